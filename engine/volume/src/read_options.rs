//! Options for reading a volume.

use glam::DVec3;

use super::{Grid, LabelChoice};
use base::unit::Unit;

/// Options for reading a volume.
#[derive(Clone, Debug, PartialEq)]
pub struct ReadOptions {
    /// The largest decoded file, and the largest volume in memory (4 bytes a voxel), in bytes. The default of
    /// 2³¹ is a CT of 512 × 512 × 2047 voxels; a larger claim is more often a damaged header than a scan.
    pub max_bytes: u64,
    /// The volume of a series (4-D file) to read, counted from 0. Needed if there are several.
    pub volume_index: Option<usize>,
    /// The series of a DICOM folder to read: its number in the list of [`super::dicom::list`], its UID, or a
    /// part of its description. Needed if there are several.
    pub series: Option<String>,
    /// The resolution to read of a file that has several (OME-Zarr), counted from 0, the finest and the default.
    pub level: Option<usize>,
    /// The voxels to read, from the first up to the one before the last number along x, y and z; all if not given.
    pub voxels: Option<[[usize; 2]; 3]>,
    /// True if damage that leaves every voxel readable is accepted: bytes after the compressed data, a wrong
    /// checksum (a voxel may then be wrong), a broken header extension.
    pub lenient: bool,
    /// Distances of neighbouring voxels along x, y, z of a file that has none (a NumPy array), mm; 1 mm if not
    /// given.
    pub spacing_mm: Option<DVec3>,
    /// What the samples are numbers of, if the user says it: [`Unit::Hu`] or [`Unit::Arbitrary`].
    pub unit: Option<Unit>,
    /// The labels that will be chosen, if the file is a mask. The structures of a DICOM file may overlap, and
    /// a voxel has one label: of such a file only these are read.
    pub labels: LabelChoice,
    /// The grid of the volume that the file is a mask of, on which contours (RTSTRUCT) become voxels.
    pub grid: Option<Grid>,
    /// [`super::Volume::frame_of_reference`] of the volume that the file is a mask of.
    pub frame_of_reference: Option<String>,
}

/// One resolution of a file that has several.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Level {
    /// Voxel counts along x, y, z.
    pub size: [usize; 3],
    /// Distance of neighbouring voxels along x, y, z, mm.
    pub spacing_mm: [f64; 3],
    /// Voxels along x, y, z that are stored, and read, together.
    pub chunk: [usize; 3],
    /// Number of volumes, as of times and channels.
    pub volumes: usize,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions {
            max_bytes: 1 << 31,
            volume_index: None,
            series: None,
            level: None,
            voxels: None,
            lenient: false,
            spacing_mm: None,
            unit: None,
            labels: LabelChoice::Whole,
            grid: None,
            frame_of_reference: None,
        }
    }
}
