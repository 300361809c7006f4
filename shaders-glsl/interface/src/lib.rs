//! What the host and the shaders share, without the shaders: their structs ([`types`]), and the numbers of
//! `shaders-glsl/include`. A line `const uint TILE = 16;` of `include/tiles.glsl` is [`tiles::TILE`] here: such a number
//! is written in GLSL only. `shaders-glsl` checks the structs against what glslang makes of the shaders.
//!
//! Volumes and splats stand on this crate and need no compiler of shaders.
#![forbid(unsafe_code)]

pub mod types;

include!(concat!(env!("OUT_DIR"), "/constants.rs"));
