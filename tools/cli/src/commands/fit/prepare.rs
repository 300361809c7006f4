//! First stage of a fit: reads, chooses and checks everything that it needs.

use std::time::{Duration, Instant};

use engine::Result;
use engine::fidelity;
use engine::fit::evaluate::{self, Evaluation, Protocol};
use engine::fit::{Clock, FitConfig, Goal, IntensityRange, Order, Plan, Settings, SizeLimit, Start};
use engine::gpu::Gpu;
use engine::splat::{self, Splat, SplatSet, WriteOptions};
use engine::volume::Labels;

use super::arguments::FitArguments;
use super::checkpoint::Checkpoints;
use super::output_files::OutputFiles;
use super::telling::Stages;
use crate::shared::console::Console;
use crate::shared::evaluation::{EVAL_SEED, unweighted};
use crate::shared::flags::Range;
use crate::shared::inputs::Case;
use crate::shared::signals::Signals;

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
    /// The fit.
    pub plan: Plan<'a>,
    /// Checkpoints of the fit.
    pub checkpoints: Checkpoints,
    /// Device of the fit.
    pub gpu: Gpu,
    /// What the splats are made of, of a fit in a batch.
    pub made_of: Option<&'a str>,
    /// Options with which the splats are written.
    pub write: WriteOptions<'static>,
    /// Protocol of the closing evaluation, if there is one.
    pub protocol: Option<Protocol>,
    /// Time when the command began.
    pub start: Instant,
    /// Seconds from `start` until the inputs were read and the device was ready.
    pub read_seconds: f64,
    /// Seconds that finding the number of splats took, and placing the first ones.
    pub initialise_seconds: f64,
    /// Time from the start until all of this was ready.
    pub before: Duration,
}

/// Places the first splats, or reads the state of an interrupted fit.
#[expect(clippy::too_many_arguments, reason = "what a fit is made of, at its one place")]
pub fn prepare<'a>(
    arguments: &'a FitArguments,
    settings: &'a Settings,
    files: &'a OutputFiles,
    inputs: &'a Inputs,
    gpu: Gpu,
    made_of: Option<&'a str>,
    signals: &Signals,
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
    let read_seconds = start.elapsed().as_secs_f64();

    let initialising = Instant::now();
    let config = &settings.config;
    let protocol = protocol(arguments, config, case)?;
    let goal = Goal::of(config, protocol.range, protocol.threshold);
    let order = Order {
        labels: inputs.labels.as_ref(),
        goal,
        measure: Some(fidelity::measured_as_shown(&gpu, (&case.volume, &case.roi), &protocol)),
        rounded: splat::rounds(&arguments.output),
        size: arguments.max_size.map(|bytes| SizeLimit {
            bytes,
            fill: !settings.says_how_many(),
            bytes_of: Box::new(move |set| splat::file_bytes(&files.splats, set, &write)),
        }),
        clock: arguments.time_budget.map(|time| Clock {
            begun: start,
            time,
            // The default number of iterations is meant for fits without a clock.
            iterations: if settings.is_explicit("iterations") { config.iterations } else { u32::MAX },
        }),
        interrupted,
        ..Order::new(&case.volume, &case.roi, config)
    };
    let unit = case.volume.unit().text();
    let (plan, begin) = Plan::new(&gpu, order, &mut Stages::new(signals, console, goal, unit))?;
    let initialise_seconds = initialising.elapsed().as_secs_f64();

    warn_of_kernel(&write, config);
    let prepared = Prepared {
        arguments,
        settings,
        files,
        case,
        plan,
        checkpoints,
        gpu,
        made_of,
        write,
        protocol: (!arguments.no_eval).then_some(protocol),
        start,
        read_seconds,
        initialise_seconds,
        before: start.elapsed(),
    };
    Ok((prepared, begin))
}

impl Prepared<'_> {
    /// Measures the field of a set that is shown, by `protocol`, on a device.
    pub fn measure(
        &self,
        gpu: &Gpu,
        set: &SplatSet,
        splats: &[Splat],
        protocol: &Protocol,
    ) -> Result<Evaluation> {
        let of = (&self.case.volume, &self.case.roi);
        fidelity::evaluate_fitted(gpu, self.plan.problem(), set, splats, of, protocol)
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
    let range = arguments.eval_range.or((config.region.range == IntensityRange::Roi).then_some(Range::Roi));
    Ok(Protocol {
        offsets: evaluate::random_offsets(arguments.eval_offsets as usize, EVAL_SEED),
        range: case.range(range)?,
        shell: config.loss.shell,
        threshold: unweighted(range).max(config.region.threshold),
    })
}
