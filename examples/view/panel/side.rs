//! Sections of the panel at the side.

use eframe::egui::{Align, CollapsingHeader, Layout, Rect, RichText, Sense, Ui, vec2};

use super::style;

/// A section with a title.
pub fn section<R>(ui: &mut Ui, title: &str, open: bool, content: impl FnOnce(&mut Ui) -> R) -> Option<R> {
    let heading = RichText::new(title).size(14.0).color(style::TEXT).strong();
    let shown = CollapsingHeader::new(heading).id_salt(title).default_open(open).show_unindented(ui, |ui| {
        ui.add_space(2.0);
        let result = content(ui);
        ui.add_space(8.0);
        result
    });
    ui.separator();
    shown.body_returned
}

/// A row of words, one of which is chosen; each explains itself under the mouse.
pub fn words<T: Copy + PartialEq>(
    ui: &mut Ui,
    value: &mut T,
    all: &[(T, &str, &str)],
    mut noted: impl FnMut(&str, Rect),
) {
    for &(of, name, about) in all {
        let response = ui.selectable_value(value, of, name).on_hover_text(about);
        noted(name, response.rect);
    }
}

/// A row with a name, which explains itself under the mouse, and a widget.
pub fn row<R>(ui: &mut Ui, name: &str, about: &str, widget: impl FnOnce(&mut Ui) -> R) -> R {
    ui.horizontal(|ui| {
        let (rect, response) =
            ui.allocate_exact_size(vec2(126.0, ui.spacing().interact_size.y), Sense::hover());
        let mut label = ui.new_child(
            eframe::egui::UiBuilder::new().max_rect(rect).layout(Layout::left_to_right(Align::Center)),
        );
        label.add(eframe::egui::Label::new(RichText::new(name).color(style::QUIET)).selectable(false));
        response.on_hover_text(about);
        widget(ui)
    })
    .inner
}
