//! A disk that is full: the exit code tells, and no damaged file has a final name.
#![cfg(unix)]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use crate::common::{command, folder, names, succeed, text};

fn arguments(out: &Path) -> Vec<String> {
    let list = ["--size", "32", "--frames", "2", "--device", "cpu", "--out", text(out)];
    list.map(String::from).to_vec()
}

/// Bakes where no file may have more blocks of 512 bytes than that.
fn limited(blocks: u32, out: &Path) -> Output {
    let script = format!("ulimit -f {blocks}; exec \"$0\" \"$@\"");
    let mut sh = Command::new("sh");
    sh.args(["-c", &script]).arg(command().get_program()).args(arguments(out));
    sh.env_remove("VRTM_DEVICE").env_remove("VRTM_THREADS").output().expect("sh runs")
}

/// Whether a file can be read back.
fn is_whole(path: &Path) -> bool {
    match path.extension().and_then(|end| end.to_str()) {
        Some("exr") => exr::prelude::read_first_flat_layer_from_file(path).is_ok(),
        Some("png") => image::open(path).is_ok(),
        _ => serde_json::from_slice::<serde_json::Value>(&fs::read(path).unwrap()).is_ok(),
    }
}

#[test]
fn a_full_disk_leaves_no_damaged_file() {
    let reference = folder("full_reference");
    succeed(&arguments(&reference).iter().map(String::as_str).collect::<Vec<_>>());
    let expected = names(&reference);
    let mut codes = Vec::new();
    for blocks in [0, 2, 8, 32, 128, 16384] {
        // Into an empty folder, and over files that were cut short, as by a crash.
        for damaged in [false, true] {
            let out = folder("full");
            for name in expected.iter().filter(|name| damaged && *name != "report.json") {
                let bytes = fs::read(reference.join(name)).unwrap();
                fs::write(out.join(name), &bytes[..bytes.len() - bytes.len() / 3]).unwrap();
            }
            let output = limited(blocks, &out);
            let line = String::from_utf8(output.stderr).unwrap();
            let left = names(&out);
            match output.status.code() {
                Some(0) => assert_eq!(left, expected),
                Some(2) => {
                    assert!(line.lines().count() == 1 && line.contains(text(&out)), "{blocks}: {line}");
                    assert!(!left.iter().any(|name| name.ends_with(".part")), "{blocks}: {left:?}");
                }
                _ => panic!("{}: {line}", output.status),
            }
            for name in left {
                assert!(is_whole(&out.join(&name)), "{blocks} blocks, {damaged}: {name}");
            }
            codes.push(output.status.code().unwrap());
        }
    }
    assert!(codes.starts_with(&[2, 2]) && codes.ends_with(&[0, 0]), "{codes:?}");
}
