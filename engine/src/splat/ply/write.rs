//! Writing a splat set as PLY.

use std::io::Write;
use std::path::Path;

use super::{INTENSITY_ELEMENT, SH0, comments};
use crate::error::{Error, Kind, Result};
use crate::splat::{SplatSet, defect};

/// Vertex properties as they are written.
const PROPERTIES: [&str; 17] = [
    "x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1",
    "scale_2", "rot_0", "rot_1", "rot_2", "rot_3",
];

/// Rows that are encoded before they are handed on.
const BLOCK_ROWS: usize = 4096;

/// Writes `set` whole or not at all; an existing file is replaced only with `force`. Refuses a set without splats,
/// which other programs cannot open, and splats that a reader would drop.
pub fn write(path: &Path, set: &SplatSet, force: bool) -> Result<()> {
    check(set).map_err(|error| error.file(path))?;
    crate::output::write_atomic(path, force, |out| encode(set, out))
}

pub(super) fn check(set: &SplatSet) -> Result<()> {
    if set.splats.is_empty() {
        return Err(Error::new(Kind::NothingToDo, "VGS-PLY-011", "there are no splats to write"));
    }
    let broken = |what: String| Err(Error::new(Kind::Internal, "VGS-PLY-012", what));
    if let Some((index, why)) = set.splats.iter().enumerate().find_map(|(i, s)| Some((i, defect(s)?))) {
        return broken(format!("splat {index} cannot be written: {why}"));
    }
    match comments::defect(&set.field, set.origin_mm) {
        Some(why) => broken(format!("the set cannot be written: {why}")),
        None => Ok(()),
    }
}

pub(super) fn encode(set: &SplatSet, out: &mut dyn Write) -> std::io::Result<()> {
    let count = set.splats.len();
    let properties: String = PROPERTIES.iter().map(|name| format!("property float {name}\n")).collect();
    let comments = comments::of_set(set);
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}{comments}\
         element {INTENSITY_ELEMENT} {count}\nproperty float intensity\nend_header\n"
    )?;

    let grey = grey_of_intensity(set);
    let mut block = Vec::with_capacity(BLOCK_ROWS * PROPERTIES.len() * 4);
    for rows in set.splats.chunks(BLOCK_ROWS) {
        block.clear();
        for splat in rows {
            let [x, y, z] = splat.mean;
            let [s0, s1, s2] = splat.log_scale;
            let [w, i, j, k] = splat.rotation;
            let g = (grey(splat.intensity) - 0.5) / SH0;
            let row = [x, y, z, 0.0, 0.0, 0.0, g, g, g, splat.opacity_logit, s0, s1, s2, w, i, j, k];
            block.extend(row.iter().flat_map(|v: &f32| v.to_le_bytes()));
        }
        out.write_all(&block)?;
    }
    for rows in set.splats.chunks(BLOCK_ROWS) {
        block.clear();
        block.extend(rows.iter().flat_map(|splat| splat.intensity.to_le_bytes()));
        out.write_all(&block)?;
    }
    Ok(())
}

/// Grey in [0, 1] of an intensity: the black-white ramp over the range of the set, mid-grey where all are equal. A
/// luminance is its own grey.
fn grey_of_intensity(set: &SplatSet) -> impl Fn(f32) -> f32 + use<> {
    let (low, high) = if set.has_intensity {
        let intensities = set.splats.iter().map(|splat| f64::from(splat.intensity));
        intensities.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)))
    } else {
        (0.0, 1.0)
    };
    move |c| if high > low { ((f64::from(c) - low) / (high - low)) as f32 } else { 0.5 }
}
