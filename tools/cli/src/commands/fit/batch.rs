//! Fits many cases in one process (`vgs batch`): the device, its pipelines and caches once, and the next case read while
//! one is fitted.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::thread;
use std::time::{Duration, Instant};

use clap::{Args, FromArgMatches};
use engine::fit::End;
use engine::gpu::Gpu;
use engine::{Error, Kind, Result};
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::arguments::FitArguments;
use super::cases::{self, Case};
use super::prepare::Inputs;
use super::run::{CheckedFit, Given};
use crate::report::results::FitResults;
use crate::shared::console::{self, Console};
use crate::shared::failure::{self, Stop};
use crate::shared::figures::seconds;
use crate::shared::flags::{DeviceArguments, duration};
use crate::shared::interrupted;
use crate::shared::outputs;
use crate::shared::signals::Signals;
use crate::shared::version::{COMMIT, NUMBER};
use crate::shared::waiting;

/// Fits splats to many cases: what is done already is left as it is, and a broken case costs itself alone
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct BatchArguments {
    /// A table (CSV) with the column volume and, as they are needed, name, roi and any other flag of vgs fit; or a folder
    /// in BIDS' layout, of which each mask is a case with its scan, of a label map with all labels
    #[arg(value_name = "CASES.csv|FOLDER")]
    cases: PathBuf,
    /// Folder for the outputs; it is made if there is none
    #[arg(short, long, value_name = "FOLDER", help_heading = "Output")]
    output: PathBuf,
    /// Format of the splats: ply or vgs
    #[arg(long, value_name = "FORMAT", default_value = "ply", value_parser = ["ply", "vgs"], help_heading = "Output")]
    format: String,
    /// Fits cases again that are done, or were made of other inputs, settings or another version
    #[arg(short, long, help_heading = "Output")]
    force: bool,
    /// Only every n-th case, from the i-th on: 1/4 to 4/4 share the cases among four processes
    #[arg(long, value_name = "I/N", help_heading = "Amount")]
    shard: Option<Shard>,
    /// Time after which no further case begins, as 30m or 8h
    #[arg(long, value_name = "TIME", value_parser = duration, help_heading = "Amount")]
    time_budget: Option<Duration>,
    #[command(flatten)]
    device: DeviceArguments,
    /// Flags of vgs fit for all cases; those of a row come first
    #[arg(last = true, value_name = "FLAGS")]
    flags: Vec<OsString>,
}

const EXAMPLES: &str = "\
Examples:
  vgs batch cases.csv -o splats
  vgs batch cases.csv -o splats --format vgs --json -- --quality fine --roi-label 1-24
  vgs batch bids/ -o splats --shard 2/8 --time-budget 3h

cases.csv:
  name,volume,roi,roi-label
  patient 1,1/ct.nii.gz,1/bones.nii.gz,
  patient 2,2/ct.nrrd,2/organs.seg.nrrd,\"liver,aorta\"

A line a case says what became of it; with --json an object with its state (done, present, failed, stopped, left), the error
with its code, and the figures of vgs fit --json. The same command again goes on where one was stopped or broke off.
The exit code is 0 if all cases are there, 75 if some are left, and that of the failures otherwise (65 if they differ).";

/// Every `of`-th case from `first` on, counted from 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shard {
    first: usize,
    of: usize,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((i, n)) if (1..=n).contains(&i) => Ok(Shard { first: i - 1, of: n }),
            _ => Err("I/N with I from 1 to N, as 2/8".to_owned()),
        }
    }
}

/// What became of a case. The names are part of the interface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "lowercase")]
enum State {
    /// Fitted and written.
    Done,
    /// Done before, of the same inputs, with the same settings and version.
    Present,
    Failed,
    /// Broken off by a signal; nothing of it is kept.
    Stopped,
    /// Not begun, as the time was over or a signal came.
    Left,
}

/// A line of the batch. The names are part of the interface.
#[derive(Serialize)]
struct Line<'a> {
    case: &'a str,
    state: State,
    /// With reading and starting the device.
    total_seconds: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    error: Option<LineError>,
    #[serde(flatten, skip_serializing_if = "Option::is_none")]
    results: Option<FitResults>,
}

#[derive(Serialize)]
struct LineError {
    code: &'static str,
    exit: u8,
    file: Option<String>,
    msg: String,
    help: String,
}

/// A case that can begin.
struct Ready {
    arguments: FitArguments,
    made_of: String,
    /// `None` if the case is present.
    inputs: Option<Inputs>,
}

/// Runs the command.
pub fn run(arguments: &BatchArguments, console: &Console) -> std::result::Result<u8, Stop> {
    let start = Instant::now();
    let mut all = cases::read(&arguments.cases)?;
    if let Some(Shard { first, of }) = arguments.shard {
        all = all.into_iter().skip(first).step_by(of).collect();
    }
    outputs::make_folder(&arguments.output)?;
    let signals = Signals::install()?;
    signals.defer_first_signal();
    waiting::be_silent();
    let mut batch = Batch { arguments, console, signals: &signals, gpu: None, start, count: all.len() };
    let mut states = Vec::new();
    let mut failures = Vec::new();
    thread::scope(|scope| {
        let mut ahead = None;
        for (i, case) in all.iter().enumerate() {
            let begun = Instant::now();
            if batch.is_over() {
                states.push(State::Left);
                batch.tell(i, case, State::Left, begun, None, None)?;
                continue;
            }
            let reading = ahead.take().unwrap_or_else(|| scope.spawn(|| arguments.ready(case)));
            let ready = reading.join().unwrap_or_else(|_| Err(failure::fault()));
            let next = all.get(i + 1);
            ahead = next.map(|next| scope.spawn(|| arguments.ready(next)));
            let (state, error, results) = match ready.and_then(|ready| batch.fit(case, ready)) {
                Ok((state, results)) => (state, None, results),
                Err(error) => (State::Failed, Some(error), None),
            };
            if let Some(error) = &error {
                failures.push(error.kind);
            }
            states.push(state);
            batch.tell(i, case, state, begun, error, results)?;
        }
        Result::Ok(())
    })?;
    batch.conclude(&states)?;
    if let Some(code) = signals.exit_code() {
        return Ok(code);
    }
    match failures.as_slice() {
        [] if states.contains(&State::Left) => Ok(Kind::Temporary.exit_code()),
        [] => Ok(0),
        [first, rest @ ..] if rest.iter().all(|kind| kind == first) => Ok(first.exit_code()),
        _ => Ok(Kind::BadData.exit_code()),
    }
}

impl BatchArguments {
    /// Returns the file of a case's splats.
    fn splats(&self, case: &Case) -> PathBuf {
        self.output.join(format!("{}.{}", case.name, self.format))
    }

    /// Parses the flags of a case, sees whether it is done, and reads its inputs if it is not.
    fn ready(&self, case: &Case) -> Result<Ready> {
        let splats = self.splats(case);
        let line = [&case.usual[..], &self.flags, &case.arguments].concat();
        let mut own = vec![OsString::from("-o"), splats.clone().into()];
        let remains = begun_file(&splats).exists();
        if self.force || remains {
            own.push("--force".into());
        }
        let matches = cases::command().try_get_matches_from(line.iter().chain(&own));
        let parsed = matches.and_then(|matches| FitArguments::from_arg_matches(&matches));
        let arguments = parsed.map_err(|error| failure::of_arguments(&error))?;
        if arguments.dry_run || arguments.explain || arguments.checkpoint.resume {
            let message = "a batch has no --dry-run, --explain or --resume";
            return Err(Error::new(Kind::Usage, "VGS-CLI-182", message).help("try them with vgs fit"));
        }
        let made_of = made_of(&arguments, &line)?;
        let record = fs::read_to_string(outputs::beside(&splats, ".run.json")).unwrap_or_default();
        let record: serde_json::Value = serde_json::from_str(&record).unwrap_or_default();
        let is_done = !remains && splats.exists() && record["end"] == "finished";
        if is_done && !self.force {
            if record["made_of"] == made_of.as_str() {
                return Ok(Ready { arguments, made_of, inputs: None });
            }
            let message = "this case is done, but of other inputs, with other settings or by another version";
            return Err(Error::new(Kind::CannotCreate, "VGS-CLI-183", message)
                .file(&splats)
                .help("--force fits it again; another --output keeps both"));
        }
        let inputs = Some(Inputs::read(&arguments)?);
        Ok(Ready { arguments, made_of, inputs })
    }
}

/// Returns the file that is there while a case is fitted, so that what is left of one that broke off is known.
fn begun_file(splats: &Path) -> PathBuf {
    let mut name = OsString::from(".");
    name.push(splats.file_name().unwrap_or_default());
    name.push(".begun");
    splats.with_file_name(name)
}

/// Returns the hash of what splats are made of: the content of the inputs, all settings, the flags and the version.
fn made_of(arguments: &FitArguments, line: &[OsString]) -> Result<String> {
    let inputs = arguments.input_records()?;
    let settings = arguments.settings.resolve(arguments.is_limited())?;
    // Where the inputs are does not count, only what they hold.
    let paths: Vec<&Path> = arguments.inputs();
    let is_path = |text: &str| {
        let value = text.strip_prefix("--roi=").unwrap_or(text);
        paths.iter().any(|path| path.to_string_lossy() == value)
    };
    let flags: Vec<String> =
        line.iter().map(|flag| flag.to_string_lossy().into_owned()).filter(|flag| !is_path(flag)).collect();
    let hashes: Vec<(&str, &str)> =
        inputs.iter().map(|(name, input)| (*name, input.sha256.as_str())).collect();
    let all = serde_json::json!([
        hashes,
        settings.config,
        settings.profile,
        settings.quality,
        flags,
        NUMBER,
        COMMIT
    ]);
    Ok(Sha256::digest(all.to_string()).iter().map(|byte| format!("{byte:02x}")).collect())
}

struct Batch<'a> {
    arguments: &'a BatchArguments,
    console: &'a Console,
    signals: &'a Signals,
    /// The device, until it fails.
    gpu: Option<Gpu>,
    start: Instant,
    count: usize,
}

impl Batch<'_> {
    fn is_over(&self) -> bool {
        let spent = self.arguments.time_budget.is_some_and(|most| self.start.elapsed() >= most);
        spent || self.signals.exit_code().is_some()
    }

    /// Fits a case.
    fn fit(&mut self, case: &Case, ready: Ready) -> Result<(State, Option<FitResults>)> {
        let Ready { arguments, made_of, inputs: Some(inputs) } = ready else {
            return Ok((State::Present, None));
        };
        let gpu = match self.gpu.take() {
            Some(gpu) => gpu,
            None => self.arguments.device.boot()?,
        };
        let splats = self.arguments.splats(case);
        let begun = begun_file(&splats);
        let given =
            Given { gpu: Some(&gpu), inputs: Some(inputs), made_of: Some(&made_of), begun: Some(&begun) };
        let _named = console::about_case(&case.name);
        let done = failure::caught(|| {
            CheckedFit::new(&arguments)?.run(given, self.signals, &Console::silent(), Instant::now())
        });
        let result = match done {
            Ok(Some(done)) => match done.end {
                End::Finished => Ok((State::Done, Some(done.results))),
                // Whole cases only; what was done before stays, as such a fit writes beside it.
                End::Stopped => remove(&done.results, &splats).map(|()| (State::Stopped, None)),
                End::Failed(error) => remove(&done.results, &splats).and(Err(error)),
            },
            Ok(None) => Err(failure::fault()),
            // A signal before the first iteration.
            Err(_) if self.signals.exit_code().is_some() => Ok((State::Stopped, None)),
            Err(error) => Err(error),
        };
        // What is broken may be the device.
        if result.as_ref().err().is_none_or(|error| !is_of_device(error.kind)) {
            self.gpu = Some(gpu);
        }
        // That of a case that another process fits is not ours.
        if result.as_ref().err().is_none_or(|error| error.kind != Kind::Temporary) {
            let _ = fs::remove_file(begun);
        }
        result
    }

    /// Writes the line of a case.
    fn tell(
        &self,
        i: usize,
        case: &Case,
        state: State,
        begun: Instant,
        error: Option<Error>,
        results: Option<FitResults>,
    ) -> Result<()> {
        let took = begun.elapsed().as_secs_f64();
        if self.console.json {
            let error = error.map(|error| LineError {
                code: error.code,
                exit: error.kind.exit_code(),
                file: error.file.as_ref().map(|file| file.display().to_string()),
                help: error.help.to_string(),
                msg: error.message,
            });
            let line = Line { case: &case.name, state, total_seconds: took, error, results };
            return self.console.json_data(&line);
        }
        if self.console.quiet && error.is_none() {
            return Ok(());
        }
        let what = match (state, error, results) {
            (_, Some(error), _) => format!("failed [{}]: {error}\n  help: {}", error.code, error.help),
            (_, _, Some(found)) => {
                let psnr = found.quality.as_ref().map(|found| format!(", {:.1} dB,", found.psnr_db));
                format!("{} splats{} in {}", found.splats, psnr.unwrap_or_default(), seconds(took))
            }
            (State::Present, ..) => "is done".to_owned(),
            (State::Stopped, ..) => "stopped; nothing of it is kept".to_owned(),
            _ => "left".to_owned(),
        };
        self.console.data(&format!("{} of {}: {}: {what}\n", i + 1, self.count, case.name))
    }

    /// Says what became of all cases.
    fn conclude(&self, states: &[State]) -> Result<()> {
        let count = |state| states.iter().filter(|&&found| found == state).count();
        let words = [
            (State::Done, "fitted"),
            (State::Present, "done before"),
            (State::Failed, "failed"),
            (State::Stopped, "stopped"),
            (State::Left, "left"),
        ];
        let told: Vec<String> = words
            .iter()
            .map(|&(state, word)| (count(state), word))
            .filter(|(count, _)| *count > 0)
            .map(|(count, word)| format!("{count} {word}"))
            .collect();
        self.console.say(&format!("{} in {}", told.join(", "), seconds(self.start.elapsed().as_secs_f64())));
        Ok(())
    }
}

/// Returns true if an error may be one of the device, so that the next case gets a new one.
fn is_of_device(kind: Kind) -> bool {
    matches!(kind, Kind::Temporary | Kind::Unavailable | Kind::Internal)
}

/// Removes what a case has written that did not finish.
fn remove(results: &FitResults, splats: &Path) -> Result<()> {
    let state = interrupted::state_path(splats);
    for path in results.outputs.iter().map(Path::new).chain([state.as_path()]) {
        match fs::remove_file(path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => {
                return Err(Error::io(path, "removing what did not finish", &e));
            }
            _ => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_counted_from_one() {
        assert_eq!("2/8".parse(), Ok(Shard { first: 1, of: 8 }));
        assert_eq!("1/1".parse(), Ok(Shard { first: 0, of: 1 }));
        for wrong in ["", "3", "0/2", "3/2", "1/0", "a/b", "-1/2", "1/2/3"] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
    }
}
