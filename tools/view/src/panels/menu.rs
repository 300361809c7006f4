//! Menus: files, editing, the view.

use std::path::PathBuf;

use egui::{Button, MenuBar, Ui};

use super::widgets::explained;
use crate::model::actions::{Action, binding};
use crate::model::orbit::Side;

/// State that the menus show.
pub struct Menus<'a> {
    /// Recent files, the latest first.
    pub recent: &'a [PathBuf],
    /// True if there is a step to undo.
    pub can_undo: bool,
    /// True if there is a step to redo.
    pub can_redo: bool,
    /// True if there is a volume to fit.
    pub can_fit: bool,
    /// True if the volume's folder may hold other series.
    pub has_series: bool,
    /// True if there are splats of files, which can be deleted and written.
    pub has_splats: bool,
    /// True if any file is open.
    pub has_data: bool,
    /// True if files of splats are open, which others can stand beside.
    pub has_files: bool,
    /// True if there are splats beside others.
    pub has_beside: bool,
}

/// Shows the menus.
pub fn show(ui: &mut Ui, menus: &Menus<'_>, actions: &mut Vec<Action>) {
    MenuBar::new().ui(ui, |ui| {
        ui.menu_button("File", |ui| {
            for action in [Action::AskOpen, Action::AskOpenFolder] {
                item(ui, true, action, actions);
            }
            ui.add_enabled_ui(!menus.recent.is_empty(), |ui| {
                ui.menu_button("Recent", |ui| {
                    for path in menus.recent {
                        let name = path.file_name().unwrap_or_default().to_string_lossy();
                        if ui.button(name).on_hover_text(path.display().to_string()).clicked() {
                            actions.push(Action::Open(vec![path.clone()]));
                        }
                    }
                });
            });
            item(ui, menus.has_files, Action::AskBeside, actions);
            item(ui, menus.has_beside, Action::CloseBeside, actions);
            item(ui, menus.has_series, Action::AskSeries, actions);
            ui.separator();
            item(ui, true, Action::AskSave, actions);
            item(ui, menus.has_data, Action::AskPack, actions);
            item(ui, menus.has_splats, Action::AskSaveSplats, actions);
            item(ui, menus.has_splats, Action::AskShare, actions);
            for action in [Action::AskScreenshot, Action::AskRecord] {
                item(ui, true, action, actions);
            }
            ui.separator();
            item(ui, true, Action::Quit, actions);
        });
        ui.menu_button("Edit", |ui| {
            item(ui, menus.can_undo, Action::Undo, actions);
            item(ui, menus.can_redo, Action::Redo, actions);
            ui.separator();
            for action in [Action::AskTransfer, Action::NextPreset, Action::PreviousPreset] {
                item(ui, true, action, actions);
            }
            ui.separator();
            for action in [Action::Measure, Action::Clip, Action::Crop] {
                item(ui, true, action, actions);
            }
            for action in [Action::DeleteInside, Action::DeleteOutside] {
                item(ui, menus.has_splats, action, actions);
            }
            ui.separator();
            item(ui, menus.can_fit, Action::ToggleFit, actions);
        });
        ui.menu_button("View", |ui| {
            for side in Side::ALL {
                item(ui, true, Action::View(side), actions);
            }
            item(ui, true, Action::SeeAll, actions);
            ui.separator();
            for action in [Action::Flip, Action::Split, Action::ToggleSlices, Action::NextMode] {
                item(ui, true, action, actions);
            }
            ui.separator();
            for action in [
                Action::TogglePanels,
                Action::ToggleOverlay,
                Action::ToggleAnnotations,
                Action::ToggleHandles,
                Action::ToggleMessages,
                Action::ToggleKeys,
            ] {
                item(ui, true, action, actions);
            }
        });
        ui.separator();
        plain(ui, "Undo", menus.can_undo, Action::Undo, actions);
        plain(ui, "Redo", menus.can_redo, Action::Redo, actions);
    });
}

/// Shows a button without a frame, explained by the table of keys.
fn plain(ui: &mut Ui, text: &str, enabled: bool, action: Action, actions: &mut Vec<Action>) {
    let button = ui.add_enabled(enabled, Button::new(text).frame(false));
    if button.clicked() {
        actions.push(action.clone());
    }
    explained(ui, button, &action);
}

/// Shows a row of a menu, as the table of keys names it.
fn item(ui: &mut Ui, enabled: bool, action: Action, actions: &mut Vec<Action>) {
    let Some(row) = binding(&action) else { return };
    let button = Button::new(row.name).shortcut_text(ui.ctx().format_shortcut(&row.key));
    if ui.add_enabled(enabled, button).on_hover_text(row.help).clicked() {
        actions.push(action);
    }
}
