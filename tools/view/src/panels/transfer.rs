//! Panel of the transfer function: presets, windows, the editor, shift and light.

use egui::{Button, ComboBox, DragValue, Image, Slider, Ui, Vec2};
use engine::transfer::{PRESETS, Preset, WINDOWS};
use engine::unit::Unit;

use super::light;
use super::widgets::{ask, colour_button, row};
use crate::model::actions::Action;
use crate::model::panel_info::PanelInfo;
use crate::model::state::ViewState;
use crate::panels::editor::widget::{self, Backdrop};
use crate::panels::editor::{Editor, full_range};

/// Gradients that a new ramp goes from and to, as shares of the range of the data.
const STEEP: [f64; 2] = [0.01, 0.05];
/// Height of the editor, points of the screen.
const TALL: f32 = 190.0;
/// Height to which the list of presets may grow, points of the screen.
const TALLEST_LIST: f32 = 560.0;
/// Size of a preset's thumbnail, points of the screen.
const THUMBNAIL: Vec2 = Vec2::new(64.0, 48.0);

/// Shows the transfer function and changes it.
pub fn show(
    ui: &mut Ui,
    state: &mut ViewState,
    editor: &mut Editor,
    info: &PanelInfo<'_>,
    actions: &mut Vec<Action>,
) {
    choices(ui, state, info, actions);
    curve(ui, state, editor, info);
    state.edit_transfer(|state| gradient_row(ui, state, info));
    light::show(ui, state);
}

/// Shows the curve with its points, window and shift, and changes them.
pub fn curve(ui: &mut Ui, state: &mut ViewState, editor: &mut Editor, info: &PanelInfo<'_>) {
    let backdrop =
        Backdrop { range: info.range, splats: info.splat_histogram, volume: info.volume_histogram };
    let by_kind = state.objects.iter().filter(|object| object.has_usual_function()).count();
    if by_kind > 0 {
        let text = "Each object has a function for its kind. Changes here apply to all of them.";
        ui.weak(text).on_hover_text("Usual look, above the objects, restores them");
    }
    state.edit_transfer(|state| {
        widget::show(ui, editor, &mut state.transfer, &backdrop, TALL);
        point(ui, state, editor, info);
        window_row(ui, state, info);
        shift_row(ui, state, info);
    });
}

/// Shows all presets, those for such data first, with what the scene looks like by each where there are pictures of it; a click chooses one of
/// them.
pub fn presets(ui: &mut Ui, state: &ViewState, info: &PanelInfo<'_>, actions: &mut Vec<Action>) {
    if info.thumbnails.is_some() {
        actions.push(Action::WantThumbnails);
    }
    let own = if info.unit.is_empty() { Unit::Arbitrary } else { Unit::Hu };
    let (first, others): (Vec<&Preset>, Vec<&Preset>) = PRESETS.iter().partition(|preset| preset.unit == own);
    let heading =
        if info.unit.is_empty() { "For CT, in HU" } else { "Over the range of the data, as for MR" };
    for (i, preset) in first.iter().chain(&others).copied().enumerate() {
        if i == first.len() {
            ui.weak(heading);
        }
        let chosen = state.transfer.name == preset.name;
        let button = match info.thumbnails.map(|thumbnails| thumbnails.of(preset.name)) {
            None => Button::selectable(chosen, preset.name),
            Some(None) => Button::selectable(chosen, preset.name).min_size(THUMBNAIL),
            Some(Some(picture)) => {
                let picture = Image::from_texture(picture).fit_to_exact_size(THUMBNAIL);
                Button::selectable(chosen, (picture, preset.name))
            }
        };
        if ui.add(button).on_hover_text(preset.about).clicked() {
            actions.push(Action::Transfer(preset.name.to_owned()));
        }
    }
}

/// Shows presets, windows and files to choose from.
fn choices(ui: &mut Ui, state: &ViewState, info: &PanelInfo<'_>, actions: &mut Vec<Action>) {
    ui.horizontal(|ui| {
        ComboBox::from_id_salt("preset")
            .selected_text(&state.transfer.name)
            .width(150.0)
            .height(TALLEST_LIST)
            .show_ui(ui, |ui| {
                presets(ui, state, info, actions);
            });
        ComboBox::from_id_salt("window").selected_text("Window").width(70.0).show_ui(ui, |ui| {
            for window in WINDOWS {
                let help = format!("W {} L {}{}", window.width, window.level, info.unit);
                if ui.selectable_label(false, window.name).on_hover_text(help).clicked() {
                    actions.push(Action::Transfer(format!("window:{}", window.name)));
                }
            }
        });
        ask(ui, "Open…", Action::AskTransfer, actions);
        ask(ui, "Save…", Action::AskSaveTransfer, actions)
            .on_hover_text("save it as a Slicer volume property");
    });
}

/// Shows the selected point in numbers, and buttons that change the points.
fn point(ui: &mut Ui, state: &mut ViewState, editor: &mut Editor, info: &PanelInfo<'_>) {
    let transfer = &mut state.transfer;
    let full = full_range(transfer, info.range);
    ui.horizontal(|ui| {
        if ui
            .button("+")
            .on_hover_text("add a point next to the selected one (Insert, or double click)")
            .clicked()
        {
            editor.add_beside(transfer, full);
        }
        let chosen = editor.selected(transfer);
        let enough = transfer.points.len() > 2 && chosen.is_some();
        let minus = ui.add_enabled(enough, egui::Button::new("−"));
        if minus.on_hover_text("remove the selected point (Delete); at least two remain").clicked() {
            editor.remove(transfer);
        }
        if ui.button("All").on_hover_text("all intensities in view; the wheel zooms").clicked() {
            editor.view_all();
        }
        let Some(index) = editor.selected(transfer) else {
            ui.weak("select a point, or double click to add one");
            return;
        };
        let mut colour = transfer.points[index].colour;
        if colour_button(ui, &mut colour, "the point's colour") {
            editor.colour(transfer, colour);
        }
        let point = transfer.points[index];
        let (mut at, mut percent) = (point.intensity + transfer.shift, 100.0 * point.opacity);
        let speed = ((full[1] - full[0]) / 1000.0).max(1e-6);
        let value = DragValue::new(&mut at).speed(speed).max_decimals(1).suffix(info.unit);
        let moved = ui.add(value).on_hover_text("the point's intensity").changed();
        let value =
            DragValue::new(&mut percent).speed(0.1).range(0.0..=100.0).max_decimals(2).suffix(" %/mm");
        let raised = ui.add(value).on_hover_text("part of the light that a millimetre absorbs").changed();
        if moved || raised {
            editor.move_to(transfer, at, percent / 100.0, full);
        }
    });
}

fn shift_row(ui: &mut Ui, state: &mut ViewState, info: &PanelInfo<'_>) {
    row(ui, "Shift", "move all points", |ui| {
        let span = info.range[1] - info.range[0];
        let slider = Slider::new(&mut state.transfer.shift, -0.25 * span..=0.25 * span);
        ui.add(slider.suffix(info.unit).clamping(egui::SliderClamping::Never).max_decimals(1));
        if ui.small_button("0").on_hover_text("no shift").clicked() {
            state.transfer.shift = 0.0;
        }
    });
}

/// Shows over which gradients opacity grows, and changes them.
fn gradient_row(ui: &mut Ui, state: &mut ViewState, info: &PanelInfo<'_>) {
    let transfer = &mut state.transfer;
    let span = (info.range[1] - info.range[0]).max(1e-6);
    let help = "show edges only, in modes volume and decoded: nothing below the first gradient, everything above the second";
    ui.horizontal(|ui| {
        let mut on = !transfer.gradient_opacities.is_empty();
        if ui.checkbox(&mut on, "Gradient").on_hover_text(help).changed() {
            transfer.set_gradient_ramp(on.then_some(STEEP.map(|share| share * span)));
        }
        match transfer.gradient_ramp() {
            Some([mut from, mut to]) => {
                let changed = ui.add(slope(&mut from, span).range(0.0..=to)).changed();
                let unit = format!("{}/voxel", info.unit);
                let change = ui.add(slope(&mut to, span).range(from..=f64::MAX).suffix(unit));
                if change.on_hover_text("change of intensity over one mean voxel spacing").changed()
                    || changed
                {
                    transfer.set_gradient_ramp(Some([from, to]));
                }
            }
            None if on => {
                ui.weak("as in the file");
            }
            None => {}
        }
    });
}

/// Makes the box of a gradient of data that span `span`.
fn slope(value: &mut f64, span: f64) -> DragValue<'_> {
    DragValue::new(value).speed(span / 2000.0).max_decimals(1)
}

/// Shows width and level of the window that the points span, and changes them.
fn window_row(ui: &mut Ui, state: &mut ViewState, info: &PanelInfo<'_>) {
    let [low, high] = state.transfer.window();
    let (mut width, mut level) = (high - low, (low + high) * 0.5);
    row(ui, "Window", "width and level: from the first to the last point, and the middle", |ui| {
        let speed = ((info.range[1] - info.range[0]) / 1000.0).max(1e-6);
        let value = |v| DragValue::new(v).speed(speed).max_decimals(1).suffix(info.unit);
        let wide = ui.add(value(&mut width).prefix("W ").range(speed..=f64::MAX));
        let high = ui.add(value(&mut level).prefix("L "));
        if wide.changed() || high.changed() {
            state.transfer.set_window([level - 0.5 * width, level + 0.5 * width]);
        }
    });
}
