//! Command line of the fuzzer (`fuzz`).
#![forbid(unsafe_code)]

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, Instant};

use clap::Parser;
use engine::{Error, Kind, Result, output};
use fuzz::log::{HEAD, Log, Series};
use fuzz::targets::{TARGETS, Target};
use fuzz::trial::Trial;

#[derive(Parser)]
#[command(
    name = "fuzz",
    about = "Reads mutated files and tells what a reader must not do: panic, or take more memory or time than a bound",
    after_help = "\
Examples:
  fuzz                                  a minute of every reader
  fuzz --target nifti,ply --seconds 600
  fuzz --target dicom --executions 100000 --seed 7 --out faults
  fuzz --log fuzz.log --executions 10000000 --seconds inf     all in all, over as many runs as it takes
  fuzz --log fuzz.log --executions 0    what the log adds up to
  fuzz --list                           the readers
  fuzz --replay faults/dicom-7-1.dcm --target dicom"
)]
struct Arguments {
    /// Readers; all of them when absent.
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    target: Vec<String>,
    /// Seconds for each reader.
    #[arg(long, default_value_t = 60.0)]
    seconds: f64,
    /// Files for each reader, at most.
    #[arg(long, default_value_t = u64::MAX)]
    executions: u64,
    /// The same seed makes the same files.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Adds what is read to this file, in series of 100000 files, each from the next seed that it has not. `--executions`
    /// then counts what is in the file as well.
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Folder for the files that led to faults.
    #[arg(long, value_name = "DIR", default_value = "fuzz-faults")]
    out: PathBuf,
    /// Reads this file instead of mutated ones.
    #[arg(long, value_name = "FILE")]
    replay: Option<PathBuf>,
    /// Lists the readers.
    #[arg(long)]
    list: bool,
}

fn main() -> ExitCode {
    match run(&Arguments::parse()) {
        Ok(0) => ExitCode::SUCCESS,
        Ok(faults) => {
            eprintln!("{faults} faults");
            ExitCode::FAILURE
        }
        Err(e) => {
            eprintln!("error[{}]: {e}", e.code);
            eprintln!("  help: {}", e.help);
            ExitCode::from(e.kind.exit_code())
        }
    }
}

/// Files of a series in a log.
const SERIES: u64 = 100_000;

/// Runs what was asked for and returns the number of faults.
fn run(arguments: &Arguments) -> Result<usize> {
    if arguments.list {
        TARGETS.iter().for_each(|target| println!("{}", target.name));
        return Ok(0);
    }
    let targets = chosen(&arguments.target)?;
    if let Some(file) = &arguments.replay {
        let bytes = std::fs::read(file).map_err(|e| Error::io(file, "reading", &e))?;
        let mut faults = 0;
        for target in targets {
            let read = Trial::new(target)?.read(&bytes);
            eprintln!("{}: {read:?}", target.name);
            faults += usize::from(read.is_err());
        }
        return Ok(faults);
    }
    let mut faults = 0;
    println!("{HEAD}");
    for target in targets {
        let total = match &arguments.log {
            Some(path) => logged(arguments, target, Log::open(path)?)?,
            None => {
                series(arguments, target, arguments.seed, arguments.executions, seconds(arguments.seconds))?
            }
        };
        println!("{}", total.row());
        faults += total.faults as usize;
    }
    Ok(faults)
}

/// Returns so many seconds; without end if there are too many to count.
fn seconds(seconds: f64) -> Duration {
    Duration::try_from_secs_f64(seconds.max(0.0)).unwrap_or(Duration::MAX)
}

/// Reads series of files until the log has enough or the time is over, and returns the sum of the log.
fn logged(arguments: &Arguments, target: &Target, mut log: Log) -> Result<Series> {
    let begin = Instant::now();
    loop {
        let total = log.total(target.name);
        let left = arguments.executions.saturating_sub(total.files);
        let time = seconds(arguments.seconds).saturating_sub(begin.elapsed());
        if left == 0 || time.is_zero() {
            return Ok(total);
        }
        let seed = arguments.seed.max(total.seed + 1);
        log.add(series(arguments, target, seed, left.min(SERIES), time)?)?;
    }
}

/// Reads the files of a seed, and keeps those that led to faults.
fn series(arguments: &Arguments, target: &Target, seed: u64, most: u64, longest: Duration) -> Result<Series> {
    let outcome = Trial::new(target)?.series(seed, most, longest, |outcome, time| {
        eprint!(
            "\r{}: {} files, {} accepted, {} faults, {:.0} s ",
            target.name,
            outcome.executions,
            outcome.accepted,
            outcome.faults.len(),
            time.as_secs_f64()
        );
    });
    eprint!("\r");
    for (number, (fault, bytes)) in outcome.faults.iter().enumerate() {
        let name = format!("{}-{seed}-{}.{}", target.name, number + 1, target.extension);
        let file = arguments.out.join(name);
        std::fs::create_dir_all(&arguments.out)
            .map_err(|e| Error::io(&arguments.out, "making a folder", &e))?;
        output::write_atomic(&file, true, |w| w.write_all(bytes))?;
        eprintln!("{}: {fault:?}", file.display());
    }
    Ok(Series::of(target.name, seed, &outcome))
}

/// Returns the readers that were asked for.
fn chosen(names: &[String]) -> Result<Vec<&'static Target>> {
    let known: Vec<_> = TARGETS.iter().map(|target| target.name).collect();
    if let Some(unknown) = names.iter().find(|name| !known.contains(&name.as_str())) {
        return Err(Error::new(Kind::Usage, "VGS-FUZ-002", format!("there is no reader {unknown}"))
            .help(format!("the readers are {}", known.join(", "))));
    }
    let is_chosen = |target: &&Target| names.is_empty() || names.iter().any(|name| name == target.name);
    Ok(TARGETS.iter().filter(is_chosen).collect())
}
