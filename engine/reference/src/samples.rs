//! Positions of the samples of a pass.

use glam::DVec3;

use volume::Bricks;
use volume::bricks::{SAMPLES, brick_voxel};

/// The samples of some slots, displaced from the voxel centres, in memory order, as the kernels number them.
#[derive(Clone, Debug)]
pub struct Samples<'a> {
    /// The sample grid.
    pub bricks: &'a Bricks,
    /// Slots of the chunk.
    pub slots: std::ops::Range<usize>,
    /// Displacement of the samples from the voxel centres, voxels.
    pub offset: DVec3,
}

impl<'a> Samples<'a> {
    /// Creates the samples of a whole grid.
    pub fn all(bricks: &'a Bricks, offset: [f32; 3]) -> Self {
        Samples { bricks, slots: 0..bricks.len(), offset: DVec3::from_array(offset.map(f64::from)) }
    }

    /// Returns the position of the sample at a Morton place of a slot, local voxels.
    pub fn position(&self, slot: usize, morton: usize) -> DVec3 {
        (self.bricks.coordinates[slot] * 8 + brick_voxel(morton)).as_dvec3() + self.offset
    }

    /// Returns the positions of all samples, [slot][Morton place].
    pub fn positions(&self) -> Vec<DVec3> {
        self.slots
            .clone()
            .flat_map(|slot| (0..SAMPLES).map(move |morton| (slot, morton)))
            .map(|(slot, morton)| self.position(slot, morton))
            .collect()
    }
}
