//! The field that splats add up to.

use super::Kernel;

/// How splats add up to V̂(x) = b + Σ w (c − b) / (Σ w + ε), with w = α κ(q), and to the occupancy
/// O(x) = Σ w / (Σ w + w₀).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// The profile κ.
    pub kernel: Kernel,
    /// b, in the unit of the intensities (HU): V̂ where no splat reaches.
    pub background: f32,
    /// ε of eq. (2), in units of w.
    pub epsilon: f32,
    /// w₀ of the occupancy, in units of w.
    pub occupancy_w0: f32,
}

impl Default for Field {
    fn default() -> Self {
        Field { kernel: Kernel::Compact, background: 0.0, epsilon: 1e-3, occupancy_w0: 0.05 }
    }
}
