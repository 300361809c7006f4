//! The encoder of a PLY in this program's layout.

use std::io::Write;

use super::names::{COLOUR_PROPERTIES, INTENSITY_ELEMENT, LABEL_PROPERTY, rest_property};
use super::{comments, exceptions};
use crate::splat::SplatSet;
use crate::splat::harmonics::SH0;

/// Vertex properties as they are written, before and after the colour.
const BEFORE: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
const BEHIND: [&str; 8] = ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"];

/// Number of rows that are encoded at a time.
pub(super) const BLOCK_ROWS: usize = 4096;

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
    let exceptions = exceptions::bytes(&set.exceptions, set.grid.as_ref());
    writeln!(out, "{}end_header", exceptions::declared(exceptions.len()))?;

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
    out.write_all(&exceptions)
}

/// Returns the coefficients of one splat in the order of a file: degree 0 of the three channels, then the
/// rest channel by channel.
fn channel_major(coefficients: &[f32]) -> impl Iterator<Item = f32> {
    let (first, rest) = coefficients.split_at(3);
    let channel = |c: usize| rest.iter().skip(c).step_by(3);
    first.iter().chain((0..3).flat_map(channel)).copied()
}

/// Returns a function from intensity to grey in [0, 1]: a ramp over the intensities of the set, mid-grey if
/// all are equal. Luminances, which are no physical intensities, are their own grey.
fn grey_of_intensity(set: &SplatSet) -> impl Fn(f32) -> f32 + use<> {
    let (low, high) = if set.has_intensity {
        let intensities = set.splats.iter().map(|splat| f64::from(splat.intensity));
        intensities.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)))
    } else {
        (0.0, 1.0)
    };
    move |c| if high > low { ((f64::from(c) - low) / (high - low)) as f32 } else { 0.5 }
}
