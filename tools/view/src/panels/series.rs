//! Question which series of a DICOM folder is meant.

use egui::text::{LayoutJob, TextFormat};
use egui::{
    Align, Button, Color32, ColorImage, Context, FontId, Id, Image, Layout, Modal, ScrollArea, TextStyle,
    TextureHandle, TextureOptions, Ui, vec2,
};
use engine::volume::dicom::{Series as Row, Slice};

use super::widgets::escaped;
use crate::model::series::Series;
use crate::panels::theme::SIGNAL;

/// Edge of the picture of a slice, points of the screen.
const PICTURE: f32 = 72.0;
/// Edge of the picture of a slice, pixels at most.
const PIXELS: usize = 144;
/// Share of the intensities of a slice that are black, and that are white.
const CLIPPED: f64 = 0.02;

/// Answer of a user who is asked for a series.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Choice {
    /// Number of the series that is meant.
    Number(usize),
    /// None is opened.
    Cancel,
}

/// Pictures of the slices, in the order of the series; empty until they are shown.
pub type SeriesPictures = Vec<Option<TextureHandle>>;

/// Asks which series is meant. Returns the answer once there is one.
pub fn show(context: &Context, series: &Series, pictures: &mut SeriesPictures) -> Option<Choice> {
    if pictures.len() != series.rows.len() {
        let picture = |row: &Row| {
            let image = picture_of(row.slice.as_ref()?)?;
            Some(context.load_texture(&row.key, image, TextureOptions::LINEAR))
        };
        *pictures = series.rows.iter().map(picture).collect();
    }
    let modal = Modal::new(Id::new("series")).show(context, |ui| {
        ui.set_width(560.0);
        ui.heading("Which series?");
        let name = series.files.volume.as_ref().and_then(|path| path.file_name()).unwrap_or_default();
        ui.weak(format!("{} holds {} of them.", name.to_string_lossy(), series.rows.len()));
        let who = shared(&series.rows);
        if !who.is_empty() {
            ui.strong(&who);
        }
        let mut choice = None;
        let below = ui.ctx().content_rect().height() - 220.0;
        ScrollArea::vertical().max_height(below.clamp(160.0, 480.0)).show(ui, |ui| {
            ui.with_layout(Layout::top_down_justified(Align::LEFT), |ui| {
                for (row, picture) in series.rows.iter().zip(pictures.iter()) {
                    let asked = series.files.series.as_ref();
                    let is_asked =
                        |asked: &String| *asked == row.key || *asked == row.summary.number.to_string();
                    let job = told(ui, row, who.is_empty());
                    let button = match picture {
                        Some(texture) => Button::image_and_text(scaled(texture), job),
                        None => Button::new(job),
                    };
                    let entry = ui.add(button.selected(asked.is_some_and(is_asked)));
                    if entry.on_hover_text(&row.summary.series_uid).clicked() {
                        choice = Some(Choice::Number(row.summary.number));
                    }
                }
            });
        });
        if ui.button("Cancel").on_hover_text("keep what is open").clicked() {
            choice = Some(Choice::Cancel);
        }
        choice
    });
    if modal.inner.is_none() && escaped(context, &modal) { Some(Choice::Cancel) } else { modal.inner }
}

/// Returns patient and day of a series.
fn who(row: &Row) -> String {
    [row.patient.as_str(), &row.study_date]
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(", ")
}

/// Returns what [`who`] says of all of them; nothing if they differ.
fn shared(rows: &[Row]) -> String {
    let first = rows.first().map(who).unwrap_or_default();
    if rows.iter().all(|row| who(row) == first) { first } else { String::new() }
}

/// Returns the texture at the size of its row.
fn scaled(texture: &TextureHandle) -> Image<'static> {
    let size = texture.size_vec2();
    let factor = PICTURE / size.x.max(size.y);
    Image::from_texture((texture.id(), size)).fit_to_exact_size(vec2(size.x * factor, size.y * factor))
}

/// Returns the text of a row: what it is, of whom, how fine, and what is wrong with it.
fn told(ui: &Ui, row: &Row, with_patient: bool) -> LayoutJob {
    let visuals = ui.visuals();
    let [body, small] = [TextStyle::Body, TextStyle::Small].map(|style| style.resolve(ui.style()));
    let mut job = LayoutJob::default();
    let mut line = |text: &str, font: &FontId, colour: Color32| {
        let text = if job.text.is_empty() { text.to_owned() } else { format!("\n{text}") };
        job.append(&text, 0.0, TextFormat::simple(font.clone(), colour));
    };
    line(&row.summary.line(), &body, visuals.strong_text_color());
    let who = who(row);
    if with_patient && !who.is_empty() {
        line(&who, &small, visuals.text_color());
    }
    let mut parts = Vec::new();
    if row.thickness_mm > 0.0 {
        parts.push(format!("{:.2} mm thick", row.thickness_mm));
    }
    if let Some(mm) = row.distance_mm {
        parts.push(format!("{mm:.2} mm apart"));
    }
    if let Some(slice) = &row.slice {
        parts.push(format!("pixels of {:.2} mm", slice.spacing_mm[0]));
    }
    if !parts.is_empty() {
        line(&parts.join(", "), &small, visuals.text_color());
    }
    for note in &row.notes {
        line(note, &small, SIGNAL);
    }
    job
}

/// Returns the picture of a slice in grey, with square pixels; `None` if it has no finite value.
fn picture_of(slice: &Slice) -> Option<ColorImage> {
    let mut sorted: Vec<f32> = slice.samples.iter().copied().filter(|v| v.is_finite()).collect();
    let at = |share: f64| (share * (sorted.len().max(1) - 1) as f64).round() as usize;
    let [first, last] = [at(CLIPPED), at(1.0 - CLIPPED)];
    sorted.sort_unstable_by(f32::total_cmp);
    let (black, white) = (*sorted.get(first)?, *sorted.get(last)?);
    let range = (white - black).max(f32::MIN_POSITIVE);
    let edges = [0, 1].map(|i| slice.size[i] as f64 * slice.spacing_mm[i]);
    let longest = edges[0].max(edges[1]);
    let size = edges.map(|edge| ((edge / longest * PIXELS as f64).round() as usize).clamp(1, PIXELS));
    let mut greys = Vec::with_capacity(size[0] * size[1]);
    for y in 0..size[1] {
        for x in 0..size[0] {
            // The mean of the pixels that this one shows.
            let bounds = |i: usize, at: usize| {
                let from = at * slice.size[i] / size[i];
                from..((at + 1) * slice.size[i] / size[i]).max(from + 1)
            };
            let columns = bounds(0, x);
            let values = bounds(1, y).flat_map(|row| {
                let row = &slice.samples[row * slice.size[0]..];
                columns.clone().map(|column| row[column])
            });
            let (sum, count) = values.filter(|v| v.is_finite()).fold((0.0, 0), |(s, n), v| (s + v, n + 1));
            let grey = (sum / count.max(1) as f32 - black) / range;
            greys.push((grey.clamp(0.0, 1.0) * 255.0).round() as u8);
        }
    }
    Some(ColorImage::from_gray(size, &greys))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slice_is_shown_in_its_shape_from_its_darkest_to_its_brightest() {
        let samples = (0..400 * 100).map(|i| if i % 400 < 200 { -1000.0 } else { 40.0 }).collect();
        let slice = Slice { size: [400, 100], spacing_mm: [0.5, 1.0], samples };
        let picture = picture_of(&slice).expect("a picture");
        assert_eq!(picture.size, [PIXELS, PIXELS / 2], "twice as wide as high, in mm");
        assert_eq!((picture.pixels[10], picture.pixels[PIXELS - 10]), (Color32::BLACK, Color32::WHITE));
        // A slice smaller than its picture.
        let small = Slice { size: [2, 2], spacing_mm: [1.0; 2], samples: vec![0.0, 1.0, 2.0, f32::NAN] };
        assert_eq!(picture_of(&small).expect("a picture").size, [PIXELS; 2]);
        assert!(picture_of(&Slice { samples: vec![f32::NAN; 4], ..small }).is_none());
    }
}
