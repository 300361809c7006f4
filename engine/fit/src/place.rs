//! The voxel grid and intensity ranges of a volume, for splats of other programs that count in its voxels.

use splat::Place;
use volume::{Roi, Volume};

/// Returns the place of a set that was fitted to `volume`. If `roi` is known, intensities may be parts of the
/// range inside it.
pub fn place(volume: &Volume, roi: Option<&Roi>) -> Place {
    Place {
        size: volume.size,
        world_from_voxel: volume.world_from_voxel,
        range: volume.min_max().map(|(low, high)| [low, high]).unwrap_or_default(),
        region_range: roi.and_then(|roi| roi.range(volume)),
    }
}
