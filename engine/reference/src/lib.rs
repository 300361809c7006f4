//! The f64 reference implementation of every kernel: what a kernel is meant to compute, written plainly,
//! without its blocks, tables and shared memory. A kernel `foo.comp` has its reference in the module that is
//! named after it or after its group. The tests compare both on the same inputs, and the references'
//! derivatives with central differences of [`objective()`].
//!
//! Reference implementations use plain loops over all samples and all splats. They are for tests and never
//! touch the GPU.
#![forbid(unsafe_code)]

pub mod activity;
pub mod adam;
pub mod decoded;
pub mod deconvolution;
pub mod eye;
pub mod half;
pub mod hidden;
pub mod loss;
pub mod moments_to_grad;
pub mod objective;
pub mod occupancy;
pub mod pairs;
pub mod picture;
pub mod quads;
pub mod radix;
pub mod raymarch;
pub mod rows;
pub mod samples;
pub mod scan;
pub mod slab;
pub mod splat_bounds;
pub mod splat_to_volume;
pub mod splat_to_volume_grad;
pub mod types;

pub use half::half;
pub use loss::Term;
pub use objective::objective;
pub use samples::Samples;
pub use types::{Adjoint, Footprint, Gradient, Reconstruction, Splat, Target};
