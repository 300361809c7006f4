//! Where splats start: a gradient-weighted blue noise in the region of interest.
//!
//! 1. `density`: p ∝ M · (G∗|∇(G∗V)| / mean + floor)^exponent per voxel, M the region's soft weight and G a narrow
//!    Gaussian. Splats gather where the intensity changes, which is worth some 2 dB against an even start.
//! 2. `blue_noise`: exactly `count` points of density ∝ p that keep apart from each other as p⁻¹ᐟ³.
//! 3. Scales from the four nearest neighbours (`grid`), flattened along the smoothed gradient: a splat on an edge
//!    lies in it. Nearest-neighbour scales are worth 9 dB against random ones.
//!
//! That is the row "gradient" of [`INITIALISERS`]; "uniform" is the paper's (`uniform`), "reference" that of its authors'
//! code (`reference`). All turn splats by one of the
//! [`ORIENTATIONS`] and take intensities from the volume (`intensity`).
//!
//! Everything is in voxel space. The result depends on the inputs and the seed alone, not on the number of threads.
//! Time and memory follow the region's bounding box, not the volume.

mod blue_noise;
mod density;
mod grid;
mod intensity;
mod orientation;
mod reference;
mod symmetric;
mod uniform;

use glam::DMat3;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;

use self::density::Density;
pub(super) use self::grid::PointGrid;
use self::intensity::intensity;
pub use self::orientation::{ORIENTATIONS, Orientation};
use super::config::{FitConfig, ScaleUnit};
use crate::error::{Error, Kind, Result};
use crate::splat::Splat;
use crate::splat::activation::{Activations, OPACITY_MAX, OPACITY_MIN};
use crate::splat::space::reshaped;
use crate::volume::{Roi, Volume};

/// How splats are initialised; the defaults are the best of the measured ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitConfig {
    /// Exponent of the gradient term of the density; 0 gives a uniform density. 0.5 and 1 are equally good.
    pub gradient_exponent: f32,
    /// Added to the gradient in units of its mean, so that even regions get splats too.
    pub gradient_floor: f32,
    /// Standard deviation of the smoothing before and after the gradient, in voxels.
    pub smoothing_sigma: f32,
    /// Scale across the gradient over scale along it is this to the power 3/2.
    pub anisotropy: f32,
    /// Scale of a splat over the mean distance of its four nearest neighbours.
    pub scale_factor: f32,
    /// Least scale, in `unit`; of "gradient" before it is flattened: a splat must reach some voxel centre.
    pub scale_min: f32,
    /// Greatest scale, in `unit`; of "gradient" before it is flattened.
    pub scale_max: f32,
    /// What the scales of "uniform" count in. Those of "gradient" follow from distances in voxels and stay in voxels.
    pub unit: ScaleUnit,
    /// What turns the splats.
    pub orientation: &'static Orientation,
    /// From this scale on (geometric mean, voxels) a splat takes the mean intensity of its footprint; 0: never.
    pub footprint: f32,
    /// Opacity of every splat.
    pub opacity: f32,
    /// Opacity of a splat is the mask at its mean instead.
    pub opacity_mask: bool,
}

impl Default for InitConfig {
    fn default() -> Self {
        InitConfig {
            gradient_exponent: 0.7,
            gradient_floor: 0.1,
            smoothing_sigma: 0.8,
            anisotropy: 1.5,
            scale_factor: 0.6,
            scale_min: 0.45,
            scale_max: 8.0,
            unit: ScaleUnit::Voxel,
            orientation: &ORIENTATIONS[0],
            footprint: 0.0,
            opacity: 0.5,
            opacity_mask: false,
        }
    }
}

impl InitConfig {
    /// Fails, naming the field, if a value lies outside the range in which the initialisation makes sense.
    pub fn check(&self) -> Result<()> {
        let rows = [
            ("gradient_exponent", self.gradient_exponent, 0.0, 4.0),
            ("gradient_floor", self.gradient_floor, 0.0, 1e3),
            ("smoothing_sigma", self.smoothing_sigma, 0.0, 8.0),
            ("anisotropy", self.anisotropy, 1.0, 100.0),
            ("scale_factor", self.scale_factor, 0.01, 10.0),
            ("scale_min", self.scale_min, 0.01, 100.0),
            ("scale_max", self.scale_max, self.scale_min, 1e3),
            ("footprint", self.footprint, 0.0, 1e3),
            ("opacity", self.opacity, OPACITY_MIN, OPACITY_MAX),
        ];
        for (name, value, low, high) in rows {
            // Written so that NaN fails.
            if !(low..=high).contains(&value) {
                let message = format!("{name} is {value}; it must lie from {low} to {high}");
                return Err(Error::new(Kind::Usage, "VGS-INIT-001", message));
            }
        }
        Ok(())
    }
}

/// A way to place the first splats.
pub struct Initialiser {
    /// Name on the command line.
    pub name: &'static str,
    /// Places `count` splats in voxel space; see [`initialise`]. With [`ScaleUnit::Box`] they have their shape in the unit
    /// cube of the volume's box, in the unit of [`super::FitConfig::stretch`], as a fit with that unit takes them.
    pub run: fn(volume: &Volume, roi: &Roi, count: usize, seed: u64, config: &InitConfig) -> Vec<Splat>,
}

/// Every way to place the first splats; the first is the default.
pub const INITIALISERS: &[Initialiser] = &[
    Initialiser { name: "gradient", run: initialise },
    Initialiser { name: "uniform", run: uniform::initialise },
    Initialiser { name: "reference", run: reference::initialise },
];

/// Places exactly `count` splats in the region of interest, in voxel space: means up to half a voxel beyond the outer
/// voxel centres, ln σ in ln voxels, intensities by trilinear sampling of the volume. Returns none if no voxel of the
/// region has a weight above 0. Samples that are not finite count as 0. `config` must pass [`InitConfig::check`].
pub fn initialise(volume: &Volume, roi: &Roi, count: usize, seed: u64, config: &InitConfig) -> Vec<Splat> {
    assert_eq!(volume.size, roi.size, "a region of interest lies on the grid of its volume");
    let Some(density) = Density::of(volume, roi, config).filter(|_| count > 0) else { return Vec::new() };
    let points = blue_noise::throw(&density, count, &mut Pcg64::seed_from_u64(seed));
    let means: Vec<[f32; 3]> = (0..count).map(|index| points.grid.point(index)).collect();
    let turns = (config.orientation.run)(&density, &means, None);
    let prototype = prototype(config);
    let shape = flattened(config);
    // Distances are in voxels, and so are scales that follow from them.
    let unit = FitConfig { scale_unit: config.unit, ..FitConfig::default() };
    let to_box = DMat3::from_diagonal(unit.stretch(volume).recip());
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

/// Gives a splat the opacity of the mask at its mean, where the configuration says so.
fn set_opacity(splat: &mut Splat, roi: &Roi, config: &InitConfig) {
    if config.opacity_mask {
        splat.set_opacity(roi.trilinear(glam::Vec3::from_array(splat.mean).as_dvec3()) as f32);
    }
}

/// What all splats start from: no rotation, and the opacity.
fn prototype(config: &InitConfig) -> Splat {
    let mut splat = Splat { rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
    splat.set_opacity(config.opacity);
    splat
}

/// Scale of a turned splat along its axes over that of a round one, of product 1: flat across z or long along x.
fn flattened(config: &InitConfig) -> [f32; 3] {
    let (root, whole) = (config.anisotropy.sqrt(), config.anisotropy);
    if config.orientation.lengthens {
        [whole, root.recip(), root.recip()]
    } else {
        [root, root, whole.recip()]
    }
}

/// Mean distance from a point to its four nearest neighbours; a neighbour that is not found near by counts with
/// `expected`, the spacing that the density asks for there.
fn mean_neighbour_distance(grid: &PointGrid, index: usize, expected: f32, config: &InitConfig) -> f32 {
    let reach = config.scale_max / config.scale_factor;
    let nearest: [f32; 4] = grid.nearest_squared(index, reach);
    nearest.iter().map(|d| if d.is_finite() { d.sqrt() } else { expected }).sum::<f32>() / 4.0
}

#[cfg(test)]
mod tests;
