//! Measures what a fit's accuracy costs (`studies trade fit`). The fits of a small `design` are run and kept
//! like those of `studies paper`, whose code runs them; `report` writes tables, CSV, JSON and plots of them.

mod design;
mod report;

use std::path::{Path, PathBuf};

use clap::Args;
use engine::fit::{FitConfig, GOAL_MARGIN_DB, Goal, PROFILES, Problem, Profile, to_the_end};
use engine::gpu::{Gpu, GpuOptions};
use engine::{Error, Kind, Result};

use self::design::{Extent, FitPlace, Part};
use self::report::{FitTradeReport, Measured};
use crate::paper::estimate::estimate;
use crate::paper::library::Place;
use crate::paper::runs::{self, Record};
use bench::progress::{all_done, carry_out};
use bench::scene::Scene;
use bench::store::Store;

#[derive(Args)]
#[command(after_help = "\
Each finished fit is a file in OUT/runs, named by case, mask, splats, profile and a hash of all settings and the device: what is \
there is not run again, and one that is stopped (Ctrl-C) is the only one lost. OUT/fit.md, fit.csv, fit.json and fit.svg are \
written anew after each fit. A changed program does not change the hash: run again with --force.

Examples:
  studies trade fit ct.nii.gz --roi bones.nii.gz --out trade
  studies trade fit ct.nii.gz --roi bones.nii.gz --out trade --densities 0.5,1 --iterations 50,100 --only grid
  studies trade fit ct.nii.gz --roi bones.nii.gz --out trade --only qualities --force      times these again")]
pub struct FitTradeArguments {
    /// The volume
    volume: PathBuf,
    /// Its mask
    #[arg(long, value_name = "MASK")]
    roi: PathBuf,
    /// Hyper-parameters that the fits start from
    #[arg(long, value_name = "NAME", default_value = PROFILES[0].name)]
    profile: String,
    /// Folder for results and reports
    #[arg(long, value_name = "DIR", default_value = "trade-fit")]
    out: PathBuf,
    /// Splats per voxel, times those of the profile
    #[arg(long, value_delimiter = ',', value_name = "X,...", default_values_t = [0.25, 0.5, 1.0, 2.0, 4.0])]
    densities: Vec<f64>,
    /// Iterations
    #[arg(long, value_delimiter = ',', value_name = "N,...", default_values_t = [50, 100, 200, 400])]
    iterations: Vec<u32>,
    /// What to run; all of it when absent. What is there of the rest is still reported
    #[arg(long, value_enum, value_delimiter = ',', value_name = "PART,...")]
    only: Vec<Part>,
    /// Repeats what is asked for, if it is there
    #[arg(long)]
    force: bool,
}

/// All parts of the design.
const ALL: [Part; 3] = [Part::Qualities, Part::Spokes, Part::Grid];

/// Runs what is missing and writes the reports.
pub fn run(options: &GpuOptions, a: &FitTradeArguments) -> Result<()> {
    let extent = extent(a)?;
    let profile = Profile::named(&a.profile)?;
    let place = Place::new(Scene::read(&a.volume, &a.roi)?);
    let judge = Gpu::new(options)?;
    let device = judge.description();
    let store = Store::open(&a.out)?;
    let (case, mask) = (case_name(&a.volume), stem(&a.roi));
    let needed = |config: &FitConfig| {
        let Some(goal) = Goal::of(config, place.range, config.region.threshold) else { return Ok(0) };
        let problem = Problem::new(&place.scene.volume, &place.scene.roi, config)?;
        problem.count_for(&judge, &goal, GOAL_MARGIN_DB, &mut |_| {}, &mut to_the_end)
    };
    let at =
        FitPlace { case: &case, mask: &mask, voxels: place.voxels, needed: &needed, device: &device.name };
    let wanted = if a.only.is_empty() { &ALL[..] } else { &a.only };
    let mut report = FitTradeReport {
        title: format!("{case} {mask}, {} voxels, --profile {}", place.voxels.round(), profile.name),
        device: format!("{} ({}, {})", device.name, device.kind, device.driver),
        is_cpu: device.kind == "CPU",
        rows: Vec::new(),
    };
    let mut missing = Vec::new();
    for row in design::rows(&at, profile, &extent, &ALL)? {
        let record = store.load::<Record>(&row.job.key())?;
        if let Some(record) = &record {
            check_place(record, &place, &store)?;
        }
        let again = record.is_none() || a.force;
        if again && wanted.contains(&row.part) {
            missing.push((estimate(&row.job, &place), report.rows.len()));
        }
        report.rows.push(Measured { row, record });
    }
    eprintln!("{} fits: {} to do", report.rows.len(), missing.len());
    let count = missing.len();
    let titles: Vec<String> = report.rows.iter().map(|m| m.row.job.title()).collect();
    let failed = carry_out(
        missing,
        |&i| titles[i].clone(),
        |&i| {
            let record = runs::run(&report.rows[i].row.job, &place, options, &judge, |_| {})?;
            store.save(&record)?;
            report.rows[i].record = Some(record);
            report.write(&store)
        },
    );
    report.write(&store)?;
    println!("{}", report.markdown());
    eprintln!("written: {}", store.file("fit.md").display());
    all_done(&failed, count, "fits")
}

fn extent(a: &FitTradeArguments) -> Result<Extent> {
    let mut extent = Extent { densities: a.densities.clone(), iterations: a.iterations.clone() };
    extent.densities.sort_by(f64::total_cmp);
    extent.iterations.sort_unstable();
    extent.iterations.dedup();
    extent.densities.dedup();
    match extent.densities.iter().find(|&&times| !(times > 0.0 && times.is_finite())) {
        None => Ok(extent),
        Some(times) => {
            let message = format!("--densities {times}: factors above 0 are needed");
            Err(Error::new(Kind::Usage, "VGS-BEN-030", message))
        }
    }
}

/// Returns an error if a result in the folder is that of another case with the same name.
fn check_place(record: &Record, place: &Place, store: &Store) -> Result<()> {
    if (record.roi_voxels, record.range) == (place.voxels, place.range) {
        return Ok(());
    }
    let message = "the results here are those of another volume or mask of the same name";
    Err(Error::new(Kind::BadData, "VGS-BEN-031", message)
        .file(store.file("runs"))
        .help("choose another --out"))
}

/// Returns the name of a file without its extensions.
fn stem(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    name.split('.').next().unwrap_or_default().to_owned()
}

/// Returns the name of a volume, or that of its folder if the file has the usual name `ct`.
fn case_name(volume: &Path) -> String {
    let folder = volume.parent().and_then(Path::file_name).map(|name| name.to_string_lossy().into_owned());
    match (stem(volume).as_str(), folder) {
        ("ct", Some(folder)) => folder,
        (name, _) => name.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use engine::volume::nifti;

    use super::*;

    #[test]
    fn a_sweep_on_the_phantom_is_kept_and_reported() {
        let folder = tempfile::tempdir().expect("a folder");
        let scene = Scene::phantom(16).expect("a phantom");
        let file = |name: &str| folder.path().join(name);
        nifti::write(file("ct.nii.gz"), &scene.volume, false).expect("written");
        let mask = engine::volume::Volume { samples: scene.roi.weight.clone(), ..scene.volume.clone() };
        nifti::write(file("mask.nii.gz"), &mask, false).expect("written");
        let mut a = FitTradeArguments {
            volume: file("ct.nii.gz"),
            roi: file("mask.nii.gz"),
            profile: "default".into(),
            out: file("out"),
            densities: vec![1.0, 0.5],
            iterations: vec![3, 2],
            only: vec![Part::Grid, Part::Spokes],
            force: false,
        };
        let options = GpuOptions { validation: true, ..GpuOptions::default() };
        run(&options, &a).expect("a sweep");
        let count = || std::fs::read_dir(file("out/runs")).expect("runs").count();
        assert_eq!(count(), 4 + 4, "the grid and the spokes, and no quality");
        let csv = std::fs::read_to_string(file("out/fit.csv")).expect("a CSV");
        assert_eq!(csv.lines().count(), 1 + 8);
        assert!(!csv.contains("NaN") && csv.contains("mixed"), "{csv}");
        let json: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(file("out/fit.json")).expect("a file"))
                .expect("JSON");
        assert!(json["rows"][0]["psnr_worst_db"].is_f64(), "{json}");
        // What is there is not run again, and the report still has it.
        a.only = vec![Part::Grid];
        let before = std::fs::metadata(file("out/fit.csv")).expect("a file").len();
        run(&options, &a).expect("nothing to do");
        assert_eq!((count(), std::fs::metadata(file("out/fit.csv")).expect("a file").len()), (8, before));
        // Another volume of the same name.
        let samples = scene.volume.samples.iter().map(|hu| hu + 10.0).collect();
        let brighter = engine::volume::Volume { samples, ..scene.volume };
        nifti::write(file("ct.nii.gz"), &brighter, true).expect("written");
        let error = run(&options, &a).expect_err("another volume");
        assert_eq!(error.code, "VGS-BEN-031", "{error}");
    }

    #[test]
    fn cases_are_called_by_what_tells_them_apart() {
        assert_eq!(case_name(Path::new("data/ct-skull/ct.nii.gz")), "ct-skull");
        assert_eq!(case_name(Path::new("data/skull.nii")), "skull");
        assert_eq!(case_name(Path::new("ct.nii")), "ct");
        assert_eq!(stem(Path::new("a/mask_bones.nii.gz")), "mask_bones");
    }
}
