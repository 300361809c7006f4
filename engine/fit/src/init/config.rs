//! The hyper-parameters of all initialisers, and the splat that they all begin with.

use std::time::Instant;

use super::density::GradientWeights;
use super::orientation::Orientation;
use crate::ScaleUnit;
use base::error::{Error, Kind, Result};
use splat::Splat;
use splat::activation::{Activations, OPACITY_MAX, OPACITY_MIN};
use volume::Roi;

/// The hyper-parameters of an initialiser; [`FitConfig::init`](crate::FitConfig::init) gives their
/// values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InitConfig {
    /// Exponent of the gradient term of the density; 0 gives a uniform density. 0.5 and 1 are equally good.
    pub gradient_exponent: f32,
    /// Constant added to the gradient, in units of its mean, so that even regions get splats too.
    pub gradient_floor: f32,
    /// Standard deviation of the smoothing before and after the gradient, in voxels.
    pub smoothing_sigma: f32,
    /// The ratio of the scale across the gradient to the scale along it is this to the power 3/2.
    pub anisotropy: f32,
    /// Ratio of a splat's scale to the mean distance of its four nearest neighbours.
    pub scale_factor: f32,
    /// Least scale, in `unit`; with "gradient" it holds before a splat is flattened. A splat must reach some
    /// voxel centre.
    pub scale_min: f32,
    /// Greatest scale, in `unit`; with "gradient" it holds before a splat is flattened.
    pub scale_max: f32,
    /// Unit of the scales of "uniform" and "reference". Those of "gradient" follow from distances in voxels
    /// and stay in voxels.
    pub unit: ScaleUnit,
    /// The cue that turns the splats.
    pub orientation: &'static Orientation,
    /// From this scale on (geometric mean, voxels) a splat takes the mean intensity of its footprint; 0:
    /// never.
    pub footprint: f32,
    /// Opacity of every splat.
    pub opacity: f32,
    /// True if the opacity of each splat is the mask at its mean instead.
    pub opacity_mask: bool,
    /// Time after which "gradient" no longer looks for places at a distance from all others, but takes any.
    pub deadline: Option<Instant>,
}

impl InitConfig {
    /// Returns how the gradient weighs voxels.
    pub(super) fn weights(&self) -> GradientWeights {
        GradientWeights {
            smoothing_sigma: self.smoothing_sigma,
            exponent: self.gradient_exponent,
            floor: self.gradient_floor,
        }
    }

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

/// Gives a splat the opacity of the mask at its mean, where the configuration says so.
pub(super) fn set_opacity(splat: &mut Splat, roi: &Roi, config: &InitConfig) {
    if config.opacity_mask {
        splat.set_opacity(roi.trilinear(glam::Vec3::from_array(splat.mean).as_dvec3()) as f32);
    }
}

/// Returns the splat that all start from: without rotation, and with the configured opacity.
pub(super) fn prototype(config: &InitConfig) -> Splat {
    let mut splat = Splat { rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
    splat.set_opacity(config.opacity);
    splat
}
