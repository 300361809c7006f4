//! How splats look where flags say little.

use engine::render::{Intensities, Look, ObjectChange, UsualLook};
use engine::splat::SplatSet;
use engine::transfer;

use super::flags::Clip;

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

/// Changes the look of splats as flags have it: usual colours of objects, single objects, and what is cut away.
pub fn change<'a>(
    look: &mut Look,
    set: &SplatSet,
    object_colours: bool,
    objects: impl IntoIterator<Item = &'a ObjectChange>,
    clip: &[Clip],
) -> engine::Result<()> {
    let range = set.intensity_range().unwrap_or([0.0, 1.0]);
    let there = set.objects();
    if object_colours {
        look.tint_objects(&there);
    }
    for change in objects {
        change.apply(&there, look, range)?;
    }
    look.clip.extend(clip.iter().flat_map(|clip| clip.0.iter().copied()));
    Ok(())
}
