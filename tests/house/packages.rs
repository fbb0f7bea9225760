//! What `cargo package` packs of the library: its sources alone. Other packages have its version.

use std::process::Command;
use std::{fs, path::Path};

const PACKAGES: [&str; 8] =
    ["vrtm", "vrtm-beyond", "vrtm-carry", "vrtm-core", "vrtm-cpu", "vrtm-gpu", "vrtm-refine", "vrtm-shaders"];

fn cargo(arguments: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO"));
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    let output = command.args(arguments).arg("--offline").current_dir(root).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn packages_hold_their_sources() {
    let known =
        [".cargo_vcs_info.json", "CHANGELOG.md", "Cargo.lock", "Cargo.toml", "Cargo.toml.orig", "README.md"];
    for package in PACKAGES {
        let text = cargo(&["package", "--list", "--allow-dirty", "--package", package]).replace('\\', "/");
        assert!(text.lines().any(|file| file.ends_with("lib.rs")), "{package}: {text}");
        for own in ["README.md", "LICENSE-APACHE", "LICENSE-MIT"] {
            assert!(text.lines().any(|file| file == own), "{package} would be packed without {own}");
        }
        let is_source = |file: &&str| file.starts_with("src/") || package == "vrtm-shaders";
        for file in text.lines().filter(|file| !is_source(file)) {
            assert!(
                known.contains(&file) || file.starts_with("LICENSE-") || file == "build.rs",
                "{package} would be packed with {file}"
            );
        }
    }
}

/// A plug-in of the compiler works for a moment, and is as long in optimisation as what it works for.
#[test]
fn plug_ins_of_the_compiler_are_not_optimised() {
    let edges =
        ["tree", "--package", "vrtm-c", "--package", "vrtm-web", "--target", "all", "--prefix", "none"];
    let tree = cargo(&[&edges[..], &["--edges", "normal,build"]].concat());
    let names: Vec<&str> = tree
        .lines()
        .filter(|line| line.contains("(proc-macro)"))
        .filter_map(|line| line.split(' ').next())
        .collect();
    assert!(names.len() > 5, "{tree}");
    let profiles = include_str!("../../Cargo.toml");
    let dist = profiles
        .split("[profile.dist.package]")
        .nth(1)
        .and_then(|dist| dist.split("[profile").next())
        .unwrap();
    for name in names {
        assert!(dist.contains(&format!("\n{name}.opt-level = 0\n")), "profile dist optimises {name}");
    }
}

#[test]
fn packages_of_other_languages_have_the_library_s_version() {
    let version = env!("CARGO_PKG_VERSION");
    for (file, line) in [
        ("CITATION.cff", format!("\nversion: {version}\n")),
        ("bindings/blender/vrtm_blender/blender_manifest.toml", format!("\nversion = \"{version}\"\n")),
        ("bindings/vcpkg/vrtm/vcpkg.json", format!("\n  \"version\": \"{version}\",\n")),
        ("bindings/web/package.json", format!("\n  \"version\": \"{version}\",\n")),
        ("Cargo.toml", format!("\nvrtm-core = {{ path = \"crates/core\", version = \"={version}\" }}\n")),
    ] {
        let text =
            fs::read_to_string(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join(file)).unwrap();
        assert!(text.contains(&line), "{file} has not {line:?}");
    }
}
