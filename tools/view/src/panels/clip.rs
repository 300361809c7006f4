//! Panel of the clip planes and the crop box, in numbers; their handles are in the picture. What the box
//! encloses, or leaves, can be deleted.

use egui::{DragValue, Ui};
use glam::DVec3;

use super::widgets::{ask, row};
use crate::model::actions::Action;
use crate::model::panel_info::PanelInfo;
use crate::model::state::{CropBox, MOST_PLANES, Plane, ViewState};

/// Shows the clip planes and the crop box and changes them.
pub fn show(ui: &mut Ui, state: &mut ViewState, info: &PanelInfo<'_>, actions: &mut Vec<Action>) {
    let mut gone = None;
    for (i, plane) in state.clip.planes.iter_mut().enumerate() {
        ui.push_id(i, |ui| plane_rows(ui, i, plane, &mut gone));
    }
    if let Some(i) = gone {
        state.clip.planes.remove(i);
    }
    ui.horizontal(|ui| {
        if state.clip.planes.is_empty() {
            ask(ui, "Add plane", Action::Clip, actions);
        } else if state.clip.planes.len() < MOST_PLANES
            && ui.button("Add plane").on_hover_text("another clip plane, across the view").clicked()
        {
            state.clip.planes.push(across(state, info));
        }
        if state.clip.crop.is_none() {
            ask(ui, "Add box", Action::Crop, actions);
        }
    });
    if let Some(crop) = &mut state.clip.crop {
        ui.separator();
        crop_rows(ui, crop, info, actions);
    }
    ui.checkbox(&mut state.show.handles, "Handles in the picture")
        .on_hover_text("drag planes and faces with the mouse");
}

/// Returns a plane through the middle of the scene across the view, which cuts away the nearer half.
pub(crate) fn across(state: &ViewState, info: &PanelInfo<'_>) -> Plane {
    let [_, _, back] = state.orbit.axes();
    let through = info.bounds.map_or(state.orbit.pivot_mm, |[low, high]| (low + high) * 0.5);
    Plane { on: true, normal: -back, offset_mm: (-back).dot(through) }
}

/// Returns the box around the scene.
pub(crate) fn around(state: &ViewState, info: &PanelInfo<'_>) -> CropBox {
    let pivot = state.orbit.pivot_mm;
    let [low_mm, high_mm] = info.bounds.unwrap_or([pivot - 100.0, pivot + 100.0]);
    CropBox { on: true, low_mm, high_mm }
}

fn plane_rows(ui: &mut Ui, index: usize, plane: &mut Plane, gone: &mut Option<usize>) {
    ui.horizontal(|ui| {
        ui.checkbox(&mut plane.on, format!("Plane {}", index + 1)).on_hover_text("whether it cuts");
        if ui.button("Flip").on_hover_text("flip the side that is cut away").clicked() {
            (plane.normal, plane.offset_mm) = (-plane.normal, -plane.offset_mm);
        }
        for (text, normal) in [("R", DVec3::X), ("A", DVec3::Y), ("S", DVec3::Z)] {
            let help = "make it perpendicular to this axis, keeping its centre";
            if ui.button(text).on_hover_text(help).clicked() {
                let through = plane.normal * plane.offset_mm;
                (plane.normal, plane.offset_mm) = (normal, normal.dot(through));
            }
        }
        if ui.button("✖").on_hover_text("remove the plane").clicked() {
            *gone = Some(index);
        }
    });
    row(ui, "Offset", "along its normal, from the world origin", |ui| {
        ui.add(DragValue::new(&mut plane.offset_mm).speed(0.5).suffix(" mm").max_decimals(1));
    });
    row(ui, "Normal", "points to the side that stays: right, front, head", |ui| {
        let mut normal = plane.normal;
        let mut changed = false;
        for axis in 0..3 {
            let value = DragValue::new(&mut normal[axis]).speed(0.01).range(-1.0..=1.0).max_decimals(3);
            changed |= ui.add(value).changed();
        }
        if let Some(unit) = normal.try_normalize().filter(|_| changed) {
            // The plane turns about its point nearest to the world's origin.
            let through = plane.normal * plane.offset_mm;
            (plane.normal, plane.offset_mm) = (unit, unit.dot(through));
        }
    });
}

fn crop_rows(ui: &mut Ui, crop: &mut CropBox, info: &PanelInfo<'_>, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        ui.checkbox(&mut crop.on, "Crop box").on_hover_text("whether it cuts");
        if ui.button("Reset").on_hover_text("the box around the scene").clicked()
            && let Some([low, high]) = info.bounds
        {
            (crop.low_mm, crop.high_mm) = (low, high);
        }
    });
    for (axis, name) in ["Left to right", "Back to front", "Foot to head"].into_iter().enumerate() {
        row(ui, name, "both ends, mm RAS", |ui| {
            let (low, high) = (crop.low_mm[axis], crop.high_mm[axis]);
            let end = |value| DragValue::new(value).speed(0.5).max_decimals(1);
            ui.add(end(&mut crop.low_mm[axis]).range(f64::MIN..=high));
            ui.add(end(&mut crop.high_mm[axis]).range(low..=f64::MAX));
            ui.label("mm");
        });
    }
    let can_delete = crop.on && !info.fitted && info.splats.is_some_and(|count| count > 0);
    ui.add_enabled_ui(can_delete, |ui| {
        ui.horizontal(|ui| {
            ask(ui, "Delete inside", Action::DeleteInside, actions);
            ask(ui, "Delete outside", Action::DeleteOutside, actions);
        });
    });
}
