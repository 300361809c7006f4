//! Parts of the panels: rows, buttons that ask for actions, buttons that choose colours.

use egui::{Align, Context, Key, Layout, ModalResponse, Response, Ui, WidgetText};
use glam::DVec3;

use crate::model::actions::{Action, binding};
use crate::panels::theme::bytes_of;

/// Shows a row: its name, of the same width in all rows, with an explanation, and `content` beside it.
pub(crate) fn row<R>(ui: &mut Ui, name: &str, help: &str, content: impl FnOnce(&mut Ui) -> R) -> R {
    ui.horizontal(|ui| {
        let size = egui::vec2(92.0, ui.spacing().interact_size.y);
        let left = Layout::left_to_right(Align::Center);
        ui.allocate_ui_with_layout(size, left, |ui| {
            ui.set_min_size(size);
            ui.label(name).on_hover_text(help);
        });
        content(ui)
    })
    .inner
}

/// Shows a button for an action, with its key in the explanation.
pub(crate) fn ask(
    ui: &mut Ui,
    text: impl Into<WidgetText>,
    action: Action,
    actions: &mut Vec<Action>,
) -> Response {
    let button = ui.add(egui::Button::new(text.into()));
    if button.clicked() {
        actions.push(action.clone());
    }
    explained(ui, button, &action)
}

/// Adds the explanation of an action and its key to a widget.
pub(crate) fn explained(ui: &Ui, response: Response, action: &Action) -> Response {
    match binding(action) {
        None => response,
        Some(row) => response.on_hover_text(format!("{} ({})", row.help, ui.ctx().format_shortcut(&row.key))),
    }
}

/// Returns true if a question is put away by Escape. A click beside it leaves it open.
pub(crate) fn escaped<T>(context: &Context, question: &ModalResponse<T>) -> bool {
    question.is_top_modal && !question.any_popup_open && context.input(|i| i.key_pressed(Key::Escape))
}

/// Shows a button that chooses a colour. Returns true if the colour was changed.
pub(crate) fn colour_button(ui: &mut Ui, colour: &mut DVec3, help: &str) -> bool {
    let mut bytes = bytes_of(*colour);
    let response = ui.color_edit_button_srgb(&mut bytes).on_hover_text(help);
    // Compared as bytes, so that looking at a colour does not round it.
    let changed = response.changed() && bytes != bytes_of(*colour);
    if changed {
        *colour = DVec3::from_array(bytes.map(|b| f64::from(b) / 255.0));
    }
    changed
}
