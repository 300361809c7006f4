//! The encoder of a PLY with physical intensities, in the order of its columns and elements.

use std::io::Write;

use super::names::{COLOUR_PROPERTIES, INTENSITY_ELEMENT, INTENSITY_PROPERTY, LABEL_PROPERTY, rest_property};
use super::{comments, region};
use crate::harmonics::{MAX_BASIS, SH0, basis_count};
use crate::{Harmonics, Region, SplatSet};

/// Vertex properties as they are written, before and after the colour.
const BEFORE: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
const BEHIND: [&str; 8] = ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"];

/// Number of rows that are encoded at a time.
pub(super) const BLOCK_ROWS: usize = 4096;

/// What the row of a vertex has.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Row {
    /// The properties of ordinary 3D Gaussian splatting, then intensity and label, all of them floats.
    Named,
    /// The 62 floats of the INRIA code and no others. Intensity and label have an element of their own, whose
    /// types are none that a reader of floats counts as its own.
    Fixed,
}

/// Writes `set` with such rows.
pub(super) fn encode(set: &SplatSet, shape: Row, out: &mut dyn Write) -> std::io::Result<()> {
    let count = set.splats.len();
    let degree = set.colours.as_ref().map_or(0, |colours| colours.degree);
    let basis = if shape == Row::Fixed { MAX_BASIS } else { basis_count(degree) };
    // The intensity of a set with colours is their luminance: reading it gives it back.
    let with_intensity = set.colours.is_none();
    let beside =
        [(with_intensity, INTENSITY_PROPERTY, "double"), (set.labels.is_some(), LABEL_PROPERTY, "uchar")];
    let beside = || beside.iter().filter(|(there, ..)| *there);

    let mut names: Vec<String> =
        BEFORE.iter().chain(&COLOUR_PROPERTIES).map(|&name| name.to_owned()).collect();
    names.extend((0..3 * (basis - 1)).map(rest_property));
    names.extend(BEHIND.map(str::to_owned));
    if shape == Row::Named {
        names.extend(beside().map(|(_, name, _)| (*name).to_owned()));
    }
    let properties: String = names.iter().map(|name| format!("property float {name}\n")).collect();
    let comments = comments::of_set(set);
    write!(out, "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{properties}{comments}")?;
    let apart = shape == Row::Fixed && beside().next().is_some();
    if apart {
        let properties: String =
            beside().map(|(_, name, kind)| format!("property {kind} {name}\n")).collect();
        write!(out, "element {INTENSITY_ELEMENT} {count}\n{properties}")?;
    }
    let bytes = set.region.as_ref().map(Region::encode);
    if let Some(bytes) = &bytes {
        write!(out, "{}", region::declared(bytes.len()))?;
    }
    writeln!(out, "end_header")?;

    let grey = grey_of_intensity(set);
    let mut row = Vec::with_capacity(names.len());
    let mut block = Vec::new();
    for first in (0..count).step_by(BLOCK_ROWS) {
        block.clear();
        for (i, splat) in set.splats.iter().enumerate().skip(first).take(BLOCK_ROWS) {
            row.clear();
            row.extend(splat.mean);
            row.extend([0.0; 3]);
            match &set.colours {
                Some(colours) => push_channels(colours, i, basis, &mut row),
                None => {
                    row.extend([(grey(splat.intensity) - 0.5) / SH0; 3]);
                    row.resize(row.len() + 3 * (basis - 1), 0.0);
                }
            }
            row.push(splat.opacity_logit);
            row.extend(splat.log_scale);
            row.extend(splat.rotation);
            if shape == Row::Named {
                row.extend(with_intensity.then_some(splat.intensity));
                row.extend(set.labels.as_ref().map(|labels| f32::from(labels[i])));
            }
            block.extend(row.iter().flat_map(|v: &f32| v.to_le_bytes()));
        }
        out.write_all(&block)?;
    }
    for first in (0..count).step_by(BLOCK_ROWS).filter(|_| apart) {
        block.clear();
        for (i, splat) in set.splats.iter().enumerate().skip(first).take(BLOCK_ROWS) {
            if with_intensity {
                block.extend(f64::from(splat.intensity).to_le_bytes());
            }
            block.extend(set.labels.as_ref().map(|labels| labels[i]));
        }
        out.write_all(&block)?;
    }
    out.write_all(&bytes.unwrap_or_default())
}

/// Appends the coefficients of splat `i` in the order of a file: degree 0 of the three channels, then `basis`
/// less one of each channel, zeros where the set has fewer.
fn push_channels(colours: &Harmonics, i: usize, basis: usize, row: &mut Vec<f32>) {
    let (first, rest) = colours.of(i).split_at(3);
    row.extend(first);
    for channel in 0..3 {
        let end = row.len() + basis - 1;
        row.extend(rest.iter().skip(channel).step_by(3));
        row.resize(end, 0.0);
    }
}

/// Returns a function from intensity to grey in [0, 1]: a ramp over the intensities of the set, mid-grey if
/// all are equal. Luminances, which are no physical intensities, are their own grey.
fn grey_of_intensity(set: &SplatSet) -> impl Fn(f32) -> f32 + use<> {
    let (low, high) = if set.unit.is_physical() {
        let intensities = set.splats.iter().map(|splat| f64::from(splat.intensity));
        intensities.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), c| (low.min(c), high.max(c)))
    } else {
        (0.0, 1.0)
    };
    move |c| if high > low { ((f64::from(c) - low) / (high - low)) as f32 } else { 0.5 }
}
