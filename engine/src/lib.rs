//! Volumetric Gaussian splatting, from a voxel volume to splats that carry a physical intensity.
//!
//! The map, with the arrows that are allowed ("A -> B": A may use B; `tests/tests/arrows` checks them):
//!
//! ```text
//! fit, render -> passes -> gpu          fit, render, passes -> volume, splat          reference -> volume, splat
//! render, reference -> transfer          render -> image, budget          fidelity -> fit, render, transfer, image, gpu, volume, splat
//! gpu      knows Vulkan, never medicine
//! volume   samples, masks, regions of interest and their files; never gpu
//! splat    splat sets, their parameters and their files; never gpu
//! transfer from intensity to colour and opacity: transfer functions, presets and their files; never gpu
//! image    pictures: files, measures of difference, lettering; never gpu
//! passes   one kernel or one group of kernels each, recorded with its buffers
//! fit      the optimisation: initialisation, the step, evaluation
//! render   a scene of splats or of a volume, seen through a transfer function in one of several modes
//! fidelity  how far what is shown of splats is from their volume, in figures and colours
//! reference  the f64 reference implementation of every kernel; never gpu
//! budget   which quality frames can afford, from the times of those that have finished; pure, uses nothing
//! output   files that appear whole or not at all; used by all that write
//! input    opening of the files that a user names; used by all that read
//! names    the name that a mistyped one stands for; used by all that have names
//! unit     what intensities are numbers of; used by all that have some
//! memory   how much of the host there is; asked before what a flag or a file sizes is taken
//! ```
//!
//! From a CT to splats (`engine/examples/fit.rs`):
//!
#![doc = concat!("```no_run\n", include_str!("../examples/fit.rs"), "```\n")]
//! From splats to pictures (`engine/examples/render.rs`):
//!
#![doc = concat!("```no_run\n", include_str!("../examples/render.rs"), "```\n")]
#![deny(unsafe_code)]

pub mod budget;
pub mod error;
pub mod fidelity;
pub mod fit;
pub mod gpu;
pub mod image;
pub mod input;
pub mod memory;
pub mod names;
pub mod output;
pub mod passes;
pub mod reference;
pub mod render;
pub mod splat;
pub mod transfer;
pub mod unit;
pub mod volume;

pub use error::{Error, Kind, Result};
