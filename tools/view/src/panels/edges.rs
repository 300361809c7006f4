//! Panel of how the edges of a binary region are shown.

use egui::{DragValue, Ui};
use engine::volume::edges::Edges;

use super::widgets::row;
use crate::model::state::ViewState;

/// Farthest that edges may move, mm.
const MOST_MM: f64 = 5.0;

/// Shows how far the edges of binary regions may move, and changes it.
pub fn show(ui: &mut Ui, state: &mut ViewState) {
    row(ui, "Edges", "how the edges of a binary mask are shown", |ui| {
        let is_smooth = state.edges != Edges::Voxel;
        let blocks =
            ui.selectable_label(!is_smooth, "Blocks").on_hover_text("blocky, exactly as the mask has them");
        let smooth = ui.selectable_label(is_smooth, "Smooth").on_hover_text(
            "at 0 mm every voxel keeps its side; larger values smooth the stairs of a coarse mask",
        );
        if blocks.clicked() {
            state.edges = Edges::Voxel;
        }
        if smooth.clicked() && !is_smooth {
            state.edges = Edges::default();
        }
        if let Edges::Within(mm) = &mut state.edges {
            ui.add(DragValue::new(mm).range(0.0..=MOST_MM).speed(0.02).suffix(" mm").fixed_decimals(1))
                .on_hover_text("how far edges may move to be smooth");
        }
    });
}
