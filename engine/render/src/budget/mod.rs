//! The frame budget: which quality level to render with, so that frames are ready in time.
//!
//! [`LevelCosts`] has the cost of each level relative to the first, which is the best. A [`Controller`] is
//! told the device time of each frame that has finished and says which level the next frame should take: down
//! at once and as far as needed, up one level at a time after a while of room, and ever later where going up
//! has failed before.
//!
//! Nothing here knows a device or a clock; `simulation`, with the feature of that name, has GPUs to
//! try the controller on.

mod controller;
#[cfg(any(test, feature = "simulation"))]
pub mod simulation;

pub use controller::Controller;

/// The cost of each quality level, the best first, relative to that of the first.
#[derive(Clone, Debug, PartialEq)]
pub struct LevelCosts(Vec<f64>);

impl LevelCosts {
    /// Creates the table from the measured costs of the levels.
    ///
    /// # Panics
    /// If there is no level, or one that is not cheaper than the one before it.
    pub fn new(costs: impl IntoIterator<Item = f64>) -> Self {
        let costs: Vec<f64> = costs.into_iter().collect();
        let falling = costs.windows(2).all(|pair| pair[1] < pair[0]);
        assert!(
            falling && costs.last().is_some_and(|&c| c > 0.0),
            "costs of quality levels go down: {costs:?}"
        );
        LevelCosts(costs)
    }

    /// Returns the number of levels.
    #[expect(clippy::len_without_is_empty, reason = "there is at least one level")]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns the cost of level `to` relative to that of level `from`.
    pub fn ratio(&self, from: usize, to: usize) -> f64 {
        self.0[to] / self.0[from]
    }

    /// Returns the best level that costs at most `share` of level `from`, or the last level if none does.
    fn within(&self, from: usize, share: f64) -> usize {
        (0..self.len()).find(|&to| self.ratio(from, to) <= share).unwrap_or(self.len() - 1)
    }
}

/// Part of a display period that a compositor may need on the same device to show the frame.
const COMPOSITOR: f64 = 0.1;

/// Returns the device time that a frame may take on a display of `rate_hz` frames a second, ms: the period
/// less what the compositor needs.
pub fn budget_ms(rate_hz: f64) -> f64 {
    1000.0 / rate_hz * (1.0 - COMPOSITOR)
}
