//! A record of what happens, for tests that drive the window from outside: a line of JSON per event.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Write;
use std::path::Path;

use eframe::egui::{Context, Rect};
use serde_json::{Value, json};

/// The record; nothing is kept unless a file was asked for.
#[derive(Default)]
pub struct Trace {
    file: Option<File>,
    /// The places of this frame's widgets, in pixels of the window, and those that were written last.
    widgets: BTreeMap<String, [f32; 4]>,
    written: BTreeMap<String, [f32; 4]>,
    /// Events of this frame that are true once it is on the screen.
    unseen: Vec<(&'static str, Value)>,
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

    /// Keeps an event until the frame is on the screen.
    pub fn once_seen(&mut self, name: &'static str, more: Value) {
        if self.file.is_some() {
            self.unseen.push((name, more));
        }
    }

    /// Begins a frame of the window: the last one is on the screen, unless egui goes through this one once more.
    pub fn begin_frame(&mut self, ctx: &Context) {
        if ctx.current_pass_index() == 0 {
            for (name, more) in std::mem::take(&mut self.unseen) {
                self.event(name, more);
            }
        }
        if self.file.is_some() {
            // However long a busy machine takes over a click, it is one.
            ctx.options_mut(|options| options.input_options.max_click_duration = f64::INFINITY);
        }
        if let Some((at, down)) = ctx.input(|i| i.pointer.latest_pos().map(|at| (at, i.pointer.any_down()))) {
            let name = if down { "pressed mouse" } else { "mouse" };
            self.widget(name, Rect::from_pos(at), ctx.pixels_per_point());
        }
    }

    /// Ends a frame, with the places of widgets if they changed. Another one follows, which tells what this one shows.
    pub fn end_frame(&mut self, ctx: &Context) {
        let widgets = std::mem::take(&mut self.widgets);
        if widgets != self.written {
            self.once_seen("layout", json!({ "widgets": widgets }));
            self.written = widgets;
        }
        if !self.unseen.is_empty() {
            ctx.request_repaint();
        }
    }
}
