//! Canvas on which a picture is composed of colours with 8 bits per channel.

use std::io::Write;

use engine::image::{self, Align, Image, Ink};

/// Size of the letters of a title, pixels.
pub const TITLE: f32 = 28.0;
/// Size of all other letters, pixels.
pub const WORDS: f32 = 19.0;

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

    /// Draws text in letters of `size` pixels, with the top of its capitals at `y`.
    pub fn text(&mut self, at: [usize; 2], size: f32, align: Align, colour: Colour, text: &str) {
        self.0.text(at, size, align, shares(colour), text);
    }

    /// Draws text with a black outline, which is legible over images.
    pub fn outlined_text(&mut self, at: [usize; 2], size: f32, align: Align, colour: Colour, text: &str) {
        let ink = Ink { letters: shares(colour), outline: [0.0; 3] };
        self.0.outlined_text(at, size, align, ink, text);
    }

    /// Writes the picture as PNG.
    pub fn write_png(&self, out: &mut dyn Write) -> std::io::Result<()> {
        image::file::encode_png(&self.0, out)
    }
}

fn shares(colour: Colour) -> [f32; 3] {
    colour.map(|byte| f32::from(byte) / 255.0)
}
