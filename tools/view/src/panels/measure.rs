//! Panel of the distances: the tool and the list.

use egui::Ui;

use super::widgets::explained;
use crate::model::actions::Action;
use crate::model::state::ViewState;

/// Shows the distances; `measuring` is true while the tool is used.
pub fn show(ui: &mut Ui, state: &mut ViewState, measuring: bool, actions: &mut Vec<Action>) {
    let button = ui.add(egui::Button::new("Measure").selected(measuring));
    if button.clicked() {
        actions.push(Action::Measure);
    }
    explained(ui, button, &Action::Measure);
    if measuring {
        ui.weak("Click two points of the picture.");
    }
    let mut gone = None;
    for (i, distance) in state.distances.iter().enumerate() {
        ui.horizontal(|ui| {
            let ends =
                [distance.from_mm, distance.to_mm].map(|p| format!("{:.1}, {:.1}, {:.1}", p.x, p.y, p.z));
            ui.monospace(format!("{:>2}  {:8.1} mm", i + 1, distance.mm()))
                .on_hover_text(format!("from ({}) to ({}) mm RAS", ends[0], ends[1]));
            if ui.small_button("✖").on_hover_text("remove it").clicked() {
                gone = Some(i);
            }
        });
    }
    if let Some(i) = gone {
        state.distances.remove(i);
    }
    if state.distances.len() > 1 && ui.button("Remove all").on_hover_text("all distances").clicked() {
        state.distances.clear();
    }
}
