//! Runs `vgs fit`, stage by stage: prepare, estimate, fit, evaluate, report.

use std::path::Path;
use std::time::Instant;

use engine::fit::{End, Settings};
use engine::gpu::Gpu;
use engine::output;

use super::arguments::FitArguments;
use super::doubts;
use super::output_files::OutputFiles;
use super::prepare::{Inputs, prepare};
use super::reporting::{report, tell};
use super::stages::{estimate, evaluate, fit};
use crate::report::results::FitResults;
use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::signals::Signals;

/// Runs the command.
pub fn run(arguments: &FitArguments, console: &Console) -> Result<u8, Stop> {
    let start = Instant::now();
    let checked = CheckedFit::new(arguments)?;
    let signals = Signals::install()?;
    match checked.run(Given::default(), &signals, console, start)? {
        Some(Done { end: End::Failed(error), .. }) => Err(error.into()),
        Some(Done { end: End::Stopped | End::Finished, .. }) => Ok(signals.exit_code().unwrap_or(0)),
        None => Ok(0),
    }
}

/// A fit whose flags were checked.
pub struct CheckedFit<'a> {
    arguments: &'a FitArguments,
    settings: Settings,
    files: OutputFiles,
}

/// What a fit finds ready; it makes what is not.
#[derive(Default)]
pub struct Given<'a> {
    pub gpu: Option<&'a Gpu>,
    pub inputs: Option<Inputs>,
    /// What the splats are made of, for the record.
    pub made_of: Option<&'a str>,
    /// A file to make once the outputs are locked: while it is there, they are not whole.
    pub begun: Option<&'a Path>,
}

/// A fit that was written.
pub struct Done {
    pub results: FitResults,
    pub end: End,
}

impl<'a> CheckedFit<'a> {
    /// Checks settings and outputs.
    pub fn new(arguments: &'a FitArguments) -> engine::Result<Self> {
        let settings = arguments.settings.resolve(arguments.is_limited())?;
        Ok(CheckedFit { arguments, settings, files: OutputFiles::checked(arguments)? })
    }

    /// Fits, measures and writes; nothing is fitted for a dry run.
    pub fn run(
        self,
        given: Given<'_>,
        signals: &Signals,
        console: &Console,
        start: Instant,
    ) -> engine::Result<Option<Done>> {
        let CheckedFit { arguments, settings, files } = self;
        let _lock = files.lock(arguments, signals)?;
        if let Some(begun) = given.begun {
            let what = given.made_of.unwrap_or_default();
            output::write_atomic(begun, true, |file| file.write_all(what.as_bytes()))?;
        }
        let inputs = match given.inputs {
            Some(inputs) => inputs,
            None => Inputs::read(arguments)?,
        };
        let settings = settings.for_volume(inputs.case().volume.is_ct());
        doubts::tell(arguments, &settings, inputs.case(), console)?;
        let gpu = match given.gpu {
            Some(gpu) => gpu.clone(),
            None => arguments.device.boot()?,
        };
        let (prepared, begin) =
            prepare(arguments, &settings, &files, &inputs, gpu, given.made_of, signals, console, start)?;
        let estimate = estimate(&prepared, &begin, console)?;
        if arguments.dry_run {
            return Ok(None);
        }
        let fitted = fit(&prepared, begin, signals, console)?;
        let evaluated = evaluate(&prepared, &fitted, signals)?;
        let results = report(&prepared, &fitted, &evaluated, estimate)?;
        tell(&prepared, &fitted, &evaluated, &results, console)?;
        Ok(Some(Done { results, end: fitted.outcome.end }))
    }
}
