//! The initialiser "gradient": blue noise that is denser where the intensity changes.
//!
//! 1. `density`: p ∝ M · (G∗|∇(G∗V)| / mean + floor)^exponent per voxel, with M the region's soft weight and
//!    G a narrow Gaussian. Splats gather where the intensity changes, which is worth some 2 dB against an
//!    even start.
//! 2. `blue_noise`: exactly `count` points of density ∝ p that keep apart from each other as p⁻¹ᐟ³.
//! 3. Scales follow from the four nearest neighbours (`grid`) and are flattened along the smoothed gradient:
//!    a splat on an edge lies in it. Nearest-neighbour scales are worth 9 dB against random ones.

use glam::DMat3;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::blue_noise;
use super::config::{InitConfig, prototype, set_opacity};
use super::density::Density;
use super::grid::PointGrid;
use super::intensity::intensity;
use crate::ScaleUnit;
use splat::Splat;
use splat::activation::Activations;
use splat::space::reshaped;
use volume::{Roi, Volume};

/// Places exactly `count` splats in the region of interest, in voxel space: means up to half a voxel beyond
/// the outer voxel centres, ln σ in ln voxels, intensities by trilinear sampling of the volume. Returns none
/// if no voxel of the region has a weight above 0. Samples that are not finite count as 0. `config` must pass
/// [`InitConfig::check`].
pub fn initialise(volume: &Volume, roi: &Roi, count: usize, seed: u64, config: &InitConfig) -> Vec<Splat> {
    assert_eq!(volume.size, roi.size, "a region of interest lies on the grid of its volume");
    let Some(density) = Density::of(volume, roi, config.weights()).filter(|_| count > 0) else {
        return Vec::new();
    };
    let points = blue_noise::throw(&density, count, config.deadline, &mut Pcg64::seed_from_u64(seed));
    let means: Vec<[f32; 3]> = (0..count).map(|index| points.grid.point(index)).collect();
    let turns = (config.orientation.run)(&density, &means, None);
    let prototype = prototype(config);
    let shape = flattened(config);
    // Distances are in voxels, and so are scales that follow from them.
    let to_box = DMat3::from_diagonal(config.unit.stretch(volume).recip());
    (0..count)
        .into_par_iter()
        .map(|index| {
            let spacing = mean_neighbour_distance(&points.grid, index, points.spacing[index], config);
            let scale = (config.scale_factor * spacing).max(config.scale_min).min(config.scale_max);
            let mut splat = Splat { mean: means[index], ..prototype };
            match turns[index] {
                Some(rotation) => {
                    splat.rotation = rotation;
                    splat.set_scale(shape.map(|factor| scale * factor));
                }
                None => splat.set_scale([scale; 3]),
            }
            splat.intensity = intensity(volume, &density, &splat, config.footprint);
            set_opacity(&mut splat, roi, config);
            if config.unit == ScaleUnit::Box { reshaped(&splat, &to_box) } else { splat }
        })
        .collect()
}

/// Returns the scales of a turned splat along its axes over that of a round one, with product 1: flat across
/// z or long along x.
fn flattened(config: &InitConfig) -> [f32; 3] {
    let (root, whole) = (config.anisotropy.sqrt(), config.anisotropy);
    if config.orientation.lengthens {
        [whole, root.recip(), root.recip()]
    } else {
        [root, root, whole.recip()]
    }
}

/// Returns the mean distance from a point to its four nearest neighbours, in voxels. A neighbour that is not
/// found nearby counts with `expected`, the spacing that the density asks for there.
fn mean_neighbour_distance(grid: &PointGrid, index: usize, expected: f32, config: &InitConfig) -> f32 {
    let reach = config.scale_max / config.scale_factor;
    let nearest: [f32; 4] = grid.nearest_squared(index, reach);
    nearest.iter().map(|d| if d.is_finite() { d.sqrt() } else { expected }).sum::<f32>() / 4.0
}
