//! What can be opened.

use eframe::egui::{self, Rect, RichText, Ui, Vec2, vec2};

use super::bar::Wish;
use super::style;
use crate::app::dialogs::Ask;
use crate::source::Files;
use vrtm_testkit::scenes;

/// Shows the menu's content; `path` is the text of its field.
pub fn show(ui: &mut Ui, path: &mut String, mut noted: impl FnMut(&str, Rect)) -> Option<Wish> {
    let mut wish = None;
    let quiet = |text: &str| RichText::new(text).color(style::QUIET);
    ui.label(quiet("your own files; or drop them on the window"));
    for (ask, name, about) in [
        (Ask::Rest, "mesh at rest...", "An OBJ file with UVs, or a glTF file with its poses and textures"),
        (
            Ask::Poses,
            "poses...",
            "OBJ or .f32 files with the vertices of an OBJ at rest; what is painted stays",
        ),
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
        let hint = "path of an OBJ or glTF file, or a folder";
        let field = ui.add(egui::TextEdit::singleline(path).desired_width(220.0).hint_text(hint));
        let entered = field.lost_focus() && ui.input(|i| i.key_pressed(egui::Key::Enter));
        if (ui.button("open").clicked() || entered) && !path.trim().is_empty() {
            wish = Some(Wish::Path(path.trim().into()));
            ui.close();
        }
    });
    ui.separator();
    ui.label(quiet("built-in scenes"));
    let sheet = sheet(ui);
    egui::Grid::new("scenes").spacing(vec2(6.0, 4.0)).show(ui, |ui| {
        for (k, scene) in scenes::NAMES.into_iter().enumerate() {
            let image = egui::Image::new((sheet.id(), THUMBNAIL)).uv(place(k));
            let item = ui.vertical(|ui| {
                ui.spacing_mut().item_spacing.y = 0.0;
                let item = ui.add(egui::Button::image(image));
                ui.label(RichText::new(scene).small());
                item
            });
            noted(&format!("scene {scene}"), item.inner.rect);
            if item.inner.clicked() {
                wish = Some(Wish::Open(Files { scene: Some(scene.into()), ..Files::default() }));
                ui.close();
            }
            if k % COLUMNS == COLUMNS - 1 {
                ui.end_row();
            }
        }
    });
    wish
}

/// Pictures of all scenes, in the order of their names, row by row.
const SHEET: &[u8] = include_bytes!("scenes.png");
const COLUMNS: usize = 5;
/// Size of each of them in the menu; in the sheet it is twice that.
const THUMBNAIL: Vec2 = vec2(64.0, 48.0);

/// The part of the sheet that shows a scene.
fn place(scene: usize) -> Rect {
    let rows = scenes::NAMES.len().div_ceil(COLUMNS);
    let part = vec2(1.0 / COLUMNS as f32, 1.0 / rows as f32);
    let at = vec2((scene % COLUMNS) as f32, (scene / COLUMNS) as f32);
    Rect::from_min_size((at * part).to_pos2(), part)
}

/// The sheet, read once.
fn sheet(ui: &Ui) -> egui::TextureHandle {
    let id = egui::Id::unique("sheet of scenes");
    if let Some(sheet) = ui.ctx().data(|data| data.get_temp(id)) {
        return sheet;
    }
    let image = image::load_from_memory(SHEET).map(|image| image.into_rgba8()).unwrap_or_default();
    let size = [image.width(), image.height()].map(|side| side as usize);
    let image = egui::ColorImage::from_rgba_unmultiplied(size, &image);
    let sheet = ui.ctx().load_texture("scenes", image, egui::TextureOptions::LINEAR);
    ui.ctx().data_mut(|data| data.insert_temp(id, sheet.clone()));
    sheet
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_scene_has_its_place_in_the_sheet() {
        let sheet = image::load_from_memory(SHEET).expect("a PNG").into_rgb8();
        let [width, height] = [sheet.width(), sheet.height()].map(|side| side as f32);
        assert_eq!([width, height], [COLUMNS as f32 * 2.0 * THUMBNAIL.x, 2.0 * 2.0 * THUMBNAIL.y]);
        for k in 0..scenes::NAMES.len() {
            // Each shows something before the same dark ground.
            let [x, y] = [place(k).left() * width, place(k).top() * height].map(|x| x.round() as u32);
            let light = |&&[dx, dy]: &&[u32; 2]| sheet.get_pixel(x + dx, y + dy).0.iter().any(|&v| v > 45);
            let all: Vec<[u32; 2]> = (0..96).flat_map(|dy| (0..128).map(move |dx| [dx, dy])).collect();
            assert!(all.iter().filter(light).count() > all.len() / 12, "{k}");
            assert!(!light(&&[2, 2]), "{k}");
        }
    }
}
