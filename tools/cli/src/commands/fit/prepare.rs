//! The first stage of a fit: everything that it needs is read, chosen and checked.

use std::time::{Duration, Instant};

use engine::Result;
use engine::fit::evaluate::{self, Protocol};
use engine::fit::labels::label;
use engine::fit::{FitConfig, IntensityRange, Scaling};
use engine::gpu::Gpu;
use engine::splat::{Field, Splat, SplatSet, WriteOptions};
use engine::volume::Labels;

use super::arguments::Arguments;
use super::checkpoint::{Checkpoints, Interrupted};
use super::optimise::{Schedule, Start};
use super::output_files::OutputFiles;
use super::settings::Settings;
use super::working_grid::WorkingGrid;
use crate::shared::evaluation::{EVAL_SEED, unweighted};
use crate::shared::flags::Range;
use crate::shared::inputs::{Case, grid_of};

/// A fit that is ready to begin: what its stages read.
pub struct Prepared<'a> {
    /// The flags.
    pub arguments: &'a Arguments,
    /// The hyper-parameters.
    pub settings: &'a Settings,
    /// The outputs.
    pub files: &'a OutputFiles,
    /// Volume and region as they were read.
    pub case: Case,
    labels: Option<Labels>,
    /// What is fitted in place of the voxels, if the settings ask for it.
    pub working: Option<WorkingGrid>,
    /// What is left on the way.
    pub checkpoints: Checkpoints,
    /// The device of the fit.
    pub gpu: Gpu,
    /// How the splats add up.
    pub field: Field,
    /// How the splats are written.
    pub write: WriteOptions,
    /// The closing evaluation, if there is one.
    pub protocol: Option<Protocol>,
    /// How long the fit goes on.
    pub schedule: Schedule,
    /// When the command began.
    pub start: Instant,
    /// Seconds from there until the inputs were read and the device was ready.
    pub read_seconds: f64,
    /// Seconds that placing the first splats took.
    pub initialise_seconds: f64,
    /// Time from the start until all of this was ready.
    pub before: Duration,
}

/// Reads the inputs, boots the device and places the first splats, or reads where an interrupted fit stands.
pub fn prepare<'a>(
    arguments: &'a Arguments,
    settings: &'a Settings,
    files: &'a OutputFiles,
    start: Instant,
) -> Result<(Prepared<'a>, Start)> {
    let (case, labels) = Case::read_labelled(&arguments.volume, &arguments.read, &arguments.region)?;
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
    let working = WorkingGrid::of(&case, config);
    let begin = begin(config, &case, working.as_ref(), interrupted)?;
    let initialise_seconds = initialising.elapsed().as_secs_f64();

    warn_of_kernel(&write, config);
    let fitted = working.as_ref().map_or(&case, |grid| &grid.case);
    let fit_config = working.as_ref().map_or(config, |grid| &grid.config);
    let field = config.field(Scaling::new(&fitted.volume, &fitted.roi, fit_config).background);
    let protocol = protocol(arguments, config, &case)?;
    let before = start.elapsed();
    let prepared = Prepared {
        arguments,
        settings,
        files,
        labels,
        working,
        checkpoints,
        gpu,
        field,
        write,
        protocol: (!arguments.no_eval).then_some(protocol),
        schedule: arguments.schedule(settings, before),
        start,
        read_seconds,
        initialise_seconds,
        before,
        case,
    };
    Ok((prepared, begin))
}

impl Prepared<'_> {
    /// Returns what is fitted: volume and region, or their working grid.
    pub fn fitted(&self) -> &Case {
        self.working.as_ref().map_or(&self.case, |grid| &grid.case)
    }

    /// Returns the hyper-parameters for what is fitted.
    pub fn fit_config(&self) -> &FitConfig {
        self.working.as_ref().map_or(&self.settings.config, |grid| &grid.config)
    }

    /// Returns splats of the fit, given in its voxel space, as a file keeps them.
    pub fn set(&self, splats: &[Splat], iterations: u32) -> SplatSet {
        let fitted = self.fitted();
        let mut set = SplatSet {
            iterations: Some(iterations),
            grid: Some(grid_of(&fitted.volume)),
            form: self.settings.config.fitted_form(&fitted.roi),
            ..SplatSet::from_voxel(splats, &fitted.volume.world_from_voxel, self.field)
        };
        if let Some(labels) = &self.labels {
            label(&mut set, labels);
        }
        set
    }
}

/// Returns where the fit begins: with first splats, or where it was interrupted.
fn begin(
    config: &FitConfig,
    case: &Case,
    working: Option<&WorkingGrid>,
    interrupted: Option<Interrupted>,
) -> Result<Start> {
    if let Some(interrupted) = interrupted {
        return Ok(Start::Interrupted(interrupted));
    }
    let fitted = working.map_or(case, |grid| &grid.case);
    let count = config.splat_count(case.roi.weight_sum());
    let run = config.initialiser()?.run;
    Ok(Start::Splats(run(&fitted.volume, &fitted.roi, count, config.seed, &config.init())))
}

/// Warns where programs that read the layout draw another kernel than that of the fit.
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

/// Returns how the splats are measured at the end.
fn protocol(arguments: &Arguments, config: &FitConfig, case: &Case) -> Result<Protocol> {
    // A fit over the region's range is measured over it, too.
    let range = arguments.eval_range.or((config.range == IntensityRange::Roi).then_some(Range::Roi));
    Ok(Protocol {
        offsets: evaluate::random_offsets(arguments.eval_offsets as usize, EVAL_SEED),
        range: case.range(range)?,
        shell: config.shell,
        threshold: unweighted(range).max(config.region_threshold),
    })
}
