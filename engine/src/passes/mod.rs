//! One file per kernel or group of kernels that belong together: the pipelines, the scratch buffers, and how they are
//! recorded. A pass knows buffers and counts; what they mean for a fit is `fit`'s business.

pub mod activity;
pub mod adam;
pub mod bin;
pub mod gradient;
pub mod loss;
pub mod occupancy;
pub mod overlap;
mod pace;
pub mod quads;
pub mod radix_sort;
pub mod rasterise;
pub mod rows;
mod sample;
pub mod scan;
pub mod splat_rows;
mod storage;
pub mod tiles;
pub mod views;
mod work;

pub use activity::Activity;
pub use adam::Adam;
pub use bin::Binner;
pub use gradient::Gradient;
pub use loss::Losses;
pub use occupancy::Occupancy;
pub use overlap::Overlap;
pub use pace::Pace;
pub use quads::Quads;
pub use radix_sort::RadixSort;
pub use rasterise::Rasteriser;
pub use rows::Rows;
pub use sample::{FieldSample, Sampler};
pub use scan::Scan;
pub use shaders_glsl::types::{Adjoint, Reconstruction, SplatGrad, Target};
pub use splat_rows::SplatRows;
pub use storage::Storage;
pub use tiles::TileBinner;
pub use views::Views;
pub use work::Work;

use crate::gpu::Gpu;

/// How wide the workgroups of the forward and the backward pass are; the value is their invocations. Eight of them own a
/// cell or a splat. The result has the same bits in either shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Shape {
    /// One cell or splat at a time, so that all its loads are uniform: for CPU drivers.
    OneByOne = 8,
    /// Eight side by side: for GPUs, which want full subgroups.
    SideBySide = 64,
}

impl Shape {
    /// What suits a device: one at a time where 8 invocations fill a subgroup.
    pub fn of(gpu: &Gpu) -> Self {
        if gpu.description().subgroup_size <= 8 { Shape::OneByOne } else { Shape::SideBySide }
    }
}
