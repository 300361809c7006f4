//! The loop of a fit: schedule, progress, signals, and what to keep when it goes wrong.

use std::time::{Duration, Instant};

use engine::fit::{FitConfig, Fitter, Progress};
use engine::gpu::Gpu;
use engine::splat::{self, Field, Form, Grid, Splat};
use engine::{Error, Kind, Result};

use super::checkpoint::{Checkpoints, Interrupted};
use crate::report::curve::CurvePoint;
use crate::shared::console::Console;
use crate::shared::inputs::{Case, grid_of};
use crate::shared::progress::Display;
use crate::shared::signals::Signals;

/// Figures and splats are fetched at least this many iterations apart ...
const FIGURES_EVERY: u32 = 20;
/// ... or this long, if that comes first: fetching waits for the device.
const FIGURES_AFTER: Duration = Duration::from_millis(500);
/// They belong to the offset grid of their iteration, so they are fetched where the same grid has its turn; if that
/// takes longer than this, anywhere.
const FIGURES_AT_LATEST: Duration = Duration::from_secs(20);

/// Fetching takes at most one part in so many of the time.
const LOOK_SHARE: u32 = 10;

/// How long a fit goes on.
#[derive(Clone, Copy, Debug)]
pub struct Schedule {
    /// The most iterations.
    pub iterations: u32,
    /// The time for all iterations.
    pub time: Option<Duration>,
}

impl Schedule {
    /// The part that is done, 0 to 1: of whichever limit is nearer.
    fn share(&self, iteration: u32, elapsed: Duration) -> f64 {
        let of_iterations = f64::from(iteration) / f64::from(self.iterations.max(1));
        let of_time = self.time.map_or(0.0, |t| elapsed.as_secs_f64() / t.as_secs_f64().max(1e-9));
        of_iterations.max(of_time).min(1.0)
    }
}

/// Where a fit begins.
pub enum Start {
    /// With first splats, in voxel space and HU.
    Splats(Vec<Splat>),
    /// Where it was interrupted.
    Interrupted(Interrupted),
}

/// How the loop ended.
pub enum End {
    /// As planned.
    Finished,
    /// By a signal; the exit code that stands for it.
    Stopped(u8),
    /// By a fault of the device or because the error was no number any more.
    Failed(Error),
}

/// What a fit came to.
pub struct Outcome {
    /// The last good splats, in voxel space and HU.
    pub splats: Vec<Splat>,
    /// Iterations behind these splats.
    pub iterations: u32,
    /// Time of the iterations.
    pub seconds: f64,
    /// Figures on the way.
    pub curve: Vec<CurvePoint>,
    /// HU range that the figures' PSNR is over.
    pub range: [f32; 2],
    /// What follows an intensity in texts.
    pub unit: &'static str,
    /// Updates that were left out because a gradient was not finite.
    pub frozen: u32,
    /// Bytes of device memory by purpose, at the end.
    pub device_bytes: std::collections::BTreeMap<&'static str, u64>,
    /// How it ended.
    pub end: End,
}

/// What is fitted, how and for how long, and who hears of it.
pub struct Job<'a> {
    pub gpu: &'a Gpu,
    pub case: &'a Case,
    pub config: &'a FitConfig,
    pub schedule: Schedule,
    pub checkpoints: &'a Checkpoints,
    pub signals: &'a Signals,
    pub console: &'a Console,
}

/// Fits splats to a case.
pub fn run(job: &Job<'_>, start: Start) -> Result<Outcome> {
    let &Job { gpu, case, config, schedule, checkpoints, signals, console } = job;
    let (mut fitter, mut curve, seconds) = match start {
        Start::Splats(first) => (Fitter::new(gpu, &case.volume, &case.roi, &first, config)?, Vec::new(), 0.0),
        Start::Interrupted(Interrupted { state, seconds, curve }) => {
            (Fitter::resume(gpu, &case.volume, &case.roi, &state, config)?, curve, seconds)
        }
    };
    // Infinity is not written.
    for point in &mut curve {
        point.progress.psnr_db = -10.0 * point.progress.mse.log10();
    }
    let first = fitter.splats()?;
    let iterations = fitter.iteration();
    let range = [fitter.scaling().range.0, fitter.scaling().range.1];
    // Uploads and kernels are not part of the passes' account.
    gpu.take_profile();
    signals.defer_first_signal();
    console.say(&format!(
        "{}fitting {} splats to {} voxels; the PSNR on the way is over {} to {}{}",
        if iterations > 0 { format!("going on after {iterations} iterations: ") } else { String::new() },
        first.len(),
        case.roi.voxel_count(),
        range[0],
        range[1],
        case.volume.unit()
    ));
    let mut state = State {
        good: first,
        iterations,
        curve,
        before: Duration::from_secs_f64(seconds),
        start: Instant::now(),
        last: (iterations, Instant::now()),
        looked: Duration::ZERO,
        grids: u32::try_from(config.offsets).unwrap_or(1).max(1),
        display: Display::new(console),
        checkpoints,
        saved: iterations,
        grid: (grid_of(&case.volume), config.fitted_form(&case.roi)),
        field: config.field(fitter.scaling().background),
    };
    let end = match state.iterate(&mut fitter, schedule, signals) {
        Ok(end) => end,
        Err(error) => End::Failed(error),
    };
    let seconds = state.elapsed().as_secs_f64();
    Ok(Outcome {
        splats: state.good,
        iterations: state.iterations,
        seconds,
        curve: state.curve,
        range,
        unit: case.volume.unit(),
        frozen: fitter.frozen().unwrap_or_default(),
        device_bytes: gpu.memory_by_purpose(),
        end,
    })
}

struct State<'a> {
    /// The last splats that were seen to be good, and the iterations behind them.
    good: Vec<Splat>,
    iterations: u32,
    curve: Vec<CurvePoint>,
    /// Time of the iterations before this run went on.
    before: Duration,
    start: Instant,
    /// When figures were fetched last.
    last: (u32, Instant),
    /// How long that took.
    looked: Duration,
    /// Offset grids that the iterations visit in turn.
    grids: u32,
    display: Display,
    checkpoints: &'a Checkpoints,
    /// The iteration of the last checkpoint.
    saved: u32,
    grid: (Grid, Form),
    field: Field,
}

impl State<'_> {
    fn elapsed(&self) -> Duration {
        self.before + self.start.elapsed()
    }

    fn iterate(&mut self, fitter: &mut Fitter, schedule: Schedule, signals: &Signals) -> Result<End> {
        loop {
            let share = schedule.share(fitter.iteration(), self.elapsed());
            let stop = signals.exit_code();
            let is_last = share >= 1.0 && fitter.iteration() > 0;
            let (iteration, time) = self.last;
            let since = fitter.iteration().saturating_sub(iteration);
            let same_grid = fitter.iteration().is_multiple_of(self.grids);
            let due = since >= FIGURES_EVERY || since > 0 && time.elapsed() >= FIGURES_AFTER;
            // Where only a subset is rasterized the figures cost more than an iteration.
            let due = due && time.elapsed() >= LOOK_SHARE * self.looked;
            let save = self.checkpoints.is_due(fitter.iteration()) && fitter.iteration() > self.saved;
            let overdue = since > 0 && time.elapsed() >= FIGURES_AT_LATEST;
            if is_last || stop.is_some() || save || due && same_grid || overdue {
                if since > 0 {
                    self.look(fitter)?;
                }
                // The count may have gone back where buffers had to grow: then it is not over yet.
                if self.checkpoints.is_due(fitter.iteration()) && fitter.iteration() > self.saved {
                    self.save(fitter)?;
                }
                if let Some(code) = stop {
                    self.checkpoints.write_state(
                        &fitter.state()?,
                        self.elapsed().as_secs_f64(),
                        &self.curve,
                    )?;
                    return Ok(End::Stopped(code));
                }
                if is_last && schedule.share(fitter.iteration(), self.elapsed()) >= 1.0 {
                    self.checkpoints.clean();
                    return Ok(End::Finished);
                }
            }
            fitter.step(share)?;
            self.display.show(fitter.iteration(), share);
        }
    }

    /// Writes a checkpoint of the splats just fetched.
    fn save(&mut self, fitter: &mut Fitter) -> Result<()> {
        let state = fitter.state()?;
        self.checkpoints.write_splats(&self.good, self.iterations, self.grid, self.field)?;
        self.checkpoints.write_state(&state, self.elapsed().as_secs_f64(), &self.curve)?;
        self.saved = state.iteration;
        Ok(())
    }

    /// Fetches figures and splats, and keeps them if they are good.
    fn look(&mut self, fitter: &mut Fitter) -> Result<()> {
        let begin = Instant::now();
        let progress = fitter.progress()?;
        let splats = fitter.splats()?;
        check(&progress, &splats, self.iterations)?;
        self.good = splats;
        self.iterations = progress.iteration;
        self.last = (progress.iteration, Instant::now());
        self.display.figures(&progress);
        self.looked = begin.elapsed();
        self.curve.push(CurvePoint { seconds: self.elapsed().as_secs_f64(), progress });
        Ok(())
    }
}

/// Refuses a state that is no longer a fit. `kept` is the iteration of the last good one.
fn check(progress: &Progress, splats: &[Splat], kept: u32) -> Result<()> {
    let bad = splats.iter().filter(|s| splat::defect(s).is_some()).count();
    let errors = [Some(progress.mse), Some(progress.occupancy_rmse), progress.dice, progress.leak];
    if bad == 0 && errors.iter().flatten().all(|e| e.is_finite()) {
        return Ok(());
    }
    let message = format!(
        "the fit diverged after {} iterations (mean squared error {}, {bad} unusable splats); the splats of iteration \
         {kept} are kept",
        progress.iteration, progress.mse
    );
    Err(Error::new(Kind::Internal, "VGS-FIT-010", message)
        .help("lower the learning rates; if they are the default ones, please report it"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_state_that_is_no_fit_any_more_is_refused() {
        let progress = Progress {
            iteration: 9,
            mse: 0.0,
            psnr_db: f64::INFINITY,
            occupancy_rmse: 0.1,
            dice: Some(0.2),
            leak: None,
        };
        let splat = Splat { rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
        assert!(check(&progress, &[splat], 5).is_ok(), "an exact fit is none that diverged");
        let rows = [
            (Progress { mse: f64::NAN, ..progress }, splat),
            (Progress { occupancy_rmse: f64::INFINITY, ..progress }, splat),
            (Progress { dice: Some(f64::NAN), ..progress }, splat),
            (Progress { leak: Some(f64::INFINITY), ..progress }, splat),
            (progress, Splat { intensity: f32::NAN, ..splat }),
        ];
        for (progress, splat) in rows {
            let error = check(&progress, &[splat], 5).expect_err("diverged");
            assert_eq!((error.kind, error.code), (Kind::Internal, "VGS-FIT-010"));
            assert!(error.message.contains("iteration 5 are kept"), "{}", error.message);
        }
    }

    #[test]
    fn the_nearer_limit_sets_the_schedule() {
        let schedule = Schedule { iterations: 100, time: Some(Duration::from_secs(10)) };
        for (iteration, seconds, share) in
            [(0, 0, 0.0), (50, 1, 0.5), (10, 5, 0.5), (200, 1, 1.0), (1, 20, 1.0)]
        {
            assert_eq!(schedule.share(iteration, Duration::from_secs(seconds)), share);
        }
    }
}
