//! File formats of splat sets, and the options of reading and writing.

use std::path::Path;

use serde::Serialize;

use super::labels::LabelCount;
use super::ply::{PLY_LAYOUTS, PlyLayout};
use super::{Place, Region, SplatSet, Unplaced};
use base::error::Result;
use base::input::Input;
use base::unit::Unit;

/// How tolerant a reader is.
#[derive(Clone, Copy, Debug)]
pub struct ReadOptions {
    /// True if an unusable splat (a value that is not finite, a zero quaternion, an absurd scale) is an
    /// error; by default it is dropped, counted and logged.
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
pub struct WriteOptions<'a> {
    /// The layout of a PLY, a row of [`PLY_LAYOUTS`]; the first by default.
    pub layout: &'static PlyLayout,
    /// The volume that the set was fitted to, for layouts in units of its voxels.
    pub place: Option<Place>,
    /// The splats with intensities that the colours of the set were made of, row by row: a format of colours that
    /// can hold them besides does, so that this program reads them again.
    pub made_of: Option<&'a SplatSet>,
    /// Splats with intensities that go into the file whole, beside those with colours, so that this program reads these
    /// again; their number may be another. For formats that [can](super::check_live).
    pub live: Option<&'a SplatSet>,
    /// True if an existing file is replaced.
    pub force: bool,
}

impl Default for WriteOptions<'_> {
    fn default() -> Self {
        WriteOptions { layout: &PLY_LAYOUTS[0], place: None, made_of: None, live: None, force: false }
    }
}

/// Description of a splat file, for people and for scripts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the format, a row of [`FORMATS`](super::FORMATS).
    pub format: &'static str,
    /// How the numbers are stored, in the format's own words.
    pub encoding: String,
    /// Layout of the numbers: a row of [`PLY_LAYOUTS`], or "3dgs" for ordinary 3D Gaussian splatting and "2dgs" for
    /// its discs.
    pub layout: &'static str,
    /// Size of the file in bytes.
    pub file_bytes: u64,
    /// Number of usable splats.
    pub splats: usize,
    /// Number of splats that were dropped because a value is unusable.
    pub dropped: usize,
    /// Number of splats whose thin axes were widened, because they were longer than
    /// [`ANISOTROPY_LIMIT`](super::activation::ANISOTROPY_LIMIT) times their width.
    pub widened: usize,
    /// Elements of the file with their counts, in file order.
    pub elements: Vec<(String, u64)>,
    /// Properties of a splat, in file order.
    pub properties: Vec<String>,
    /// Name of the kernel; the Gaussian if the file names none.
    pub kernel: &'static str,
    /// What the intensities are numbers of.
    pub unit: Unit,
    /// Degree of the spherical harmonics of the colours; absent if the splats have an intensity.
    pub harmonics_degree: Option<u8>,
    /// The labels of the splats, ascending; empty if the file gives none.
    pub labels: Vec<LabelCount>,
    /// Least and greatest intensity, absent without splats.
    pub intensity_range: Option<[f32; 2]>,
    /// The intensities that 0 and 1 of `intensity_01` stand for, if the file gives them.
    pub intensity_01_range: Option<[f32; 2]>,
    /// Least and greatest mean, or centre of a coded voxel, along each axis, mm RAS with the origin added; absent if there
    /// are none
    /// or only a volume can place them.
    pub bounding_box_mm: Option<[[f64; 3]; 2]>,
    /// Least and greatest mean along each axis as voxel index times spacing, mm, if only a volume can place
    /// the splats.
    pub index_box_mm: Option<[[f64; 3]; 2]>,
    /// Origin of the means, mm RAS.
    pub origin_mm: [f64; 3],
    /// Background: V̂ where no splat reaches.
    pub background: f32,
    /// ε of eq. (2).
    pub epsilon: f32,
    /// w₀ of the occupancy.
    pub occupancy_w0: f32,
    /// Iterations of the fit, if the file gives them.
    pub iterations: Option<u32>,
    /// Voxels along x, y, z of the grid that the set was fitted on, if the file gives them.
    pub grid_size: Option<[u32; 3]>,
    /// Checksum of the samples of the volume that the set was fitted to, if the file gives it.
    pub volume_crc32: Option<u32>,
    /// Number of voxels of the region; absent if the set has none.
    pub region_voxels: Option<usize>,
    /// Greatest error of the intensities of voxels that are coded in place of splats; absent if none are.
    pub bound: Option<f64>,
    /// What the set was fitted for: the name of a [`Form`](super::Form), or "region" for a grid with a region.
    pub form: &'static str,
}

impl Summary {
    /// Creates the description of a set in a file; what only a reader knows is empty.
    pub(super) fn of_set(
        set: &SplatSet,
        format: &'static str,
        layout: &'static str,
        file_bytes: u64,
    ) -> Self {
        let origin_mm = set.origin_mm.to_array();
        let corners = set.region.as_ref().filter(|_| !set.voxels.is_empty()).map(Region::bounds);
        let voxels = corners.zip(set.grid).into_iter().flat_map(|([first, end], grid)| {
            let corner =
                move |i: usize| [0, 1, 2].map(|k| if i >> k & 1 > 0 { end[k] - 1 } else { first[k] });
            (0..8).map(move |i| grid.world_from_voxel.transform_point3(corner(i).map(f64::from).into()))
        });
        let voxels: Vec<[f64; 3]> = voxels.map(|corner| (corner - set.origin_mm).to_array()).collect();
        let axis = |k: usize| {
            let values = || {
                let means = set.splats.iter().map(|splat| f64::from(splat.mean[k]));
                means.chain(voxels.iter().map(|corner| corner[k]))
            };
            values().reduce(f64::min).zip(values().reduce(f64::max))
        };
        let corners = axis(0).zip(axis(1)).zip(axis(2)).map(|((x, y), z)| {
            [[x.0, y.0, z.0], [x.1, y.1, z.1]].map(|corner| std::array::from_fn(|k| corner[k] + origin_mm[k]))
        });
        Summary {
            format,
            encoding: String::new(),
            layout,
            file_bytes,
            splats: set.splats.len(),
            dropped: 0,
            widened: 0,
            elements: Vec::new(),
            properties: Vec::new(),
            kernel: set.field.kernel.name(),
            unit: set.unit,
            harmonics_degree: set.colours.as_ref().map(|colours| colours.degree),
            labels: set.label_counts(),
            intensity_range: set.intensity_range().map(|range| range.map(|v| v as f32)),
            intensity_01_range: None,
            bounding_box_mm: corners,
            index_box_mm: None,
            origin_mm,
            background: set.field.background,
            epsilon: set.field.epsilon,
            occupancy_w0: set.field.occupancy_w0,
            iterations: set.iterations,
            grid_size: set.grid.map(|grid| grid.size),
            volume_crc32: set.volume_crc32,
            region_voxels: set.region.as_ref().map(Region::voxel_count),
            bound: set.voxels.iter().map(|voxels| voxels.precision.bound()).reduce(f64::max),
            form: set.form_name(),
        }
    }
}

/// One file format of splat sets.
pub struct Format {
    /// Short name, also the usual extension.
    pub name: &'static str,
    /// True if the file rounds the splats, so that a fit should round them first.
    pub rounds: bool,
    /// True if the file holds colours: it is for programs that draw splats as they are.
    pub coloured: bool,
    /// True if the file holds intensities, so that a transfer function can act on what is read of it.
    pub physical: bool,
    /// True if it holds coded voxels ([`SplatSet::voxels`]).
    pub voxels: bool,
    /// True if a fit can go along with the splats with colours ([`WriteOptions::live`]).
    pub live: bool,
    /// How a file is read.
    pub reader: Reader,
    /// Writes a file atomically; replaces an existing one only if the options say so.
    pub write: fn(&Path, &SplatSet, &WriteOptions) -> Result<()>,
    /// Returns the size in bytes of the file that `write` makes.
    pub bytes: fn(&SplatSet, &WriteOptions) -> Result<u64>,
}

/// How files of a format are read.
pub struct Reader {
    /// Returns true if the first bytes of a file (up to [`SNIFF_BYTES`]) are of this format.
    pub sniff: fn(&[u8]) -> bool,
    /// Reads a file.
    pub read: fn(&Input, &ReadOptions) -> Result<Unplaced>,
    /// Reads a file and describes what it holds.
    pub describe: fn(&Input, &ReadOptions) -> Result<Summary>,
}

/// Number of leading bytes that [`Reader::sniff`] receives: enough to unpack the first of a gzip stream.
pub const SNIFF_BYTES: u64 = 1024;
