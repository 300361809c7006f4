//! The host side of the kernels: the pipelines, the scratch buffers, and how they are recorded. One file per
//! kernel or group of kernels that belong together. A pass knows buffers and counts; what they mean for a fit
//! is `fit`'s business.
//!
//! | file | what it records, or holds |
//! |---|---|
//! | `scan`, `radix_sort`, `rows` | prefix sums, sorting, rows by a list of indices: of any buffer |
//! | `pair_lists` | pairs counted, sorted, and found by list: what both binners share |
//! | `sample_grid`, `bin` | the bricks of a fit, and which splats reach which of their samples |
//! | `rasterise`, `sample` | splats to samples; the field at voxels, in HU |
//! | `loss`, `overlap`, `gradient`, `adam` | what a step does after the forward pass |
//! | `activity`, `ranking` | which splats a look can show |
//! | `tiles`, `quads` | splats to tiles and blocks of planes; splats to quads |
//! | `occupancy` | which bricks of a volume a look can show |
//! | `views`, `splat_rows` | what kernels are told of views, and of splats |
//! | `storage`, `workgroup_shape` | how samples are stored, how wide workgroups are |
//! | `submission_pacer` | how much work one submission takes |
//! | `work` | counts of what a frame was made of |

pub mod activity;
pub mod adam;
pub mod bin;
pub mod gradient;
pub mod loss;
pub mod occupancy;
pub mod overlap;
mod pair_lists;
pub mod quads;
pub mod radix_sort;
mod ranking;
pub mod rasterise;
pub mod rows;
mod sample;
mod sample_grid;
pub mod scan;
pub mod splat_rows;
mod storage;
mod submission_pacer;
pub mod tiles;
pub mod views;
mod work;
mod workgroup_shape;

pub use activity::Activity;
pub use adam::Adam;
pub use bin::Binner;
pub use gradient::Gradient;
pub use loss::Losses;
pub use occupancy::Occupancy;
pub use overlap::Overlap;
pub use quads::Quads;
pub use radix_sort::RadixSort;
pub use ranking::Ranking;
pub use rasterise::Rasteriser;
pub use rows::Rows;
pub use sample::{FieldSample, Sampler};
pub use sample_grid::SampleGrid;
pub use scan::Scan;
pub use shaders_glsl::types::{Adjoint, Reconstruction, SplatGrad, Target};
pub use splat_rows::SplatRows;
pub use storage::Storage;
pub use submission_pacer::SubmissionPacer;
pub use tiles::TileBinner;
pub use views::Views;
pub use work::Work;
pub use workgroup_shape::WorkgroupShape;
