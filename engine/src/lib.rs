//! Volumetric Gaussian splatting, from a voxel volume to splats that carry a physical intensity: all crates of the
//! engine under one name.
//!
//! | crate | what it is |
//! |---|---|
//! | [`volume`] | samples, masks, regions of interest and their files |
//! | [`splat`] | splat sets, their parameters and their files |
//! | [`transfer`] | from intensity to colour and opacity: transfer functions, presets and their files |
//! | [`image`] | pictures: files, measures of difference, lettering |
//! | [`gpu`] | Vulkan, and nothing of medicine |
//! | [`passes`] | one kernel or one group of kernels each, recorded with its buffers |
//! | [`fit`] | the optimisation: initialisation, the step, evaluation |
//! | [`render`] | a scene of splats or of a volume, seen through a transfer function in one of several modes |
//! | [`mod@bake`] | standard splats that show in other programs what a transfer function shows of a fit |
//! | [`fidelity`] | how far what is shown of splats is from their volume, in figures and colours |
//! | [`mod@rasterize`] | splats as a volume again |
//! | [`mod@coded`] | a region without splats: its voxels, coded within a bound |
//! | `base` | [`Error`], and what else all of them use: [`figures`], [`input`], [`output`], [`memory`], [`names`], [`mod@unit`] |
//!
//! Who uses whom is in `docs/design/architecture.md`; volumes, splats, transfer functions and pictures know no Vulkan.
//!
//! From a CT to splats (`engine/examples/fit.rs`):
//!
#![doc = concat!("```no_run\n", include_str!("../examples/fit.rs"), "```\n")]
//! From splats to pictures (`engine/examples/render.rs`):
//!
#![doc = concat!("```no_run\n", include_str!("../examples/render.rs"), "```\n")]
#![forbid(unsafe_code)]

pub mod coded;
pub mod fidelity;
pub mod rasterize;

pub use bake;
pub use base::{Error, Kind, Result, error, figures, input, memory, names, output, unit};
pub use fit;
pub use gpu;
pub use image;
pub use passes;
pub use render;
pub use render::budget;
pub use splat;
pub use transfer;
pub use volume;
