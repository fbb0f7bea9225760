//! Colours and spacing: dark and quiet, so that the mesh is what one sees.

use eframe::egui::{self, Color32, CornerRadius, Margin, Stroke, TextStyle, vec2};

pub const BACK: Color32 = Color32::from_rgb(24, 25, 28);
pub const PANEL: Color32 = Color32::from_rgb(32, 33, 37);
pub const RAISED: Color32 = Color32::from_rgb(45, 47, 52);
pub const LINE: Color32 = Color32::from_rgb(52, 54, 60);
pub const TEXT: Color32 = Color32::from_rgb(208, 210, 214);
pub const QUIET: Color32 = Color32::from_rgb(140, 144, 152);
/// The colour of the studs.
pub const ACCENT: Color32 = Color32::from_rgb(214, 162, 78);
/// Strain with the original UVs.
pub const BEFORE: Color32 = Color32::from_rgb(196, 92, 78);
/// Strain that is gone.
pub const GOOD: Color32 = Color32::from_rgb(124, 184, 116);
pub const ERROR: Color32 = Color32::from_rgb(232, 112, 96);

pub fn apply(ctx: &egui::Context) {
    ctx.set_theme(egui::Theme::Dark);
    ctx.all_styles_mut(|style| {
        for (of, size) in [(TextStyle::Heading, 15.0), (TextStyle::Small, 11.0), (TextStyle::Monospace, 12.0)]
        {
            style.text_styles.entry(of).and_modify(|font| font.size = size);
        }
        let spacing = &mut style.spacing;
        spacing.item_spacing = vec2(8.0, 6.0);
        spacing.button_padding = vec2(9.0, 4.0);
        spacing.interact_size.y = 22.0;
        spacing.slider_width = 104.0;
        spacing.tooltip_width = 340.0;
        let visuals = &mut style.visuals;
        visuals.panel_fill = PANEL;
        visuals.window_fill = PANEL;
        visuals.extreme_bg_color = BACK;
        visuals.selection.bg_fill = ACCENT.gamma_multiply(0.42);
        visuals.selection.stroke = Stroke::new(1.0, Color32::from_rgb(250, 226, 184));
        visuals.window_stroke = Stroke::new(1.0, LINE);
        visuals.slider_trailing_fill = true;
        let widgets = &mut visuals.widgets;
        widgets.noninteractive.bg_stroke = Stroke::new(1.0, LINE);
        widgets.noninteractive.fg_stroke.color = TEXT;
        for (state, fill) in [
            (&mut widgets.inactive, RAISED),
            (&mut widgets.hovered, Color32::from_rgb(56, 58, 64)),
            (&mut widgets.active, Color32::from_rgb(66, 68, 75)),
            (&mut widgets.open, Color32::from_rgb(56, 58, 64)),
        ] {
            state.weak_bg_fill = fill;
            state.bg_fill = fill;
            state.bg_stroke = Stroke::NONE;
            state.fg_stroke.color = TEXT;
            state.corner_radius = CornerRadius::same(4);
            state.expansion = 0.0;
        }
    });
}

/// The frame of a panel.
pub fn frame(vertical: i8) -> egui::Frame {
    egui::Frame::NONE.fill(PANEL).inner_margin(Margin::symmetric(12, vertical))
}

/// A colour of the legend of strain, from -1 (squeezed) to 1 (stretched): as in `surface.wgsl`, lit.
pub fn strain(t: f32) -> Color32 {
    let still = [0.60, 0.58, 0.54];
    let end = if t > 0.0 { [0.80, 0.05, 0.03] } else { [0.03, 0.16, 0.75] };
    let s = t.abs().min(1.0).powf(0.8);
    let [r, g, b] = [0, 1, 2].map(|c| still[c] + (end[c] - still[c]) * s);
    egui::Rgba::from_rgb(r, g, b).into()
}
