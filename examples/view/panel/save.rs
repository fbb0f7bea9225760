//! Where to save, and what.

use eframe::egui::{self, Rect, RichText, Ui};

use super::bar::Wish;
use super::style;
use crate::app::dialogs::Ask;

/// The pressed button.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pressed {
    Rigidity,
    Picture,
}

/// Shows the folder and what can be saved there.
pub fn show(ui: &mut Ui, folder: &mut String, mut noted: impl FnMut(&str, Rect)) -> Option<Wish> {
    let mut wish = None;
    ui.label(RichText::new("to this folder").color(style::QUIET));
    ui.horizontal(|ui| {
        ui.add(egui::TextEdit::singleline(folder).desired_width(260.0));
        let choose = ui.button("...").on_hover_text("Choose the folder");
        noted("save to", choose.rect);
        if choose.clicked() {
            wish = Some(Wish::Ask(Ask::Folder));
        }
    });
    for (which, name, about) in [
        (Pressed::Rigidity, "rigidity maps", "A PNG per tile: <name>_rigidity.<UDIM>.png, white = rigid"),
        (Pressed::Picture, "picture", "This view as a PNG, without panels: <name>_<frame>.png"),
    ] {
        let response = ui.button(name).on_hover_text(about);
        noted(&format!("save {name}"), response.rect);
        if response.clicked() {
            wish = Some(Wish::Save(which));
        }
    }
    wish
}

/// Asks whether files may be replaced; `None` until it is answered.
pub fn replace(ui: &Ui, files: &[String], mut noted: impl FnMut(&str, Rect)) -> Option<bool> {
    let mut answer = None;
    egui::Modal::new(egui::Id::unique("replace")).show(ui.ctx(), |ui| {
        ui.set_max_width(460.0);
        ui.add_space(4.0);
        ui.heading(if files.len() == 1 { "Replace this file?" } else { "Replace these files?" });
        ui.add_space(6.0);
        for file in files {
            ui.label(file);
        }
        ui.add_space(10.0);
        ui.horizontal(|ui| {
            for (name, yes) in [("replace", true), ("keep", false)] {
                let response = ui.button(name);
                noted(name, response.rect);
                if response.clicked() {
                    answer = Some(yes);
                }
            }
        });
    });
    // A click beside the question does not answer it: it may be the one that asked for it.
    answer.or(ui.input(|i| i.key_pressed(egui::Key::Escape)).then_some(false))
}
