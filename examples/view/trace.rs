//! A record of what happens, for tests that drive the window from outside: a line of JSON per event.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::Path;

use eframe::egui::Rect;
use serde_json::{Value, json};

/// The record; nothing is kept unless a file was asked for.
#[derive(Default)]
pub struct Trace {
    file: Option<File>,
    /// The places of this frame's widgets, in pixels of the window, and those that were written last.
    widgets: BTreeMap<String, [f32; 4]>,
    written: BTreeMap<String, [f32; 4]>,
}

impl Trace {
    /// # Errors
    /// A file that cannot be written.
    pub fn new(path: Option<&Path>) -> Result<Trace, String> {
        let create =
            |path: &Path| File::create(path).map_err(|error| format!("--trace {}: {error}", path.display()));
        Ok(Trace { file: path.map(create).transpose()?, ..Trace::default() })
    }

    /// Writes an event; `more` is an object with its facts.
    pub fn event(&mut self, name: &str, mut more: Value) {
        let Some(file) = &mut self.file else { return };
        more["event"] = json!(name);
        if let Err(error) = writeln!(file, "{more}") {
            eprintln!("vrtm-view: --trace: {error}");
            self.file = None;
        }
    }

    /// Notes where a widget is.
    pub fn widget(&mut self, name: &str, rect: Rect, pixels_per_point: f32) {
        if self.file.is_some() {
            let pixels = [rect.left(), rect.top(), rect.right(), rect.bottom()];
            self.widgets.insert(name.into(), pixels.map(|x| (x * pixels_per_point).round()));
        }
    }

    /// Ends a frame of the window: writes the places of widgets if they changed.
    pub fn end_frame(&mut self) {
        let widgets = std::mem::take(&mut self.widgets);
        if widgets != self.written {
            self.event("layout", json!({ "widgets": widgets }));
            self.written = widgets;
        }
    }
}
