//! Status line at the bottom: what is under the cursor, the last distance, and work in progress.

use egui::{ProgressBar, Ui};
use glam::DVec3;

use super::widgets::explained;
use crate::model::actions::Action;
use crate::model::panel_info::PanelInfo;
use crate::model::state::ViewState;

/// Point under the cursor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Place, mm RAS.
    pub at_mm: DVec3,
    /// Intensity there, HU for CT; `None` if it is not known.
    pub intensity: Option<f64>,
}

/// Shows the status line. `told` is the number of messages that can be listed.
pub fn show(
    ui: &mut Ui,
    state: &ViewState,
    info: &PanelInfo<'_>,
    reading: Option<&Reading>,
    scale: Option<f64>,
    told: usize,
    actions: &mut Vec<Action>,
) {
    ui.horizontal(|ui| {
        match reading {
            None => _ = ui.weak("move the mouse over something"),
            Some(Reading { at_mm, intensity }) => {
                if let Some(v) = intensity {
                    ui.monospace(format!("{v:7.1}{}", info.unit))
                        .on_hover_text("intensity of the surface under the cursor");
                }
                ui.monospace(format!("({:.1}, {:.1}, {:.1}) mm RAS", at_mm.x, at_mm.y, at_mm.z))
                    .on_hover_text("right, anterior, superior of the scanner's origin");
            }
        }
        if let Some(distance) = state.distances.last() {
            ui.separator();
            ui.monospace(format!("distance {:.1} mm", distance.mm()))
                .on_hover_text("the last distance measured");
        }
        if let Some(mm) = scale {
            ui.separator();
            ui.monospace(format!("{mm:.3} mm/pixel")).on_hover_text("at the depth of the pivot");
        }
        if let Some((what, share)) = info.progress {
            ui.separator();
            match share {
                Some(share) => _ = ui.add(ProgressBar::new(share).desired_width(160.0).text(what)),
                None => {
                    ui.spinner();
                    ui.label(what);
                }
            }
        }
        ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
            ui.weak("not for diagnosis").on_hover_text("for research and teaching; no medical device");
            if told > 0 {
                let button = ui.small_button("Messages");
                if button.clicked() {
                    actions.push(Action::ToggleMessages);
                }
                explained(ui, button, &Action::ToggleMessages);
            }
        });
    });
}
