//! Writing a splat set as PLY.

use std::io::Write;
use std::path::Path;

use super::{COLOUR_PROPERTIES, INTENSITY_ELEMENT, LABEL_PROPERTY, comments, rest_property};
use crate::error::{Error, Kind, Result};
use crate::splat::harmonics::{MAX_DEGREE, SH0};
use crate::splat::{Harmonics, SplatSet, defect};

/// Vertex properties as they are written, before and behind the colour.
const BEFORE: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
const BEHIND: [&str; 8] = ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"];

/// Rows that are encoded before they are handed on.
const BLOCK_ROWS: usize = 4096;

/// Writes `set` whole or not at all; an existing file is replaced only with `force`. Refuses a set without splats,
/// which other programs cannot open, and splats that a reader would drop.
pub fn write(path: &Path, set: &SplatSet, force: bool) -> Result<()> {
    check(set).map_err(|error| error.file(path))?;
    crate::output::write_atomic(path, force, |out| encode(set, out))
}

/// Bytes of the file that [`write()`] makes of `set`.
pub fn bytes(set: &SplatSet) -> u64 {
    let mut count = Count(0);
    // Counting cannot fail.
    let _ = encode(set, &mut count);
    count.0
}

/// Where bytes are counted and go no further.
struct Count(u64);

impl Write for Count {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0 += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

pub(super) fn check(set: &SplatSet) -> Result<()> {
    if set.splats.is_empty() {
        return Err(Error::new(Kind::NothingToDo, "VGS-PLY-011", "there are no splats to write"));
    }
    let broken = |what: String| Err(Error::new(Kind::Internal, "VGS-PLY-012", what));
    if let Some((index, why)) = set.splats.iter().enumerate().find_map(|(i, s)| Some((i, defect(s)?))) {
        return broken(format!("splat {index} cannot be written: {why}"));
    }
    let defect = comments::defect(&set.field, set.origin_mm)
        .or_else(|| set.grid.and_then(|grid| grid.defect()))
        .or_else(|| set.label_defect())
        .or_else(|| set.colours.as_ref().and_then(|colours| colour_defect(colours, set)));
    match defect {
        Some(why) => broken(format!("the set cannot be written: {why}")),
        None => Ok(()),
    }
}

/// Why these colours cannot be written, or nothing if they can.
fn colour_defect(colours: &Harmonics, set: &SplatSet) -> Option<&'static str> {
    let conditions = [
        (!set.has_intensity, "it has colours beside physical intensities"),
        (colours.degree <= MAX_DEGREE, "the degree of its harmonics is above 3"),
        (
            colours.coefficients.len() == colours.stride() * set.splats.len(),
            "there are not harmonics for every splat",
        ),
        (colours.coefficients.iter().all(|c| c.is_finite()), "a harmonic is not finite"),
    ];
    conditions.iter().find_map(|&(good, why)| (!good).then_some(why))
}

pub(super) fn encode(set: &SplatSet, out: &mut dyn Write) -> std::io::Result<()> {
    let count = set.splats.len();
    let declared = |name: &str| format!("property float {name}\n");
    let rest_count = set.colours.as_ref().map_or(0, |colours| colours.stride() - 3);
    let rest: String = (0..rest_count).map(|index| declared(&rest_property(index))).collect();
    let [before, colour, behind] = [&BEFORE[..], &COLOUR_PROPERTIES[..], &BEHIND[..]]
        .map(|names| names.iter().copied().map(declared).collect::<String>());
    let comments = comments::of_set(set);
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{before}{colour}{rest}{behind}{comments}"
    )?;
    // The intensity of a set with colours is their luminance: reading it gives it back.
    let with_intensity = set.colours.is_none();
    if with_intensity || set.labels.is_some() {
        writeln!(out, "element {INTENSITY_ELEMENT} {count}")?;
    }
    if with_intensity {
        writeln!(out, "property float intensity")?;
    }
    if set.labels.is_some() {
        writeln!(out, "property uchar {LABEL_PROPERTY}")?;
    }
    writeln!(out, "end_header")?;

    let grey = grey_of_intensity(set);
    let mut row = Vec::new();
    let mut block = Vec::new();
    for first in (0..count).step_by(BLOCK_ROWS) {
        block.clear();
        for (i, splat) in set.splats.iter().enumerate().skip(first).take(BLOCK_ROWS) {
            let [x, y, z] = splat.mean;
            let [s0, s1, s2] = splat.log_scale;
            let [w, i_axis, j_axis, k_axis] = splat.rotation;
            row.clear();
            row.extend([x, y, z, 0.0, 0.0, 0.0]);
            match &set.colours {
                Some(colours) => row.extend(channel_major(colours.of(i))),
                None => row.extend([(grey(splat.intensity) - 0.5) / SH0; 3]),
            }
            row.extend([splat.opacity_logit, s0, s1, s2, w, i_axis, j_axis, k_axis]);
            block.extend(row.iter().flat_map(|v: &f32| v.to_le_bytes()));
        }
        out.write_all(&block)?;
    }
    for first in (0..count).step_by(BLOCK_ROWS) {
        block.clear();
        for (i, splat) in set.splats.iter().enumerate().skip(first).take(BLOCK_ROWS) {
            if with_intensity {
                block.extend(splat.intensity.to_le_bytes());
            }
            block.extend(set.labels.as_ref().map(|labels| labels[i]));
        }
        out.write_all(&block)?;
    }
    Ok(())
}

/// The coefficients of one splat as a file has them: degree 0 of the three channels, then the rest channel by channel.
fn channel_major(coefficients: &[f32]) -> impl Iterator<Item = f32> {
    let (first, rest) = coefficients.split_at(3);
    let channel = |c: usize| rest.iter().skip(c).step_by(3);
    first.iter().chain((0..3).flat_map(channel)).copied()
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
