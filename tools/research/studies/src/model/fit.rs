//! `studies model fit`: counts and times frames of scenes, and finds what each piece of their work costs.

use std::path::{Path, PathBuf};

use clap::Args;
use engine::gpu::Gpu;
use engine::passes::WorkgroupShape;
use engine::{Error, Kind, Result};

use super::plan::{self, Place, Unit, shots, sights};
use super::report::ModelReport;
use super::shots::{Record, measure};
use bench::progress::{all_done, carry_out};
use bench::store::Store;

/// What each piece of work costs on this device, and how well that predicts scenes that were held out.
#[derive(Args)]
#[command(after_help = "\
Each file of splats, whole and cut to its most important ones, is rendered in modes slab, decoded and alpha, in \
several sizes, for one eye and two, through transfer functions lit and not lit, from near and far. Each \
frame's work is counted, in a run of its own, and its passes are timed by the device. The costs of a unit of \
work are the non-negative ones of least relative error. They are judged by scenes that were held out, all \
fits of a case together (bones-100k, bones-250k), and by sizes that were held out. A file's results are in \
OUT/runs: what is there is not measured again. OUT/model.md, model.csv, model.json and model.svg are written \
anew after each file.

Examples:
  studies model fit bones-100k.ply body-100k.ply --out model --quick
  studies model fit fits/*.ply --out model --cuts 30000
  studies --device nvidia model fit fits/*.ply --out model-gpu --sizes 512,1024,2048")]
pub struct ModelFitArguments {
    /// The splats (PLY); files of at least two cases, so that one can be held out
    #[arg(required = true)]
    splats: Vec<PathBuf>,
    /// Folder for results and reports
    #[arg(long, value_name = "DIR", default_value = "model")]
    out: PathBuf,
    /// Edges of the pictures, pixels
    #[arg(long, value_delimiter = ',', default_values_t = [256, 512, 896])]
    sizes: Vec<u32>,
    /// Renders the so many most important splats of each file as well
    #[arg(long, value_delimiter = ',')]
    cuts: Vec<usize>,
    /// Transfer functions
    #[arg(long, value_delimiter = ',', default_values_t = ["CT-Bone".to_owned(), "CT-Soft-Tissue".to_owned()])]
    tf: Vec<String>,
    /// Frames that are timed of each; the one in the middle counts
    #[arg(long, default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=99))]
    frames: u32,
    /// One transfer function, small pictures, one frame of each
    #[arg(long)]
    quick: bool,
    /// Measures again what is there
    #[arg(long)]
    force: bool,
}

/// Measures the frames that have no results yet, and writes the reports.
pub fn run(gpu: &Gpu, a: &ModelFitArguments) -> Result<()> {
    if a.sizes.is_empty() || a.sizes.contains(&0) || a.tf.is_empty() {
        return Err(Error::new(
            Kind::Usage,
            "VGS-BEN-041",
            "sizes above 0 and a transfer function are needed",
        ));
    }
    let store = Store::open(&a.out)?;
    let device = device(gpu);
    let wide = WorkgroupShape::of(gpu) == WorkgroupShape::SideBySide;
    let mut report = ModelReport::new(device.clone(), wide);
    let mut units = Vec::new();
    for path in &a.splats {
        for splats in std::iter::once(None).chain(a.cuts.iter().copied().map(Some)) {
            units.push((unit(a, path, splats, &device)?, path.as_path()));
        }
    }
    run_missing(gpu, &store, units, a.force, |record| {
        report.records.push(record);
        report.write(&store)
    })?;
    report.write(&store)?;
    println!("{}", report.markdown());
    eprintln!("written: {}", store.file("model.md").display());
    Ok(())
}

/// Loads the results of `units` from `store`, measures and saves those that are missing, or all of them with
/// `force`, and calls `finished` with each.
pub fn run_missing(
    gpu: &Gpu,
    store: &Store,
    units: Vec<(Unit, &Path)>,
    force: bool,
    mut finished: impl FnMut(Record) -> Result<()>,
) -> Result<()> {
    let count = units.len();
    let mut missing = Vec::new();
    for (unit, path) in units {
        match if force { None } else { store.load::<Record>(&unit.key())? } {
            Some(record) => finished(record)?,
            None => missing.push((unit.seconds(), (unit, path))),
        }
    }
    let left = missing.len();
    eprintln!("{left} of {count} to do");
    let failed = carry_out(
        missing,
        |(unit, _)| unit.title(),
        |(unit, path)| {
            let record = measure(unit, path, gpu)?;
            store.save(&record)?;
            finished(record)
        },
    );
    all_done(&failed, left, "files")
}

/// Returns the name, kind and driver of the device of `gpu`.
pub fn device(gpu: &Gpu) -> String {
    let device = gpu.description();
    format!("{} ({}, {})", device.name, device.kind, device.driver)
}

fn unit(a: &ModelFitArguments, path: &Path, splats: Option<usize>, device: &str) -> Result<Unit> {
    let (file, contents) = plan::identity(path)?;
    let sizes: Vec<u32> =
        if a.quick { a.sizes.iter().map(|n| (n / 4).max(16)).collect() } else { a.sizes.clone() };
    let functions = if a.quick { &a.tf[..1] } else { &a.tf[..] };
    Ok(Unit {
        file,
        contents,
        splats,
        sights: sights(functions),
        places: vec![Place::Filling, Place::Before(1.0)],
        shots: shots(&sizes),
        frames: if a.quick { 1 } else { a.frames as usize },
        device: device.to_owned(),
    })
}
