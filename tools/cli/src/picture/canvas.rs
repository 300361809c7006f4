//! A picture being composed: pixels, rectangles, text, and the PNG file.

use std::io::Write;

use super::font;

/// Red, green, blue, 0 to 255.
pub type Colour = [u8; 3];

/// An RGB image, rows from the top.
pub struct Canvas {
    /// Width, pixels.
    pub width: usize,
    /// Height, pixels.
    pub height: usize,
    pixels: Vec<Colour>,
}

/// Where text stands relative to its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Align {
    Left,
    Middle,
}

impl Canvas {
    /// A canvas of one colour.
    pub fn new(width: usize, height: usize, colour: Colour) -> Self {
        Canvas { width, height, pixels: vec![colour; width * height] }
    }

    /// Sets a pixel; one outside is left out.
    pub fn put(&mut self, x: usize, y: usize, colour: Colour) {
        if x < self.width && y < self.height {
            self.pixels[y * self.width + x] = colour;
        }
    }

    /// Fills a rectangle.
    pub fn fill(&mut self, [x, y]: [usize; 2], [width, height]: [usize; 2], colour: Colour) {
        for row in y..y + height {
            for column in x..x + width {
                self.put(column, row, colour);
            }
        }
    }

    /// Draws an image, whose colours `at` gives by column and row.
    pub fn image(
        &mut self,
        [x, y]: [usize; 2],
        [width, height]: [usize; 2],
        at: impl Fn(usize, usize) -> Colour,
    ) {
        for row in 0..height {
            for column in 0..width {
                self.put(x + column, y + row, at(column, row));
            }
        }
    }

    /// Writes text whose letters are `scale` times 5 by 7 pixels, its top at `y`.
    pub fn text(&mut self, [x, y]: [usize; 2], scale: usize, align: Align, colour: Colour, text: &str) {
        let width = text_width(text, scale);
        let left = match align {
            Align::Left => x,
            Align::Middle => x.saturating_sub(width / 2),
        };
        for (i, letter) in text.chars().enumerate() {
            for (column, row) in font::pixels(letter) {
                let at = [left + (i * font::ADVANCE + column) * scale, y + row * scale];
                self.fill(at, [scale; 2], colour);
            }
        }
    }

    /// Encodes the picture.
    pub fn write_png(&self, out: &mut dyn Write) -> std::io::Result<()> {
        let mut encoder = png::Encoder::new(out, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(self.pixels.as_flattened())?;
        writer.finish()?;
        Ok(())
    }
}

/// Width of a text, pixels.
pub fn text_width(text: &str, scale: usize) -> usize {
    (text.chars().count() * font::ADVANCE * scale).saturating_sub(scale)
}
