//! Last stage of a fit: writes the run record and the curve, and prints the figures.

use std::path::Path;

use engine::coded::{InPlaceOfSplats, in_place_of_splats};
use engine::fit::evaluate::Evaluation;
use engine::fit::{End, Outcome};
use engine::{Result, splat};

use super::prepare::Prepared;
use super::stages::{Evaluated, Fitted};
use crate::report::estimate::{CheckedEstimate, Estimate};
use crate::report::quality::{Quality, quality_text};
use crate::report::record::{MemoryRecord, RoiRecord, RunRecord, Timings, VolumeRecord, WorkingRecord};
use crate::report::results::FitResults;
use crate::shared::clock;
use crate::shared::console::Console;
use crate::shared::figures::{bytes, seconds};
use crate::shared::interrupted;
use crate::shared::memory::host_peak_bytes;
use crate::shared::version::{COMMIT, NUMBER, VERSION};

/// Writes the record and the curve of a fit, and returns its results.
pub fn report(
    prepared: &Prepared<'_>,
    fitted: &Fitted,
    evaluated: &Evaluated,
    estimate: Option<Estimate>,
) -> Result<FitResults> {
    let (arguments, files) = (prepared.arguments, &fitted.files);
    let timings = timings(prepared, fitted, evaluated, estimate.as_ref());
    let results = results(prepared, fitted, evaluated, &timings);
    warn_of_target(prepared, evaluated);
    warn_of_bytes(prepared, fitted, evaluated);
    let checked = match estimate {
        Some(estimate) => {
            let file_bytes = splat::file_bytes(&files.splats, &fitted.set, &prepared.write)?;
            Some(CheckedEstimate::new(estimate, &results, file_bytes))
        }
        None => None,
    };
    let record = record(prepared, &fitted.outcome, timings, checked, &results)?;
    files.write_reports(
        &record,
        &fitted.outcome,
        (&arguments.volume, prepared.case.volume.unit().text()),
        prepared.write.force,
    )?;
    Ok(results)
}

/// Prints the results of a fit.
pub fn tell(
    prepared: &Prepared<'_>,
    fitted: &Fitted,
    evaluated: &Evaluated,
    results: &FitResults,
    console: &Console,
) -> Result<()> {
    if console.json {
        console.json_data(results)
    } else if !console.quiet {
        console.data(&summary(results, fitted, evaluated.evaluation.as_ref(), &prepared.arguments.output))
    } else {
        Ok(())
    }
}

/// Returns the times of the stages.
fn timings(
    prepared: &Prepared<'_>,
    fitted: &Fitted,
    evaluated: &Evaluated,
    estimate: Option<&Estimate>,
) -> Timings {
    Timings {
        read: prepared.read_seconds,
        initialise: prepared.initialise_seconds,
        trials: prepared.plan.counted().as_secs_f64(),
        calibrate: estimate.map(|estimate| estimate.calibration_seconds).unwrap_or_default(),
        fit: fitted.outcome.seconds,
        evaluate: evaluated.seconds,
        total: prepared.start.elapsed().as_secs_f64(),
        passes: fitted.passes.clone(),
    }
}

/// Returns the results of the fit, as they are printed.
fn results(prepared: &Prepared<'_>, fitted: &Fitted, evaluated: &Evaluated, timings: &Timings) -> FitResults {
    let Prepared { gpu, case, .. } = prepared;
    let outcome = &fitted.outcome;
    let device = gpu.description();
    FitResults {
        splats: outcome.splats.len(),
        quality: evaluated.evaluation.as_ref().map(Quality::of),
        target_reached: surplus(prepared, evaluated).map(|db| db >= 0.0),
        seconds: timings.total,
        fit_seconds: outcome.seconds,
        seconds_per_iteration: outcome.seconds / f64::from(outcome.iterations.max(1)),
        iterations: outcome.iterations,
        frozen_updates: outcome.frozen,
        device_peak_bytes: gpu.peak_bytes(),
        host_peak_bytes: host_peak_bytes(),
        device: device.name.clone(),
        driver: device.driver.clone(),
        roi_voxels: case.roi.voxel_count(),
        outputs: fitted.files.list().iter().map(|p| p.display().to_string()).collect(),
    }
}

/// Returns by how much the fit is better than its target, dB, if it has one and was measured.
fn surplus(prepared: &Prepared<'_>, evaluated: &Evaluated) -> Option<f64> {
    let evaluation = evaluated.evaluation.as_ref()?;
    Some(prepared.plan.goal()?.surplus_of(&evaluation.on_grid))
}

/// Warns of a target that the fit has missed.
fn warn_of_target(prepared: &Prepared<'_>, evaluated: &Evaluated) {
    let Some((goal, surplus)) = prepared.plan.goal().zip(surplus(prepared, evaluated)) else { return };
    let Some(db) = prepared.settings.missed_db(surplus) else { return };
    let target = goal.text(prepared.case.volume.unit().text());
    if prepared.settings.is_aim() {
        tracing::warn!(
            "the aim of {target} is missed by {db:.1} dB; --target-hu makes it a target that is reached"
        );
    } else {
        tracing::warn!("{target} is missed by {db:.2} dB: the limits of the fit allow no more splats");
    }
}

/// Warns if splats that are to reach an error take more bytes than the region without them.
fn warn_of_bytes(prepared: &Prepared<'_>, fitted: &Fitted, evaluated: &Evaluated) {
    let Some((_, evaluation)) = prepared.plan.goal().zip(evaluated.evaluation.as_ref()) else { return };
    let output = &fitted.files.splats;
    let Ok(taken) = std::fs::metadata(output).map(|file| file.len()) else { return };
    if !splat::rounds(output) {
        return;
    }
    let case = &prepared.case;
    let coded = in_place_of_splats(&case.volume, &case.roi, evaluation.on_grid.rmse_hu);
    if let Some(InPlaceOfSplats { bound, bytes: without }) = coded.filter(|coded| coded.bytes < taken) {
        tracing::warn!(
            "these splats take {}; without splats the region takes {} as near in the mean, and no voxel is off by more \
             than {bound:.0}{}: vgs convert {} --bound {bound:.0} -o OUT.vgs, with the same --roi",
            bytes(taken),
            bytes(without),
            case.volume.unit().text(),
            prepared.arguments.volume.display()
        );
    }
}

/// Returns the run record.
fn record<'a>(
    prepared: &'a Prepared<'_>,
    outcome: &Outcome,
    timings: Timings,
    estimate: Option<CheckedEstimate>,
    results: &'a FitResults,
) -> Result<RunRecord<'a>> {
    let Prepared { arguments, settings, case, plan, gpu, .. } = prepared;
    let problem = plan.problem();
    let (end, error) = match &outcome.end {
        End::Finished => ("finished", None),
        End::Stopped => ("stopped", None),
        End::Failed(error) => ("failed", Some(error.to_string())),
    };
    Ok(RunRecord {
        format: "vgs-run-1",
        date: clock::now(),
        version: NUMBER,
        commit: COMMIT,
        command: std::env::args_os().map(|a| a.to_string_lossy().into_owned()).collect(),
        end,
        error,
        made_of: prepared.made_of,
        inputs: arguments.input_records()?,
        volume: VolumeRecord::of(&case.volume),
        roi: RoiRecord::of(&case.roi, &case.volume),
        working_grid: problem.has_own_grid().then(|| WorkingRecord {
            volume: VolumeRecord::of(problem.volume()),
            roi: RoiRecord::of(problem.roi(), problem.volume()),
        }),
        profile: &settings.profile,
        quality: settings.quality.as_deref(),
        explicit: &settings.explicit,
        config: &settings.config,
        time_budget_seconds: arguments.time_budget.map(|t| t.as_secs_f64()),
        device: gpu.description(),
        timings,
        memory: MemoryRecord {
            device_by_purpose: outcome.device_bytes.clone(),
            device_peak_bytes: results.device_peak_bytes,
            host_peak_bytes: results.host_peak_bytes,
        },
        estimate,
        results,
    })
}

/// Returns lines two columns further right.
fn indented(lines: &str) -> String {
    lines.lines().map(|line| format!("  {line}\n")).collect()
}

/// Describes the end of a fit in plain words.
fn summary(
    results: &FitResults,
    Fitted { outcome, files, .. }: &Fitted,
    evaluation: Option<&Evaluation>,
    output: &Path,
) -> String {
    let how = match &outcome.end {
        End::Finished => "fitted",
        End::Stopped => "stopped early: fitted",
        End::Failed(_) => "failed: left are",
    };
    let mut out = format!(
        "{how} {} splats to {} voxels in {} ({} iterations, {} each; {} with reading and all the rest)\n",
        results.splats,
        results.roi_voxels,
        seconds(results.fit_seconds),
        results.iterations,
        seconds(results.seconds_per_iteration),
        seconds(results.seconds)
    );
    if let Some(evaluation) = evaluation {
        out.push_str(&format!(
            "how near that is to the scan, in the region:\n{}",
            indented(&quality_text(evaluation))
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
    if matches!(outcome.end, End::Stopped) {
        let state = interrupted::state_path(output);
        out.push_str(&format!("to go on: the same command with --resume ({})\n", state.display()));
    }
    out.push_str(&format!("vgs {VERSION}. For looking, not for diagnosis.\n"));
    out
}
