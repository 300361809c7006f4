//! Splats as a volume again: their field, as it is shown, at the voxels of a grid.

use glam::{DAffine3, DVec3};
use rayon::prelude::*;

use crate::error::Result;
use crate::fit::evaluate::FieldSample;
use crate::gpu::Gpu;
use crate::passes::visit;
use crate::render::{bounds, decode};
use crate::splat::{Activations, Form, Grid, SplatSet};
use crate::volume::Volume;

/// A quantity of the field of splats.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quantity {
    /// HU where the occupancy is one half or more, elsewhere this number.
    Intensity {
        /// HU elsewhere.
        outside: f32,
    },
    /// HU everywhere; far from all splats that of the background.
    Field,
    /// From 0 to 1; of a fit to a binary mask, at the voxels, 0 or 1.
    Occupancy,
    /// The summed weight of the splats themselves, whatever they were fitted for.
    Weight,
}

impl Quantity {
    fn of(self, sample: &FieldSample) -> f32 {
        match self {
            Quantity::Intensity { outside } if sample.occupancy < 0.5 => outside,
            Quantity::Intensity { .. } | Quantity::Field => sample.hu,
            Quantity::Occupancy => sample.occupancy,
            Quantity::Weight => sample.weight,
        }
    }
}

/// Replaces the samples of `grid` by a quantity of a set there. Returns the number of voxels that splats reach.
///
/// # Errors
/// Fails if the device fails, and returns the errors of [`decode`].
pub fn rasterize(gpu: &Gpu, set: &SplatSet, quantity: Quantity, grid: &mut Volume) -> Result<usize> {
    let nothing = match quantity {
        Quantity::Intensity { outside } => outside,
        Quantity::Field => set.field.background,
        Quantity::Occupancy | Quantity::Weight => 0.0,
    };
    let mut samples = std::mem::take(&mut grid.samples);
    samples.fill(nothing);
    let mut reached = 0;
    let take = |index: usize, sample: &FieldSample| {
        samples[index] = quantity.of(sample);
        reached += usize::from(sample.weight > 0.0);
    };
    let done = match quantity {
        Quantity::Weight => visit(gpu, &set.to_voxel(&grid.world_from_voxel), &set.field, grid.size, take),
        _ => visit_shown(gpu, set, grid, take),
    };
    grid.samples = samples;
    done.map(|()| reached)
}

/// Returns the grid of this spacing, mm, around the reach of a set's splats and its coded voxels; its axes are RAS.
pub fn grid_around(set: &SplatSet, spacing: DVec3) -> Grid {
    let splats = set.splats.iter().map(|s| {
        let mean = DVec3::from_array(s.mean.map(f64::from));
        let reach = s.reach(set.field.kernel.support_q());
        (mean - reach, mean + reach)
    });
    let coded = (!set.voxels.is_empty()).then(|| {
        let [low, high] = bounds(set).map(|corner| corner - set.origin_mm);
        (low, high)
    });
    let (low, high) = splats.chain(coded).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or_default();
    // More than an index can count is as good as the most.
    let size = (((high - low) / spacing).ceil() + 1.0).to_array().map(|n| n as u32);
    let affine = DAffine3 { translation: low + set.origin_mm, ..DAffine3::from_scale(spacing) };
    Grid { size, world_from_voxel: affine }
}

/// Calls `take` with index and field of the voxels of `grid`, as the set is shown: of those that a splat may reach.
/// Splats that were fitted for the voxels of a grid are decoded there and interpolated; then `take` is called for all
/// voxels, and the weight is the occupancy. The samples of `grid` are not looked at.
///
/// # Errors
/// As [`rasterize`].
pub fn visit_shown(
    gpu: &Gpu,
    set: &SplatSet,
    grid: &Volume,
    mut take: impl FnMut(usize, &FieldSample),
) -> Result<()> {
    if set.form == Form::Field {
        return visit(gpu, &set.to_voxel(&grid.world_from_voxel), &set.field, grid.size, take);
    }
    let decoded = decode(gpu, set, 1.0)?;
    let field = decoded.in_voxels_of(grid, set.origin_mm);
    let [nx, ny, nz] = grid.size;
    let layer = nx * ny;
    for z in 0..nz {
        let at = |i: usize| {
            let (hu, occupancy) = field(DVec3::new((i % nx) as f64, (i / nx) as f64, z as f64));
            FieldSample { hu: hu as f32, occupancy: occupancy as f32, weight: occupancy as f32 }
        };
        let samples: Vec<FieldSample> = (0..layer).into_par_iter().map(at).collect();
        samples.iter().enumerate().for_each(|(i, sample)| take(z * layer + i, sample));
    }
    Ok(())
}
