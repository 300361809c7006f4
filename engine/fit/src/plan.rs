//! The one way to fit: an [`Order`] says what, a [`Plan`] is the fit that is ready to begin, and [`Fitted`] what it made.
//!
//! [`Plan::new`] finds the number of splats, by trials where an error is to be reached, and places the first ones.
//! [`Plan::run`] fits them, and makes the set: rounded where its file rounds, and fitted again with another number of
//! splats where it misses its error or its size. A [`Watch`] hears of each stage and may cut it short. [`run`] is all of it in
//! one call, with neither labels nor limits.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use super::evaluate::Metrics;
use super::going::Going;
use super::labels::label;
use super::run::{End, GOAL_MARGIN_DB, Interrupted, Outcome, Problem, Start, Watch};
use super::stage::{Count, Stage, Trial};
use super::{FitConfig, Goal, Progress, Schedule};
use base::error::{Error, Result};
use base::figures;
use gpu::Gpu;
use splat::{Rounding, Splat, SplatSet};
use volume::{Labels, Roi, Volume};

/// What rounding for a small file costs, dB: the fit before it should be better by as much.
const ROUNDING_DB: f64 = 0.3;
/// Part of a clock's time that trials may take ...
const TRIALS_OF_TIME: f64 = 0.25;
/// ... and part of it by which first splats are placed; the fit has the rest.
const PLACED_BY: u32 = 2;
/// Part of a limited file that the first splats may fill ...
const FILLED: f64 = 0.99;
/// ... and of that where splats are rounded: fitted ones differ more, and take more bytes.
const FILLED_IF_ROUNDED: f64 = 0.8;
/// A file that is filled to this part of what the first splats may fill is full.
const NEARLY: f64 = 0.97;
/// Part of a limited file that is aimed at when splats are taken away.
const AIMED: f64 = 0.98;
/// Most times that first splats are placed, or splats taken away, for a limited file.
const ROUNDS: usize = 5;

/// Measures a set of a problem at the voxels, as its goal counts; the splats are those of the set in voxel space of the
/// working grid, HU.
pub type Measure<'a> = dyn Fn(&Problem<'_>, &SplatSet, &[Splat]) -> Result<Metrics> + 'a;

/// Returns the bytes of the file of a set.
pub type BytesOf<'a> = dyn Fn(&SplatSet) -> Result<u64> + 'a;

/// Everything that a fit is told, besides its device and its observer.
pub struct Order<'a> {
    /// The volume.
    pub volume: &'a Volume,
    /// Its region of interest.
    pub roi: &'a Roi,
    /// Structures of the region: each splat gets the label of its voxel.
    pub labels: Option<&'a Labels>,
    /// The hyper-parameters.
    pub config: &'a FitConfig,
    /// The error to reach.
    pub goal: Option<Goal>,
    /// How the goal is measured; `None` for the field of the splats at the voxels of the scan on the working grid.
    pub measure: Option<Box<Measure<'a>>>,
    /// True if the splats are for a file that rounds them: they are rounded and fitted again, unless they are fitted in
    /// mini-batches or by a clock.
    pub rounded: bool,
    /// The size that the file may have.
    pub size: Option<SizeLimit<'a>>,
    /// The time that the fit may take.
    pub clock: Option<Clock>,
    /// The fit that goes on; `None` for one that begins.
    pub interrupted: Option<Interrupted>,
}

/// Limit of the size of a file of splats.
pub struct SizeLimit<'a> {
    /// Most bytes.
    pub bytes: u64,
    /// True if there are to be as many splats as that holds, false if other numbers count and this is a limit.
    pub fill: bool,
    /// Returns the bytes of the file of a set.
    pub bytes_of: Box<BytesOf<'a>>,
}

/// Limit of the time of a fit.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    /// Time from which it counts.
    pub begun: Instant,
    /// Time until the splats are ready.
    pub time: Duration,
    /// Most iterations.
    pub iterations: u32,
}

impl<'a> Order<'a> {
    /// Creates an order without labels and limits; the goal is that of the configuration, over the range of the volume.
    pub fn new(volume: &'a Volume, roi: &'a Roi, config: &'a FitConfig) -> Self {
        let range = volume.min_max().map_or([0.0; 2], |(low, high)| [low, high]);
        Order {
            volume,
            roi,
            labels: None,
            config,
            goal: Goal::of(config, range, config.region.threshold),
            measure: None,
            rounded: false,
            size: None,
            clock: None,
            interrupted: None,
        }
    }
}

/// Fits splats to the region of interest of a volume, as `config` says, and returns them in the world of the
/// volume (mm RAS, HU). `watch` receives the figures of the fit a few times a second and may stop it; the set
/// is then that of the iterations that were done.
///
/// # Errors
/// Fails for a configuration that cannot work, for a region without voxels, if the device fails, and if the
/// fit diverges.
///
/// ```no_run
/// use std::ops::ControlFlow;
/// use fit::FitConfig;
/// use gpu::{Gpu, GpuOptions};
/// use volume::{ReadOptions, Roi, Volume};
///
/// # fn main() -> base::Result<()> {
/// let volume = Volume::read("ct.nii.gz", &ReadOptions::default())?;
/// let bone = Roi::from_threshold(&volume, 226.0, 3071.0)?;
/// let gpu = Gpu::new(&GpuOptions::default())?;
/// let config = FitConfig::default().with(|c| c.count.density = 0.05);
/// let splats = fit::run(&gpu, &volume, &bone, &config, |progress| {
///     println!("iteration {}: {:.1} dB", progress.iteration, progress.psnr_db);
///     ControlFlow::Continue(())
/// })?;
/// splat::write(std::path::Path::new("bone.ply"), &splats, false)?;
/// # Ok(())
/// # }
/// ```
pub fn run(
    gpu: &Gpu,
    volume: &Volume,
    roi: &Roi,
    config: &FitConfig,
    watch: impl FnMut(&Progress) -> ControlFlow<()>,
) -> Result<SplatSet> {
    let mut watch = OnFigures { watch, stop: false };
    let (plan, start) = Plan::new(gpu, Order::new(volume, roi, config), &mut watch)?;
    let Fitted { set, outcome, lacking } = plan.run(start, &mut watch)?;
    match (outcome.end, lacking) {
        (End::Failed(error), _) | (_, Some(error)) => Err(error),
        (End::Finished | End::Stopped, None) => Ok(set),
    }
}

/// A [`Watch`] that hands figures to a closure, which may stop the fit.
struct OnFigures<F> {
    watch: F,
    stop: bool,
}

impl<F: FnMut(&Progress) -> ControlFlow<()>> Watch for OnFigures<F> {
    fn figures(&mut self, progress: &Progress) {
        self.stop |= (self.watch)(progress).is_break();
    }

    fn stops(&mut self) -> bool {
        self.stop
    }
}

/// A fit that is ready to begin.
pub struct Plan<'a> {
    gpu: Gpu,
    problem: Problem<'a>,
    labels: Option<Labels>,
    goal: Option<Goal>,
    measure: Option<Box<Measure<'a>>>,
    rounded: bool,
    size: Option<SizeLimit<'a>>,
    schedule: Schedule,
    counted: Duration,
}

/// A finished fit, or what one that ended early came to.
pub struct Fitted {
    /// The splats as their file has them, in the world of the volume (mm RAS, HU).
    pub set: SplatSet,
    /// How the iterations went; its splats are those of the set, in voxel space of the working grid.
    pub outcome: Outcome,
    /// Why the set is less than it should be, if the device has failed after the iterations.
    pub lacking: Option<Error>,
}

/// Tells `watch` of a stage while `work` is done.
fn during<T>(watch: &RefCell<&mut dyn Watch>, stage: Stage, work: impl FnOnce(&mut Going<'_>) -> T) -> T {
    watch.borrow_mut().begin_stage(stage);
    let done = work(&mut |share| watch.borrow_mut().going(share));
    watch.borrow_mut().end_stage();
    done
}

impl<'a> Plan<'a> {
    /// Finds the number of splats, and places the first ones; returns them, or the state of the interrupted fit, as the
    /// start of [`Plan::run`]. Waits for the device.
    ///
    /// # Errors
    /// Fails for a configuration that cannot work, for more splats than there may be or memory holds, and if the device
    /// fails.
    pub fn new(gpu: &Gpu, order: Order<'a>, watch: &mut dyn Watch) -> Result<(Self, Start)> {
        let Order { volume, roi, labels, config, goal, measure, rounded, size, clock, interrupted } = order;
        let begun = Instant::now();
        let mut problem = Problem::new(volume, roi, config)?;
        let labels = labels
            .map(|labels| labels.clone().with_slices(config.effective_between_slices(), volume))
            .transpose()?;
        let fitted_again = rounded && config.subset.size == 0 && clock.is_none();
        let mut counted = Duration::ZERO;
        let start = match interrupted {
            Some(interrupted) => Start::Interrupted(interrupted),
            None => {
                let watch = RefCell::new(watch);
                if let Some(goal) = &goal {
                    let margin = GOAL_MARGIN_DB + if fitted_again { ROUNDING_DB } else { 0.0 };
                    problem = counted_for(problem, gpu, goal, margin, clock, &watch)?;
                }
                counted = begun.elapsed();
                let deadline = clock.map(|clock| clock.begun + clock.time / PLACED_BY);
                let place = |problem: &Problem<'_>| {
                    during(&watch, Stage::Place, |_| problem.first_splats_by(deadline))
                };
                let mut first = place(&problem)?;
                if let Some(size) = &size {
                    let filled = if rounded { FILLED_IF_ROUNDED } else { 1.0 };
                    (problem, first) = within(problem, first, size, filled, fitted_again, &place)?;
                }
                Start::First(first)
            }
        };
        let schedule = clock.map_or_else(
            || problem.schedule(),
            |clock| Schedule {
                iterations: clock.iterations,
                time: Some(clock.time.saturating_sub(clock.begun.elapsed())),
            },
        );
        let plan = Plan {
            gpu: gpu.clone(),
            problem,
            labels,
            goal,
            measure,
            rounded: fitted_again,
            size,
            schedule,
            counted,
        };
        Ok((plan, start))
    }

    /// Returns the problem: volume and region on the working grid, and the hyper-parameters for it.
    pub fn problem(&self) -> &Problem<'a> {
        &self.problem
    }

    /// Returns the error to reach, if there is one.
    pub fn goal(&self) -> Option<&Goal> {
        self.goal.as_ref()
    }

    /// Returns the schedule of the iterations.
    pub fn schedule(&self) -> Schedule {
        self.schedule
    }

    /// Returns the time that finding the number of splats took.
    pub fn counted(&self) -> Duration {
        self.counted
    }

    /// Fits from `start`, and makes the set. If the device fails, the set is that of the last good splats.
    ///
    /// # Errors
    /// Fails if the fit cannot begin, and if the size of the set's file cannot be told.
    pub fn run(&self, start: Start, watch: &mut dyn Watch) -> Result<Fitted> {
        let mut outcome = self.problem.run(&self.gpu, start, self.schedule, watch)?;
        if outcome.frozen > 0 {
            tracing::warn!("{} updates of splats were left out: a gradient was not finite", outcome.frozen);
        }
        let mut lacking = None;
        let set = if matches!(outcome.end, End::Finished) {
            self.settled(&mut outcome, &mut lacking, &RefCell::new(watch))?
        } else {
            self.set(&outcome.splats, outcome.iterations)
        };
        Ok(Fitted { set, outcome, lacking })
    }

    /// Returns splats of the fit (voxel space of the working grid, HU) as a set with their labels and, if the
    /// iterations were the last, as a file would have them.
    pub fn first_set(&self, splats: &[Splat], iterations: u32) -> SplatSet {
        let rounding = self.rounded.then(|| Rounding::usual(splats));
        self.labelled(SplatSet { rounding, ..self.problem.splat_set(splats, iterations) })
    }

    /// Returns splats (voxel space of the working grid, HU) as a set with labels.
    pub fn set(&self, splats: &[Splat], iterations: u32) -> SplatSet {
        self.labelled(self.problem.splat_set(splats, iterations))
    }

    /// Returns fitted splats as a set that is rounded and fitted again; see [`Problem::rounded_set`].
    ///
    /// # Errors
    /// Fails if the device fails.
    pub fn rounded_set(&self, splats: &[Splat], iterations: u32, going: &mut Going<'_>) -> Result<SplatSet> {
        Ok(self.labelled(self.problem.rounded_set(&self.gpu, splats, iterations, going)?))
    }

    fn labelled(&self, mut set: SplatSet) -> SplatSet {
        if let Some(labels) = &self.labels {
            label(&mut set, labels);
        }
        set
    }

    /// Returns the set of a finished fit as its file has it: rounded where that rounds.
    fn made(
        &self,
        splats: &[Splat],
        iterations: u32,
        lacking: &mut Option<Error>,
        watch: &RefCell<&mut dyn Watch>,
    ) -> SplatSet {
        if self.rounded {
            match during(watch, Stage::Round, |going| self.rounded_set(splats, iterations, going)) {
                Ok(set) => return set,
                Err(error) => {
                    tracing::warn!("the rounded splats could not be fitted again: {error}");
                    lacking.get_or_insert(error);
                }
            }
        }
        self.set(splats, iterations)
    }

    /// Makes the set of a fit, and fits again with another number of splats where the set has missed its goal or is too
    /// large for its file; the size counts most. If the device fails, the splats stay as they are.
    fn settled(
        &self,
        outcome: &mut Outcome,
        lacking: &mut Option<Error>,
        watch: &RefCell<&mut dyn Watch>,
    ) -> Result<SplatSet> {
        let iterations = outcome.iterations;
        // The last splats that were measured, and their set.
        let mut last: Option<(Vec<Splat>, SplatSet)> = None;
        if let Some(goal) = &self.goal {
            let mut surplus = |splats: &[Splat]| {
                let set = self.made(splats, iterations, lacking, watch);
                let (_, set) = last.insert((splats.to_vec(), set));
                Ok(goal.surplus_of(&self.measured(goal, set, splats)?))
            };
            let splats = outcome.splats.clone();
            let brought = self.problem.brought_to_goal(
                &self.gpu,
                splats,
                &mut surplus,
                &mut |splats| {
                    watch.borrow_mut().counted(&Count::MissedGoal { splats });
                    watch.borrow_mut().begin_stage(Stage::ReachGoal);
                },
                &mut |share| watch.borrow_mut().going(share),
            );
            watch.borrow_mut().end_stage();
            match brought {
                Ok(splats) => outcome.splats = splats,
                Err(error) => {
                    tracing::warn!("the fit could not be brought to its target: {error}");
                    lacking.get_or_insert(error);
                }
            }
        }
        let set = match last {
            Some((splats, set)) if splats == outcome.splats => set,
            _ => self.made(&outcome.splats, iterations, lacking, watch),
        };
        match &self.size {
            Some(size) => self.within_size(size, outcome, set, lacking, watch),
            None => Ok(set),
        }
    }

    fn measured(&self, goal: &Goal, set: &SplatSet, splats: &[Splat]) -> Result<Metrics> {
        match &self.measure {
            Some(measure) => measure(&self.problem, set, splats),
            None => self.problem.at_voxels(&self.gpu, goal, splats),
        }
    }

    /// Takes splats away from a fit until the file of its set is small enough.
    fn within_size(
        &self,
        size: &SizeLimit<'_>,
        outcome: &mut Outcome,
        set: SplatSet,
        lacking: &mut Option<Error>,
        watch: &RefCell<&mut dyn Watch>,
    ) -> Result<SplatSet> {
        let (mut set, most) = (set, size.bytes);
        for round in 0..=ROUNDS {
            let bytes = (size.bytes_of)(&set)?;
            let fixed = fixed_bytes(&set);
            let [room, taken] =
                [(AIMED * most as f64) as u64, bytes].map(|bytes| bytes.saturating_sub(fixed).max(1));
            let splats = (outcome.splats.len() as f64 * room as f64 / taken as f64) as usize;
            if bytes <= most || watch.borrow_mut().stops() {
                break;
            }
            if round == ROUNDS || splats == 0 {
                tracing::warn!(
                    "the file has {}, more than {}: its grid and its mask need the rest",
                    figures::bytes(bytes),
                    figures::bytes(most)
                );
                break;
            }
            watch.borrow_mut().counted(&Count::TooLarge { splats, bytes, most });
            let again = during(watch, Stage::ReachSize, |going| {
                self.problem.with_count(&self.gpu, &outcome.splats, splats, going)
            });
            match again {
                Ok(splats) => outcome.splats = splats,
                Err(error) => {
                    let size = figures::bytes(bytes);
                    tracing::warn!("the file could not be made smaller than {size}: {error}");
                    lacking.get_or_insert(error);
                    break;
                }
            }
            set = self.made(&outcome.splats, outcome.iterations, lacking, watch);
        }
        Ok(set)
    }
}

/// Returns the problem with the number of splats that the goal takes.
fn counted_for<'a>(
    problem: Problem<'a>,
    gpu: &Gpu,
    goal: &Goal,
    margin_db: f64,
    clock: Option<Clock>,
    watch: &RefCell<&mut dyn Watch>,
) -> Result<Problem<'a>> {
    let until = clock.map(|clock| clock.begun + clock.time.mul_f64(TRIALS_OF_TIME));
    let mut trials = 0;
    let mut told = |trial: &Trial| {
        trials += 1;
        watch.borrow_mut().counted(&Count::Tried(*trial));
    };
    let splats = during(watch, Stage::Count, |going| {
        let mut in_time = |share: f64| {
            if until.is_some_and(|until| Instant::now() >= until) {
                return ControlFlow::Break(());
            }
            going(share)
        };
        problem.count_for(gpu, goal, margin_db, &mut told, &mut in_time)
    })?;
    let most = problem.config().most_splats(problem.native_voxels());
    watch.borrow_mut().counted(&Count::Found { splats, most, trials });
    Ok(problem.of_count(splats))
}

/// Returns the bytes of a file that do not depend on the number of splats: those of the region.
fn fixed_bytes(set: &SplatSet) -> u64 {
    set.region.as_ref().map_or(0, |region| region.encode().len() as u64)
}

/// Returns the problem and its first splats: no more than a file of limited size holds, and as many, if nothing else says
/// how many.
fn within<'a>(
    problem: Problem<'a>,
    first: Vec<Splat>,
    size: &SizeLimit<'_>,
    filled: f64,
    fitted_again: bool,
    place: &dyn Fn(&Problem<'_>) -> Result<Vec<Splat>>,
) -> Result<(Problem<'a>, Vec<Splat>)> {
    let (mut problem, mut first) = (problem, first);
    for _ in 0..ROUNDS {
        let rounding = fitted_again.then(|| Rounding::usual(&first));
        let set = SplatSet { rounding, ..problem.splat_set(&first, 0) };
        let fixed = fixed_bytes(&set) as f64;
        let part =
            ((size.bytes_of)(&set)? as f64 - fixed) / (size.bytes as f64 * filled * FILLED - fixed).max(1.0);
        let limit = problem.config().most_splats(problem.native_voxels());
        let count = ((first.len() as f64 / part) as usize).clamp(1, limit.max(1));
        let fits = part <= 1.0 && (!size.fill || part > NEARLY);
        if fits || count == first.len() {
            break;
        }
        problem = problem.of_count(count);
        first = place(&problem)?;
    }
    Ok((problem, first))
}
