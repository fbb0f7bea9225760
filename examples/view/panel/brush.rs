//! The brush's settings and tools.

use eframe::egui::{self, Slider, Ui};

use super::side::{row, words};
use crate::brush::kind::{Brush, Click};
use crate::brush::steps::Steps;
use crate::brush::textures::Source;
use crate::brush::whole::Tool;

/// Request of a button.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BrushWish {
    Undo,
    Redo,
    Use(Tool),
    Take(Source),
}

/// Shows the settings of the brush.
pub fn show(
    ui: &mut Ui,
    brush: &mut Brush,
    (steps, has_texture): (&Steps, bool),
    mut noted: impl FnMut(&str, egui::Rect),
) -> Option<BrushWish> {
    if !has_texture && brush.click == Click::Colour {
        brush.click = Click::Paint;
    }
    row(ui, "tool", "What a click does on the surface.", |ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        let tools = [
            (Click::Paint, "paint", "Paint around the mouse"),
            (Click::Fill, "island", "Make all of the UV island under the mouse rigid, or elastic with erase"),
            (
                Click::Colour,
                "colour",
                "This colour keeps its shape: all of the textures that has the clicked one",
            ),
        ];
        let count = if has_texture { 3 } else { 2 };
        words(ui, &mut brush.click, &tools[..count], &mut noted);
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
    if brush.click == Click::Colour {
        let about = "How far from the clicked colour others count as the same one: 0 (itself) to 1.";
        number(ui, &mut brush.tolerance, 0.0..=1.0, "tolerance", about);
    }
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
    if has_texture {
        row(ui, "texture", "Features from the textures, with the brush's rigidity.", |ui| {
            for (source, name, about) in [
                (Source::Bright, "bright", "What is bright in the textures keeps its shape"),
                (Source::Dark, "dark", "What is dark in the textures keeps its shape"),
                (Source::Detail, "detail", "What is drawn on the textures outside of features, a little"),
            ] {
                button(ui, true, name, about, BrushWish::Take(source));
            }
        });
    }
    wish
}
