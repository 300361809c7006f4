//! The unit of scales.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::volume::Volume;

/// What initial scales and scale clamps count in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ScaleUnit {
    /// Voxels along whichever axis.
    Voxel,
    /// The mean of the three voxel spacings: the same millimetres along every axis.
    Spacing,
    /// The box of the volume as a unit cube: a splat has its shape there, and one that is round there is as long along
    /// each axis as the volume is. The unit is the mean over the axes of one voxel's part of the edge.
    Box,
}

impl ScaleUnit {
    /// Returns how many voxels along each axis are a unit of the space in which splats have their shape: ones, but for
    /// [`ScaleUnit::Box`] (n - 1) times the mean of 1/(n - 1) over the axes, n the voxels of an axis.
    pub fn stretch(self, volume: &Volume) -> DVec3 {
        let edges = volume.size.map(|n| n.max(2) as f64 - 1.0);
        match self {
            ScaleUnit::Voxel | ScaleUnit::Spacing => DVec3::ONE,
            ScaleUnit::Box => DVec3::from_array(edges) * edges.iter().map(|n| 1.0 / n).sum::<f64>() / 3.0,
        }
    }

    /// Returns the least and the greatest scale of a splat in voxels of `volume`, from those in this unit. Clamps in
    /// millimetres become the narrowest box in voxels that lets every splat through which they let through: with the
    /// spacings h of mean h̄ that is `least` h̄ / max h to `most` h̄ / min h (for an affine without shear).
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
