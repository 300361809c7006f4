//! NIfTI-1 and NIfTI-2 files, read strictly and written atomically.
//!
//! Single files and pairs, plain or gzip, either byte order, every scalar datatype. Sizes are compared with
//! the bytes that are there before anything is allocated, and a stream is read to its end so that its
//! checksum counts. The `nifti` crate parses the NIfTI-1 header; its voxel reader is not used, since it
//! begins at the wrong byte where extensions or a gap precede the voxels, applies a NaN slope, and stops
//! before the checksum.
//!
//! | file | what is there |
//! |---|---|
//! | `header`, `datatype`, `extension` | the bytes of a header, the types of voxels, the names of labels |
//! | `open` | a file or a pair of files, opened up to the voxels |
//! | `read`, `describe` | the voxels as a [`Volume`](super::Volume), the header as a [`Header`] |
//! | `write` | the writer |

mod datatype;
mod describe;
mod extension;
mod header;
mod open;
mod read;
mod write;

pub use describe::{Header, describe};
pub(super) use header::{FIELDS, sniff};
pub(super) use open::beside;
pub(super) use read::open;
pub use write::{check_name, write};

#[cfg(test)]
mod tests;
