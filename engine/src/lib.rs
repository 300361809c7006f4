//! Volumetric Gaussian splatting, from a voxel volume to splats that carry a physical intensity.
//!
//! The map, with the arrows that are allowed ("A -> B": A may use B; `tests/tests/arrows.rs` checks them):
//!
//! ```text
//! fit -> passes -> gpu          fit, passes -> volume, splat          reference -> volume, splat
//! gpu      knows Vulkan, never medicine
//! volume   samples, masks, regions of interest and their files; never gpu
//! splat    splat sets, their parameters and their files; never gpu
//! passes   one kernel or one group of kernels each, recorded with its buffers
//! fit      the optimisation: initialisation, the step, evaluation
//! reference  the f64 twin of every kernel; never gpu
//! output   files that appear whole or not at all; used by all that write
//! ```
#![deny(unsafe_code)]

pub mod error;
pub mod fit;
pub mod gpu;
pub mod output;
pub mod passes;
pub mod reference;
pub mod splat;
pub mod volume;

pub use error::{Error, Kind, Result};
