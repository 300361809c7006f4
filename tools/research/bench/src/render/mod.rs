//! Measures rendering (`bench render`): pictures are compared with their references, then timed.
//!
//! A configuration (`config`) becomes units (`plan`), one for each subject of a section; each is measured
//! (`accuracy`, `speed`) in scenes of volumes and fitted splats (`scenes`) and kept as a file (`record`), so
//! that nothing is measured twice. Reports are made from the files and written after every unit (`report`,
//! `table5`, `goals`, `export`, `plot`).

pub mod accuracy;
pub mod config;
mod export;
mod figures;
mod goals;
mod plan;
mod plot;
pub mod record;
mod report;
mod results;
pub mod scenes;
mod speed;
mod table5;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, ValueEnum};
use engine::gpu::{Gpu, GpuOptions};
use engine::{Error, Kind, Result};

use self::config::{Config, Section};
use self::figures::{db, ms};
use self::plan::{Plan, Unit};
use self::record::{Record, Records};
use self::results::{Device, Results};
use self::scenes::Library;
use crate::cost::median;
use crate::progress::{Series, all_done};
use crate::store::Store;

/// Pictures of all modes against what they should be, and what frames cost
#[derive(Args)]
#[command(after_help = "\
Each subject of a section that is finished is a file in OUT/runs, named by a hash of all settings and the device: what is \
there is not measured again, and one that is stopped (Ctrl-C) is the only one lost. Fitted splats are kept in OUT/splats. \
OUT/render.md, render.csv, render.json, accuracy-cost.svg and slab-distance.svg are written anew after each \
subject. A changed program does not change the hash: measure again with --force, or choose another folder.

Examples:
  bench render --data DIR --quick                    the first subject of each section, small
  bench render --data DIR --out pictures             all of it: hours on a CPU
  bench render --data DIR --only end-to-end,speed
  bench render --data DIR --config mine.toml         other cases and settings; tools/research/bench/src/render/default.toml explains them")]
pub struct RenderArguments {
    /// Folder with the cases: CASE/ct.nii.gz and its masks
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Folder for results and tables
    #[arg(long, value_name = "DIR", default_value = "render-tables")]
    out: PathBuf,
    /// Cases, transfer functions, modes and sections in place of the usual ones (TOML)
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Fewer and smaller pictures; the tables say so
    #[arg(long)]
    quick: bool,
    /// What to measure; all of it when absent
    #[arg(long, value_enum, value_delimiter = ',', value_name = "SECTION,...")]
    only: Vec<Section>,
    /// Measures again what is there; fitted splats stay
    #[arg(long)]
    force: bool,
}

impl RenderArguments {
    fn sections(&self) -> Vec<Section> {
        let mut all =
            if self.only.is_empty() { Section::value_variants().to_vec() } else { self.only.clone() };
        all.sort();
        all.dedup();
        all
    }

    /// Returns a command line that repeats the measurement, without the paths of this machine.
    fn command(&self) -> String {
        let mut text = "bench render --data DIR".to_owned();
        if self.config.is_some() {
            text += " --config FILE";
        }
        if self.quick {
            text += " --quick";
        }
        if !self.only.is_empty() {
            let names: Vec<_> = self.sections().into_iter().map(Section::name).collect();
            text += &format!(" --only {}", names.join(","));
        }
        text
    }
}

/// Measures what is missing and writes the tables.
pub fn run(options: &GpuOptions, a: &RenderArguments) -> Result<()> {
    let config = Config::read(a.config.as_deref())?;
    let config = if a.quick { config.quick() } else { config };
    let sections = a.sections();
    let gpu = Gpu::new(options)?;
    let device = Device::new(gpu.description());
    let plan = Plan::new(&config, &sections, &device.text)?;
    plan.left_out.iter().for_each(|line| eprintln!("left out: {line}"));
    let store = Store::open(&a.out)?;
    let mut records = Records::new();
    let mut missing = Vec::new();
    for unit in &plan.units {
        match if a.force { None } else { store.load::<Record>(&unit.key())? } {
            Some(record) => drop(records.insert(record.key.clone(), record)),
            None => missing.push(unit),
        }
    }
    eprintln!(
        "{} subjects: {} are there, {} to do",
        plan.units.len(),
        plan.units.len() - missing.len(),
        missing.len()
    );
    let mut runner = Runner {
        options,
        gpu: &gpu,
        library: Library::new(&a.data, &store.file("splats"), options)?,
        config: &config,
        plan: &plan,
        sections: &sections,
        device: &device,
        store: &store,
        command: a.command(),
        quick: a.quick,
        records,
        skipped: BTreeMap::new(),
    };
    let failed = runner.all(&missing)?;
    println!("{}", runner.report().markdown());
    eprintln!("written: {}", store.file("render.md").display());
    all_done(&failed, missing.len(), "subjects")
}

/// Rough time of a frame of 1024² pixels on two cores, seconds: of mode `exact`, and of any other mode. The
/// actual times of the first subjects correct it.
const FRAME_SECONDS: [f64; 2] = [6.0, 1.5];

/// Measures units, one after the other.
struct Runner<'a> {
    options: &'a GpuOptions,
    /// Device for pictures that are compared; each rendering that is timed creates its own.
    gpu: &'a Gpu,
    library: Library<'a>,
    config: &'a Config,
    plan: &'a Plan,
    sections: &'a [Section],
    device: &'a Device,
    store: &'a Store,
    command: String,
    quick: bool,
    records: Records,
    /// Reasons why units have no record, by key.
    skipped: BTreeMap<String, String>,
}

impl Runner<'_> {
    /// Measures all units and keeps the records. A unit that fails is reported on stderr and does not end the
    /// others. Returns the errors.
    fn all(&mut self, missing: &[&Unit]) -> Result<Vec<Error>> {
        self.write()?;
        let frames: Vec<f64> = missing.iter().map(|unit| frame_seconds(unit)).collect();
        let mut series = Series::new(frames.iter().sum());
        let mut failed = Vec::new();
        let mut budget = self.budget();
        for (i, (unit, &estimated)) in missing.iter().zip(&frames).enumerate() {
            eprintln!("[{}/{}] {}; {}", i + 1, missing.len(), unit.title(), series.tell());
            let begin = Instant::now();
            match self.within_budget(unit, budget).and_then(|why| match why {
                None => self.measure(unit).map(Some),
                Some(why) => {
                    eprintln!("    left out: {why}");
                    self.skipped.insert(unit.key(), why);
                    Ok(None)
                }
            }) {
                Ok(record) => {
                    if let Some(record) = record {
                        record.left_out.iter().for_each(|line| eprintln!("    left out: {line}"));
                        self.store.save(&record)?;
                        self.records.insert(record.key.clone(), record);
                    }
                }
                Err(e) => {
                    eprintln!("    failed: {e}");
                    self.skipped.insert(unit.key(), format!("failed: {e}"));
                    failed.push(e);
                }
            }
            if unit.section == Section::Table5 {
                budget = budget.map(|left| left - begin.elapsed().as_secs_f64());
            }
            series.finished(estimated, begin.elapsed());
            self.write()?;
        }
        Ok(failed)
    }

    /// Returns the seconds for the paper's Table 5; `None` if they are not limited.
    fn budget(&self) -> Option<f64> {
        let part = self.config.parts.get(&Section::Table5).filter(|_| self.device.is_cpu)?;
        part.budget_minutes.map(|minutes| 60.0 * minutes)
    }

    /// Returns the reason why the rest of the budget (seconds) is too short for a unit; `None` if it is not.
    fn within_budget(&mut self, unit: &Unit, budget: Option<f64>) -> Result<Option<String>> {
        let Some(left) = budget.filter(|_| unit.section == Section::Table5) else { return Ok(None) };
        let needed = self.library.fit_seconds(unit)? + frame_seconds(unit);
        let minutes = |seconds: f64| ms(Some(seconds.max(0.0) / 60.0));
        let text = format!(
            "needs about {} min of the {} min that are left of the budget",
            minutes(needed),
            minutes(left)
        );
        Ok((needed > left).then_some(text))
    }

    fn measure(&mut self, unit: &Unit) -> Result<Record> {
        let (set, place) = self.library.splats(unit)?;
        if set.splats.is_empty() {
            return Err(Error::new(Kind::NothingToDo, "VGS-BEN-027", format!("{}: no splats", unit.title())));
        }
        if unit.section.is_timed() {
            return speed::measure(unit, place, &set, self.options, &mut |row| {
                let wall = median(&row.each(|cost| cost.wall_ms));
                eprintln!("    {}, {}: {} ms", row.transfer, row.rendering, ms(wall));
            });
        }
        accuracy::measure(unit, place, &set, self.gpu, &mut |row| {
            eprintln!("    {}, {}: {} dB", row.transfer, row.rendering, db(row.psnr()));
        })
    }

    fn report(&self) -> Results<'_> {
        Results {
            config: self.config,
            plan: self.plan,
            sections: self.sections,
            records: &self.records,
            skipped: &self.skipped,
            device: self.device,
            quick: self.quick,
            command: &self.command,
        }
    }

    fn write(&self) -> Result<()> {
        let report = self.report();
        self.store.report("render.md", &report.markdown())?;
        self.store.report("render.csv", &export::csv(&report))?;
        self.store.report("render.json", &export::json(&report)?)?;
        if self.sections.contains(&Section::RendererError) {
            self.store.report("accuracy-cost.svg", &plot::cost(&report)?)?;
            self.store.report("slab-distance.svg", &plot::slab_distance(&report)?)?;
        }
        Ok(())
    }
}

/// Estimates the time of the frames of a unit, seconds.
fn frame_seconds(unit: &Unit) -> f64 {
    let part = &unit.part;
    let of = |mode: &str| if mode == "exact" { FRAME_SECONDS[0] } else { FRAME_SECONDS[1] };
    let pictures: f64 = unit.renderings.iter().chain(&unit.reference).map(|r| of(&r.mode)).sum();
    let views = unit.views().len();
    let frames = if unit.section.is_timed() { part.frames + part.warm_up * views } else { views };
    let others = part.downsampled.len() + 4 * unit.stereo.len() + usize::from(part.whole);
    let all = pictures + others as f64 * FRAME_SECONDS[1];
    unit.transfers.len() as f64 * frames as f64 * all * (f64::from(part.size) / 1024.0).powi(2)
}
