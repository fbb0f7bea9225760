//! The brush's settings and tools.

use eframe::egui::{self, Slider, Ui};

use super::side::{row, words};
use crate::brush::kind::Brush;
use crate::brush::steps::Steps;
use crate::brush::whole::Tool;

/// Request of a button.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BrushWish {
    Undo,
    Redo,
    Use(Tool),
}

/// Shows the settings of the brush.
pub fn show(
    ui: &mut Ui,
    brush: &mut Brush,
    steps: &Steps,
    mut noted: impl FnMut(&str, egui::Rect),
) -> Option<BrushWish> {
    row(ui, "tool", "What a click does on the surface.", |ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        let tools = [
            (false, "paint", "Paint around the mouse"),
            (true, "fill island", "Make all of the UV island under the mouse rigid, or elastic with erase"),
        ];
        words(ui, &mut brush.fills, &tools, &mut noted);
    });
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
    let mut wish = None;
    let mut button = |ui: &mut Ui, is_enabled: bool, name: &str, about: &str, asks: BrushWish| {
        let response = ui.add_enabled(is_enabled, egui::Button::new(name)).on_hover_text(about);
        noted(name, response.rect);
        if response.clicked() {
            wish = Some(asks);
        }
    };
    ui.horizontal(|ui| {
        ui.checkbox(&mut brush.erase, "erase").on_hover_text("Paint elastic material (E, or hold Ctrl).");
        let about = "Paint the opposite side of the mesh, too, mirrored in x at rest (X).";
        ui.checkbox(&mut brush.symmetry, "symmetry x").on_hover_text(about);
    });
    ui.horizontal(|ui| {
        button(ui, steps.can_undo(), "undo", "Take the last step back (Ctrl+Z)", BrushWish::Undo);
        button(ui, steps.can_redo(), "redo", "Do it again (Ctrl+Shift+Z or Ctrl+Y)", BrushWish::Redo);
        ui.separator();
        for (tool, name, about) in [
            (Tool::Grow, "grow", "Make all features a little larger, each within its island"),
            (Tool::Shrink, "shrink", "Make all features a little smaller"),
            (Tool::Invert, "invert", "Make elastic what is rigid, and rigid what is elastic"),
        ] {
            button(ui, true, name, about, BrushWish::Use(tool));
        }
    });
    wish
}
