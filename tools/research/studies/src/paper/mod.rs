//! Reproduces the paper's tables with ours beside them (`studies paper`).
//!
//! A *run* is a fit of one row with one profile (`job`, `plan`), measured on the way (`runs`) and kept as a
//! file ([`bench::store`]), so that nothing is computed twice. Reports are made from the files and written
//! after every run (`tables`, `studies`, `plot`). `published` has the paper's figures, `prototype` those of a
//! CPU prototype, `peer` those of the authors' own code, and `baselines` compares downsampled volumes, which
//! need no fit.

mod baselines;
mod count;
pub mod estimate;
pub mod job;
pub mod library;
pub mod peer;
mod plan;
mod plot;
mod prototype;
mod published;
mod results;
pub mod runs;
mod section;
mod studies;
mod tables;

use std::path::PathBuf;

use clap::{Args, ValueEnum as _};
use engine::gpu::{Gpu, GpuOptions};
use engine::{Error, Result};

use self::estimate::estimate;
use self::job::Job;
use self::library::Library;
use self::plan::{Effort, Plan};
use self::results::Results;
use self::section::Section;
use bench::progress::{all_done, carry_out};
use bench::report::Table;
use bench::store::Store;

#[derive(Args)]
#[command(after_help = "\
A run is a fit of one row with one profile, measured with all splats on the grid every 50 iterations, mini-batches every 250. \
Each finished run is a file in OUT/runs, named by case, mask, splats, profile and a hash of all settings and the device: \
what is there is not run again, and a run that is stopped (Ctrl-C) is the only one lost. The tables as CSV, \
OUT/paper.csv (every measurement) and OUT/psnr-time.svg are written anew after each run. A changed program does not change the hash: \
repeat with --force, or choose another folder.

Examples:
  studies paper --data DIR --quick              a quarter of an hour on two cores
  studies paper --data DIR --out tables         all of it: hours on a CPU
  studies paper --data DIR --only table2,table6
  studies paper --data DIR --only table3        the downsampled volumes alone, checked against DIR/README.md")]
pub struct PaperArguments {
    /// Folder with the cases: CASE/ct.nii.gz and its masks
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Folder for results and tables
    #[arg(long, value_name = "DIR", default_value = "paper-tables")]
    out: PathBuf,
    /// Fewer rows and iterations; the tables say so
    #[arg(long)]
    quick: bool,
    /// What to make; all of it when absent
    #[arg(long, value_enum, value_delimiter = ',', value_name = "SECTION,...")]
    only: Vec<Section>,
    /// Repeats runs whose results are there
    #[arg(long)]
    force: bool,
}

impl PaperArguments {
    fn sections(&self) -> Vec<Section> {
        if self.only.is_empty() { Section::value_variants().to_vec() } else { self.only.clone() }
    }
}

/// Runs what is missing and writes the tables.
pub fn run(options: &GpuOptions, a: &PaperArguments) -> Result<()> {
    if a.only == [Section::Table3] {
        return baselines::check(&a.data);
    }
    let sections = a.sections();
    let effort = if a.quick { Effort::QUICK } else { Effort::FULL };
    let store = Store::open(&a.out)?;
    let judge = Gpu::new(options)?;
    let device = judge.description();
    let mut library = Library::new(&a.data);
    let plan = Plan::new(&sections, &effort, &mut library, &device.name)?;
    let report = PaperReport {
        device: format!("{} ({}, {})", device.name, device.kind, device.driver),
        baselines: match sections.contains(&Section::Table3) {
            true => Some(baselines::table(&a.data)?),
            false => None,
        },
        sections: &sections,
        effort: &effort,
        plan: &plan,
        store: &store,
    };
    let jobs = plan.jobs(&sections);
    let mut results = Results::default();
    let mut missing = Vec::new();
    for job in &jobs {
        match if a.force { None } else { store.load(&job.key())? } {
            Some(record) => results.add(record),
            None => missing.push(*job),
        }
    }
    eprintln!("{} runs: {} are there, {} to do", jobs.len(), jobs.len() - missing.len(), missing.len());
    report.write(&results)?;
    let failed = Runner { options, judge: &judge, library: &mut library, report: &report }
        .all(&missing, &mut results)?;
    println!("{}", report.markdown(&results));
    eprintln!("written: {}", store.file("paper.csv").display());
    all_done(&failed, missing.len(), "runs")
}

/// Carries out runs, one after the other.
struct Runner<'a> {
    options: &'a GpuOptions,
    judge: &'a Gpu,
    library: &'a mut Library,
    report: &'a PaperReport<'a>,
}

impl Runner<'_> {
    /// Runs all jobs and keeps the results. A run that fails is reported on stderr and does not end the
    /// others. Returns the errors.
    fn all(&mut self, jobs: &[&Job], results: &mut Results) -> Result<Vec<Error>> {
        let mut queue = Vec::new();
        for job in jobs {
            queue.push((estimate(job, self.library.place(&job.folder, &job.mask)?), *job));
        }
        Ok(carry_out(
            queue,
            |job| job.title(),
            |job| {
                let place = self.library.place(&job.folder, &job.mask)?;
                let record = runs::run(job, place, self.options, self.judge, |p| {
                    eprintln!("    iteration {}: {:.2} dB, {:.1} s", p.iteration, p.psnr(), p.seconds);
                })?;
                if let Some(at) = record.diverged_at {
                    eprintln!("    diverged before iteration {at}");
                }
                self.report.store.save(&record)?;
                results.add(record);
                self.report.write(results)
            },
        ))
    }
}

/// Everything that the reports are written from, besides the results.
struct PaperReport<'a> {
    sections: &'a [Section],
    effort: &'a Effort,
    plan: &'a Plan,
    store: &'a Store,
    device: String,
    baselines: Option<String>,
}

impl PaperReport<'_> {
    /// Returns the tables of all sections, each with the name of its file.
    fn tables(&self, results: &Results) -> Vec<(&'static str, Table)> {
        let plan = self.plan;
        let mut tables = Vec::new();
        if !plan.rows.is_empty() {
            tables.push(("cases", tables::cases(&plan.rows)));
        }
        for section in self.sections {
            match section {
                Section::Table2 => tables.push(("table-2", tables::table_2(&plan.rows, results))),
                Section::Table3 => {}
                Section::Table4 => tables.push(("table-4", tables::table_4(&plan.losses, results))),
                Section::Table6 => tables.push(("table-6", tables::table_6(&plan.rows, results))),
                Section::Ablation => tables.push(("ablation", studies::ablation(&plan.losses, results))),
                Section::Density => tables.push(("density", studies::density(&plan.sweeps, results))),
                Section::Findings => {
                    tables.push(("fidelity", studies::fidelity(&plan.fidelity, results)));
                    tables.push(("findings", studies::findings(&plan.findings, results)));
                }
                Section::Reference => {
                    tables.push(("peers", peer::table(&plan.peers, results)));
                    tables.push(("differences", peer::differences(&plan.differences, results)));
                }
            }
        }
        tables
    }

    fn markdown(&self, results: &Results) -> String {
        let mut text = tables::preamble(self.effort, &self.device);
        for (_, table) in self.tables(results) {
            text += &format!("\n{}", table.markdown());
        }
        if let Some(baselines) = &self.baselines {
            text += &format!("\n{baselines}");
        }
        text
    }

    fn write(&self, results: &Results) -> Result<()> {
        for (name, table) in self.tables(results) {
            self.store.report(&format!("{name}.csv"), &table.csv())?;
        }
        self.store.report("paper.csv", &results.csv())?;
        if !self.plan.rows.is_empty() {
            self.store.report("psnr-time.svg", &plot::svg(&self.plan.rows, results)?)?;
        }
        Ok(())
    }
}
