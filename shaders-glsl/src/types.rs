//! The structs that host and shaders share, in `scalar` layout: plain arrays, no SIMD types, no padding.

use bytemuck::{Pod, Zeroable};

/// One splat by its raw parameters: 12 floats, 48 bytes. Spaces and units depend on the set that holds it: voxel
/// space inside a fit, world mm relative to the set's origin in a file.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Splat {
    /// Centre.
    pub mean: [f32; 3],
    /// Opacity α = 1 / (1 + exp(-logit)).
    pub opacity_logit: f32,
    /// Unit quaternion, (w, x, y, z).
    pub rotation: [f32; 4],
    /// Natural logarithm of the standard deviation along each of the rotated axes.
    pub log_scale: [f32; 3],
    /// Physical intensity, HU for CT.
    pub intensity: f32,
}
