//! Panel of fits: the region, the quality and what a fit will cost; then how far it is, and its end.

use std::path::PathBuf;

use egui::{Button, ComboBox, DragValue, ProgressBar, TextEdit, Ui};
use engine::fit::{PROFILES, QUALITIES};

use super::slices::Shade;
use super::widgets::{ask, row};
use crate::model::actions::Action;
use crate::model::fit_plan::{FitStatus, Stage, config, ply_bytes, usual_profile};
use crate::model::panel_info::PanelInfo;
use crate::model::region::{Region, Threshold};
use crate::model::state::Files;
use crate::panels::theme::SIGNAL;
use engine::figures::{bytes, seconds};

/// Greatest radius of the ball that closes gaps, mm: that of [`engine::volume::Cleaning`].
const MAX_CLOSE_MM: f64 = 50.0;

/// Choices of the panel. The region becomes that of the volume once its voxels are asked for.
#[derive(Clone, Debug)]
pub struct FitForm {
    /// True if the panel is open.
    pub open: bool,
    /// True if the region is a mask; otherwise it is a threshold.
    by_mask: bool,
    mask: Option<PathBuf>,
    labels: String,
    /// The threshold; `None` until the panel is open for a volume.
    threshold: Option<Threshold>,
    /// Name of the profile; `None` for the usual one.
    profile: Option<&'static str>,
    quality: &'static str,
    /// Region of the volume that the choices have followed last.
    followed: Option<Region>,
}

impl Default for FitForm {
    fn default() -> Self {
        FitForm {
            open: false,
            by_mask: false,
            mask: None,
            labels: String::new(),
            threshold: None,
            profile: None,
            quality: "standard",
            followed: None,
        }
    }
}

impl FitForm {
    /// Takes over the region of the volume if it has become another one, as by a file that was dropped.
    pub fn follow(&mut self, files: &Files) {
        let region = files.region();
        if region == self.followed {
            return;
        }
        match &region {
            None => {}
            Some(Region::Mask { path, labels }) => {
                (self.by_mask, self.mask) = (true, Some(path.clone()));
                self.labels = labels.clone().unwrap_or_default();
            }
            Some(Region::Threshold(threshold)) => {
                (self.by_mask, self.threshold) = (false, Some(threshold.clone()));
            }
        }
        self.followed = region;
    }

    /// Takes a mask that was asked for and returns the region.
    pub fn take_mask(&mut self, path: PathBuf) -> Region {
        (self.by_mask, self.labels) = (true, String::new());
        self.mask = Some(path.clone());
        Region::Mask { path, labels: None }
    }

    /// Returns the region that is chosen.
    fn region(&self) -> Option<Region> {
        if !self.by_mask {
            return self.threshold.clone().map(Region::Threshold);
        }
        let labels = Some(self.labels.trim()).filter(|text| !text.is_empty()).map(str::to_owned);
        Some(Region::Mask { path: self.mask.clone()?, labels })
    }

    /// Returns true if the volume has the region that is chosen.
    fn is_found(&self, files: &Files, info: &PanelInfo<'_>) -> bool {
        info.region.is_some() && files.region().is_some() && self.region() == files.region()
    }

    /// Returns what the slices shade while the panel is open: the region, or the voxels of a threshold that
    /// were not yet asked for.
    pub fn shade(&self, files: &Files, info: &PanelInfo<'_>) -> Option<Shade> {
        let threshold = self.threshold.as_ref().filter(|_| !self.by_mask);
        (self.open && info.volume).then(|| match threshold {
            _ if self.is_found(files, info) => Shade::Region,
            Some(threshold) => Shade::Between([threshold.low, threshold.high]),
            None => Shade::Nothing,
        })
    }
}

/// Time that a fit of a profile and a quality will take for a number of voxels, seconds, if that is known.
pub type Times<'a> = dyn Fn(&str, &str, usize) -> Option<f64> + 'a;

/// Shows the panel.
pub fn show(
    ui: &mut Ui,
    form: &mut FitForm,
    files: &Files,
    info: &PanelInfo<'_>,
    times: &Times<'_>,
    actions: &mut Vec<Action>,
) {
    match info.fit {
        Some(status) => progress(ui, status, info, actions),
        None => {
            region(ui, form, files, info, actions);
            plan(ui, form, files, info, times, actions);
        }
    }
}

/// Shows the choice of the region and its size.
fn region(ui: &mut Ui, form: &mut FitForm, files: &Files, info: &PanelInfo<'_>, actions: &mut Vec<Action>) {
    row(ui, "Region", "what is fitted; the slices show it in colour", |ui| {
        for (text, by_mask, help) in [
            ("Threshold", false, "the voxels between two intensities"),
            ("Mask", true, "a file; you can also drop it on the window"),
        ] {
            ui.selectable_value(&mut form.by_mask, by_mask, text).on_hover_text(help);
        }
    });
    if form.by_mask {
        mask(ui, form, actions);
    } else {
        let threshold =
            form.threshold.get_or_insert_with(|| Threshold::first(info.range, !info.unit.is_empty()));
        between(ui, threshold, info);
    }
    let found = form.is_found(files, info);
    ui.horizontal(|ui| {
        let chosen = form.region().filter(|_| !found && info.progress.is_none());
        let find = ui.add_enabled(chosen.is_some(), Button::new("Find"));
        if let (true, Some(region)) = (find.clicked(), chosen) {
            actions.push(Action::Region(Some(region)));
        }
        find.on_hover_text("use this as the region, shown in slices and picture")
            .on_disabled_hover_text("the region is up to date, or nothing is chosen yet");
        let whole = ui.add_enabled(files.region().is_some(), Button::new("Whole volume"));
        if whole.on_hover_text("show the volume without a region").clicked() {
            actions.push(Action::Region(None));
        }
    });
    match info.region.filter(|_| found) {
        Some(size) => _ = ui.label(format!("{} voxels, {:.1} ml", size.voxels, size.ml)),
        None if form.by_mask => _ = ui.weak("open a mask, or drop one on the window"),
        None => _ = ui.weak("the slices show the voxels before cleaning"),
    }
}

fn mask(ui: &mut Ui, form: &mut FitForm, actions: &mut Vec<Action>) {
    row(ui, "File", "binary, soft from 0 to 1, or labels", |ui| {
        ask(ui, "Open…", Action::AskMask, actions);
        if let Some(path) = &form.mask {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            ui.add(egui::Label::new(name).truncate()).on_hover_text(path.display().to_string());
        }
    });
    row(ui, "Labels", "of a label map: numbers or names, separated by commas", |ui| {
        ui.add(TextEdit::singleline(&mut form.labels).hint_text("as it is").desired_width(f32::INFINITY));
    });
}

/// Shows the bounds of a threshold and how its voxels are cleaned.
fn between(ui: &mut Ui, threshold: &mut Threshold, info: &PanelInfo<'_>) {
    let Threshold { low, high, min_ml, largest, close_mm, fill_holes } = threshold;
    let speed = ((info.range[1] - info.range[0]) * 0.001).max(1e-3);
    row(ui, "From", "least and greatest intensity", |ui| {
        ui.add(DragValue::new(low).speed(speed).max_decimals(1));
        ui.label("to");
        ui.add(DragValue::new(high).speed(speed).max_decimals(1).suffix(info.unit));
    });
    optional(ui, "Pieces from", "remove smaller connected pieces", min_ml, 1.0, |ml| {
        DragValue::new(ml).speed(0.05).range(0.0..=1e6).max_decimals(3).suffix(" ml")
    });
    optional(ui, "Largest", "keep the largest connected pieces", largest, 1, |count| {
        DragValue::new(count).speed(0.05).range(1..=1000).suffix(" kept")
    });
    optional(ui, "Close gaps", "with a ball of this radius", close_mm, 2.0, |mm| {
        DragValue::new(mm).speed(0.05).range(0.0..=MAX_CLOSE_MM).max_decimals(2).suffix(" mm")
    });
    row(ui, "Fill holes", "fill what is enclosed on all sides", |ui| ui.checkbox(fill_holes, ""));
}

/// Shows a value that may be left out.
fn optional<T>(
    ui: &mut Ui,
    name: &str,
    help: &str,
    value: &mut Option<T>,
    first: T,
    drag: impl Fn(&mut T) -> DragValue<'_>,
) {
    row(ui, name, help, |ui| {
        let mut on = value.is_some();
        if ui.checkbox(&mut on, "").changed() {
            *value = on.then_some(first);
        }
        if let Some(value) = value {
            ui.add(drag(value));
        }
    });
}

/// Shows profile and quality, what the fit will cost, and the button that begins it.
fn plan(
    ui: &mut Ui,
    form: &mut FitForm,
    files: &Files,
    info: &PanelInfo<'_>,
    times: &Times<'_>,
    actions: &mut Vec<Action>,
) {
    ui.separator();
    let usual = usual_profile(!info.unit.is_empty());
    let mut profile = form.profile.unwrap_or(usual);
    row(ui, "Profile", "settings for a kind of data", |ui| {
        ComboBox::from_id_salt("profile").selected_text(profile).width(110.0).show_ui(ui, |ui| {
            for row in PROFILES {
                ui.selectable_value(&mut profile, row.name, row.name).on_hover_text(row.about);
            }
        });
    });
    form.profile = Some(profile).filter(|name| *name != usual);
    row(ui, "Quality", "trade-off between error and cost", |ui| {
        for row in QUALITIES {
            ui.selectable_value(&mut form.quality, row.name, row.name).on_hover_text(row.about);
        }
    });
    let found = info.region.filter(|_| form.is_found(files, info));
    if let (Some(size), Ok(config)) = (found, config(profile, form.quality, !info.unit.is_empty())) {
        let splats = config.splat_count(size.weight);
        let cost = if config.has_goal() {
            format!(
                "as many splats as it takes for 99 % of the voxels to be within {}{}; {} iterations",
                config.count.target_hu, info.unit, config.iterations
            )
        } else {
            let bytes = bytes(ply_bytes(splats));
            format!("{splats} splats, {} iterations, {bytes} as .ply", config.iterations)
        };
        let (time, known) = match times(profile, form.quality, size.voxels) {
            Some(time) => {
                (format!(", about {}", seconds(time)), "estimated from the last such fit, by voxels")
            }
            None => (String::new(), "the first iterations will show how long it takes on this device"),
        };
        ui.label(cost + &time).on_hover_text(format!("a .vgs takes about an eighth of that; {known}"));
    }
    let button = ui.add_enabled(found.is_some(), Button::new("Fit splats"));
    if button.clicked() {
        actions.push(Action::StartFit { profile, quality: form.quality });
    }
    button
        .on_hover_text("fit splats to the region in the background")
        .on_disabled_hover_text("find a region first");
}

/// Shows how far the fit is, and what can be done with it.
fn progress(ui: &mut Ui, status: &FitStatus, info: &PanelInfo<'_>, actions: &mut Vec<Action>) {
    match (status.stage, status.share()) {
        (Stage::Ended, _) => _ = ui.label(status.text()),
        (_, Some(share)) => _ = ui.add(ProgressBar::new(share).text(status.text())),
        (_, None) => {
            ui.horizontal(|ui| {
                ui.spinner();
                ui.label(status.text());
            });
        }
    }
    if let (Some(psnr), Some(rmse)) = (status.psnr_db, status.rmse) {
        if let Some(p99) = status.p99 {
            ui.label(format!("99 % of the voxels are within {p99:.1}{} of the scan", info.unit));
        }
        ui.label(format!("error {rmse:.1}{}, PSNR {psnr:.1} dB", info.unit)).on_hover_text(
            "at the voxels of the region: root mean square error, and PSNR over the range of intensities",
        );
    }
    if let Some(splats) = status.splats {
        ui.weak(format!("{splats} splats"));
    }
    ui.horizontal(|ui| match status.stage {
        Stage::Preparing | Stage::Running => {
            let button = ui.add_enabled(!status.stopping, Button::new("Stop"));
            if button.on_hover_text("stop the fit; the splats so far can be kept").clicked() {
                actions.push(Action::StopFit);
            }
        }
        Stage::Ended => {
            ask(ui, "Keep…", Action::AskKeep, actions).on_hover_text("save the splats to a file");
            if ui.button("Discard").on_hover_text("discard the splats").clicked() {
                actions.push(Action::DiscardFit);
            }
            ui.colored_label(SIGNAL, "not saved yet");
        }
        Stage::Writing => {}
    });
}
