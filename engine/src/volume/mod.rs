//! Voxel volumes and regions of interest.
//!
//! Spaces: *voxel* space has voxel centres at integer coordinates, x fastest in memory; *world* space is patient
//! millimetres, RAS (x to the patient's right... left-to-right, y back-to-front, z feet-to-head).

pub mod bricks;
mod roi;

use glam::DAffine3;

pub use bricks::Bricks;
pub use roi::Roi;

/// A scalar volume on a regular grid.
#[derive(Clone, Debug)]
pub struct Volume {
    /// Voxel counts along x, y, z.
    pub size: [usize; 3],
    /// Voxel index (centres at integers) to world, mm RAS. May be oblique, sheared or left-handed.
    pub world_from_voxel: DAffine3,
    /// Samples, x fastest: HU for CT, the stored unit otherwise. Length is the product of `size`.
    pub samples: Vec<f32>,
}
