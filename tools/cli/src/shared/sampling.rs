//! Evaluates a set as it is shown, at the voxels of a grid.

use engine::Result;
use engine::fit::evaluate::FieldSample;
use engine::gpu::Gpu;
use engine::passes::visit;
use engine::render;
use engine::splat::{Form, SplatSet};
use engine::volume::Volume;
use glam::DVec3;
use rayon::prelude::*;

/// Calls `take` with index and field of the voxels of `volume`, as the set is shown: of those that a splat
/// may reach. Splats that were fitted for the voxels of a grid are decoded there and interpolated; then
/// `take` is called for all voxels, and the weight is the occupancy.
pub fn visit_shown(
    gpu: &Gpu,
    set: &SplatSet,
    volume: &Volume,
    mut take: impl FnMut(usize, &FieldSample),
) -> Result<()> {
    if set.form == Form::Field {
        return visit(gpu, &set.to_voxel(&volume.world_from_voxel), &set.field, volume.size, take);
    }
    let decoded = render::decode(gpu, set, 1.0)?;
    let field = decoded.in_voxels_of(volume, set.origin_mm);
    let [nx, ny, _] = volume.size;
    let layer = nx * ny;
    for z in 0..volume.size[2] {
        let at = |i: usize| {
            let (hu, occupancy) = field(DVec3::new((i % nx) as f64, (i / nx) as f64, z as f64));
            FieldSample { hu: hu as f32, occupancy: occupancy as f32, weight: occupancy as f32 }
        };
        let samples: Vec<FieldSample> = (0..layer).into_par_iter().map(at).collect();
        samples.iter().enumerate().for_each(|(i, sample)| take(z * layer + i, sample));
    }
    Ok(())
}
