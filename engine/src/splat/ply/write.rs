//! Writing a splat set as PLY.

use std::io::Write;
use std::path::Path;

use super::{COLOUR_PROPERTIES, INTENSITY_ELEMENT, LABEL_PROPERTY, comments, reference, rest_property};
use crate::error::{Error, Kind, Result};
use crate::splat::harmonics::{MAX_DEGREE, SH0};
use crate::splat::{Harmonics, Kernel, Place, SplatSet, WriteOptions, defect};

/// Vertex properties as they are written, before and behind the colour.
const BEFORE: [&str; 6] = ["x", "y", "z", "nx", "ny", "nz"];
const BEHIND: [&str; 8] = ["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"];

/// Rows that are encoded before they are handed on.
pub(super) const BLOCK_ROWS: usize = 4096;

/// What the numbers of a PLY stand for.
#[derive(Debug)]
pub struct PlyLayout {
    /// Name on the command line and in what is told of a file.
    pub name: &'static str,
    /// In a few words, who reads it.
    pub about: &'static str,
    /// What programs that read it take κ to be; nothing where the file names it.
    pub kernel: Option<Kernel>,
    /// Fails where a set that could be written otherwise cannot be in this layout.
    check: fn(&SplatSet, Option<&Place>) -> Result<()>,
    /// Writes a set that was checked.
    encode: fn(&SplatSet, Option<&Place>, &mut dyn Write) -> std::io::Result<()>,
    /// What of a set does not come into the file.
    losses: fn(&SplatSet, Option<&Place>) -> Vec<String>,
}

/// Every layout that is written; the first is the usual one.
pub const PLY_LAYOUTS: &[PlyLayout] = &[
    PlyLayout {
        name: "vgs",
        about: "places in mm RAS and HU in a second element; what every other command and ordinary viewers read",
        kernel: None,
        check: |_, _| Ok(()),
        encode: |set, _, out| encode(set, out),
        losses: |_, _| Vec::new(),
    },
    PlyLayout {
        name: "reference",
        about: "that of the paper's authors, for their viewer: voxel index times spacing, opacity as a probability; \
                commands then need the volume beside it",
        kernel: Some(reference::KERNEL),
        check: reference::check,
        encode: reference::encode,
        losses: reference::losses,
    },
];

impl PlyLayout {
    /// The layout of this name.
    pub fn named(name: &str) -> Option<&'static PlyLayout> {
        PLY_LAYOUTS.iter().find(|layout| layout.name == name)
    }

    /// What of `set` does not come into a file of this layout, in words that go on after "without ".
    pub fn losses(&self, set: &SplatSet, place: Option<&Place>) -> Vec<String> {
        (self.losses)(set, place)
    }
}

/// Writes `set` whole or not at all. Refuses a set without splats, which other programs cannot open, and splats that a
/// reader would drop.
pub fn write(path: &Path, set: &SplatSet, options: &WriteOptions) -> Result<()> {
    let WriteOptions { layout, place, force } = options;
    check(set).and_then(|()| (layout.check)(set, place.as_ref())).map_err(|error| error.file(path))?;
    crate::output::write_atomic(path, *force, |out| (layout.encode)(set, place.as_ref(), out))
}

/// Bytes of the file that [`write()`] makes of `set`.
pub fn bytes(set: &SplatSet, options: &WriteOptions) -> Result<u64> {
    let WriteOptions { layout, place, .. } = options;
    (layout.check)(set, place.as_ref())?;
    let mut count = Count(0);
    // Counting cannot fail.
    let _ = (layout.encode)(set, place.as_ref(), &mut count);
    Ok(count.0)
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
