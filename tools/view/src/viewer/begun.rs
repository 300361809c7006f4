//! The picture on its way, and what is known of those before.

use std::collections::BTreeMap;
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
    /// Of what moved, by quality level.
    pub(super) moving: BTreeMap<usize, f64>,
    pub(super) full: Option<f64>,
}

impl PictureTimes {
    /// Returns the time that the next one of what moves should take on `level`, where `ratio` is that of its cost to
    /// the first level's; `None` if nothing is known.
    pub(super) fn expected(&self, level: usize, ratio: f64) -> Option<f64> {
        self.moving.get(&level).copied().or(self.full.map(|ms| ms * ratio))
    }
}
