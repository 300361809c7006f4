//! A set as its file has it, which a volume may have to place yet.

use std::path::PathBuf;

use super::ply::reference::Rows;
use super::{Place, SplatSet};
use crate::error::{Error, Kind, Result};

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
