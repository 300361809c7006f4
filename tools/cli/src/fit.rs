//! `vgs fit`: splats for the region of interest of a volume.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use engine::fit::evaluate::{self, Evaluation};
use engine::fit::labels::label;
use engine::fit::{FitConfig, IntensityRange, Scaling};
use engine::output::write_atomic;
use engine::splat::{self, Form, Splat, SplatSet};
use engine::{Error, Kind, Result};

use crate::arguments::{DeviceArguments, Range, VERSION, duration, range_or_roi, unweighted};
use crate::checkpoint::{self, CheckpointArguments, Checkpoints};
use crate::clock;
use crate::console::Console;
use crate::eval;
use crate::explain::{self, Checked};
use crate::failure::Stop;
use crate::inputs::{Case, InputRecord, ReadArguments, RoiArguments, grid_of};
use crate::lock::Lock;
use crate::optimise::{self, End, Job, Outcome, Schedule, Start};
use crate::outputs;
use crate::report::record::{
    Memory, PassRecord, Results, RoiRecord, RunRecord, Timings, VolumeRecord, WorkingRecord, host_peak_bytes,
};
use crate::report::{Quality, bytes, curve, psnr, seconds};
use crate::settings::{Settings, SettingsArguments};
use crate::signals::Signals;
use crate::splats::{self, LayoutArguments};

/// Fits splats to the region of interest of a volume
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Arguments {
    /// The volume: NIfTI or InVesalius project
    volume: PathBuf,
    #[command(flatten)]
    region: RoiArguments,
    /// Where the splats go (PLY). Beside it: .run.json (record), .csv and .svg (curve)
    #[arg(short, long, value_name = "OUT.ply", help_heading = "Output")]
    output: PathBuf,
    /// Replaces outputs that exist
    #[arg(short, long, help_heading = "Output")]
    force: bool,
    /// Slices and shaded views of CT, splats and difference, as `vgs eval` draws them
    #[arg(long, value_name = "FILE.png", help_heading = "Output", conflicts_with = "no_eval")]
    picture: Option<PathBuf>,
    /// Leaves out the closing evaluation
    #[arg(long, help_heading = "Output")]
    no_eval: bool,
    /// What the PSNR of the closing evaluation is over: two HU, or roi for the volume's range inside the region [default:
    /// the range of the whole volume]
    #[arg(long, value_name = "LOW,HIGH|roi", value_parser = range_or_roi, allow_hyphen_values = true,
          help_heading = "Output")]
    eval_range: Option<Range>,
    /// Sub-voxel offset grids of the closing evaluation
    #[arg(long, value_name = "N", default_value_t = 4, help_heading = "Output",
          value_parser = clap::value_parser!(u32).range(0..=64))]
    eval_offsets: u32,
    /// Says first what the fit will cost on this device: time, memory, file, error. The record then has both that and what
    /// it came to
    #[arg(long, help_heading = "Output", conflicts_with = "resume")]
    explain: bool,
    /// Says it and does not fit; nothing is written
    #[arg(long, help_heading = "Output", conflicts_with_all = ["resume", "explain"])]
    dry_run: bool,
    #[command(flatten)]
    layout: LayoutArguments,
    #[command(flatten)]
    checkpoint: CheckpointArguments,
    #[command(flatten)]
    read: ReadArguments,
    /// Time until the splats are ready (90s, 5m), reading included: as many iterations as it allows are done, and
    /// the schedule follows the clock. Two runs then differ. --iterations limits it only where it is given
    #[arg(long, value_name = "TIME", value_parser = duration, help_heading = "Settings")]
    time_budget: Option<Duration>,
    #[command(flatten)]
    device: DeviceArguments,
    #[command(flatten)]
    settings: SettingsArguments,
}

const EXAMPLES: &str = "\
Examples:
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply --quality fine --dry-run     what that would cost
  vgs fit ct.nii.gz --roi labels.nii.gz --roi-label liver,aorta -o organs.ply --density 0.2
  vgs fit skull.inv3 --roi-threshold 226,3071 -o skull.ply --time-budget 5m
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply --config best.toml --json
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply --kernel gaussian --ply-layout reference
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply --profile paper --subset 4000 --checkpoint-every 100
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply --profile paper --subset 4000 --resume";

/// Offsets of the closing evaluation come from this seed, as those of `vgs eval` by default.
pub const EVAL_SEED: u64 = 7;

/// Runs the command.
pub fn run(arguments: &Arguments, console: &Console) -> std::result::Result<u8, Stop> {
    let start = Instant::now();
    let settings = arguments.settings.resolve()?;
    let files = Files::of(&arguments.output, arguments.picture.as_deref());
    let mut inputs = vec![arguments.volume.as_path()];
    inputs.extend(arguments.region.roi.as_deref());
    // What an interrupted fit has written is its own to replace.
    // A dry run writes nothing that could replace anything.
    let force = arguments.force || arguments.checkpoint.resume || arguments.dry_run;
    outputs::check(&files.list(), &inputs, force)?;
    check_extension(&files.splats)?;
    let signals = Signals::install()?;
    let _lock = if arguments.dry_run { None } else { Some(Lock::take(&files.splats, &signals)?) };
    // Another run may have written them before it gave the lock away.
    outputs::check(&files.list(), &inputs, force)?;
    let (case, labels) = Case::read_labelled(&arguments.volume, &arguments.read, &arguments.region)?;
    let checkpoints = Checkpoints::new(
        &arguments.checkpoint,
        &files.splats,
        &arguments.input_records()?,
        &arguments.region,
        &settings.config,
        arguments.layout.options(&case.volume, &case.roi, force),
    )?;
    let interrupted = if arguments.checkpoint.resume { Some(checkpoints.read()?) } else { None };
    let gpu = arguments.device.boot()?;
    let mut timings = Timings { read: start.elapsed().as_secs_f64(), ..Default::default() };

    let initialising = Instant::now();
    let config = &settings.config;
    let working = WorkingGrid::of(&case, config);
    let fitted = working.as_ref().map_or(&case, |grid| &grid.case);
    let fit_config = working.as_ref().map_or(config, |grid| &grid.config);
    let begin = match interrupted {
        Some(interrupted) => Start::Interrupted(interrupted),
        None => {
            let count = config.splat_count(case.roi.weight_sum());
            let run = config.initialiser()?.run;
            Start::Splats(run(&fitted.volume, &fitted.roi, count, config.seed, &config.init()))
        }
    };
    timings.initialise = initialising.elapsed().as_secs_f64();

    let write = arguments.layout.options(&case.volume, &case.roi, force);
    if let Some(theirs) = write.layout.kernel.filter(|&kernel| kernel != config.kernel) {
        tracing::warn!(
            "programs that read the layout {} draw the kernel {}, the fit is with {}: fit with --kernel {} for them",
            write.layout.name,
            theirs.name(),
            config.kernel.name(),
            theirs.name()
        );
    }
    let background = Scaling::new(&fitted.volume, &fitted.roi, fit_config).background;
    let field = config.field(background);
    let grid = grid_of(&fitted.volume);
    let set_of = |splats: &[Splat], iterations: u32| {
        let mut set = SplatSet {
            iterations: Some(iterations),
            grid: Some(grid),
            form: config.fitted_form(&fitted.roi),
            ..SplatSet::from_voxel(splats, &fitted.volume.world_from_voxel, field)
        };
        if let Some(labels) = &labels {
            label(&mut set, labels);
        }
        set
    };
    // A fit over the region's range is measured over it, too.
    let eval_range = arguments.eval_range.or((config.range == IntensityRange::Roi).then_some(Range::Roi));
    let protocol = evaluate::Protocol {
        offsets: evaluate::random_offsets(arguments.eval_offsets as usize, EVAL_SEED),
        range: case.range(eval_range)?,
        shell: config.shell,
        threshold: unweighted(eval_range).max(config.region_threshold),
    };
    let protocol = (!arguments.no_eval).then_some(protocol);
    let before = start.elapsed();
    let schedule = arguments.schedule(&settings, before);
    let estimate = match &begin {
        Start::Splats(first) if arguments.explain || arguments.dry_run => {
            Some(explain::estimate(&explain::Plan {
                gpu: &arguments.device.boot()?,
                fitted,
                native: &case,
                config: fit_config,
                field,
                first,
                schedule,
                protocol: protocol.clone(),
                set: &set_of(first, config.iterations),
                output: &files.splats,
                write: &write,
                quality: settings.plain_quality(),
                before,
            })?)
        }
        _ => None,
    };
    if let Some(estimate) = &estimate {
        timings.calibrate = estimate.calibration_seconds;
        if !arguments.dry_run {
            console.say(&explain::text(estimate));
        } else if console.json {
            console.json_data(estimate)?;
        } else {
            console.data(&(explain::text(estimate) + "\n"))?;
        }
    }
    if arguments.dry_run {
        return Ok(0);
    }
    let job = Job {
        gpu: &gpu,
        case: fitted,
        config: fit_config,
        schedule,
        checkpoints: &checkpoints,
        signals: &signals,
        console,
    };
    let outcome = optimise::run(&job, begin)?;
    timings.fit = outcome.seconds;
    timings.passes = PassRecord::list(gpu.take_profile());
    if outcome.frozen > 0 {
        tracing::warn!("{} updates of splats were left out: a gradient was not finite", outcome.frozen);
    }

    let set = set_of(&outcome.splats, outcome.iterations);
    splats::write(&files.splats, &set, &write)?;

    let evaluating = Instant::now();
    let wanted = matches!(outcome.end, End::Finished) && signals.exit_code().is_none();
    let evaluation = match protocol.filter(|_| wanted) {
        // What is shown counts.
        Some(protocol) if set.form != Form::Field => {
            Some(eval::evaluate_decoded(&gpu, &set, &case, &protocol)?)
        }
        Some(protocol) => {
            // Of a working grid to the native one; without it they are there, and nothing need be rounded.
            let native = working.as_ref().map(|_| set.to_voxel(&case.volume.world_from_voxel));
            Some(evaluate::evaluate(
                &gpu,
                native.as_deref().unwrap_or(&outcome.splats),
                &field,
                &case.volume,
                &case.roi,
                &protocol,
            )?)
        }
        None => None,
    };
    if let (Some(path), Some(evaluation)) = (&files.picture, &evaluation) {
        eval::draw(
            path,
            force,
            &gpu,
            &set,
            &case,
            None,
            &eval::names(&files.splats, &arguments.volume),
            evaluation,
        )?;
    }
    timings.evaluate = evaluating.elapsed().as_secs_f64();
    timings.total = start.elapsed().as_secs_f64();

    let description = gpu.description();
    let results = Results {
        splats: outcome.splats.len(),
        quality: evaluation.as_ref().map(Quality::of),
        seconds: timings.total,
        fit_seconds: outcome.seconds,
        seconds_per_iteration: outcome.seconds / f64::from(outcome.iterations.max(1)),
        iterations: outcome.iterations,
        frozen_updates: outcome.frozen,
        device_peak_bytes: gpu.peak_bytes(),
        host_peak_bytes: host_peak_bytes(),
        device: description.name.clone(),
        driver: description.driver.clone(),
        roi_voxels: case.roi.voxel_count(),
        outputs: files.list().iter().map(|p| p.display().to_string()).collect(),
    };
    let (end, error) = match &outcome.end {
        End::Finished => ("finished", None),
        End::Stopped(_) => ("stopped", None),
        End::Failed(error) => ("failed", Some(error.to_string())),
    };
    let record = RunRecord {
        format: "vgs-run-1",
        date: clock::now(),
        version: env!("CARGO_PKG_VERSION"),
        commit: env!("VGS_COMMIT"),
        command: std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect(),
        end,
        error,
        inputs: arguments.input_records()?,
        volume: VolumeRecord::of(&case.volume),
        roi: RoiRecord::of(&case.roi, &case.volume),
        working_grid: working.as_ref().map(|grid| WorkingRecord {
            volume: VolumeRecord::of(&grid.case.volume),
            roi: RoiRecord::of(&grid.case.roi, &grid.case.volume),
        }),
        profile: &settings.profile,
        quality: settings.quality.as_deref(),
        explicit: &settings.explicit,
        config,
        time_budget_seconds: arguments.time_budget.map(|t| t.as_secs_f64()),
        device: description,
        timings: timings.clone(),
        memory: Memory {
            device_by_purpose: outcome.device_bytes.clone(),
            device_peak_bytes: results.device_peak_bytes,
            host_peak_bytes: results.host_peak_bytes,
        },
        estimate: match estimate {
            Some(estimate) => {
                Some(Checked::new(estimate, &results, splat::file_bytes(&files.splats, &set, &write)?))
            }
            None => None,
        },
        results: &results,
    };
    files.write_reports(&record, &outcome, &arguments.volume, force)?;

    if console.json {
        console.json_data(&results)?;
    } else if !console.quiet {
        console.data(&summary(&results, &outcome, evaluation.as_ref(), &files))?;
    }
    match outcome.end {
        End::Failed(error) => Err(error.into()),
        End::Stopped(code) => Ok(code),
        End::Finished => Ok(signals.exit_code().unwrap_or(0)),
    }
}

impl Arguments {
    fn schedule(&self, settings: &Settings, spent: Duration) -> Schedule {
        // The default number of iterations is meant for fits without a clock.
        let iterations = match self.time_budget {
            Some(_) if !settings.is_explicit("iterations") => u32::MAX,
            _ => settings.config.iterations,
        };
        Schedule { iterations, time: self.time_budget.map(|t| t.saturating_sub(spent)) }
    }

    fn input_records(&self) -> Result<BTreeMap<&'static str, InputRecord>> {
        let mut records = BTreeMap::from([("volume", InputRecord::of(&self.volume)?)]);
        if let Some(mask) = &self.region.roi {
            records.insert("roi", InputRecord::of(mask)?);
        }
        Ok(records)
    }
}

/// The case on the coarser grid that is fitted in its place (`working_grid`).
struct WorkingGrid {
    case: Case,
    /// With the HU range that the native volume has or suggests: the means of its blocks reach less far.
    config: FitConfig,
}

impl WorkingGrid {
    /// Nothing where the voxels themselves are fitted.
    fn of(case: &Case, config: &FitConfig) -> Option<Self> {
        if config.working_grid <= 1 {
            return None;
        }
        let (low, high) = Scaling::new(&case.volume, &case.roi, config).range;
        let config = FitConfig { hu_range: [low, high], ..config.clone() };
        Some(WorkingGrid { case: case.coarsened(config.working_grid as usize), config })
    }
}

/// The outputs of a fit.
struct Files {
    splats: PathBuf,
    record: PathBuf,
    csv: PathBuf,
    svg: PathBuf,
    picture: Option<PathBuf>,
}

impl Files {
    fn of(output: &Path, picture: Option<&Path>) -> Self {
        Files {
            splats: output.to_owned(),
            record: outputs::beside(output, ".run.json"),
            csv: outputs::beside(output, ".csv"),
            svg: outputs::beside(output, ".svg"),
            picture: picture.map(Path::to_owned),
        }
    }

    fn list(&self) -> Vec<&Path> {
        let mut list = vec![self.splats.as_path(), &self.record, &self.csv, &self.svg];
        list.extend(self.picture.as_deref());
        list
    }

    fn write_reports(
        &self,
        record: &RunRecord<'_>,
        outcome: &Outcome,
        volume: &Path,
        force: bool,
    ) -> Result<()> {
        let json = serde_json::to_string_pretty(record).map_err(|e| {
            Error::new(Kind::Internal, "VGS-CLI-003", format!("the record cannot be written as JSON: {e}"))
        })?;
        let name = volume.file_name().unwrap_or_default().to_string_lossy();
        let title = format!("{name}: {} splats", outcome.splats.len());
        let plot = curve::svg(&outcome.curve, &title, outcome.range, outcome.unit)?;
        let put = |path: &Path, text: &str| write_atomic(path, force, |out| out.write_all(text.as_bytes()));
        put(&self.record, &(json + "\n"))?;
        put(&self.csv, &curve::csv(&outcome.curve))?;
        put(&self.svg, &plot)
    }
}

/// The extension names the format; a wrong one must not be found out after the fit.
fn check_extension(path: &Path) -> Result<()> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    if splat::FORMATS.iter().any(|format| format.name.eq_ignore_ascii_case(&extension)) {
        return Ok(());
    }
    let names: Vec<_> = splat::FORMATS.iter().map(|format| format!(".{}", format.name)).collect();
    Err(Error::new(Kind::Usage, "VGS-CLI-022", "the extension names no splat format")
        .file(path)
        .help(format!("known: {}", names.join(", "))))
}

/// The end of a fit in plain words.
fn summary(results: &Results, outcome: &Outcome, evaluation: Option<&Evaluation>, files: &Files) -> String {
    let how = match &outcome.end {
        End::Finished => "fitted",
        End::Stopped(_) => "stopped early: fitted",
        End::Failed(_) => "failed: what is left are",
    };
    let mut out = format!(
        "{how} {} splats to {} voxels in {} ({} iterations, {} each; {} in all)\n",
        results.splats,
        results.roi_voxels,
        seconds(results.fit_seconds),
        results.iterations,
        seconds(results.seconds_per_iteration),
        seconds(results.seconds)
    );
    if let (Some(quality), Some(evaluation)) = (&results.quality, evaluation) {
        let ([low, high], unit) = (quality.range, evaluation.unit);
        out.push_str(&format!(
            "quality in the region, PSNR over {low} to {high}{unit}:\n  at the voxels: {}, an error of {:.1}{unit} (root \
             mean square)\n",
            psnr(quality.psnr_db, quality.range),
            quality.rmse_hu
        ));
        if !evaluation.between.is_empty() {
            out.push_str(&format!(
                "  between the voxels: {} at the worst of {} offsets, {} in the mean\n",
                psnr(quality.psnr_min_offset_db, quality.range),
                evaluation.between.len(),
                psnr(quality.psnr_mean_offset_db, quality.range)
            ));
        }
        out.push_str(&format!(
            "  outline: occupancy off by {:.3} (root mean square between the voxels), soft Dice {:.4}\n",
            quality.occupancy_rmse, quality.soft_dice
        ));
    }
    let host = results.host_peak_bytes.map(|n| format!(", {} of the host", bytes(n))).unwrap_or_default();
    let name = |p: &&Path| p.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let names: Vec<_> = files.list()[1..].iter().map(name).collect();
    out.push_str(&format!(
        "memory: at most {} of the device{host}\non: {} ({})\nwritten: {}, and {}\n",
        bytes(results.device_peak_bytes),
        results.device,
        results.driver,
        files.splats.display(),
        names.join(", ")
    ));
    if matches!(outcome.end, End::Stopped(_)) {
        let state = checkpoint::state_path(&files.splats);
        out.push_str(&format!("to go on: the same command with --resume ({})\n", state.display()));
    }
    out.push_str(&format!("vgs {VERSION}. For looking, not for diagnosis.\n"));
    out
}
