//! What can be opened.

use eframe::egui::{self, Rect, RichText, Ui};

use super::bar::Wish;
use super::style;
use crate::app::dialogs::Ask;
use crate::scenes;
use crate::source::Files;

/// Shows the menu's content; `path` is the text of its field.
pub fn show(ui: &mut Ui, path: &mut String, mut noted: impl FnMut(&str, Rect)) -> Option<Wish> {
    let mut wish = None;
    let quiet = |text: &str| RichText::new(text).color(style::QUIET);
    ui.label(quiet("your own files; or drop them on the window"));
    for (ask, name, about) in [
        (Ask::Rest, "mesh at rest...", "An OBJ file with UVs"),
        (Ask::Poses, "poses...", "OBJ or .f32 files with the vertices of the mesh; what is painted stays"),
        (
            Ask::Rigidity,
            "rigidity map...",
            "PNG, white = rigid; of several tiles, any of r.1001.png, r.1002.png",
        ),
        (Ask::Texture, "colour texture...", "PNG; of several tiles, any of skin.1001.png, skin.1002.png"),
        (Ask::Normal, "normal map...", "PNG, in tangent space; green grows with v, as in OpenGL"),
        (Ask::Asset, "asset folder...", "A folder with asset.json"),
    ] {
        let item = ui.button(name).on_hover_text(about);
        noted(name, item.rect);
        if item.clicked() {
            wish = Some(Wish::Ask(ask));
            ui.close();
        }
    }
    ui.horizontal(|ui| {
        let hint = "path of an OBJ file or a folder";
        let field = ui.add(egui::TextEdit::singleline(path).desired_width(220.0).hint_text(hint));
        let entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
        if (ui.button("open").clicked() || entered) && !path.trim().is_empty() {
            wish = Some(Wish::Path(path.trim().into()));
            ui.close();
        }
    });
    ui.separator();
    ui.label(quiet("built-in scenes"));
    ui.horizontal_wrapped(|ui| {
        ui.set_max_width(290.0);
        for scene in scenes::NAMES {
            let item = ui.button(scene);
            noted(&format!("scene {scene}"), item.rect);
            if item.clicked() {
                wish = Some(Wish::Open(Files { scene: Some(scene.into()), ..Files::default() }));
                ui.close();
            }
        }
    });
    wish
}
