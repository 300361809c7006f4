//! The initialiser "gradient": blue noise that is denser where the intensity changes.
//!
//! 1. `density`: p ∝ M · (G∗|∇(G∗V)| / mean + floor)^exponent per voxel, with M the region's soft weight and
//!    G a narrow Gaussian. Splats gather where the intensity changes, which is worth some 2 dB against an
//!    even start.
//! 2. `blue_noise`: exactly `count` points of density ∝ p that keep apart from each other as p⁻¹ᐟ³.
//! 3. Scales follow from the four nearest neighbours (`grid`) and are flattened along the smoothed gradient:
//!    a splat on an edge lies in it. Nearest-neighbour scales are worth 9 dB against random ones.

use std::time::Instant;

use glam::DMat3;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::blue_noise;
use super::density::{Density, GradientWeights};
use super::grid::PointGrid;
use super::intensity::intensity;
use super::prototype::{prototype, set_opacity};
use crate::ScaleUnit;
use crate::config::Init;
use splat::Splat;
use splat::activation::Activations;
use splat::space::reshaped;
use volume::{Roi, Volume};

/// Places exactly `count` splats in the region of interest, in voxel space: means up to half a voxel beyond
/// the outer voxel centres, ln σ in ln voxels, intensities by trilinear sampling of the volume. Returns none
/// if no voxel of the region has a weight above 0. Samples that are not finite count as 0. After the deadline it no
/// longer looks for places at a distance from all others, but takes any.
pub fn initialise(
    volume: &Volume,
    roi: &Roi,
    count: usize,
    seed: u64,
    init: &Init,
    deadline: Option<Instant>,
) -> Vec<Splat> {
    assert_eq!(volume.size, roi.size, "a region of interest lies on the grid of its volume");
    let Some(density) = Density::of(volume, roi, GradientWeights::of(init)).filter(|_| count > 0) else {
        return Vec::new();
    };
    let points = blue_noise::throw(&density, count, deadline, &mut Pcg64::seed_from_u64(seed));
    let means: Vec<[f32; 3]> = (0..count).map(|index| points.grid.point(index)).collect();
    let turns = (init.cue().run)(&density, &means, None);
    let prototype = prototype(init);
    let shape = flattened(init);
    // Distances are in voxels, and so are scales that follow from them.
    let to_box = DMat3::from_diagonal(init.unit.stretch(volume).recip());
    (0..count)
        .into_par_iter()
        .map(|index| {
            let spacing = mean_neighbour_distance(&points.grid, index, points.spacing[index], init);
            let scale = (init.scale_factor * spacing).max(init.scale_min).min(init.scale_max);
            let mut splat = Splat { mean: means[index], ..prototype };
            match turns[index] {
                Some(rotation) => {
                    splat.rotation = rotation;
                    splat.set_scale(shape.map(|factor| scale * factor));
                }
                None => splat.set_scale([scale; 3]),
            }
            splat.intensity = intensity(volume, &density, &splat, init.footprint);
            set_opacity(&mut splat, roi, init);
            if init.unit == ScaleUnit::Box { reshaped(&splat, &to_box) } else { splat }
        })
        .collect()
}

/// Returns the scales of a turned splat along its axes over that of a round one, with product 1: flat across
/// z or long along x.
fn flattened(init: &Init) -> [f32; 3] {
    let (root, whole) = (init.anisotropy.sqrt(), init.anisotropy);
    if init.cue().lengthens { [whole, root.recip(), root.recip()] } else { [root, root, whole.recip()] }
}

/// Returns the mean distance from a point to its four nearest neighbours, in voxels. A neighbour that is not
/// found nearby counts with `expected`, the spacing that the density asks for there.
fn mean_neighbour_distance(grid: &PointGrid, index: usize, expected: f32, init: &Init) -> f32 {
    let reach = init.scale_max / init.scale_factor;
    let nearest: [f32; 4] = grid.nearest_squared(index, reach);
    nearest.iter().map(|d| if d.is_finite() { d.sqrt() } else { expected }).sum::<f32>() / 4.0
}
