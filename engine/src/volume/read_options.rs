//! How a volume is read.

/// How a volume is read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadOptions {
    /// The largest decoded file, and the largest volume in memory (4 bytes a voxel), in bytes. The default of
    /// 2³¹ is a CT of 512 × 512 × 2047 voxels; a larger claim is more often a damaged header than a scan.
    pub max_bytes: u64,
    /// Which volume of a series (4-D file) to read, counted from 0. Needed if there are several.
    pub volume_index: Option<usize>,
    /// Which series of a DICOM folder to read: its number in the list of [`super::dicom::list`], its UID, or a
    /// part of its description. Needed if there are several.
    pub series: Option<String>,
    /// Accept damage that leaves every voxel readable: bytes after the compressed data, a wrong checksum
    /// (then a voxel may be wrong), a broken header extension.
    pub lenient: bool,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions { max_bytes: 1 << 31, volume_index: None, series: None, lenient: false }
    }
}
