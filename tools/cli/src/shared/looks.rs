//! How splats look where flags say little.

use engine::render::{Intensities, Look, UsualLook};
use engine::splat::SplatSet;
use engine::transfer;

/// Returns the look of splats with the transfer function called `name`, for all of them; without a name the usual look
/// of several objects, and otherwise a preset that shows something.
pub fn look_of(set: &SplatSet, name: Option<&str>) -> engine::Result<Look> {
    let range = set.intensity_range().unwrap_or([0.0, 1.0]);
    if let Some(name) = name {
        return Ok(Look::new(transfer::load(name, range)?));
    }
    match UsualLook::of(set) {
        Some(usual) => Ok(usual.look(&set.objects())),
        None => Ok(Look::new(transfer::load(Intensities::of_set(set).suiting_preset(set.unit), range)?)),
    }
}
