//! The bar at the top: what is open, and how it is looked at.

use std::path::PathBuf;

use eframe::egui::containers::menu::{MenuButton, MenuConfig};
use eframe::egui::{self, PopupCloseBehavior, Rect, RichText, Ui};

use super::open;
use super::save::{self, Pressed};
use super::side::words;
use super::style;
use super::view;
use super::viewport::{Look, Panes, Shown};
use crate::app::dialogs::Ask;
use crate::draw::camera::Side;
use crate::source::Files;

/// Requests of the bar.
pub enum Wish {
    Open(Files),
    /// A folder, or an OBJ file.
    Path(PathBuf),
    /// Show a dialog.
    Ask(Ask),
    /// See the whole mesh, from where it is seen or from a side.
    Frame(Option<Side>),
    /// Turn z up, or y.
    Up(bool),
    Save(Pressed),
}

/// Points below which choices are lists in place of rows of words.
const ROOMY: f32 = 1220.0;
/// Points below which the name of what is open goes.
const NAMED: f32 = 900.0;

pub const PANES: [(Panes, &str, &str); 4] = [
    (Panes::Original, "original", "The texture by the mesh's own UVs (1)"),
    (Panes::Redirected, "redirected", "The texture through the redirection map (2)"),
    (Panes::SideBySide, "side by side", "Both, from the same side (3)"),
    (
        Panes::Wipe,
        "wipe",
        "One picture: original on the left of a line that you drag, redirected on its right (4)",
    ),
];

pub const SHOWN: [(Shown, &str, &str); 3] = [
    (
        Shown::Texture,
        "texture",
        "The colour texture, or a painted one: studs where the rigidity is over 0.5, a checker elsewhere (T)",
    ),
    (Shown::Rigidity, "rigidity map", "The rigidity map: 0 (elastic, dark) to 1 (rigid, light) (R)"),
    (
        Shown::Strain,
        "strain",
        "The relative change of length inside rigid features: red = stretched, blue = squeezed (S)",
    ),
];

/// Shows the bar; `path` and `folder` are texts of the fields for what to open and where to save.
pub fn show(
    ui: &mut Ui,
    (name, z_up): (&str, bool),
    (look, path, folder): (&mut Look, &mut String, &mut String),
    mut noted: impl FnMut(&str, Rect),
) -> Option<Wish> {
    let mut wish = None;
    let width = ui.ctx().content_rect().width();
    ui.horizontal_centered(|ui| {
        // Clicks into a field for a path must not close the menu.
        let menu = |name: &'static str| {
            let stays = MenuConfig::new().close_behavior(PopupCloseBehavior::CloseOnClickOutside);
            MenuButton::new(name).config(stays)
        };
        let (button, _) = menu("open").ui(ui, |ui| wish = open::show(ui, path, &mut noted));
        noted("open", button.rect);
        let (button, _) = menu("save").ui(ui, |ui| {
            if let Some(asked) = save::show(ui, folder, &mut noted) {
                wish = Some(asked);
                ui.close();
            }
        });
        noted("save", button.rect);
        if width >= NAMED {
            let name = RichText::new(name).heading().color(style::TEXT);
            ui.scope(|ui| {
                ui.set_max_width(0.14 * width);
                ui.add(egui::Label::new(name).truncate());
            });
        }
        ui.separator();
        choice(ui, width, ("panes", &PANES), &mut look.panes, &mut noted);
        ui.separator();
        choice(ui, width, ("shown", &SHOWN), &mut look.shown, &mut noted);
        ui.separator();
        let side = look.has_side(width);
        for (value, name, about) in [
            (&mut look.grid, "grid lines", "Lines of the texture's grid, as the warp bends them (G)"),
            (
                &mut look.brush,
                "brush",
                "Paint rigidity on the surface with the left mouse button; the right one orbits (B)",
            ),
        ] {
            let response = ui.selectable_label(*value, name).on_hover_text(about);
            noted(name, response.rect);
            *value ^= response.clicked();
        }
        let (button, _) = menu("view").ui(ui, |ui| {
            if let Some(asked) = view::show(ui, z_up, &mut noted) {
                wish = Some(asked);
                ui.close();
            }
        });
        noted("view menu", button.rect);
        let about = "The panel at the side: figures, brush, settings (N)";
        let response = ui.selectable_label(side, "settings").on_hover_text(about);
        noted("settings", response.rect);
        if response.clicked() {
            look.side = Some(!side);
        }
    });
    wish
}

/// One of several: a row of words, or a list in a narrow window.
fn choice<T: Copy + PartialEq>(
    ui: &mut Ui,
    width: f32,
    (id, all): (&str, &[(T, &str, &str)]),
    value: &mut T,
    mut noted: impl FnMut(&str, Rect),
) {
    let now = all.iter().find(|(of, ..)| of == value).map_or("", |(_, name, _)| name);
    if width >= ROOMY {
        return words(ui, value, all, noted);
    }
    let list = egui::ComboBox::from_id_salt(id).selected_text(now).width(96.0);
    let list = list.show_ui(ui, |ui| words(ui, value, all, &mut noted));
    noted(id, list.response.rect);
}

/// Keys that do what the bar does.
pub fn keys(ui: &Ui, look: &mut Look) -> Option<Wish> {
    use egui::Key;
    let pressed = |key| ui.input(|i| i.key_pressed(key) && i.modifiers.is_none());
    for (key, (panes, ..)) in [Key::Num1, Key::Num2, Key::Num3, Key::Num4].into_iter().zip(PANES) {
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
    if pressed(Key::N) {
        look.side = Some(!look.has_side(ui.ctx().content_rect().width()));
    }
    pressed(Key::F).then_some(Wish::Frame(None))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The places of the bar's widgets in a window of this width.
    fn places(width: f32, look: &mut Look) -> Vec<(String, Rect)> {
        let ctx = egui::Context::default();
        style::apply(&ctx);
        let input = egui::RawInput {
            screen_rect: Some(Rect::from_min_size(egui::Pos2::ZERO, egui::vec2(width, 480.0))),
            ..egui::RawInput::default()
        };
        let mut places = Vec::new();
        // The first pass measures.
        for _ in 0..2 {
            places.clear();
            let mut output = ctx.run_ui(input.clone(), |ui| {
                egui::Panel::top("bar").frame(style::frame(0)).exact_size(42.0).show(ui, |ui| {
                    let name = "a_character_with_a_long_name";
                    let fields = (&mut *look, &mut String::new(), &mut String::new());
                    show(ui, (name, false), fields, |name, rect| places.push((name.into(), rect)));
                });
            });
            // Nobody draws the text.
            output.textures_delta.clear();
        }
        places
    }

    #[test]
    fn nothing_of_the_bar_is_cut_off_or_lies_over_another_thing() {
        for width in [800.0, 899.0, 901.0, 1219.0, 1221.0, 1600.0] {
            let mut look = Look { panes: Panes::SideBySide, shown: Shown::Rigidity, ..Look::default() };
            let places = places(width, &mut look);
            assert!(places.len() >= 8, "{width}: {places:?}");
            for (name, rect) in &places {
                assert!(rect.left() >= 0.0 && rect.right() <= width, "{width}: {name} at {rect:?}");
                assert!(rect.top() >= 0.0 && rect.bottom() <= 42.0, "{width}: {name} at {rect:?}");
            }
            for pair in places.windows(2) {
                let [(a, left), (b, right)] = pair else { continue };
                assert!(left.right() <= right.left(), "{width}: {a} {left:?} {b} {right:?}");
            }
        }
    }
}
