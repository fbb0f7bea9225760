//! The brush in the view: where it is, and what a stroke changes.

use eframe::egui::{Key, Modifiers, Ui, Vec2};
use serde_json::json;

use super::{App, Open};
use crate::brush::kind::{Brush, Click};
use crate::brush::mirror;
use crate::brush::pick::Hit;
use crate::brush::steps::Change;
use crate::brush::textures::{Source, colour};
use crate::draw::camera::Camera;
use crate::model::Model;
use crate::panel::brush::BrushWish;
use crate::panel::viewport::Mouse;
use crate::solve::answer::Solved;
use crate::solve::inbox::Edit;

/// The brush between two passes over the window.
#[derive(Default)]
pub struct Stroke {
    /// The pane under the mouse, the point of the surface there, and the brush's radius in space.
    pub under: Option<(usize, Hit, f32)>,
    /// The pane and the place of the last dab.
    last: Option<(usize, [f32; 2])>,
}

/// Dabs per radius along a stroke.
const DENSITY: f32 = 3.0;
/// Most dabs per pass, so that a sudden move of the mouse does not stall the window.
const MOST: usize = 64;

impl App {
    pub(super) fn brush_keys(&mut self, ui: &Ui) {
        if ui.ctx().egui_wants_keyboard_input() || !self.look.brush {
            return;
        }
        let again = Modifiers::COMMAND | Modifiers::SHIFT;
        // The longer one first: that without Shift would take it.
        for (modifiers, key, wish) in [
            (again, Key::Z, BrushWish::Redo),
            (Modifiers::COMMAND, Key::Y, BrushWish::Redo),
            (Modifiers::COMMAND, Key::Z, BrushWish::Undo),
        ] {
            if ui.input_mut(|i| i.consume_key(modifiers, key)) {
                self.brush_wish(wish);
            }
        }
        let pressed = |key| ui.input(|i| i.key_pressed(key));
        self.brush.erase ^= pressed(Key::E);
        self.brush.symmetry ^= pressed(Key::X);
        for (key, factor) in [(Key::OpenBracket, 1.0 / 1.2), (Key::CloseBracket, 1.2)] {
            if pressed(key) {
                self.brush.radius = (self.brush.radius * factor).clamp(2.0, 200.0);
            }
        }
    }

    /// Follows the mouse in panes of this size, and paints if its button is held. Returns whether it does.
    pub(super) fn paint(&mut self, ui: &Ui, size: Vec2, camera: &Camera, mouse: &Mouse) -> bool {
        let Some(open) = &mut self.open else { return false };
        self.stroke.under = None;
        if !mouse.paints {
            self.stroke.last = None;
            open.painter.end();
        }
        let Some((pane, at)) = mouse.over.filter(|_| self.look.brush) else { return mouse.paints };
        let Some(answer) = &self.shown else { return false };
        let positions = &answer.positions;
        let model = &open.model;
        let mut hits: Vec<(Hit, f32)> = Vec::new();
        let from = self.stroke.last.filter(|(of, _)| mouse.paints && *of == pane).map_or(at, |(_, at)| at);
        let way = [0, 1].map(|c| (at[c] - from[c]) * size[c]);
        let steps = (way[0].hypot(way[1]) / self.brush.radius * DENSITY).ceil().max(1.0) as usize;
        for k in 1..=steps.min(MOST) {
            let t = k as f32 / steps.min(MOST) as f32;
            let at = [0, 1].map(|c| from[c] + (at[c] - from[c]) * t);
            let radius = |hit: &Hit| self.brush.radius / size.y * camera.height(hit.position);
            hits.extend(Hit::pick(model, positions, camera, at).map(|hit| (hit, radius(&hit))));
        }
        self.stroke.under = hits.last().map(|&(hit, radius)| (pane, hit, radius));
        if !mouse.paints {
            return false;
        }
        // A mouse that is held still paints nothing new.
        let before = self.stroke.last.replace((pane, at));
        if before == Some((pane, at)) {
            return true;
        }
        let erase = self.brush.erase ^ ui.input(|i| i.modifiers.command);
        let brush = Brush { erase, ..self.brush };
        if brush.symmetry {
            let plane = mirror::plane(model);
            let other = |&(ref hit, radius): &(Hit, f32)| {
                mirror::opposite(model, positions, hit, plane, radius).map(|hit| (hit, radius))
            };
            hits.extend(hits.iter().filter_map(other).collect::<Vec<_>>());
        }
        let seen = self.look.redirected()[pane].then_some(answer.tiles.as_slice());
        if brush.click != Click::Paint {
            // One press fills once.
            if before.is_none() {
                let fill = |(hit, _): &(Hit, f32)| match brush.click {
                    Click::Colour => {
                        let (page, uv) = texture_place(model, seen, hit);
                        let colours = &open.pictures.colours;
                        let taken = colours[page].as_ref().map(|image| Source::Colour(colour(image, uv)));
                        taken.map(|taken| open.painter.take(colours, taken, &brush)).unwrap_or_default()
                    }
                    _ => open.painter.fill_island(model, hit.triangle, &brush),
                };
                let changes = hits.iter().flat_map(fill).collect();
                self.send(changes);
            }
            return true;
        }
        let changes = open.painter.dab(model, positions, seen, &hits, &brush);
        self.send(changes);
        true
    }

    /// Does what a button of the brush asks for.
    pub(super) fn brush_wish(&mut self, wish: BrushWish) {
        let Some(Open { painter, model, pictures, .. }) = &mut self.open else { return };
        let changes = match wish {
            BrushWish::Undo => painter.undo(),
            BrushWish::Redo => painter.redo(),
            BrushWish::Use(tool) => painter.change(model, tool),
            BrushWish::Take(source) => painter.take(&pictures.colours, source, &self.brush),
        };
        self.send(changes);
    }

    /// Hands changed rectangles to the picture and to the solving thread.
    fn send(&mut self, changes: Vec<Change>) {
        let Some(open) = &mut self.open else { return };
        for Change { page, rect, .. } in changes {
            open.scene.paint(&self.gpu, &open.painter.canvases, page, rect);
            let facts =
                json!({ "tile": open.model.pages[page].udim, "first": rect.first, "size": rect.size });
            self.trace.event("paint", facts);
            let texels = open.painter.canvases[page].copy(rect);
            self.worker.inbox.post(Edit::Paint { page, rect, texels });
            self.flow.edit += 1;
            self.screen.changed();
        }
    }
}

/// The page of a point of the surface, and the UV of what its texture shows there.
fn texture_place(model: &Model, seen: Option<&[Solved]>, hit: &Hit) -> (usize, [f32; 2]) {
    let tile = model.tile_of(hit.triangle);
    let uv = model.surface.uv(hit.triangle, hit.weights);
    (model.tiles[tile].page, seen.map_or(uv, |seen| seen[tile].maps.redirected(uv)))
}
