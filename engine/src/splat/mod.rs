//! Splat sets: parameters, activations, spaces and files.

pub use shaders_glsl::types::Splat;
