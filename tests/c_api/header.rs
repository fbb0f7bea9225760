//! The C header matches the library: its text is up to date, every exported symbol is declared, and it compiles as C
//! and as C++.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

use object::{Object, ObjectSymbol};

mod generate;
mod mirrored;

use crate::tools::{compiler, library, root, scratch};

/// The header as `capi/src` has it now; `include/vrtm.h` is a committed copy.
static GENERATED: LazyLock<String> = LazyLock::new(|| generate::header(root()).unwrap());

fn committed() -> PathBuf {
    root().join("include/vrtm.h")
}

#[test]
fn the_committed_header_is_the_generated_one() {
    if std::env::var_os("VRTM_UPDATE_HEADER").is_some() {
        std::fs::write(committed(), GENERATED.as_str()).unwrap();
    }
    let text = std::fs::read_to_string(committed()).unwrap_or_default();
    let line = text.lines().zip(GENERATED.lines()).position(|(a, b)| a != b);
    assert!(
        text == *GENERATED,
        "include/vrtm.h differs from capi/src (first in line {:?}): VRTM_UPDATE_HEADER=1 cargo test --test c_api header::",
        line.map(|n| n + 1)
    );
}

#[test]
fn the_page_of_settings_is_the_generated_one() {
    let page = mirrored::Words::read(root()).unwrap().page().unwrap();
    let path = root().join("docs/settings.md");
    if std::env::var_os("VRTM_UPDATE_HEADER").is_some() {
        std::fs::write(&path, &page).unwrap();
    }
    let text = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        text == page,
        "docs/settings.md is out of date: VRTM_UPDATE_HEADER=1 cargo test --test c_api header::"
    );
}

/// Names declared as `VRTM_API type name(`, without comments.
fn declared(header: &str) -> BTreeSet<String> {
    let code: String = header
        .split("/*")
        .enumerate()
        .map(|(i, part)| if i == 0 { part } else { part.split_once("*/").map_or("", |(_, code)| code) })
        .flat_map(|part| part.lines().map(|line| line.split("//").next().unwrap_or("")))
        .filter(|line| !line.starts_with('#'))
        .collect::<Vec<_>>()
        .join(" ");
    code.split("VRTM_API")
        .skip(1)
        .filter_map(|declaration| declaration.split_once('('))
        .filter_map(|(head, _)| head.split_whitespace().last())
        .map(|name| name.trim_start_matches('*').to_owned())
        .collect()
}

/// The symbols that the dynamic linker finds in a library.
fn exported(library: &Path) -> BTreeSet<String> {
    let bytes = std::fs::read(library).unwrap();
    let file = object::File::parse(&*bytes).unwrap();
    match file.format() {
        object::BinaryFormat::Elf => file
            .dynamic_symbols()
            .filter(|symbol| symbol.is_definition() && symbol.is_global())
            .map(|symbol| symbol.name().unwrap().to_owned())
            .collect(),
        _ => (file.exports().unwrap().iter())
            .map(|export| String::from_utf8_lossy(export.name()).trim_start_matches('_').to_owned())
            .collect(),
    }
}

#[test]
fn the_library_exports_what_the_header_declares_and_nothing_else() {
    let declared = declared(&GENERATED);
    let exported = exported(&library());
    assert!(declared.len() >= 26, "only {} declarations found", declared.len());
    let undeclared: Vec<_> = exported.difference(&declared).collect();
    assert!(undeclared.is_empty(), "exported, but not in vrtm.h: {undeclared:?}");
    let missing: Vec<_> = declared.difference(&exported).collect();
    assert!(missing.is_empty(), "in vrtm.h, but not exported: {missing:?}");
    assert!(exported.iter().all(|name| name.starts_with("vrtm_")));
}

#[test]
fn every_struct_with_a_size_has_an_initialiser() {
    let mut count = 0;
    for part in GENERATED.split("typedef struct ").skip(1) {
        let (name, body) = part.split_once(" {").unwrap();
        let body = body.split_once("\n}").unwrap().0;
        if body.contains("struct_size") {
            let first = body.lines().find(|line| !line.trim().is_empty() && !line.contains("//"));
            assert_eq!(first.map(str::trim), Some("uint32_t struct_size;"), "{name}");
            let forms = [format!("\nVRTM_DEFINE_INIT_({name})"), format!("\nVRTM_DEFINE_INIT_WITH_({name},")];
            assert!(forms.iter().any(|form| GENERATED.contains(form)), "{name} has no initialiser");
            count += 1;
        }
    }
    assert!(count >= 14, "only {count} structs found");
}

/// The defaults that initialisers set are those of the library, and the fields' comments tell them.
#[test]
fn initialisers_set_the_defaults() {
    use vrtm_capi::{mesh::vrtm_mesh_desc, refine::vrtm_refinement_desc};
    use vrtm_capi::{solve::vrtm_solve_options, tile::vrtm_tile_settings};
    let (mesh, tile) = (vrtm_mesh_desc::default(), vrtm_tile_settings::default());
    let (pbd, refinement) = (vrtm_solve_options::default().pbd, vrtm_refinement_desc::default());
    let single = f64::from;
    let fields = [
        ("vrtm_mesh_desc", "", "weld_position_tolerance", mesh.weld_position_tolerance),
        ("vrtm_mesh_desc", "", "weld_uv_tolerance", mesh.weld_uv_tolerance),
        ("vrtm_tile_settings", "", "smoothness", single(tile.smoothness)),
        ("vrtm_tile_settings", "", "smoothness_floor", single(tile.smoothness_floor)),
        ("vrtm_tile_settings", "", "room", single(tile.room)),
        ("vrtm_tile_settings", "", "room_threshold", single(tile.room_threshold)),
        ("vrtm_tile_settings", "", "seam_reach", single(tile.seam_reach)),
        ("vrtm_tile_settings", "", "harm", single(tile.harm)),
        ("vrtm_solve_options", "pbd.", "iterations", f64::from(pbd.iterations)),
        ("vrtm_solve_options", "pbd.", "smoothing", single(pbd.smoothing)),
        ("vrtm_solve_options", "pbd.", "coarse_correction", single(pbd.coarse_correction)),
        ("vrtm_refinement_desc", "", "tolerance", refinement.tolerance),
    ];
    let zeros = [tile.orientation, tile.orientation_density, pbd.damping, pbd.orientation_preservation];
    assert!(zeros.iter().all(|value| *value == 0.0));
    assert_eq!(GENERATED.matches("    value.").count(), fields.len() + 1, "the size, and these");
    for (of, path, field, default) in fields {
        let (_, body) = GENERATED.split_once(&format!("VRTM_DEFINE_INIT_WITH_({of},\n")).unwrap();
        let (body, _) = body.split_once(')').unwrap();
        let (_, text) = body.split_once(&format!("value.{path}{field} = ")).unwrap();
        let text = text.split_once(';').unwrap().0;
        let number = match (text.strip_suffix('f'), text.split_once(" / ")) {
            (Some(text), _) => single(text.parse::<f32>().unwrap()),
            (None, Some((over, under))) => over.parse::<f64>().unwrap() / under.parse::<f64>().unwrap(),
            (None, None) => text.parse().unwrap(),
        };
        assert_eq!(number, default, "{of}.{path}{field}");
        let holder = if path.is_empty() { of } else { "vrtm_pbd_settings" };
        let (_, body) = GENERATED.split_once(&format!("typedef struct {holder} {{")).unwrap();
        let above = body.split_once(&format!(" {field};")).unwrap().0.lines().rev().skip(1);
        let comment: Vec<_> = above.map_while(|line| line.strip_prefix("    // ")).collect();
        let comment = comment.into_iter().rev().collect::<Vec<_>>().join(" ");
        let told =
            format!("efault {}", text.trim_end_matches(".0f").trim_end_matches('f').replace("1.0 / ", "1/"));
        assert!(comment.contains(&told), "{holder}.{field}: {told:?} is not in {comment:?}");
    }
}

#[test]
fn every_line_fits_the_page() {
    for (number, line) in GENERATED.lines().enumerate() {
        assert!(line.len() <= 120, "line {} has {} characters", number + 1, line.len());
    }
}

#[cfg(any(unix, all(windows, target_env = "gnu")))]
fn compile(name: &str, text: &str, language: &str, options: &[&str]) {
    let file = scratch().join(name);
    std::fs::write(&file, text).unwrap();
    let output = Command::new(compiler(language))
        .args(["-fsyntax-only", "-Wall", "-Wextra", "-pedantic", "-Werror", "-Wconversion"])
        .args(["-Wshadow", "-Wstrict-aliasing"])
        .args(options)
        .arg("-I")
        .arg(root().join("include"))
        .arg(&file)
        .output()
        .unwrap();
    assert!(output.status.success(), "{name} {options:?}:\n{}", String::from_utf8_lossy(&output.stderr));
}

#[cfg(any(unix, all(windows, target_env = "gnu")))] // The flags are those of gcc and clang.
#[test]
fn the_header_compiles_as_c11() {
    // Included twice, the header has a working guard. Included alone, it needs no header before it.
    compile(
        "alone.c",
        "#include \"vrtm.h\"\n#include \"vrtm.h\"\nint main(void) { return 0; }\n",
        "c",
        &["-std=c11"],
    );
}

#[cfg(any(unix, all(windows, target_env = "gnu")))]
#[test]
fn the_headers_compile_as_cpp() {
    let alone = "#include \"vrtm.h\"\n#include \"vrtm.h\"\nint main() { return 0; }\n";
    compile("alone.cpp", alone, "cpp", &["-std=c++17"]);
    let wrapper = "#include \"vrtm.hpp\"\n#include \"vrtm.hpp\"\nint main() { return 0; }\n";
    for standard in ["-std=c++17", "-std=c++20"] {
        compile("raii.cpp", wrapper, "cpp", &[standard]);
        compile("raii.cpp", wrapper, "cpp", &[standard, "-fno-exceptions", "-fno-rtti"]);
    }
}
