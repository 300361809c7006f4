//! What a volume and its region tell splats that count in its voxels.

use crate::splat::Place;
use crate::volume::{Roi, Volume};

/// The place of a set that was fitted to `volume`; intensities can be parts of the range inside `roi` where it is known.
pub fn place(volume: &Volume, roi: Option<&Roi>) -> Place {
    Place {
        size: volume.size,
        world_from_voxel: volume.world_from_voxel,
        range: volume.min_max().map(|(low, high)| [low, high]).unwrap_or_default(),
        region_range: roi.and_then(|roi| roi.range(volume)),
    }
}
