//! The bar at the top: what is open, and how it is looked at.

use std::path::PathBuf;

use eframe::egui::containers::menu::{MenuButton, MenuConfig};
use eframe::egui::{self, PopupCloseBehavior, Rect, RichText, Ui};

use super::open;
use super::save::{self, Pressed};
use super::style;
use super::viewport::{Look, Panes, Shown};
use crate::app::dialogs::Ask;
use crate::source::Files;

/// What the bar asks for.
pub enum Wish {
    Open(Files),
    /// A folder, or an OBJ file.
    Path(PathBuf),
    /// Show a dialog.
    Ask(Ask),
    /// See the whole mesh again.
    Reset,
    /// Turn z up, or y.
    Up(bool),
    Save(Pressed),
}

/// Shows the bar; `path` and `folder` are the texts of the fields for paths, `clip` the frame that is being written
/// and the last one.
pub fn show(
    ui: &mut Ui,
    (name, z_up): (&str, bool),
    (look, path, folder): (&mut Look, &mut String, &mut String),
    clip: Option<(usize, usize)>,
    mut noted: impl FnMut(&str, Rect),
) -> Option<Wish> {
    let mut wish = None;
    ui.horizontal_centered(|ui| {
        // Clicks into a field for a path must not close the menu.
        let menu = |name: &'static str| {
            let stays = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
            MenuButton::new(name).config(stays)
        };
        let (opens, _) = menu("open").ui(ui, |ui| {
            if let Some(asked) = open::show(ui, path, &mut noted) {
                wish = Some(asked);
            }
        });
        noted("open", opens.rect);
        let (saves, _) = menu("save").ui(ui, |ui| {
            if let Some(asked) = save::show(ui, folder, &mut noted) {
                wish = Some(asked);
                ui.close();
            }
        });
        noted("save", saves.rect);
        if let Some(progress) = clip
            && save::progress(ui, progress)
        {
            wish = Some(Wish::Save(Pressed::Stop));
        }
        if clip.is_some() {
            // All frames of a clip look alike.
            ui.disable();
        }
        ui.label(RichText::new(name).heading().color(style::TEXT));
        ui.separator();
        let mut tab = |ui: &mut Ui, chosen: bool, name: &str, about: &str| {
            let response = ui.selectable_label(chosen, name).on_hover_text(about);
            noted(name, response.rect);
            response.clicked()
        };
        for (panes, name, about) in [
            (Panes::Original, "original", "The texture by the mesh's own UVs (1)"),
            (Panes::Redirected, "redirected", "The texture through the redirection map (2)"),
            (Panes::SideBySide, "side by side", "Both, from the same side (3)"),
        ] {
            if tab(ui, look.panes == panes, name, about) {
                look.panes = panes;
            }
        }
        ui.separator();
        for (shown, name, about) in [
            (
                Shown::Texture,
                "texture",
                "A painted texture: studs where the rigidity is over 0.5, a checker elsewhere (T)",
            ),
            (Shown::Rigidity, "rigidity map", "The rigidity map: 0 (elastic, dark) to 1 (rigid, light) (R)"),
            (
                Shown::Strain,
                "strain",
                "The relative change of length inside rigid features: red = stretched, blue = squeezed (S)",
            ),
        ] {
            if tab(ui, look.shown == shown, name, about) {
                look.shown = shown;
            }
        }
        if look.shown == Shown::Strain {
            let range = egui::DragValue::new(&mut look.range).speed(0.005).range(0.02..=2.0).prefix("± ");
            ui.add(range).on_hover_text("The strain at the ends of the colours");
        }
        ui.separator();
        if tab(ui, look.grid, "grid lines", "Lines of the texture's grid, as the warp bends them (G)") {
            look.grid = !look.grid;
        }
        if look.grid {
            let every =
                egui::DragValue::new(&mut look.every).range(1..=256).prefix("every ").suffix(" cells");
            ui.add(every).on_hover_text("Cells of the grid from one line to the next");
        }
        if tab(
            ui,
            look.brush,
            "brush",
            "Paint rigidity on the surface with the left mouse button; the right one orbits (B)",
        ) {
            look.brush = !look.brush;
        }
        // A narrow window has no room for them.
        if ui.available_width() < 130.0 {
            return;
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            let up = if z_up { "z up" } else { "y up" };
            if ui.button(up).on_hover_text("Which axis points up").clicked() {
                wish = Some(Wish::Up(!z_up));
            }
            if ui.button("whole").on_hover_text("See the whole mesh (F)").clicked() {
                wish = Some(Wish::Reset);
            }
        });
    });
    wish
}

/// Keys that do what the bar does.
pub fn keys(ui: &Ui, look: &mut Look) -> Option<Wish> {
    use egui::Key;
    let pressed = |key| ui.input(|i| i.key_pressed(key) && i.modifiers.is_none());
    for (key, panes) in
        [(Key::Num1, Panes::Original), (Key::Num2, Panes::Redirected), (Key::Num3, Panes::SideBySide)]
    {
        if pressed(key) {
            look.panes = panes;
        }
    }
    for (key, shown) in [(Key::T, Shown::Texture), (Key::R, Shown::Rigidity), (Key::S, Shown::Strain)] {
        if pressed(key) {
            look.shown = shown;
        }
    }
    look.grid ^= pressed(Key::G);
    look.brush ^= pressed(Key::B);
    pressed(Key::F).then_some(Wish::Reset)
}
