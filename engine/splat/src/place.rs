//! Places of splats: what a volume adds to a file that does not say where its splats lie.
//!
//! Some files count in the voxels of the volume that they were fitted to, and give intensities as parts of
//! its range. Such a file is [`Unplaced`](super::Unplaced) until it is given the [`Place`] of that volume. A
//! place is plain data, because this module knows no volumes.

use glam::{DAffine3, DVec3};

/// Grid and intensity ranges of a volume, which place the splats that count in its voxels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Voxel counts along x, y, z.
    pub size: [usize; 3],
    /// Map from voxel index (centres at integers) to world, mm RAS; invertible.
    pub world_from_voxel: DAffine3,
    /// Least and greatest intensity of the whole volume.
    pub range: [f32; 2],
    /// Least and greatest intensity in the region of interest, if one is known.
    pub region_range: Option<[f32; 2]>,
}

impl Place {
    /// Returns the distance between neighbouring voxel centres along each axis, mm.
    pub fn spacing_mm(&self) -> DVec3 {
        let linear = self.world_from_voxel.matrix3;
        DVec3::new(linear.x_axis.length(), linear.y_axis.length(), linear.z_axis.length())
    }

    /// Returns the number of voxels from the first to the last centre along each axis, which is the edge of a
    /// unit cube; 1 if there is only one voxel.
    pub fn steps(&self) -> DVec3 {
        DVec3::from_array(self.size.map(|n| n.saturating_sub(1).max(1) as f64))
    }
}
