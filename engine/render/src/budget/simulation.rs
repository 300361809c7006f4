//! Simulated GPUs to try a controller on: their frame times follow from a model and a seed.

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg32;

use super::{Controller, LevelCosts};

/// How a simulated GPU behaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Behaviour {
    /// Every frame takes the same time.
    Steady,
    /// Frames scatter by 8 %, and one in a hundred takes twice as long.
    Noisy,
    /// The clock falls to 55 % as the chip heats up, and rises again as it cools.
    Throttling,
    /// The scene costs 2.5 times as much from one frame on, and 600 frames later no more than before.
    SuddenLoad,
}

/// All behaviours with their names.
pub const BEHAVIOURS: [(&str, Behaviour); 4] = [
    ("steady", Behaviour::Steady),
    ("noisy", Behaviour::Noisy),
    ("throttling", Behaviour::Throttling),
    ("sudden load", Behaviour::SuddenLoad),
];

/// Frames between recording a frame and learning its time.
const LATENCY: usize = 2;
/// The frames during which [`Behaviour::SuddenLoad`] is under load.
pub const LOADED: std::ops::Range<usize> = 1200..1800;

/// A frame of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// The quality level that it was rendered on.
    pub level: usize,
    /// Device time, ms.
    pub gpu_ms: f64,
}

/// A simulated GPU.
pub struct SimulatedGpu {
    behaviour: Behaviour,
    random: Pcg32,
    /// Heat of the chip: 0 is cold, 1 as hot as full load makes it.
    heat: f64,
    frame: usize,
}

impl SimulatedGpu {
    /// Creates a cold GPU before its first frame.
    pub fn new(behaviour: Behaviour, seed: u64) -> Self {
        SimulatedGpu { behaviour, random: Pcg32::seed_from_u64(seed), heat: 0.0, frame: 0 }
    }

    /// Returns the device time of the next frame, ms. `work_ms` is what it takes without any disturbance,
    /// `period_ms` how long it is shown.
    pub fn frame(&mut self, work_ms: f64, period_ms: f64) -> f64 {
        let at = self.frame;
        self.frame += 1;
        match self.behaviour {
            Behaviour::Steady => work_ms,
            Behaviour::Noisy => {
                // Sum of four uniform numbers: nearly normal, without tails beyond 3.5 standard deviations.
                let even: f64 = (0..4).map(|_| self.random.random::<f64>() - 0.5).sum();
                let outlier = if self.random.random::<f64>() < 0.01 { 2.0 } else { 1.0 };
                work_ms * (1.0 + 0.08 * even * 3f64.sqrt()) * outlier
            }
            Behaviour::Throttling => {
                let ms = work_ms / (1.0 - 0.45 * ((self.heat - 0.5) * 2.0).clamp(0.0, 1.0));
                // Heat follows load with a time constant of 10 s.
                let load = (ms / period_ms).min(1.0);
                self.heat += (load - self.heat) * period_ms.max(ms) / 10_000.0;
                ms
            }
            Behaviour::SuddenLoad if LOADED.contains(&at) => work_ms * 2.5,
            Behaviour::SuddenLoad => work_ms,
        }
    }
}

/// Simulates `frames` frames of a GPU under a controller and returns them. `best_ms` is what the best level
/// takes without any disturbance.
pub fn trace(
    costs: &LevelCosts,
    behaviour: Behaviour,
    best_ms: f64,
    budget_ms: f64,
    frames: usize,
) -> Vec<Frame> {
    let mut gpu = SimulatedGpu::new(behaviour, 7);
    let mut controller = Controller::new(costs.clone(), budget_ms);
    let mut out: Vec<Frame> = Vec::with_capacity(frames);
    for at in 0..frames {
        let level = controller.level();
        let gpu_ms = gpu.frame(best_ms * costs.ratio(0, level), budget_ms);
        out.push(Frame { level, gpu_ms });
        if let Some(news) = at.checked_sub(LATENCY).map(|then| out[then]) {
            controller.finished(news.level, news.gpu_ms);
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::budget_ms;
    use super::*;

    fn costs() -> LevelCosts {
        LevelCosts::new([1.0, 0.84, 0.7, 0.56, 0.45, 0.35, 0.26, 0.18, 0.12])
    }

    fn late(frames: &[Frame], budget: f64) -> usize {
        frames.iter().filter(|f| f.gpu_ms > budget).count()
    }

    fn changes(frames: &[Frame]) -> usize {
        frames.windows(2).filter(|pair| pair[0].level != pair[1].level).count()
    }

    /// Runs `check` at 72, 90 and 120 Hz on scenes from one that fits to one that takes six times too long.
    fn each(behaviour: Behaviour, check: impl Fn(&[Frame], f64, f64, &str)) {
        for rate in [72.0, 90.0, 120.0] {
            for excess in [0.7, 1.0, 1.7, 3.0, 6.0] {
                let budget = budget_ms(rate);
                let frames = trace(&costs(), behaviour, budget * excess, budget, 6000);
                check(&frames, budget, excess, &format!("{behaviour:?}, {rate} Hz, {excess} of the budget"));
            }
        }
    }

    /// On a steady device: at most a few late frames at the start, the best level that leaves a margin, and
    /// rest.
    #[test]
    fn a_steady_device_settles_on_the_best_level_that_fits() {
        each(Behaviour::Steady, |frames, budget, excess, case| {
            assert!(late(frames, budget) <= LATENCY + 2, "{case}: {} late", late(frames, budget));
            let best = costs().within(0, 1.0 / excess);
            let last = frames[frames.len() - 1].level;
            assert!(last <= best + 1, "{case}: level {last}, while {best} fits");
            assert!(changes(&frames[1000..]) == 0, "{case}: {} changes", changes(&frames[1000..]));
        });
    }

    /// Where every hundredth frame is an outlier that nobody can foresee, the others are in time, and
    /// outliers are not chased.
    #[test]
    fn noise_and_outliers_are_not_chased() {
        each(Behaviour::Noisy, |frames, budget, excess, case| {
            let settled = &frames[1000..];
            let share = late(settled, budget) as f64 / settled.len() as f64;
            assert!(share < 0.015, "{case}: {:.2} % late", share * 100.0);
            let levels: f64 = settled.iter().map(|f| f.level as f64).sum::<f64>() / settled.len() as f64;
            let best = costs().within(0, 1.0 / (1.2 * excess)) as f64;
            assert!(levels <= best + 1.5, "{case}: level {levels:.1} in the mean, while {best} fits");
            assert!(changes(settled) <= 12, "{case}: {} changes", changes(settled));
        });
    }

    /// A device that heats up: p99 within the budget, and the levels follow the heat instead of hunting it.
    #[test]
    fn throttling_is_followed() {
        each(Behaviour::Throttling, |frames, budget, excess, case| {
            // Where a hot device is too slow on the last level, there is nothing to follow.
            if excess * 0.12 / 0.55 > 0.9 {
                return;
            }
            let settled = &frames[100..];
            let share = late(settled, budget) as f64 / settled.len() as f64;
            assert!(share <= 0.01, "{case}: {:.2} % late", share * 100.0);
            assert!(changes(&frames[3000..]) <= 8, "{case}: {} changes", changes(&frames[3000..]));
        });
    }

    /// A load that comes at once is answered within the latency and two more frames, and when it goes the
    /// quality returns.
    #[test]
    fn a_sudden_load_is_answered_at_once_and_forgotten_later() {
        each(Behaviour::SuddenLoad, |frames, budget, excess, case| {
            let missed = late(&frames[LOADED.start..LOADED.end], budget);
            // Where even the last level does not fit there is nothing to do but to render it.
            let fits = 2.5 * excess * 0.12 <= 1.0;
            assert!(!fits || missed <= LATENCY + 3, "{case}: {missed} late");
            let (before, after) = (frames[LOADED.start - 1].level, frames[frames.len() - 1].level);
            assert_eq!(before, after, "{case}");
            let back = frames[LOADED.end..].iter().position(|f| f.level == before);
            assert!(back.is_some_and(|n| n < 9 * 70), "{case}: back after {back:?} frames");
        });
    }

    #[test]
    fn going_up_in_vain_is_tried_ever_less_often() {
        // The next level is claimed to be 5 % dearer and is twice as dear: every attempt fails.
        let costs = LevelCosts::new([1.0, 0.95]);
        let mut controller = Controller::new(costs, 10.0);
        let mut attempts = Vec::new();
        for frame in 0..20_000 {
            let level = controller.level();
            controller.finished(level, if level == 0 { 12.0 } else { 6.0 });
            if level == 1 && controller.level() == 0 {
                attempts.push(frame);
            }
        }
        let waits: Vec<usize> = attempts.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(waits.len() >= 4 && waits.windows(2).all(|w| w[1] > w[0] || w[1] > 7000), "{waits:?}");
    }

    #[test]
    fn late_news_of_another_level_and_nonsense_are_ignored() {
        let mut controller = Controller::new(costs(), 10.0);
        for _ in 0..100 {
            controller.finished(3, 1e3);
            controller.finished(0, f64::NAN);
        }
        assert_eq!(controller.level(), 0);
        controller.finished(0, 20.0);
        controller.finished(0, 20.0);
        assert_eq!(controller.level(), 5, "down to the level of 0.35 at once, that of 0.425 and less");
    }

    #[test]
    #[should_panic(expected = "costs of quality levels go down")]
    fn costs_that_go_up_are_refused() {
        LevelCosts::new([1.0, 0.5, 0.6]);
    }
}
