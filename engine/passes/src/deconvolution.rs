//! The extinction and the colour of every splat in mode alpha: what splats draw, added up, is to be the medium
//! that a transfer function makes of the field.
//!
//! It is a deconvolution by Richardson and Lucy's iteration (1972, 1974): see `include/deconvolution.glsl`. What
//! does not depend on the transfer function, [`Points`], is made once for a scene.

use shaders_glsl as glsl;
pub use shaders_glsl::deconvolution::ROUNDS;
use shaders_glsl::types::{DeconvolutionParams, Look};

use super::lists::{DeviceLists, Lists};
use base::error::Result;
use gpu::{Buffer, Gpu, Kernel, Recorder};

/// Greatest number of points and of splats: as many as a pair can tell apart.
pub const MOST_ROWS: usize = 1 << 24;

/// Returns a pair for the list of a point or of a splat: the index of the other in the upper 24 bits, and a
/// weight, 0 to 1, in steps of 1/255 in the lower 8. A pair never has the weight 0.
pub fn pair(index: u32, weight: f32) -> u32 {
    index << 8 | (weight * 255.0).round().clamp(1.0, 255.0) as u32
}

/// Returns the index of the other of a [`pair`].
pub fn index_of(pair: u32) -> usize {
    (pair >> 8) as usize
}

/// Returns the weight of a [`pair`], 0 to 1.
pub fn weight_of(pair: u32) -> f32 {
    (pair & 255) as f32 / 255.0
}

/// Points at which splats are compared with the medium.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Points {
    /// V and O of the field at each point.
    pub values: Vec<[f32; 2]>,
    /// For each point the splats that are drawn there, as [`pair`]s weighted by their profiles.
    pub of_points: Lists,
    /// For each splat the points at which it is drawn, as [`pair`]s weighted for the splat's mean over them.
    pub of_splats: Lists,
    /// Share of the medium around it with which each splat begins.
    pub shares: Vec<f32>,
}

/// [`Points`] on the device.
pub struct DevicePoints {
    count: usize,
    values: Buffer<[f32; 2]>,
    of_points: DeviceLists,
    of_splats: DeviceLists,
    shares: Buffer<f32>,
}

impl DevicePoints {
    /// Uploads points.
    pub fn new(gpu: &Gpu, points: &Points) -> Result<Self> {
        Ok(DevicePoints {
            count: points.values.len(),
            values: gpu.upload("field at points in the splats", "splats", &points.values)?,
            of_points: points.of_points.upload(gpu, "splats at points", "splats")?,
            of_splats: points.of_splats.upload(gpu, "points of splats", "splats")?,
            shares: gpu.upload("shares of splats", "splats", &points.shares)?,
        })
    }
}

/// A look: its row, points and integrals.
pub type LookTables<'a> = (&'a Buffer<Look>, &'a Buffer<[u32; 2]>, &'a Buffer<[u32; 4]>);

/// The deconvolution for one look after the other.
pub struct Deconvolution {
    points: Kernel,
    splats: Kernel,
    /// Four halves a row, as `media_halves`.
    ratios: Buffer<[u32; 2]>,
    media_halves: Buffer<[u32; 2]>,
    /// Extinction times colour, and extinction, 1/mm, of each splat.
    pub media: Buffer<[f32; 4]>,
    /// The look that the media are of, and the next round for it.
    state: Option<(u64, u32)>,
}

impl Deconvolution {
    /// Creates the deconvolution for a scene of splats with these points.
    pub fn new(gpu: &Gpu, points: &DevicePoints) -> Result<Self> {
        Ok(Deconvolution {
            points: Kernel::new(gpu, &glsl::DECONVOLVE_POINTS, &[])?,
            splats: Kernel::new(gpu, &glsl::DECONVOLVE_SPLATS, &[])?,
            ratios: gpu.buffer("ratios at points in the splats", "splats", points.count)?,
            media_halves: gpu.buffer("media of splats in halves", "splats", points.shares.len())?,
            media: gpu.buffer("media of splats", "splats", points.shares.len())?,
            state: None,
        })
    }

    /// Records the rounds that `look` needs: all that are left or, where a frame must not take long, `at_most`
    /// so many; what is there after any of them can be drawn. Looks are told apart by their number.
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        points: &DevicePoints,
        (number, (rows, entries, integrals)): (u64, LookTables<'_>),
        at_most: u32,
    ) {
        let next = self.state.map_or(0, |(look, next)| if look == number { next } else { 0 });
        let end = (ROUNDS + 1).min(next.saturating_add(at_most));
        for round in next..end {
            recorder
                .pass(&self.points)
                .read("look_rows", rows)
                .read("look_points", entries)
                .read("look_integrals", integrals)
                .read("point_values", &points.values)
                .read("point_ends", &points.of_points.ends)
                .read("point_pairs", &points.of_points.rows)
                .read("media_halves", &self.media_halves)
                .write("ratios", &mut self.ratios)
                .push(&DeconvolutionParams { count: points.count as u32, round })
                .dispatch_over(points.count as u32);
            recorder
                .pass(&self.splats)
                .read("splat_ends", &points.of_splats.ends)
                .read("splat_pairs", &points.of_splats.rows)
                .read("shares", &points.shares)
                .read("ratios", &self.ratios)
                .write("media", &mut self.media)
                .write("media_halves", &mut self.media_halves)
                .push(&DeconvolutionParams { count: points.shares.len() as u32, round })
                .dispatch_over(points.shares.len() as u32);
        }
        self.state = Some((number, end));
    }
}
