//! Programs that were compiled against the first header run with this library. `tests/abi/` has a copy of that header
//! and a program from its time, both never changed: the program is compiled, linked and run, and each declaration of
//! the copy is held against today's header, whose structs may have grown at their end only.

#![cfg(any(unix, all(windows, target_env = "gnu")))] // The compiler's flags are those of gcc and clang.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::tools::{self, compiler, link_arguments, root, scratch, search_path, system_libraries};

/// Number of functions of the first header, and the hashes (XXH3, 64 bits) of that header and of the program.
const FUNCTIONS: usize = 42;
const HEADER_HASH: u64 = 0xe443_bd60_da28_e12d;
const PROGRAM_HASH: u64 = 0x43a7_1ebc_e248_45bd;

fn frozen() -> PathBuf {
    root().join("tests/abi/vrtm-0.1.h")
}

/// The first header up to what was experimental in it, which promised nothing.
fn promised() -> String {
    read(&frozen()).split_once("/* ==== Experimental").unwrap().0.to_owned()
}

fn program() -> PathBuf {
    root().join("tests/abi/host-0.1.c")
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Runs the C compiler and returns its messages, or an error with them.
fn compile(source: &Path, arguments: &[impl AsRef<OsStr>]) -> Result<(), String> {
    let output = Command::new(compiler("c"))
        .args(["-std=c11", "-Wall", "-Wextra", "-pedantic", "-Werror", "-Wno-unused-function"])
        .arg(source)
        .args(arguments)
        .output()
        .unwrap();
    match output.status.success() {
        true => Ok(()),
        false => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
    }
}

fn run(program: &Path) -> String {
    let output = Command::new(program)
        .env_remove("VRTM_DEVICE")
        .env_remove("VRTM_THREADS")
        .env("XDG_RUNTIME_DIR", scratch())
        .env("PATH", search_path())
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{said}{}", String::from_utf8_lossy(&output.stderr));
    said
}

#[test]
fn the_first_header_and_its_program_are_as_they_were() {
    for (path, hash) in [(frozen(), HEADER_HASH), (program(), PROGRAM_HASH)] {
        let found = xxhash_rust::xxh3::xxh3_64(&std::fs::read(&path).unwrap());
        assert_eq!(found, hash, "{} was changed: {found:#x}", path.display());
    }
}

#[test]
fn a_program_of_the_first_version_runs() {
    let built = tools::program("abi_host");
    let mut arguments = vec!["-o".into(), built.clone().into_os_string()];
    arguments.extend(link_arguments());
    arguments.extend(system_libraries().iter().map(OsString::from));
    compile(&program(), &arguments).unwrap();
    let said = run(&built);
    println!("{said}");
    assert!(
        said.lines().filter(|line| line.starts_with("ok ")).count() >= 50 && !said.contains("FAIL"),
        "{said}"
    );
    // It leaves no function out.
    let text = read(&program());
    let functions = functions(&promised());
    assert_eq!(functions.len(), FUNCTIONS, "{functions:?}");
    for name in functions {
        assert!(text.contains(&format!("{name}(")), "{name} is not called");
    }
}

/// Names declared as `VRTM_API type name(`, with a space or a line's end between.
fn functions(header: &str) -> Vec<String> {
    header
        .split("\nVRTM_API")
        .skip(1)
        .map(|declaration| {
            let head = declaration.split_once('(').unwrap().0;
            head.rsplit([' ', '*']).next().unwrap().to_owned()
        })
        .collect()
}

/// A header's structs: their fields' types, as pointers to them, in order.
fn structs(header: &str) -> BTreeMap<String, Vec<(String, String)>> {
    let mut structs = BTreeMap::new();
    for part in header.split("\ntypedef struct ").skip(1) {
        let (name, body) = part.split_once(" {\n").unwrap();
        let body = body.split_once("\n}").unwrap().0;
        let fields =
            body.lines().map(str::trim).filter(|line| !line.starts_with("//") && !line.is_empty()).map(
                |line| {
                    let declaration = line.strip_suffix(';').unwrap_or_else(|| panic!("{name}: {line}"));
                    let at = declaration.rfind([' ', '*']).unwrap() + 1;
                    let (kind, field) = (declaration[..at].trim(), &declaration[at..]);
                    match field.split_once('[') {
                        Some((field, length)) => (field.to_owned(), format!("{kind} (*)[{length}")),
                        None => (field.to_owned(), format!("{kind} *")),
                    }
                },
            );
        structs.insert(name.to_owned(), fields.collect());
    }
    structs
}

/// A C program that prints, as compiled against the first header, what must hold of `header`.
fn layout_printer(header: &str) -> String {
    let mut lines = vec![
        format!("#include \"{}\"", frozen().display()),
        "#include <stddef.h>\n#include <stdio.h>".to_owned(),
        "int main(void)\n{".to_owned(),
        format!("puts(\"#include \\\"{}\\\"\");", header.replace('\\', "/")),
    ];
    for (name, fields) in structs(&promised()) {
        let grows = fields[0].0 == "struct_size";
        let relation = if grows { ">=" } else { "==" };
        lines.push(format!(
            "printf(\"_Static_assert(sizeof({name}) {relation} %zu, \\\"{name}: size\\\");\\n\", sizeof({name}));"
        ));
        for (field, kind) in fields {
            lines.push(format!(
                "printf(\"_Static_assert(offsetof({name}, {field}) == %zu, \\\"{name}.{field}: offset\\\");\\n\", \
                 offsetof({name}, {field}));"
            ));
            lines.push(format!(
                "puts(\"_Static_assert(_Generic(&(({name} *)0)->{field}, {kind}: 1, default: 0), \
                 \\\"{name}.{field}: type\\\");\");"
            ));
        }
    }
    lines.push("puts(\"int main(void) { return 0; }\");\nreturn 0;\n}\n".to_owned());
    lines.join("\n")
}

/// Holds the layout of each struct of the first header against `header`; the error is the compiler's.
fn compare_layouts(name: &str, header: &Path) -> Result<String, String> {
    let printer = scratch().join(format!("abi_{name}_printer.c"));
    let built = tools::program(&format!("abi_{name}_printer"));
    std::fs::write(&printer, layout_printer(&header.display().to_string())).unwrap();
    compile(&printer, &[OsStr::new("-o"), built.as_os_str()])?;
    let assertions = run(&built);
    let source = scratch().join(format!("abi_{name}_layout.c"));
    std::fs::write(&source, format!("#include <stddef.h>\n{assertions}")).unwrap();
    compile(&source, &["-fsyntax-only"]).map(|()| assertions)
}

/// The first header without its structs and versions, to be read after another header: a compiler takes functions,
/// types and constants that are declared twice only if they are the same.
fn declarations() -> String {
    let text = promised();
    let body = text.split_once("#define VRTM_H\n").unwrap().1;
    let mut out = String::new();
    let mut rest = body;
    while let Some((before, after)) = rest.split_once("\ntypedef struct ") {
        out.push_str(before);
        rest = after.split_once("\n}").unwrap().1.split_once(';').unwrap().1;
    }
    out.push_str(rest);
    let kept = out.lines().filter(|line| !line.starts_with("#define VRTM_VERSION"));
    kept.collect::<Vec<_>>().join("\n").replace("extern \"C\" {", "")
}

fn compare_declarations(name: &str, header: &Path) -> Result<(), String> {
    let source = scratch().join(format!("abi_{name}_declarations.c"));
    let text =
        format!("#include \"{}\"\n{}\nint main(void) {{ return 0; }}\n", header.display(), declarations());
    std::fs::write(&source, text).unwrap();
    compile(&source, &["-fsyntax-only"])
}

#[test]
fn structs_have_grown_at_their_end_only() {
    let assertions = compare_layouts("today", &root().join("include/vrtm.h")).unwrap();
    assert!(assertions.lines().count() > 300, "only {} are compared", assertions.lines().count());
}

#[test]
fn functions_types_and_constants_are_those_of_the_first_header() {
    assert_eq!(functions(&declarations()).len(), FUNCTIONS);
    compare_declarations("today", &root().join("include/vrtm.h")).unwrap();
}

/// The comparison finds each of these changes, which would break a compiled program.
#[test]
fn changes_that_break_programs_are_found() {
    let today = read(&root().join("include/vrtm.h"));
    let changes = [
        ("a_type", "    uint32_t charts_reused;", "    float charts_reused;"),
        ("a_field_moved", "    vrtm_backend backend;", "    uint64_t before;\n    vrtm_backend backend;"),
        ("a_field_removed", "    uint32_t charts_reused;\n", "    uint32_t something_else;\n"),
        ("an_array", "    char reason[", "    char reason[2 * "),
        ("a_constant", "#define VRTM_ERROR_BUSY 6", "#define VRTM_ERROR_BUSY 7"),
        ("a_parameter", "vrtm_asset_get_info(vrtm_asset asset,", "vrtm_asset_get_info(vrtm_tile asset,"),
        ("a_typedef", "typedef int32_t vrtm_status;", "typedef int64_t vrtm_status;"),
        ("a_fixed_struct", "} vrtm_uv_set;", "    int more;\n} vrtm_uv_set;"),
    ];
    for (name, from, to) in changes {
        let changed = today.replace(from, to);
        assert!(changed != today, "{from:?} is not in the header");
        let header = scratch().join(format!("abi_{name}.h"));
        std::fs::write(&header, changed).unwrap();
        let found = compare_layouts(name, &header).is_err() || compare_declarations(name, &header).is_err();
        assert!(found, "{from:?} may become {to:?} and nothing tells");
    }
}
