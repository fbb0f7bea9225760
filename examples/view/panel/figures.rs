//! Milliseconds and strain of the frame that is shown, and of all frames so far.

use eframe::egui::{self, Color32, Pos2, RichText, Sense, Stroke, Ui, pos2, vec2};

use super::style;
use crate::solve::answer::{Answer, Strain};
use crate::solve::inbox::Purpose;

/// The figures of all frames that were solved since the last edit.
#[derive(Default)]
pub struct History {
    edit: u64,
    frames: Vec<Option<(f64, Option<Strain>)>>,
}

impl History {
    pub fn learn(&mut self, answer: &Answer) {
        let request = &answer.request;
        if self.edit != request.edit || self.frames.len() != request.last {
            self.frames = vec![None; request.last];
            self.edit = request.edit;
        }
        if let Some(frame) = self.frames.get_mut(request.frame - 1) {
            let strain = answer.strain().or(frame.and_then(|(_, strain)| strain));
            *frame = Some((answer.solve_ms, strain));
        }
    }

    pub fn strain(&self, frame: usize) -> Option<Strain> {
        self.frames.get(frame - 1).copied().flatten().and_then(|(_, strain)| strain)
    }

    /// Frames, from 1, with their strain, after and before.
    pub fn strains(&self) -> impl Iterator<Item = (usize, [f32; 2])> + '_ {
        (1..).zip(&self.frames).filter_map(|(frame, known)| Some((frame, known.as_ref()?.1?.rms)))
    }
}

/// Shows the figures of a result.
pub fn show(ui: &mut Ui, answer: &Answer, history: &History, draw_ms: f64) {
    let strain = answer.strain().or_else(|| history.strain(answer.request.frame));
    let (text, [before, after]) = words(strain.map(|strain| strain.rms));
    ui.label(RichText::new(text).color(after));
    egui::Grid::new("figures").num_columns(3).spacing(vec2(14.0, 3.0)).show(ui, |ui| {
        let quiet = |text: &str| RichText::new(text).color(style::QUIET);
        let number = |text: String| RichText::new(text).monospace();
        ui.label("");
        ui.label(quiet("before"));
        ui.label(quiet("after"));
        ui.end_row();
        let rows = [
            (
                "strain, RMS",
                strain.map(|s| s.rms),
                "Root of the mean square of the relative change of length inside rigid features, measured on the mesh.",
            ),
            (
                "95 % below",
                strain.map(|s| s.p95),
                "95 % of all lengths inside rigid features change by less (of the worst tile).",
            ),
        ];
        for (name, values, about) in rows {
            ui.label(name).on_hover_text(about);
            for (k, colour) in [(0, before), (1, after)] {
                let text = values.map_or("-".into(), |v| format!("{:5.1} %", 100.0 * v[k]));
                ui.label(number(text).color(colour));
            }
            ui.end_row();
        }
        if let Some([features, worse]) = strain.map(|s| s.features).filter(|[features, _]| *features > 0) {
            ui.label("worse features").on_hover_text(
                "Painted features whose strain is larger than without the warp, by more than .02: ringed in the \
                 view of strain, of each tile sixteen at most.",
            );
            ui.label("");
            ui.label(number(format!("{worse} of {features}")));
            ui.end_row();
        }
    });
    let times = RichText::new("times and charts").color(style::QUIET);
    egui::CollapsingHeader::new(times)
        .id_salt("times")
        .show_unindented(ui, |ui| times_of(ui, answer, draw_ms));
}

/// Strain that nobody sees.
const UNSEEN: f32 = 0.005;

/// Words for the strain before and after, and the colours of both: red is bad, green is good.
fn words(rms: Option<[f32; 2]>) -> (String, [Color32; 2]) {
    let Some([before, after]) = rms else {
        return ("nothing is rigid yet: paint what is to keep its shape".into(), [style::QUIET; 2]);
    };
    if before.max(after) < UNSEEN {
        return ("no stretch here: nothing to keep".into(), [style::QUIET; 2]);
    }
    let gone = 100.0 * (1.0 - after / before);
    let (text, colour) = if after < UNSEEN || gone >= 50.0 {
        (format!("features keep their shape: {gone:.0} % of the stretch is gone"), style::GOOD)
    } else if gone >= 1.0 {
        (format!("{gone:.0} % of the stretch is gone"), style::ACCENT)
    } else {
        ("no less stretch than without".into(), style::BEFORE)
    };
    (text, [if before < UNSEEN { style::QUIET } else { style::BEFORE }, colour])
}

/// Duration of a result, and the solves for it.
fn times_of(ui: &mut Ui, answer: &Answer, draw_ms: f64) {
    let preview = answer.request.purpose == Purpose::Preview;
    egui::Grid::new("times").num_columns(2).spacing(vec2(14.0, 3.0)).show(ui, |ui| {
        let mut row = |name: &str, value: String, about: &str| {
            ui.label(RichText::new(name).color(style::QUIET)).on_hover_text(about);
            ui.label(RichText::new(value).monospace());
            ui.end_row();
        };
        let quality = format!("{:?}", answer.request.quality).to_lowercase();
        let quality = if preview { format!("{quality}, preview") } else { quality };
        row("quality", quality, "How much work the result that is shown took.");
        row("solve", format!("{:7.1} ms", answer.solve_ms), "The whole solve, excluding measuring.");
        row("fetch", format!("{:7.1} ms", answer.fetch_ms), "Writing the redirection maps and the warps of all tiles.");
        row("draw", format!("{draw_ms:7.1} ms"), "Uploading and drawing, on the processor and the GPU.");
        row("build", format!("{:7.1} ms", answer.build_ms), "Building grids after a change of maps or settings.");
        let jacobian = format!("{:7.3}   ", answer.report.min_jacobian);
        row(
            "min Jacobian",
            jacobian,
            "Smallest corner Jacobian of the warp: over 0 certifies that it is one-to-one.",
        );
        let charts = format!("{} solved, {} kept", answer.report.charts_active, answer.report.charts_reused);
        row(
            "charts",
            charts,
            "Charts solved in this call, and those that kept their last result because none of their inputs changed.",
        );
    });
}

/// Plots strain over the frames, before and after: the same width as the timeline above it.
pub fn plot(
    ui: &mut Ui,
    history: &History,
    x_of: impl Fn(usize) -> f32,
    [left, right]: [f32; 2],
    height: f32,
) {
    let (area, _) = ui.allocate_exact_size(vec2(ui.available_width(), height), Sense::hover());
    let painter = ui.painter();
    painter
        .line_segment([pos2(left, area.bottom()), pos2(right, area.bottom())], Stroke::new(1.0, style::LINE));
    let most = history.strains().map(|(_, [before, after])| before.max(after)).fold(0.0f32, f32::max);
    if most <= 0.0 {
        return;
    }
    let y = |strain: f32| area.bottom() - strain / most * (height - 3.0);
    for (k, colour) in [(0, style::BEFORE), (1, style::ACCENT)] {
        let mut last: Option<(usize, Pos2)> = None;
        for (frame, strain) in history.strains() {
            let at = pos2(x_of(frame), y(strain[k]));
            painter.circle_filled(at, 1.5, colour);
            if let Some((_, from)) = last.filter(|(before, _)| before + 1 == frame) {
                painter.line_segment([from, at], Stroke::new(1.2, colour));
            }
            last = Some((frame, at));
        }
    }
    let label = |text: String, y: f32, align: egui::Align2, colour: Color32| {
        painter.text(pos2(left - 8.0, y), align, text, egui::FontId::proportional(10.0), colour);
    };
    label(format!("{most:.2}"), area.top(), egui::Align2::RIGHT_TOP, style::QUIET);
    label("strain".into(), area.bottom(), egui::Align2::RIGHT_BOTTOM, style::QUIET);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_and_colours_tell_good_from_bad() {
        for (rms, start, colours) in [
            (None, "nothing is rigid yet", [style::QUIET; 2]),
            (Some([0.0, 0.0]), "no stretch here: nothing to keep", [style::QUIET; 2]),
            (Some([0.0049, 0.001]), "no stretch here", [style::QUIET; 2]),
            (Some([0.4, 0.1]), "features keep their shape: 75 %", [style::BEFORE, style::GOOD]),
            (Some([0.4, 0.3]), "25 % of the stretch is gone", [style::BEFORE, style::ACCENT]),
            (Some([0.4, 0.5]), "no less stretch", [style::BEFORE; 2]),
            (Some([0.001, 0.2]), "no less stretch", [style::QUIET, style::BEFORE]),
        ] {
            let (text, found) = words(rms);
            assert!(text.starts_with(start) && found == colours, "{rms:?}: {text} {found:?}");
        }
    }
}
