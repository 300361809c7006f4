//! A set as its file has it, which a volume may still have to place.

use std::path::PathBuf;

use super::ply::reference::Rows;
use super::{Place, SplatSet};
use base::error::{Error, Kind, Result};
use base::unit::Unit;

/// A set as its file has it, which a volume may still have to place.
#[derive(Clone, Debug)]
pub struct Unplaced {
    pub(super) path: PathBuf,
    /// The set; its splats are not placed yet if there are `rows`.
    pub(super) set: SplatSet,
    /// What splats in the layout of the paper's authors need to be placed; `None` if they are placed.
    pub(super) rows: Option<Rows>,
}

impl Unplaced {
    /// Returns true if only a volume can place the splats.
    pub fn needs_volume(&self) -> bool {
        self.rows.is_some()
    }

    /// Returns the number of usable splats.
    pub fn len(&self) -> usize {
        self.set.splats.len()
    }

    /// Returns true if there are no usable splats, and nothing in their place.
    pub fn is_empty(&self) -> bool {
        self.set.is_empty()
    }

    /// Returns what the intensities are numbers of.
    pub fn unit(&self) -> Unit {
        self.set.unit
    }

    /// Returns the set in the world. Files that know their place need no `place` and ignore one.
    ///
    /// # Errors
    /// [`Kind::Usage`] if a volume is needed and none is given, or if the file has no `hu` and the intensity
    /// range of the region is not known.
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
