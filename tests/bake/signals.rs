//! SIGTERM and Ctrl-C at any moment: nothing half-written stays, and the next run goes on.
#![cfg(unix)]

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::common::{channels, command, folder, names, succeed, text};

/// All frames of the built-in scene: they take long enough for a signal to come in the middle.
fn arguments(out: &Path) -> Vec<String> {
    let list = ["--size", "256", "--no-sheet", "--device", "cpu", "--out", text(out)];
    list.map(String::from).to_vec()
}

fn start(out: &Path) -> Child {
    let mut command = command();
    command.args(arguments(out)).stdout(Stdio::null()).stderr(Stdio::null());
    command.spawn().expect("bake starts")
}

fn send(signal: &str, child: &Child) {
    let status = Command::new("kill").args([signal, &child.id().to_string()]).status().expect("kill runs");
    assert!(status.success());
}

/// Whether a file is being written, or is there already.
fn has(out: &Path, ending: &str) -> bool {
    names(out).iter().any(|name| name.ends_with(ending))
}

#[test]
fn a_signal_leaves_whole_files_alone_and_the_next_run_goes_on() {
    let reference = folder("signal_reference");
    succeed(&arguments(&reference).iter().map(String::as_str).collect::<Vec<_>>());
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
            channels::<3>(&path, ["B", "G", "R"]);
            assert_eq!(fs::read(&path).unwrap(), fs::read(reference.join(&name)).unwrap(), "{name}");
        }
    }
    assert!(halfway > 0, "each signal came before the first frame");
    succeed(&arguments(&out).iter().map(String::as_str).collect::<Vec<_>>());
    assert_eq!(names(&out), names(&reference));
}
