//! Units of initial scales and of scale clamps.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use volume::Volume;

/// Unit of initial scales and of scale clamps.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ScaleUnit {
    /// Voxels, along any axis.
    Voxel,
    /// The mean of the three voxel spacings: the same millimetres along every axis.
    Spacing,
    /// The box of the volume as a unit cube: splats have their shape in the cube, so one that is round there
    /// is stretched along the axes like the volume. The unit is the mean over the axes of the length of one
    /// voxel in the cube.
    Box,
}

impl ScaleUnit {
    /// Returns the number of voxels along each axis that are one unit of the space in which splats have their
    /// shape: ones, except for [`ScaleUnit::Box`], where it is (n - 1) times the mean of 1/(n - 1) over the
    /// axes, with n voxels along an axis.
    pub fn stretch(self, volume: &Volume) -> DVec3 {
        let edges = volume.size.map(|n| n.max(2) as f64 - 1.0);
        match self {
            ScaleUnit::Voxel | ScaleUnit::Spacing => DVec3::ONE,
            ScaleUnit::Box => DVec3::from_array(edges) * edges.iter().map(|n| 1.0 / n).sum::<f64>() / 3.0,
        }
    }

    /// Returns the least and the greatest scale of a splat in voxels of `volume`, given those in this unit.
    /// Clamps in millimetres become the narrowest range in voxels that admits every splat they admit: with
    /// the spacings h of mean h̄ that is `least` h̄ / max h to `most` h̄ / min h (for an affine without
    /// shear).
    pub fn clamp(self, least: f32, most: f32, volume: &Volume) -> (f32, f32) {
        match self {
            ScaleUnit::Voxel | ScaleUnit::Box => (least, most),
            ScaleUnit::Spacing => {
                let spacing = volume.spacing_mm();
                let mean = spacing.element_sum() / 3.0;
                let scale = |scale: f32, spacing: f64| (f64::from(scale) * mean / spacing) as f32;
                (scale(least, spacing.max_element()), scale(most, spacing.min_element()))
            }
        }
    }
}
