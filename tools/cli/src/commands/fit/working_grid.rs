//! The coarser grid that is fitted in place of the volume's own (`working_grid`).

use engine::fit::{FitConfig, Scaling};

use crate::shared::inputs::Case;

/// The case on a coarser grid.
pub struct WorkingGrid {
    /// Volume and region on that grid.
    pub case: Case,
    /// The configuration, with the HU range that the native volume has or suggests: the means of its blocks reach less far.
    pub config: FitConfig,
}

impl WorkingGrid {
    /// Returns the working grid of a case; `None` where the voxels themselves are fitted.
    pub fn of(case: &Case, config: &FitConfig) -> Option<Self> {
        if config.working_grid <= 1 {
            return None;
        }
        let (low, high) = Scaling::new(&case.volume, &case.roi, config).range;
        let config = FitConfig { hu_range: [low, high], ..config.clone() };
        Some(WorkingGrid { case: case.coarsened(config.working_grid as usize), config })
    }
}
