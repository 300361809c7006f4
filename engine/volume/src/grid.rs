//! Regular grids, and boxes of them.

use glam::{DAffine3, DVec3};

use base::{Error, Kind, Result};

/// A regular grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Voxel counts along x, y, z.
    pub size: [usize; 3],
    /// Map from voxel index (centres at integers) to world, mm RAS.
    pub world_from_voxel: DAffine3,
}

impl Grid {
    /// Returns the grid of the box of `size` voxels whose first one is `first`.
    pub fn of_box(&self, first: [usize; 3], size: [usize; 3]) -> Grid {
        let offset = DAffine3::from_translation(DVec3::from_array(first.map(|c| c as f64)));
        Grid { size, world_from_voxel: self.world_from_voxel * offset }
    }

    /// Returns true if `part` is the grid of a box of this one, to a hundredth of a voxel.
    pub fn has_box(&self, ends: [[usize; 2]; 3], part: &Grid) -> bool {
        let (first, size) =
            (ends.map(|[first, _]| first), ends.map(|[first, end]| end.saturating_sub(first)));
        let found = self.of_box(first, size);
        let voxel_from_world = found.world_from_voxel.inverse();
        let same_place = |corner: DVec3| {
            let there = voxel_from_world.transform_point3(part.world_from_voxel.transform_point3(corner));
            there.distance(corner) < 0.01
        };
        let last = DVec3::from_array(size.map(|n| n as f64));
        self.check_box(first, size).is_ok()
            && part.size == size
            && [DVec3::ZERO, DVec3::X * last, DVec3::Y * last, DVec3::Z * last].into_iter().all(same_place)
    }

    /// Refuses a box that is empty or reaches beyond the grid.
    pub(super) fn check_box(&self, first: [usize; 3], size: [usize; 3]) -> Result<()> {
        let within = |axis: usize| {
            first[axis].checked_add(size[axis]).is_some_and(|end| size[axis] > 0 && end <= self.size[axis])
        };
        if (0..3).all(within) {
            return Ok(());
        }
        let ends: [usize; 3] = std::array::from_fn(|axis| first[axis].saturating_add(size[axis]));
        let [x, y, z] = [0, 1, 2].map(|axis| format!("{}:{}", first[axis], ends[axis]));
        let [nx, ny, nz] = self.size;
        let message =
            format!("the voxels {x},{y},{z} are not all among the {nx} x {ny} x {nz} of the volume");
        Err(Error::new(Kind::Usage, "VGS-VOL-026", message)
            .help(format!("choose some of --voxels 0:{nx},0:{ny},0:{nz}; a range holds one voxel or more")))
    }
}

/// The place of a volume that is a box of a larger one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PartOf {
    /// The grid of the larger volume.
    pub grid: Grid,
    /// Its voxel that is the first of the box.
    pub first: [usize; 3],
}

impl PartOf {
    /// Returns the place among slices that are `every` times as many along `axis`, between those that there are.
    pub fn with_slices(mut self, axis: usize, every: usize) -> PartOf {
        let mut closer = DVec3::ONE;
        closer[axis] = 1.0 / every as f64;
        self.grid.size[axis] = (self.grid.size[axis] - 1) * every + 1;
        self.grid.world_from_voxel *= DAffine3::from_scale(closer);
        self.first[axis] *= every;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_with_more_slices_lies_where_it_lay() {
        let world_from_voxel =
            DAffine3::from_rotation_y(0.4) * DAffine3::from_scale(DVec3::new(1.0, 2.0, 6.0));
        let whole = Grid { size: [9, 8, 7], world_from_voxel };
        let part = whole.of_box([2, 0, 3], [4, 8, 3]);
        let place = PartOf { grid: whole, first: [2, 0, 3] }.with_slices(2, 3);
        assert_eq!((place.grid.size, place.first), ([9, 8, 19], [2, 0, 9]));
        let closer = DAffine3::from_scale(DVec3::new(1.0, 1.0, 1.0 / 3.0));
        let found = place.grid.of_box(place.first, [4, 8, 7]);
        assert!(found.world_from_voxel.abs_diff_eq(part.world_from_voxel * closer, 1e-12));
    }
}
