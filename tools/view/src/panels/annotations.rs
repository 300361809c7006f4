//! Paints annotations over the picture: the patient's sides, the scale, distances, handles and the line of
//! the split.

use std::path::Path;

use egui::{Align2, Color32, FontId, Painter, Pos2, Rect, Shape, Stroke, pos2, vec2};
use engine::fidelity::diverging;
use engine::image::{self, annotate::scale_bar, orientation_labels};
use engine::transfer::TransferFunction;
use glam::{DVec2, DVec3, Vec3};

use crate::model::cube;
use crate::model::orbit::Orbit;
use crate::model::state::{Clip, Distance, Files, Object, Subject, ViewState};
use crate::panels::error::number;
use crate::panels::handles::{Handle, Placed, edges, handles, outline};
use crate::panels::status::Reading;
use crate::panels::theme::{ACCENT, SIGNAL, screen};

/// Distance to the border of the picture, points of the screen.
const MARGIN: f32 = 10.0;

/// Length of an edge of the cube, points of the screen.
const CUBE: f32 = 40.0;
/// Width and greatest height of the colour bar, points of the screen.
const BAR: [f32; 2] = [12.0, 150.0];
/// Space below the colour bar, where the scale bar is, points of the screen.
const BELOW_BAR: f32 = 64.0;
/// Number of steps in which the colour bar is painted.
const STEPS: usize = 64;

/// Returns the place of the orientation cube in the lower right corner of a picture, points of the screen.
pub fn cube_place(picture: Rect) -> Rect {
    let reach = cube::REACH as f32 * CUBE;
    Rect::from_min_size(picture.right_bottom() - vec2(reach, reach), vec2(reach, reach))
        .translate(vec2(-MARGIN, -MARGIN))
}

/// Converts a place of the screen to one of the cube.
pub fn in_cube(picture: Rect, at: Pos2) -> DVec2 {
    let from = (at - cube_place(picture).center()) / (0.5 * CUBE);
    DVec2::new(f64::from(from.x), f64::from(from.y))
}

/// Colours of what is written over a picture.
#[derive(Clone, Copy, Debug)]
pub struct Ink {
    /// Colour of letters and lines.
    pub letters: Color32,
    /// Colour of the line around them.
    pub outline: Color32,
}

impl Ink {
    /// Returns the ink for a background; `None` is transparent.
    pub fn on(background: Option<DVec3>) -> Self {
        let ink = image::Ink::on(background.map(|colour| colour.as_vec3().into()));
        let [letters, outline] =
            [ink.letters, ink.outline].map(|colour| screen(Vec3::from(colour).as_dvec3()));
        Ink { letters, outline }
    }
}

/// What is told over a picture beside what the state says.
#[derive(Clone, Copy, Debug)]
pub struct Told<'a> {
    /// True if it is known how the patient lies.
    pub oriented: bool,
    /// Least and greatest intensity of the data.
    pub range: [f64; 2],
    /// Unit of intensities, with a space before it.
    pub unit: &'a str,
    /// Subjects that the picture shows.
    pub subjects: &'a [Subject],
    /// True if the splats are those of a fit that no file has.
    pub fitted: bool,
    /// Error at which its colours end, if surfaces have them.
    pub error: Option<f64>,
}

/// Picture that is painted over.
pub struct PictureOverlay<'a> {
    /// Painter of the annotations.
    pub painter: &'a Painter,
    /// Place of the picture, points of the screen.
    pub rect: Rect,
    /// Camera of the picture.
    pub orbit: &'a Orbit,
    /// Width over height of the picture.
    pub aspect: f64,
    /// Colours of letters and lines.
    pub ink: Ink,
}

impl PictureOverlay<'_> {
    /// Paints what a picture tells, as far as the state shows it: names and the line between both halves, letters,
    /// cube, scale and colours, and the distances that were measured.
    pub fn tell(&self, state: &ViewState, told: &Told<'_>) {
        if let (Some(split), [left, right]) = (state.split, told.subjects) {
            let [left, right] = names(&state.files, [*left, *right], told.fitted);
            self.split(split, [&left, &right]);
        }
        if state.show.orientation && told.oriented {
            self.letters();
        }
        if state.show.cube && told.oriented {
            self.cube();
        }
        if state.show.scale_bar {
            self.scale();
        }
        let own_colours = |object: &Object| object.tint.is_some() || !object.visible;
        let all_own = told.subjects == [Subject::Splats]
            && !told.fitted
            && !state.objects.is_empty()
            && state.objects.iter().all(own_colours);
        if let (true, Some(range)) = (state.show.colour_bar, told.error) {
            self.error_bar(range, told.unit);
        } else if state.show.colour_bar
            && !all_own
            && let Ok(function) = state.transfer.function()
        {
            self.colour_bar(&function, told.range, told.unit);
        }
        state.distances.iter().for_each(|distance| self.distance(distance, self.ink.letters));
    }

    /// Paints the letters of the patient's sides at the four borders.
    fn letters(&self) {
        let [right, up, _] = self.orbit.axes();
        let r = self.rect.shrink(MARGIN);
        let places = [
            (r.left_center(), Align2::LEFT_CENTER),
            (r.right_center(), Align2::RIGHT_CENTER),
            (r.center_top(), Align2::CENTER_TOP),
            (r.center_bottom(), Align2::CENTER_BOTTOM),
        ];
        for (text, (at, align)) in orientation_labels(right, up).into_iter().zip(places) {
            self.text(at, align, &text, 18.0, self.ink.letters);
        }
    }

    /// Paints a bar of a round length, true at the depth of the pivot.
    fn scale(&self) {
        let mm_per_point = self.orbit.height_mm() / f64::from(self.rect.height());
        let Some((length, text)) = scale_bar(mm_per_point, self.rect.width() as usize) else { return };
        let from = self.rect.left_bottom() + vec2(MARGIN, -MARGIN);
        let to = from + vec2(length as f32, 0.0);
        for (stroke, ends) in
            [(Stroke::new(4.0, self.ink.outline), 1.0), (Stroke::new(2.0, self.ink.letters), 0.0)]
        {
            let out = vec2(ends, 0.0);
            self.painter.line_segment([from - out, to + out], stroke);
            for end in [from, to] {
                self.painter.line_segment([end, end - vec2(0.0, 6.0)], stroke);
            }
        }
        self.text(from - vec2(0.0, 9.0), Align2::LEFT_BOTTOM, &text, 13.0, self.ink.letters);
    }

    /// Paints the cube whose faces are the patient's sides.
    fn cube(&self) {
        let middle = cube_place(self.rect).center();
        let at = |p: DVec2| middle + vec2(p.x as f32, p.y as f32) * (0.5 * CUBE);
        for face in cube::faces(self.orbit) {
            let grey = (90.0 + 90.0 * face.towards) as u8;
            let corners = face.corners.map(at).to_vec();
            let edge = Stroke::new(1.0, Color32::BLACK);
            self.painter.add(Shape::convex_polygon(corners, Color32::from_gray(grey), edge));
            // A letter on a face that is seen from its edge would lie over its neighbours.
            if face.towards > 0.3 {
                let size = (9.0 + 6.0 * face.towards) as f32;
                self.text(
                    at(face.middle),
                    Align2::CENTER_CENTER,
                    &face.letter().to_string(),
                    size,
                    Color32::WHITE,
                );
            }
        }
    }

    /// Paints the colours of the intensities that a transfer function shows, as far as there are any in
    /// `range`, with the least, the middle and the greatest of them in `unit`.
    fn colour_bar(&self, function: &TransferFunction, range: [f64; 2], unit: &str) {
        let Some([low, high]) = function.shown_in(range) else { return };
        let height = BAR[1].min(0.25 * self.rect.height());
        if height < 40.0 {
            return;
        }
        let value = |share: f64| low + share * (high - low);
        let texts =
            [(0.0, ""), (0.5, ""), (1.0, unit)].map(|(share, unit)| format!("{:.0}{unit}", value(share)));
        self.bar(height, |share| function.at(value(share)).0, texts);
    }

    /// Paints the colours of errors from -`range` to `range`, in `unit`.
    fn error_bar(&self, range: f64, unit: &str) {
        let height = BAR[1].min(0.25 * self.rect.height());
        if height < 40.0 {
            return;
        }
        let colour = |share: f64| DVec3::from_array(diverging(2.0 * share - 1.0).map(f64::from));
        let range = number(range);
        let texts = [format!("-{range}{unit} too low"), "0".to_owned(), format!("+{range}{unit} too high")];
        self.bar(height, colour, texts);
    }

    /// Paints a bar of colours, from its foot up, with texts at its foot, middle and top.
    fn bar(&self, height: f32, colour: impl Fn(f64) -> DVec3, texts: [String; 3]) {
        let foot = self.rect.left_bottom() + vec2(MARGIN, -BELOW_BAR);
        let bar = Rect::from_min_max(foot - vec2(0.0, height), foot + vec2(BAR[0], 0.0));
        let step = height / STEPS as f32;
        for i in 0..STEPS {
            let top = bar.bottom() - (i + 1) as f32 * step;
            let row = Rect::from_min_size(pos2(bar.left(), top), vec2(bar.width(), step + 0.5));
            self.painter.rect_filled(row, 0.0, screen(colour((i as f64 + 0.5) / STEPS as f64)));
        }
        let edge = Stroke::new(1.0, self.ink.letters);
        self.painter.rect_stroke(bar, 0.0, edge, egui::StrokeKind::Outside);
        for (share, text) in [0.0, 0.5, 1.0].into_iter().zip(texts) {
            let at = pos2(bar.right() + 5.0, bar.bottom() - share * height);
            self.text(at, Align2::LEFT_CENTER, &text, 12.0, self.ink.letters);
        }
    }

    /// Paints the line between both halves at `share` of the width, with their names.
    fn split(&self, share: f64, [left, right]: [&str; 2]) {
        let x = self.rect.left() + share as f32 * self.rect.width();
        self.painter.vline(x, self.rect.y_range(), Stroke::new(3.0, self.ink.outline.gamma_multiply(0.6)));
        self.painter.vline(x, self.rect.y_range(), Stroke::new(1.0, self.ink.letters));
        let y = self.rect.top() + MARGIN + 22.0;
        self.text(pos2(x - MARGIN, y), Align2::RIGHT_TOP, left, 13.0, self.ink.letters);
        self.text(pos2(x + MARGIN, y), Align2::LEFT_TOP, right, 13.0, self.ink.letters);
    }

    /// Paints the grip of the line between both halves at `share` of the width.
    pub fn grip(&self, share: f64) {
        let x = self.rect.left() + share as f32 * self.rect.width();
        let edge = Stroke::new(1.5, Color32::BLACK);
        self.painter.circle(pos2(x, self.rect.center().y), 6.0, Color32::WHITE, edge);
    }

    /// Paints a distance that is being measured: from its first point to that under the cursor, if any (mm RAS).
    pub fn begun(&self, from_mm: DVec3, to_mm: Option<DVec3>) {
        match to_mm {
            Some(to_mm) => self.distance(&Distance { from_mm, to_mm }, SIGNAL),
            None => self.cross(from_mm, SIGNAL),
        }
    }

    fn distance(&self, distance: &Distance, colour: Color32) {
        let (Some(from), Some(to)) = (self.at(distance.from_mm), self.at(distance.to_mm)) else { return };
        let outline = outline_of(colour).gamma_multiply(0.7);
        self.painter.line_segment([from, to], Stroke::new(3.0, outline));
        self.painter.line_segment([from, to], Stroke::new(1.4, colour));
        self.cross(distance.from_mm, colour);
        self.cross(distance.to_mm, colour);
        let middle = from + (to - from) * 0.5;
        // The label stands on the side where the line does not run into it.
        let falls = (to.x - from.x) * (to.y - from.y) > 0.0;
        let (at, align) = match falls {
            true => (middle + vec2(6.0, -3.0), Align2::LEFT_BOTTOM),
            false => (middle + vec2(6.0, 3.0), Align2::LEFT_TOP),
        };
        self.text(at, align, &format!("{:.1} mm", distance.mm()), 13.0, colour);
    }

    /// Paints the point in which the slices meet (mm RAS).
    pub fn crosshair(&self, at_mm: DVec3) {
        self.cross(at_mm, ACCENT);
    }

    fn cross(&self, x: DVec3, colour: Color32) {
        let Some(at) = self.at(x) else { return };
        for (width, colour) in [(3.0, outline_of(colour)), (1.4, colour)] {
            for arm in [vec2(5.0, 0.0), vec2(0.0, 5.0)] {
                self.painter.line_segment([at - arm, at + arm], Stroke::new(width, colour));
            }
        }
    }

    /// Paints the outlines of planes and of the crop box, and their handles. `bright` is the handle under the
    /// cursor or being dragged.
    pub fn handles(&self, clip: &Clip, bounds: [DVec3; 2], bright: Option<Handle>) {
        let thin = Stroke::new(1.0, ACCENT.gamma_multiply(0.7));
        for plane in clip.planes.iter().filter(|plane| plane.on) {
            let corners = outline(plane.normal, plane.offset_mm, bounds);
            for (i, from) in corners.iter().enumerate() {
                self.line(*from, corners[(i + 1) % corners.len()], thin);
            }
        }
        for crop in clip.crop.iter().filter(|crop| crop.on) {
            for [from, to] in edges([crop.low_mm, crop.high_mm]) {
                self.line(from, to, thin);
            }
        }
        let placed = handles(clip, bounds);
        for pair in placed.windows(2) {
            if let [Placed { handle: Handle::Offset(_), at_mm: foot }, Placed { at_mm: tip, .. }] = pair {
                self.line(*foot, *tip, Stroke::new(2.0, ACCENT));
            }
        }
        for Placed { handle, at_mm } in placed {
            let Some(at) = self.at(at_mm) else { continue };
            let fill = if bright == Some(handle) { SIGNAL } else { ACCENT };
            let edge = Stroke::new(1.5, Color32::BLACK);
            match handle {
                Handle::Normal(_) => _ = self.painter.circle(at, 4.5, fill, edge),
                Handle::Offset(_) => _ = self.painter.circle(at, 6.0, fill, edge),
                Handle::Face { .. } => {
                    let square = Rect::from_center_size(at, vec2(10.0, 10.0));
                    self.painter.rect(square, 1.0, fill, edge, egui::StrokeKind::Outside);
                }
            }
        }
    }

    /// Paints intensity and place of what is under the cursor beside it.
    pub fn reading(&self, cursor: Pos2, reading: &Reading, unit: &str) {
        let place = format!("({:.1}, {:.1}, {:.1}) mm", reading.at_mm.x, reading.at_mm.y, reading.at_mm.z);
        let text = match reading.intensity {
            Some(v) => format!("{v:.0}{unit}\n{place}"),
            None => place,
        };
        self.text(cursor + vec2(14.0, 10.0), Align2::LEFT_TOP, &text, 12.0, SIGNAL);
    }

    /// Returns the place of a point (mm RAS) on the screen; `None` if it is behind the eye.
    fn at(&self, x: DVec3) -> Option<Pos2> {
        let (place, _) = self.orbit.seen(x, self.aspect)?;
        let size = self.rect.size();
        // Far outside of the screen the numbers would exceed the precision of f32.
        let DVec2 { x, y } = place.clamp(DVec2::splat(-1e3), DVec2::splat(1e3));
        Some(self.rect.min + vec2(x as f32 * size.x, y as f32 * size.y))
    }

    fn line(&self, from: DVec3, to: DVec3, stroke: Stroke) {
        if let (Some(from), Some(to)) = (self.at(from), self.at(to)) {
            self.painter.line_segment([from, to], stroke);
        }
    }

    /// Paints text with an outline, which is legible on any picture.
    fn text(&self, at: Pos2, align: Align2, text: &str, size: f32, colour: Color32) {
        let font = FontId::proportional(size);
        let galley = self.painter.layout_no_wrap(text.to_owned(), font, colour);
        let corner = align.anchor_size(at, galley.size()).min;
        let dark = outline_of(colour);
        for (dx, dy) in [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)] {
            let outline = egui::epaint::TextShape::new(corner + vec2(dx, dy), galley.clone(), dark);
            self.painter.add(Shape::Text(outline.with_override_text_color(dark)));
        }
        self.painter.galley(corner, galley, colour);
    }
}

/// Returns the colour of the line around what is painted in a colour.
fn outline_of(colour: Color32) -> Color32 {
    if colour.intensity() > 0.4 { Color32::BLACK } else { Color32::WHITE }
}

/// Returns the names of both sides of a split picture: those of the files, with their folders where they would
/// be the same.
fn names(files: &Files, sides: [Subject; 2], fitted: bool) -> [String; 2] {
    let name = |subject: Subject, with_folder: bool| {
        let (first, more) = match subject {
            Subject::Splats if fitted => return "the fit".to_owned(),
            Subject::Splats => (files.splats.first(), files.splats.len().saturating_sub(1)),
            Subject::Beside => (files.beside.as_ref(), 0),
            Subject::Volume => (files.volume.as_ref(), 0),
        };
        let last = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let folder = first.and_then(|path| path.parent()).filter(|_| with_folder).map(last);
        let name = first.map(|path| last(path)).unwrap_or_default();
        let name = folder.map_or(name.clone(), |folder| format!("{folder}/{name}"));
        if more > 0 { format!("{name} and {more} more") } else { name }
    };
    let [left, right] = sides.map(|side| name(side, false));
    if left == right { sides.map(|side| name(side, true)) } else { [left, right] }
}
