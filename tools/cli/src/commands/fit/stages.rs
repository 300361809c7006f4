//! Stages of a fit between preparing and reporting: estimate, fit, evaluate.

use std::time::Instant;

use engine::Result;
use engine::fit::evaluate::Evaluation;
use engine::fit::{End, Outcome, ROUNDING_ITERATIONS, Start};
use engine::splat::SplatSet;

use super::output_files::OutputFiles;
use super::prepare::Prepared;
use super::watch::FitWatch;
use super::{count, explain, settle};
use crate::picture;
use crate::report::estimate::{self, Estimate};
use crate::report::record::PassRecord;
use crate::shared::console::Console;
use crate::shared::signals::Signals;
use crate::shared::splat_files;
use crate::shared::waiting::Waiting;

/// Estimates the cost of the fit and prints the estimate, if that was asked for.
pub fn estimate(prepared: &Prepared<'_>, begin: &Start, console: &Console) -> Result<Option<Estimate>> {
    let Prepared { arguments, settings, .. } = prepared;
    let first = match begin {
        Start::First(first) if arguments.explain || arguments.dry_run => first,
        _ => return Ok(None),
    };
    let estimate = explain::estimate(&explain::Plan {
        gpu: &arguments.device.boot()?,
        problem: &prepared.problem,
        native: prepared.case,
        begin,
        first,
        schedule: prepared.schedule,
        protocol: prepared.protocol.clone(),
        set: &prepared.first_set(first, settings.config.iterations),
        rounding_iterations: if prepared.is_rounded() { ROUNDING_ITERATIONS } else { 0 },
        output: &prepared.files.splats,
        write: &prepared.write,
        quality: settings.plain_quality(),
        target: prepared.goal.as_ref().map(|goal| {
            let about = if count::is_aim(settings) { "about " } else { "" };
            format!("{about}{}", count::text(goal, prepared.case.volume.unit().text()))
        }),
        before: prepared.before,
    })?;
    let unit = prepared.case.volume.unit().text();
    if !arguments.dry_run {
        console.say(&estimate::text(&estimate, unit));
    } else if console.json {
        console.json_data(&estimate)?;
    } else {
        console.data(&(estimate::text(&estimate, unit) + "\n"))?;
    }
    Ok(Some(estimate))
}

/// Splats of a fit, written to their file, and how it went.
pub struct Fitted {
    /// Outcome of the fit.
    pub outcome: Outcome,
    /// Splats as the file has them.
    pub set: SplatSet,
    /// Device time by pass.
    pub passes: Vec<PassRecord>,
    /// Output files: that of the splats and those of the reports.
    pub files: OutputFiles,
}

/// Part of the time budget by which a fit may take longer without a warning.
const OVERRUN: f64 = 0.1;

/// Fits the splats and writes them.
pub fn fit(prepared: &Prepared<'_>, begin: Start, signals: &Signals, console: &Console) -> Result<Fitted> {
    let mut outcome = {
        let mut watch = FitWatch::new(prepared, signals, console);
        prepared.problem.run(&prepared.gpu, begin, prepared.schedule, &mut watch)?
    };
    let passes = PassRecord::list(prepared.gpu.take_profile());
    if outcome.frozen > 0 {
        tracing::warn!("{} updates of splats were left out: a gradient was not finite", outcome.frozen);
    }
    let finished = matches!(outcome.end, End::Finished);
    let set = if finished {
        settle::settled(prepared, &mut outcome, signals, console)?
    } else {
        prepared.set(&outcome.splats, outcome.iterations)
    };
    let files = prepared.files.after(&outcome.end);
    splat_files::write(&files.splats, &set, &prepared.write)?;
    if finished {
        prepared.checkpoints.clean();
    }
    warn_of_time(prepared, outcome.iterations);
    Ok(Fitted { outcome, set, passes, files })
}

/// Warns if the time budget was too short for what cannot be left out: reading, placing splats, an iteration.
fn warn_of_time(prepared: &Prepared<'_>, iterations: u32) {
    let took = prepared.start.elapsed();
    if let Some(budget) = prepared.arguments.time_budget
        && took > budget.mul_f64(1.0 + OVERRUN)
    {
        tracing::warn!(
            "the splats were ready after {:.1} s, not {:.1}: reading took {:.1} s, placing them {:.1} s, {iterations} \
             iterations the rest; fewer splats take less",
            took.as_secs_f64(),
            budget.as_secs_f64(),
            prepared.read_seconds,
            prepared.initialise_seconds
        );
    }
}

/// Result of the closing evaluation.
pub struct Evaluated {
    /// Evaluation; `None` if it was not asked for or the fit did not finish.
    pub evaluation: Option<Evaluation>,
    /// Time of the evaluation, with the picture, seconds.
    pub seconds: f64,
}

/// Measures the splats of a fit that finished, and draws the picture of the evaluation.
pub fn evaluate(prepared: &Prepared<'_>, fitted: &Fitted, signals: &Signals) -> Result<Evaluated> {
    let evaluating = Instant::now();
    let finished = matches!(fitted.outcome.end, End::Finished) && signals.exit_code().is_none();
    let waiting = Waiting::on("measuring the splats");
    let measured = |protocol| settle::measure(prepared, &fitted.set, &fitted.outcome.splats, protocol);
    let evaluation = prepared.protocol.as_ref().filter(|_| finished).map(measured).transpose()?;
    drop(waiting);
    if let (Some(path), Some(evaluation)) = (&prepared.files.picture, &evaluation) {
        let _waiting = Waiting::on(format!("drawing {}", path.display()));
        picture::draw(
            path,
            prepared.write.force,
            &prepared.gpu,
            &fitted.set,
            prepared.case,
            None,
            &picture::names(&prepared.files.splats, &prepared.arguments.volume),
            evaluation,
        )?;
    }
    Ok(Evaluated { evaluation, seconds: evaluating.elapsed().as_secs_f64() })
}
