//! Estimates what a fit will cost before it begins. Memory and file size come from preparing it, and time
//! from running its first iterations on this device. Errors come from those after these iterations, and from
//! the ratio of final to early errors in measured fits of the same quality.

use std::time::{Duration, Instant};

use engine::Result;
use engine::coded::in_place_of_splats;
use engine::fit::evaluate::{self, Protocol};
use engine::fit::{EARLY, Fitter, Goal, QualityPreset, ROUNDING_ITERATIONS, Schedule, Start};
use engine::gpu::Gpu;
use engine::splat::{self, Splat, SplatSet};

use super::prepare::Prepared;
use crate::report::estimate::{CodedEstimate, Estimate, VoxelErrors};
use crate::shared::waiting::Waiting;

/// Number of iterations that are not timed: kernels are compiled at the first one, and buffers grow.
const WARM_UP: u32 = 4;
/// Number of iterations of a batch, which is timed as a whole: one is recorded while another runs.
const BATCH: u32 = 4;
/// Time after which no further iterations are timed.
const TIMED: Duration = Duration::from_millis(2500);
/// Greatest number of iterations that are timed.
const MOST_TIMED: u32 = 64;
/// Ratio of the memory of a fit to that of its first iterations, and of the closing evaluation to that of the splats
/// after them: splats that have found their places reach more bricks, and the buffers of pairs grow by half of what they
/// need, once, or not at all. These are the greatest ratios that were seen (docs/results/tradeoffs.md), so less may come.
const FIT_MEMORY_GROWTH: f64 = 1.45;
const EVALUATION_MEMORY_GROWTH: f64 = 1.9;
/// Number of fits in which rounded splats are fitted again.
const ROUNDING_FITS: f64 = 3.0;
/// Ratio of the time of a later iteration to that of the first ones: splats that have found their places
/// reach other bricks. It is the median of the 28 fits of the default profile in
/// docs/results/paper-tables/runs (iterations after the 50th over those before), half of which lie between
/// 1.02 and 1.14.
const GROWTH: f64 = 1.07;

/// Times measured at the first iterations, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Rates {
    /// Time of reading the inputs, finding the number of splats and placing the first, which are done already.
    before: f64,
    /// Time of creating targets and buffers.
    setup: f64,
    /// Additional time of the first iterations.
    warm_up: f64,
    /// Mean time of an iteration over the whole fit.
    iteration: f64,
    /// Time of fetching figures and splats once.
    look: f64,
    /// Time of rounding the splats.
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
pub struct Trying<'a> {
    /// Device object other than that of the fit, so that memory is counted separately ...
    pub gpu: &'a Gpu,
    /// ... and one for the closing evaluation.
    pub gpu_of_evaluation: &'a Gpu,
    /// The fit.
    pub prepared: &'a Prepared<'a>,
    /// Start of the fit, and the splats there.
    pub begin: &'a Start,
    pub first: &'a [Splat],
    /// Time when the estimate began.
    pub begun: Instant,
}

/// Measures what a fit will cost.
pub fn estimate(plan: &Trying<'_>) -> Result<Estimate> {
    let Trying { gpu, prepared, first, begun, .. } = plan;
    let Prepared { plan: fit, case, settings, .. } = prepared;
    let problem = fit.problem();
    let waiting = Waiting::on("running the first iterations, to estimate what the fit will cost");
    let mut rates = Rates { before: prepared.before.as_secs_f64(), ..Rates::default() };
    let splats = time_iterations(plan, &mut rates, &waiting)?;
    let early = errors(plan, &splats)?;
    let set = prepared.plan.first_set(&splats, settings.config.iterations);
    if set.rounding.is_some() {
        // A fit of its own behind each of the groups that are rounded, but the last.
        rates.finish = f64::from(ROUNDING_ITERATIONS) * rates.iteration + ROUNDING_FITS * rates.setup;
    }
    if let Some(protocol) = &prepared.protocol {
        rates.evaluation = evaluation_seconds(plan, &set, &splats, protocol)?;
    }
    let iterations = rates.iterations(&fit.schedule());
    let looks = iterations / u32::try_from(problem.config().offset_count()).unwrap_or(1).max(LOOK_EVERY);
    let expected = expected(plan, early);
    let coded = expected.and_then(|errors| in_place_of_splats(&case.volume, &case.roi, errors.rmse_hu));
    Ok(Estimate {
        device: gpu.description().name.clone(),
        splats: first.len(),
        may_grow: problem.config().topology()?.change.is_some() && problem.config().topology.limit > 1.0,
        roi_voxels: case.roi.voxel_count(),
        iterations,
        seconds: rates.total(iterations, looks),
        before_seconds: rates.before,
        trial_seconds: fit.counted().as_secs_f64(),
        fit_seconds: rates.fit(iterations, looks),
        finish_seconds: rates.setup + rates.finish + rates.evaluation,
        seconds_per_iteration: rates.iteration,
        device_peak_bytes: peak_bytes(plan),
        file_bytes: file_bytes(plan, set)?,
        early,
        expected,
        coded: coded.map(|of| CodedEstimate { bound: of.bound, file_bytes: of.bytes }),
        target: fit.goal().map(|goal| {
            let about = if settings.is_aim() { "about " } else { "" };
            format!("{about}{}", goal.text(case.volume.unit().text()))
        }),
        calibration_seconds: begun.elapsed().as_secs_f64(),
        found_seconds: prepared.start.elapsed().as_secs_f64(),
    })
}

/// Returns the most device memory of trials, which have been on the device of the fit, of the fit and of the closing
/// evaluation.
fn peak_bytes(plan: &Trying<'_>) -> u64 {
    let [fit, evaluation] = [plan.gpu, plan.gpu_of_evaluation].map(Gpu::peak_bytes);
    tracing::debug!("peaks: trials {}, fit {fit}, evaluation {evaluation}", plan.prepared.gpu.peak_bytes());
    let later = |bytes: u64, growth: f64| (bytes as f64 * growth) as u64;
    plan.prepared
        .gpu
        .peak_bytes()
        .max(later(fit, FIT_MEMORY_GROWTH))
        .max(later(evaluation, EVALUATION_MEMORY_GROWTH))
}

/// Returns the bytes of the file, by the set of early splats.
fn file_bytes(plan: &Trying<'_>, early: SplatSet) -> Result<u64> {
    let Prepared { files, write, .. } = plan.prepared;
    splat::file_bytes(&files.splats, &early, write)
}

/// Measures the errors of early splats at the voxels.
fn errors(plan: &Trying<'_>, early: &[Splat]) -> Result<VoxelErrors> {
    let Prepared { plan: fit, case, protocol, .. } = plan.prepared;
    let problem = fit.problem();
    let there;
    let splats = if problem.has_own_grid() {
        there = problem.splat_set(early, EARLY).to_voxel(&case.volume.world_from_voxel);
        &there
    } else {
        early
    };
    let range = protocol.as_ref().map_or_else(|| case.full_range(), |p| p.range);
    let protocol =
        Protocol { offsets: Vec::new(), range, shell: problem.config().loss.shell, threshold: 0.0 };
    let found = evaluate::evaluate(plan.gpu, splats, &problem.field(), &case.volume, &case.roi, &protocol)?;
    Ok(VoxelErrors { rmse_hu: found.on_grid.rmse_hu, p99_hu: found.on_grid.p99_hu })
}

/// Returns the time of the closing evaluation, seconds. It is measured with no grid between the voxels and with one,
/// and all others cost the same.
fn evaluation_seconds(
    plan: &Trying<'_>,
    set: &SplatSet,
    splats: &[Splat],
    protocol: &Protocol,
) -> Result<f64> {
    let timed = |offsets: &[[f32; 3]]| -> Result<f64> {
        let begin = Instant::now();
        let protocol = Protocol { offsets: offsets.to_vec(), ..protocol.clone() };
        plan.prepared.measure(plan.gpu_of_evaluation, set, splats, &protocol)?;
        Ok(begin.elapsed().as_secs_f64())
    };
    // The first time kernels are compiled, as in the fit.
    let at_voxels = timed(&[])?;
    let Some(one) = protocol.offsets.get(..1) else { return Ok(at_voxels) };
    let (again, between) = (timed(&[])?, timed(one)?);
    Ok(at_voxels + (between - again).max(0.0) * protocol.offsets.len() as f64)
}

/// Least number of iterations after which a fit fetches figures.
const LOOK_EVERY: u32 = 16;

/// Runs and times the fit's first iterations; returns the splats after [`EARLY`] of them.
fn time_iterations(plan: &Trying<'_>, rates: &mut Rates, waiting: &Waiting) -> Result<Vec<Splat>> {
    let setup = Instant::now();
    let mut fitter = plan.prepared.plan.problem().fitter(plan.gpu, plan.begin)?;
    rates.setup = setup.elapsed().as_secs_f64();
    let schedule = Schedule { time: None, ..plan.prepared.plan.schedule() };
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
        let by_time = timing.elapsed().as_secs_f64() / TIMED.as_secs_f64();
        let by_count = f64::from(fitter.iteration()) / f64::from(EARLY);
        waiting.at(by_time.min(by_count).max(f64::from(done) / f64::from(MOST_TIMED)).min(1.0));
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

/// Returns the errors to expect. With a target they are that, and what it says of the other figure by their ratio in
/// the early splats; else they are known for an unchanged quality.
fn expected(plan: &Trying<'_>, early: VoxelErrors) -> Option<VoxelErrors> {
    let Prepared { settings, plan: fit, .. } = plan.prepared;
    let goal = fit.goal();
    match goal {
        Some(goal) => expected_of_goal(goal, early),
        None => settings.plain_quality().map(|quality| expected_of_quality(quality, early)),
    }
}

/// Returns the expected errors of a fit with a target. Of two parts of a target the one that asks for more counts.
fn expected_of_goal(goal: &Goal, early: VoxelErrors) -> Option<VoxelErrors> {
    let p99_of_rmse = early.p99_hu / early.rmse_hu;
    let span = f64::from(goal.range[1]) - f64::from(goal.range[0]);
    let rmse_of_psnr = goal.psnr_db.map(|db| span * 10f64.powf(-db / 20.0));
    let rmse_of_p99 = goal.p99_hu.map(|p99| p99 / p99_of_rmse);
    let rmse_hu =
        rmse_of_psnr.into_iter().chain(rmse_of_p99).filter(|rmse| rmse.is_finite()).reduce(f64::min)?;
    Some(VoxelErrors { rmse_hu, p99_hu: rmse_hu * p99_of_rmse })
}

/// Returns the expected errors of a fit with this quality whose first iterations left errors `early`.
fn expected_of_quality(quality: &QualityPreset, early: VoxelErrors) -> VoxelErrors {
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
    fn a_target_is_what_is_expected() {
        let early = VoxelErrors { rmse_hu: 50.0, p99_hu: 200.0 };
        let goal = |psnr_db, p99_hu| Goal { psnr_db, p99_hu, range: [-1024.0, 3071.0], threshold: 0.0 };
        let of = |psnr, p99| expected_of_goal(&goal(psnr, p99), early).expect("a target");
        assert_eq!(of(None, Some(30.0)), VoxelErrors { rmse_hu: 7.5, p99_hu: 30.0 });
        let psnr = of(Some(60.0), None);
        assert!((psnr.rmse_hu - 4.095).abs() < 1e-9 && (psnr.p99_hu - 16.38).abs() < 1e-9, "{psnr:?}");
        assert_eq!(of(Some(60.0), Some(30.0)), psnr, "the one that asks for more");
    }

    #[test]
    fn a_better_quality_leaves_less_of_the_early_errors() {
        let early = VoxelErrors { rmse_hu: 100.0, p99_hu: 400.0 };
        let all: Vec<VoxelErrors> =
            QUALITIES.iter().map(|quality| expected_of_quality(quality, early)).collect();
        assert!(all.iter().all(|e| 0.0 < e.rmse_hu && e.rmse_hu < 100.0 && e.p99_hu < 400.0), "{all:?}");
        assert!(all.windows(2).all(|pair| pair[1].rmse_hu < pair[0].rmse_hu), "{all:?}");
    }
}
