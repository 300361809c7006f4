//! Canvas on which a picture is composed of colours with 8 bits per channel.

use std::io::Write;

use engine::image::{self, Align, Image};

/// Red, green, blue, 0 to 255.
pub type Colour = [u8; 3];

/// An opaque picture, rows from the top.
pub struct Canvas(Image);

impl Canvas {
    /// Creates a canvas of one colour.
    pub fn new(width: usize, height: usize, colour: Colour) -> Self {
        let [r, g, b] = shares(colour);
        Canvas(Image::new([width, height], [r, g, b, 1.0]))
    }

    /// Draws an image at `[x, y]` of `[width, height]` pixels; `at` returns the colour at a column and row.
    /// What lies outside the canvas is left out.
    pub fn image(
        &mut self,
        [x, y]: [usize; 2],
        [width, height]: [usize; 2],
        at: impl Fn(usize, usize) -> Colour,
    ) {
        for row in 0..height {
            for column in 0..width {
                self.0.put(x + column, y + row, shares(at(column, row)));
            }
        }
    }

    /// Draws text whose letters are `scale` times 5 by 7 pixels, with its top at `y`.
    pub fn text(&mut self, at: [usize; 2], scale: usize, align: Align, colour: Colour, text: &str) {
        self.0.text(at, scale, align, shares(colour), text);
    }

    /// Writes the picture as PNG.
    pub fn write_png(&self, out: &mut dyn Write) -> std::io::Result<()> {
        image::file::encode_png(&self.0, out)
    }
}

fn shares(colour: Colour) -> [f32; 3] {
    colour.map(|byte| f32::from(byte) / 255.0)
}
