//! The picture on its way, and what is known of those before.

use std::time::{Duration, Instant};

/// Time after the last movement until the picture is rendered in full.
pub(super) const REST: Duration = Duration::from_millis(150);

/// What a picture on its way was begun for.
pub(super) struct Begun {
    /// True if it is to be shown soon rather than well.
    pub(super) fast: bool,
    /// Quality level of what moves.
    pub(super) level: Option<usize>,
    /// True if it has a lower quality than it will have at rest.
    pub(super) draft: bool,
    /// True if a frame shows it already, though it has not finished.
    pub(super) shown: bool,
    /// Time of the first event behind the edit of the look that it shows.
    pub(super) edited: Option<Instant>,
}

/// Time that pictures took last on the device, ms.
#[derive(Default)]
pub(super) struct PictureTimes {
    pub(super) fast: Option<f64>,
    pub(super) full: Option<f64>,
}
