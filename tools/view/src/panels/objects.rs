//! Panel of the objects (fits and labels), each with its visibility, colour and opacity.

use egui::{Button, Slider, Ui};
use glam::DVec3;

use super::widgets::colour_button;
use crate::panel_info::PanelInfo;
use crate::state::ViewState;

/// Colours that objects get in turn, which people of all kinds of colour vision can tell apart (Okabe and Ito
/// 2008).
const TINTS: [[u8; 3]; 7] = [
    [230, 159, 0],
    [86, 180, 233],
    [0, 158, 115],
    [240, 228, 66],
    [0, 114, 178],
    [213, 94, 0],
    [204, 121, 167],
];

/// Shows the list.
pub fn show(ui: &mut Ui, state: &mut ViewState, info: &PanelInfo<'_>) {
    if state.objects.is_empty() {
        ui.weak("Open splats, or drop a file here.");
        return;
    }
    if state.objects.len() > 1 {
        ui.horizontal(|ui| {
            for (text, visible) in [("Show all", true), ("Hide all", false)] {
                if ui.small_button(text).on_hover_text("all objects of the list").clicked() {
                    state.objects.iter_mut().for_each(|o| o.visible = visible);
                }
            }
        });
    }
    let mut alone = None;
    for (i, object) in state.objects.iter_mut().enumerate() {
        ui.push_id(i, |ui| {
            ui.horizontal(|ui| {
                let eye = if object.visible { "👁" } else { "–" };
                let eye = ui.add(Button::new(eye).frame(false).min_size(egui::vec2(18.0, 0.0)));
                let eye = eye.on_hover_text("shown or hidden; with Shift this one alone");
                if eye.clicked() && ui.input(|input| input.modifiers.shift) {
                    alone = Some(i);
                } else if eye.clicked() {
                    object.visible = !object.visible;
                }
                tint(ui, &mut object.tint, i);
                let percent = Slider::from_get_set(0.0..=100.0, |new| {
                    if let Some(new) = new {
                        object.opacity = new / 100.0;
                    }
                    object.opacity * 100.0
                });
                ui.spacing_mut().slider_width = 56.0;
                ui.add(percent.suffix(" %").fixed_decimals(0)).on_hover_text("factor of the opacity per mm");
                let count = info.object_splats.get(i).copied();
                let name = ui.add(egui::Label::new(&object.name).truncate());
                if let Some(count) = count {
                    name.on_hover_text(format!("{}: {count} splats", object.name));
                }
            });
        });
    }
    if let Some(alone) = alone {
        state.objects.iter_mut().enumerate().for_each(|(i, o)| o.visible = i == alone);
    }
}

/// Shows the choice between a colour of the object's own and that of the transfer function.
fn tint(ui: &mut Ui, tint: &mut Option<DVec3>, index: usize) {
    let mut own = tint.is_some();
    let check =
        ui.checkbox(&mut own, "").on_hover_text("a colour of its own instead of the transfer function's");
    if check.changed() {
        let next = TINTS[index % TINTS.len()].map(|b| f64::from(b) / 255.0);
        *tint = own.then(|| DVec3::from_array(next));
    }
    match tint {
        Some(colour) => {
            colour_button(ui, colour, "the object's colour");
        }
        None => ui.add_space(ui.spacing().interact_size.x + ui.spacing().item_spacing.x),
    }
}
