//! The brush's settings.

use eframe::egui::{self, Slider, Ui};

use super::side::row;
use crate::brush::painter::Brush;

/// Shows the settings of the brush.
pub fn show(ui: &mut Ui, brush: &mut Brush, can_undo: bool, mut noted: impl FnMut(&str, egui::Rect)) -> bool {
    let mut number = |ui: &mut Ui, value: &mut f32, range, name: &str, about: &str| {
        let slider = Slider::new(value, range).fixed_decimals(2);
        let response = row(ui, name, about, |ui| ui.add(slider));
        noted(name, response.rect);
    };
    number(
        ui,
        &mut brush.value,
        0.0..=1.0,
        "rigidity",
        "The rigidity that is painted: 0 (elastic) to 1 (rigid).",
    );
    number(
        ui,
        &mut brush.radius,
        2.0..=200.0,
        "radius",
        "Radius of the brush on the screen, in points ([ and ]).",
    );
    number(
        ui,
        &mut brush.softness,
        0.0..=1.0,
        "softness",
        "The part of the radius over which the brush fades out.",
    );
    let mut undo = false;
    ui.horizontal(|ui| {
        let erase =
            ui.checkbox(&mut brush.erase, "erase").on_hover_text("Paint elastic material (E, or hold Ctrl).");
        noted("erase", erase.rect);
        let response = ui.add_enabled(can_undo, egui::Button::new("undo stroke")).on_hover_text("Ctrl+Z");
        noted("undo", response.rect);
        undo = response.clicked();
    });
    undo
}
