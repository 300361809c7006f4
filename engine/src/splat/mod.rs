//! Splat sets: parameters, activations, spaces and files.
pub mod kernel;
pub use kernel::Kernel;
pub use shaders_glsl::types::Splat;
