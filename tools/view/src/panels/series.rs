//! Question which series of a DICOM folder is meant.

use egui::{Context, Id, Modal, ScrollArea};

use crate::series::Series;

/// Answer of a user who is asked for a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// Number of the series that is meant.
    Number(usize),
    /// None is opened.
    Cancel,
}

/// Asks which series is meant. Returns the answer once there is one.
pub fn show(context: &Context, series: &Series) -> Option<Choice> {
    let modal = Modal::new(Id::new("series")).show(context, |ui| {
        ui.set_width(460.0);
        ui.heading("Which series?");
        let name = series.files.volume.as_ref().and_then(|path| path.file_name()).unwrap_or_default();
        ui.weak(format!("{} holds {} of them.", name.to_string_lossy(), series.rows.len()));
        let mut choice = None;
        ScrollArea::vertical().max_height(320.0).show(ui, |ui| {
            for row in &series.rows {
                let chosen = series.files.series.as_ref() == Some(&row.number.to_string());
                let entry = ui.selectable_label(chosen, row.line());
                if entry.on_hover_text(&row.series_uid).clicked() {
                    choice = Some(Choice::Number(row.number));
                }
            }
        });
        if ui.button("Cancel").on_hover_text("what is open stays").clicked() {
            choice = Some(Choice::Cancel);
        }
        choice
    });
    if modal.inner.is_none() && modal.should_close() { Some(Choice::Cancel) } else { modal.inner }
}
