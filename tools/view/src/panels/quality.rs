//! Panel of mode and quality, and of the time that a frame may take.

use egui::{DragValue, Slider, Ui};
use engine::render::{Needs, SplatKind, StepOf};

use super::edges;
use super::widgets::{explained, row};
use crate::model::actions::Action;
use crate::model::panel_info::PanelInfo;
use crate::model::state::{self, SplatMode, Subject, ViewState};

/// Least and greatest step that the slider gives.
const STEPS: [f64; 2] = [0.05, 4.0];

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
    mode_row(ui, state, info);
    if info.has_region {
        edges::show(ui, state);
    }
    step_row(ui, state, info);
    budget_row(ui, state, info);
    let quality = &mut state.quality;
    row(ui, "Frame target", "time that a frame may take while the picture moves", |ui| {
        let value = DragValue::new(&mut quality.target_frame_ms).speed(0.1).range(1.0..=1000.0);
        ui.add(value.suffix(" ms").max_decimals(1));
    });
    ui.checkbox(&mut quality.adaptive, "Coarser while moving")
        .on_hover_text("lower the quality until the target is met; full quality at rest");
    ui.checkbox(&mut state.show.overlay, "Frame times")
        .on_hover_text("frame times, passes, splats and memory");
}

/// Shows the modes that suit the splats; nothing if there are none, as for a volume alone.
fn mode_row(ui: &mut Ui, state: &mut ViewState, info: &PanelInfo<'_>) {
    let modes = info.modes();
    let about = |mode: SplatMode| mode.row().about;
    match modes[..] {
        [] => {}
        [mode] => {
            let why = match info.kind {
                Some(SplatKind::Coloured) => {
                    "these splats have colours of their own, and no intensities to classify"
                }
                _ => {
                    "these splats were fitted at the voxels of their scan: other modes would show artefacts between them"
                }
            };
            row(ui, "Mode", why, |ui| ui.label(mode.name).on_hover_text(format!("{}; {why}", about(mode))));
        }
        _ => row(ui, "Mode", "how splats are rendered", |ui| {
            for mode in modes {
                ui.selectable_value(&mut state.mode, mode, mode.name).on_hover_text(about(mode));
            }
        }),
    }
}

/// Shows the distance of samples along a ray, in the unit of what is rendered, if that has such steps.
fn step_row(ui: &mut Ui, state: &mut ViewState, info: &PanelInfo<'_>) {
    // What is seen of splats decides; a volume beside them follows.
    let of_splats = info.has(Subject::Splats) && (state.shown != Subject::Volume || state.split.is_some());
    let mode = state::mode_row(state.mode_of(if of_splats { Subject::Splats } else { Subject::Volume }));
    let (unit_mm, suffix, help) = match mode.step_of {
        Some(StepOf::Samples) => (
            1.0,
            " voxels",
            "distance between samples along a ray where something shows, in voxels: smaller is finer and slower",
        ),
        Some(StepOf::Slabs) => match info.sigma_mm {
            Some(mm) => {
                (mm, " mm", "thickness of the slabs that a ray is cut into: smaller is finer and slower")
            }
            None => return,
        },
        None => return,
    };
    row(ui, "Step", help, |ui| {
        let mut step = state.quality.step.unwrap_or(mode.step) * unit_mm;
        let [least, most] = STEPS.map(|step| step * unit_mm);
        let slider = Slider::new(&mut step, least..=most).logarithmic(true).suffix(suffix).fixed_decimals(2);
        if ui.add(slider).changed() {
            state.quality.step = Some(step / unit_mm);
        }
    });
}

/// Shows how many splats are drawn, in the modes that draw splats one by one.
fn budget_row(ui: &mut Ui, state: &mut ViewState, info: &PanelInfo<'_>) {
    let Some(splats) = info.splats.filter(|_| state.mode.needs != Needs::DecodedField) else { return };
    let budget = &mut state.quality.splat_budget;
    row(ui, "Splat budget", "largest number of splats drawn", |ui| {
        let mut limited = budget.is_some();
        if ui.checkbox(&mut limited, "").on_hover_text("limit how many splats are drawn").changed() {
            *budget = limited.then_some((splats as u64).max(1));
        }
        match budget {
            None => _ = ui.label(format!("all {splats}")),
            Some(budget) => {
                let value = DragValue::new(budget).speed(1000.0).range(1000..=u64::MAX);
                ui.add(value.suffix(format!(" of {splats}")));
            }
        }
    });
}
