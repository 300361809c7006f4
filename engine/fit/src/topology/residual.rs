//! Places where the fit is worst: G₁ ∗ (M (V̂ − V)²) over the ROI, and the voxels where it is largest.
//!
//! A single wrong voxel is noise that one more splat would only copy; the smoothing asks for places where
//! several neighbours are wrong together.

use glam::IVec3;
use rayon::prelude::*;

use super::Scene;
use super::spread::{slot_at, spread};
use splat::Splat;
use volume::Bricks;
use volume::bricks::{BRICK, SAMPLES, brick_morton, brick_voxel};

/// Least distance of new splats from each other, voxels.
const APART: f64 = 2.0;
/// Standard deviation of a new splat, voxels: it repairs one place and leaves its surroundings to the others.
const SCALE: f32 = 0.8;
/// Opacity of a new splat: logit 0, from where it can soon rise or fall.
const OPACITY: f32 = 0.5;
/// Reach of the smoothing, voxels; its standard deviation is 1 voxel.
const REACH: usize = 3;
/// Edge of a brick with the voxels around it that the smoothing needs.
const WIDE: usize = BRICK + 2 * REACH;

/// Creates at most `most` splats where the smoothed squared residual is largest, the worst voxel first.
pub(super) fn splats_at_worst(scene: &Scene, most: usize) -> Vec<Splat> {
    if most == 0 {
        return Vec::new();
    }
    let residuals = smoothed_residuals(scene);
    let mut worst: Vec<usize> = (0..residuals.len()).filter(|&i| residuals[i] > 0.0).collect();
    // The index makes the order total, so the parallel sort has one result.
    worst.par_sort_unstable_by(|&a, &b| residuals[b].total_cmp(&residuals[a]).then(a.cmp(&b)));
    spread(scene.bricks, worst, APART, most)
        .into_iter()
        .map(|index| scene.new_splat(scene.voxel(index).as_dvec3(), SCALE, OPACITY))
        .collect()
}

/// Returns G₁ ∗ (M (V̂ − V)²) at each sample, squared HU; 0 outside the ROI.
pub(super) fn smoothed_residuals(scene: &Scene) -> Vec<f32> {
    let squared = scene.map_roi(0.0, |field, voxel, m| {
        let error = field.hu - scene.target(voxel.as_dvec3()) as f32;
        let squared = m * error * error;
        if squared.is_finite() { squared } else { 0.0 }
    });
    let smooth = smoothed(scene.bricks, &squared);
    scene
        .map_roi(false, |_, _, _| true)
        .into_iter()
        .zip(smooth)
        .map(|(inside, r)| if inside { r } else { 0.0 })
        .collect()
}

/// Smooths samples by a Gaussian of one voxel; what has no brick counts as 0. Each brick is computed on its
/// own, so that cost and memory follow the ROI.
fn smoothed(bricks: &Bricks, samples: &[f32]) -> Vec<f32> {
    let taps = taps();
    let mut out = vec![0.0; samples.len()];
    let scratch =
        || (vec![0.0; WIDE * WIDE * WIDE], vec![0.0; WIDE * WIDE * BRICK], vec![0.0; WIDE * BRICK * BRICK]);
    out.par_chunks_mut(SAMPLES).enumerate().for_each_init(scratch, |(wide, rows, planes), (slot, out)| {
        gather(bricks, samples, slot, wide);
        // Along x, then y, then z; each pass shortens one edge from WIDE to BRICK.
        for (i, row) in rows.iter_mut().enumerate() {
            let (x, yz) = (i % BRICK, i / BRICK);
            *row = convolve(&taps, |j| wide[yz * WIDE + x + j]);
        }
        for (i, plane) in planes.iter_mut().enumerate() {
            let (x, y, z) = (i % BRICK, i / BRICK % BRICK, i / (BRICK * BRICK));
            *plane = convolve(&taps, |j| rows[(z * WIDE + y + j) * BRICK + x]);
        }
        for (morton, out) in out.iter_mut().enumerate() {
            let [x, y, z] = brick_voxel(morton).to_array().map(|c| c as usize);
            *out = convolve(&taps, |j| planes[((z + j) * BRICK + y) * BRICK + x]);
        }
    });
    out
}

/// Gathers into `wide` the samples of a brick and of [`REACH`] voxels around it, x fastest.
fn gather(bricks: &Bricks, samples: &[f32], slot: usize, wide: &mut [f32]) {
    let centre = bricks.coordinates[slot].as_ivec3();
    let around: [Option<usize>; 27] = std::array::from_fn(|i| {
        let step = IVec3::new(i as i32 % 3, i as i32 / 3 % 3, i as i32 / 9) - 1;
        slot_at(bricks, centre + step)
    });
    for (i, out) in wide.iter_mut().enumerate() {
        // Counted from the brick before this one on each axis.
        let at = [i % WIDE, i / WIDE % WIDE, i / (WIDE * WIDE)].map(|c| c + BRICK - REACH);
        let [bx, by, bz] = at.map(|c| c / BRICK);
        let inside = at.map(|c| (c % BRICK) as u32);
        *out = around[bx + 3 * (by + 3 * bz)]
            .map_or(0.0, |slot| samples[slot * SAMPLES + brick_morton(inside.into())]);
    }
}

fn convolve(taps: &[f32], at: impl Fn(usize) -> f32) -> f32 {
    taps.iter().enumerate().map(|(j, tap)| tap * at(j)).sum()
}

/// Returns a Gaussian of one voxel at whole voxels, with sum 1.
fn taps() -> [f32; 2 * REACH + 1] {
    let raw: [f64; 2 * REACH + 1] = std::array::from_fn(|j| (-0.5 * (j as f64 - REACH as f64).powi(2)).exp());
    let sum: f64 = raw.iter().sum();
    raw.map(|tap| (tap / sum) as f32)
}
