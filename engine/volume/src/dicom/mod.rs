//! DICOM: a folder or a zip of slices, one file of several frames, or one slice, which stands for its series;
//! and the structures of a segmentation (DICOM-SEG) or a structure set (RTSTRUCT), as a mask.
//!
//! | file | what is there |
//! |---|---|
//! | `lengths` | the lengths that elements claim, checked before memory is taken for them |
//! | `elements` | the elements that are used, a row for each, and the one way in which their values are taken |
//! | `header` | what a file says of its frames: place, size, units |
//! | `location` | where a file is: on disk, or in a zip |
//! | `find` | the files of a folder or a zip |
//! | `stacks` | frames that lie parallel to each other, as the entries of a list that one is chosen from |
//! | `geometry` | the planes of a stack in space: order, distance, gaps, tilt |
//! | `scale`, `pixels` | stored values to intensities |
//! | `structures` | structures and their choice; their voxels as one mask |
//! | `segmentation`, `contours`, `polygon` | structures that are given as voxels, and as contours |
//! | `read` | all of it together |
//! | `series` | the series of a folder for people to choose from, and the files of one |
//!
//! Nothing is resampled. Planes are sorted by their position along the normal of the slices, never by number.
//! A gantry tilt is a shear of the affine. Where slices are missing or uneven the grid has the planes between
//! them, and no value there (NaN). DICOM's patient axes point to the left, back and head (LPS); volumes are
//! in RAS.

mod contours;
mod elements;
mod find;
mod geometry;
mod header;
mod lengths;
mod location;
mod pixels;
mod polygon;
mod read;
mod scale;
mod segmentation;
mod series;
mod stacks;
mod structures;
#[cfg(test)]
mod tests;

pub use elements::{ElementRow, element_rows};
pub(super) use location::is_zip;
pub(super) use read::read;
pub use read::{list, structures};
pub use series::{Series, SeriesFiles, Slice, is_key, series, series_files};
pub use stacks::StackSummary;
pub use structures::Structure;

/// Name of the format.
pub const NAME: &str = "DICOM";
/// Name of the format of a zip of DICOM files.
pub const ZIP_NAME: &str = "zip of DICOM files";
/// Offset of the magic, after a preamble of any content.
const MAGIC_AT: usize = 128;
const MAGIC: &[u8] = b"DICM";

/// First group of elements: the file meta information.
const META: &[u8] = &[2, 0, 0, 0, b'U', b'L', 4, 0];
/// The transfer syntaxes of files without meta information: with representations, and without.
const BARE: [&str; 2] = ["1.2.840.10008.1.2.1\0", "1.2.840.10008.1.2\0"];
/// Number of elements at the beginning of a file without a magic that must make sense.
const BARE_ELEMENTS: usize = 3;

/// Returns true if this is the beginning of a DICOM file, be it without preamble, magic or meta information.
pub(super) fn sniff(head: &[u8]) -> bool {
    has_magic(head) || missing_start(head).is_some()
}

fn has_magic(head: &[u8]) -> bool {
    head.get(MAGIC_AT..MAGIC_AT + MAGIC.len()) == Some(MAGIC)
}

/// Returns what is missing at the beginning of a DICOM file without preamble, or without magic, or without meta
/// information, as some archives keep them; `None` if nothing is missing, or if it is no DICOM file.
fn missing_start(head: &[u8]) -> Option<Vec<u8>> {
    let preamble = vec![0; MAGIC_AT];
    if has_magic(head) {
        return None;
    }
    if head.starts_with(MAGIC) {
        return Some(preamble);
    }
    if head.starts_with(META) {
        return Some([&preamble, MAGIC].concat());
    }
    let syntax = [true, false].into_iter().zip(BARE).find(|(explicit, _)| is_bare(head, *explicit))?.1;
    let no_names = [2, 0, 2, 0, b'U', b'I', 0, 0, 2, 0, 3, 0, b'U', b'I', 0, 0];
    let meta =
        [&no_names[..], &[2, 0, 0x10, 0, b'U', b'I', syntax.len() as u8, 0], syntax.as_bytes()].concat();
    Some([&preamble, MAGIC, META, &(meta.len() as u32).to_le_bytes(), &meta].concat())
}

/// Returns true if these are the first elements of a data set, with representations or without: of
/// group 8, in ascending order, with the values that their lengths tell.
fn is_bare(mut rest: &[u8], explicit: bool) -> bool {
    let mut last = (0, 0);
    for _ in 0..BARE_ELEMENTS {
        let Some(&[a, b, c, d, e, f, g, h]) = rest.first_chunk() else { return false };
        let tag = (u16::from_le_bytes([a, b]), u16::from_le_bytes([c, d]));
        let length = match explicit {
            // The first elements have short values.
            true if e.is_ascii_uppercase() && f.is_ascii_uppercase() => u16::from_le_bytes([g, h]).into(),
            true => return false,
            false => u32::from_le_bytes([e, f, g, h]),
        };
        if tag.0 != 8 || tag <= last || length % 2 == 1 {
            return false;
        }
        let Some(next) = rest[8..].get(length as usize..) else { return false };
        (rest, last) = (next, tag);
    }
    true
}
