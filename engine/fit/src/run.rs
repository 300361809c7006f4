//! The iterations of a fit. A [`Problem`] does everything that a [`FitConfig`] asks for: it puts volume and region on the
//! working grid, places the first splats, follows the [`Schedule`], repeats steps whose buffers were too small, and makes the
//! set. A [`Watch`] is told of the progress, may stop the fit and may keep intermediate states.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::stage::{Count, Stage};
use super::{FitConfig, FitState, Fitter, Progress, Scaling, Schedule};
use base::error::{Error, Kind, Result};
use base::memory;
use gpu::{Gpu, PassTime};
use splat::{Field, Form, Grid, Region, Splat, SplatSet};
use volume::{Displacements, PartOf, Roi, Volume};

/// Figures are fetched at least this many iterations apart ...
const FIGURES_EVERY: u32 = 20;
/// ... or this long, if that comes first: fetching waits for the device.
const FIGURES_AFTER: Duration = Duration::from_millis(500);
/// Figures belong to the offset grid of their iteration, so they are fetched when the same grid has its turn
/// again; after this long, they are fetched at any grid.
const FIGURES_AT_LATEST: Duration = Duration::from_secs(20);
/// Fetching figures takes at most one part in this many of the time.
const FIGURES_SHARE: u32 = 10;

/// Maximum number of splats for each voxel of the region, as many as a density may ask for ...
const MOST_A_VOXEL: f64 = 100.0;
/// ... and a number of splats that is allowed for any region.
const LEAST_LIMIT: f64 = 10_000.0;
/// How much better than a goal the number of splats should make a fit, dB: trials are not exact.
pub const GOAL_MARGIN_DB: f64 = 0.3;
/// Least host memory of a splat, bytes, while a fit is prepared and written: itself in two spaces, its set,
/// its row.
const HOST_BYTES_A_SPLAT: u64 = 300;

/// The slices of a working grid that the scan has.
#[derive(Clone, Copy, Debug)]
struct ScanSlices {
    axis: usize,
    every: usize,
    first: usize,
}

/// A fitting problem: a volume and a region on the working grid, and a configuration that was checked.
pub struct Problem<'a> {
    volume: Cow<'a, Volume>,
    roi: Cow<'a, Roi>,
    config: FitConfig,
    /// Sum of the mask on the volume's own grid, voxels: what a density is multiplied by.
    native_voxels: f64,
    /// Where the working grid has more slices: which of them are the scan's.
    scan_slices: Option<ScanSlices>,
    /// The grid that the working grid is a box of, if the volume is one of a larger volume.
    part_of: Option<PartOf>,
    /// Checksum of the volume on its own grid, once it was asked for.
    volume_crc32: OnceLock<u32>,
    /// The voxels of a binary region, once they were asked for.
    region: OnceLock<Option<Region>>,
}

impl<'a> Problem<'a> {
    /// Checks the configuration and puts volume and region on its working grid: block means of `working_grid`
    /// voxels along each axis, [more slices](volume::FinerSlices) where those of the volume are thick, or the
    /// voxels themselves.
    ///
    /// # Errors
    /// Those of [`FitConfig::check`], and [`Kind::HostMemory`] if there is no memory for more slices.
    pub fn new(volume: &'a Volume, roi: &'a Roi, config: &FitConfig) -> Result<Self> {
        config.check()?;
        let native_voxels = roi.weight_sum();
        let volume_part = volume.part_of;
        if let Some(finer) = config.effective_between_slices().finer(volume) {
            finer.require_memory()?;
            let volume_crc32 = OnceLock::from(volume.crc32());
            let along = Displacements::of(&finer, volume);
            let fine = finer.volume(volume, Some(roi), &along);
            let roi = Cow::Owned(finer.roi(roi, &fine, &along));
            let (volume, config) = (Cow::Owned(fine), config.clone());
            let region = OnceLock::new();
            let (axis, every) = (finer.axis(), finer.factor());
            let scan_slices = Some(ScanSlices { axis, every, first: 0 });
            let part_of = volume_part.map(|part| part.with_slices(axis, every));
            return Ok(Problem {
                volume,
                roi,
                config,
                native_voxels,
                scan_slices,
                part_of,
                volume_crc32,
                region,
            });
        }
        let scan_slices = None;
        if config.samples.working_grid <= 1 {
            let (volume, roi) = (Cow::Borrowed(volume), Cow::Borrowed(roi));
            let volume_crc32 = OnceLock::new();
            let region = OnceLock::new();
            let config = config.clone();
            let part_of = volume_part;
            return Ok(Problem {
                volume,
                roi,
                config,
                native_voxels,
                scan_slices,
                part_of,
                volume_crc32,
                region,
            });
        }
        // The range is that of the native volume: the means of its blocks reach less far.
        let (low, high) = Scaling::new(volume, roi, config).range;
        let factor = config.samples.working_grid as usize;
        Ok(Problem {
            volume: Cow::Owned(volume.coarsened(factor)),
            roi: Cow::Owned(roi.coarsened(factor)),
            config: config.clone().with(|c| c.region.hu_range = [low, high]),
            native_voxels,
            scan_slices,
            // Blocks of voxels are counted from the first one of the part.
            part_of: None,
            volume_crc32: OnceLock::from(volume.crc32()),
            region: OnceLock::new(),
        })
    }

    /// Returns the same problem with another configuration, which has the same working grid.
    pub(super) fn with_config(&self, config: FitConfig) -> Problem<'_> {
        let (volume, roi) = (Cow::Borrowed(&*self.volume), Cow::Borrowed(&*self.roi));
        let volume_crc32 = self.volume_crc32.clone();
        let region = self.region.clone();
        let (native_voxels, scan_slices, part_of) = (self.native_voxels, self.scan_slices, self.part_of);
        Problem { volume, roi, config, native_voxels, scan_slices, part_of, volume_crc32, region }
    }

    /// Returns the part of the problem in the box of `size` voxels from `first` on.
    pub(super) fn part(&self, first: [usize; 3], size: [usize; 3]) -> Problem<'static> {
        let roi = self.roi.cropped(first, size);
        Problem {
            volume: Cow::Owned(self.volume.cropped(first, size)),
            native_voxels: roi.weight_sum() * self.native_voxels / self.roi.weight_sum(),
            scan_slices: self.scan_slices.map(|scan| {
                let before = scan.first as isize - first[scan.axis] as isize;
                ScanSlices { first: before.rem_euclid(scan.every as isize) as usize, ..scan }
            }),
            part_of: None,
            roi: Cow::Owned(roi),
            config: self.config.clone(),
            volume_crc32: OnceLock::new(),
            region: OnceLock::new(),
        }
    }

    /// Returns the same problem for this number of splats.
    pub fn of_count(self, splats: usize) -> Self {
        Problem { config: self.config.with(|c| c.count.splats = splats), ..self }
    }

    /// Returns the sum of the mask on the volume's own grid, voxels.
    pub fn native_voxels(&self) -> f64 {
        self.native_voxels
    }

    /// Returns the ranges of the fit.
    pub(super) fn scaling(&self) -> Scaling {
        Scaling::new(&self.volume, &self.roi, &self.config)
    }

    /// Returns the volume on the working grid.
    pub fn volume(&self) -> &Volume {
        &self.volume
    }

    /// Returns the region on the working grid.
    pub fn roi(&self) -> &Roi {
        &self.roi
    }

    /// Returns the region in the slices that the scan has: what lies between them is no measure of a fit.
    pub(super) fn scanned_roi(&self) -> Cow<'_, Roi> {
        match self.scan_slices {
            Some(ScanSlices { axis, every, first }) => Cow::Owned(self.roi.in_planes(axis, every, first)),
            None => Cow::Borrowed(&self.roi),
        }
    }

    /// Returns the configuration, with the range of the native volume where the working grid is coarser.
    pub fn config(&self) -> &FitConfig {
        &self.config
    }

    /// Returns true if the fit works on a grid of its own, coarser than the volume's or with more slices.
    pub fn has_own_grid(&self) -> bool {
        matches!(self.volume, Cow::Owned(_))
    }

    /// Returns the constants of the field that is fitted.
    pub fn field(&self) -> Field {
        self.config.field(self.scaling().background)
    }

    /// Returns the schedule of the configuration: its iterations, without a clock.
    pub fn schedule(&self) -> Schedule {
        Schedule { iterations: self.config.iterations, time: None }
    }

    /// Places the first splats, in voxel space of the working grid and HU.
    ///
    /// # Errors
    /// [`Kind::Usage`] for more splats than any density allows, [`Kind::HostMemory`] for more than there is
    /// memory for.
    pub fn first_splats(&self) -> Result<Vec<Splat>> {
        self.first_splats_by(None)
    }

    /// Places the first splats as [`Self::first_splats`] does, with less care after `deadline`: two runs then
    /// differ.
    ///
    /// # Errors
    /// Those of [`Self::first_splats`].
    pub fn first_splats_by(&self, deadline: Option<Instant>) -> Result<Vec<Splat>> {
        let place = self.config.init.initialiser()?.run;
        let count = self.config.splat_count(self.native_voxels);
        let most = (MOST_A_VOXEL * self.native_voxels).max(LEAST_LIMIT);
        if count as f64 > most {
            let message = format!("{count} splats for a region of {:.0} voxels", self.native_voxels);
            return Err(Error::new(Kind::Usage, "VGS-FIT-040", message).help(format!(
                "choose at most {most:.0}; 0.1 a voxel is usual, and more than 1 is never useful"
            )));
        }
        memory::require(count as u64 * HOST_BYTES_A_SPLAT, &format!("{count} splats"))?;
        Ok(place(&self.volume, &self.roi, count, self.config.seed, &self.config.init, deadline))
    }

    /// Prepares the device for a fit that begins with first splats or goes on from a state, as `start` says.
    pub fn fitter(&self, gpu: &Gpu, start: &Start) -> Result<Fitter<'_>> {
        match start {
            Start::First(first) => Fitter::new(gpu, &self.volume, &self.roi, first, &self.config),
            Start::Interrupted(from) => {
                Fitter::resume(gpu, &self.volume, &self.roi, &from.state, &self.config)
            }
        }
    }

    /// Returns splats of the fit (voxel space of the working grid, HU) as a set in the world, with the grid
    /// that they were fitted on, their form and their region. The grid of a part is that of the whole, so that parts go
    /// together, and each is measured by the whole.
    pub fn splat_set(&self, splats: &[Splat], iterations: u32) -> SplatSet {
        let own = || volume::Grid { size: self.volume.size, world_from_voxel: self.volume.world_from_voxel };
        let PartOf { grid, first } = self.part_of.unwrap_or_else(|| PartOf { grid: own(), first: [0; 3] });
        let first = first.map(|at| u32::try_from(at).unwrap_or(u32::MAX));
        SplatSet {
            iterations: Some(iterations),
            grid: Some(Grid::of_voxels(grid.size, grid.world_from_voxel)),
            unit: self.volume.unit(),
            // That of a part would say that the whole is another volume.
            volume_crc32: self
                .part_of
                .is_none()
                .then(|| *self.volume_crc32.get_or_init(|| self.volume.crc32())),
            form: self.config.fitted_form(),
            region: self.region().map(|region| region.within(first)),
            ..SplatSet::from_voxel(splats, &self.volume.world_from_voxel, self.field())
        }
    }

    /// Returns the voxels of the region, if it is binary and shown as voxels.
    fn region(&self) -> Option<Region> {
        if self.roi.soft || self.config.fitted_form() == Form::Field {
            return None;
        }
        let region = || Region::of(self.roi.size, |i| (self.roi.weight[i] > 0.5).then_some(0));
        self.region.get_or_init(region).clone()
    }

    /// Fits from `start` until `schedule` is done or `watch` stops it. If the fit fails on the way, the
    /// outcome has the last splats that were seen to be good; an error is returned only if the fit cannot
    /// begin.
    pub fn run(&self, gpu: &Gpu, start: Start, schedule: Schedule, watch: &mut dyn Watch) -> Result<Outcome> {
        let mut fitter = self.fitter(gpu, &start)?;
        let (mut curve, before) = match start {
            Start::First(_) => (Vec::new(), 0.0),
            Start::Interrupted(Interrupted { curve, seconds, .. }) => (curve, seconds),
        };
        // A PSNR can be infinite, so it is not written; it is computed again here.
        for point in &mut curve {
            point.progress.psnr_db = -10.0 * point.progress.mse.log10();
        }
        let good = fitter.splats()?;
        let iterations = fitter.iteration();
        // Uploads and the creation of kernels are not part of the profile of the passes.
        gpu.take_profile();
        let (low, high) = fitter.scaling().range;
        watch.begin(&Beginning { splats: good.len(), iterations, range: [low, high] });
        let mut course = Course {
            good,
            iterations,
            curve,
            before: Duration::from_secs_f64(before),
            begun: Instant::now(),
            figures: Figures { iteration: iterations, at: Instant::now(), took: Duration::ZERO },
            // Number of offset grids that the iterations visit in turn.
            grids: u32::try_from(self.config.offset_count()).unwrap_or(1).max(1),
            kept: None,
        };
        let end = course.run(&mut fitter, schedule, watch).unwrap_or_else(End::Failed);
        let seconds = course.elapsed().as_secs_f64();
        let (frozen, end) = match (fitter.frozen(), end) {
            (Ok(frozen), end) => (frozen, end),
            // The first failure counts.
            (Err(_), end @ End::Failed(_)) => (0, end),
            (Err(error), _) => (0, End::Failed(error)),
        };
        Ok(Outcome {
            seconds,
            splats: course.good,
            iterations: course.iterations,
            curve: course.curve,
            range: [low, high],
            frozen,
            device_bytes: gpu.memory_by_purpose(),
            passes: gpu.take_profile(),
            end,
        })
    }
}

/// Starting point of a fit.
pub enum Start {
    /// First splats, in voxel space of the working grid and HU.
    First(Vec<Splat>),
    /// An interrupted fit, which goes on.
    Interrupted(Interrupted),
}

/// An interrupted fit and its figures so far.
pub struct Interrupted {
    /// Splats and what the optimiser keeps of them.
    pub state: FitState,
    /// Time of its iterations so far, seconds.
    pub seconds: f64,
    /// Its figures so far.
    pub curve: Vec<CurvePoint>,
}

/// The figures of a fit at one time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CurvePoint {
    /// Time of the iterations so far, seconds.
    pub seconds: f64,
    /// The figures.
    pub progress: Progress,
}

/// State of a fit when its iterations begin.
#[derive(Clone, Copy, Debug)]
pub struct Beginning {
    /// Number of splats.
    pub splats: usize,
    /// Number of iterations that were done before, by a fit that was interrupted.
    pub iterations: u32,
    /// Range whose span the PSNR of the figures refers to, HU.
    pub range: [f32; 2],
}

/// Observer of a fit. Every method has a default that leaves the fit alone.
pub trait Watch {
    /// Receives the state of the fit when the iterations begin.
    fn begin(&mut self, _beginning: &Beginning) {}

    /// Receives the number of iterations after each step, and `share`, the part of the schedule that was done
    /// when the step began, 0 to 1. A step whose buffers were too small is repeated, so the number may go
    /// back.
    fn step(&mut self, _iteration: u32, _share: f64) {}

    /// Returns true if the fit should take figures on the way.
    fn wants_figures(&self) -> bool {
        true
    }

    /// Receives figures, a few times a second.
    fn figures(&mut self, _progress: &Progress) {}

    /// Returns true if the fit must stop. The fit asks before each step.
    fn stops(&mut self) -> bool {
        false
    }

    /// Returns true if the fit as it is after this number of iterations should be kept.
    fn keeps(&self, _iteration: u32) -> bool {
        false
    }

    /// Hears that a stage besides the iterations begins.
    fn begin_stage(&mut self, _stage: Stage) {}

    /// Hears how far the stage is, 0 to 1, and says whether it goes on; cut short, it takes the best so far.
    fn going(&mut self, _done: f64) -> ControlFlow<()> {
        if self.stops() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }

    /// Hears that the stage is over.
    fn end_stage(&mut self) {}

    /// Hears of the number of splats.
    fn counted(&mut self, _count: &Count) {}

    /// Keeps the fit as it is. The fit calls this where [`Watch::keeps`] returns true, and a last time when
    /// [`Watch::stops`] has stopped it. Returns true if the fit should go on.
    fn keep(&mut self, _milestone: &mut Milestone<'_, '_>) -> Result<bool> {
        Ok(true)
    }
}

/// The fit after a number of iterations, for [`Watch::keep`]. The number is final: no step of them will be
/// repeated.
pub struct Milestone<'a, 'b> {
    /// The fit; nothing is in flight.
    pub fitter: &'a mut Fitter<'b>,
    /// The splats, in voxel space of the working grid and HU.
    pub splats: &'a [Splat],
    /// Number of iterations behind the splats.
    pub iteration: u32,
    /// Time of the iterations so far, seconds, this and other milestones included.
    pub seconds: f64,
    /// Figures so far.
    pub curve: &'a [CurvePoint],
    /// True if the fit was stopped here.
    pub stopped: bool,
}

/// Reason for the end of a fit.
pub enum End {
    /// The schedule is done, or [`Watch::keep`] returned false.
    Finished,
    /// [`Watch::stops`] returned true.
    Stopped,
    /// The device failed, the fit diverged, or [`Watch::keep`] failed.
    Failed(Error),
}

/// Result of a fit.
pub struct Outcome {
    /// The last good splats, in voxel space of the working grid and HU.
    pub splats: Vec<Splat>,
    /// Number of iterations behind these splats.
    pub iterations: u32,
    /// Time of the iterations, seconds.
    pub seconds: f64,
    /// Figures over the course of the fit.
    pub curve: Vec<CurvePoint>,
    /// Range whose span the PSNR of the figures refers to, HU.
    pub range: [f32; 2],
    /// Number of updates that were left out because a gradient was not finite.
    pub frozen: u32,
    /// Device memory by purpose at the end, bytes.
    pub device_bytes: std::collections::BTreeMap<&'static str, u64>,
    /// Device time by pass, of the iterations alone.
    pub passes: Vec<(String, PassTime)>,
    /// Reason for the end of the fit.
    pub end: End,
}

/// The last time that figures were fetched.
struct Figures {
    iteration: u32,
    at: Instant,
    /// Time that fetching them took.
    took: Duration,
}

/// State of the loop over the iterations of a fit.
struct Course {
    /// The last splats that were seen to be good, and the iterations behind them.
    good: Vec<Splat>,
    iterations: u32,
    curve: Vec<CurvePoint>,
    /// Time of the iterations before this run, if it goes on from an interrupted fit.
    before: Duration,
    begun: Instant,
    figures: Figures,
    grids: u32,
    /// The iteration of the last milestone.
    kept: Option<u32>,
}

impl Course {
    fn elapsed(&self) -> Duration {
        self.before + self.begun.elapsed()
    }

    /// Returns true if figures should be fetched at this iteration. Figures belong to the offset grid whose
    /// turn it is, so they are taken when the same grid has its turn, unless they are overdue. Where only a
    /// mini-batch is rasterized, they cost more than an iteration.
    fn are_figures_due(&self, iteration: u32) -> bool {
        let since = iteration.saturating_sub(self.figures.iteration);
        let waited = self.figures.at.elapsed();
        let due = since >= FIGURES_EVERY || since > 0 && waited >= FIGURES_AFTER;
        let affordable = waited >= FIGURES_SHARE * self.figures.took;
        let overdue = since > 0 && waited >= FIGURES_AT_LATEST;
        due && affordable && iteration.is_multiple_of(self.grids) || overdue
    }

    fn is_milestone(&self, iteration: u32, watch: &dyn Watch) -> bool {
        watch.keeps(iteration) && self.kept.is_none_or(|kept| iteration > kept)
    }

    fn run(&mut self, fitter: &mut Fitter<'_>, schedule: Schedule, watch: &mut dyn Watch) -> Result<End> {
        loop {
            let share = schedule.share(fitter.iteration(), self.elapsed());
            let stopped = watch.stops();
            let over = |iteration: u32, share: f64| share >= 1.0 && iteration > 0;
            let figures = watch.wants_figures() && self.are_figures_due(fitter.iteration());
            let milestone = self.is_milestone(fitter.iteration(), watch);
            if over(fitter.iteration(), share) || stopped || milestone || figures {
                self.look(fitter, watch)?;
                // The count may have gone back where buffers had to grow: then it is not over yet.
                let at = fitter.iteration();
                if (stopped || self.is_milestone(at, watch)) && !self.keep(fitter, watch, stopped)? {
                    return Ok(End::Finished);
                }
                if stopped {
                    return Ok(End::Stopped);
                }
                if over(at, schedule.share(at, self.elapsed())) {
                    return Ok(End::Finished);
                }
            }
            fitter.step(share)?;
            watch.step(fitter.iteration(), share);
        }
    }

    fn keep(&mut self, fitter: &mut Fitter<'_>, watch: &mut dyn Watch, stopped: bool) -> Result<bool> {
        self.kept = Some(fitter.iteration());
        watch.keep(&mut Milestone {
            iteration: fitter.iteration(),
            seconds: self.elapsed().as_secs_f64(),
            fitter,
            splats: &self.good,
            curve: &self.curve,
            stopped,
        })
    }

    /// Fetches the splats, and the figures where they are wanted, and keeps them. Fails if the fit has
    /// diverged.
    fn look(&mut self, fitter: &mut Fitter<'_>, watch: &mut dyn Watch) -> Result<()> {
        let begin = Instant::now();
        fitter.finish()?;
        // Nothing has changed since the last time.
        if fitter.iteration() == self.figures.iteration {
            return Ok(());
        }
        let progress = watch.wants_figures().then(|| fitter.progress()).transpose()?;
        let splats = fitter.splats()?;
        check(fitter.iteration(), progress.as_ref(), &splats, self.iterations)?;
        self.good = splats;
        self.iterations = fitter.iteration();
        self.figures = Figures { iteration: self.iterations, at: Instant::now(), took: begin.elapsed() };
        if let Some(progress) = progress {
            watch.figures(&progress);
            self.curve.push(CurvePoint { seconds: self.elapsed().as_secs_f64(), progress });
        }
        Ok(())
    }
}

/// Fails if the fit has diverged: if an error is not finite or a splat is unusable. `kept` is the iteration
/// of the last good splats.
fn check(iteration: u32, progress: Option<&Progress>, splats: &[Splat], kept: u32) -> Result<()> {
    let bad = splats.iter().filter(|s| splat::defect(s).is_some()).count();
    let errors = progress.map(|p| [Some(p.mse), Some(p.occupancy_rmse), p.dice, p.leak]);
    if bad == 0 && errors.iter().flatten().flatten().all(|e| e.is_finite()) {
        return Ok(());
    }
    let mse = progress.map_or(f64::NAN, |p| p.mse);
    let message = format!(
        "the fit diverged after {iteration} iterations (mean squared error {mse}, {bad} unusable splats); the splats of \
         iteration {kept} are kept"
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
        assert!(check(9, Some(&progress), &[splat], 5).is_ok(), "an exact fit is none that diverged");
        assert!(check(9, None, &[splat], 5).is_ok());
        let rows = [
            (Progress { mse: f64::NAN, ..progress }, splat),
            (Progress { occupancy_rmse: f64::INFINITY, ..progress }, splat),
            (Progress { dice: Some(f64::NAN), ..progress }, splat),
            (Progress { leak: Some(f64::INFINITY), ..progress }, splat),
            (progress, Splat { intensity: f32::NAN, ..splat }),
        ];
        for (progress, splat) in rows {
            let error = check(9, Some(&progress), &[splat], 5).expect_err("diverged");
            assert_eq!((error.kind, error.code), (Kind::Internal, "VGS-FIT-010"));
            assert!(error.message.contains("iteration 5 are kept"), "{}", error.message);
        }
    }
}
