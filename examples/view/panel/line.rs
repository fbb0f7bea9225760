//! The timeline at the bottom.

use eframe::egui::{
    self, Align2, Event, FontId, PointerButton, Pos2, Rect, RichText, Sense, Stroke, Ui, pos2, vec2,
};

use super::figures::{self, History};
use super::style;
use crate::model::Model;
use crate::timeline::Timeline;

/// Shows the timeline, and the plot of what is known under it; `noted` learns where its parts are. Returns whether it
/// is being dragged.
pub fn show(
    ui: &mut Ui,
    line: &mut Timeline,
    (model, history): (&Model, Option<&History>),
    now: f64,
    mut noted: impl FnMut(&str, Rect),
) -> bool {
    let (mut dragged, mut ends) = (false, [0.0; 2]);
    ui.horizontal(|ui| {
        let mut button = |ui: &mut Ui, name: &str, icon: &str, about: &str| {
            let response = ui.add(egui::Button::new(icon).min_size(vec2(34.0, 28.0))).on_hover_text(about);
            noted(name, response.rect);
            response.clicked()
        };
        if button(ui, "previous key", "⏮", "The key before this frame: rest, or a pose (Page Up)") {
            line.step_to_key(false);
        }
        let (icon, about) = if line.is_playing() { ("⏸", "Stop (space)") } else { ("▶", "Play (space)") };
        if button(ui, "play", icon, about) {
            line.toggle(now);
        }
        if button(ui, "next key", "⏭", "The key after this frame (Page Down)") {
            line.step_to_key(true);
        }
        let number = RichText::new(format!("{:>4}", line.number(line.frame)))
            .monospace()
            .size(18.0)
            .color(style::ACCENT);
        ui.label(number);
        ui.label(RichText::new(format!("of {}", line.number(line.last))).color(style::QUIET));
        ui.add_space(6.0);

        let (area, response) =
            ui.allocate_exact_size(vec2(ui.available_width(), 34.0), Sense::click_and_drag());
        let track =
            Rect::from_min_max(area.min + vec2(10.0, 13.0), pos2(area.right() - 10.0, area.top() + 19.0));
        noted("timeline", track);
        let x_of = |frame: usize| {
            let part = (frame - 1) as f32 / (line.last.max(2) - 1) as f32;
            track.left() + part * track.width()
        };
        let painter = ui.painter();
        painter.rect_filled(track, 3.0, style::BACK);
        let past = Rect::from_min_max(track.min, pos2(x_of(line.frame), track.bottom()));
        painter.rect_filled(past, 3.0, style::ACCENT.gamma_multiply(0.45));
        let mut free = f32::MIN;
        for (key, &frame) in line.keys.iter().enumerate() {
            let x = x_of(frame);
            let colour = if frame == line.frame { style::ACCENT } else { style::QUIET };
            painter.line_segment(
                [pos2(x, track.top() - 3.0), pos2(x, track.bottom() + 3.0)],
                Stroke::new(1.5, colour),
            );
            let (name, align) = match key {
                0 => ("rest".into(), Align2::LEFT_TOP),
                _ if key + 1 == line.keys.len() => (line.label(key), Align2::RIGHT_TOP),
                _ => (line.label(key), Align2::CENTER_TOP),
            };
            let place = pos2(x, track.bottom() + 4.0);
            let text = painter.layout_no_wrap(name, FontId::proportional(10.0), colour);
            let place = align.anchor_size(place, text.size());
            // Of keys that lie close together only some have their names.
            if place.left() > free {
                free = place.right() + 8.0;
                painter.galley(place.min, text, colour);
            }
        }
        let at = pos2(x_of(line.frame), track.center().y);
        painter.circle_filled(at, 7.0, style::ACCENT);
        painter.circle_filled(at, 3.0, style::PANEL);
        let frame_at = |x: f32| {
            let part = ((x - track.left()) / track.width()).clamp(0.0, 1.0);
            1 + (part * (line.last - 1) as f32).round() as usize
        };
        if let Some(at) = response.hover_pos().filter(|_| !response.dragged()) {
            let near = line.keys.iter().position(|&frame| (x_of(frame) - at.x).abs() < 6.0);
            let text =
                near.map_or_else(|| format!("frame {}", line.number(frame_at(at.x))), |key| model.note(key));
            response.clone().on_hover_text_at_pointer(text);
        }
        // The button may go down, move and up again between two passes over the window.
        let held = response.is_pointer_button_down_on();
        if (held || response.clicked() || response.drag_stopped())
            && let Some(at) = pointer(ui)
        {
            line.go(frame_at(at.x));
            dragged = held;
        }
        ends = [track.left(), track.right()];
    });
    let Some(history) = history else { return dragged };
    if line.keys.len() == 1 {
        let text =
            "The mesh at rest, to paint on. Add poses in the menu open, or drop their files on the window.";
        ui.label(RichText::new(text).color(style::QUIET));
        return dragged;
    }
    let [left, right] = ends;
    let last = line.last;
    let x_of = |frame: usize| left + (frame - 1) as f32 / (last.max(2) - 1) as f32 * (right - left);
    figures::plot(ui, history, x_of, [left, right], 30.0);
    dragged
}

/// Place of the mouse, or of the release of its button: it may have moved since.
fn pointer(ui: &Ui) -> Option<Pos2> {
    ui.input(|i| {
        let released = |event: &Event| match *event {
            Event::PointerButton { pos, button: PointerButton::Primary, pressed: false, .. } => Some(pos),
            _ => None,
        };
        i.events.iter().find_map(released).or(i.pointer.latest_pos())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fonts_have_the_icons() {
        let context = egui::Context::default();
        context.run_ui(Default::default(), |_| {}).textures_delta.clear();
        let font = egui::FontId::proportional(13.0);
        assert!(context.fonts_mut(|fonts| fonts.has_glyphs(&font, "⏮⏸▶⏭")));
    }
}
