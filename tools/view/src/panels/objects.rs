//! Panel of the objects (fits and labels), each with its visibility, colour and opacity; they can be deleted.

use egui::{Button, RichText, Slider, Ui};
use engine::splat::usual_colour;
use engine::transfer::PRESETS;
use glam::{DVec3, Vec3};

use super::widgets::colour_button;
use crate::actions::Action;
use crate::deletions::{Deletion, Target};
use crate::panel_info::PanelInfo;
use crate::state::ViewState;
use crate::theme::SIGNAL;
use crate::transfer::Transfer;

/// Returns the colour of its own that an object gets first.
fn first_tint(name: &str, index: usize) -> DVec3 {
    Vec3::from_array(usual_colour(name, index)).as_dvec3()
}

/// Shows the list. Without `actions` objects cannot be saved.
pub fn show(ui: &mut Ui, state: &mut ViewState, info: &PanelInfo<'_>, mut actions: Option<&mut Vec<Action>>) {
    if info.fitted {
        ui.weak("The splats of the fit, which are in no file yet.");
        return;
    }
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
            let colours = ui.small_button("Colours");
            if colours.on_hover_text("gives each object the colour that is usual for its name").clicked() {
                for (i, object) in state.objects.iter_mut().enumerate() {
                    object.tint = Some(first_tint(&object.name, i));
                }
            }
        });
    }
    // Anatomy must not vanish without a sign.
    let transfer = state.transfer.function().ok();
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
                tint(ui, &mut object.tint, || first_tint(&object.name, i));
                let percent = Slider::from_get_set(0.0..=100.0, |new| {
                    if let Some(new) = new {
                        object.opacity = new / 100.0;
                    }
                    object.opacity * 100.0
                });
                ui.spacing_mut().slider_width = 56.0;
                ui.add(percent.suffix(" %").fixed_decimals(0)).on_hover_text("factor of the opacity per mm");
                own_function(ui, &mut object.transfer, info);
                let target = Target { file: object.file, label: object.label };
                let is_deleted = menu(ui, &mut state.deleted, target, actions.as_deref_mut());
                let count = info.object_splats.get(i).copied();
                let name = RichText::new(&object.name);
                let name = if is_deleted { name.weak().strikethrough() } else { name };
                let name = ui.add(egui::Label::new(name).truncate());
                if let Some(count) = count {
                    name.on_hover_text(format!("{}: {count} splats", object.name));
                }
            });
            let shown = object.visible && object.opacity > 0.0;
            let function = object.transfer.as_ref().map(Transfer::function).transpose().ok().flatten();
            let function = function.as_ref().or(transfer.as_ref());
            if let (true, Some(transfer), Some(own)) = (shown, function, info.object_intensities.get(i))
                && !own.are_seen(transfer)
                && let Some([low, high]) = own.middle_half()
            {
                let text = format!("hardly seen: mostly {low:.0} to {high:.0}{}", info.unit);
                ui.colored_label(SIGNAL, text)
                    .on_hover_text("the transfer function is transparent for most of this object's splats");
            }
        });
    }
    if let Some(alone) = alone {
        state.objects.iter_mut().enumerate().for_each(|(i, o)| o.visible = i == alone);
    }
    restore(ui, &mut state.deleted, info);
}

/// Shows the menu of an object, which deletes, restores or saves it. Returns true if it is deleted.
fn menu(ui: &mut Ui, deleted: &mut Vec<Deletion>, target: Target, actions: Option<&mut Vec<Action>>) -> bool {
    let own = Deletion::Object(target);
    let is_deleted = deleted.contains(&own);
    let menu = ui.menu_button("…", |ui| {
        if is_deleted {
            if ui.button("Restore").on_hover_text("takes back that it was deleted").clicked() {
                deleted.retain(|deletion| *deletion != own);
            }
        } else if ui.button("Delete").on_hover_text("its splats; their file stays as it is").clicked() {
            deleted.push(own);
        }
        let save = Button::new("Save this object…");
        if let Some(actions) = actions
            && ui.add_enabled(!is_deleted, save).on_hover_text("its splats, to a file of their own").clicked()
        {
            actions.push(Action::AskSaveObject(target));
        }
    });
    menu.response.on_hover_text("delete, restore or save its splats");
    is_deleted
}

/// Shows how many splats are deleted, if any are, and restores all of them.
pub(crate) fn restore(ui: &mut Ui, deleted: &mut Vec<Deletion>, info: &PanelInfo<'_>) {
    if deleted.is_empty() {
        return;
    }
    ui.horizontal(|ui| {
        let all = info.splats.unwrap_or(0) + info.deleted;
        ui.label(format!("{} of {all} splats are deleted", info.deleted))
            .on_hover_text("their files stay as they are");
        if ui.small_button("Restore all").on_hover_text("takes back everything that was deleted").clicked() {
            deleted.clear();
        }
    });
}

/// Shows the choice between the transfer function of the scene and presets of the object's own.
fn own_function(ui: &mut Ui, own: &mut Option<Transfer>, info: &PanelInfo<'_>) {
    let text = own.as_ref().map_or("tf".to_owned(), |function| function.name.clone());
    let menu = ui.menu_button(text, |ui| {
        if ui.selectable_label(own.is_none(), "as the scene").clicked() {
            *own = None;
        }
        for preset in PRESETS {
            let chosen = own.as_ref().is_some_and(|function| function.name == preset.name);
            if ui.selectable_label(chosen, preset.name).on_hover_text(preset.about).clicked() {
                *own = Some(Transfer::new(&preset.over(info.range)));
            }
        }
    });
    menu.response.on_hover_text("a transfer function of its own, in mode decoded");
}

/// Shows the choice between a colour of the object's own, at first `first`, and that of the transfer function.
fn tint(ui: &mut Ui, tint: &mut Option<DVec3>, first: impl FnOnce() -> DVec3) {
    let mut own = tint.is_some();
    let check =
        ui.checkbox(&mut own, "").on_hover_text("a colour of its own instead of the transfer function's");
    if check.changed() {
        *tint = own.then(first);
    }
    match tint {
        Some(colour) => {
            colour_button(ui, colour, "the object's colour");
        }
        None => ui.add_space(ui.spacing().interact_size.x + ui.spacing().item_spacing.x),
    }
}
