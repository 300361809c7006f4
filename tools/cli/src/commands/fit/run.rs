//! Runs `vgs fit`, stage by stage: prepare, estimate, fit, evaluate, report.

use std::time::Instant;

use engine::fit::End;

use super::arguments::FitArguments;
use super::doubts;
use super::output_files::OutputFiles;
use super::prepare::{Inputs, prepare};
use super::reporting::report;
use super::stages::{estimate, evaluate, fit};
use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::signals::Signals;

/// Runs the command.
pub fn run(arguments: &FitArguments, console: &Console) -> Result<u8, Stop> {
    let start = Instant::now();
    let settings = arguments.settings.resolve(arguments.is_limited())?;
    let files = OutputFiles::checked(arguments)?;
    let signals = Signals::install()?;
    let _lock = files.lock(arguments, &signals)?;
    let inputs = Inputs::read(arguments)?;
    let settings = settings.for_volume(inputs.case().volume.is_ct());
    doubts::tell(arguments, &settings, inputs.case(), console)?;
    let (prepared, begin) = prepare(arguments, &settings, &files, &inputs, &signals, console, start)?;
    let estimate = estimate(&prepared, &begin, console)?;
    if arguments.dry_run {
        return Ok(0);
    }
    let fitted = fit(&prepared, begin, &signals, console)?;
    let evaluated = evaluate(&prepared, &fitted, &signals)?;
    report(&prepared, &fitted, &evaluated, estimate, console)?;
    match fitted.outcome.end {
        End::Failed(error) => Err(error.into()),
        End::Stopped | End::Finished => Ok(signals.exit_code().unwrap_or(0)),
    }
}
