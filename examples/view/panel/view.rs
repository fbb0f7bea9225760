//! Where from the mesh is looked at.

use eframe::egui::{Rect, RichText, Ui};

use super::bar::Wish;
use super::style;
use crate::draw::camera::Side;

/// Shows the menu's content.
pub fn show(ui: &mut Ui, z_up: bool, mut noted: impl FnMut(&str, Rect)) -> Option<Wish> {
    let mut wish = None;
    let quiet = |text: &str| RichText::new(text).color(style::QUIET);
    ui.label(quiet("see the whole mesh"));
    ui.horizontal(|ui| {
        for (side, name, about) in [
            (None, "from here", "Fill the pane with the mesh in all of its poses (F)"),
            (Some(Side::Front), "front", "Look along z, or along y where z points up"),
            (Some(Side::Right), "side", "Look along x"),
            (Some(Side::Top), "top", "Look from above"),
        ] {
            let response = ui.button(name).on_hover_text(about);
            noted(name, response.rect);
            if response.clicked() {
                wish = Some(Wish::Frame(side));
            }
        }
    });
    ui.horizontal(|ui| {
        ui.label(quiet("up is"));
        for (up, name) in [(false, "y"), (true, "z")] {
            if ui.selectable_label(z_up == up, name).clicked() {
                wish = Some(Wish::Up(up));
            }
        }
    });
    wish
}
