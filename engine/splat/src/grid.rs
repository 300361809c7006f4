//! The grid that a set was fitted on, its form (whether its field is right everywhere or only on that grid),
//! and the voxels of the grid where the splats are wrong about the mask.

use glam::{DAffine3, DMat3, DVec3};

/// A grid of voxels in the world.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Voxels along x, y, z.
    pub size: [u32; 3],
    /// Map from voxel indices (centres at integers) to mm RAS.
    pub world_from_voxel: DAffine3,
}

impl Grid {
    /// Creates the grid of the voxels of a volume of this size.
    pub fn of_voxels(size: [usize; 3], world_from_voxel: DAffine3) -> Self {
        Grid { size: size.map(|n| u32::try_from(n).unwrap_or(u32::MAX)), world_from_voxel }
    }

    /// Returns the grid with samples `pitch` voxels apart, beginning at the centre of the first voxel. At ½
    /// every second sample is the centre of a voxel; at 2 every sample is that of every second voxel.
    ///
    /// # Panics
    /// If `pitch` is not a finite number above 0.
    pub fn at_pitch(&self, pitch: f64) -> Self {
        assert!(pitch > 0.0 && pitch.is_finite(), "a pitch of {pitch} voxels");
        // A grid that ends between two samples loses less than one of them.
        let size = self.size.map(|n| ((f64::from(n.max(1)) - 1.0) / pitch + 1e-6).floor() as u32 + 1);
        Grid { size, world_from_voxel: self.world_from_voxel * DAffine3::from_scale(DVec3::splat(pitch)) }
    }

    /// Returns why a file must not hold this grid, or `None` if it may.
    pub fn defect(&self) -> Option<&'static str> {
        let affine = self.world_from_voxel;
        let conditions = [
            (self.size.iter().all(|&n| n > 0), "the grid has no voxels"),
            (affine.is_finite() && affine.inverse().is_finite(), "the grid's axes lie in one plane"),
        ];
        conditions.iter().find_map(|&(good, why)| (!good).then_some(why))
    }

    /// Returns the affine row by row, four numbers each.
    pub fn rows(&self) -> [f64; 12] {
        let DAffine3 { matrix3: m, translation: t } = self.world_from_voxel;
        let rows = [0, 1, 2].map(|k| m.row(k).extend(t[k]).to_array());
        std::array::from_fn(|i| rows[i / 4][i % 4])
    }

    /// Creates a grid of this size from the rows of its affine.
    pub fn from_rows(size: [u32; 3], rows: [f64; 12]) -> Self {
        let column = |k: usize| DVec3::new(rows[k], rows[4 + k], rows[8 + k]);
        let matrix = DMat3::from_cols(column(0), column(1), column(2));
        Grid { size, world_from_voxel: DAffine3::from_mat3_translation(matrix, column(3)) }
    }
}

/// A voxel of the grid that rounding the splats' occupancy puts on the wrong side of a binary mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Exception {
    /// The voxel's indices along x, y, z.
    pub voxel: [u16; 3],
    /// True if the voxel is in the mask: its occupancy is 1, and otherwise 0. It holds only where a splat
    /// reaches the voxel, so an exception goes with the splats that it belongs to.
    pub inside: bool,
}

impl Exception {
    /// Creates the exception of the voxel with this index, x fastest; `None` if the grid has no such voxel.
    pub fn at(index: u64, inside: bool, grid: &Grid) -> Option<Self> {
        let [nx, ny, nz] = grid.size.map(u64::from);
        let [x, y, z] = [index % nx, index / nx % ny, index / nx / ny];
        let axis = |at: u64| u16::try_from(at).ok();
        (z < nz).then_some(())?;
        Some(Exception { voxel: [axis(x)?, axis(y)?, axis(z)?], inside })
    }

    /// Returns the index of the voxel in a grid that has it, x fastest.
    pub fn index(&self, grid: &Grid) -> u64 {
        let [x, y, z] = self.voxel.map(u64::from);
        (z * u64::from(grid.size[1]) + y) * u64::from(grid.size[0]) + x
    }

    /// Returns why a set with this grid must not have some exceptions, or `None` if it may.
    pub fn defect(exceptions: &[Exception], grid: Option<&Grid>) -> Option<&'static str> {
        let Some(grid) = grid else {
            return (!exceptions.is_empty()).then_some("it has exceptions and no grid for them");
        };
        let beyond = |e: &Exception| (0..3).any(|k| u32::from(e.voxel[k]) >= grid.size[k]);
        if exceptions.iter().any(beyond) {
            return Some("an exception lies beyond the grid");
        }
        let ascending = exceptions.is_sorted_by(|a, b| a.index(grid) < b.index(grid));
        (!ascending).then_some("its exceptions are not in order")
    }
}

/// What a set was fitted for, which decides how it is shown and measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// The set is right between the voxels as well.
    #[default]
    Field,
    /// The set is right at the voxels of its grid only: it has to be decoded there and interpolated.
    Grid {
        /// True if the mask was binary: an occupancy above ½ stands for 1, any other for 0, but for the set's
        /// [exceptions](Exception).
        binary: bool,
    },
}

/// Names of the forms in files.
const NAMES: [(&str, Form); 3] = [
    ("field", Form::Field),
    ("grid", Form::Grid { binary: false }),
    ("grid-binary", Form::Grid { binary: true }),
];

impl Form {
    /// Returns the name of the form in files.
    pub fn name(self) -> &'static str {
        NAMES.iter().find(|(_, form)| *form == self).map_or("field", |(name, _)| name)
    }

    /// Returns the form of two sets of the same kind together: an occupancy is rounded only if both masks
    /// were binary.
    pub fn joined(self, other: Self) -> Self {
        match (self, other) {
            (Form::Grid { binary: a }, Form::Grid { binary: b }) => Form::Grid { binary: a && b },
            _ => self,
        }
    }

    /// Returns the form called `name`.
    pub fn from_name(name: &str) -> Option<Self> {
        NAMES.iter().find(|(known, _)| *known == name).map(|(_, form)| *form)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_finer_grid_keeps_the_voxels_and_a_coarser_one_some_of_them() {
        let affine = DAffine3::from_mat3_translation(
            DMat3::from_diagonal(DVec3::new(-0.7, 0.7, 3.0)),
            DVec3::new(5.0, 6.0, 7.0),
        );
        let grid = Grid { size: [5, 4, 1], world_from_voxel: affine };
        for (pitch, size) in [(1.0, [5, 4, 1]), (0.5, [9, 7, 1]), (2.0, [3, 2, 1])] {
            let other = grid.at_pitch(pitch);
            assert_eq!(other.size, size, "{pitch}");
            let voxel = DVec3::new(4.0, 2.0, 0.0);
            let found = other.world_from_voxel.transform_point3(voxel / pitch);
            assert!(found.abs_diff_eq(affine.transform_point3(voxel), 1e-12), "{pitch}: {found}");
        }
        assert_eq!(Grid::from_rows(grid.size, grid.rows()), grid);
        assert_eq!(grid.defect(), None);
        assert!(Grid { size: [0, 1, 1], ..grid }.defect().is_some());
        let flat = DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0));
        assert!(Grid { world_from_voxel: flat, ..grid }.defect().is_some());
    }

    #[test]
    fn exceptions_need_a_grid_that_holds_them() {
        let grid = Grid { size: [2, 3, 4], world_from_voxel: DAffine3::IDENTITY };
        let at = |voxel| [Exception { voxel, inside: true }];
        assert_eq!(Exception::defect(&at([1, 2, 3]), Some(&grid)), None);
        assert_eq!(Exception::defect(&[], None), None);
        let all: Vec<_> = (0..24).filter_map(|i| Exception::at(i, i % 2 == 0, &grid)).collect();
        assert_eq!((all.len(), Exception::at(24, true, &grid)), (24, None));
        assert!((0..24).zip(&all).all(|(i, exception)| exception.index(&grid) == i));
        assert_eq!(Exception::defect(&all, Some(&grid)), None);
        assert!(Exception::defect(&[all[5], all[5]], Some(&grid)).is_some(), "twice");
        assert!(Exception::defect(&[all[5], all[4]], Some(&grid)).is_some(), "backwards");
        for (exceptions, grid) in
            [(at([0; 3]), None), (at([2, 0, 0]), Some(&grid)), (at([0, 0, 4]), Some(&grid))]
        {
            assert!(Exception::defect(&exceptions, grid).is_some(), "{exceptions:?}");
        }
    }

    #[test]
    fn forms_have_names() {
        for (name, form) in NAMES {
            assert_eq!((Form::from_name(name), form.name()), (Some(form), name));
        }
        assert_eq!(Form::from_name("cubic"), None);
    }
}
