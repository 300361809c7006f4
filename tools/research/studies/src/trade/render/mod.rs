//! Measures what a picture's accuracy costs (`studies trade render`). Splats of a few cases are rendered in
//! many ways (`plan`) from several sides through several transfer functions, compared with the CT itself
//! (`shots`), and kept; `report` writes tables and plots of them, and `quality_levels` chooses the
//! levels of the frame budget's controller.

mod averages;
mod plan;
mod quality_levels;
mod report;
mod shots;

use std::path::PathBuf;

use clap::Args;
use engine::fit::{FitConfig, Profile};
use engine::gpu::{Gpu, GpuOptions};
use engine::{Result, output};

pub use self::plan::Choice;
use self::report::PictureTradeReport;
use self::shots::{Record, Unit};
use bench::progress::{all_done, carry_out};
use bench::render::config::{Config, Subject};
use bench::render::scenes::Library;
use bench::scene::splats_by_importance;
use bench::store::Store;

/// Cases of the configuration of `bench render`, with their splats per voxel.
const CASES: [(&str, f64); 3] = [("torso bones", 0.1), ("skull", 0.05), ("heart", 0.1)];
/// Transfer functions of that configuration: hard, soft, and a surface.
const TRANSFERS: [&str; 3] = ["steep shaded", "soft shaded", "skin shaded"];
/// Iterations of the fits of a quick run.
const QUICK_ITERATIONS: u32 = 60;

#[derive(Args)]
#[command(after_help = "\
Pictures of splats, of a fit with offsets and of one for the CT's grid, against the CT with its mask, ray-marched in steps of a twentieth \
of a voxel, lit: 3 cases, 3 transfer functions, 8 views. \
Each case in each transfer function is a file in OUT/runs, named by a hash of all settings and the device: what is there is \
not measured again. Fitted splats are kept in OUT/splats. OUT/render.md, render.csv, render.json and render.svg are written anew \
after each.

Examples:
  studies trade render --data DIR --quick                  one case, one transfer function, two views
  studies trade render --data DIR --out trade              all of it: half an hour on two cores
  studies trade render --data DIR --levels engine/render/src/quality_levels.toml   writes the levels, too
  studies trade render --data DIR --out large --cases skull --density 4 --size 512        larger pictures of more splats")]
pub struct PictureTradeArguments {
    /// Folder with the cases: CASE/ct.nii.gz and its masks
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
    /// Folder for results and reports
    #[arg(long, value_name = "DIR", default_value = "trade-render")]
    out: PathBuf,
    /// Edge of the pictures, pixels
    #[arg(long, default_value_t = 320, value_parser = clap::value_parser!(u32).range(16..=8192))]
    size: u32,
    /// Cases, of those of `bench render`'s configuration; three of different kinds when absent
    #[arg(long, value_delimiter = ',', value_name = "NAME,...")]
    cases: Vec<String>,
    /// Splats per voxel, times those of the case: whether the quality levels are those of larger scenes, too
    #[arg(long, value_name = "TIMES", default_value_t = 1.0)]
    density: f64,
    /// One case, one transfer function, two views and a short fit
    #[arg(long)]
    quick: bool,
    /// Measures again what is there; fitted splats stay
    #[arg(long)]
    force: bool,
    /// Writes the quality levels of the frame budget (TOML), in place of those that are there
    #[arg(long, value_name = "FILE", conflicts_with = "quick")]
    levels: Option<PathBuf>,
}

/// Measures what is missing and writes the reports.
pub fn run(options: &GpuOptions, a: &PictureTradeArguments) -> Result<()> {
    let gpu = Gpu::new(options)?;
    let device = gpu.description();
    let store = Store::open(&a.out)?;
    let units = units(a, &format!("{} ({}, {})", device.name, device.kind, device.driver))?;
    let mut report = PictureTradeReport {
        device: units.first().map(|u| u.device.clone()).unwrap_or_default(),
        is_cpu: device.kind == "CPU",
        records: Vec::new(),
    };
    let mut missing = Vec::new();
    for unit in &units {
        match if a.force { None } else { store.load::<Record>(&unit.key())? } {
            Some(record) => report.records.push(record),
            // All units have the same pictures, so their estimates are equal.
            None => missing.push((1.0, unit)),
        }
    }
    eprintln!("{} of {} to do", missing.len(), units.len());
    let count = missing.len();
    let folder = store.file("splats");
    let mut library = Library::new(&a.data, &folder, options)?;
    let failed = carry_out(
        missing,
        |unit| unit.title(),
        |unit| {
            let sets = [&unit.fit, &unit.grid_fit].map(|fit| {
                let path = library.fitted(&unit.case, fit)?;
                splats_by_importance(&path)
            });
            let [field, grid] = sets;
            let record = shots::measure(unit, library.place(&unit.case)?, &field?, &grid?, &gpu)?;
            store.save(&record)?;
            report.records.push(record);
            report.write(&store)
        },
    );
    report.write(&store)?;
    println!("{}", report.markdown());
    eprintln!("written: {}", store.file("render.md").display());
    all_done(&failed, count, "subjects")?;
    if let Some(path) = &a.levels {
        let text = quality_levels::toml(&report.rows(), &report.device);
        output::write_atomic(path, true, |w| w.write_all(text.as_bytes()))?;
    }
    Ok(())
}

fn units(a: &PictureTradeArguments, device: &str) -> Result<Vec<Unit>> {
    let config = Config::read(None)?;
    let named: Vec<(String, f64)> = match a.cases.as_slice() {
        [] => CASES.map(|(name, density)| (name.to_owned(), density)).into(),
        names => names.iter().map(|name| (name.clone(), density_of(name))).collect(),
    };
    let (cases, transfers, views) = if a.quick {
        (&named[..1], &TRANSFERS[..1], vec![0, config.orbit.count / 2])
    } else {
        (&named[..], &TRANSFERS[..], (0..config.orbit.count).collect())
    };
    let mut units = Vec::new();
    for (name, density) in cases {
        let (case, density) = (name.clone(), Some(density * a.density));
        let profile = Some("field".into());
        let subject =
            Subject { case, density, splats: None, ply: None, profile, renderings: None, coloured: false };
        let fit = config.fit(&subject)?;
        let iterations = if a.quick { QUICK_ITERATIONS } else { fit.iterations };
        for transfer in transfers {
            units.push(Unit {
                case: config.case_of(&subject)?,
                fit: FitConfig { iterations, ..fit.clone() },
                grid_fit: grid_fit(&fit, a.quick)?,
                transfer: config.transfer(transfer)?.clone(),
                choices: plan::choices(),
                size: a.size,
                orbit: config.orbit,
                views: views.clone(),
                device: device.to_owned(),
            });
        }
    }
    Ok(units)
}

/// Returns the configuration of a fit for the grid with as many splats.
fn grid_fit(fit: &FitConfig, quick: bool) -> Result<FitConfig> {
    let grid = Profile::named("default")?.config()?;
    let iterations = if quick { QUICK_ITERATIONS } else { grid.iterations };
    Ok(grid.with(|c| {
        c.count.density = fit.count.density;
        c.count.splats = fit.count.splats;
        c.iterations = iterations;
    }))
}

/// Returns the splats per voxel of a case; the usual number for a case that is none of the three.
fn density_of(name: &str) -> f64 {
    CASES
        .iter()
        .find(|(known, _)| *known == name)
        .map_or(FitConfig::default().count.density, |(_, density)| *density)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_run_is_three_cases_through_three_functions_from_eight_sides() {
        let a = |quick: bool, cases: &[&str]| PictureTradeArguments {
            data: PathBuf::new(),
            out: PathBuf::new(),
            size: 64,
            cases: cases.iter().map(|name| (*name).to_owned()).collect(),
            density: 1.0,
            quick,
            force: false,
            levels: None,
        };
        let all = units(&a(false, &[]), "none").expect("units");
        assert_eq!((all.len(), all[0].views.len()), (9, 8));
        let keys: std::collections::BTreeSet<String> = all.iter().map(Unit::key).collect();
        assert_eq!(keys.len(), 9);
        let quick = units(&a(true, &[]), "none").expect("units");
        assert_eq!((quick.len(), quick[0].views.len(), quick[0].fit.iterations), (1, 2, QUICK_ITERATIONS));
        assert_eq!(units(&a(false, &["skull"]), "none").expect("units")[0].fit.count.density, 0.05);
        let dense = PictureTradeArguments { density: 4.0, ..a(false, &["skull"]) };
        assert_eq!(units(&dense, "none").expect("units")[0].fit.count.density, 0.2);
        assert!(units(&a(false, &["no such case"]), "none").is_err());
        assert!(
            units(&PictureTradeArguments { density: -1.0, ..dense }, "none").is_err(),
            "as a fit refuses it"
        );
    }
}
