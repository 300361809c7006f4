//! Draws the three orthogonal slices through the centre of the region: CT, splats, and their difference.

use engine::image::Align;
use glam::DVec3;

use super::canvas::{Canvas, Colour, WORDS};
use super::subject::{Subject, diverging, grey};

/// Width of a slice's panel, pixels.
pub const PANEL: usize = 440;

/// Orientation of a slice as radiologists look at it; the letters are directions of the patient.
struct View {
    name: &'static str,
    right: char,
    up: char,
}

const VIEWS: [View; 3] = [
    View { name: "axial", right: 'L', up: 'A' },
    View { name: "coronal", right: 'L', up: 'S' },
    View { name: "sagittal", right: 'P', up: 'S' },
];

/// Colour of text over images.
const LETTERS: Colour = [255, 205, 92];

/// Returns the titles of the three columns; `volume` is the name of the volume.
pub fn columns(volume: &str) -> [String; 3] {
    [volume.to_owned(), "splats".to_owned(), format!("difference (splats - {volume})")]
}

/// View on a grid: the voxel axis along each direction of the picture, true if its index grows that way, and
/// the size in pixels.
struct Plane {
    across: (usize, bool),
    down: (usize, bool),
    pixels: [usize; 2],
}

impl Plane {
    /// Returns the plane of a view. `pixels_per_mm` is the same for all views, so that lengths can be
    /// compared.
    fn of(view: &View, subject: &Subject, pixels_per_mm: f64) -> Plane {
        let across = axis_towards(subject, view.right);
        let (axis, upwards) = axis_towards(subject, view.up);
        let down = (axis, !upwards);
        let pixels = [across.0, down.0]
            .map(|axis| ((extent_mm(subject, axis) * pixels_per_mm).round() as usize).max(1));
        Plane { across, down, pixels }
    }

    /// Returns the pixel where the slices meet.
    fn pixel(&self, subject: &Subject) -> [usize; 2] {
        [(self.across, self.pixels[0]), (self.down, self.pixels[1])].map(|((axis, forward), count)| {
            let share = (subject.centre[axis] + 0.5) / subject.ct.size[axis] as f64;
            let share = if forward { share } else { 1.0 - share };
            (share * count as f64) as usize
        })
    }

    /// Returns the voxel coordinates of a pixel in the slice through the centre.
    fn voxel(&self, subject: &Subject, column: usize, row: usize) -> DVec3 {
        let mut voxel = subject.centre;
        for ((axis, forward), place, count) in
            [(self.across, column, self.pixels[0]), (self.down, row, self.pixels[1])]
        {
            let share = (place as f64 + 0.5) / count as f64;
            let share = if forward { share } else { 1.0 - share };
            voxel[axis] = share * subject.ct.size[axis] as f64 - 0.5;
        }
        voxel
    }
}

/// Draws four strokes around a pixel of a slice; they end at its edges.
fn mark(canvas: &mut Canvas, [x, y]: [usize; 2], [width, height]: [usize; 2], at: [usize; 2]) {
    for away in 7..14i64 {
        for [dx, dy] in [[away, 0], [-away, 0], [0, away], [0, -away]] {
            let place = [at[0] as i64 + dx, at[1] as i64 + dy];
            if (0..width as i64).contains(&place[0]) && (0..height as i64).contains(&place[1]) {
                canvas.image([x + place[0] as usize, y + place[1] as usize], [1, 1], |_, _| LETTERS);
            }
        }
    }
}

/// Returns the voxel axis along a direction of the patient, and true if its index grows that way.
fn axis_towards(subject: &Subject, letter: char) -> (usize, bool) {
    let codes = subject.ct.axis_codes();
    let codes = if subject.ct.oriented { codes.as_str() } else { "RAS" };
    let opposite = opposite(letter);
    codes
        .chars()
        .position(|c| c == letter || c == opposite)
        .map_or((0, true), |axis| (axis, codes.chars().nth(axis) == Some(letter)))
}

fn opposite(letter: char) -> char {
    let pairs = [('R', 'L'), ('A', 'P'), ('S', 'I')];
    pairs
        .iter()
        .find_map(|&(a, b)| (letter == a).then_some(b).or((letter == b).then_some(a)))
        .unwrap_or(letter)
}

fn extent_mm(subject: &Subject, axis: usize) -> f64 {
    subject.ct.size[axis] as f64 * subject.ct.spacing_mm()[axis]
}

/// Returns the heights of the three rows in pixels, and the scale in pixels per mm.
pub fn layout(subject: &Subject) -> ([usize; 3], f64) {
    let longest = (0..3).map(|axis| extent_mm(subject, axis)).fold(f64::MIN_POSITIVE, f64::max);
    let pixels_per_mm = PANEL as f64 / longest;
    (std::array::from_fn(|i| Plane::of(&VIEWS[i], subject, pixels_per_mm).pixels[1]), pixels_per_mm)
}

/// Draws a row of three slices; `left` are the columns' left edges.
pub fn draw_row(
    canvas: &mut Canvas,
    subject: &Subject,
    row: usize,
    left: [usize; 3],
    top: usize,
    scale: f64,
) {
    let view = &VIEWS[row];
    let plane = Plane::of(view, subject, scale);
    let [width, height] = plane.pixels;
    for (column, &x) in left.iter().enumerate() {
        let x = x + (PANEL - width) / 2;
        canvas.image([x, top], plane.pixels, |px, py| colour(subject, column, plane.voxel(subject, px, py)));
        if subject.marked {
            mark(canvas, [x, top], plane.pixels, plane.pixel(subject));
        }
        if column == 0 {
            over(canvas, [x + 6, top + 6], view.name);
        }
        if subject.ct.oriented && column == 0 && height > 60 {
            let middle = top + height / 2 - 7;
            let letters = [
                ([x + 6, middle], opposite(view.right)),
                ([x + width - 16, middle], view.right),
                ([x + width / 2 - 5, top + 6], view.up),
                ([x + width / 2 - 5, top + height - 20], opposite(view.up)),
            ];
            for (at, letter) in letters {
                over(canvas, at, &letter.to_string());
            }
        }
    }
}

/// Draws text over an image, with a shadow that keeps it legible on any grey.
fn over(canvas: &mut Canvas, at: [usize; 2], text: &str) {
    canvas.outlined_text(at, WORDS, Align::Left, LETTERS, text);
}

/// Returns the colour of a voxel in one of the columns.
fn colour(subject: &Subject, column: usize, voxel: DVec3) -> Colour {
    let ct = subject.sample(&subject.ct.samples, voxel);
    let shade = subject.grey(ct);
    let hu = || subject.sample(&subject.hu, voxel);
    match column {
        0 => grey(shade),
        1 if subject.sample(&subject.occupancy, voxel) >= 0.5 => grey(subject.grey(hu())),
        1 => [0.16, 0.19, 0.26].map(|share| (share * 255.0 * shade) as u8),
        _ if subject.sample(&subject.roi.weight, voxel) >= 0.5 => diverging((hu() - ct) / subject.difference),
        _ => grey(0.10 + 0.16 * shade),
    }
}
