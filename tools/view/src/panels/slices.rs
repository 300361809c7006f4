//! Panel of the slices: three planes with a crosshair, and the window in which they are grey.

use egui::{
    Align2, Color32, ColorImage, DragValue, FontId, PointerButton, Rect, Response, Sense, Stroke,
    TextureHandle, TextureOptions, Ui, pos2, vec2,
};
use engine::fidelity::diverging;
use glam::{DVec2, DVec3};

use super::error::{bar, ends};
use crate::model::panel_info::PanelInfo;
use crate::model::slices::{SlicePlane, first_window, grey};
use crate::model::state::{ErrorColours, Slices};

/// Pixels of the longer side of a slice through a volume, and through splats alone, which take longer.
const PIXELS: [usize; 2] = [320, 128];
/// Length of a drag that changes the window by a factor of e, points of the screen.
const POINTS_PER_E: f32 = 250.0;
/// Length of scrolling that moves a slice by a hundredth of the scene, points of the screen.
const POINTS_PER_STEP: f32 = 25.0;
/// Height of what stands under the slices, points of the screen, and of what the error adds to it.
const FOOT: f32 = 64.0;
const LEGEND: f32 = 58.0;

/// Colour of a region over the grey of the slices, and its part of the mixture.
const SHADE: ([f32; 3], f32) = ([64.0, 200.0, 255.0], 0.4);

/// What is shaded in the slices, which show the whole volume then.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shade {
    /// Nothing.
    Nothing,
    /// The region of the volume.
    Region,
    /// What lies between two intensities.
    Between([f64; 2]),
}

/// What the pixels of a slice depend on.
#[derive(Clone, PartialEq)]
struct Key {
    shade: Option<Shade>,
    /// Error at which its colours end, where it is shown.
    error: Option<f64>,
    data: u64,
    volume: bool,
    bounds: [DVec3; 2],
    depth_mm: f64,
    window: [f64; 2],
}

/// Pictures of the slices, made anew where they have to be.
#[derive(Default)]
pub struct SliceImages {
    shown: [Option<(Key, TextureHandle)>; 3],
}

/// Returns the colour of a plane, by which its line is known in the others.
fn colour(plane: SlicePlane) -> Color32 {
    match plane {
        SlicePlane::Axial => Color32::from_rgb(235, 90, 80),
        SlicePlane::Coronal => Color32::from_rgb(110, 200, 110),
        SlicePlane::Sagittal => Color32::from_rgb(235, 200, 90),
    }
}

/// Shows the slices through the crosshair, which they move. With a `shade` they show all of the volume and shade a
/// part of it; otherwise they may have the colours of the error.
pub fn show(
    ui: &mut Ui,
    slices: &mut Slices,
    images: &mut SliceImages,
    info: &PanelInfo<'_>,
    shade: Option<Shade>,
    errors: ErrorColours,
) {
    let Some(bounds) = info.volume_bounds.filter(|_| shade.is_some()).or(info.bounds) else {
        _ = ui.weak("nothing is open");
        return;
    };
    // A session file may hold any numbers.
    slices.at_mm = slices.at_mm.filter(|at| at.is_finite());
    slices.window = slices.window.filter(|window| window.iter().all(|v| v.is_finite()));
    let at_mm = slices.at_mm.get_or_insert((bounds[0] + bounds[1]) * 0.5);
    *at_mm = at_mm.clamp(bounds[0], bounds[1]);
    let window = slices.window.get_or_insert_with(|| first_window(info.range, !info.unit.is_empty()));
    let error = info.error.found().filter(|_| errors.slices && shade.is_none());
    let range = error.map(|error| errors.range(error));
    let foot_height = if range.is_some() { FOOT + LEGEND } else { FOOT };
    let width = ui.available_width();
    let height = (ui.available_height() - foot_height) / 3.0 - ui.spacing().item_spacing.y;
    for (plane, image) in SlicePlane::ALL.into_iter().zip(&mut images.shown) {
        let extent = plane.extent_mm(bounds).max(DVec2::splat(1e-9));
        let scale = (width / extent.x as f32).min(height.max(40.0) / extent.y as f32);
        let size = vec2(extent.x as f32, extent.y as f32) * scale;
        let (place, _) = ui.allocate_exact_size(vec2(width, size.y), Sense::hover());
        let rect = Rect::from_center_size(place.center(), size);
        let response = ui.interact(rect, ui.id().with(plane.name()), Sense::click_and_drag());
        lead(ui, &response, rect, plane, bounds, at_mm, window);
        let key = Key {
            shade,
            error: range,
            data: info.data,
            volume: info.volume,
            bounds,
            depth_mm: at_mm[plane.axes()[2]],
            window: *window,
        };
        paint(ui, image, key, rect, plane, *at_mm, info);
    }
    let intensity = match shade {
        Some(_) => (info.sample_whole)(*at_mm).map(|(intensity, _)| intensity),
        None => (info.sample)(*at_mm),
    };
    if let (Some(error), Some(range)) = (error, range) {
        legend(ui, error.at(*at_mm), range, info.unit);
    }
    foot(ui, *at_mm, intensity, window, info.unit);
}

/// Moves the crosshair and changes the window, as the mouse says.
fn lead(
    ui: &Ui,
    response: &Response,
    rect: Rect,
    plane: SlicePlane,
    bounds: [DVec3; 2],
    at_mm: &mut DVec3,
    window: &mut [f64; 2],
) {
    let primary = response.clicked() || response.dragged_by(PointerButton::Primary);
    if let (true, Some(at)) = (primary, response.interact_pointer_pos()) {
        let from = (at - rect.min) / rect.size();
        let place = DVec2::new(f64::from(from.x), f64::from(from.y)).clamp(DVec2::ZERO, DVec2::ONE);
        *at_mm = plane.point(place, *at_mm, bounds);
    }
    let by = response.drag_delta();
    if response.dragged_by(PointerButton::Secondary) && by != egui::Vec2::ZERO {
        let [low, high] = *window;
        let (width, level) = (high - low, (low + high) * 0.5);
        let half = 0.5 * width * f64::from(by.x / POINTS_PER_E).exp();
        let level = level - width * f64::from(by.y / POINTS_PER_E);
        *window = [level - half, level + half];
    }
    if response.hovered() {
        let scroll = ui.input(|i| i.smooth_scroll_delta().y);
        let axis = plane.axes()[2];
        let step = (bounds[1][axis] - bounds[0][axis]) / 100.0;
        let moved = at_mm[axis] + step * f64::from(scroll / POINTS_PER_STEP);
        at_mm[axis] = moved.clamp(bounds[0][axis], bounds[1][axis]);
    }
}

/// Returns the pixels of a slice.
fn pixels(key: &Key, size: [usize; 2], plane: SlicePlane, at_mm: DVec3, info: &PanelInfo<'_>) -> ColorImage {
    let slice = |sample: &dyn Fn(DVec3) -> Option<f64>| plane.intensities(at_mm, key.bounds, size, sample);
    let Some(shade) = key.shade else {
        let greys = slice(info.sample).into_iter().map(|v| grey(v, key.window));
        let (Some(error), Some(range)) = (info.error.found(), key.error) else {
            return ColorImage::from_gray(size, &greys.collect::<Vec<u8>>());
        };
        let errors = slice(&|at| error.at(at));
        let mixed = greys.zip(errors).map(|(grey, error)| {
            let [r, g, b] =
                over(f32::from(grey) / 255.0, f64::from(error) / range).map(|v| (255.0 * v).round() as u8);
            Color32::from_rgb(r, g, b)
        });
        return ColorImage::new(size, mixed.collect());
    };
    let intensities = slice(&|at| (info.sample_whole)(at).map(|(intensity, _)| intensity));
    let weights = match shade {
        Shade::Region => slice(&|at| (info.sample_whole)(at).map(|(_, weight)| weight)),
        Shade::Between([low, high]) => {
            intensities.iter().map(|v| f32::from((low..=high).contains(&f64::from(*v)))).collect()
        }
        Shade::Nothing => vec![0.0; intensities.len()],
    };
    let mixed = intensities.iter().zip(&weights).map(|(&intensity, &weight)| {
        let grey = f32::from(grey(intensity, key.window));
        // Outside of the volume the weight is NaN, too, and nothing is shaded.
        let part = SHADE.1 * weight.max(0.0);
        let [r, g, b] = SHADE.0.map(|shade| (grey + part * (shade - grey)).round() as u8);
        Color32::from_rgb(r, g, b)
    });
    ColorImage::new(size, mixed.collect())
}

/// Returns a grey, 0 to 1, under the colour of an error, -1 to 1: the larger the error, the less is seen of the grey. NaN
/// is no error.
fn over(grey: f32, error: f64) -> [f32; 3] {
    if error.is_nan() {
        return [grey; 3];
    }
    let share = error.abs().min(1.0).powf(0.8) as f32;
    diverging(if error < 0.0 { -1.0 } else { 1.0 }).map(|end| grey + share * (end - grey))
}

/// Shows the error at the crosshair, and which colours errors have.
fn legend(ui: &mut Ui, error: Option<f64>, range: f64, unit: &str) {
    match error {
        Some(error) => ui.monospace(format!("error {error:+.1}{unit}")),
        None => ui.weak("no error here: outside the region"),
    };
    let (rect, _) = ui.allocate_exact_size(vec2(ui.available_width(), 12.0), Sense::hover());
    bar(ui, rect, |share| over(0.5, 2.0 * share - 1.0));
    ends(ui, rect, range, unit);
}

/// Paints a slice with the lines of the others, the patient's sides and its name.
fn paint(
    ui: &Ui,
    image: &mut Option<(Key, TextureHandle)>,
    key: Key,
    rect: Rect,
    plane: SlicePlane,
    at_mm: DVec3,
    info: &PanelInfo<'_>,
) {
    let bounds = key.bounds;
    if image.as_ref().is_none_or(|(shown, _)| *shown != key) {
        let size = plane.pixels(bounds, if info.volume { PIXELS[0] } else { PIXELS[1] });
        let pixels = pixels(&key, size, plane, at_mm, info);
        match image {
            Some((shown, texture)) => {
                texture.set(pixels, TextureOptions::LINEAR);
                *shown = key;
            }
            None => {
                let texture = ui.ctx().load_texture(plane.name(), pixels, TextureOptions::LINEAR);
                *image = Some((key, texture));
            }
        }
    }
    let Some((_, texture)) = image else { return };
    let painter = ui.painter_at(rect.expand(1.0));
    let whole = Rect::from_min_max(pos2(0.0, 0.0), pos2(1.0, 1.0));
    painter.image(texture.id(), rect, whole, Color32::WHITE);
    painter.rect_stroke(rect, 0.0, Stroke::new(1.0, colour(plane)), egui::StrokeKind::Inside);
    let place = plane.place(at_mm, bounds);
    let cross = rect.min + vec2(place.x as f32, place.y as f32) * rect.size();
    // The line across the axis u of a slice is the plane that is seen along u.
    let seen_along =
        |axis: usize| SlicePlane::ALL.into_iter().find(|p| p.axes()[2] == axis).unwrap_or(SlicePlane::Axial);
    let [u, v, _] = plane.axes();
    painter.vline(cross.x, rect.y_range(), Stroke::new(1.0, colour(seen_along(u)).gamma_multiply(0.7)));
    painter.hline(rect.x_range(), cross.y, Stroke::new(1.0, colour(seen_along(v)).gamma_multiply(0.7)));
    let font = FontId::proportional(12.0);
    let inner = rect.shrink(3.0);
    painter.text(inner.left_top(), Align2::LEFT_TOP, plane.name(), font.clone(), colour(plane));
    if info.oriented {
        let places = [
            (inner.left_center(), Align2::LEFT_CENTER),
            (inner.right_center(), Align2::RIGHT_CENTER),
            (inner.center_top(), Align2::CENTER_TOP),
            (inner.center_bottom(), Align2::CENTER_BOTTOM),
        ];
        for (text, (at, align)) in plane.letters().into_iter().zip(places) {
            painter.text(at, align, text, font.clone(), Color32::WHITE);
        }
    }
}

/// Shows what is at the crosshair, and the window.
fn foot(ui: &mut Ui, at_mm: DVec3, intensity: Option<f64>, window: &mut [f64; 2], unit: &str) {
    ui.horizontal(|ui| {
        match intensity {
            Some(v) => ui.monospace(format!("{v:.1}{unit}")),
            None => ui.weak("nothing here"),
        };
        ui.monospace(format!("({:.1}, {:.1}, {:.1}) mm", at_mm.x, at_mm.y, at_mm.z))
            .on_hover_text("the crosshair: right, anterior, superior of the scanner's origin");
    });
    ui.horizontal(|ui| {
        ui.label("Window").on_hover_text("greyscale window of the slices; or drag with the right button");
        let [low, high] = window;
        let speed = (*high - *low).abs() * 0.005;
        ui.add(DragValue::new(low).speed(speed).max_decimals(0));
        ui.label("to");
        ui.add(DragValue::new(high).speed(speed).max_decimals(0).suffix(unit));
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_larger_an_error_the_less_is_seen_of_the_grey() {
        assert_eq!(over(0.3, 0.0), [0.3; 3]);
        assert_eq!(over(0.3, f64::NAN), [0.3; 3], "no error is known");
        for (error, end) in [(-1.0, -1.0), (-7.0, -1.0), (1.0, 1.0), (7.0, 1.0)] {
            let apart = (0..3).map(|k| (over(0.3, error)[k] - diverging(end)[k]).abs()).fold(0.0, f32::max);
            assert!(apart < 1e-6, "{error}");
        }
        let [small, large] = [0.2, 0.6].map(|error| over(0.3, error));
        assert!(small[0] < large[0] && small[2] > large[2], "redder: {small:?} {large:?}");
    }
}
