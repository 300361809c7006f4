//! Where the splats of a file lie that does not say so itself.
//!
//! Some files count in the voxels of the volume that they were fitted to, and give intensities as parts of its range.
//! Such a file is [`Unplaced`] until it meets the [`Place`] of that volume: plain data, because this module knows no
//! volumes.

use std::path::PathBuf;

use glam::{DAffine3, DVec3};

use super::SplatSet;
use super::ply::reference::Rows;
use crate::error::{Error, Kind, Result};

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

/// A set as its file has it.
#[derive(Clone, Debug)]
pub struct Unplaced {
    pub(super) path: PathBuf,
    /// Where `rows` says otherwise, its splats are not placed yet.
    pub(super) set: SplatSet,
    /// What the splats of the paper's authors still need; nothing where they are placed.
    pub(super) rows: Option<Rows>,
}

impl Unplaced {
    /// Whether only a volume can place the splats.
    pub fn needs_volume(&self) -> bool {
        self.rows.is_some()
    }

    /// Number of usable splats.
    pub fn len(&self) -> usize {
        self.set.splats.len()
    }

    /// Whether there is no usable splat.
    pub fn is_empty(&self) -> bool {
        self.set.splats.is_empty()
    }

    /// Whether intensities are physical; see [`SplatSet::has_intensity`].
    pub fn has_intensity(&self) -> bool {
        self.set.has_intensity
    }

    /// The set in the world. Files that know their place need no `place` and pay no heed to one.
    ///
    /// # Errors
    /// [`Kind::Usage`] where a volume is needed and none is there; [`Kind::BadData`] where the file's intensities cannot
    /// be known from what there is.
    pub fn placed(self, place: Option<&Place>) -> Result<SplatSet> {
        let Unplaced { path, set, rows } = self;
        match (rows, place) {
            (None, _) => Ok(set),
            (Some(rows), Some(place)) => rows.placed(set, place, &path).map_err(|error| error.file(path)),
            (Some(_), None) => {
                let message = "a PLY in the layout of the paper's authors: its splats stand at voxel index times \
                               spacing, which only their volume can place in the patient";
                Err(Error::new(Kind::Usage, "VGS-PLY-026", message).file(path).help(
                    "give the volume that they were fitted to, and its mask for the intensities: vgs eval SPLATS \
                     VOLUME --roi MASK, vgs rasterize SPLATS --like VOLUME --roi MASK, and vgs render or vgs view \
                     SPLATS --volume VOLUME --roi MASK",
                ))
            }
        }
    }
}
