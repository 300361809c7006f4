//! The grid with more slices along the one axis along which voxels are much longer.

use glam::{DAffine3, DVec3};

use crate::affine::spacing_of;
use base::error::Result;
use base::memory;

/// Edge of a voxel along the coarse axis over the longer one of the other two from which on there are slices between.
const LEAST_RATIO: f64 = 1.75;
/// Greatest factor.
const MOST_TIMES: usize = 8;
/// Most slices, as many as a 3D image of usual devices has, ...
const MOST_SLICES: usize = 2048;
/// ... and most voxels. Both are numbers and not what memory there is, so that a fit is the same on every machine.
const MOST_VOXELS: usize = 1 << 29;

/// A grid with more slices along one axis, for the volumes and masks of another grid. Slice i of that one is slice
/// i `factor` of this.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FinerSlices {
    pub(super) axis: usize,
    pub(super) factor: usize,
    /// Size and place of the grid with few slices.
    pub(super) coarse_size: [usize; 3],
    coarse_affine: DAffine3,
}

impl FinerSlices {
    /// Returns the finer grid of one with voxels of `size` at `world_from_voxel`; `None` where no axis is coarse, or only
    /// a slice long, and where the finer grid would be too large.
    pub fn of(size: [usize; 3], world_from_voxel: &DAffine3) -> Option<Self> {
        let spacing = spacing_of(world_from_voxel).to_array();
        let axis = (0..3).max_by(|&a, &b| spacing[a].total_cmp(&spacing[b]))?;
        let others = [(axis + 1) % 3, (axis + 2) % 3].map(|other| spacing[other]);
        let usable = spacing.iter().all(|edge| edge.is_finite() && *edge > 0.0) && size[axis] >= 2;
        if !usable || size.contains(&0) || spacing[axis] < LEAST_RATIO * others[0].max(others[1]) {
            return None;
        }
        let ratio = 2.0 * spacing[axis] / (others[0] + others[1]);
        let wanted = (ratio.round() as usize).min(MOST_TIMES);
        let plane = size.iter().product::<usize>() / size[axis];
        (2..=wanted).rev().find_map(|factor| {
            let slices = (size[axis] - 1) * factor + 1;
            let fits = slices <= MOST_SLICES && plane.checked_mul(slices)? <= MOST_VOXELS;
            fits.then_some(FinerSlices { axis, factor, coarse_size: size, coarse_affine: *world_from_voxel })
        })
    }

    /// Returns how many of its slices there are for one.
    pub fn factor(&self) -> usize {
        self.factor
    }

    /// Returns the axis along which there are more slices.
    pub fn axis(&self) -> usize {
        self.axis
    }

    /// Returns the voxel counts along x, y, z.
    pub fn size(&self) -> [usize; 3] {
        let mut size = self.coarse_size;
        size[self.axis] = (size[self.axis] - 1) * self.factor + 1;
        size
    }

    /// Returns the map from voxel index (centres at integers) to world, mm RAS.
    pub fn world_from_voxel(&self) -> DAffine3 {
        let mut scale = DVec3::ONE;
        scale[self.axis] /= self.factor as f64;
        self.coarse_affine * DAffine3::from_scale(scale)
    }

    /// Fails if memory does not hold a volume and a region of this size.
    ///
    /// # Errors
    /// [`Kind::HostMemory`](base::Kind::HostMemory).
    pub fn require_memory(&self) -> Result<()> {
        let voxels: u64 = self.size().iter().map(|&n| n as u64).product();
        memory::require(voxels.saturating_mul(12), "the slices between those of this volume")
            .map_err(|error| error.help("leave them out: --between-slices linear"))
    }

    /// Returns the number of voxels from one slice to the next in memory. A *column* is a line of voxels along the
    /// axis; columns are counted by their first voxel, x before y before z. `inner` columns in a row lie side by side.
    pub(super) fn inner(&self) -> usize {
        self.coarse_size[..self.axis].iter().product()
    }

    /// Returns the slice below a finer one, and how far above it that is, in slices.
    pub(super) fn between(&self, slice: usize) -> (usize, f64) {
        (slice / self.factor, (slice % self.factor) as f64 / self.factor as f64)
    }

    /// Returns the pixels of a row of a slice, and the number of rows.
    pub(super) fn slice_size(&self) -> [usize; 2] {
        self.across().map(|axis| self.coarse_size[axis])
    }

    /// Returns the axes of a slice.
    pub(super) fn across(&self) -> [usize; 2] {
        [[1, 2], [0, 2], [0, 1]][self.axis]
    }

    /// Returns the distances of neighbouring voxels along each axis of the coarse grid, mm.
    pub(super) fn spacing_mm(&self) -> DVec3 {
        spacing_of(&self.coarse_affine)
    }

    /// Returns the place in memory of a pixel of a slice of the coarse grid.
    pub(super) fn index(&self, slice: usize, [x, y]: [usize; 2]) -> usize {
        let strides = [1, self.coarse_size[0], self.coarse_size[0] * self.coarse_size[1]];
        let [across, up] = self.across();
        slice * strides[self.axis] + x * strides[across] + y * strides[up]
    }
}
