//! Panel of the error: how far the splats are from the volume that is open beside them, and the colours of that.

use egui::{DragValue, Pos2, Rect, Sense, Stroke, Ui, vec2};
use engine::fidelity::{ShownError, diverging};

use super::widgets::row;
use crate::model::panel_info::{Measured, PanelInfo};
use crate::model::state::ViewState;
use crate::panels::theme::{SIGNAL, screen};

/// Height of the bar of colours, points of the screen.
const BAR: f32 = 12.0;

/// Shows the error and the switches of its colours.
pub fn show(ui: &mut Ui, state: &mut ViewState, info: &PanelInfo<'_>) {
    let error = match info.error {
        Measured::Nothing => return,
        Measured::Later => {
            ui.weak("It is measured once the picture is complete.");
            return;
        }
        Measured::Nowhere => {
            ui.weak("It could not be measured: the splats may be from another scan.");
            return;
        }
        Measured::Found(error) => error,
    };
    for line in in_words(error, info.unit, info.region.is_some()) {
        ui.label(line);
    }
    if error.other_volume {
        ui.colored_label(SIGNAL, "They were fitted to another volume, or to this one read differently.");
    }
    let colours = &mut state.errors;
    ui.checkbox(&mut colours.slices, "Colours in the slices").on_hover_text(
        "over the greyscale slices: blue where the splats are too low, red where they are too high",
    );
    ui.checkbox(&mut colours.picture, "Colours in the picture")
        .on_hover_text("surfaces coloured by their error, in mode decoded; visibility stays the same");
    let mut range = colours.range(error);
    let speed = 0.01 * range;
    row(ui, "Range", "error at which the colours saturate", |ui| {
        let value = DragValue::new(&mut range).speed(speed).range(0.01..=1e6).max_decimals(1);
        if ui.add(value.prefix("± ").suffix(info.unit)).changed() {
            colours.range = Some(range);
        }
        if ui
            .small_button("Auto")
            .on_hover_text("a round number that 99 % of the voxels stay below")
            .clicked()
        {
            colours.range = None;
        }
    });
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), BAR), Sense::hover());
    bar(ui, rect, |share| diverging(2.0 * share - 1.0));
    ends(ui, rect, range, info.unit);
}

/// Returns the error as people say it.
fn in_words(error: &ShownError, unit: &str, of_region: bool) -> [String; 2] {
    let figures = &error.figures;
    let whose = if of_region { "of the region" } else { "where the splats are" };
    [
        format!(
            "99 % of the voxels are within {}{unit}; mean {}{unit}",
            number(figures.p99_hu),
            number(figures.mean_error_hu)
        ),
        format!("{} voxels {whose}, splats minus volume", error.voxels),
    ]
}

/// Formats an error: with a decimal where it is small.
pub(crate) fn number(error: f64) -> String {
    if error.abs() < 9.95 { format!("{error:.1}") } else { format!("{error:.0}") }
}

/// Paints a bar of colours, from left to right.
pub(crate) fn bar(ui: &Ui, rect: Rect, colour: impl Fn(f64) -> [f32; 3]) {
    const STEPS: usize = 64;
    let step = rect.width() / STEPS as f32;
    for i in 0..STEPS {
        let left = rect.left() + i as f32 * step;
        let part = Rect::from_min_size(Pos2::new(left, rect.top()), vec2(step + 0.5, rect.height()));
        let [r, g, b] = colour((i as f64 + 0.5) / STEPS as f64).map(f64::from);
        ui.painter().rect_filled(part, 0.0, screen(glam::DVec3::new(r, g, b)));
    }
    let edge = Stroke::new(1.0, egui::Color32::from_gray(160));
    ui.painter().rect_stroke(rect, 0.0, edge, egui::StrokeKind::Inside);
}

/// Shows the ends and the middle of a bar from -`range` to `range`.
pub(crate) fn ends(ui: &mut Ui, bar: Rect, range: f64, unit: &str) {
    let height = ui.text_style_height(&egui::TextStyle::Small);
    let (rect, _) = ui.allocate_exact_size(vec2(bar.width(), height), Sense::hover());
    let font = egui::TextStyle::Small.resolve(ui.style());
    let colour = ui.visuals().text_color();
    for (at, align, text) in [
        (rect.left_top(), egui::Align2::LEFT_TOP, format!("-{}{unit}, too low", number(range))),
        (rect.center_top(), egui::Align2::CENTER_TOP, "0".to_owned()),
        (rect.right_top(), egui::Align2::RIGHT_TOP, format!("+{}{unit}, too high", number(range))),
    ] {
        ui.painter().text(at, align, text, font.clone(), colour);
    }
}
