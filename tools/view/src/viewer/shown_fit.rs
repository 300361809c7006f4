//! Describes the fit beside the window, and what of it waits to be shown.

use std::sync::Arc;
use std::time::Instant;

use crate::io::fitting::Fitting;
use crate::io::loader::LoadedSplats;
use crate::model::state::SplatMode;

/// What a fit was asked for, from whose time that of the next one is told.
pub(super) struct AskedFit {
    pub(super) profile: &'static str,
    pub(super) quality: &'static str,
    /// Number of voxels of the region.
    pub(super) voxels: usize,
    /// Time when it was begun; `None` once it has ended.
    pub(super) begun: Option<Instant>,
}

/// A fit and the splats of it that wait to be shown.
pub(super) struct ShownFit {
    /// The fit.
    pub(super) fitting: Fitting,
    /// What was asked for.
    pub(super) asked: AskedFit,
    /// Splats that have come, while the picture moves or others are being prepared.
    pub(super) arrived: Option<Arc<LoadedSplats>>,
    /// Splats whose scene the canvas prepares.
    pub(super) preparing: Option<Arc<LoadedSplats>>,
    /// Mode in which splats were shown before.
    pub(super) mode: SplatMode,
}
