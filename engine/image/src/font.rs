//! The letters: outlines of Ubuntu Light, and of Hack for what it lacks, filled at any size with smooth edges. They
//! are the fonts that egui brings along, so pictures have the letters of the window; their licences are with them in
//! the crate `epaint_default_fonts`.

use std::sync::LazyLock;

use skrifa::instance::{LocationRef, Size};
use skrifa::outline::{DrawSettings, OutlinePen};
use skrifa::{FontRef, GlyphId, MetadataProvider};

/// Height of a capital, as a share of the size of the letters.
pub const CAPITAL: f32 = 0.693;
/// Depth of a tail below the line, as a share of the size of the letters.
pub const TAIL: f32 = 0.2;
/// Greatest distance between a curve and the lines that stand for it, pixels.
const SMOOTH: f32 = 0.05;

/// The fonts, the first one that has a letter gives it.
static FONTS: LazyLock<Vec<FontRef<'static>>> = LazyLock::new(|| {
    let files = [epaint_default_fonts::UBUNTU_LIGHT, epaint_default_fonts::HACK_REGULAR];
    files.into_iter().map(|file| FontRef::new(file).expect("a font of the crate")).collect()
});

/// Returns the font of a letter and its glyph in it; that of the empty frame for a letter that none has.
fn glyph_of(letter: char) -> (&'static FontRef<'static>, GlyphId) {
    let found = FONTS.iter().find_map(|font| Some((font, font.charmap().map(letter)?)));
    found.unwrap_or((&FONTS[0], GlyphId::NOTDEF))
}

/// Returns the width of a text in letters of `size` pixels, pixels.
pub fn width(text: &str, size: f32) -> f32 {
    text.chars().map(|letter| advance(glyph_of(letter), size)).sum()
}

fn advance((font, glyph): (&FontRef<'_>, GlyphId), size: f32) -> f32 {
    let metrics = font.glyph_metrics(Size::new(size), LocationRef::default());
    metrics.advance_width(glyph).unwrap_or(0.5 * size)
}

/// Share of each pixel of a rectangle that something covers, 0 to 1, rows from the top.
pub struct Coverage {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Signed area that the edges seen so far take from each pixel and all pixels to its right, less that which they
    /// take from its left neighbour.
    changes: Vec<f32>,
}

impl Coverage {
    /// Creates an empty rectangle.
    pub fn new(size: [usize; 2]) -> Self {
        Coverage { size, changes: vec![0.0; size[0] * size[1]] }
    }

    /// Adds a text in letters of `size` pixels; `x` is its left end and `y` the line that it stands on.
    pub fn add(&mut self, [x, y]: [f32; 2], size: f32, text: &str) {
        let mut at = x;
        for letter in text.chars() {
            let (font, glyph) = glyph_of(letter);
            let settings = DrawSettings::unhinted(Size::new(size), LocationRef::default());
            let mut pen = Pen { coverage: self, corner: [at, y], start: [0.0; 2], last: [0.0; 2] };
            if let Some(outline) = font.outline_glyphs().get(glyph) {
                // A glyph of these fonts can be drawn; one that cannot has no outline.
                let _ = outline.draw(settings, &mut pen);
            }
            at += advance((font, glyph), size);
        }
    }

    /// Returns the covered share of each pixel.
    pub fn shares(&self) -> Vec<f32> {
        let rows = self.changes.chunks(self.size[0].max(1));
        let sums = rows.flat_map(|row| {
            row.iter().scan(0.0_f32, |sum, change| {
                *sum += change;
                // Letters whose parts overlap cover no pixel twice.
                Some(sum.abs().min(1.0))
            })
        });
        sums.collect()
    }

    /// Adds an edge. To the right of an edge that goes down everything is covered.
    fn edge(&mut self, from: [f32; 2], to: [f32; 2]) {
        let (sign, [x0, y0], [x1, y1]) = if from[1] <= to[1] { (1.0, from, to) } else { (-1.0, to, from) };
        let [width, height] = self.size;
        let slope = (x1 - x0) / (y1 - y0);
        if !slope.is_finite() {
            return;
        }
        let first = y0.max(0.0).floor() as usize;
        for row in first..(y1.max(0.0).ceil() as usize).min(height) {
            let (top, bottom) = (y0.max(row as f32), y1.min(row as f32 + 1.0));
            if bottom <= top {
                continue;
            }
            let ends = [top, bottom].map(|y| (x0 + (y - y0) * slope).clamp(0.0, width as f32));
            self.part(row, ends, sign * (bottom - top));
        }
    }

    /// Adds the part of an edge within one row, which covers `height` of it, with its ends along the row.
    fn part(&mut self, row: usize, [a, b]: [f32; 2], height: f32) {
        let width = self.size[0];
        let (left, right) = (a.min(b), a.max(b));
        // Share of the part that lies to the left of x, integrated over the pixel: what the pixel gets.
        let covered = |pixel: usize| {
            let (low, high) = (pixel as f32, pixel as f32 + 1.0);
            if right - left < 1e-6 {
                return high - left.clamp(low, high);
            }
            let within = |x: f32| ((x - left) / (right - left)).clamp(0.0, 1.0);
            let (from, to) = (left.clamp(low, high), right.clamp(low, high));
            let before = within(from);
            let sloped = within(to) - before;
            // To the left of `from` nothing more than `before`; to the right of `to` all up to there.
            let behind = within(to) * (high - to);
            before * (to - from) + sloped * (to - from) * 0.5 + behind
        };
        let mut last = 0.0;
        for pixel in left as usize..width {
            let share = covered(pixel);
            self.changes[row * width + pixel] += height * (share - last);
            last = share;
            if share >= 1.0 - 1e-6 {
                break;
            }
        }
    }
}

/// Takes the outline of a glyph, y upwards, as edges.
struct Pen<'a> {
    coverage: &'a mut Coverage,
    corner: [f32; 2],
    start: [f32; 2],
    last: [f32; 2],
}

impl Pen<'_> {
    fn place(&self, x: f32, y: f32) -> [f32; 2] {
        [self.corner[0] + x, self.corner[1] - y]
    }

    fn line(&mut self, to: [f32; 2]) {
        self.coverage.edge(self.last, to);
        self.last = to;
    }

    /// Draws a curve, at shares 0 to 1 of its length, as so many lines as its `bend` needs, pixels.
    fn curve(&mut self, bend: f32, at: impl Fn(f32) -> [f32; 2]) {
        let count = (bend / (8.0 * SMOOTH)).sqrt().ceil().clamp(1.0, 64.0) as usize;
        (1..=count).for_each(|i| self.line(at(i as f32 / count as f32)));
    }
}

fn mix(a: [f32; 2], b: [f32; 2], share: f32) -> [f32; 2] {
    [0, 1].map(|i| a[i] + share * (b[i] - a[i]))
}

/// Returns how far three points are from a straight line with equal steps.
fn bend(a: [f32; 2], b: [f32; 2], c: [f32; 2]) -> f32 {
    2.0 * [0, 1].map(|i| a[i] - 2.0 * b[i] + c[i]).into_iter().fold(0.0, |sum: f32, d| sum.hypot(d))
}

impl OutlinePen for Pen<'_> {
    fn move_to(&mut self, x: f32, y: f32) {
        self.start = self.place(x, y);
        self.last = self.start;
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.line(self.place(x, y));
    }

    fn quad_to(&mut self, cx: f32, cy: f32, x: f32, y: f32) {
        let (a, b, c) = (self.last, self.place(cx, cy), self.place(x, y));
        self.curve(bend(a, b, c), |t| mix(mix(a, b, t), mix(b, c, t), t));
    }

    fn curve_to(&mut self, ax: f32, ay: f32, bx: f32, by: f32, x: f32, y: f32) {
        let (a, b, c, d) = (self.last, self.place(ax, ay), self.place(bx, by), self.place(x, y));
        self.curve(3.0 * bend(a, b, c).max(bend(b, c, d)), |t| {
            let (ab, bc, cd) = (mix(a, b, t), mix(b, c, t), mix(c, d, t));
            mix(mix(ab, bc, t), mix(bc, cd, t), t)
        });
    }

    fn close(&mut self) {
        self.line(self.start);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(text: &str, size: f32, at: [f32; 2]) -> f32 {
        let mut coverage = Coverage::new([400, 200]);
        coverage.add(at, size, text);
        coverage.shares().iter().sum()
    }

    #[test]
    fn edges_cover_what_lies_between_them() {
        let mut coverage = Coverage::new([6, 4]);
        // A slanted box of 2 by 3 pixels, from (1.25, 0.5), leaning to the right by one pixel.
        let corners = [[1.25, 0.5], [3.25, 0.5], [4.25, 3.5], [2.25, 3.5]];
        for (from, to) in corners.into_iter().zip(corners.into_iter().cycle().skip(1)) {
            coverage.edge(from, to);
        }
        let shares = coverage.shares();
        assert!((shares.iter().sum::<f32>() - 6.0).abs() < 1e-4, "{shares:?}");
        let row = |y: usize| shares[6 * y..6 * (y + 1)].iter().sum::<f32>();
        for (y, covered) in [(0, 1.0), (1, 2.0), (2, 2.0), (3, 1.0)] {
            assert!((row(y) - covered).abs() < 1e-4, "row {y}: {shares:?}");
        }
        assert!(shares[6] < 1e-6 && (shares[6 + 2] - 1.0).abs() < 1e-4 && shares[6 + 5] < 1e-6, "{shares:?}");
    }

    #[test]
    fn letters_grow_with_their_size_and_stay_what_they_are() {
        for text in ["L", "g", "50 mm", "R 0"] {
            let [small, large] = [10.0, 60.0].map(|size| area(text, size, [20.0, 120.0]) / (size * size));
            assert!((small / large - 1.0).abs() < 0.02, "{text}: {small} and {large} of a square");
            // Between two pixels they have the same weight as on one.
            let moved = area(text, 10.0, [20.37, 120.61]) / 100.0;
            assert!((moved / small - 1.0).abs() < 0.01, "{text}: {moved} and {small}");
            let [w, v] = [10.0, 60.0].map(|size| width(text, size) / size);
            assert!((w / v - 1.0).abs() < 1e-3, "{text}");
        }
        assert!(width("mm", 20.0) > 1.5 * width("ii", 20.0), "each letter has its own width");
        assert_eq!(area(" ", 30.0, [20.0, 120.0]), 0.0);
    }

    #[test]
    fn capitals_and_tails_are_as_high_as_they_say() {
        let rows = |text: &str| {
            let mut coverage = Coverage::new([200, 200]);
            coverage.add([10.0, 120.0], 100.0, text);
            let shares = coverage.shares();
            let filled = |y: &usize| shares[200 * y..200 * (y + 1)].iter().any(|share| *share > 0.5);
            let filled: Vec<usize> = (0..200).filter(filled).collect();
            [filled[0] as f32, filled[filled.len() - 1] as f32 + 1.0]
        };
        let [top, foot] = rows("H");
        assert!((120.0 - top - 100.0 * CAPITAL).abs() <= 1.5 && (foot - 120.0).abs() <= 1.0, "{top} {foot}");
        let [_, tail] = rows("g");
        assert!((tail - 120.0 - 100.0 * TAIL).abs() <= 3.0, "{tail}");
    }

    #[test]
    fn letters_that_are_needed_are_there() {
        let letters = ('a'..='z').chain('A'..='Z').chain('0'..='9').chain("+-.,:()/%|−±×∞µ°äöüéñ".chars());
        for letter in letters {
            assert_ne!(glyph_of(letter).1, GlyphId::NOTDEF, "{letter}");
        }
        assert_eq!(glyph_of('漢').1, GlyphId::NOTDEF);
        assert!(area("漢", 40.0, [20.0, 120.0]) > 10.0, "an unknown letter is a frame");
    }
}
