//! Rectangles and text on an [`Image`]. Parts outside of the picture are left out.

use super::Image;
use super::font::{self, Coverage};

/// Where text stands relative to its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    /// The point is the left end of the text.
    Left,
    /// The point is the middle of the text.
    Middle,
    /// The point is the right end of the text.
    Right,
}

/// Colours of what is written over a picture: legible on any.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ink {
    /// Colour of letters and bars.
    pub letters: [f32; 3],
    /// Colour of the line around them.
    pub outline: [f32; 3],
}

impl Ink {
    /// White with a black outline, for dark pictures.
    pub const LIGHT: Ink = Ink { letters: [1.0; 3], outline: [0.0; 3] };
    /// Black with a white outline, for bright pictures and for paper.
    pub const DARK: Ink = Ink { letters: [0.0; 3], outline: [1.0; 3] };

    /// Returns the ink for a background. What is transparent mostly ends on paper.
    pub fn on(background: Option<[f32; 3]>) -> Ink {
        let brightness = background.map_or(1.0, |[r, g, b]| 0.3 * r + 0.59 * g + 0.11 * b);
        if brightness > 0.5 { Ink::DARK } else { Ink::LIGHT }
    }
}

/// Returns the width of a text in letters of `size` pixels, pixels.
pub fn text_width(text: &str, size: f32) -> usize {
    font::width(text, size).ceil() as usize
}

/// Returns the height of capitals in letters of `size` pixels, pixels.
pub fn capital_height(size: f32) -> usize {
    (font::CAPITAL * size).ceil() as usize
}

/// Returns the height of a line with tails in letters of `size` pixels, pixels.
pub fn line_height(size: f32) -> usize {
    ((font::CAPITAL + font::TAIL) * size).ceil() as usize
}

/// Returns the text if it fits into `room` pixels, otherwise its beginning and three dots.
pub fn shortened(text: &str, size: f32, room: usize) -> String {
    if text_width(text, size) <= room {
        return text.to_owned();
    }
    let mut kept: Vec<char> = text.chars().collect();
    while kept.pop().is_some() {
        let short: String = kept.iter().chain("...".chars().collect::<Vec<_>>().iter()).collect();
        if text_width(&short, size) <= room {
            return short;
        }
    }
    "...".to_owned()
}

impl Image {
    /// Sets a pixel to an opaque colour.
    pub fn put(&mut self, x: usize, y: usize, [r, g, b]: [f32; 3]) {
        if x < self.size[0] && y < self.size[1] {
            self.pixels[y * self.size[0] + x] = [r, g, b, 1.0];
        }
    }

    /// Fills a rectangle with an opaque colour; `x`, `y` is its top left corner.
    pub fn fill(&mut self, [x, y]: [usize; 2], [width, height]: [usize; 2], colour: [f32; 3]) {
        for row in y..(y + height).min(self.size[1]) {
            for column in x..(x + width).min(self.size[0]) {
                self.put(column, row, colour);
            }
        }
    }

    /// Writes text in letters of `size` pixels; `y` is the top of its capitals, and `align` says where `x` is.
    pub fn text(&mut self, at: [usize; 2], size: f32, align: Align, colour: [f32; 3], text: &str) {
        self.outlined(at, size, align, text, &[(colour, 0.0)]);
    }

    /// Writes text with an outline, which is legible on any picture.
    pub fn outlined_text(&mut self, at: [usize; 2], size: f32, align: Align, ink: Ink, text: &str) {
        self.outlined(at, size, align, text, &[(ink.outline, outline_width(size)), (ink.letters, 0.0)]);
    }

    /// Writes text in several colours, one over the other, each wider than the letters by so many pixels.
    fn outlined(
        &mut self,
        [x, y]: [usize; 2],
        size: f32,
        align: Align,
        text: &str,
        layers: &[([f32; 3], f32)],
    ) {
        let width = text_width(text, size);
        let border = layers.iter().map(|(_, wider)| wider.ceil() as usize + 1).max().unwrap_or(1);
        let (left, foot) = (align.left(x, width), y as f32 + font::CAPITAL * size);
        // The rectangle of the text begins `border` pixels before it, which may be outside of the picture.
        let room = [width + 2 * border, line_height(size) + (0.4 * size).ceil() as usize + 2 * border];
        let above = border + (0.3 * size).ceil() as usize;
        let own = [border as f32, foot - y as f32 + above as f32];
        for &(colour, wider) in layers {
            for (i, share) in widened(room, own, size, text, wider).into_iter().enumerate() {
                let place = |at: usize, inner: usize, before: usize| (at + inner).checked_sub(before);
                let (Some(column), Some(row)) =
                    (place(left, i % room[0], border), place(y, i / room[0], above))
                else {
                    continue;
                };
                if share > 0.0 && column < self.size[0] && row < self.size[1] {
                    let pixel = &mut self.pixels[row * self.size[0] + column];
                    let [r, g, b] = colour;
                    for (own, new) in pixel.iter_mut().zip([r, g, b, 1.0]) {
                        *own += share * (new - *own);
                    }
                }
            }
        }
    }
}

/// Returns the width of the outline of letters, pixels.
pub fn outline_width(size: f32) -> f32 {
    (0.09 * size).max(1.0)
}

/// Returns the share of each pixel that letters cover which are wider by `wider` pixels on all sides.
fn widened(room: [usize; 2], [x, y]: [f32; 2], size: f32, text: &str, wider: f32) -> Vec<f32> {
    const DIRECTIONS: usize = 16;
    let at = |place: [f32; 2]| {
        let mut coverage = Coverage::new(room);
        coverage.add(place, size, text);
        coverage.shares()
    };
    let mut shares = at([x, y]);
    if wider > 0.0 {
        for i in 0..DIRECTIONS {
            let (sine, cosine) = (std::f32::consts::TAU * i as f32 / DIRECTIONS as f32).sin_cos();
            let moved = at([x + wider * cosine, y + wider * sine]);
            shares.iter_mut().zip(moved).for_each(|(share, moved)| *share = share.max(moved));
        }
    }
    shares
}

impl Align {
    /// Returns the column at which a text of `width` pixels begins, at least 0.
    fn left(self, x: usize, width: usize) -> usize {
        match self {
            Align::Left => x,
            Align::Middle => x.saturating_sub(width / 2),
            Align::Right => x.saturating_sub(width),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns left, top, right, bottom of the pixels that satisfy something.
    fn extent(image: &Image, is: impl Fn([f32; 4]) -> bool) -> [usize; 4] {
        let [width, _] = image.size;
        let places = (0..image.pixels.len()).filter(|&i| is(image.pixels[i])).map(|i| [i % width, i / width]);
        places.fold([usize::MAX, usize::MAX, 0, 0], |[l, t, r, b], [x, y]| {
            [l.min(x), t.min(y), r.max(x + 1), b.max(y + 1)]
        })
    }

    #[test]
    fn letters_stand_where_they_are_put() {
        let bright = |pixel: [f32; 4]| pixel[0] > 0.75;
        let draw = |x: usize, align: Align| {
            let mut image = Image::new([120, 60], [0.5, 0.5, 0.5, 1.0]);
            image.text([x, 10], 40.0, align, [1.0; 3], "LT");
            extent(&image, bright)
        };
        let width = text_width("LT", 40.0);
        let [left, top, right, bottom] = draw(20, Align::Left);
        assert!(left.abs_diff(20) <= 5 && right.abs_diff(20 + width) <= 3, "{left} to {right}");
        assert!(
            top.abs_diff(10) <= 1 && bottom.abs_diff(10 + capital_height(40.0)) <= 1,
            "{top} to {bottom}"
        );
        assert_eq!(draw(20 + width / 2, Align::Middle), draw(20, Align::Left));
        assert_eq!(draw(20 + width, Align::Right), draw(20, Align::Left));
        // What is outside is left out.
        let mut image = Image::new([20, 9], [0.0; 4]);
        image.outlined_text([15, 5], 40.0, Align::Left, Ink::LIGHT, "L");
        image.outlined_text([0, 0], 40.0, Align::Middle, Ink::LIGHT, "漢");
        assert_eq!(image.pixels.len(), 180);
    }

    #[test]
    fn edges_are_smooth_and_let_through_what_is_behind() {
        let mut image = Image::new([60, 40], [0.0; 4]);
        image.text([5, 5], 30.0, Align::Left, [1.0, 0.5, 0.0], "S");
        let edge: Vec<_> = image.pixels.iter().filter(|p| p[3] > 0.1 && p[3] < 0.9).collect();
        assert!(edge.len() > 20, "{} pixels of the edge", edge.len());
        // Premultiplied, as all pictures are.
        assert!(image.pixels.iter().all(|p| (p[0] - p[3]).abs() < 1e-6 && (p[1] - 0.5 * p[3]).abs() < 1e-6));
    }

    #[test]
    fn a_long_text_is_shortened() {
        let text = "ten of ten";
        assert_eq!(shortened(text, 20.0, text_width(text, 20.0)), text);
        let short = shortened(text, 20.0, text_width(text, 20.0) - 1);
        assert!(short.ends_with("...") && text.starts_with(short.trim_end_matches('.')), "{short}");
        assert!(text_width(&short, 20.0) < text_width(text, 20.0) && short.len() > 6, "{short}");
        assert_eq!(shortened(text, 10.0, 0), "...");
    }

    #[test]
    fn an_outline_goes_around_letters_on_any_background() {
        for (background, ink) in [([0.0, 0.0, 0.0, 1.0], Ink::LIGHT), ([1.0; 4], Ink::DARK)] {
            assert_eq!(Ink::on(Some([background[0]; 3])), ink);
            // On its contrary the outline is seen all around.
            let mut image = Image::new([90, 60], [0.5, 0.5, 0.5, 1.0]);
            image.outlined_text([30, 15], 40.0, Align::Left, ink, "H");
            let near = |colour: [f32; 3]| move |p: [f32; 4]| (p[0] - colour[0]).abs() < 0.2;
            let (inner, outer) = (extent(&image, near(ink.letters)), extent(&image, near(ink.outline)));
            let wider = outline_width(40.0).round() as usize;
            for side in 0..2 {
                let apart = [inner[side].abs_diff(outer[side]), inner[side + 2].abs_diff(outer[side + 2])];
                assert!(apart.iter().all(|n| n.abs_diff(wider) <= 1), "{inner:?} in {outer:?}");
            }
        }
        assert_eq!(Ink::on(None), Ink::DARK);
        assert_eq!(Ink::on(Some([0.2, 0.3, 0.9])), Ink::LIGHT);
    }

    #[test]
    fn rectangles_are_cut_at_the_border() {
        let mut image = Image::new([3, 3], [0.0; 4]);
        image.fill([2, 1], [9, 9], [1.0; 3]);
        image.put(7, 7, [1.0; 3]);
        let white: Vec<_> = (0..9).filter(|&i| image.pixels[i] == [1.0; 4]).collect();
        assert_eq!(white, [5, 8]);
    }
}
