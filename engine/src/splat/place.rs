//! Where the splats of a file lie that does not say so itself.
//!
//! Some files count in the voxels of the volume that they were fitted to, and give intensities as parts of its range.
//! Such a file is [`Unplaced`](super::Unplaced) until it meets the [`Place`] of that volume: plain data, because this module knows no
//! volumes.

use glam::{DAffine3, DVec3};

/// What a volume gives to splats that count in its voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Voxel counts along x, y, z.
    pub size: [usize; 3],
    /// Voxel index (centres at integers) to world, mm RAS; invertible.
    pub world_from_voxel: DAffine3,
    /// Least and greatest intensity of the whole volume.
    pub range: [f32; 2],
    /// Least and greatest intensity in the region of interest, where one is known.
    pub region_range: Option<[f32; 2]>,
}

impl Place {
    /// Distance between neighbouring voxel centres along each axis, mm.
    pub fn spacing_mm(&self) -> DVec3 {
        let linear = self.world_from_voxel.matrix3;
        DVec3::new(linear.x_axis.length(), linear.y_axis.length(), linear.z_axis.length())
    }

    /// Voxels from the first to the last centre along each axis, which is the edge of a unit cube; 1 where there is only
    /// one voxel.
    pub fn steps(&self) -> DVec3 {
        DVec3::from_array(self.size.map(|n| n.saturating_sub(1).max(1) as f64))
    }
}
