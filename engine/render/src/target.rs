//! The pictures that a frame is rendered into.

use base::error::Result;
use gpu::{Format, Gpu, Image};

/// Colour and depth of all views, one layer each.
pub struct Target {
    /// Display-referred colour, premultiplied by the opacity in the fourth channel.
    pub colour: Image,
    /// Σ z α T along a ray, mm along the viewing direction: the mean depth times the opacity. A single pixel
    /// if depth was not asked for.
    pub depth: Image,
    size: [u32; 2],
}

impl Target {
    /// Creates a target of `size` pixels for `views` views. Colour is kept in halves, or in floats if
    /// `precise`.
    pub fn new(gpu: &Gpu, size: [u32; 2], views: u32, precise: bool, depth: bool) -> Result<Self> {
        let format = if precise { Format::Rgba32f } else { Format::Rgba16f };
        let depth_size = if depth { size } else { [1, 1] };
        Ok(Target {
            colour: gpu.picture("colour", "pictures", format, size, views)?,
            depth: gpu.picture("depth", "pictures", Format::R32f, depth_size, views)?,
            size,
        })
    }

    /// Returns the width and height, pixels.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// Returns the number of views.
    pub fn views(&self) -> u32 {
        self.colour.layers()
    }

    /// Returns the colour of a view, rows from the top. Waits for the device.
    pub fn read_colour(&self, view: u32) -> Result<Vec<[f32; 4]>> {
        let all: Vec<[f32; 4]> = match self.colour.format() {
            Format::Rgba32f => self.colour.read()?,
            _ => self
                .colour
                .read::<[u16; 4]>()?
                .iter()
                .map(|texel| texel.map(|bits| half::f16::from_bits(bits).to_f32()))
                .collect(),
        };
        Ok(self.layer(all, view))
    }

    /// Returns the mean depth of a view, mm along the viewing direction, rows from the top; infinite where
    /// nothing is seen. Waits for the device.
    pub fn read_depth(&self, view: u32) -> Result<Vec<f32>> {
        let weighted = self.layer(self.depth.read::<f32>()?, view);
        let colour = self.read_colour(view)?;
        Ok(weighted
            .iter()
            .zip(&colour)
            .map(|(&d, c)| if c[3] > 0.0 { d / c[3] } else { f32::INFINITY })
            .collect())
    }

    fn layer<T: Copy>(&self, all: Vec<T>, view: u32) -> Vec<T> {
        let texels = (self.size[0] * self.size[1]) as usize;
        all[view as usize * texels..][..texels].to_vec()
    }
}
