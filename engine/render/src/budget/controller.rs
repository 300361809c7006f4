//! The controller of the frame budget: it takes finished frame times and chooses quality levels.

use std::collections::VecDeque;

use super::LevelCosts;

/// Number of frames that the controller looks back on when it considers a better level.
const WINDOW: usize = 60;
/// Number of frames from which a trend is read.
const TREND: usize = 32;
/// Number of late frames in a row that count as an overload; a single one is an outlier.
const LATE: usize = 2;
/// Part of the budget that a level should take when it is chosen, so that it is not left again at once.
const AIM: f64 = 0.85;
/// Part of the budget above which a trend says that frames are about to be late. With normal scatter the
/// third largest of 32 frames is 1.35 deviations above the mean and the 99th of 100 is 2.33: for 8 % scatter,
/// 7 % more.
const EDGE: f64 = 0.93;
/// Frames to wait before going up, at first and at most; the number doubles each time that going up has
/// failed.
const PATIENCE: [usize; 2] = [60, 60 << 7];

/// Chooses the quality level of the next frame from the times of finished frames.
#[derive(Clone, Debug)]
pub struct Controller {
    costs: LevelCosts,
    budget_ms: f64,
    level: usize,
    /// Times of the latest frames on the present level, ms.
    times: VecDeque<f64>,
    /// Frames since the present level was chosen.
    age: usize,
    /// Frames to wait before going up to each level.
    patience: Vec<usize>,
    /// True if the present level was reached by going up.
    climbed: bool,
}

impl Controller {
    /// Creates a controller that begins on the best level, with a budget of `budget_ms` for each frame.
    pub fn new(costs: LevelCosts, budget_ms: f64) -> Self {
        let patience = vec![PATIENCE[0]; costs.len()];
        Controller { costs, budget_ms, level: 0, times: VecDeque::new(), age: 0, patience, climbed: false }
    }

    /// Returns the level that the next frame should take.
    pub fn level(&self) -> usize {
        self.level
    }

    /// Returns what the levels cost.
    pub fn costs(&self) -> &LevelCosts {
        &self.costs
    }

    /// Returns the device time that a frame may take, ms.
    pub fn budget_ms(&self) -> f64 {
        self.budget_ms
    }

    /// Sets another budget, for example when the refresh rate of the display changes.
    pub fn set_budget_ms(&mut self, budget_ms: f64) {
        if budget_ms != self.budget_ms {
            self.budget_ms = budget_ms;
            self.patience.fill(PATIENCE[0]);
            // What was measured still holds; only what it is compared with has changed.
        }
    }

    /// Records a finished frame: its quality level and its device time in ms. Frames on another level than
    /// the present one were already under way when the level changed, and are ignored.
    pub fn finished(&mut self, level: usize, gpu_ms: f64) {
        if level != self.level || !gpu_ms.is_finite() {
            return;
        }
        self.age += 1;
        if self.times.len() == WINDOW {
            self.times.pop_front();
        }
        self.times.push_back(gpu_ms);
        match self.overload() {
            Some(ms) => self.go_down(ms),
            None if self.may_go_up() => self.change(self.level - 1, true),
            None => {}
        }
    }

    /// Goes down at once if the best level is the present one and one of its frames has taken, or would take,
    /// more than the budget (`gpu_ms`, in ms). This is for frames that need not be in time, so that no frame
    /// has to be late first.
    pub fn foresee(&mut self, gpu_ms: f64) {
        if self.level == 0 && gpu_ms.is_finite() && gpu_ms > self.budget_ms {
            self.go_down(gpu_ms);
        }
    }

    /// Returns how long frames take now, ms, if that is too long: the shortest of the latest frames if all of
    /// them are late, or the time that the trend leads to.
    fn overload(&self) -> Option<f64> {
        let latest = self.times.iter().rev().take(LATE).copied().reduce(f64::min);
        if let Some(least) = latest.filter(|&ms| ms > self.budget_ms && self.times.len() >= LATE) {
            return Some(least);
        }
        if self.times.len() < TREND {
            return None;
        }
        let high = third_largest(self.times.iter().rev().take(TREND));
        (high > EDGE * self.budget_ms).then_some(high)
    }

    fn go_down(&mut self, gpu_ms: f64) {
        let last = self.costs.len() - 1;
        if self.level == last {
            return;
        }
        // If this comes soon after going up, going up was a mistake: wait longer next time.
        if self.climbed && self.age <= 2 * self.patience[self.level] {
            self.patience[self.level] = (2 * self.patience[self.level]).min(PATIENCE[1]);
        }
        let wanted = self.costs.within(self.level, AIM * self.budget_ms / gpu_ms);
        self.change(wanted.max(self.level + 1), false);
    }

    /// Returns true if all but two frames of a whole window would have fitted on the next better level, and
    /// the controller has waited long enough.
    fn may_go_up(&self) -> bool {
        if self.level == 0 || self.times.len() < WINDOW || self.age < self.patience[self.level - 1] {
            return false;
        }
        let ratio = self.costs.ratio(self.level, self.level - 1);
        third_largest(self.times.iter()) * ratio <= AIM * self.budget_ms
    }

    fn change(&mut self, level: usize, climbed: bool) {
        // A level that has held for long is trusted again.
        if self.climbed && self.age > 2 * self.patience[self.level] {
            self.patience[self.level] = (self.patience[self.level] / 2).max(PATIENCE[0]);
        }
        self.level = level;
        self.climbed = climbed;
        self.age = 0;
        self.times.clear();
    }
}

/// Returns the third largest of `times`, so that two outliers do not make a trend; −∞ if there are fewer than
/// three.
fn third_largest<'a>(times: impl Iterator<Item = &'a f64>) -> f64 {
    let mut top = [f64::NEG_INFINITY; 3];
    for &ms in times {
        let at = top.iter().take_while(|&&t| t >= ms).count();
        if at < top.len() {
            top[at..].rotate_right(1);
            top[at] = ms;
        }
    }
    top[2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_best_level_that_is_too_slow_is_left_before_a_frame_is_late() {
        let mut controller = Controller::new(LevelCosts::new([1.0, 0.5, 0.25]), 10.0);
        controller.foresee(8.0);
        controller.foresee(f64::NAN);
        assert_eq!(controller.level(), 0);
        controller.foresee(30.0);
        assert_eq!(controller.level(), 2, "a quarter of 30 ms is in time, a half is not");
        controller.foresee(1000.0);
        assert_eq!(controller.level(), 2, "what the best level takes says nothing of this one");
    }
}
