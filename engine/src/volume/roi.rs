//! The region of interest: where the fit looks.

/// A region of interest on the grid of its volume.
#[derive(Clone, Debug)]
pub struct Roi {
    /// Voxel counts along x, y, z; equal to the volume's.
    pub size: [usize; 3],
    /// Membership in [0, 1] of every voxel, x fastest.
    pub weight: Vec<f32>,
    /// Whether the mask was soft (any weight strictly between 0 and 1).
    pub soft: bool,
}
