//! Options for reading a volume.

/// Options for reading a volume.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadOptions {
    /// The largest decoded file, and the largest volume in memory (4 bytes a voxel), in bytes. The default of
    /// 2³¹ is a CT of 512 × 512 × 2047 voxels; a larger claim is more often a damaged header than a scan.
    pub max_bytes: u64,
    /// The volume of a series (4-D file) to read, counted from 0. Needed if there are several.
    pub volume_index: Option<usize>,
    /// The series of a DICOM folder to read: its number in the list of [`super::dicom::list`], its UID, or a
    /// part of its description. Needed if there are several.
    pub series: Option<String>,
    /// True if damage that leaves every voxel readable is accepted: bytes after the compressed data, a wrong
    /// checksum (a voxel may then be wrong), a broken header extension.
    pub lenient: bool,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions { max_bytes: 1 << 31, volume_index: None, series: None, lenient: false }
    }
}
