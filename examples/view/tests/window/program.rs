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

/// Tries until there is something.
fn until<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(start.elapsed() < PATIENCE, "{what} in {PATIENCE:?}");
        std::thread::sleep(Duration::from_millis(10));
    }
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
        let program = Program { child, display: server.display.clone(), trace, passed: 0 };
        // Before the window is on the screen, clicks are lost.
        program.xdotool("search --sync --onlyvisible --name ^vrtm");
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
        let (k, event) = until(&format!("no such \"{name}\""), || {
            let ended = self.child.try_wait().expect("a status");
            let fits = |(_, event): &(usize, Value)| event["event"] == name && fits(event);
            let found = self.events().enumerate().skip(self.passed).find(fits);
            assert!(found.is_some() || ended.is_none(), "the program ended before \"{name}\": {ended:?}");
            found
        });
        // Of what follows a solve, its picture may come in the same moment.
        self.passed = k + 1;
        event
    }

    /// Place of a widget in the last frame on the screen: left, top, right, bottom in pixels.
    pub fn widget(&self, name: &str) -> [u32; 4] {
        until(&format!("no widget \"{name}\""), || {
            let layout = self.events().filter(|event| event["event"] == "layout").last()?;
            let rect = layout["widgets"][name].as_array()?;
            Some([0, 1, 2, 3].map(|k| rect[k].as_f64().expect("a number") as u32))
        })
    }

    /// Gives a command to the mouse, and waits until the window shows a frame with it there, pressed or not.
    fn mouse(&self, words: &str, name: &str, place: [u32; 2]) {
        self.xdotool(words);
        until(&format!("no {name} at {place:?}"), || (self.widget(name)[..2] == place).then_some(()));
    }

    fn move_to(&self, name: &str, [x, y]: [u32; 2]) {
        self.mouse(&format!("mousemove {x} {y}"), name, [x, y]);
    }

    /// Clicks on a widget, once it stays where it is.
    pub fn click(&self, name: &str) {
        let middle = || {
            let [left, top, right, bottom] = self.widget(name);
            [(left + right) / 2, (top + bottom) / 2]
        };
        let mut place = [0; 2];
        while place != middle() {
            place = middle();
            self.move_to("mouse", place);
        }
        self.mouse("mousedown 1", "pressed mouse", place);
        self.mouse("mouseup 1", "mouse", place);
        // What only the mouse over a widget shows goes away.
        self.move_away();
    }

    /// Drags from the first point through all others.
    pub fn drag(&self, points: &[[u32; 2]]) {
        self.move_to("mouse", points[0]);
        self.mouse("mousedown 1", "pressed mouse", points[0]);
        for &point in points {
            self.move_to("pressed mouse", point);
        }
        self.mouse("mouseup 1", "mouse", points[points.len() - 1]);
    }

    /// Moves the mouse to where it touches nothing: the line at the bottom.
    pub fn move_away(&self) {
        self.move_to("mouse", [700, 612]);
    }

    /// Closes the window by its key; the program must end by itself.
    pub fn quit(mut self) {
        self.xdotool("search --onlyvisible --name ^vrtm windowfocus --sync key ctrl+q");
        let status = until("the window does not close", || self.child.try_wait().expect("a status"));
        assert!(status.success(), "{status}");
        assert_eq!(self.events().last().map(|event| event["event"].clone()), Some("close".into()));
    }

    fn xdotool(&self, words: &str) {
        let done = Command::new("xdotool").args(words.split(' ')).env("DISPLAY", &self.display).status();
        assert!(done.expect("xdotool starts").success(), "xdotool {words:?}");
    }
}

impl Drop for Program {
    fn drop(&mut self) {
        if std::thread::panicking() {
            let last: Vec<_> = self.events().filter(|event| event["event"] != "layout").collect();
            eprintln!("the last events were {:#?}", &last[last.len().saturating_sub(6)..]);
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
