//! First stage of a fit: reads, chooses and checks everything that it needs.

use std::time::{Duration, Instant};

use engine::Result;
use engine::fit::evaluate::{self, Protocol};
use engine::fit::labels::label;
use engine::fit::{FitConfig, Goal, Going, IntensityRange, Problem, Schedule, Start};
use engine::gpu::Gpu;
use engine::splat::{Field, Rounding, Splat, SplatSet, WriteOptions};
use engine::volume::Labels;

use super::arguments::FitArguments;
use super::checkpoint::Checkpoints;
use super::count;
use super::output_files::OutputFiles;
use super::settings::Settings;
use crate::shared::console::Console;
use crate::shared::evaluation::{EVAL_SEED, unweighted};
use crate::shared::flags::Range;
use crate::shared::inputs::Case;

/// Inputs of a fit.
pub struct Inputs {
    case: Case,
    labels: Option<Labels>,
}

impl Inputs {
    /// Reads the volume and its region.
    pub fn read(arguments: &FitArguments) -> Result<Self> {
        let (case, labels) = Case::read_labelled(&arguments.volume, &arguments.read, &arguments.region)?;
        Ok(Inputs { case, labels })
    }

    /// Returns the volume and its region.
    pub fn case(&self) -> &Case {
        &self.case
    }
}

/// Fit that is ready to begin, for its stages.
pub struct Prepared<'a> {
    /// Flags.
    pub arguments: &'a FitArguments,
    /// Hyper-parameters.
    pub settings: &'a Settings,
    /// Outputs.
    pub files: &'a OutputFiles,
    /// Volume and region as they were read.
    pub case: &'a Case,
    labels: Option<Labels>,
    /// Problem of the fit: volume and region on the working grid, with the hyper-parameters for it.
    pub problem: Problem<'a>,
    /// Checkpoints of the fit.
    pub checkpoints: Checkpoints,
    /// Device of the fit.
    pub gpu: Gpu,
    /// Field that the splats add up to.
    pub field: Field,
    /// Options with which the splats are written.
    pub write: WriteOptions<'static>,
    /// Protocol of the closing evaluation, if there is one.
    pub protocol: Option<Protocol>,
    /// Protocol of measuring at the voxels alone.
    pub at_voxels: Protocol,
    /// Error that the fit is to reach, if there is one.
    pub goal: Option<Goal>,
    /// Schedule of the fit.
    pub schedule: Schedule,
    /// Time when the command began.
    pub start: Instant,
    /// Seconds from `start` until the inputs were read and the device was ready.
    pub read_seconds: f64,
    /// Seconds that finding the number of splats took, and placing the first ones.
    pub initialise_seconds: f64,
    /// Seconds that finding the number alone took.
    pub trial_seconds: f64,
    /// Time from the start until all of this was ready.
    pub before: Duration,
}

/// Boots the device and places the first splats, or reads the state of an interrupted fit.
pub fn prepare<'a>(
    arguments: &'a FitArguments,
    settings: &'a Settings,
    files: &'a OutputFiles,
    inputs: &'a Inputs,
    console: &Console,
    start: Instant,
) -> Result<(Prepared<'a>, Start)> {
    let case = &inputs.case;
    let write = arguments.layout.options(&case.volume, &case.roi, arguments.replaces_outputs());
    let checkpoints = Checkpoints::new(
        &arguments.checkpoint,
        &files.splats,
        &arguments.input_records()?,
        &arguments.region,
        &settings.config,
        write,
    )?;
    let interrupted = if arguments.checkpoint.resume { Some(checkpoints.read()?) } else { None };
    let gpu = arguments.device.boot()?;
    let read_seconds = start.elapsed().as_secs_f64();

    let initialising = Instant::now();
    let config = &settings.config;
    let protocol = protocol(arguments, config, case)?;
    let goal = Goal::of(config, protocol.range, protocol.threshold);
    let problem = Problem::new(&case.volume, &case.roi, config)?;
    let mut trial_seconds = 0.0;
    let (problem, begin) = match interrupted {
        Some(interrupted) => (problem, Start::Interrupted(interrupted)),
        None => {
            let problem = match &goal {
                Some(goal) => count::for_goal(problem, &gpu, goal, arguments, console, start)?,
                None => problem,
            };
            trial_seconds = initialising.elapsed().as_secs_f64();
            let (problem, first) = count::placed(problem, settings, arguments, &write, start)?;
            (problem, Start::First(first))
        }
    };
    let initialise_seconds = initialising.elapsed().as_secs_f64();

    warn_of_kernel(&write, config);
    let before = start.elapsed();
    let prepared = Prepared {
        arguments,
        settings,
        files,
        case,
        labels: inputs
            .labels
            .clone()
            .map(|labels| labels.with_slices(config.effective_between_slices(), &case.volume))
            .transpose()?,
        field: problem.field(),
        problem,
        checkpoints,
        gpu,
        write,
        at_voxels: Protocol { offsets: Vec::new(), ..protocol.clone() },
        protocol: (!arguments.no_eval).then_some(protocol),
        goal,
        schedule: arguments.schedule(settings, before),
        start,
        read_seconds,
        initialise_seconds,
        trial_seconds,
        before,
    };
    Ok((prepared, begin))
}

impl Prepared<'_> {
    /// Returns true if the splats are rounded for a small file and fitted again.
    pub fn is_rounded(&self) -> bool {
        count::is_rounded(&self.problem, self.arguments)
    }

    /// Returns first splats of the fit, given in its voxel space, as a file stores them.
    pub fn first_set(&self, splats: &[Splat], iterations: u32) -> SplatSet {
        let rounding = self.is_rounded().then(|| Rounding::coarse(splats));
        self.labelled(SplatSet { rounding, ..self.problem.splat_set(splats, iterations) })
    }

    /// Returns fitted splats as [`Prepared::set`] does, rounded and fitted again; `None` if the device has
    /// failed.
    pub fn rounded_set(&self, splats: &[Splat], iterations: u32, going: &mut Going<'_>) -> Option<SplatSet> {
        let rounded = self.problem.rounded_set(&self.gpu, splats, iterations, going);
        let failed = |error| tracing::warn!("the rounded splats could not be fitted again: {error}");
        Some(self.labelled(rounded.map_err(failed).ok()?))
    }

    /// Returns fitted splats, given in the voxel space of the fit, as a file stores them. If the device has
    /// failed, the exceptions are missing.
    pub fn set(&self, splats: &[Splat], iterations: u32) -> SplatSet {
        let finished = self.problem.finished_set(&self.gpu, splats, iterations).unwrap_or_else(|error| {
            tracing::warn!("the voxels where the splats miss the mask could not be listed: {error}");
            self.problem.splat_set(splats, iterations)
        });
        self.labelled(finished)
    }

    fn labelled(&self, mut set: SplatSet) -> SplatSet {
        if let Some(labels) = &self.labels {
            label(&mut set, labels);
        }
        set
    }
}

/// Warns if programs that read the layout use another kernel than the fit.
fn warn_of_kernel(write: &WriteOptions, config: &FitConfig) {
    if let Some(theirs) = write.layout.kernel.filter(|&kernel| kernel != config.kernel) {
        tracing::warn!(
            "programs that read the layout {} draw the kernel {}, the fit is with {}: fit with --kernel {} for them",
            write.layout.name,
            theirs.name(),
            config.kernel.name(),
            theirs.name()
        );
    }
}

/// Returns the protocol of the closing evaluation.
fn protocol(arguments: &FitArguments, config: &FitConfig, case: &Case) -> Result<Protocol> {
    // A fit over the region's range is measured over it, too.
    let range = arguments.eval_range.or((config.range == IntensityRange::Roi).then_some(Range::Roi));
    Ok(Protocol {
        offsets: evaluate::random_offsets(arguments.eval_offsets as usize, EVAL_SEED),
        range: case.range(range)?,
        shell: config.shell,
        threshold: unweighted(range).max(config.region_threshold),
    })
}
