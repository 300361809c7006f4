//! The grid that a set was fitted on, and its form: whether its field is right everywhere or only on that grid.

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

/// What a set was fitted for, which decides how it is shown and measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Form {
    /// The set is right between the voxels as well.
    #[default]
    Field,
    /// The set is right at the voxels of its grid only: it has to be decoded there and interpolated.
    Grid,
}

/// Names of the forms in files.
const NAMES: [(&str, Form); 4] = [
    ("field", Form::Field),
    ("grid", Form::Grid),
    (Form::WITH_REGION, Form::Grid),
    (Form::OCCUPIED, Form::Grid),
];

impl Form {
    /// The name in files of [`Form::Grid`] with a [`Region`](crate::Region).
    pub(crate) const WITH_REGION: &str = "region";
    /// The same in files from before there were regions: they are where the occupancy is above ½, but for some
    /// exceptions.
    pub(crate) const OCCUPIED: &str = "grid-binary";

    /// Returns the name of the form in files, of a set that has a region or none.
    pub(crate) fn name(self, region: bool) -> &'static str {
        match self {
            Form::Field => "field",
            Form::Grid if region => Form::WITH_REGION,
            Form::Grid => "grid",
        }
    }

    /// Returns the form that is called `name` in files, with the name itself.
    pub(crate) fn from_name(name: &str) -> Option<(Self, &'static str)> {
        NAMES.iter().find(|(known, _)| *known == name).map(|&(name, form)| (form, name))
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
    fn forms_have_names() {
        for (name, form) in NAMES {
            assert_eq!(Form::from_name(name), Some((form, name)));
        }
        for (form, region) in [(Form::Field, false), (Form::Grid, false), (Form::Grid, true)] {
            assert_eq!(Form::from_name(form.name(region)).map(|(form, _)| form), Some(form));
        }
        assert_eq!(Form::from_name("cubic"), None);
    }
}
