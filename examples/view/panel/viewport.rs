//! The view of the mesh: one pane or two, with the mouse that orbits and paints.

use eframe::egui::{
    self, Align2, Color32, CursorIcon, FontId, PointerButton, Pos2, Rect, Sense, Stroke, Ui, pos2, vec2,
};

use super::style;
use crate::brush::pick::Hit;
use crate::draw::camera::{Camera, Orbit, View};

/// UVs at which the texture is looked up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Panes {
    Original,
    Redirected,
    SideBySide,
    /// One picture: the original on the left of a line, the redirection on its right.
    Wipe,
}

/// Content of the surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shown {
    Texture,
    Rigidity,
    Strain,
}

/// Settings of the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    pub panes: Panes,
    /// Place of a wipe's line, as a fraction of the width.
    pub wipe: f32,
    pub shown: Shown,
    /// True if grid lines are drawn.
    pub grid: bool,
    /// True if the left mouse button paints.
    pub brush: bool,
    /// True if the panel at the side is there; `None` = if the window is wide enough.
    pub side: Option<bool>,
}

impl Default for Look {
    fn default() -> Look {
        Look {
            panes: Panes::SideBySide,
            wipe: 0.5,
            shown: Shown::Texture,
            grid: false,
            brush: false,
            side: None,
        }
    }
}

/// Cells of the grid from one line to the next.
const EVERY: f32 = 8.0;
/// Strain at the ends of the colours.
const RANGE: f32 = 0.3;
/// Points of the window's width from which the panel at the side is there unasked.
const WIDE: f32 = 1000.0;

impl Look {
    /// True if the panel at the side is there.
    pub fn has_side(&self, width: f32) -> bool {
        self.side.unwrap_or(width >= WIDE)
    }

    /// True for each pane that is redirected.
    pub fn redirected(&self) -> &'static [bool] {
        match self.panes {
            Panes::Original => &[false],
            Panes::Redirected => &[true],
            Panes::SideBySide | Panes::Wipe => &[false, true],
        }
    }

    /// The line of the wipe, if there is one.
    pub fn line(&self) -> Option<f32> {
        (self.panes == Panes::Wipe).then_some(self.wipe)
    }

    /// The place of a pane.
    pub fn pane(&self, area: Rect, pane: usize) -> Rect {
        if self.panes != Panes::SideBySide {
            return area;
        }
        let half = vec2(0.5 * area.width(), area.height());
        Rect::from_min_size(area.min + vec2(pane as f32 * half.x, 0.0), half)
    }

    /// The part of a pane that is seen.
    pub fn seen(&self, area: Rect, pane: usize) -> Rect {
        let place = self.pane(area, pane);
        match self.line().map(|part| area.left() + part * area.width()) {
            None => place,
            Some(x) if pane == 0 => place.with_max_x(x),
            Some(x) => place.with_min_x(x),
        }
    }

    /// The pane at a point, and where in it the point lies.
    pub fn place(&self, area: Rect, at: Pos2) -> (usize, [f32; 2]) {
        let last = self.redirected().len() - 1;
        let pane = usize::from(last > 0 && at.x >= self.seen(area, 1).left());
        let place = self.pane(area, pane);
        (pane, [(at.x - place.left()) / place.width(), (at.y - place.top()) / place.height()])
    }

    /// The views to draw; `cells` is the grid's size along a side, `scale` pixels per point, `overlay` the strength of
    /// the rigidity map over textures.
    pub fn views(&self, camera: &Camera, cells: u32, scale: f32, overlay: f32) -> Vec<View> {
        let lines = if self.grid { cells as f32 / EVERY } else { 0.0 };
        let view = |&redirected: &bool| View {
            clip: camera.clip.to_cols_array_2d(),
            eye: camera.eye.extend(0.0).into(),
            right: camera.right.extend(0.0).into(),
            up: camera.up.extend(0.0).into(),
            redirect: f32::from(u8::from(redirected)),
            shown: self.shown as u8 as f32,
            lines,
            line_width: 1.1 * scale.max(1.0),
            range: RANGE,
            overlay,
            ..View::default()
        };
        self.redirected().iter().map(view).collect()
    }
}

/// Action of the mouse in the view.
#[derive(Default)]
pub struct Mouse {
    /// The pane under it, and where in the pane in units of its width and height.
    pub over: Option<(usize, [f32; 2])>,
    /// True if it paints.
    pub paints: bool,
}

/// Reserves the place, and reads the mouse.
pub fn mouse(ui: &mut Ui, look: &mut Look, orbit: &mut Orbit) -> (Rect, Mouse) {
    let (area, response) = ui.allocate_exact_size(ui.available_size(), Sense::click_and_drag());
    let pane = look.pane(area, 0);
    let camera = orbit.camera(pane.width() / area.height());
    if look.panes == Panes::Wipe {
        let place = look.seen(area, 1);
        let handle = place.with_max_x(place.left()).expand2(vec2(7.0, 0.0));
        let line = ui.interact(handle, ui.scope_id().with("wipe"), Sense::drag());
        if let Some(at) = line.interact_pointer_pos() {
            look.wipe = ((at.x - area.left()) / area.width()).clamp(0.02, 0.98);
        }
        if line.hovered() || line.dragged() {
            ui.set_cursor_icon(CursorIcon::ResizeHorizontal);
        }
    }
    let mut mouse = Mouse::default();
    let shift = ui.input(|i| i.modifiers.shift);
    let held = |button| response.dragged_by(button);
    let way = response.drag_delta();
    let free = !look.brush;
    if held(PointerButton::Middle) || (shift && free && held(PointerButton::Primary)) {
        orbit.pan(&camera, [way.x / area.height(), way.y / area.height()]);
    } else if held(PointerButton::Secondary) || (free && held(PointerButton::Primary)) {
        orbit.turn([way.x, way.y]);
    }
    if response.hovered() {
        let (wheel, pinch) = ui.input(|i| (i.smooth_scroll_delta.y, i.zoom_delta()));
        let factor = (0.0016 * wheel).exp() * pinch;
        if factor != 1.0 {
            orbit.dolly(factor);
        }
    }
    let pointer =
        ui.input(|i| i.pointer.latest_pos()).filter(|&at| response.contains_pointer() && area.contains(at));
    mouse.over = pointer.map(|at| look.place(area, at));
    // The button may go down, move and up again between two passes over the window.
    let held =
        response.is_pointer_button_down_on() && ui.input(|i| i.pointer.button_down(PointerButton::Primary));
    mouse.paints =
        look.brush && (held || response.clicked() || response.drag_stopped_by(PointerButton::Primary));
    if look.brush && mouse.over.is_some() {
        ui.set_cursor_icon(CursorIcon::Crosshair);
    }
    (area, mouse)
}

/// Draws what lies over the picture: names of panes, the legend, the brush.
pub fn overlay(ui: &Ui, area: Rect, look: &Look, has_strain: bool) {
    let painter = ui.painter_at(area);
    for (k, &redirected) in look.redirected().iter().enumerate() {
        let place = look.seen(area, k);
        let name = if redirected { "redirected" } else { "original" };
        let font = FontId::proportional(13.0);
        // Beside the line of a wipe, where the eye is.
        let (at, align) = match (look.panes, k) {
            (Panes::Wipe, 0) => (place.right_top() + vec2(-14.0, 12.0), Align2::RIGHT_TOP),
            _ => (place.left_top() + vec2(14.0, 12.0), Align2::LEFT_TOP),
        };
        let text = painter.layout_no_wrap(name.into(), font, style::QUIET);
        // A part that is too narrow for its name goes without.
        if text.size().x + 20.0 < place.width() {
            let place = align.anchor_size(at, text.size());
            painter.rect_filled(place.expand2(vec2(6.0, 3.0)), 4.0, style::BACK.gamma_multiply(0.8));
            painter.galley(place.min, text, style::QUIET);
        }
        if k > 0 {
            let (colour, width) =
                if look.panes == Panes::Wipe { (style::TEXT, 1.5) } else { (style::LINE, 1.0) };
            painter.line_segment([place.left_top(), place.left_bottom()], Stroke::new(width, colour));
            if look.panes == Panes::Wipe {
                let handle = Rect::from_center_size(place.left_center(), vec2(10.0, 34.0));
                painter.rect_filled(handle, 5.0, style::TEXT);
            }
        }
    }
    if look.shown == Shown::Strain && has_strain {
        legend(&painter, area);
    }
}

fn legend(painter: &egui::Painter, area: Rect) {
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
        (bar.left(), Align2::LEFT_TOP, -RANGE),
        (bar.center().x, Align2::CENTER_TOP, 0.0),
        (bar.right(), Align2::RIGHT_TOP, RANGE),
    ] {
        let value = if value == 0.0 { "0".into() } else { format!("{value:+.2}") };
        text(x, bar.bottom() + 3.0, align, value);
    }
    text(bar.left(), bar.top() - 4.0, Align2::LEFT_BOTTOM, "squeezed".into());
    text(bar.right(), bar.top() - 4.0, Align2::RIGHT_BOTTOM, "stretched".into());
}

/// The brush's outline: a circle on the plane that touches the surface.
pub fn outline(ui: &Ui, (pane, seen): (Rect, Rect), camera: &Camera, hit: &Hit, radius: f32) {
    let painter = ui.painter_at(seen);
    let (a, b) = hit.normal.any_orthonormal_pair();
    let points: Vec<Pos2> = (0..48)
        .filter_map(|k| {
            let (sin, cos) = (k as f32 / 48.0 * std::f32::consts::TAU).sin_cos();
            let point = hit.position + radius * (cos * a + sin * b);
            let [x, y, _] = camera.project(point)?;
            Some(pane.lerp_inside(vec2(x, y)))
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
        let one = Look { panes: Panes::Original, ..Look::default() };
        assert_eq!(one.place(area, pos2(210.0, 70.0)), (0, [0.5, 0.5]));
        let both = Look::default();
        assert_eq!(both.place(area, pos2(110.0, 20.0)), (0, [0.5, 0.0]));
        let (pane, [x, y]) = both.place(area, pos2(310.0, 120.0));
        assert!(pane == 1 && (x - 0.5).abs() < 1e-6 && y == 1.0);
        assert_eq!(both.place(area, pos2(410.0, 20.0)).0, 1, "the right edge");
    }

    #[test]
    fn the_line_of_a_wipe_parts_one_picture() {
        let area = Rect::from_min_size(pos2(10.0, 20.0), vec2(400.0, 100.0));
        let wipe = Look { panes: Panes::Wipe, wipe: 0.25, ..Look::default() };
        assert_eq!(wipe.place(area, pos2(90.0, 70.0)), (0, [0.2, 0.5]));
        assert_eq!(wipe.place(area, pos2(210.0, 70.0)), (1, [0.5, 0.5]));
        assert_eq!([0, 1].map(|k| wipe.seen(area, k).width()), [100.0, 300.0]);
        assert_eq!([0, 1].map(|k| wipe.pane(area, k)), [area; 2]);
    }
}
