//! DICOM: a folder or a zip of slices, one file of several frames, or one slice, which stands for its series;
//! and the structures of a segmentation (DICOM-SEG) or a structure set (RTSTRUCT), as a mask.
//!
//! | file | what is there |
//! |---|---|
//! | `lengths` | the lengths that elements claim, checked before memory is taken for them |
//! | `header` | what a file says of its frames: place, size, units |
//! | `location` | where a file is: on disk, or in a zip |
//! | `find` | the files of a folder or a zip |
//! | `stacks` | frames that lie parallel to each other, as the entries of a list that one is chosen from |
//! | `geometry` | the planes of a stack in space: order, distance, gaps, tilt |
//! | `pixels` | stored values to intensities |
//! | `structures` | structures and their choice; their voxels as one mask |
//! | `segmentation`, `contours` | structures that are given as voxels, and as contours |
//! | `read` | all of it together |
//!
//! Nothing is resampled. Planes are sorted by their position along the normal of the slices, never by number.
//! A gantry tilt is a shear of the affine. Where slices are missing or uneven the grid has the planes between
//! them, and no value there (NaN). DICOM's patient axes point to the left, back and head (LPS); volumes are
//! in RAS.

mod contours;
mod find;
mod geometry;
mod header;
mod lengths;
mod location;
mod pixels;
mod read;
mod segmentation;
mod stacks;
mod structures;
#[cfg(test)]
mod tests;

pub(super) use location::is_zip;
pub use read::{list, read, structures};
pub use stacks::StackSummary;
pub use structures::Structure;

/// Name of the format.
pub const NAME: &str = "DICOM";
/// Name of the format of a zip of DICOM files.
pub const ZIP_NAME: &str = "zip of DICOM files";
/// Offset of the magic, after a preamble of any content.
const MAGIC_AT: usize = 128;
const MAGIC: &[u8] = b"DICM";

/// Returns true if this is the beginning of a DICOM file.
pub(super) fn sniff(head: &[u8]) -> bool {
    head.get(MAGIC_AT..MAGIC_AT + MAGIC.len()) == Some(MAGIC)
}
