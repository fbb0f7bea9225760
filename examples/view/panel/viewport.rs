//! The view of the mesh: one pane or two, with the mouse that orbits and paints.

use eframe::egui::{
    self, Align2, Color32, CursorIcon, FontId, PointerButton, Pos2, Rect, Response, Sense, Stroke, Ui, pos2,
    vec2,
};

use super::style;
use crate::brush::pick::Hit;
use crate::draw::camera::{Camera, Orbit, View};
use crate::model::plus;

/// Which UVs the texture is looked up by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Panes {
    Original,
    Redirected,
    SideBySide,
}

/// What the surface shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    Texture,
    Rigidity,
    Strain,
}

/// How the mesh is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    pub panes: Panes,
    pub shown: Shown,
    /// Whether lines of the grid are drawn, and how many cells apart.
    pub grid: bool,
    pub every: u32,
    /// Strain at the ends of the colours.
    pub range: f32,
    /// Whether the left mouse button paints.
    pub brush: bool,
}

impl Look {
    /// Whether each pane is redirected.
    pub fn redirected(&self) -> &'static [bool] {
        match self.panes {
            Panes::Original => &[false],
            Panes::Redirected => &[true],
            Panes::SideBySide => &[false, true],
        }
    }

    /// The views to draw; `cells` is the grid's size along a side, `scale` pixels per point.
    pub fn views(&self, camera: &Camera, cells: u32, scale: f32) -> Vec<View> {
        let wide = |[x, y, z]: [f32; 3]| [x, y, z, 0.0];
        let lines = if self.grid { cells as f32 / self.every as f32 } else { 0.0 };
        let view = |&redirected: &bool| View {
            clip: camera.clip(),
            eye: wide(camera.eye),
            right: wide(camera.right),
            up: wide(camera.up),
            redirect: f32::from(u8::from(redirected)),
            shown: self.shown as u8 as f32,
            lines,
            line_width: 1.1 * scale.max(1.0),
            range: self.range,
            ..View::default()
        };
        self.redirected().iter().map(view).collect()
    }
}

/// What the mouse did in the view.
#[derive(Default)]
pub struct Mouse {
    /// Whether it orbits, pans or comes closer.
    pub moves: bool,
    /// The pane under it, and where in the pane in units of its width and height.
    pub over: Option<(usize, [f32; 2])>,
    /// Whether it paints.
    pub paints: bool,
}

/// Reserves the place, and reads the mouse.
pub fn mouse(ui: &mut Ui, look: &Look, orbit: &mut Orbit) -> (Rect, Response, Mouse) {
    let (area, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
    let count = look.redirected().len();
    let width = area.width() / count as f32;
    let camera = orbit.camera(width / area.height());
    let mut mouse = Mouse::default();
    let (alt, shift) = ui.input(|i| (i.modifiers.alt, i.modifiers.shift));
    let held = |button| response.dragged_by(button);
    let way = response.drag_delta();
    let free = !look.brush || alt;
    if held(PointerButton::Middle) || (shift && free && held(PointerButton::Primary)) {
        orbit.pan(&camera, [way.x / area.height(), way.y / area.height()]);
        mouse.moves = true;
    } else if held(PointerButton::Secondary) || (free && held(PointerButton::Primary)) {
        orbit.turn([way.x, way.y]);
        mouse.moves = true;
    }
    if response.hovered() {
        let (wheel, pinch) = ui.input(|i| (i.smooth_scroll_delta.y, i.zoom_delta()));
        let factor = (0.0016 * wheel).exp() * pinch;
        if factor != 1.0 {
            orbit.dolly(factor);
            mouse.moves = true;
        }
    }
    let pointer =
        ui.input(|i| i.pointer.latest_pos()).filter(|&at| response.contains_pointer() && area.contains(at));
    mouse.over = pointer.map(|at| place(area, count, at));
    // The button may go down, move and up again between two passes over the window.
    let held =
        response.is_pointer_button_down_on() && ui.input(|i| i.pointer.button_down(PointerButton::Primary));
    mouse.paints = look.brush
        && !alt
        && (held || response.clicked() || response.drag_stopped_by(PointerButton::Primary));
    if look.brush && mouse.over.is_some() {
        ui.set_cursor_icon(CursorIcon::Crosshair);
    }
    (area, response, mouse)
}

/// The pane of a point, and where in it the point lies.
pub fn place(area: Rect, count: usize, at: Pos2) -> (usize, [f32; 2]) {
    let part = ((at.x - area.left()) / area.width() * count as f32).clamp(0.0, count as f32 - 1e-3);
    (part as usize, [part.fract(), (at.y - area.top()) / area.height()])
}

/// Draws what lies over the picture: names of panes, the legend, the brush.
pub fn overlay(ui: &Ui, area: Rect, look: &Look, has_strain: bool) {
    let painter = ui.painter_at(area);
    let count = look.redirected().len();
    let width = area.width() / count as f32;
    for (k, &redirected) in look.redirected().iter().enumerate() {
        let left = area.left() + k as f32 * width;
        let name = if redirected { "redirected" } else { "original" };
        let font = FontId::proportional(13.0);
        painter.text(pos2(left + 14.0, area.top() + 12.0), Align2::LEFT_TOP, name, font, style::QUIET);
        if k > 0 {
            painter.line_segment(
                [pos2(left, area.top()), pos2(left, area.bottom())],
                Stroke::new(1.0, style::LINE),
            );
        }
    }
    if look.shown == Shown::Strain && has_strain {
        legend(&painter, area, look.range);
    }
}

fn legend(painter: &egui::Painter, area: Rect, range: f32) {
    let bar = Rect::from_min_size(pos2(area.left() + 16.0, area.bottom() - 40.0), vec2(220.0, 10.0));
    let steps = 44;
    for k in 0..steps {
        let part = |k: i32| bar.left() + bar.width() * k as f32 / steps as f32;
        let t = 2.0 * (k as f32 + 0.5) / steps as f32 - 1.0;
        let box_ = Rect::from_min_max(pos2(part(k), bar.top()), pos2(part(k + 1) + 0.5, bar.bottom()));
        painter.rect_filled(box_, 0.0, style::strain(t));
    }
    let text = |x: f32, y: f32, align: Align2, text: String| {
        painter.text(pos2(x, y), align, text, FontId::proportional(11.0), style::TEXT);
    };
    for (x, align, value) in [
        (bar.left(), Align2::LEFT_TOP, -range),
        (bar.center().x, Align2::CENTER_TOP, 0.0),
        (bar.right(), Align2::RIGHT_TOP, range),
    ] {
        let value = if value == 0.0 { "0".into() } else { format!("{value:+.2}") };
        text(x, bar.bottom() + 3.0, align, value);
    }
    text(bar.left(), bar.top() - 4.0, Align2::LEFT_BOTTOM, "squeezed".into());
    text(bar.right(), bar.top() - 4.0, Align2::RIGHT_BOTTOM, "stretched".into());
}

/// The brush's outline: a circle on the plane that touches the surface.
pub fn outline(ui: &Ui, area: Rect, (count, pane): (usize, usize), camera: &Camera, hit: &Hit, radius: f32) {
    let painter = ui.painter_at(area);
    let width = area.width() / count as f32;
    let left = area.left() + pane as f32 * width;
    let [a, b] = camera.tangents(hit.normal);
    let points: Vec<Pos2> = (0..48)
        .filter_map(|k| {
            let (sin, cos) = (k as f32 / 48.0 * std::f32::consts::TAU).sin_cos();
            let point = plus(plus(hit.position, a, radius * cos), b, radius * sin);
            let [x, y, _] = camera.project(point)?;
            Some(pos2(left + x * width, area.top() + y * area.height()))
        })
        .collect();
    // Dark under light, so that it is seen on any surface.
    painter.add(egui::Shape::closed_line(points.clone(), Stroke::new(3.0, Color32::from_black_alpha(140))));
    painter.add(egui::Shape::closed_line(points, Stroke::new(1.4, Color32::from_rgb(255, 236, 200))));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panes_lie_side_by_side() {
        let area = Rect::from_min_size(pos2(10.0, 20.0), vec2(400.0, 100.0));
        assert_eq!(place(area, 1, pos2(210.0, 70.0)), (0, [0.5, 0.5]));
        assert_eq!(place(area, 2, pos2(110.0, 20.0)), (0, [0.5, 0.0]));
        let (pane, [x, y]) = place(area, 2, pos2(310.0, 120.0));
        assert!(pane == 1 && (x - 0.5).abs() < 1e-6 && y == 1.0);
        assert_eq!(place(area, 2, pos2(410.0, 20.0)).0, 1, "the right edge");
    }
}
