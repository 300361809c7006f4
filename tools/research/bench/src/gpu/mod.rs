//! Measures everything that a GPU can tell, in one command (`bench gpu`): programs of this project, one after the
//! other, into one folder. It needs a driver and what a build of this project made, no network. A step that is finished
//! is a file in OUT/runs and is not run again.

mod steps;

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use clap::Args;
use engine::gpu::{Gpu, GpuOptions};
use engine::{Error, Kind, Result};
use serde::{Deserialize, Serialize};

use self::steps::{Step, steps};
use crate::report::Table;
use crate::store::{Keep, Store, hash};

/// Everything that a GPU can tell, in one folder
#[derive(Args)]
#[command(after_help = "\
Steps: devices, tests, passes, fits, pictures, headset, model, full. A step that is finished is not run again; one that is \
stopped (Ctrl-C, --minutes) goes on with what it has kept. OUT/gpu.md has all tables, OUT/logs what the programs said. \
Without --data synthetic CTs are fitted and shown.

Examples:
  bench gpu                                    all steps, ten minutes of them
  bench gpu --data DIR --minutes 60            scans in place of synthetic CTs
  bench --device nvidia gpu --only passes,fits --out h200
  bench gpu --quick --minutes 30               small scenes: proves on a CPU driver that everything works")]
pub struct GpuArguments {
    /// Folder for results and tables
    #[arg(long, value_name = "DIR", default_value = "gpu-results")]
    out: PathBuf,
    /// Folder with scans and masks, laid out as for `bench render`
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Ends after so many minutes; the same command then goes on
    #[arg(long, default_value_t = 10.0)]
    minutes: f64,
    /// Runs these steps only
    #[arg(long, value_delimiter = ',', value_name = "STEP,...")]
    only: Vec<String>,
    /// Small scenes
    #[arg(long)]
    quick: bool,
    /// Runs finished steps again
    #[arg(long)]
    force: bool,
}

/// A finished step.
#[derive(Serialize, Deserialize)]
struct Finished {
    step: String,
    commands: Vec<String>,
    device: String,
    seconds: f64,
    /// Why the step was left out, if it was.
    left_out: Option<String>,
    /// What the commands wrote on stdout.
    said: Vec<String>,
}

impl Keep for Finished {
    fn key(&self) -> String {
        key(&self.step, &self.commands, &self.device)
    }
}

fn key(step: &str, commands: &[String], device: &str) -> String {
    format!("{step}-{}", hash(&(commands, device)))
}

/// How a step ended that is not finished.
enum Unfinished {
    Failed(Error),
    /// The time is over.
    Late,
}

/// Runs all steps that are left and writes the tables.
///
/// # Errors
/// Returns [`Kind::Usage`] for a step that there is not, [`Kind::Temporary`] if steps failed or are left.
pub fn run(options: &GpuOptions, arguments: &GpuArguments) -> Result<()> {
    let all = steps(arguments.data.is_some(), arguments.quick);
    let chosen = chosen(&all, &arguments.only)?;
    let description = Gpu::new(options)?.description().clone();
    let device = format!("{} ({}, {})", description.name, description.kind, description.driver);
    let store = Store::open(&arguments.out)?;
    store.report("pictures.toml", &pictures(arguments.quick))?;
    for folder in ["logs", "splats", "cases"] {
        let path = store.file(folder);
        std::fs::create_dir_all(&path).map_err(|e| Error::io(&path, "making a folder", &e))?;
    }
    let runner = Runner {
        out: arguments.out.clone(),
        data: arguments.data.clone(),
        device: options.device.clone(),
        deadline: Instant::now() + Duration::from_secs_f64(arguments.minutes.max(0.0) * 60.0),
    };
    println!("{device}, into {}", arguments.out.display());
    let (mut finished, mut failed, mut late) = (BTreeMap::new(), Vec::new(), Vec::new());
    for (i, step) in chosen.iter().enumerate() {
        let kept = store.load::<Finished>(&key(step.name, &step.commands, &device))?;
        let count = format!("[{}/{}] {}", i + 1, chosen.len(), step.name);
        if let Some(kept) = kept.filter(|_| !arguments.force) {
            eprintln!("{count}: there already");
            finished.insert(step.name, kept);
            continue;
        }
        eprintln!("{count}: {}", step.what);
        match runner.step(step, &device) {
            Ok(done) => {
                let said =
                    done.left_out.as_ref().map_or_else(String::new, |why| format!("; left out: {why}"));
                eprintln!("    {:.1} s{said}", done.seconds);
                store.save(&done)?;
                finished.insert(step.name, done);
            }
            Err(Unfinished::Failed(e)) => {
                eprintln!("    failed: {e}");
                failed.push(step.name);
            }
            Err(Unfinished::Late) => {
                eprintln!("    the time is over");
                late.push(step.name);
            }
        }
        store.report("gpu.md", &report(&device, &chosen, &finished, &failed, &arguments.out))?;
    }
    let text = report(&device, &chosen, &finished, &failed, &arguments.out);
    store.report("gpu.md", &text)?;
    println!("written: {}", store.file("gpu.md").display());
    ending(&failed, &late, &arguments.out)
}

/// Returns the configuration of the pictures.
fn pictures(quick: bool) -> String {
    let usual = include_str!("pictures.toml");
    match quick {
        false => usual.to_owned(),
        true => usual.replace("phantom = 128", "phantom = 24").replace("phantom = 256", "phantom = 32"),
    }
}

/// Returns the steps that were asked for, all where none were.
fn chosen<'a>(all: &'a [Step], only: &[String]) -> Result<Vec<&'a Step>> {
    if let Some(unknown) = only.iter().find(|name| all.iter().all(|step| step.name != **name)) {
        let names: Vec<_> = all.iter().map(|step| step.name).collect();
        return Err(Error::new(Kind::Usage, "VGS-BEN-050", format!("there is no step {unknown}"))
            .help(format!("the steps are {}", names.join(", "))));
    }
    Ok(all.iter().filter(|step| only.is_empty() || only.iter().any(|name| name == step.name)).collect())
}

/// Returns the error that tells what is missing, if anything is.
fn ending(failed: &[&str], late: &[&str], out: &Path) -> Result<()> {
    let error = |message: String, help: &str| {
        Err(Error::new(Kind::Temporary, "VGS-BEN-051", message).file(out).help(help))
    };
    match (failed, late) {
        ([], []) => Ok(()),
        ([], late) => error(
            format!("the time was over before {}", late.join(", ")),
            "the same command goes on where this one ended; --minutes gives it longer",
        ),
        (failed, _) => error(
            format!("{} failed", failed.join(", ")),
            "the folder logs has what the programs said; the same command tries again",
        ),
    }
}

/// Runs commands for a folder of results.
struct Runner {
    out: PathBuf,
    data: Option<PathBuf>,
    device: Option<String>,
    deadline: Instant,
}

impl Runner {
    /// Runs the commands of a step.
    fn step(&self, step: &Step, device: &str) -> std::result::Result<Finished, Unfinished> {
        let begin = Instant::now();
        let mut done = Finished {
            step: step.name.to_owned(),
            commands: step.commands.clone(),
            device: device.to_owned(),
            seconds: 0.0,
            left_out: None,
            said: Vec::new(),
        };
        for (i, command) in step.commands.iter().enumerate() {
            let words: Vec<String> = command.split_whitespace().flat_map(|word| self.words(word)).collect();
            if words[0] == "cargo" && !Path::new("Cargo.toml").exists() {
                done.left_out = Some("this is not the folder of the sources".into());
                break;
            }
            let name =
                if step.commands.len() > 1 { format!("{}-{}", step.name, i + 1) } else { step.name.into() };
            done.said.push(self.command(&name, &words)?);
        }
        done.seconds = begin.elapsed().as_secs_f64();
        Ok(done)
    }

    /// Returns what a word of a command stands for.
    fn words(&self, word: &str) -> Vec<String> {
        if word == "{device}" {
            return self.device.iter().flat_map(|name| ["--device".to_owned(), name.clone()]).collect();
        }
        let data = self.data.as_deref().unwrap_or(Path::new(""));
        vec![word.replace("{out}", &self.out.to_string_lossy()).replace("{data}", &data.to_string_lossy())]
    }

    /// Runs a command until it ends or the time is over; what it writes goes into the logs. Returns its stdout.
    fn command(&self, name: &str, words: &[String]) -> std::result::Result<String, Unfinished> {
        let logs = self.out.join("logs");
        let said = logs.join(format!("{name}.out"));
        let create = |path: &Path| File::create(path).map_err(|e| Error::io(path, "writing", &e));
        let spawned = || -> Result<Child> {
            let program = program(&words[0]);
            let mut command = match std::env::var_os("VGS_RUNNER") {
                Some(runner) => {
                    let mut command = Command::new(runner);
                    command.arg(&program);
                    command
                }
                None => Command::new(&program),
            };
            let (out, err) = (create(&said)?, create(&logs.join(format!("{name}.err")))?);
            command.args(&words[1..]).stdin(Stdio::null()).stdout(out).stderr(err);
            command.spawn().map_err(|e| Error::io(&program, "starting", &e))
        };
        let mut child = spawned().map_err(Unfinished::Failed)?;
        let status = self.wait(&mut child)?;
        if !status.success() {
            let message = format!("a program ended with {status}: {}", words[0]);
            let failed = Error::new(Kind::Temporary, "VGS-BEN-052", message);
            return Err(Unfinished::Failed(failed.file(logs.join(format!("{name}.err")))));
        }
        std::fs::read_to_string(&said).map_err(|e| Unfinished::Failed(Error::io(&said, "reading", &e)))
    }

    /// Waits for a program, and ends it when the time is over.
    fn wait(&self, child: &mut Child) -> std::result::Result<ExitStatus, Unfinished> {
        loop {
            match child.try_wait() {
                Ok(Some(status)) => return Ok(status),
                Err(e) => {
                    let message = format!("waiting for a program: {e}");
                    return Err(Unfinished::Failed(Error::new(Kind::Internal, "VGS-BEN-053", message)));
                }
                Ok(None) if Instant::now() >= self.deadline => {
                    let _ = child.kill();
                    let _ = child.wait();
                    return Err(Unfinished::Late);
                }
                Ok(None) => std::thread::sleep(Duration::from_millis(50)),
            }
        }
    }
}

/// Returns the path of a program of this project, which lies beside this one; others are looked up by the system.
fn program(name: &str) -> PathBuf {
    // A runner's loader is the executable, but the first argument is this program.
    let this = match std::env::var_os("VGS_RUNNER") {
        Some(_) => std::env::args_os().next().map(PathBuf::from),
        None => std::env::current_exe().ok(),
    };
    let file = format!("{name}{}", std::env::consts::EXE_SUFFIX);
    let beside = this.as_deref().and_then(Path::parent).map(|folder| folder.join(&file));
    beside.filter(|path| path.exists()).unwrap_or_else(|| name.into())
}

/// Returns all tables as Markdown.
fn report(
    device: &str,
    chosen: &[&Step],
    finished: &BTreeMap<&str, Finished>,
    failed: &[&str],
    out: &Path,
) -> String {
    let state = |step: &Step| match finished.get(step.name) {
        Some(Finished { left_out: Some(why), .. }) => format!("left out: {why}"),
        Some(done) => format!("{:.1} s", done.seconds),
        None if failed.contains(&step.name) => format!("failed; see logs/{}.err", step.name),
        None => "not yet run".into(),
    };
    let steps = Table {
        title: format!("Steps on {device}"),
        columns: vec!["step", "what it tells", "state"],
        rows: chosen.iter().map(|step| vec![step.name.into(), step.what.into(), state(step)]).collect(),
    };
    let mut text = steps.markdown();
    for step in chosen {
        let Some(done) = finished.get(step.name) else { continue };
        if let Some(table) = fits(done) {
            text += &format!("\n## {}\n\n{}", step.what, table.markdown());
        }
        for file in &step.tables {
            if let Ok(table) = std::fs::read_to_string(out.join(file)) {
                text += &format!("\n## {}\n\n{table}", step.what);
            }
        }
    }
    text
}

/// What `vgs fit --json` tells of a fit, as far as the table shows it.
#[derive(Deserialize)]
struct Fit {
    outputs: Vec<String>,
    roi_voxels: u64,
    splats: u64,
    psnr_db: f64,
    fit_seconds: f64,
    seconds: f64,
    device_peak_bytes: u64,
}

/// Returns the fits of a step as a table; nothing if there were none.
fn fits(done: &Finished) -> Option<Table> {
    let row = |said: &String| {
        let fit: Fit = serde_json::from_str(said).ok()?;
        let file = Path::new(fit.outputs.first()?).file_stem()?.to_string_lossy().into_owned();
        Some(vec![
            file,
            fit.roi_voxels.to_string(),
            fit.splats.to_string(),
            format!("{:.2}", fit.psnr_db),
            format!("{:.2}", fit.fit_seconds),
            format!("{:.2}", fit.seconds),
            format!("{:.1}", fit.device_peak_bytes as f64 * 1e-6),
        ])
    };
    let rows: Vec<_> = done.said.iter().filter_map(row).collect();
    (!rows.is_empty()).then(|| Table {
        title: done.device.clone(),
        columns: vec![
            "fit",
            "voxels",
            "splats",
            "PSNR / dB",
            "iterations / s",
            "all / s",
            "device memory / MB",
        ],
        rows,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_of_all_kinds_have_commands_of_this_project() {
        for (has_data, quick) in [(false, false), (false, true), (true, false), (true, true)] {
            for step in steps(has_data, quick) {
                assert!(!step.commands.is_empty(), "{}", step.name);
                for command in &step.commands {
                    let program = command.split_whitespace().next();
                    assert!(["vgs", "bench", "studies", "cargo"].map(Some).contains(&program), "{command}");
                    assert!(has_data || !command.contains("{data}"), "{command}");
                }
            }
        }
    }

    #[test]
    fn unknown_steps_are_refused() {
        let all = steps(false, true);
        let refused = chosen(&all, &["fit".to_owned()]).err().expect("an error");
        assert_eq!((refused.kind, refused.code), (Kind::Usage, "VGS-BEN-050"));
        assert!(refused.help.contains("fits"), "{}", refused.help);
        assert_eq!(chosen(&all, &[]).expect("all").len(), all.len());
    }

    #[test]
    fn fits_become_rows() {
        let said = r#"{"outputs":["x/skull.ply"],"roi_voxels":5,"splats":2,"psnr_db":40.126,"fit_seconds":1.5,
            "seconds":2.0,"device_peak_bytes":1500000,"more":1}"#;
        let done = Finished {
            step: "fits".into(),
            commands: Vec::new(),
            device: "a device".into(),
            seconds: 1.0,
            left_out: None,
            said: vec!["no JSON".into(), said.into()],
        };
        let table = fits(&done).expect("a table");
        assert_eq!(table.rows, [["skull", "5", "2", "40.13", "1.50", "2.00", "1.5"]]);
    }
}
