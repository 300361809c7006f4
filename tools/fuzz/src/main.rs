//! Command line of the fuzzer (`fuzz`).
#![forbid(unsafe_code)]

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;
use engine::{Error, Kind, Result, output};
use fuzz::targets::{TARGETS, Target};
use fuzz::trial::{Outcome, Trial};

#[derive(Parser)]
#[command(
    name = "fuzz",
    about = "Reads mutated files and tells what a reader must not do: panic, or take more memory or time than a bound",
    after_help = "\
Examples:
  fuzz                                  a minute of every reader
  fuzz --target nifti,ply --seconds 600
  fuzz --target dicom --executions 100000 --seed 7 --out faults
  fuzz --list                           the readers
  fuzz --replay faults/dicom-1.dcm --target dicom"
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

/// Runs what was asked for and returns the number of faults.
fn run(arguments: &Arguments) -> Result<usize> {
    if arguments.list {
        TARGETS.iter().for_each(|target| println!("{}", target.name));
        return Ok(0);
    }
    let mut faults = 0;
    println!("| reader | files | accepted | a second | faults |\n|---|---|---|---|---|");
    for target in chosen(&arguments.target)? {
        let trial = Trial::new(target)?;
        if let Some(file) = &arguments.replay {
            let bytes = std::fs::read(file).map_err(|e| Error::io(file, "reading", &e))?;
            let read = trial.read(&bytes);
            eprintln!("{}: {read:?}", target.name);
            faults += usize::from(read.is_err());
            continue;
        }
        let share = |outcome: &Outcome| 100.0 * outcome.accepted as f64 / outcome.executions.max(1) as f64;
        let longest = Duration::from_secs_f64(arguments.seconds.max(0.0));
        let begin = std::time::Instant::now();
        let outcome = trial.series(arguments.seed, arguments.executions, longest, |outcome, time| {
            eprint!(
                "\r{}: {} files, {:.0} % accepted, {} faults, {:.0} s ",
                target.name,
                outcome.executions,
                share(outcome),
                outcome.faults.len(),
                time.as_secs_f64()
            );
        });
        let rate = outcome.executions as f64 / begin.elapsed().as_secs_f64();
        eprint!("\r");
        println!(
            "| {} | {} | {:.0} % | {rate:.0} | {} |",
            target.name,
            outcome.executions,
            share(&outcome),
            outcome.faults.len()
        );
        for (number, (fault, bytes)) in outcome.faults.iter().enumerate() {
            let file = arguments.out.join(format!("{}-{}.{}", target.name, number + 1, target.extension));
            std::fs::create_dir_all(&arguments.out)
                .map_err(|e| Error::io(&arguments.out, "making a folder", &e))?;
            output::write_atomic(&file, true, |w| w.write_all(bytes))?;
            eprintln!("{}: {fault:?}", file.display());
        }
        faults += outcome.faults.len();
    }
    Ok(faults)
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
