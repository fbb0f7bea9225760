//! Programs that were compiled against the first header run with this library: tests/abi/vrtm-0.1.txt lists the sizes,
//! offsets, values and signatures that it promised. Structs may have grown at their end only.

#![cfg(all(any(unix, all(windows, target_env = "gnu")), target_pointer_width = "64"))]

use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::tools::{compiler, program, root, scratch, text};

/// A header up to what is experimental in it, which promises nothing, without comments.
fn promised(header: &str) -> String {
    let promised = header.split_once("/* ==== Experimental").map_or(header, |(promised, _)| promised);
    promised
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
        .fold(String::new(), |text, line| text + line + "\n")
}

/// The structs of a header: their names, and their fields as declared.
fn structs(header: &str) -> Vec<(&str, Vec<&str>)> {
    let parts = header.split("\ntypedef struct ").skip(1).filter_map(|part| part.split_once(" {\n"));
    parts
        .map(|(name, rest)| (name, &rest[..rest.find("\n}").unwrap()]))
        .map(|(name, body)| {
            (name, body.split(';').map(str::trim).filter(|field| !field.is_empty()).collect())
        })
        .collect()
}

/// The name of a field, and its type as a pointer to it.
fn field(declaration: &str) -> (&str, String) {
    let at = declaration.rfind([' ', '*']).unwrap() + 1;
    let (kind, name) = (declaration[..at].trim(), &declaration[at..]);
    match name.split_once('[') {
        Some((name, length)) => (name, format!("{kind} (*)[{length}")),
        None => (name, format!("{kind} *")),
    }
}

/// Runs the C compiler; the error is what it says.
fn compile(source: &str, name: &str, arguments: &[&str]) -> Result<(), String> {
    let file = scratch().join(format!("{name}.c"));
    std::fs::write(&file, source).unwrap();
    let mut command = Command::new(compiler("c"));
    command.args(["-std=c11", "-Wall", "-Wextra", "-pedantic", "-Werror", "-Wno-unused-function"]);
    let output = command.arg(&file).args(arguments).output().unwrap();
    if output.status.success() { Ok(()) } else { Err(text(&output)) }
}

/// The table of a header. A line of a struct is `name size: offset declaration, ...`, with >= before a size that may
/// grow.
fn table(header: &Path) -> String {
    let text = promised(&std::fs::read_to_string(header).unwrap());
    let mut lines =
        vec!["# What vrtm.h promises from 0.1 on, for 64 bits: written by tests/c_api/abi.rs.".to_owned()];
    let constants = text.lines().filter_map(|line| line.strip_prefix("#define VRTM_")?.split_once(' '));
    for (name, value) in constants {
        if !name.starts_with("VERSION") && !name.starts_with("API") && !name.contains('(') {
            lines.push(format!("VRTM_{name} = {value}"));
        }
    }
    // Types and functions as they are declared.
    for declaration in text.split("\n\n").flat_map(|part| part.split(";\n")).map(str::trim) {
        let words = declaration.split_whitespace().collect::<Vec<_>>().join(" ");
        let is_type = words.starts_with("typedef ") && !words.starts_with("typedef struct");
        match words.strip_prefix("VRTM_API ") {
            Some(function) => lines.push(format!("{};", function.trim_end_matches(';'))),
            None if is_type => lines.push(format!("{};", words.trim_end_matches(';'))),
            None => {}
        }
    }
    // Sizes and offsets are what a program prints that is compiled with the header.
    let mut printer = format!(
        "#include \"{}\"\n#include <stddef.h>\n#include <stdio.h>\nint main(void)\n{{\n",
        header.display()
    );
    for (name, fields) in structs(&text) {
        let relation = if fields[0] == "uint32_t struct_size" { ">=" } else { "==" };
        writeln!(printer, "printf(\"struct {name} {relation} %zu:\", sizeof({name}));").unwrap();
        for (k, declaration) in fields.iter().enumerate() {
            let comma = if k > 0 { "," } else { "" };
            let name_of = field(declaration).0;
            writeln!(printer, "printf(\"{comma} %zu {declaration}\", offsetof({name}, {name_of}));").unwrap();
        }
        printer.push_str("puts(\"\");\n");
    }
    let built = program("abi_printer");
    compile(&(printer + "return 0;\n}\n"), "abi_printer", &["-o", built.to_str().unwrap()]).unwrap();
    let printed = String::from_utf8(Command::new(built).output().unwrap().stdout).unwrap();
    lines.extend(printed.lines().map(str::to_owned));
    lines.iter().map(|line| wrapped(line)).collect()
}

/// A line of the table; what does not fit the page goes on in lines with an indent.
fn wrapped(line: &str) -> String {
    let (mut text, mut length) = (String::new(), 0);
    for word in line.split_inclusive(", ") {
        if length + word.len() > 120 {
            text = text.trim_end().to_owned() + "\n    ";
            length = 4;
        }
        text += word;
        length += word.len();
    }
    text + "\n"
}

/// Holds a header against a table; the error is the compiler's.
fn compare(table: &str, header: &Path, name: &str) -> Result<(), String> {
    let mut source = format!("#include \"{}\"\n#include <stddef.h>\n", header.display());
    let (mut used, mut declared) = (String::new(), String::new());
    for line in table.replace("\n    ", " ").lines().filter(|line| !line.starts_with('#')) {
        if let Some(rest) = line.strip_prefix("struct ") {
            let (head, fields) = rest.split_once(": ").unwrap();
            let (of, size) = head.split_once(' ').unwrap();
            writeln!(source, "_Static_assert(sizeof({of}) {size}, \"{of}\");").unwrap();
            for (offset, declaration) in fields.split(", ").map(|field| field.split_once(' ').unwrap()) {
                let (field, kind) = field(declaration);
                writeln!(
                    source,
                    "_Static_assert(offsetof({of}, {field}) == {offset} && \
                    _Generic(&(({of} *)0)->{field}, {kind}: 1, default: 0), \"{of}.{field}\");"
                )
                .unwrap();
            }
        } else if let Some((constant, value)) = line.split_once(" = ") {
            writeln!(source, "_Static_assert({constant} == {value}, \"{constant}\");").unwrap();
        } else if line.starts_with("typedef ") {
            let head = line
                .split_once("(*")
                .map_or(line.trim_end_matches(';'), |(_, rest)| rest.split_once(')').unwrap().0);
            writeln!(used, "(void)sizeof({});", head.rsplit(' ').next().unwrap()).unwrap();
            writeln!(declared, "{line}").unwrap();
        } else {
            let head = line.split_once('(').unwrap().0;
            writeln!(used, "(void)&{};", head.rsplit([' ', '*']).next().unwrap()).unwrap();
            writeln!(declared, "{line}").unwrap();
        }
    }
    // A compiler takes types and functions that are declared twice only if they are the same.
    compile(&format!("{source}static void used(void)\n{{\n{used}}}\n{declared}"), name, &["-fsyntax-only"])
}

fn frozen() -> PathBuf {
    root().join("tests/abi/vrtm-0.1.txt")
}

/// VRTM_UPDATE_ABI=1 writes the table again, which is for before 0.1.0 alone.
#[test]
fn the_header_keeps_what_the_first_one_promised() {
    let header = root().join("include/vrtm.h");
    if std::env::var_os("VRTM_UPDATE_ABI").is_some() {
        std::fs::write(frozen(), table(&header)).unwrap();
    }
    let table = std::fs::read_to_string(frozen()).unwrap();
    assert!(table.lines().count() > 150, "only {} lines", table.lines().count());
    compare(&table, &header, "abi_today").unwrap();
}

/// The comparison finds each change that would break a compiled program, and lets structs grow.
#[test]
fn changes_that_break_programs_are_found() {
    let table = std::fs::read_to_string(frozen()).unwrap();
    let today = std::fs::read_to_string(root().join("include/vrtm.h")).unwrap();
    let changed = |name: &str, from: &str, to: &str| {
        let changed = today.replacen(from, to, 1);
        assert!(changed != today, "{from:?} is not in the header");
        let header = scratch().join(format!("{name}.h"));
        std::fs::write(&header, changed).unwrap();
        compare(&table, &header, name)
    };
    for (name, from, to) in [
        ("abi_type", "    uint32_t charts_reused;", "    float charts_reused;"),
        ("abi_moved", "    vrtm_backend backend;", "    uint64_t before;\n    vrtm_backend backend;"),
        ("abi_removed", "    uint32_t charts_reused;\n", "    uint32_t something_else;\n"),
        ("abi_array", "    char reason[", "    char reason[2 * "),
        ("abi_constant", "#define VRTM_ERROR_BUSY 6", "#define VRTM_ERROR_BUSY 7"),
        ("abi_parameter", "vrtm_asset_get_info(vrtm_asset asset,", "vrtm_asset_get_info(vrtm_tile asset,"),
        ("abi_function", "vrtm_status vrtm_asset_solve(", "vrtm_status vrtm_asset_solve_now("),
        ("abi_typedef", "typedef int32_t vrtm_status;", "typedef int64_t vrtm_status;"),
        ("abi_fixed_struct", "} vrtm_uv_set;", "    int more;\n} vrtm_uv_set;"),
    ] {
        assert!(changed(name, from, to).is_err(), "{from:?} may become {to:?} and nothing tells");
    }
    changed("abi_grown", "} vrtm_tile_report;", "    uint64_t more;\n} vrtm_tile_report;").unwrap();
}
