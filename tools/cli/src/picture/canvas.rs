//! A picture being composed of colours of 8 bits: an [`Image`] with what this program draws on it.

use std::io::Write;

use engine::image::{self, Align, Image};

/// Red, green, blue, 0 to 255.
pub type Colour = [u8; 3];

/// An opaque picture, rows from the top.
pub struct Canvas(Image);

impl Canvas {
    /// Makes a canvas of one colour.
    pub fn new(width: usize, height: usize, colour: Colour) -> Self {
        let [r, g, b] = shares(colour);
        Canvas(Image::new([width, height], [r, g, b, 1.0]))
    }

    /// Draws an image, whose colours `at` gives by column and row; what lies outside is left out.
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

    /// Writes text whose letters are `scale` times 5 by 7 pixels, its top at `y`.
    pub fn text(&mut self, at: [usize; 2], scale: usize, align: Align, colour: Colour, text: &str) {
        self.0.text(at, scale, align, shares(colour), text);
    }

    /// Encodes the picture.
    pub fn write_png(&self, out: &mut dyn Write) -> std::io::Result<()> {
        image::file::encode_png(&self.0, out)
    }
}

fn shares(colour: Colour) -> [f32; 3] {
    colour.map(|byte| f32::from(byte) / 255.0)
}
