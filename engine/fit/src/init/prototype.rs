//! The splat that all initialisers begin with.

use crate::config::Init;
use splat::Splat;
use splat::activation::Activations;
use volume::Roi;

/// Gives a splat the opacity of the mask at its mean, where the configuration says so.
pub(super) fn set_opacity(splat: &mut Splat, roi: &Roi, init: &Init) {
    if init.opacity_mask {
        splat.set_opacity(roi.trilinear(glam::Vec3::from_array(splat.mean).as_dvec3()) as f32);
    }
}

/// Returns the splat that all start from: without rotation, and with the configured opacity.
pub(super) fn prototype(init: &Init) -> Splat {
    let mut splat = Splat { rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
    splat.set_opacity(init.opacity);
    splat
}
