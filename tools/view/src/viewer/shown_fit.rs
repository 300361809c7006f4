//! Describes the fit beside the window, and what of it waits to be shown.

use std::sync::Arc;

use crate::fitting::Fitting;
use crate::loader::LoadedSplats;
use crate::state::SplatMode;

/// A fit and the splats of it that wait to be shown.
pub(super) struct ShownFit {
    /// The fit.
    pub(super) fitting: Fitting,
    /// Splats that have come, while the picture moves or others are being prepared.
    pub(super) arrived: Option<Arc<LoadedSplats>>,
    /// Splats whose scene the canvas prepares.
    pub(super) preparing: Option<Arc<LoadedSplats>>,
    /// Mode in which splats were shown before.
    pub(super) mode: SplatMode,
}
