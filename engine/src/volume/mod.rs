//! Voxel volumes and regions of interest.
//!
//! Spaces: *voxel* space has voxel centres at integer coordinates, x fastest in memory; *world* space is patient
//! millimetres, RAS: x grows to the patient's right, y to the front, z to the head.

pub mod bricks;
pub mod compare;
pub mod distance;
pub mod inv3;
mod labels;
pub mod nifti;
pub mod phantom;
pub mod resample;
mod roi;
mod source;

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DAffine3, DVec3};

use crate::{Error, Kind, Result};
pub use bricks::Bricks;
pub use labels::Labels;
pub use roi::{LabelChoice, Roi};
use source::Source;

/// A scalar volume on a regular grid.
#[derive(Clone, Debug)]
pub struct Volume {
    /// Voxel counts along x, y, z.
    pub size: [usize; 3],
    /// Voxel index (centres at integers) to world, mm RAS. May be oblique, sheared or left-handed.
    pub world_from_voxel: DAffine3,
    /// Samples, x fastest: HU for CT, the stored unit otherwise. Length is the product of `size`. May hold NaN and
    /// infinities where the file does.
    pub samples: Vec<f32>,
    /// Whether the file says how the patient lies. If not, the axes are those of the grid and left and right are
    /// unknown.
    pub oriented: bool,
    /// Names of label values, where the file carries them.
    pub labels: BTreeMap<i32, String>,
}

/// How a volume is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadOptions {
    /// The largest decoded file, and the largest volume in memory (4 bytes a voxel), in bytes. The default of 2³¹
    /// is a CT of 512 × 512 × 2047 voxels; a larger claim is more often a damaged header than a scan.
    pub max_bytes: u64,
    /// Which volume of a series (4-D file) to read, counted from 0. Needed if there are several.
    pub volume_index: Option<usize>,
    /// Accept damage that leaves every voxel readable: bytes after the compressed data, a wrong checksum (then a
    /// voxel may be wrong), a broken header extension.
    pub lenient: bool,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions { max_bytes: 1 << 31, volume_index: None, lenient: false }
    }
}

/// A file format that [`Volume::read`] knows.
pub struct Format {
    /// Name for messages.
    pub name: &'static str,
    /// Lower-case name endings, with the dot.
    pub extensions: &'static [&'static str],
    /// Whether the first [`SNIFF_BYTES`] decoded bytes (or fewer, in a shorter file) are of this format.
    sniff: fn(&[u8]) -> bool,
    read: fn(&Path, &ReadOptions) -> Result<Volume>,
}

/// How much of a file is looked at to recognise it.
pub const SNIFF_BYTES: usize = 1024;

/// Every format; the content decides, and the name only where the content is not recognised.
pub const FORMATS: &[Format] = &[
    Format {
        name: "NIfTI",
        extensions: &[".nii", ".nii.gz", ".hdr", ".hdr.gz", ".img", ".img.gz"],
        sniff: nifti::sniff,
        read: nifti::read,
    },
    Format { name: "InVesalius project", extensions: &[".inv3"], sniff: inv3::sniff, read: inv3::read },
];

/// Summary of the samples of a volume.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stats {
    /// How many samples are finite; the other fields are over these.
    pub finite: usize,
    /// How many samples are NaN or infinite.
    pub non_finite: usize,
    /// Smallest sample; 0 if none is finite.
    pub min: f32,
    /// Largest sample; 0 if none is finite.
    pub max: f32,
    /// Mean; 0 if none is finite.
    pub mean: f64,
    /// Population standard deviation; 0 if none is finite.
    pub std_dev: f64,
}

impl Volume {
    /// A volume of known orientation and without label names. `samples` has x fastest.
    ///
    /// # Panics
    /// If the number of samples is not the product of `size`.
    pub fn new(size: [usize; 3], world_from_voxel: DAffine3, samples: Vec<f32>) -> Self {
        assert_eq!(samples.len(), size.iter().product::<usize>(), "one sample for every voxel");
        Volume { size, world_from_voxel, samples, oriented: true, labels: BTreeMap::new() }
    }

    /// Reads a volume in any of the [`FORMATS`]. What is odd but readable is warned about.
    ///
    /// # Errors
    /// [`Kind::Missing`], [`Kind::BadData`], [`Kind::Usage`] (a volume of a series must be chosen),
    /// [`Kind::HostMemory`] or [`Kind::Io`].
    pub fn read(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Volume> {
        let path = path.as_ref();
        let mut head = vec![0; SNIFF_BYTES];
        let n = Source::open(path, options.lenient)?.read_some(&mut head)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        let format = FORMATS
            .iter()
            .find(|f| (f.sniff)(&head[..n]))
            .or_else(|| FORMATS.iter().find(|f| f.extensions.iter().any(|e| name.ends_with(e))))
            .ok_or_else(|| {
                let known: Vec<_> =
                    FORMATS.iter().map(|f| format!("{} ({})", f.name, f.extensions.join(" "))).collect();
                Error::new(Kind::BadData, "VGS-VOL-009", "not a volume in a known format")
                    .file(path)
                    .help(format!("known formats: {}", known.join(", ")))
            })?;
        (format.read)(path, options)
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        self.samples.len()
    }

    /// Whether there is no voxel.
    pub fn is_empty(&self) -> bool {
        self.samples.is_empty()
    }

    /// Place of voxel (x, y, z) in `samples`.
    pub fn index(&self, x: usize, y: usize, z: usize) -> usize {
        debug_assert!(x < self.size[0] && y < self.size[1] && z < self.size[2]);
        x + self.size[0] * (y + self.size[1] * z)
    }

    /// World (mm RAS) to voxel space.
    pub fn voxel_from_world(&self) -> DAffine3 {
        self.world_from_voxel.inverse()
    }

    /// Distance between neighbouring voxel centres along each voxel axis, mm.
    pub fn spacing_mm(&self) -> DVec3 {
        spacing_of(&self.world_from_voxel)
    }

    /// The direction in which each voxel index grows, as "RAS" or "LPS"; "???" if the orientation is unknown.
    pub fn axis_codes(&self) -> String {
        if self.oriented { axis_codes_of(&self.world_from_voxel) } else { "???".into() }
    }

    /// Trilinear interpolation at a point in voxel space, clamped to the grid: beyond the edge the edge value.
    pub fn trilinear(&self, voxel: DVec3) -> f64 {
        trilinear(self.size, voxel, |i| f64::from(self.samples[i]))
    }

    /// Trilinear sample at `x` (voxel space), clamped to the edge, each voxel first clipped to `clip`; a voxel that is
    /// not finite counts as `idle`.
    pub fn sample_clipped(&self, x: DVec3, clip: (f32, f32), idle: f32) -> f64 {
        trilinear(self.size, x, |i| {
            let v = self.samples[i];
            f64::from(if v.is_finite() { v.clamp(clip.0, clip.1) } else { idle })
        })
    }

    /// Smallest and largest finite sample; `None` if there is none.
    pub fn min_max(&self) -> Option<(f32, f32)> {
        let finite = || self.samples.iter().copied().filter(|v| v.is_finite());
        Some((finite().reduce(f32::min)?, finite().reduce(f32::max)?))
    }

    /// Whether intensities look like Hounsfield units: air at about -1000 tells a CT from everything else.
    pub fn is_ct(&self) -> bool {
        self.min_max().is_some_and(|(low, _)| low < -200.0)
    }

    /// What follows an intensity in texts: " HU" for a CT, nothing for a volume without a scale of its own.
    pub fn unit(&self) -> &'static str {
        if self.is_ct() { " HU" } else { "" }
    }

    /// Counts, range, mean and spread of the samples, in two passes of f64.
    pub fn gather_stats(&self) -> Stats {
        let finite = || self.samples.iter().copied().filter(|v| v.is_finite()).map(f64::from);
        let n = finite().count();
        let (min, max) = self.min_max().unwrap_or_default();
        let over = n.max(1) as f64;
        let mean = finite().sum::<f64>() / over;
        let variance = finite().map(|v| (v - mean).powi(2)).sum::<f64>() / over;
        Stats { finite: n, non_finite: self.len() - n, min, max, mean, std_dev: variance.sqrt() }
    }

    /// The eight corners of the box of all voxels, in world mm: half a voxel beyond the outermost centres. Corner
    /// `i` is at the far end of axis `a` if bit `a` of `i` is set.
    pub fn world_corners(&self) -> [DVec3; 8] {
        self.voxel_corners().map(|c| self.world_from_voxel.transform_point3(c))
    }

    /// The same corners in voxel space.
    fn voxel_corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            DVec3::from_array(std::array::from_fn(|a| {
                if i >> a & 1 == 1 { self.size[a] as f64 - 0.5 } else { -0.5 }
            }))
        })
    }
}

/// Trilinear sample of a grid at `x` (voxel space), clamped to the edge: what every volume renderer shows. `at` gives
/// the value of a voxel by its place in memory, x fastest.
pub fn trilinear(size: [usize; 3], x: DVec3, at: impl Fn(usize) -> f64) -> f64 {
    let last = DVec3::from_array(size.map(|n| n as f64 - 1.0));
    let p = x.clamp(DVec3::ZERO, last);
    let low = p.floor();
    let f = p - low;
    let low = low.to_array().map(|c| c as usize);
    let high: [usize; 3] = std::array::from_fn(|axis| (low[axis] + 1).min(size[axis] - 1));
    let row = |y: usize, z: usize| {
        let base = (z * size[1] + y) * size[0];
        lerp(at(base + low[0]), at(base + high[0]), f.x)
    };
    let slice = |z: usize| lerp(row(low[1], z), row(high[1], z), f.y);
    lerp(slice(low[2]), slice(high[2]), f.z)
}

/// Linear interpolation that gives the ends exactly, and a NaN end only where it has weight.
fn lerp(a: f64, b: f64, t: f64) -> f64 {
    if t == 0.0 { a } else { a + (b - a) * t }
}

/// Length of each column of an affine.
pub(crate) fn spacing_of(affine: &DAffine3) -> DVec3 {
    let m = affine.matrix3;
    DVec3::new(m.x_axis.length(), m.y_axis.length(), m.z_axis.length())
}

/// For each voxel axis the letter of the anatomical direction that it is closest to. Every direction is used once:
/// the clearest axis chooses first.
fn axis_codes_of(affine: &DAffine3) -> String {
    let m = affine.matrix3;
    let columns = [m.x_axis, m.y_axis, m.z_axis].map(|c| c.normalize_or_zero().to_array());
    let mut codes = ['?'; 3];
    let (mut axes, mut directions) = (vec![0, 1, 2], vec![0, 1, 2]);
    while !axes.is_empty() {
        let strength = |&(a, d): &(usize, usize)| columns[a][d].abs();
        let (a, d) = axes
            .iter()
            .flat_map(|&a| directions.iter().map(move |&d| (a, d)))
            .max_by(|p, q| strength(p).total_cmp(&strength(q)))
            .expect("an axis and a direction are left");
        codes[a] = if columns[a][d] > 0.0 { ['R', 'A', 'S'][d] } else { ['L', 'P', 'I'][d] };
        axes.retain(|&x| x != a);
        directions.retain(|&x| x != d);
    }
    codes.iter().collect()
}

/// Room for `count` samples, or an error that says how much was asked for.
fn reserve_samples(count: usize) -> Result<Vec<f32>> {
    let mut samples = Vec::new();
    samples.try_reserve_exact(count).map_err(|_| {
        Error::new(
            Kind::HostMemory,
            "VGS-VOL-010",
            format!("no memory for a volume of {} bytes", 4 * count as u64),
        )
    })?;
    Ok(samples)
}

#[cfg(test)]
mod tests;
