//! Statistics in a corner of the picture: frame times, passes, splats and memory.

use egui::{Align2, Color32, Context, Frame, Id, Rect, Sense, Stroke, Ui, pos2, vec2};

use crate::model::panel_info::{FRAMES, PanelInfo, Statistics};
use crate::panels::theme::{ACCENT, SIGNAL};

/// Number of passes that are listed, the slowest ones.
const PASSES: usize = 6;

/// Shows the statistics at the upper right corner of the picture.
pub fn show(context: &Context, picture: Rect, info: &PanelInfo<'_>, target_ms: f64) {
    egui::Area::new(Id::new("overlay"))
        .pivot(Align2::RIGHT_TOP)
        .fixed_pos(picture.right_top() + vec2(-8.0, 8.0))
        .interactable(false)
        .show(context, |ui| {
            Frame::popup(ui.style()).fill(Color32::from_black_alpha(170)).show(ui, |ui| {
                ui.set_width(230.0);
                rows(ui, info, target_ms);
            });
        });
}

fn rows(ui: &mut Ui, info: &PanelInfo<'_>, target_ms: f64) {
    let statistics = info.statistics;
    ui.small(&statistics.device);
    match (statistics.percentile_ms(0.5), statistics.percentile_ms(0.95)) {
        (Some(median), Some(p95)) => {
            ui.strong(format!("{median:.1} ms, p95 {p95:.1} ms, {:.0} fps", 1000.0 / median.max(1e-3)));
        }
        _ => _ = ui.weak("no frame yet"),
    }
    curve(ui, statistics, target_ms);
    let line = |ui: &mut Ui, name: &str, value: String| {
        ui.horizontal(|ui| {
            ui.small(name);
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| ui.small(value));
        });
    };
    if let Some(all) = info.splats {
        let drawn = statistics.active_splats.map_or("?".to_owned(), |n| n.to_string());
        line(ui, "splats drawn", format!("{drawn} of {all}"));
    }
    if let Some(step) = statistics.step {
        line(ui, "step", format!("{step:.2}"));
    }
    ui.separator();
    for (name, ms) in statistics.passes.iter().take(PASSES) {
        line(ui, name, format!("{ms:.2} ms"));
    }
    ui.separator();
    for (purpose, bytes) in &statistics.memory {
        line(ui, purpose, mebibytes(*bytes));
    }
    line(ui, "device memory", mebibytes(statistics.memory.values().sum()));
}

fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

/// Shows frame times as bars and the target as a line.
fn curve(ui: &mut Ui, statistics: &Statistics, target_ms: f64) {
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), 36.0), Sense::hover());
    let most = statistics.frames_ms().fold(1.5 * target_ms, f64::max);
    let height = |ms: f64| (ms / most) as f32 * rect.height();
    let width = rect.width() / FRAMES as f32;
    let first = FRAMES - statistics.frames_ms().len();
    for (i, ms) in statistics.frames_ms().enumerate() {
        let x = rect.left() + (first + i) as f32 * width;
        let bar = Rect::from_min_max(pos2(x, rect.bottom() - height(ms)), pos2(x + width, rect.bottom()));
        ui.painter().rect_filled(bar, 0.0, if ms > target_ms { SIGNAL } else { ACCENT });
    }
    ui.painter().hline(
        rect.x_range(),
        rect.bottom() - height(target_ms),
        Stroke::new(1.0, Color32::from_gray(160)),
    );
}
