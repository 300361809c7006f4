//! The PLY writer.

use std::path::Path;

use super::comments;
use crate::harmonics::MAX_DEGREE;
use crate::{Harmonics, SplatSet, WriteOptions, defect};
use base::error::{Error, Kind, Result};
use base::output::counted;

/// Writes `set` atomically. Refuses a set without splats, which other programs cannot open, and splats that a
/// reader would drop.
pub fn write(path: &Path, set: &SplatSet, options: &WriteOptions) -> Result<()> {
    let WriteOptions { layout, place, force, .. } = options;
    check(set).and_then(|()| (layout.check)(set, place.as_ref())).map_err(|error| error.file(path))?;
    base::output::write_atomic(path, *force, |out| (layout.encode)(set, place.as_ref(), out))
}

/// Returns the size in bytes of the file that [`write()`] makes of `set`.
pub fn bytes(set: &SplatSet, options: &WriteOptions) -> Result<u64> {
    let WriteOptions { layout, place, .. } = options;
    (layout.check)(set, place.as_ref())?;
    Ok(counted(|out| (layout.encode)(set, place.as_ref(), out)))
}

/// Refuses a set that no file may hold.
pub(crate) fn check(set: &SplatSet) -> Result<()> {
    if set.is_empty() {
        return Err(Error::new(Kind::NothingToDo, "VGS-PLY-011", "there are no splats to write"));
    }
    let broken = |what: String| Err(Error::new(Kind::Internal, "VGS-PLY-012", what));
    if let Some((index, why)) = set.splats.iter().enumerate().find_map(|(i, s)| Some((i, defect(s)?))) {
        return broken(format!("splat {index} cannot be written: {why}"));
    }
    let defect = comments::defect(&set.field, set.origin_mm)
        .or_else(|| set.grid.and_then(|grid| grid.defect()))
        .or_else(|| set.region.as_ref().and_then(|region| region.defect(set.grid.as_ref())))
        .or_else(|| set.label_defect())
        .or_else(|| set.colours.as_ref().and_then(|colours| colour_defect(colours, set)));
    match defect {
        Some(why) => broken(format!("the set cannot be written: {why}")),
        None => Ok(()),
    }
}

/// Returns why these colours cannot be written, or `None` if they can.
fn colour_defect(colours: &Harmonics, set: &SplatSet) -> Option<&'static str> {
    let conditions = [
        (!set.unit.is_physical(), "it has colours beside physical intensities"),
        (colours.degree <= MAX_DEGREE, "the degree of its harmonics is above 3"),
        (
            colours.coefficients.len() == colours.stride() * set.splats.len(),
            "there are not harmonics for every splat",
        ),
        (colours.coefficients.iter().all(|c| c.is_finite()), "a harmonic is not finite"),
    ];
    conditions.iter().find_map(|&(good, why)| (!good).then_some(why))
}
