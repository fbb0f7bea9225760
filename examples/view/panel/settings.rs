//! The settings of solves: those that artists need under the names that they have in Blender, with what one will see,
//! and the others under the library's names, with its words.

use eframe::egui::{self, ComboBox, RichText, Slider, SliderClamping, Ui};
use vrtm::{OpenBorders, Overlap, Quality, Seams, TileSettings};

use super::side::{row, words};
use super::style;
use crate::model::LAYERS;

/// Settings of solves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    pub quality: Quality,
    pub overlaps: Overlaps,
    pub tile: TileSettings,
}

/// Treatment of overlapping islands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overlaps {
    #[default]
    Each,
    Fixed,
    FirstFace,
}

impl Overlaps {
    /// Most layers of a page.
    pub fn layers(self) -> u32 {
        if self == Overlaps::Each { LAYERS } else { 0 }
    }
}

const QUALITIES: [(Quality, &str, &str); 2] = [
    (Quality::Draft, "draft", "A preview: solved on half as many cells along each axis."),
    (
        Quality::Normal,
        "normal",
        "One correction on each level, and more on the finest level in crowded charts; the default.",
    ),
];

/// A number under the name that it has in Blender, too.
struct Knob {
    name: &'static str,
    /// The library's name for it.
    setting: &'static str,
    range: [f32; 2],
    about: &'static str,
}

const KNOBS: [Knob; 4] = [
    Knob {
        name: "No Harm",
        setting: "harm",
        range: [0.0, 16.0],
        about: "How much stiffer a feature gets where it would look worse than without vrtm. At 0 all give way alike, and \
                in a crowd some look worse.",
    },
    Knob {
        name: "Calm",
        setting: SMOOTHNESS,
        range: [-1.0, 1.0],
        about: "Over time: raise it where features jitter in a film, which leaves more strain. Lower, down to -1, \
                features are rounder, and the skin between them is squeezed harder.",
    },
    Knob {
        name: "Keep Direction",
        setting: "orientation_density",
        range: [0.0, 1.0],
        about: "Features turn less where they are dense, such as scales and lettering: 0.15 is a beginning, 0.5 is much. \
                It leaves more strain, and does not go with seams that continue.",
    },
    Knob {
        name: "Room",
        setting: "room",
        range: [0.0, 3.0],
        about: "How much the skin between features resists being crushed. Nearly always 0.3 is best: lower or higher \
                leaves more strain.",
    },
];

const SMOOTHNESS: &str = "smoothness";

/// The smoothness of a value of Calm: 1 and -1 are the ends of what is of use, 4 times the default and a quarter of it.
fn smoothness(calm: f32) -> f32 {
    TileSettings::default().smoothness * 4f32.powf(calm)
}

fn calm(smoothness: f32) -> f32 {
    (smoothness / TileSettings::default().smoothness).log(4.0)
}

/// Shows the settings; `noted` learns where each of them is. Returns whether one is being dragged.
pub fn show(ui: &mut Ui, settings: &mut Settings, mut noted: impl FnMut(&str, egui::Rect)) -> bool {
    let mut dragged = false;
    row(ui, "Quality", "How much work a solve does on each level of its grid (quality).", |ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        let quality = &mut settings.quality;
        words(ui, quality, &QUALITIES, |name, rect| noted(&format!("quality {name}"), rect));
    });
    let tile = &mut settings.tile;
    for Knob { name, setting, range: [least, most], about } in KNOBS {
        let Some(value) = tile.number(setting) else { continue };
        let is_calm = setting == SMOOTHNESS;
        let mut shown = if is_calm { calm(*value) } else { *value };
        let slider = Slider::new(&mut shown, least..=most).clamping(SliderClamping::Always).max_decimals(2);
        let response = row(ui, name, &format!("{about} ({setting})"), |ui| ui.add(slider));
        noted(name, response.rect);
        dragged |= response.dragged();
        if response.changed() {
            *value = if is_calm { smoothness(shown) } else { shown };
        }
    }
    choice(
        ui,
        ("Seams", "What happens to features at the seams of the UV map (seams)."),
        &mut tile.seams,
        &[
            (Seams::Shut, "Shut", "Nothing moves at a seam: a feature on one keeps its width there"),
            (Seams::Keep, "Keep", "A feature that touches a border stays as it is, whole"),
            (
                Seams::Continue,
                "Continue",
                "Features keep their shape across seams. Here textures are dilated for that; elsewhere, see to it",
            ),
        ],
        &mut noted,
    );
    choice(
        ui,
        ("Open Borders", "What happens where the mesh ends (open_borders)."),
        &mut tile.open_borders,
        &[
            (OpenBorders::Fixed, "Fixed", "Nothing moves there, as is right where another mesh begins"),
            (
                OpenBorders::Slide,
                "Slide",
                "Textures slide along the border, so that features there keep their shape",
            ),
        ],
        &mut noted,
    );
    choice(
        ui,
        ("Overlaps", "Islands that overlap in the UV map, as mirrored halves do (max_layers, overlap)."),
        &mut settings.overlaps,
        &[
            (
                Overlaps::Each,
                "Each",
                "Every island is solved as if it were alone: each layer of islands has its own result",
            ),
            (Overlaps::Fixed, "Fixed", "Nothing moves where islands share the texture"),
            (
                Overlaps::FirstFace,
                "First Face",
                "The island with the first face moves all of them: for those that bend alike",
            ),
        ],
        &mut noted,
    );
    let first = settings.overlaps == Overlaps::FirstFace;
    tile.overlap = if first { Overlap::FirstFace } else { Overlap::Fixed };
    let moves = tile.open_borders == OpenBorders::Slide || tile.seams == Seams::Continue;
    if moves && tile.orientation_density > 0.0 {
        let text = "Keep Direction goes neither with open borders that slide nor with seams that continue: set it to 0, \
                    or Open Borders to Fixed and Seams to Shut.";
        ui.label(RichText::new(text).small().color(style::ERROR));
    }
    let mut back = ui.button("defaults").on_hover_text("All settings of tiles as they were");
    noted("defaults", back.rect);
    if back.clicked() {
        (*tile, settings.overlaps) = (TileSettings::default(), Overlaps::default());
        back.mark_changed();
    }
    ui.add_space(4.0);
    egui::CollapsingHeader::new(RichText::new("under the library's names").color(style::QUIET))
        .id_salt("more")
        .show_unindented(ui, |ui| dragged |= more(ui, tile, &mut noted));
    dragged
}

/// The settings that have no name of an artist's.
fn more(ui: &mut Ui, tile: &mut TileSettings, mut noted: impl FnMut(&str, egui::Rect)) -> bool {
    let mut dragged = false;
    // 0 = as many as resolve the features, then 64, 128, ... cells.
    let mut step = tile.grid[0].map_or(0, |cells| cells.ilog2() as i32 - 5);
    let cells = |step: i32| (step > 0).then(|| 32u32 << step);
    let slider = Slider::new(&mut step, 0..=6)
        .custom_formatter(move |step, _| cells(step as i32).map_or("auto".into(), |cells| cells.to_string()))
        .custom_parser(|text| match text.trim().parse::<u32>() {
            Ok(cells) => Some(f64::from(cells.clamp(64, 2048)).log2().round() - 5.0),
            Err(_) => Some(0.0),
        });
    let about = "Cells of the grid in u and v. auto = as many as resolve the rigid features.";
    let response = row(ui, "grid", about, |ui| ui.add(slider));
    noted("grid", response.rect);
    dragged |= response.dragged();
    if response.changed() {
        tile.grid = [cells(step); 2];
    }
    for setting in TileSettings::SETTINGS.iter().filter(|s| KNOBS.iter().all(|k| k.setting != s.name)) {
        let (Some([least, most]), Some(value)) = (setting.limits, tile.number(setting.name)) else {
            continue;
        };
        // Nothing useful lies beyond 10.
        let slider = Slider::new(value, least..=most.min(10.0))
            .logarithmic(most > 1.0)
            .smallest_positive(1e-6)
            .clamping(SliderClamping::Always);
        let about = setting.about.replace(['[', ']', '`'], "");
        let response = row(ui, setting.name, about.trim(), |ui| ui.add(slider));
        noted(setting.name, response.rect);
        dragged |= response.dragged();
    }
    dragged
}

/// A row with a list to choose from.
pub fn choice<T: Copy + PartialEq>(
    ui: &mut Ui,
    (id, about): (&str, &str),
    value: &mut T,
    all: &[(T, &str, &str)],
    mut noted: impl FnMut(&str, egui::Rect),
) {
    let now = all.iter().find(|(of, ..)| of == value).map_or("", |(_, name, _)| name);
    row(ui, id, about, |ui| {
        let list = ComboBox::from_id_salt(id).width(118.0).truncate().selected_text(now).show_ui(ui, |ui| {
            words(ui, value, all, |name, rect| noted(&format!("{id} {name}"), rect));
        });
        noted(id, list.response.rect);
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blender's add-on has the same words.
    const ADD_ON: &str = include_str!("../../../bindings/blender/vrtm_blender/properties.py");

    #[test]
    fn knobs_are_those_of_the_add_on() {
        // Its strings are cut into lines.
        let text = ADD_ON.replace("\"\n        \"", "");
        for knob in KNOBS {
            assert!(text.contains(&format!("name=\"{}\"", knob.name)), "{}", knob.name);
            let about = knob.about.split_whitespace().collect::<Vec<_>>().join(" ");
            let first = about.split(". ").next().unwrap_or_default().trim_end_matches('.');
            assert!(text.contains(first), "{}: {first}", knob.name);
            assert!(TileSettings::default().number(knob.setting).is_some(), "{}", knob.setting);
        }
    }

    #[test]
    fn calm_is_a_power_of_four_of_the_default() {
        assert_eq!(smoothness(0.0), 0.02);
        for value in [-1.0, -0.25, 0.5, 1.0] {
            assert!((calm(smoothness(value)) - value).abs() < 1e-5);
        }
        assert!((smoothness(1.0) - 0.08).abs() < 1e-6 && (smoothness(-1.0) - 0.005).abs() < 1e-6);
    }
}
