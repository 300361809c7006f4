//! Voxel volumes and regions of interest.
//!
//! Spaces: *voxel* space has voxel centres at integer coordinates, x fastest in memory; *world* space is
//! patient millimetres, RAS: x grows to the patient's right, y to the front, z to the head.
//!
//! | file | what is there |
//! |---|---|
//! | `volume` | [`Volume`]: samples on a regular grid, and where it is in the patient |
//! | `affine`, `interpolation` | what an affine says of a grid; values between voxels |
//! | `formats`, `read_options` | [`Volume::read`] with [`FORMATS`], a row per file format |
//! | `nifti`, `inv3`, `source` | the formats, and how their files are opened |
//! | `roi`, `labels` | [`Roi`]: where a volume counts; [`Labels`]: which label each voxel has |
//! | `bricks`, `distance` | [`Bricks`]: the blocks of 8³ voxels that a region touches; distances to a mask |
//! | `resample`, `compare`, `phantom` | coarser grids, differences of two volumes, a synthetic CT |

mod affine;
pub mod bricks;
pub mod compare;
pub mod distance;
mod formats;
mod interpolation;
pub mod inv3;
mod labels;
pub mod nifti;
pub mod phantom;
mod read_options;
pub mod resample;
mod roi;
mod source;
mod volume;

pub(crate) use affine::spacing_of;
pub use bricks::Bricks;
pub use formats::{FORMATS, Format, SNIFF_BYTES};
pub use interpolation::trilinear;
pub use labels::Labels;
pub use read_options::ReadOptions;
pub use roi::{LabelChoice, Roi};
pub use volume::{Stats, Volume};

#[cfg(test)]
mod tests;
