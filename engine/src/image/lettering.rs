//! Rectangles and text on an [`Image`]. Parts outside of the picture are left out; all drawing is opaque.

use super::{Image, font};

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

/// Returns the width of a text in pixels, in letters of 5 by 7 pixels that are magnified `scale` times.
pub fn text_width(text: &str, scale: usize) -> usize {
    (text.chars().count() * font::ADVANCE * scale).saturating_sub(scale)
}

/// Returns the text if it fits into `room` pixels, otherwise its beginning and three dots.
pub fn shortened(text: &str, scale: usize, room: usize) -> String {
    if text_width(text, scale) <= room {
        return text.to_owned();
    }
    let keep = (room / (font::ADVANCE * scale)).saturating_sub(3);
    text.chars().take(keep).chain("...".chars()).collect()
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

    /// Writes text in letters of `scale` times 5 by 7 pixels; `y` is the top of the text, and `align` says
    /// where `x` is.
    pub fn text(&mut self, [x, y]: [usize; 2], scale: usize, align: Align, colour: [f32; 3], text: &str) {
        let left = align.left(x, text_width(text, scale));
        for (i, letter) in text.chars().enumerate() {
            for (column, row) in font::pixels(letter) {
                let at = [left + (i * font::ADVANCE + column) * scale, y + row * scale];
                self.fill(at, [scale; 2], colour);
            }
        }
    }

    /// Writes white text with a black outline, which is legible on any picture.
    pub fn outlined_text(&mut self, [x, y]: [usize; 2], scale: usize, align: Align, text: &str) {
        let (left, width) = (align.left(x, text_width(text, scale)), scale.div_ceil(2));
        for dy in 0..3 {
            for dx in 0..3 {
                let at = [(left + dx * width).saturating_sub(width), (y + dy * width).saturating_sub(width)];
                self.text(at, scale, Align::Left, [0.0; 3], text);
            }
        }
        self.text([left, y], scale, Align::Left, [1.0; 3], text);
    }
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

    /// Returns the picture as lines of `#` where it is white and `o` where it is black.
    fn lines(image: &Image) -> Vec<String> {
        let letter = |pixel: &[f32; 4]| match pixel {
            [1.0, 1.0, 1.0, 1.0] => '#',
            [0.0, 0.0, 0.0, 1.0] => 'o',
            _ => '.',
        };
        image.pixels.chunks(image.size[0]).map(|row| row.iter().map(letter).collect()).collect()
    }

    #[test]
    fn letters_stand_where_they_are_put() {
        let grey = [0.5, 0.5, 0.5, 1.0];
        let draw = |x: usize, align: Align| {
            let mut image = Image::new([13, 7], grey);
            image.text([x, 0], 1, align, [1.0; 3], "LT");
            lines(&image)
        };
        let expected = [
            ".#.....#####.",
            ".#.......#...",
            ".#.......#...",
            ".#.......#...",
            ".#.......#...",
            ".#.......#...",
            ".#####...#...",
        ];
        assert_eq!(text_width("LT", 1), 11);
        assert_eq!(draw(1, Align::Left), expected);
        assert_eq!(draw(6, Align::Middle), expected);
        assert_eq!(draw(12, Align::Right), expected);
        // Twice as large, and partly outside.
        let mut image = Image::new([6, 9], grey);
        image.text([3, 5], 2, Align::Left, [1.0; 3], "L");
        assert_eq!(lines(&image)[4..], ["......", "...##.", "...##.", "...##.", "...##."]);
    }

    #[test]
    fn a_long_text_is_shortened() {
        let text = "ten of ten";
        assert_eq!(shortened(text, 2, text_width(text, 2)), text);
        let short = shortened(text, 2, text_width(text, 2) - 1);
        assert_eq!(short, "ten of...");
        assert!(text_width(&short, 2) < text_width(text, 2));
        assert_eq!(shortened(text, 1, 0), "...");
    }

    #[test]
    fn an_outline_goes_around_each_stroke() {
        let mut image = Image::new([9, 9], [0.5; 4]);
        image.outlined_text([2, 1], 1, Align::Left, "L");
        let found = lines(&image);
        assert_eq!(found[0], ".ooo.....");
        assert_eq!(found[1], ".o#o.....");
        assert_eq!(found[6], ".o#ooooo.");
        assert_eq!(found[7], ".o#####o.");
        assert_eq!(found[8], ".ooooooo.");
    }

    #[test]
    fn rectangles_are_cut_at_the_border() {
        let mut image = Image::new([3, 3], [0.0; 4]);
        image.fill([2, 1], [9, 9], [1.0; 3]);
        assert_eq!(lines(&image), ["...", "..#", "..#"]);
        image.put(7, 7, [1.0; 3]);
        assert_eq!(lines(&image), ["...", "..#", "..#"]);
    }
}
