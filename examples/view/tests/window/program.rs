//! The program in its window, driven from outside.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::screen::Server;

/// Longest wait for one event: a software driver on a busy machine.
const PATIENCE: Duration = Duration::from_secs(90);

/// A running program and its record.
pub struct Program {
    child: Child,
    display: String,
    trace: PathBuf,
    /// Events that were waited for, and those before them.
    passed: usize,
}

/// True if a program is in the path.
pub fn is_there(name: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|folder| folder.join(name).is_file())
}

impl Program {
    /// Starts it in a folder.
    pub fn start(server: &Server, folder: &Path, options: &[&str]) -> Program {
        let trace = folder.join("trace.jsonl");
        let _ = std::fs::remove_file(&trace);
        let child = Command::new(env!("CARGO_BIN_EXE_vrtm-view"))
            .args(options)
            .arg("--trace")
            .arg(&trace)
            .current_dir(folder)
            .env("DISPLAY", &server.display)
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            // No desktop's portal, and dialogs of a program that a test puts there.
            .env_remove("DBUS_SESSION_BUS_ADDRESS")
            .env("PATH", folder.join("bin"))
            .stdout(Stdio::null())
            .stderr(Stdio::inherit())
            .spawn()
            .expect("the program starts");
        let mut program = Program { child, display: server.display.clone(), trace, passed: 0 };
        // Before the window is on the screen, clicks are lost.
        program.wait("layout", |_| true);
        program.passed = 0;
        program.xdotool(&["search", "--sync", "--onlyvisible", "--name", "^vrtm", "sleep", "0.5"]);
        program
    }

    /// All events so far.
    pub fn events(&self) -> impl Iterator<Item = Value> + use<> {
        let text = std::fs::read_to_string(&self.trace).unwrap_or_default();
        let lines: Vec<_> = text.lines().map(str::to_string).collect();
        // The last line may be half written.
        lines.into_iter().filter_map(|line| serde_json::from_str(&line).ok())
    }

    /// Waits for an event after those that were waited for before.
    pub fn wait(&mut self, name: &str, fits: impl Fn(&Value) -> bool) -> Value {
        let start = Instant::now();
        loop {
            let found = self
                .events()
                .enumerate()
                .skip(self.passed)
                .find(|(_, event)| event["event"] == name && fits(event));
            if let Some((k, event)) = found {
                // Of what follows a solve, its picture may come in the same moment.
                self.passed = k + 1;
                return event;
            }
            if let Ok(Some(status)) = self.child.try_wait() {
                panic!("the program ended with {status} before \"{name}\"");
            }
            if start.elapsed() > PATIENCE {
                let last: Vec<_> = self.events().filter(|event| event["event"] != "layout").collect();
                let last = &last[last.len().saturating_sub(6)..];
                panic!("no such \"{name}\" in {PATIENCE:?}; the last events were {last:#?}");
            }
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    /// Place of a widget now: left, top, right, bottom in pixels.
    pub fn widget(&self, name: &str) -> [u32; 4] {
        let layouts: Vec<_> = self.events().filter(|event| event["event"] == "layout").collect();
        let rect = layouts.last().map(|event| event["widgets"][name].clone()).unwrap_or_default();
        assert!(rect.is_array(), "no widget \"{name}\"");
        [0, 1, 2, 3].map(|k| rect[k].as_f64().expect("a number") as u32)
    }

    /// Clicks on a widget, once it stays where it is.
    pub fn click(&mut self, name: &str) {
        let mut place = self.widget(name);
        loop {
            std::thread::sleep(Duration::from_millis(300));
            let now = self.widget(name);
            if now == place {
                break;
            }
            place = now;
        }
        let [left, top, right, bottom] = place;
        let [x, y] = [(left + right) / 2, (top + bottom) / 2].map(|x| x.to_string());
        self.xdotool(&[
            "mousemove",
            &x,
            &y,
            "sleep",
            "0.15",
            "mousedown",
            "1",
            "sleep",
            "0.15",
            "mouseup",
            "1",
        ]);
        // What only the mouse over a widget shows goes away. A move in the same pass over the window would undo the
        // click.
        std::thread::sleep(Duration::from_millis(400));
        self.move_away();
    }

    /// Drags from the first point through all others.
    pub fn drag(&mut self, points: &[[u32; 2]]) {
        let mut words: Vec<String> = Vec::new();
        for (k, point) in points.iter().enumerate() {
            words.extend(["mousemove".into(), point[0].to_string(), point[1].to_string()]);
            words.extend(["sleep".into(), "0.06".into()]);
            if k == 0 {
                words.extend(["mousedown".into(), "1".into(), "sleep".into(), "0.1".into()]);
            }
        }
        words.extend(["sleep", "0.1", "mouseup", "1"].map(String::from));
        self.xdotool(&words.iter().map(String::as_str).collect::<Vec<_>>());
    }

    /// Moves the mouse to where it touches nothing: the line at the bottom.
    pub fn move_away(&self) {
        self.xdotool(&["mousemove", "700", "612", "sleep", "0.1"]);
    }

    /// Closes the window by its key; the program must end by itself.
    pub fn quit(mut self) {
        self.xdotool(&[
            "search",
            "--onlyvisible",
            "--name",
            "^vrtm",
            "windowfocus",
            "sleep",
            "0.2",
            "key",
            "ctrl+q",
        ]);
        let start = Instant::now();
        let status = loop {
            match self.child.try_wait().expect("a status") {
                Some(status) => break status,
                None if start.elapsed() > PATIENCE => panic!("the window does not close"),
                None => std::thread::sleep(Duration::from_millis(30)),
            }
        };
        assert!(status.success(), "{status}");
        assert_eq!(self.events().last().map(|event| event["event"].clone()), Some("close".into()));
    }

    fn xdotool(&self, words: &[&str]) {
        let done = Command::new("xdotool").args(words).env("DISPLAY", &self.display).status();
        assert!(done.expect("xdotool starts").success(), "xdotool {words:?}");
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
