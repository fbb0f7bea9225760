//! Saving from the window: names, the question whether files may be replaced, and clips.

use std::path::{Path, PathBuf};

use eframe::egui::Ui;
use serde_json::json;

use super::{App, Notice};
use crate::draw::picture::Picture;
use crate::panel::save::{self, Job, Pressed};
use crate::save::clip::Clip;
use crate::save::file::Existing;
use crate::save::{encode, file, rigidity};
use crate::solve::inbox::{Purpose, Request};

/// Requests that wait for an answer.
pub struct Question {
    job: Job,
    files: Vec<Existing>,
}

impl App {
    /// A button was pressed: saves to the folder.
    pub(super) fn press(&mut self, pressed: Pressed) {
        let Some(open) = &self.open else { return };
        if pressed != Pressed::Stop && self.clip.is_some() {
            return;
        }
        let folder = Path::new(self.folder.trim());
        let name = open.model.name.replace(|c: char| !c.is_alphanumeric() && c != '-', "_");
        let job = match pressed {
            Pressed::Stop => return self.give_clip_up(),
            Pressed::Rigidity => {
                Job::Rigidity(rigidity::paths(folder, &name, open.model.pages.iter().map(|page| page.udim)))
            }
            Pressed::Picture => {
                Job::Picture(folder.join(format!("{name}_{:04}.png", open.line.number(open.line.frame))))
            }
            Pressed::Clip => Job::Clip(folder.join(format!("{name}_clip.png"))),
        };
        // If such files are there already, the user decides.
        let files = file::existing(job.paths(), &open.inputs);
        if files.is_empty() {
            self.save(job);
        } else {
            self.question = Some(Question { job, files });
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
            self.save(question.job);
        }
    }

    fn save(&mut self, job: Job) {
        self.notice = None;
        let saved = match &job {
            Job::Rigidity(paths) => match &mut self.open {
                Some(open) => rigidity::save(paths, &open.painter.canvases),
                None => Ok(()),
            },
            Job::Picture(path) => self.picture(path),
            Job::Clip(path) => return self.begin_clip(path.clone()),
        };
        match saved {
            Ok(()) => self.tell_saved(job.paths()),
            Err(message) => self.say(message),
        }
    }

    fn tell_saved(&mut self, paths: &[PathBuf]) {
        self.trace.event("saved", json!({ "paths": paths }));
        let [first, others @ ..] = paths else { return };
        let more = if others.is_empty() { String::new() } else { format!(" and {} more", others.len()) };
        self.notice = Some(Notice { text: format!("saved to {}{more}", first.display()), is_error: false });
    }

    /// The pixels of the view, without what lies over it.
    fn pixels(&self, size: [u32; 2]) -> Result<Vec<u8>, String> {
        let (picture, (views, wipe)) = (Picture::new(&self.gpu, size), self.screen.views());
        picture.draw(&self.gpu, self.open.as_ref().map(|open| &open.scene), views, wipe);
        picture.read(&self.gpu)
    }

    fn picture(&self, path: &Path) -> Result<(), String> {
        let size = self.screen.size();
        let pixels = self.pixels(size)?;
        let bytes = encode::picture(size, &pixels).map_err(|error| format!("{}: {error}", path.display()))?;
        vrtm_examples::whole::write(path, &bytes)
    }

    fn begin_clip(&mut self, path: PathBuf) {
        let Some(open) = &mut self.open else { return };
        open.line.go(1);
        match Clip::new(path, self.screen.size(), (open.line.last, open.line.rate)) {
            Ok(clip) => {
                self.clip = Some(clip);
                self.ask_clip();
            }
            Err(message) => self.say(message),
        }
    }

    /// Asks for the next frame of the clip.
    fn ask_clip(&mut self) {
        let (Some(open), Some(clip)) = (&mut self.open, &self.clip) else { return };
        open.line.go(clip.next);
        self.worker.inbox.ask(Request {
            frame: clip.next,
            last: clip.last,
            quality: self.settings.quality,
            purpose: Purpose::Clip,
            edit: self.flow.edit,
        });
    }

    /// Adds the frame that is shown, if it is the next one.
    pub(super) fn clip_frame(&mut self) {
        let Some(clip) = &self.clip else { return };
        let shown = self.shown.as_ref().map(|answer| (answer.request.purpose, answer.request.frame));
        if shown != Some((Purpose::Clip, clip.next)) {
            return;
        }
        let added = self.pixels(clip.size).and_then(|pixels| match &mut self.clip {
            Some(clip) => clip.add(&pixels),
            None => Ok(()),
        });
        if let Err(message) = added {
            self.give_clip_up();
            return self.say(message);
        }
        if !self.clip.as_ref().is_some_and(Clip::is_complete) {
            return self.ask_clip();
        }
        self.flow.reset();
        match self.clip.take().map(Clip::finish) {
            Some(Ok(path)) => self.tell_saved(&[path]),
            Some(Err(message)) => self.say(message),
            None => {}
        }
    }

    /// Leaves no clip behind that is not complete.
    pub(super) fn give_clip_up(&mut self) {
        if self.clip.take().is_some() {
            self.flow.reset();
        }
    }
}
