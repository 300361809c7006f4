//! Stages of a fit between preparing and reporting: estimate, fit, evaluate.

use std::time::Instant;

use engine::Result;
use engine::fit::evaluate::Evaluation;
use engine::fit::{self, End, Outcome, Start};
use engine::splat::SplatSet;

use super::explain;
use super::output_files::OutputFiles;
use super::prepare::Prepared;
use super::watch::FitWatch;
use crate::picture;
use crate::report::estimate::{self, Estimate};
use crate::report::record::PassRecord;
use crate::shared::console::Console;
use crate::shared::signals::Signals;
use crate::shared::splat_files;
use crate::shared::waiting::Waiting;

/// Estimates the cost of the fit and prints the estimate, if that was asked for.
pub fn estimate(prepared: &Prepared<'_>, begin: &Start, console: &Console) -> Result<Option<Estimate>> {
    let arguments = prepared.arguments;
    let first = match begin {
        Start::First(first) if arguments.explain || arguments.dry_run => first,
        _ => return Ok(None),
    };
    let begun = Instant::now();
    let [gpu, gpu_of_evaluation] = [arguments.device.boot()?, arguments.device.boot()?];
    let estimate = explain::estimate(&explain::Trying {
        gpu: &gpu,
        gpu_of_evaluation: &gpu_of_evaluation,
        prepared,
        begin,
        first,
        begun,
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
    let fitted = {
        let mut watch = FitWatch::new(prepared, signals, console);
        prepared.plan.run(begin, &mut watch)?
    };
    let fit::Fitted { set, mut outcome, lacking: _ } = fitted;
    let passes = PassRecord::list(std::mem::take(&mut outcome.passes));
    let finished = matches!(outcome.end, End::Finished);
    let files = prepared.files.after(&outcome.end);
    let writing = Waiting::on(format!("writing {}", files.splats.display()));
    match (splat_files::write(&files.splats, &set, &prepared.write), outcome.end) {
        (Ok(()), end) => outcome.end = end,
        // What made the fit fail comes first: with a full disk the splats cannot be kept either.
        (Err(error), End::Failed(cause)) => {
            tracing::warn!("the splats so far are lost: {error}");
            return Err(cause);
        }
        (Err(error), _) => return Err(error),
    }
    drop(writing);
    if files.splats != prepared.files.splats {
        let (kept, written) = (prepared.files.splats.display(), files.splats.display());
        tracing::warn!("{kept} stays as it is; what this fit came to is in {written}");
    }
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
    let measured = |protocol| prepared.measure(&prepared.gpu, &fitted.set, &fitted.outcome.splats, protocol);
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
