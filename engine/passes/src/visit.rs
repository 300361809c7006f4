//! The field of splats at the voxels of a grid. Only bricks that a splat reaches are computed, in slabs of
//! bounded size, so that cost and memory depend on the splats and not on the size of the grid.

use std::cmp::Ordering;
use std::ops::Range;

use glam::{DVec3, IVec3, UVec3};
use rayon::prelude::*;

use super::{FieldSample, Sampler};
use base::error::Result;
use gpu::Gpu;
use splat::{Activations, Field, Splat};
use volume::Bricks;
use volume::bricks::{BRICK, SAMPLES};

/// Number of samples after which a slab ends; with their results they take some 13 MB.
const SLAB_SAMPLES: usize = 1 << 19;

/// Returns the first and the last brick of the grid along each axis that a splat reaches; `None` if it lies
/// outside.
fn bricks_of(splat: &Splat, field: &Field, size: [usize; 3]) -> Option<[[usize; 2]; 3]> {
    let mean = DVec3::from_array(splat.mean.map(f64::from));
    let reach = splat.reach(field.kernel.support_q());
    let mut out = [[0; 2]; 3];
    for axis in 0..3 {
        let first = (mean[axis] - reach[axis]).ceil().max(0.0);
        let last = (mean[axis] + reach[axis]).floor().min(size[axis] as f64 - 1.0);
        // This also holds if one of them is NaN.
        if first.partial_cmp(&last).is_none_or(Ordering::is_gt) {
            return None;
        }
        out[axis] = [first as usize / BRICK, last as usize / BRICK];
    }
    Some(out)
}

/// Returns ranges of brick layers that together are the grid. Each ends with the layer in which its touched bricks
/// reach [`SLAB_SAMPLES`], the last one with the grid.
fn slabs(touched: &[bool], grid: [usize; 3]) -> Vec<Range<usize>> {
    let (mut out, mut first, mut samples) = (Vec::new(), 0, 0);
    for (z, layer) in touched.chunks((grid[0] * grid[1]).max(1)).enumerate() {
        samples += layer.iter().filter(|&&t| t).count() * SAMPLES;
        if samples >= SLAB_SAMPLES || z + 1 == grid[2] {
            out.push(first..z + 1);
            (first, samples) = (z + 1, 0);
        }
    }
    out
}

/// Calls `take` with index and field of each voxel of a grid that a splat may reach; the splats are in its
/// voxel space.
pub fn visit(
    gpu: &Gpu,
    splats: &[Splat],
    field: &Field,
    size: [usize; 3],
    mut take: impl FnMut(usize, &FieldSample),
) -> Result<()> {
    let grid = size.map(|n| n.div_ceil(BRICK));
    let boxes: Vec<_> = splats.par_iter().map(|s| bricks_of(s, field, size)).collect();
    let mut touched = vec![false; grid.iter().product()];
    for [x, y, z] in boxes.iter().flatten() {
        for bz in z[0]..=z[1] {
            for by in y[0]..=y[1] {
                let row = (bz * grid[1] + by) * grid[0];
                touched[row + x[0]..=row + x[1]].fill(true);
            }
        }
    }
    for Range { start: first, end: last } in slabs(&touched, grid) {
        let near: Vec<Splat> = splats
            .iter()
            .zip(&boxes)
            .filter(|(_, b)| b.is_some_and(|[_, _, z]| z[0] < last && z[1] >= first))
            .map(|(s, _)| *s)
            .collect();
        let low = IVec3::new(0, 0, (first * BRICK) as i32);
        let high = (last * BRICK).min(size[2]) - first * BRICK;
        let extent = UVec3::new(size[0] as u32, size[1] as u32, high as u32);
        let bricks = Bricks::of_box(low, extent, |v| {
            let [x, y, z] = (v / BRICK as u32).to_array().map(|n| n as usize);
            touched[((first + z) * grid[1] + y) * grid[0] + x]
        });
        if near.is_empty() || bricks.is_empty() {
            continue;
        }
        let samples = Sampler::new(gpu, &near, field, &bricks)?.sample([0.0; 3])?;
        for (i, sample) in samples.iter().enumerate() {
            let (slot, morton) = (i / SAMPLES, i % SAMPLES);
            if bricks.is_active(slot, morton) {
                let [x, y, z] = bricks.voxel(slot, morton).to_array().map(|n| n as usize);
                take((z * size[1] + y) * size[0] + x, sample);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slabs_end_where_they_are_full() {
        let full = SLAB_SAMPLES / SAMPLES;
        let grid = [full / 2, 1, 7];
        let touched: Vec<bool> = [0, 1, 1, 1, 0, 0, 1].iter().flat_map(|&t| vec![t == 1; grid[0]]).collect();
        assert_eq!(slabs(&touched, grid), [0..3, 3..7]);
        let layer = slabs(&touched, [grid[0] * 7, 1, 1]);
        assert!(layer.len() == 1 && layer[0] == (0..1), "a layer is never cut: {layer:?}");
        assert!(slabs(&[], [0, 0, 0]).is_empty());
    }

    #[test]
    fn a_splat_reaches_as_far_as_its_kernel() {
        let mut splat = Splat { mean: [20.0, 4.0, 4.0], rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
        splat.set_scale([2.0, 1.0, 1.0]);
        let field = Field::default();
        let far = splat.reach(field.kernel.support_q());
        assert!((far - DVec3::new(2.0, 1.0, 1.0) * 6f64.sqrt()).length() < 1e-6, "{far}");
        // The splat reaches from 15.1 to 24.9, and from 1.6 to 6.4.
        assert_eq!(bricks_of(&splat, &field, [64, 64, 64]), Some([[2, 3], [0, 0], [0, 0]]));
        assert_eq!(bricks_of(&splat, &field, [8, 8, 8]), None);
    }
}
