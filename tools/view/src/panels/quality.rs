//! Panel of mode and quality, and of the time that a frame may take.

use egui::{DragValue, Slider, Ui};

use super::widgets::{explained, row};
use crate::actions::Action;
use crate::panel_info::PanelInfo;
use crate::state::{SplatMode, Subject, ViewState, mode_row};

/// Shows the mode and the quality and changes them.
pub fn show(ui: &mut Ui, state: &mut ViewState, info: &PanelInfo<'_>, actions: &mut Vec<Action>) {
    row(ui, "Shown", "splats, those beside them, or the volume they were fitted to", |ui| {
        for (text, subject) in
            [("Splats", Subject::Splats), ("Beside", Subject::Beside), ("Volume", Subject::Volume)]
        {
            let there = info.has(subject);
            // Few users compare splats.
            if there || subject != Subject::Beside {
                ui.add_enabled_ui(there, |ui| ui.selectable_value(&mut state.shown, subject, text));
            }
        }
        let both = state.split.is_some();
        let there = info.has_two();
        let button = ui.add_enabled(there, egui::Button::new("Both").selected(both));
        if button.clicked() {
            actions.push(Action::Split);
        }
        explained(ui, button, &Action::Split)
            .on_disabled_hover_text("open splats and their volume, or splats beside them");
    });
    row(ui, "Mode", "how splats are rendered", |ui| {
        for mode in SplatMode::ALL {
            ui.selectable_value(&mut state.mode, mode, mode.name())
                .on_hover_text(mode_row(mode.name()).about);
        }
    });
    let quality = &mut state.quality;
    row(
        ui,
        "Step",
        "slab thickness in standard deviations, or step of the volume in voxels: less is finer",
        |ui| {
            ui.add(Slider::new(&mut quality.step, 0.25..=4.0).logarithmic(true).suffix(" σ").max_decimals(2));
        },
    );
    if let Some(splats) = info.splats {
        row(ui, "Splat budget", "most splats that are drawn", |ui| {
            let mut limited = quality.splat_budget.is_some();
            if ui.checkbox(&mut limited, "").on_hover_text("limit how many splats are drawn").changed() {
                quality.splat_budget = limited.then_some((splats as u64).max(1));
            }
            match &mut quality.splat_budget {
                None => _ = ui.label(format!("all {splats}")),
                Some(budget) => {
                    let value = DragValue::new(budget).speed(1000.0).range(1000..=u64::MAX);
                    ui.add(value.suffix(format!(" of {splats}")));
                }
            }
        });
    }
    row(ui, "Frame target", "what a frame may take while the picture moves", |ui| {
        let value = DragValue::new(&mut quality.target_frame_ms).speed(0.1).range(1.0..=1000.0);
        ui.add(value.suffix(" ms").max_decimals(1));
    });
    ui.checkbox(&mut quality.adaptive, "Coarser while moving")
        .on_hover_text("quality falls until the target is met; at rest it is full again");
    ui.checkbox(&mut state.show.overlay, "Frame times")
        .on_hover_text("frame times, passes, splats and memory");
}
