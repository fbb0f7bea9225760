//! Saving from the window: names, and the question whether files may be replaced.

use std::path::{Path, PathBuf};

use eframe::egui::Ui;
use image::ExtendedColorType;
use serde_json::json;

use super::{App, Notice};
use crate::draw::picture::Picture;
use crate::panel::save::{self, Pressed};
use crate::save::{encode, file, rigidity};

/// Requests that wait for an answer.
pub struct Question {
    pressed: Pressed,
    paths: Vec<PathBuf>,
    /// Files that would be replaced.
    files: Vec<String>,
}

impl App {
    /// A button was pressed: saves to the folder.
    pub(super) fn press(&mut self, pressed: Pressed) {
        let Some(open) = &self.open else { return };
        let folder = Path::new(self.folder.trim());
        let name = open.model.name.replace(|c: char| !c.is_alphanumeric() && c != '-', "_");
        let paths = match pressed {
            Pressed::Rigidity => {
                rigidity::paths(folder, &name, open.model.pages.iter().map(|page| page.udim))
            }
            Pressed::Picture => {
                vec![folder.join(format!("{name}_{:04}.png", open.line.number(open.line.frame)))]
            }
        };
        // If such files are there already, the user decides.
        let files = file::existing(&paths, &open.inputs);
        if files.is_empty() {
            self.save(pressed, &paths);
        } else {
            self.question = Some(Question { pressed, paths, files });
        }
    }

    /// Shows the dialog that is asked for, and does what the last one was shown for.
    pub(super) fn dialog(&mut self, ui: &Ui, frame: &eframe::Frame) {
        if let Some(told) = self.dialogs.told() {
            self.open_told(told);
        }
        if let Some(ask) = self.asked.take() {
            self.dialogs.open(ask, Path::new(self.folder.trim()), frame, ui.ctx());
        }
    }

    /// Shows the question, if there is one.
    pub(super) fn ask_question(&mut self, ui: &Ui, scale: f32) {
        let Some(question) = &self.question else { return };
        let trace = &mut self.trace;
        let answer = save::replace(ui, &question.files, |name, rect| trace.widget(name, rect, scale));
        if let Some(yes) = answer
            && let Some(question) = self.question.take()
            && yes
        {
            self.save(question.pressed, &question.paths);
        }
    }

    fn save(&mut self, pressed: Pressed, paths: &[PathBuf]) {
        self.notice = None;
        let saved = match (pressed, &self.open) {
            (Pressed::Rigidity, Some(open)) => rigidity::save(paths, &open.painter.canvases),
            (Pressed::Picture, _) => paths.iter().try_for_each(|path| self.picture(path)),
            _ => Ok(()),
        };
        match saved {
            Ok(()) => self.tell_saved(paths),
            Err(message) => self.say(message),
        }
    }

    fn tell_saved(&mut self, paths: &[PathBuf]) {
        self.trace.event("saved", json!({ "paths": paths }));
        let [first, others @ ..] = paths else { return };
        let more = if others.is_empty() { String::new() } else { format!(" and {} more", others.len()) };
        self.notice = Some(Notice { text: format!("saved to {}{more}", first.display()), is_error: false });
    }

    /// The view, without what lies over it.
    fn picture(&self, path: &Path) -> Result<(), String> {
        let (picture, (views, wipe)) = (Picture::new(&self.gpu, self.screen.size()), self.screen.views());
        picture.draw(&self.gpu, self.open.as_ref().map(|open| &open.scene), views, wipe);
        // The window is opaque.
        let pixels: Vec<u8> =
            picture.read(&self.gpu)?.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        let bytes = encode(picture.size, ExtendedColorType::Rgb8, &pixels);
        let bytes = bytes.map_err(|error| format!("{}: {error}", path.display()))?;
        vrtm_examples::whole::write(path, &bytes)
    }
}
