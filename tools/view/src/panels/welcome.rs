//! What stands in place of the picture while nothing is open, and what is shown while files are dragged over
//! the window.

use std::path::PathBuf;

use egui::{Align2, Color32, Context, FontId, Id, LayerId, Order, Rect, Ui, UiBuilder, vec2};

use super::objects;
use super::widgets::ask;
use crate::model::actions::Action;
use crate::model::deletions::Deletion;
use crate::model::panel_info::PanelInfo;

/// Number of recent files that are offered.
const MOST: usize = 8;

/// Offers to open files, in the middle of `rect`.
pub fn show(ui: &mut Ui, rect: Rect, recent: &[PathBuf], actions: &mut Vec<Action>) {
    let size = vec2(360.0, 146.0 + 26.0 * recent.len().min(MOST) as f32);
    let place = Rect::from_center_size(rect.center(), size).intersect(rect);
    ui.scope_builder(UiBuilder::new().max_rect(place), |ui| {
        ui.vertical_centered(|ui| {
            ui.heading("Nothing is open");
            ui.weak("Drop splats, a volume, a mask or a session here.");
            ask(ui, "Open…", Action::AskOpen, actions);
            ask(ui, "Open folder…", Action::AskOpenFolder, actions);
            if recent.is_empty() {
                return;
            }
            ui.add_space(8.0);
            ui.weak("Recent");
            for path in recent.iter().take(MOST) {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                if ui.link(name).on_hover_text(path.display().to_string()).clicked() {
                    actions.push(Action::Open(vec![path.clone()]));
                }
            }
        });
    });
}

/// Offers to restore splats, in the middle of `rect`, where none are left.
pub fn all_deleted(ui: &mut Ui, rect: Rect, deleted: &mut Vec<Deletion>, info: &PanelInfo<'_>) {
    let place = Rect::from_center_size(rect.center(), vec2(250.0, 80.0)).intersect(rect);
    ui.scope_builder(UiBuilder::new().max_rect(place), |ui| {
        ui.vertical_centered(|ui| {
            ui.heading("No splats left");
            objects::restore(ui, deleted, info);
        });
    });
}

/// Says that the files over the window can be dropped.
pub fn hovered(context: &Context, rect: Rect) {
    let painter = context.layer_painter(LayerId::new(Order::Foreground, Id::new("hovered files")));
    painter.rect_filled(rect, 0.0, Color32::from_black_alpha(160));
    painter.text(
        rect.center(),
        Align2::CENTER_CENTER,
        "Drop to open",
        FontId::proportional(22.0),
        Color32::WHITE,
    );
}
