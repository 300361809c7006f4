//! DICOM: a folder of slices, one file of several frames, or one slice, which stands for its series.
//!
//! | file | what is there |
//! |---|---|
//! | `header` | what a file says of its frames: place, size, units |
//! | `find` | the files of a folder |
//! | `stacks` | frames that lie parallel to each other, as the entries of a list that one is chosen from |
//! | `geometry` | the planes of a stack in space: order, distance, gaps, tilt |
//! | `pixels` | stored values to intensities |
//! | `read` | all of it together |
//!
//! Nothing is resampled. Planes are sorted by their position along the normal of the slices, never by number.
//! A gantry tilt is a shear of the affine. Where slices are missing or uneven the grid has the planes between
//! them, and no value there (NaN). DICOM's patient axes point to the left, back and head (LPS); volumes are
//! in RAS.

mod find;
mod geometry;
mod header;
mod pixels;
mod read;
mod stacks;
#[cfg(test)]
mod tests;

pub use read::{list, read};
pub use stacks::StackSummary;

/// Name of the format.
pub const NAME: &str = "DICOM";
/// Offset of the magic, after a preamble of any content.
const MAGIC_AT: usize = 128;
const MAGIC: &[u8] = b"DICM";

/// Returns true if this is the beginning of a DICOM file.
pub(super) fn sniff(head: &[u8]) -> bool {
    head.get(MAGIC_AT..MAGIC_AT + MAGIC.len()) == Some(MAGIC)
}
