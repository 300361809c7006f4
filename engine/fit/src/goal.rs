//! The error that a fit is to reach, in place of a number of splats.

use super::FitConfig;
use super::evaluate::Metrics;

/// Error that a fit is to reach at the voxels of the region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    /// Least PSNR, dB; none if it does not matter.
    pub psnr_db: Option<f64>,
    /// Greatest error of 99 % of the voxels, HU; none if it does not matter.
    pub p99_hu: Option<f64>,
    /// Range of the PSNR, HU.
    pub range: [f32; 2],
    /// Above 0: every voxel whose mask exceeds this counts alike; 0: the mask weighs them.
    pub threshold: f32,
}

impl Goal {
    /// Returns the goal of a configuration, with the PSNR over `range` (HU); none if it has none.
    pub fn of(config: &FitConfig, range: [f32; 2], threshold: f32) -> Option<Goal> {
        let wanted = |value: f32| (value > 0.0).then_some(f64::from(value));
        let goal = Goal {
            psnr_db: wanted(config.count.target_psnr),
            p99_hu: wanted(config.count.target_hu),
            range,
            threshold,
        };
        config.has_goal().then_some(goal)
    }

    /// Returns by how much an error is better than the goal, dB; below 0 it is worse. The part of the goal that
    /// is missed by most counts; 20 log₁₀ makes decibels of HU.
    pub fn surplus_db(&self, psnr_db: f64, p99_hu: f64) -> f64 {
        let psnr = self.psnr_db.map_or(f64::INFINITY, |least| psnr_db - least);
        let p99 = self.p99_hu.map_or(f64::INFINITY, |most| 20.0 * (most / p99_hu.max(1e-9)).log10());
        psnr.min(p99)
    }

    /// Describes the goal in a few words; `unit` is the text behind an intensity.
    pub fn text(&self, unit: &str) -> String {
        let psnr = self.psnr_db.map(|db| format!("a PSNR of {db} dB"));
        let p99 = self.p99_hu.map(|hu| format!("99 % of the voxels within {hu}{unit} of the scan"));
        psnr.into_iter().chain(p99).collect::<Vec<_>>().join(" with ")
    }

    /// Returns [`Goal::surplus_db`] of figures at the voxels.
    pub fn surplus_of(&self, metrics: &Metrics) -> f64 {
        self.surplus_db(metrics.psnr_db, metrics.p99_hu)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_part_that_is_missed_by_most_counts() {
        let config = FitConfig::default().with(|c| {
            c.count.target_psnr = 45.0;
            c.count.target_hu = 50.0;
        });
        let goal = Goal::of(&config, [0.0, 1.0], 0.0).expect("a goal");
        assert!((goal.surplus_db(46.0, 25.0) - 1.0).abs() < 1e-6);
        assert!((goal.surplus_db(48.0, 50.0) - 0.0).abs() < 1e-6);
        assert!((goal.surplus_db(48.0, 100.0) + 6.02).abs() < 0.01, "twice the error is 6 dB");
        let psnr = config.with(|c| c.count.target_hu = 0.0);
        let goal = Goal::of(&psnr, [0.0, 1.0], 0.0).expect("a goal");
        assert!((goal.surplus_db(44.0, 1e6) + 1.0).abs() < 1e-6);
        assert!(goal.surplus_db(f64::INFINITY, 0.0).is_infinite(), "an exact fit reaches every goal");
        assert_eq!(Goal::of(&FitConfig::default(), [0.0, 1.0], 0.0), None);
    }
}
