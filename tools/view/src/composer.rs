//! Puts rendered pictures into a window: over its background, and two of them side by side where the picture
//! is split.

use engine::Result;
use engine::gpu::{Drawing, Format, Gpu, Image, Recorder};
use shaders_glsl as glsl;
use shaders_glsl::types::ShowParams;

/// What puts pictures into pictures of one format.
pub struct Composer(Drawing);

/// A rectangle of the window: left, top, right, bottom; pixels.
pub type Area = [f32; 4];

/// A layer of a picture of premultiplied display-referred colour.
#[derive(Clone, Copy)]
pub struct Layer<'a> {
    /// The picture.
    pub picture: &'a Image,
    /// Which of its layers.
    pub layer: u32,
    /// Edges of what is shown of it, from its upper left corner, as parts of its own.
    pub part: [f32; 2],
}

/// What is put where.
pub struct Composition<'a> {
    /// Left of the split, and where there is none.
    pub first: Layer<'a>,
    /// Right of the split.
    pub second: Option<Layer<'a>>,
    /// Where the picture is divided, pixels from the window's left edge.
    pub split: f32,
    /// What is covered.
    pub area: Area,
    /// Where the pictures lie; they are scaled to it.
    pub place: Area,
    /// Red, green, blue behind everything, display-referred.
    pub background: [f32; 3],
}

impl Composer {
    /// Puts pictures into those of this format.
    pub fn new(gpu: &Gpu, format: Format) -> Result<Self> {
        let linear = [u32::from(format.is_srgb())];
        Drawing::new(gpu, &glsl::SHOW_VERT, &glsl::SHOW_FRAG, &linear, &[format], 1).map(Composer)
    }

    /// Records it into a window's picture.
    pub fn compose(&self, recorder: &mut Recorder, what: &Composition<'_>, window: &mut Image) {
        let [width, height, _] = window.size();
        let [r, g, b] = what.background;
        let second = what.second.unwrap_or(what.first);
        recorder
            .draw(&self.0)
            .sample("first_picture", what.first.picture)
            .sample("second_picture", second.picture)
            .push(&ShowParams {
                window: [width as f32, height as f32],
                area: what.area,
                picture: what.place,
                background: [r, g, b, 1.0],
                split: if what.second.is_some() { what.split } else { f32::MAX },
                first: what.first.layer,
                second: second.layer,
                first_part: what.first.part,
                second_part: second.part,
            })
            .vertices_over(&mut [window], 0..6);
    }
}
