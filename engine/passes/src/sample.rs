//! Samples of the field of a set of splats at the voxels of a brick grid, in HU, for measurements and for
//! decoding.

use super::Rasterizer;
use base::error::Result;
use gpu::{Buffer, Gpu};
use splat::activation::{limit_anisotropy, normalised};
use splat::{Field, Splat};
use volume::Bricks;

/// The field of some splats at one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldSample {
    /// V̂, HU.
    pub hu: f32,
    /// O in 0..1.
    pub occupancy: f32,
    /// Summed weight W of the splats.
    pub weight: f32,
}

/// Samples a field on a brick grid.
pub struct Sampler {
    rasterizer: Rasterizer,
    splats: Buffer<Splat>,
    background: f32,
    /// HU per unit of the intensities on the device.
    unit: f64,
    occupancy_w0: f32,
}

/// Intensities may be this far from the background, HU. If one is farther, all go to the device as parts of
/// the farthest: otherwise their products with weights could leave f32.
const FAR_HU: f64 = 1e12;

impl Sampler {
    /// Creates a sampler for the samples of `bricks`; the splats are in voxel coordinates of the volume and
    /// HU.
    pub fn new(gpu: &Gpu, splats: &[Splat], field: &Field, bricks: &Bricks) -> Result<Self> {
        let origin = bricks.origin.as_vec3().to_array();
        let away = |s: &Splat| f64::from(s.intensity) - f64::from(field.background);
        let furthest = splats.iter().map(|s| away(s).abs()).filter(|v| v.is_finite()).fold(0.0, f64::max);
        let unit = if furthest > FAR_HU { furthest } else { 1.0 };
        // Intensities are relative to the background, so that an uncovered sample has it exactly.
        let local: Vec<Splat> = splats
            .iter()
            .map(|s| Splat {
                mean: std::array::from_fn(|i| s.mean[i] - origin[i]),
                intensity: (away(s) / unit) as f32,
                rotation: normalised(s.rotation),
                log_scale: limit_anisotropy(s.log_scale),
                ..*s
            })
            .collect();
        Ok(Sampler {
            rasterizer: Rasterizer::new(gpu, field.kernel, field.epsilon, bricks, local.len())?,
            splats: gpu.upload("splats", "splats", &local)?,
            background: field.background,
            unit,
            occupancy_w0: field.occupancy_w0,
        })
    }

    /// Evaluates all samples at one offset and returns them in memory order of the bricks. Samples that take
    /// no part may hold anything.
    pub fn sample(&mut self, offset: [f32; 3]) -> Result<Vec<FieldSample>> {
        let got = self.rasterizer.rasterize(&self.splats, offset)?;
        Ok(got
            .into_iter()
            .map(|r| FieldSample {
                // The hull of the intensities is finite; only rounding could lead out of f32.
                hu: (f64::from(r.value) * self.unit + f64::from(self.background))
                    .clamp(f64::from(f32::MIN), f64::from(f32::MAX)) as f32,
                occupancy: r.weight / (r.weight + self.occupancy_w0),
                weight: r.weight,
            })
            .collect())
    }
}
