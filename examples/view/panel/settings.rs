//! The settings of solves, under the names of the C header and with its words.

use eframe::egui::{self, ComboBox, Slider, SliderClamping, Ui};
use vrtm::{OpenBorders, Overlap, Quality, Seams, TileSettings};

use super::side::row;

/// What solves are asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    pub quality: Quality,
    pub tile: TileSettings,
}

const QUALITIES: [(Quality, &str, &str); 2] = [
    (Quality::Draft, "draft", "A preview: solved on half as many cells along each axis."),
    (
        Quality::Normal,
        "normal",
        "One correction on each level, and more on the finest level in crowded charts; the default.",
    ),
];

/// Shows the settings; `noted` learns where each of them is. Returns whether one is being dragged.
pub fn show(ui: &mut Ui, settings: &mut Settings, mut noted: impl FnMut(&str, egui::Rect)) -> bool {
    let mut dragged = false;
    row(ui, "quality", "How much work a solve does on each level of its grid.", |ui| {
        ui.spacing_mut().item_spacing.x = 2.0;
        for (quality, name, about) in QUALITIES {
            let chosen = ui.selectable_label(settings.quality == quality, name).on_hover_text(about);
            noted(&format!("quality {name}"), chosen.rect);
            if chosen.clicked() {
                settings.quality = quality;
            }
        }
    });
    let tile = &mut settings.tile;
    // 0 = as many as resolve the features, then 64, 128, ... cells.
    let mut step = tile.grid[0].map_or(0, |cells| cells.ilog2() as i32 - 5);
    let cells = |step: i32| (step > 0).then(|| 32u32 << step);
    let slider = Slider::new(&mut step, 0..=6)
        .custom_formatter(move |step, _| cells(step as i32).map_or("auto".into(), |cells| cells.to_string()))
        .custom_parser(|text| match text.trim().parse::<u32>() {
            Ok(cells) => Some(f64::from(cells.clamp(64, 2048)).log2().round() - 5.0),
            Err(_) => Some(0.0),
        });
    let about = "Cells of the grid in u and v: the resolution of the solve. auto = as many as resolve the rigid features.";
    let response = row(ui, "grid", about, |ui| ui.add(slider));
    noted("grid", response.rect);
    dragged |= response.dragged();
    if response.changed() {
        tile.grid = [cells(step); 2];
    }
    for setting in TileSettings::SETTINGS {
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
    choice(
        ui,
        (
            "overlap",
            "Which chart moves texels that several charts of a tile share, or that a chart shares with itself.",
        ),
        &mut tile.overlap,
        &[
            (Overlap::Fixed, "fixed", "Shared texels do not move, so that nothing gets worse; the default."),
            (
                Overlap::FirstFace,
                "first_face",
                "The chart with the first face moves them: for mirrored halves that deform alike.",
            ),
        ],
    );
    // `continue` needs a texture that shows what lies beyond the seams, which the painted material does not.
    choice(
        ui,
        (
            "seams",
            "What happens where the surface goes on beyond a chart's border, elsewhere in the UV plane.",
        ),
        &mut tile.seams,
        &[
            (Seams::Shut, "shut", "Nothing moves at a border, and any texture will do; the default."),
            (
                Seams::Keep,
                "keep",
                "Rigid features that touch a border of their chart stay as they were, whole, and their \
                                   elastic surroundings give way: never half of a feature.",
            ),
        ],
    );
    choice(
        ui,
        ("open_borders", "What happens at a border of a chart beyond which the surface ends."),
        &mut tile.open_borders,
        &[
            (OpenBorders::Fixed, "fixed", "Nothing moves at an open border; the default."),
            (
                OpenBorders::Slide,
                "slide",
                "Texture slides along open borders, as if the surface were mirrored there, so \
                                           that a feature at a border keeps its shape; only with an orientation_density \
                                           of 0.",
            ),
        ],
    );
    let mut back = ui.button("defaults").on_hover_text("All settings of tiles as they were");
    noted("defaults", back.rect);
    if back.clicked() {
        *tile = TileSettings::default();
        back.mark_changed();
    }
    dragged
}

fn choice<T: Copy + PartialEq>(
    ui: &mut Ui,
    (name, about): (&str, &str),
    value: &mut T,
    all: &[(T, &str, &str)],
) {
    let now = all.iter().find(|(of, ..)| of == value).map_or("", |(_, name, _)| name);
    row(ui, name, about, |ui| {
        ComboBox::from_id_salt(name).width(118.0).selected_text(now).show_ui(ui, |ui| {
            for &(of, name, about) in all {
                ui.selectable_value(value, of, name).on_hover_text(about);
            }
        });
    });
}
