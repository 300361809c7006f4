//! What a file format of splat sets is, and how files are read and written.

use std::path::Path;

use serde::Serialize;

use super::labels::LabelCount;
use super::ply::{PLY_LAYOUTS, PlyLayout};
use super::{Place, SplatSet, Unplaced};
use crate::error::Result;

/// How forgiving a reader is.
#[derive(Clone, Copy, Debug)]
pub struct ReadOptions {
    /// Whether an unusable splat (a value that is not finite, a zero quaternion, an absurd scale) is an error; by
    /// default it is dropped, counted and logged.
    pub strict: bool,
    /// Files that declare more splats than this are refused before anything is allocated.
    pub max_splats: u64,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions { strict: false, max_splats: 200_000_000 }
    }
}

/// How a set is written.
#[derive(Clone, Copy, Debug)]
pub struct WriteOptions {
    /// What the numbers of a PLY stand for, a row of [`PLY_LAYOUTS`]; the first by default.
    pub layout: &'static PlyLayout,
    /// The volume that the set was fitted to, for layouts that count in its voxels.
    pub place: Option<Place>,
    /// Whether an existing file is replaced.
    pub force: bool,
}

impl Default for WriteOptions {
    fn default() -> Self {
        WriteOptions { layout: &PLY_LAYOUTS[0], place: None, force: false }
    }
}

/// What a splat file holds, for people and for scripts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the format, a row of [`FORMATS`](super::FORMATS).
    pub format: &'static str,
    /// How the numbers are stored, in the format's own words.
    pub encoding: String,
    /// What they stand for: a row of [`PLY_LAYOUTS`], or "3dgs" where it is that of ordinary 3D Gaussian splatting.
    pub layout: &'static str,
    /// Size of the file in bytes.
    pub file_bytes: u64,
    /// Usable splats.
    pub splats: usize,
    /// Splats that were dropped because a value is unusable.
    pub dropped: usize,
    /// Splats whose thin axes were widened, because they were longer than
    /// [`ANISOTROPY_LIMIT`](super::activation::ANISOTROPY_LIMIT) times their width.
    pub widened: usize,
    /// Elements of the file with their counts, in file order.
    pub elements: Vec<(String, u64)>,
    /// Properties of a splat, in file order.
    pub properties: Vec<String>,
    /// Name of the kernel; the Gaussian where the file says nothing.
    pub kernel: &'static str,
    /// Whether intensities are physical (HU) rather than the luminance of a colour.
    pub has_intensity: bool,
    /// Degree of the spherical harmonics of the colours; absent where the splats have an intensity.
    pub harmonics_degree: Option<u8>,
    /// The labels that splats have, ascending; empty where the file gives none.
    pub labels: Vec<LabelCount>,
    /// Least and greatest intensity, absent without splats.
    pub intensity_range: Option<[f32; 2]>,
    /// The intensities that 0 and 1 of `intensity_01` stand for, where the file says so.
    pub intensity_01_range: Option<[f32; 2]>,
    /// Least and greatest mean along each axis, mm RAS with the origin added; absent without splats, and where only a
    /// volume can place them.
    pub bounding_box_mm: Option<[[f64; 3]; 2]>,
    /// The same as voxel index times spacing, mm, of a file whose splats only a volume can place.
    pub index_box_mm: Option<[[f64; 3]; 2]>,
    /// Origin of the means, mm RAS.
    pub origin_mm: [f64; 3],
    /// V̂ where no splat reaches.
    pub background: f32,
    /// ε of eq. (2).
    pub epsilon: f32,
    /// w₀ of the occupancy.
    pub occupancy_w0: f32,
    /// Iterations of the fit, where the file says so.
    pub iterations: Option<u32>,
    /// Voxels along x, y, z of the grid that the set was fitted on, where the file says so.
    pub grid_size: Option<[u32; 3]>,
    /// What it was fitted for: the name of a [`Form`](super::Form).
    pub form: &'static str,
}

/// One file format of splat sets.
pub struct Format {
    /// Short name, also the usual extension.
    pub name: &'static str,
    /// Whether the first bytes of a file (up to [`SNIFF_BYTES`]) are of this format.
    pub sniff: fn(&[u8]) -> bool,
    /// Reads a file.
    pub read: fn(&Path, &ReadOptions) -> Result<Unplaced>,
    /// Writes a file whole or not at all; an existing one is replaced only if the options say so.
    pub write: fn(&Path, &SplatSet, &WriteOptions) -> Result<()>,
    /// Bytes of the file that it writes.
    pub bytes: fn(&SplatSet, &WriteOptions) -> Result<u64>,
    /// Reads a file and tells what it holds.
    pub describe: fn(&Path, &ReadOptions) -> Result<Summary>,
}

/// How many leading bytes a [`Format::sniff`] gets to see.
pub const SNIFF_BYTES: u64 = 16;
