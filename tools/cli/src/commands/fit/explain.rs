//! Estimates what a fit will cost before it begins. Memory and file size come from preparing it, and time
//! from running its first iterations on this device. Errors come from those after these iterations, and from
//! the ratio of final to early errors in measured fits of the same quality.

use std::time::{Duration, Instant};

use engine::Result;
use engine::fit::evaluate::{self, Protocol};
use engine::fit::{EARLY, Fitter, Problem, QualityPreset, Schedule, Start};
use engine::gpu::Gpu;
use engine::splat::{self, Splat, SplatSet};

use crate::report::estimate::{Estimate, VoxelErrors};
use crate::shared::inputs::Case;

/// Number of iterations that are not timed: kernels are compiled at the first one, and buffers grow.
const WARM_UP: u32 = 4;
/// Number of iterations of a batch, which is timed as a whole: one is recorded while another runs.
const BATCH: u32 = 4;
/// Time after which no further iterations are timed.
const TIMED: Duration = Duration::from_millis(2500);
/// Greatest number of iterations that are timed.
const MOST_TIMED: u32 = 64;
/// Ratio of the time of a later iteration to that of the first ones: splats that have found their places
/// reach other bricks. It is the median of the 28 fits of the default profile in
/// docs/results/paper-tables/runs (iterations after the 50th over those before), half of which lie between
/// 1.02 and 1.14.
const GROWTH: f64 = 1.07;

/// Times measured at the first iterations, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Rates {
    /// Time of reading the inputs and placing the first splats, which are done already.
    before: f64,
    /// Time of creating targets and buffers.
    setup: f64,
    /// Additional time of the first iterations.
    warm_up: f64,
    /// Mean time of an iteration over the whole fit.
    iteration: f64,
    /// Time of fetching figures and splats once.
    look: f64,
    /// Time of rounding the splats, and of finding the voxels that they have on the wrong side of the mask.
    finish: f64,
    /// Time of the closing evaluation.
    evaluation: f64,
}

impl Rates {
    /// Returns the number of iterations that a schedule leaves time for.
    fn iterations(&self, schedule: &Schedule) -> u32 {
        let Some(time) = schedule.time else { return schedule.iterations };
        let left = (time.as_secs_f64() - self.warm_up).max(0.0) / self.iteration.max(1e-9);
        // The conversion saturates if time is long and iterations are fast.
        schedule.iterations.min(left as u32).max(1)
    }

    /// Returns the time of `iterations`, with figures fetched `looks` times, seconds.
    fn fit(&self, iterations: u32, looks: u32) -> f64 {
        self.warm_up + f64::from(iterations) * self.iteration + f64::from(looks) * self.look
    }

    fn total(&self, iterations: u32, looks: u32) -> f64 {
        self.before + self.setup + self.fit(iterations, looks) + self.finish + self.evaluation
    }
}

/// Fit that is estimated.
pub struct Plan<'a> {
    /// Device object other than that of the fit, so that memory is counted separately.
    pub gpu: &'a Gpu,
    /// Problem of the fit.
    pub problem: &'a Problem<'a>,
    /// Volume and region as they were read, for the evaluation at the end.
    pub native: &'a Case,
    /// Start of the fit, and the splats there.
    pub begin: &'a Start,
    pub first: &'a [Splat],
    pub schedule: Schedule,
    /// The closing evaluation, if there is one.
    pub protocol: Option<Protocol>,
    /// Splats as they will be written, except for their values.
    pub set: &'a SplatSet,
    /// Iterations that rounding the splats takes after the fit.
    pub rounding_iterations: u32,
    pub output: &'a std::path::Path,
    /// Options with which they will be written.
    pub write: &'a splat::WriteOptions<'a>,
    /// Quality, if none of its settings was changed.
    pub quality: Option<&'static QualityPreset>,
    /// Error that the fit is to reach, in words, if there is one.
    pub target: Option<String>,
    /// Time since the command began.
    pub before: Duration,
}

/// Measures what a fit will cost.
pub fn estimate(plan: &Plan<'_>) -> Result<Estimate> {
    let begin = Instant::now();
    let mut rates = Rates { before: plan.before.as_secs_f64(), ..Rates::default() };
    let splats = time_iterations(plan, &mut rates)?;
    let evaluating = Instant::now();
    let early = errors(plan, &splats)?;
    if let Some(protocol) = &plan.protocol {
        // One grid is measured, and all cost the same.
        rates.evaluation = evaluating.elapsed().as_secs_f64() * (1 + protocol.offsets.len()) as f64;
    }
    let finishing = Instant::now();
    plan.problem.misclassified(plan.gpu, &plan.problem.splat_set(&splats, EARLY))?;
    rates.finish = finishing.elapsed().as_secs_f64() + f64::from(plan.rounding_iterations) * rates.iteration;
    let iterations = rates.iterations(&plan.schedule);
    let looks = iterations / u32::try_from(plan.problem.config().offset_count()).unwrap_or(1).max(LOOK_EVERY);
    Ok(Estimate {
        device: plan.gpu.description().name.clone(),
        splats: plan.first.len(),
        may_grow: plan.problem.config().topology()?.change.is_some()
            && plan.problem.config().topology_limit > 1.0,
        roi_voxels: plan.native.roi.voxel_count(),
        iterations,
        seconds: rates.total(iterations, looks),
        fit_seconds: rates.fit(iterations, looks),
        seconds_per_iteration: rates.iteration,
        device_peak_bytes: plan.gpu.peak_bytes(),
        file_bytes: splat::file_bytes(plan.output, plan.set, plan.write)?,
        early,
        expected: plan.quality.map(|quality| expected(quality, early)),
        target: plan.target.clone(),
        calibration_seconds: begin.elapsed().as_secs_f64(),
    })
}

/// Measures the errors of early splats at the voxels.
fn errors(plan: &Plan<'_>, early: &[Splat]) -> Result<VoxelErrors> {
    let native = plan.native;
    let there;
    let splats = if plan.problem.is_coarser() {
        there = plan.problem.splat_set(early, EARLY).to_voxel(&native.volume.world_from_voxel);
        &there
    } else {
        early
    };
    let range = plan.protocol.as_ref().map_or_else(|| native.full_range(), |p| p.range);
    let protocol =
        Protocol { offsets: Vec::new(), range, shell: plan.problem.config().shell, threshold: 0.0 };
    let found =
        evaluate::evaluate(plan.gpu, splats, &plan.problem.field(), &native.volume, &native.roi, &protocol)?;
    Ok(VoxelErrors { rmse_hu: found.on_grid.rmse_hu, p99_hu: found.on_grid.p99_hu })
}

/// Least number of iterations after which a fit fetches figures.
const LOOK_EVERY: u32 = 16;

/// Runs and times the fit's first iterations; returns the splats after [`EARLY`] of them.
fn time_iterations(plan: &Plan<'_>, rates: &mut Rates) -> Result<Vec<Splat>> {
    let setup = Instant::now();
    let mut fitter = plan.problem.fitter(plan.gpu, plan.begin)?;
    rates.setup = setup.elapsed().as_secs_f64();
    let schedule = Schedule { time: None, ..plan.schedule };
    let run = |fitter: &mut Fitter<'_>, count: u32| -> Result<f64> {
        let begin = Instant::now();
        fitter.run_to(fitter.iteration() + count, schedule)?;
        Ok(begin.elapsed().as_secs_f64())
    };
    let warm_up = run(&mut fitter, WARM_UP)?;
    let timing = Instant::now();
    let (mut done, mut spent) = (0, 0.0);
    let mut early = None;
    while early.is_none() || done < MOST_TIMED && timing.elapsed() < TIMED {
        let to_early = EARLY.saturating_sub(fitter.iteration());
        let batch = if to_early > 0 { to_early.min(BATCH) } else { BATCH };
        spent += run(&mut fitter, batch)?;
        done += batch;
        if early.is_none() && fitter.iteration() >= EARLY {
            let looking = Instant::now();
            fitter.progress()?;
            early = Some(fitter.splats()?);
            rates.look = looking.elapsed().as_secs_f64();
        }
    }
    let an_iteration = spent / f64::from(done);
    rates.iteration = GROWTH * an_iteration;
    rates.warm_up = (warm_up - f64::from(WARM_UP) * an_iteration).max(0.0);
    Ok(early.unwrap_or_default())
}

/// Returns the expected errors of a fit with this quality whose first iterations left errors `early`.
fn expected(quality: &QualityPreset, early: VoxelErrors) -> VoxelErrors {
    VoxelErrors {
        rmse_hu: quality.rmse_of_early * early.rmse_hu,
        p99_hu: quality.p99_of_early * early.p99_hu,
    }
}

#[cfg(test)]
mod tests {
    use engine::fit::QUALITIES;

    use super::*;

    #[test]
    fn time_is_what_the_parts_take() {
        let rates = Rates {
            before: 1.0,
            setup: 2.0,
            warm_up: 0.5,
            iteration: 0.1,
            look: 0.01,
            finish: 0.25,
            evaluation: 3.0,
        };
        assert!((rates.fit(400, 25) - 40.75).abs() < 1e-9);
        assert!((rates.total(400, 25) - 47.0).abs() < 1e-9);
        let limited = |seconds: u64, iterations| {
            rates.iterations(&Schedule { iterations, time: Some(Duration::from_secs(seconds)) })
        };
        assert_eq!(rates.iterations(&Schedule { iterations: 400, time: None }), 400);
        assert_eq!(limited(10, u32::MAX), 95, "after the half second of the first ones");
        assert_eq!(limited(10, 50), 50);
        assert_eq!(limited(0, 50), 1, "a fit does one iteration at least");
    }

    #[test]
    fn a_better_quality_leaves_less_of_the_early_errors() {
        let early = VoxelErrors { rmse_hu: 100.0, p99_hu: 400.0 };
        let all: Vec<VoxelErrors> = QUALITIES.iter().map(|quality| expected(quality, early)).collect();
        assert!(all.iter().all(|e| 0.0 < e.rmse_hu && e.rmse_hu < 100.0 && e.p99_hu < 400.0), "{all:?}");
        assert!(all.windows(2).all(|pair| pair[1].rmse_hu < pair[0].rmse_hu), "{all:?}");
    }
}
