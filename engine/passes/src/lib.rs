//! The host side of the kernels: pipelines, scratch buffers, and how they are recorded. There is one file per
//! kernel or group of kernels that belong together. A pass knows buffers and counts; `fit` knows what they
//! mean for a fit.
//!
//! | file | kernels recorded there | what it is |
//! |---|---|---|
//! | `scan` | `scan_sums`, `scan_offsets`, `scan_apply` | prefix sums of any buffer |
//! | `radix_sort` | `radix_count`, `radix_scatter` | sorting of any keys and values |
//! | `rows` | `gather_rows`, `scatter_rows` | rows of any buffer by a list of indices |
//! | `pair_lists` | `brick_ranges` | pairs summed up, sorted, and found by list, for both binners |
//! | `sample_grid` | | the bricks of a fit, in chunks that a binding holds |
//! | `bin` | `splat_bounds`, `emit_pairs`, `pair_masks`, `cell_masks` | which splats reach which samples of a fit |
//! | `rasterize` | `splat_to_volume` | rasterization, from splats to samples |
//! | `sample`, `visit` | | the field at voxels, in HU; at all that splats reach |
//! | `loss` | `loss_dice`, `loss_kl`, `loss_leak`, `loss_mse`, `loss_occupancy`, `loss_square`, `loss_tail` | its terms |
//! | `overlap` | `overlap_sums`, `sum_triples` | the sums over all samples that a Dice loss needs first |
//! | `gradient` | `splat_to_volume_grad`, `moments_to_grad` | the backward pass |
//! | `adam` | `adam` | the optimiser |
//! | `activity` | `mark_active`, `list_active` | which splats a look can show |
//! | `ranking` | `limit_active` | an order of importance, for listings with a budget |
//! | `tiles` | `hidden_parts`, `project_splats`, `emit_tile_pairs` | splats into tiles and blocks of planes |
//! | `deconvolution` | `deconvolve_points`, `deconvolve_splats` | extinction and colour of each splat, for mode alpha |
//! | `quads` | `project_quads` | projection of splats to quads |
//! | `occupancy` | `occupancy_mark`, `occupancy_spread` | which bricks of a volume a look can show |
//! | `voxel_gradients` | `voxel_gradients` | gradients at the voxels of a volume, for its light |
//! | `faces` | `list_faces` | the faces around those bricks, and the pixels that they cover |
//! | `picture` | `picture_project`, `picture_pairs`, `picture_blend`, `picture_ssim`, `picture_loss_grad`, `picture_blend_grad`, `picture_project_grad`, `adam_harmonics` | standard splats on a picture, its loss, and the way back |
//! | `render/slab` | `slab` | the modes slab and exact |
//! | `render/raymarch` | `raymarch` | the modes volume and decoded |
//! | `views`, `splat_rows` | | the views and the splats that kernels read |
//! | `objective` | | what splats are moved by: [`Objective`] |
//! | `lists` | | lists of rows, one behind the other |
//! | `storage`, `workgroup_shape` | | how samples are stored, how wide workgroups are |
//! | `submission_pacer` | | how much work one submission takes |
//! | `work` | | counts of the work of a frame |
//!
//! A test holds the table against the sources: every kernel is named in it once, and used in that file alone.
#![forbid(unsafe_code)]

pub mod activity;
pub mod adam;
pub mod bin;
pub mod deconvolution;
pub mod faces;
pub mod gradient;
pub mod lists;
pub mod loss;
mod objective;
pub mod occupancy;
pub mod overlap;
mod pair_lists;
pub mod picture;
pub mod quads;
pub mod radix_sort;
mod ranking;
pub mod rasterize;
pub mod rows;
mod sample;
mod sample_grid;
pub mod scan;
pub mod splat_rows;
mod storage;
mod submission_pacer;
pub mod tiles;
pub mod views;
mod visit;
pub mod voxel_gradients;
mod work;
mod workgroup_shape;

pub use activity::Activity;
pub use adam::Adam;
pub use bin::Binner;
pub use deconvolution::Deconvolution;
pub use faces::Faces;
pub use gradient::Gradient;
pub use lists::Lists;
pub use loss::Losses;
pub use objective::Objective;
pub use occupancy::Occupancy;
pub use overlap::Overlap;
pub use picture::Picture;
pub use quads::Quads;
pub use radix_sort::RadixSort;
pub use ranking::Ranking;
pub use rasterize::Rasterizer;
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
pub use visit::visit;
pub use work::Work;
pub use workgroup_shape::WorkgroupShape;

#[cfg(test)]
mod tests;
