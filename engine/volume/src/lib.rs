//! Voxel volumes and regions of interest.
//!
//! Spaces: *voxel* space has voxel centres at integer coordinates, x fastest in memory; *world* space is
//! patient millimetres, RAS: x grows to the patient's right, y to the front, z to the head.
//!
//! | file | what is there |
//! |---|---|
//! | `volume` | [`Volume`]: samples on a regular grid, and where it is in the patient |
//! | `affine`, `interpolation` | what an affine says of a grid; values between voxels |
//! | `kind_of_scan` | whether samples are HU |
//! | `formats`, `read_options` | [`Volume::read`], from paths and readers, with [`FORMATS`], a row per file format |
//! | `dicom`, `nifti`, `inv3`, `nrrd`, `metaimage`, `npy` | the formats |
//! | `source`, `payload` | opening of their files; unpacking and bounds of the voxels behind a header |
//! | `elements`, `text_header` | types of voxels; what the headers of NRRD and MetaImage have in common |
//! | `fields` | [`FieldRow`]: what a reader does with a field of a header |
//! | `mask_values` | what the values of a mask stand for |
//! | `roi`, `labels` | [`Roi`]: the voxels that are fitted; [`Labels`]: the label of each voxel |
//! | `label_choice` | [`LabelChoice`]: which labels of a map are meant |
//! | `present` | [`PresentLabel`]: the labels that a mask has, and what each covers |
//! | `cleaning`, `morphology` | [`Cleaning`]: a region from a threshold; pieces, closing and holes of masks |
//! | `bricks`, `distance` | [`Bricks`]: the blocks of 8³ voxels that a region touches; distances to a mask |
//! | `edges`, `beyond`, `edged` | occupancy of a region without stairs, values around it, and both of a volume |
//! | `resample`, `crop`, `slices` | coarser grids, parts of a volume, and slices between thick ones |
//! | `compare`, `phantom` | differences of two volumes, a synthetic CT |
#![forbid(unsafe_code)]

mod affine;
pub mod beyond;
pub mod bricks;
mod cleaning;
pub mod compare;
mod crop;
pub mod dicom;
pub mod distance;
mod edged;
pub mod edges;
mod elements;
mod fields;
mod formats;
mod grid;
mod interpolation;
pub mod inv3;
mod kind_of_scan;
mod label_choice;
mod labels;
mod mask_values;
pub mod metaimage;
pub mod morphology;
pub mod nifti;
pub mod npy;
pub mod nrrd;
mod payload;
pub mod phantom;
mod present;
mod read_options;
pub mod resample;
mod roi;
mod slices;
mod source;
mod text_header;
mod volume;
mod voxel_source;
#[cfg(feature = "zarr")]
pub mod zarr;

pub use affine::spacing_of;
pub use bricks::Bricks;
pub use cleaning::Cleaning;
pub use edged::shown;
pub use fields::FieldRow;
pub use formats::{FORMATS, Format, check_output, files_of, is_zarr, levels, write, write_by_boxes};
pub use grid::{Grid, PartOf};
pub use interpolation::trilinear;
pub use kind_of_scan::unit_by_boxes;
pub use label_choice::LabelChoice;
pub use labels::Labels;
pub use present::PresentLabel;
pub use read_options::{Level, ReadOptions};
pub use roi::Roi;
pub use slices::{BetweenSlices, Displacements, FinerSlices};
pub use source::SNIFF_BYTES;
pub use volume::{Stats, Volume};
pub use voxel_source::VoxelSource;

#[cfg(test)]
mod tests;
