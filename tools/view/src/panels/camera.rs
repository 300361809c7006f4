//! Panel of the camera: sides to look from, pivot, distance and field of view.

use egui::{DragValue, Slider, TextEdit, Ui};
use glam::DVec3;

use super::widgets::{ask, colour_button, row};
use crate::model::actions::Action;
use crate::model::orbit::{FOV_RANGE, Side};
use crate::model::state::{Bookmark, ViewState};

/// Greatest number of bookmarks; a list of more would not be looked through.
const MOST_BOOKMARKS: usize = 50;

/// Shows the camera and changes it.
pub fn show(ui: &mut Ui, state: &mut ViewState, actions: &mut Vec<Action>) {
    for pair in Side::ALL.chunks(2) {
        ui.columns(2, |columns| {
            for (ui, &side) in columns.iter_mut().zip(pair) {
                ui.vertical_centered_justified(|ui| {
                    ask(ui, capitalised(side.name()), Action::View(side), actions)
                });
            }
        });
    }
    ui.horizontal(|ui| ask(ui, "Whole scene", Action::SeeAll, actions));
    let orbit = &mut state.orbit;
    row(ui, "Azimuth", "around the body's axis: 0 in front, 90 at the patient's left", |ui| {
        let mut azimuth = orbit.azimuth_deg;
        if ui.add(DragValue::new(&mut azimuth).speed(0.5).suffix("°").max_decimals(1)).changed() {
            orbit.turn(azimuth - orbit.azimuth_deg, 0.0);
        }
    });
    row(ui, "Elevation", "90 above the head, -90 below the feet", |ui| {
        let value = DragValue::new(&mut orbit.elevation_deg).speed(0.5).range(-90.0..=90.0);
        ui.add(value.suffix("°").max_decimals(1));
    });
    row(ui, "Distance", "from the eye to the pivot", |ui| {
        let speed = orbit.distance_mm * 0.005;
        let value = DragValue::new(&mut orbit.distance_mm).speed(speed).range(1.0..=1e6);
        ui.add(value.suffix(" mm").max_decimals(1));
    });
    row(ui, "Field of view", "from the upper to the lower edge; what is at the pivot keeps its size", |ui| {
        let mut fov = orbit.fov_deg;
        let slider = Slider::new(&mut fov, FOV_RANGE[0]..=FOV_RANGE[1]).suffix("°").fixed_decimals(0);
        if ui.add(slider).changed() {
            orbit.set_fov(fov);
        }
    });
    row(ui, "Pivot R A S", "point that the camera turns around: mm to the right, front and head", |ui| {
        for axis in 0..3 {
            ui.add(DragValue::new(&mut orbit.pivot_mm[axis]).speed(0.5).max_decimals(1));
        }
        ui.label("mm");
    });
    row(ui, "Background", "the background; letters turn dark on a bright one", |ui| {
        colour_button(ui, &mut state.background, "the background colour");
        for (name, colour) in [("black", DVec3::ZERO), ("white", DVec3::ONE)] {
            if ui.small_button(name).clicked() {
                state.background = colour;
            }
        }
    });
    ui.checkbox(&mut state.show.orientation, "Orientation letters")
        .on_hover_text("R right, L left, A anterior, P posterior, S superior, I inferior");
    ui.checkbox(&mut state.show.scale_bar, "Scale bar").on_hover_text("true at the depth of the pivot");
    ui.checkbox(&mut state.show.colour_bar, "Colour bar")
        .on_hover_text("the colours of the intensities that the transfer function shows");
    ui.checkbox(&mut state.show.cube, "Orientation cube").on_hover_text("click a face to look from there");
    bookmarks(ui, state);
}

/// Shows the cameras that were kept, and keeps the present one.
fn bookmarks(ui: &mut Ui, state: &mut ViewState) {
    let mut gone = None;
    for (i, bookmark) in state.bookmarks.iter_mut().enumerate() {
        ui.push_id(i, |ui| {
            ui.horizontal(|ui| {
                if ui.button("Go to").on_hover_text("go back to this view").clicked() {
                    state.orbit = bookmark.orbit;
                }
                ui.add(TextEdit::singleline(&mut bookmark.name).desired_width(180.0));
                if ui.small_button("✖").on_hover_text("remove it").clicked() {
                    gone = Some(i);
                }
            });
        });
    }
    if let Some(i) = gone {
        state.bookmarks.remove(i);
    }
    let full = state.bookmarks.len() >= MOST_BOOKMARKS;
    let keep = ui.add_enabled(!full, egui::Button::new("Keep this view"));
    if keep.on_hover_text("a bookmark of the camera, saved with the session").clicked() {
        let name = format!("View {}", state.bookmarks.len() + 1);
        state.bookmarks.push(Bookmark { name, orbit: state.orbit });
    }
}

fn capitalised(word: &str) -> String {
    let mut letters = word.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}
