//! Draws rendered pictures into a window, over its background, and side by side if the picture is split.

use engine::Result;
use engine::gpu::{Drawing, Format, Gpu, Image, Recorder};
use shaders_glsl as glsl;
use shaders_glsl::types::ShowParams;

/// Draws pictures into pictures of one format.
pub struct Composer(Drawing);

/// Rectangle of the window: left, top, right, bottom; pixels.
pub type Area = [f32; 4];

/// Layer of a picture with premultiplied display-referred colour.
#[derive(Clone, Copy)]
pub struct Layer<'a> {
    /// The picture.
    pub picture: &'a Image,
    /// Index of its layer.
    pub layer: u32,
    /// Width and height of the part that is shown, from the upper left corner, as fractions of the picture.
    pub part: [f32; 2],
}

/// Pictures and their places in a window.
pub struct Composition<'a> {
    /// Layer left of the split, or the only one.
    pub first: Layer<'a>,
    /// Layer right of the split, if there is one.
    pub second: Option<Layer<'a>>,
    /// Place of the split, pixels from the window's left edge.
    pub split: f32,
    /// Area that is drawn.
    pub area: Area,
    /// Place of the pictures; they are scaled to it.
    pub place: Area,
    /// Background behind everything: red, green, blue, display-referred.
    pub background: [f32; 3],
}

impl Composer {
    /// Creates a composer that draws into pictures of this format.
    pub fn new(gpu: &Gpu, format: Format) -> Result<Self> {
        let linear = [u32::from(format.is_srgb())];
        Drawing::new(gpu, &glsl::SHOW_VERT, &glsl::SHOW_FRAG, &linear, &[format], 1).map(Composer)
    }

    /// Records the drawing of `what` into a window's picture.
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
