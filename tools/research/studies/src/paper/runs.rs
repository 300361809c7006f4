//! Carries out a run: fits, and measures on the way.
//!
//! Measurements rasterize all splats at the voxel centres, on a device object of their own, so that neither
//! their time nor their memory is part of what the fit is said to cost.

use std::time::Instant;

use engine::Result;
use engine::fidelity::evaluate_decoded;
use engine::fit::evaluate::{self, Evaluation, Protocol};
use engine::fit::{Beginning, End, FitForm, Milestone, Problem, Start, Watch};
use engine::gpu::{Gpu, GpuOptions};
use engine::splat::{self, Splat, SplatSet};
use serde::{Deserialize, Serialize};

use super::job::{HELD_OUT_SEED, Job, Range};
use super::library::Place;
use bench::cost::cpu_ms;
use bench::scene::Scene;
use bench::store::Keep;

/// One measurement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Iterations done.
    pub iteration: u32,
    /// Time of these iterations without measurements, seconds.
    pub seconds: f64,
    /// Number of splats.
    pub splats: usize,
    /// MMSE, equation (4), on the grid, all splats.
    pub mmse: f64,
}

impl Point {
    /// Returns the PSNR, dB.
    pub fn psnr(&self) -> f64 {
        -10.0 * self.mmse.log10()
    }
}

/// Additional figures of the measurement at the end.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Last {
    /// Soft Dice on the grid, over ROI and shell.
    pub soft_dice: f64,
    /// Occupancy error on the grid, over ROI and shell.
    pub occupancy_rmse: f64,
    /// Errors on the grid, HU; `None` in files from before these were kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub errors: Option<Errors>,
    /// Errors between the voxels, if they were asked for.
    pub held_out: Option<HeldOut>,
}

/// Errors of the intensity, HU.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Root mean square.
    pub rmse_hu: f64,
    /// 99th percentile of the absolute error.
    pub p99_hu: f64,
}

/// Figures at offsets that the fit has not seen.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct HeldOut {
    /// The worst PSNR, dB.
    pub worst: f64,
    /// The mean PSNR, dB.
    pub mean: f64,
    /// Occupancy error over all offsets.
    pub occupancy_rmse: f64,
}

/// Result of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Job that was run.
    pub job: Job,
    /// Measurements from iteration 0 on.
    pub points: Vec<Point>,
    /// Figures at the end; `None` if the fit diverged.
    pub last: Option<Last>,
    /// Iteration of the first measurement that was not a finite number, after which the run was stopped.
    pub diverged_at: Option<u32>,
    /// Range of the normalisation, HU.
    pub range: [f32; 2],
    /// Sum of the mask.
    pub roi_voxels: f64,
    /// Time to place the first splats, seconds.
    pub initialise_seconds: f64,
    /// Most bytes of device memory that the fit held at once.
    pub device_peak_bytes: u64,
    /// Updates of splats that were left out because a gradient was not finite.
    pub frozen: u32,
    /// Driver of the device.
    pub driver: String,
    /// Cost of the whole fit; `None` in files from before this was kept, and for a fit that diverged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cost: Option<FitCost>,
}

/// Cost of a fit from the volume in memory to the last splats, without measurements.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FitCost {
    /// Time until the first iteration (first splats, targets, kernels), seconds.
    pub setup_seconds: f64,
    /// Time of the whole fit, seconds.
    pub seconds: f64,
    /// CPU time of the whole fit (user and system, all threads), seconds; `None` if the system does not tell.
    pub core_seconds: Option<f64>,
    /// Size of the PLY of the last splats, bytes.
    pub file_bytes: u64,
}

/// Time and CPU time, seconds.
#[derive(Clone, Copy, Debug, Default)]
struct CostSoFar {
    wall: f64,
    core: Option<f64>,
}

/// Measures time and CPU time from its start on.
struct Clock(Instant, Option<f64>);

impl Clock {
    fn start() -> Self {
        Clock(Instant::now(), cpu_ms())
    }

    fn add_to(self, spent: &mut CostSoFar) {
        spent.wall += self.0.elapsed().as_secs_f64();
        let core = self.1.zip(cpu_ms()).map(|(from, to)| 1e-3 * (to - from));
        spent.core = core.map(|core| spent.core.unwrap_or_default() + core);
    }
}

impl Keep for Record {
    fn key(&self) -> String {
        self.job.key()
    }

    fn defect(&self) -> Option<&'static str> {
        self.points.is_empty().then_some("this result has no measurement")
    }
}

impl Record {
    /// Returns the core-seconds of a second of the fit; 1 if they are not known.
    pub fn cores(&self) -> f64 {
        let cost = self.cost.as_ref().filter(|cost| cost.seconds > 0.0);
        cost.and_then(|cost| Some(cost.core_seconds? / cost.seconds)).unwrap_or(1.0)
    }

    /// Returns the first measurement, which is that of the initialisation.
    pub fn start(&self) -> Option<&Point> {
        self.points.first()
    }

    /// Returns the last measurement.
    pub fn end(&self) -> Option<&Point> {
        self.points.last()
    }

    /// Returns the best measurement; iteration 0 counts.
    pub fn best(&self) -> Option<&Point> {
        self.points.iter().min_by(|a, b| a.mmse.total_cmp(&b.mmse))
    }

    /// Returns the worst measurement; iteration 0 counts.
    pub fn worst(&self) -> Option<&Point> {
        self.points.iter().max_by(|a, b| a.mmse.total_cmp(&b.mmse))
    }

    /// Returns the worst measurement after iteration 0.
    pub fn worst_after_start(&self) -> Option<&Point> {
        self.points.iter().skip(1).max_by(|a, b| a.mmse.total_cmp(&b.mmse))
    }
}

/// Runs a job. `judge` is the device that measures; `saw` is called with each measurement.
pub fn run(
    job: &Job,
    place: &Place,
    options: &GpuOptions,
    judge: &Gpu,
    mut saw: impl FnMut(&Point),
) -> Result<Record> {
    let scene = &place.scene;
    let mut setup = CostSoFar::default();
    let initialising = Clock::start();
    let problem = Problem::new(&scene.volume, &scene.roi, &job.config)?;
    let start = Start::First(problem.first_splats()?);
    initialising.add_to(&mut setup);
    let initialise_seconds = setup.wall;
    let gpu = Gpu::new(options)?;
    let bench = Bench { job, place, judge, problem: &problem };
    let record = Record {
        job: job.clone(),
        points: Vec::new(),
        last: None,
        diverged_at: None,
        range: bench.range(),
        roi_voxels: place.voxels,
        initialise_seconds,
        device_peak_bytes: 0,
        frozen: 0,
        driver: gpu.description().driver.clone(),
        cost: None,
    };
    let clock = Some(Clock::start());
    let mut judged = MeasuredFit { bench, record, setup, spent: CostSoFar::default(), clock, saw: &mut saw };
    let outcome = problem.run(&gpu, start, problem.schedule(), &mut judged)?;
    let mut record = judged.record;
    match outcome.end {
        End::Failed(error) if error.code == DIVERGED => {
            record.diverged_at = record.end().map(|point| point.iteration + job.measure_every);
        }
        End::Failed(error) => return Err(error),
        End::Finished | End::Stopped => {}
    }
    record.device_peak_bytes = gpu.peak_bytes();
    record.frozen = outcome.frozen;
    Ok(record)
}

/// Error code of a fit that diverged.
const DIVERGED: &str = "VGS-FIT-010";

/// Fit that is measured on the way.
struct MeasuredFit<'a> {
    bench: Bench<'a>,
    record: Record,
    setup: CostSoFar,
    spent: CostSoFar,
    /// Clock that runs while the fit is prepared, and then while it runs, but not during measurements.
    clock: Option<Clock>,
    saw: &'a mut dyn FnMut(&Point),
}

impl Watch for MeasuredFit<'_> {
    fn begin(&mut self, _: &Beginning) {
        if let Some(clock) = self.clock.replace(Clock::start()) {
            clock.add_to(&mut self.setup);
        }
    }

    fn wants_figures(&self) -> bool {
        false
    }

    fn keeps(&self, iteration: u32) -> bool {
        self.bench.job.measured_at(iteration)
    }

    fn keep(&mut self, milestone: &mut Milestone<'_, '_>) -> Result<bool> {
        if let Some(clock) = self.clock.take() {
            clock.add_to(&mut self.spent);
        }
        let goes_on = self.measure(milestone.iteration, milestone.splats)?;
        self.clock = Some(Clock::start());
        Ok(goes_on)
    }
}

impl MeasuredFit<'_> {
    /// Measures `splats` after `iteration` iterations and adds the point to the record. Returns false if the
    /// fit has diverged.
    fn measure(&mut self, iteration: u32, splats: &[Splat]) -> Result<bool> {
        let is_last = iteration >= self.bench.job.config.iterations;
        let evaluation = self.bench.measure(splats, is_last)?;
        let mmse = evaluation.on_grid.mmse;
        if !mmse.is_finite() {
            self.record.diverged_at = Some(iteration);
            return Ok(false);
        }
        let point = Point { iteration, seconds: self.spent.wall, splats: splats.len(), mmse };
        (self.saw)(&point);
        self.record.points.push(point);
        if is_last {
            let (setup, spent) = (self.setup, self.spent);
            self.record.last = Some(self.bench.last(&evaluation));
            self.record.cost = Some(FitCost {
                setup_seconds: setup.wall,
                seconds: setup.wall + spent.wall,
                core_seconds: setup.core.zip(spent.core).map(|(a, b)| a + b),
                file_bytes: self.bench.file_bytes(splats)?,
            });
        }
        Ok(true)
    }
}

impl Job {
    /// Returns true if figures are measured after `iteration` iterations.
    fn measured_at(&self, iteration: u32) -> bool {
        iteration.is_multiple_of(self.measure_every) || iteration >= self.config.iterations
    }
}

/// Measures the splats of one run.
struct Bench<'a> {
    job: &'a Job,
    place: &'a Place,
    judge: &'a Gpu,
    problem: &'a Problem<'a>,
}

impl Bench<'_> {
    fn range(&self) -> [f32; 2] {
        match self.job.range {
            Range::MinMax => self.place.range,
            Range::Hu => [-1024.0, 3071.0],
            Range::Roi => self.place.region_range,
        }
    }

    /// Evaluates splats on the grid; at the end also on the shell and at held-out offsets. A fit for the grid
    /// is then evaluated as viewers show it.
    fn measure(&self, splats: &[Splat], is_last: bool) -> Result<Evaluation> {
        let protocol = Protocol {
            offsets: match is_last {
                true => evaluate::random_offsets(self.job.held_out, HELD_OUT_SEED),
                false => Vec::new(),
            },
            range: self.range(),
            // The intensity error is that of the ROI: without the shell it is the same and cheaper.
            shell: if is_last { self.job.config.loss.shell } else { 0 },
            threshold: self.job.config.region.threshold,
        };
        let Scene { volume, roi, .. } = &self.place.scene;
        let between = self.job.config.effective_between_slices();
        if is_last && self.job.config.effective_form() == FitForm::Grid {
            let set = self.set(splats)?;
            return evaluate::with_slices(volume, roi, between, &protocol, |volume, roi, protocol| {
                evaluate_decoded(self.judge, &set, volume, roi, protocol)
            });
        }
        evaluate::with_slices(volume, roi, between, &protocol, |volume, roi, protocol| {
            let set = || self.problem.splat_set(splats, 0).to_voxel(&volume.world_from_voxel);
            let there = self.problem.has_own_grid().then(set);
            let splats = there.as_deref().unwrap_or(splats);
            evaluate::evaluate(self.judge, splats, &self.problem.field(), volume, roi, protocol)
        })
    }

    fn set(&self, splats: &[Splat]) -> Result<SplatSet> {
        Ok(self.problem.splat_set(splats, self.job.config.iterations))
    }

    fn file_bytes(&self, splats: &[Splat]) -> Result<u64> {
        splat::file_bytes("a.ply".as_ref(), &self.set(splats)?, &splat::WriteOptions::default())
    }

    fn last(&self, evaluation: &Evaluation) -> Last {
        Last {
            soft_dice: evaluation.on_grid.soft_dice,
            occupancy_rmse: evaluation.on_grid.occupancy_rmse,
            errors: Some(Errors { rmse_hu: evaluation.on_grid.rmse_hu, p99_hu: evaluation.on_grid.p99_hu }),
            held_out: (self.job.held_out > 0).then(|| HeldOut {
                worst: evaluation.worst_psnr_db(),
                mean: evaluation.mean_psnr_db(),
                occupancy_rmse: evaluation.occupancy_rmse(),
            }),
        }
    }
}

#[cfg(test)]
pub mod tests {
    use engine::fit::evaluate::Protocol;

    use super::*;
    use crate::paper::job::tests::job;

    /// Creates a result with these errors at iterations 0, 50, 100 and so on.
    pub fn record(job: Job, mmse: &[f64]) -> Record {
        let points = mmse.iter().enumerate().map(|(i, &mmse)| Point {
            iteration: 50 * i as u32,
            seconds: 30.0 * i as f64,
            splats: job.config.count.splats + 10 * i,
            mmse,
        });
        Record {
            points: points.collect(),
            last: Some(Last {
                soft_dice: 0.9,
                occupancy_rmse: 0.1,
                errors: Some(Errors { rmse_hu: 20.0, p99_hu: 70.0 }),
                held_out: Some(HeldOut { worst: 40.0, mean: 41.0, occupancy_rmse: 0.05 }),
            }),
            diverged_at: None,
            range: [-1024.0, 3071.0],
            roi_voxels: 1000.0,
            initialise_seconds: 0.5,
            device_peak_bytes: 5_000_000,
            frozen: 0,
            driver: "none".into(),
            cost: Some(FitCost {
                setup_seconds: 0.6,
                seconds: 9.0,
                core_seconds: Some(17.0),
                file_bytes: 999,
            }),
            job,
        }
    }

    #[test]
    fn the_worst_is_told_with_and_without_the_start() {
        let record = record(job(5), &[0.03, 0.01, 0.02]);
        let psnr = |p: Option<&Point>| p.map(|p| (p.psnr() * 10.0).round() / 10.0);
        assert_eq!(psnr(record.worst()), Some(15.2));
        assert_eq!(psnr(record.worst_after_start()), Some(17.0));
        assert_eq!(record.best().map(|p| p.iteration), Some(50));
        assert_eq!(record.end().map(|p| (p.iteration, p.splats)), Some((100, 25)));
    }

    #[test]
    fn a_run_measures_start_way_and_end_with_all_splats() {
        let options = GpuOptions { validation: true, ..GpuOptions::default() };
        let judge = Gpu::new(&options).expect("a device with validation layers");
        let place = Place::new(Scene::phantom(24).expect("a phantom"));
        let job = job(60);
        let mut seen = Vec::new();
        let record = run(&job, &place, &options, &judge, |p| seen.push(*p)).expect("a run");
        assert_eq!(seen, record.points);
        assert_eq!(record.points.iter().map(|p| p.iteration).collect::<Vec<_>>(), [0, 3, 6, 7]);
        assert!(record.points.iter().all(|p| p.splats == 60));
        assert!(record.points.windows(2).all(|p| p[0].seconds < p[1].seconds), "time goes on");
        assert!(record.device_peak_bytes > 0 && record.frozen == 0 && record.diverged_at.is_none());
        assert!(record.last.is_some_and(|l| l.soft_dice > 0.1 && l.held_out.is_some()));
        let errors = record.last.and_then(|l| l.errors).expect("errors");
        assert!(errors.p99_hu > errors.rmse_hu && errors.rmse_hu > 0.0, "{errors:?}");
        let cost = record.cost.expect("it did not diverge");
        assert!(cost.setup_seconds > 0.0 && cost.seconds > cost.setup_seconds);
        assert!(
            (60 * 72..60 * 72 + 4000).contains(&cost.file_bytes),
            "72 bytes a splat, a header and exceptions: {cost:?}"
        );
        // The start is the initialisation itself, over the range of the whole volume.
        let problem = Problem::new(&place.scene.volume, &place.scene.roi, &job.config).expect("a problem");
        let first = problem.first_splats().expect("first splats");
        let protocol = Protocol { offsets: Vec::new(), range: place.range, shell: 0, threshold: 0.0 };
        let field = problem.field();
        let scene = &place.scene;
        let expected = evaluate::evaluate(&judge, &first, &field, &scene.volume, &scene.roi, &protocol);
        let expected = expected.expect("an evaluation").on_grid.psnr_db;
        // The fit clips intensities to their range in the region.
        assert!((seen[0].psnr() - expected).abs() < 0.05, "{} dB, not {expected}", seen[0].psnr());
        assert!(record.end().map(Point::psnr) > Some(expected + 1.0), "seven iterations help");
        assert!(judge.validation_messages().is_empty(), "{:?}", judge.validation_messages());
    }
    #[test]
    fn a_step_that_is_repeated_is_measured_once() {
        let options = GpuOptions { validation: true, ..GpuOptions::default() };
        let judge = Gpu::new(&options).expect("a device with validation layers");
        let place = Place::new(Scene::phantom(48).expect("a phantom"));
        // The splats reach every brick: the buffers for 4096 pairs grow, and the fit goes back to its first
        // step.
        let mut job = job(100);
        job.config.init.scale_min = 8.0;
        assert!(place.bricks * 100 > 4096);
        let record = run(&job, &place, &options, &judge, |_| {}).expect("a run");
        assert_eq!(record.points.iter().map(|p| p.iteration).collect::<Vec<_>>(), [0, 3, 6, 7]);
    }
}
