//! The region that a set was fitted to: the voxels of its grid that belong to an object. A file has them exactly,
//! because a picture shows every voxel of a surface, and they take few bytes; splats say what is inside.
//!
//! | file | what it is |
//! |---|---|
//! | `kinds` | [`Region`]: the voxels and their objects |
//! | `voxels` | the bytes of a region |
//! | `occupied` | regions from the weights of splats: of files without one, and of parts of a set |
//! | `stored` | what a file has of a region |

mod kinds;
mod occupied;
mod stored;
mod voxels;

pub(crate) use kinds::place;
#[cfg(test)]
pub(crate) use kinds::tests;
pub use kinds::{Region, RegionObject};
pub(crate) use occupied::Exception;
pub(crate) use stored::Stored;
