//! A full disk, SIGTERM and Ctrl-C at any moment: nothing half-written stays, and the next run goes on.
#![cfg(unix)]

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::common::{borrow, command, folder, names, read_exr, succeed, text, without_remarks};

fn one_frame(out: &Path) -> Vec<String> {
    let list = ["--size", "32", "--frames", "2", "--device", "cpu", "--out", text(out)];
    list.map(String::from).to_vec()
}

/// Bakes where no file may have more blocks of 512 bytes than that.
fn limited(blocks: u32, out: &Path) -> Output {
    let script = format!("ulimit -f {blocks}; exec \"$0\" \"$@\"");
    let mut sh = Command::new("sh");
    sh.args(["-c", &script]).arg(command().get_program()).args(one_frame(out));
    sh.env_remove("VRTM_DEVICE").env_remove("VRTM_THREADS").output().expect("sh runs")
}

/// True if a file can be read back.
fn is_whole(path: &Path) -> bool {
    match path.extension().and_then(|end| end.to_str()) {
        Some("exr") => exr::prelude::read_first_flat_layer_from_file(path).is_ok(),
        // Of a film, `open` reads the first picture alone.
        Some("png") => {
            image::open(path).is_ok() && fs::read(path).unwrap().ends_with(b"\0\0\0\0IEND\xaeB`\x82")
        }
        _ => serde_json::from_slice::<serde_json::Value>(&fs::read(path).unwrap()).is_ok(),
    }
}

#[test]
fn a_full_disk_leaves_no_damaged_file() {
    let reference = folder("full_reference");
    succeed(&borrow(&one_frame(&reference)));
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
            let output = without_remarks(limited(blocks, &out));
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

/// All frames of the built-in scene: they take long enough for a signal to come in the middle.
fn all_frames(out: &Path) -> Vec<String> {
    let list = ["--size", "256", "--no-sheet", "--no-film", "--device", "cpu", "--out", text(out)];
    list.map(String::from).to_vec()
}

fn start(out: &Path) -> Child {
    let mut command = command();
    command.args(all_frames(out)).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().expect("bake starts")
}

fn send(signal: &str, child: &Child) {
    let status = Command::new("kill").args([signal, &child.id().to_string()]).status().expect("kill runs");
    assert!(status.success());
}

/// True if a file is being written, or is there already.
fn has(out: &Path, ending: &str) -> bool {
    names(out).iter().any(|name| name.ends_with(ending))
}

#[test]
fn a_signal_leaves_whole_files_alone_and_the_next_run_goes_on() {
    let reference = folder("signal_reference");
    succeed(&borrow(&all_frames(&reference)));
    let out = folder("signal");
    let mut halfway = 0;
    for (round, (signal, code)) in [("-TERM", 143), ("-INT", 130)].into_iter().cycle().take(12).enumerate() {
        let _ = fs::remove_dir_all(&out);
        let mut child = start(&out);
        // At once when a temporary file is there, or some time after a frame is done.
        let awaited = if round < 6 { ".part" } else { ".exr" };
        let limit = Instant::now() + Duration::from_secs(60);
        while !has(&out, awaited) && child.try_wait().expect("a status").is_none() {
            assert!(Instant::now() < limit, "no {awaited}");
        }
        thread::sleep(Duration::from_millis(7 * (round as u64 % 6)));
        send(signal, &child);
        let status = child.wait().expect("bake ends");
        assert_eq!(status.code(), Some(code), "{status}");
        let left = names(&out);
        assert!(!has(&out, ".part"), "{left:?}");
        assert!(!left.contains(&"report.json".to_string()), "it was done before the signal came");
        halfway += usize::from(!left.is_empty());
        for name in left {
            let path = out.join(&name);
            read_exr(&path);
            assert_eq!(fs::read(&path).unwrap(), fs::read(reference.join(&name)).unwrap(), "{name}");
        }
    }
    assert!(halfway > 0, "each signal came before the first frame");
    succeed(&borrow(&all_frames(&out)));
    assert_eq!(names(&out), names(&reference));
}
