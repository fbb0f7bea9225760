//! What `cargo package` packs of the library: its sources alone. Other packages have its version.

use std::process::Command;
use std::{fs, path::Path};

const PACKAGES: [&str; 8] =
    ["vrtm", "vrtm-beyond", "vrtm-carry", "vrtm-core", "vrtm-cpu", "vrtm-gpu", "vrtm-refine", "vrtm-shaders"];

#[test]
fn packages_hold_their_sources() {
    let known =
        [".cargo_vcs_info.json", "CHANGELOG.md", "Cargo.lock", "Cargo.toml", "Cargo.toml.orig", "README.md"];
    for package in PACKAGES {
        let output = Command::new(env!("CARGO"))
            .args(["package", "--list", "--allow-dirty", "--offline", "--package", package])
            .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
            .output()
            .unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let text = String::from_utf8(output.stdout).unwrap().replace('\\', "/");
        assert!(text.lines().any(|file| file.ends_with("lib.rs")), "{package}: {text}");
        let is_source = |file: &&str| file.starts_with("src/") || package == "vrtm-shaders";
        for file in text.lines().filter(|file| !is_source(file)) {
            assert!(
                known.contains(&file) || file.starts_with("LICENSE-") || file == "build.rs",
                "{package} would be packed with {file}"
            );
        }
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
        ("Cargo.toml", format!("\nvrtm-core = {{ path = \"crates/core\", version = \"{version}\" }}\n")),
    ] {
        let text =
            fs::read_to_string(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join(file)).unwrap();
        assert!(text.contains(&line), "{file} has not {line:?}");
    }
}
