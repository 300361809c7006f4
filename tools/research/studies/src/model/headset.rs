//! `studies model`: counts the work of the frames of a standalone headset, and predicts what devices
//! that are not at hand would take for them.

use std::fmt::Write;
use std::path::{Path, PathBuf};

use clap::Args;
use engine::budget::budget_ms;
use engine::gpu::Gpu;
use engine::render::{QualityLevel, SplatKind, quality_levels};
use engine::{Error, Kind, Result};
use serde::Serialize;

use super::device::Device;
use super::plan::{Place, Shot, Sight, Unit, identity};
use super::plot::{self, LevelRanges};
use super::shots::{Frame, Record, measure};
use super::stages::STAGES;
use crate::trade::render::Choice;
use bench::cost::median;
use bench::progress::{all_done, carry_out};
use bench::store::Store;

/// Refresh rates of the displays, Hz.
const RATES_HZ: [f64; 2] = [72.0, 90.0];

/// The frames of a headset, and what devices that are not at hand would take for them
#[derive(Args)]
#[command(after_help = "\
Two eyes of 96 degrees, 64 mm apart, see the splats in real size, as vgs-xr places them and at half of that \
distance, at the frame budget's quality levels of all kinds of splats, with depth. The work of each frame is counted here; what it takes elsewhere is a roofline over a device's rates, from the \
share of them that a program reaches that suits it badly to that of one that suits it well. A budget is 9/10 \
of a period. OUT/headset.md, headset.csv, headset.json and headset.svg are written anew after each file.

Examples:
  studies model bones-100k.ply bones-250k.ply --out model
  studies model fits/*.ply --out model --devices mine.toml         \
tools/research/studies/src/model/devices explains it")]
pub struct ModelArguments {
    /// The splats (PLY)
    #[arg(required = true)]
    splats: Vec<PathBuf>,
    /// Folder for results and reports
    #[arg(long, value_name = "DIR", default_value = "model")]
    out: PathBuf,
    /// Width and height of an eye's picture
    #[arg(long, value_delimiter = ',', value_name = "WxH,...", default_values_t = ["1440x1440".to_owned(), "2064x2208".to_owned()])]
    sizes: Vec<String>,
    /// Transfer function
    #[arg(long, default_value = "CT-Bone")]
    tf: String,
    /// Shares of the distance that vgs-xr begins at
    #[arg(long, value_delimiter = ',', default_values_t = [1.0, 0.5])]
    distances: Vec<f64>,
    /// Devices besides those that come with the program (TOML)
    #[arg(long, value_delimiter = ',', value_name = "FILE,...")]
    devices: Vec<PathBuf>,
    /// Counts again what is there
    #[arg(long)]
    force: bool,
}

/// Renders the frames that have no results yet, counts their work, and writes the reports.
pub fn run(gpu: &Gpu, a: &ModelArguments) -> Result<()> {
    let store = Store::open(&a.out)?;
    let mut devices = Device::known();
    for path in &a.devices {
        devices.push(Device::read(path)?);
    }
    let here = device(gpu);
    let sizes = a.sizes.iter().map(|text| size(text)).collect::<Result<Vec<_>>>()?;
    let modelled = modelled();
    let shots: Vec<Shot> =
        sizes.iter().flat_map(|&size| modelled.iter().map(move |r| shot(r, size))).collect();
    let mut units = Vec::new();
    for path in &a.splats {
        let (file, contents) = identity(path)?;
        let unit = Unit {
            file,
            contents,
            sights: vec![Sight { transfer: a.tf.clone(), lit: true }],
            places: a.distances.iter().map(|&share| Place(share)).collect(),
            shots: shots.clone(),
            device: here.clone(),
        };
        units.push((unit, path.as_path()));
    }
    let mut report = HeadsetReport { devices, here, sizes, records: Vec::new() };
    run_missing(gpu, &store, units, a.force, |record| {
        report.records.push(record);
        report.write(&store)
    })?;
    report.write(&store)?;
    println!("{}", report.markdown());
    eprintln!("written: {}", store.file("headset.md").display());
    Ok(())
}

/// Loads the results of `units` from `store`, measures and saves those that are missing, or all of them with
/// `force`, and calls `finished` with each.
fn run_missing(
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
        |(unit, _)| unit.file.clone(),
        |(unit, path)| {
            let record = measure(unit, path, gpu)?;
            store.save(&record)?;
            finished(record)
        },
    );
    all_done(&failed, left, "files")
}

/// Returns the name, kind and driver of the device of `gpu`.
fn device(gpu: &Gpu) -> String {
    let device = gpu.description();
    format!("{} ({}, {})", device.name, device.kind, device.driver)
}

fn size(text: &str) -> Result<[u32; 2]> {
    let parts: Option<Vec<u32>> = text.split('x').map(|n| n.parse().ok()).collect();
    match parts.as_deref() {
        Some(&[width, height]) if width.min(height) > 0 => Ok([width, height]),
        _ => Err(Error::new(Kind::Usage, "VGS-BEN-044", format!("{text:?} is no size"))
            .help("for example 1440x1440")),
    }
}

/// Returns the quality levels of splats for the grid, which have mode decoded, and of coloured splats, which have
/// mode alpha. Those of the field are ways to render of the first.
fn modelled() -> Vec<QualityLevel> {
    [SplatKind::Grid, SplatKind::Coloured].into_iter().flat_map(quality_levels).copied().collect()
}

fn shot(level: &QualityLevel, size: [u32; 2]) -> Shot {
    let q = level.quality;
    Shot {
        mode: level.mode.into(),
        size,
        views: 2,
        depth: true,
        resolution: q.resolution,
        coarseness: q.coarseness,
    }
}

struct HeadsetReport {
    devices: Vec<Device>,
    here: String,
    sizes: Vec<[u32; 2]>,
    records: Vec<Record>,
}

/// Predicted time of a frame on a device.
#[derive(Serialize)]
struct Prediction<'a> {
    device: &'a str,
    file: &'a str,
    splats: usize,
    place: String,
    size: [u32; 2],
    level: usize,
    rendering: String,
    /// Slowest and fastest time, ms.
    range_ms: [f64; 2],
    /// Stage that takes the longest at the slow end, and the resource that limits it.
    most: String,
    /// Measured time on the device that counted the work, ms.
    here_ms: f64,
    work: &'a super::work::Work,
}

/// Returns the name that the tables of `studies trade render` have for the quality of a shot.
fn rendering(shot: &Shot) -> String {
    let Shot { mode, coarseness, resolution, .. } = shot.clone();
    Choice { step: coarseness, resolution, ..Choice::usual(&mode) }.name()
}

/// Returns "yes" if a range of times, slowest first, is within `budget`, "perhaps" if only the fastest is,
/// and else "no".
fn verdict([slow, fast]: [f64; 2], budget: f64) -> &'static str {
    match (slow <= budget, fast <= budget) {
        (true, _) => "yes",
        (false, true) => "perhaps",
        (false, false) => "no",
    }
}

fn distinct<T: PartialEq + Clone>(all: impl Iterator<Item = T>) -> Vec<T> {
    let mut once = Vec::new();
    for x in all {
        if !once.contains(&x) {
            once.push(x);
        }
    }
    once
}

/// Rounds a number of splats to the nearest 5,000.
fn about(splats: usize) -> usize {
    (splats + 2_500) / 5_000 * 5_000
}

impl HeadsetReport {
    fn frames(&self) -> impl Iterator<Item = (&Record, &Frame)> {
        self.records.iter().flat_map(|r| r.frames.iter().map(move |f| (r, f)))
    }

    fn predictions(&self) -> Vec<Prediction<'_>> {
        let mut all = Vec::new();
        for device in &self.devices {
            for (record, frame) in self.frames() {
                let stages = device.stages(&frame.work, 0);
                let most = stages.iter().zip(STAGES.iter()).max_by(|a, b| a.0.ms.total_cmp(&b.0.ms));
                all.push(Prediction {
                    device: &device.name,
                    file: &record.unit.file,
                    splats: record.splats,
                    place: frame.place.name(),
                    size: frame.shot.size,
                    level: record.unit.shots.iter().position(|s| *s == frame.shot).unwrap_or(0)
                        % modelled().len(),
                    rendering: rendering(&frame.shot),
                    range_ms: device.range(&frame.work),
                    most: most.map_or_else(String::new, |(time, stage)| {
                        format!("{}: {:?}", stage.name, time.limit)
                    }),
                    here_ms: frame.passes.values().sum(),
                    work: &frame.work,
                });
            }
        }
        all
    }

    fn markdown(&self) -> String {
        let all = self.predictions();
        let mut text = String::new();
        for device in &self.devices {
            let of: Vec<&Prediction<'_>> = all.iter().filter(|p| p.device == device.name).collect();
            for place in distinct(of.iter().map(|p| p.place.clone())) {
                let here: Vec<&Prediction<'_>> = of.iter().filter(|p| p.place == place).copied().collect();
                text += &self.table(device, &place, &here);
                text.push('\n');
            }
        }
        text
    }

    /// Returns the columns of a table: each size with each rounded number of splats, in ascending order of
    /// the latter.
    fn columns(&self, of: &[&Prediction<'_>]) -> Vec<([u32; 2], usize)> {
        let mut counts = distinct(of.iter().map(|p| about(p.splats)));
        counts.sort_unstable();
        self.sizes.iter().flat_map(|&size| counts.iter().map(move |&n| (size, n))).collect()
    }

    /// Returns the slowest and the fastest time of a quality level in a column, ms, each the median over its
    /// files; `None` if no frame of it was rendered.
    fn middle(of: &[&Prediction<'_>], level: usize, (size, count): ([u32; 2], usize)) -> Option<[f64; 2]> {
        let ends = [0, 1].map(|end| {
            let times: Vec<f64> = of
                .iter()
                .filter(|p| p.level == level && p.size == size && about(p.splats) == count)
                .map(|p| p.range_ms[end])
                .collect();
            median(&times)
        });
        Some([ends[0]?, ends[1]?])
    }

    fn table(&self, device: &Device, place: &str, of: &[&Prediction<'_>]) -> String {
        let columns = self.columns(of);
        let rows = modelled().into_iter().enumerate().map(|(level, row)| {
            let mut cells = vec![level.to_string(), rendering(&shot(&row, [1; 2]))];
            cells.extend(columns.iter().map(|&column| {
                Self::middle(of, level, column).map_or_else(String::new, |range| {
                    let [at72, at90] = RATES_HZ.map(|hz| verdict(range, budget_ms(hz)));
                    format!("{} to {}: {at72}, {at90}", digits(range[1]), digits(range[0]))
                })
            }));
            cells
        });
        let files = distinct(of.iter().map(|p| p.file));
        let mut titles = vec!["level".to_owned(), "rendering".to_owned()];
        titles.extend(columns.iter().map(|([w, h], n)| format!("{w} × {h}, {}k / ms", n / 1000)));
        let title = format!(
            "Two eyes on {}, {place}: fastest to slowest, the middle of the files of that many splats, and whether that is within the \
             budget at {} and at {} Hz ({:.1} and {:.1} ms). Files: {}; work counted on {}",
            device.name,
            RATES_HZ[0],
            RATES_HZ[1],
            budget_ms(RATES_HZ[0]),
            budget_ms(RATES_HZ[1]),
            files.join(", "),
            self.here
        );
        // Not a [`bench::report::Table`], whose columns are known when the program is built.
        let line = |cells: &[String]| format!("| {} |\n", cells.join(" | "));
        let body: String = rows.map(|row| line(&row)).collect();
        format!("{title}\n\n{}|{}\n{body}", line(&titles), "---|".repeat(titles.len()))
    }

    fn csv(&self, all: &[Prediction<'_>]) -> String {
        let mut out = String::from(
            "device,file,splats,place,width,height,level,rendering,fast_ms,slow_ms,most,shown,pairs,wide_evaluations,evaluations,\
             wide_samples,wide_gradients,samples,gradients,fragments,here_ms\n",
        );
        for p in all {
            // Writing to a string cannot fail.
            let _ = writeln!(
                out,
                "\"{}\",{},{},{},{},{},{},\"{}\",{:.3},{:.3},{},{},{},{},{},{},{},{},{},{},{:.3}",
                p.device,
                p.file,
                p.splats,
                p.place,
                p.size[0],
                p.size[1],
                p.level,
                p.rendering,
                p.range_ms[1],
                p.range_ms[0],
                p.most,
                p.work.shown,
                p.work.sorted,
                p.work.wide.evaluations,
                p.work.narrow.evaluations,
                p.work.wide.samples,
                p.work.wide.gradients,
                p.work.narrow.samples,
                p.work.narrow.gradients,
                p.work.fragments,
                p.here_ms
            );
        }
        out
    }

    /// Plots a panel for each size and number of splats, for the first device and the first place, as SVG.
    fn svg(&self, all: &[Prediction<'_>]) -> Result<String> {
        let Some(first) = all.first() else { return plot::levels("", &[], &[]) };
        let of: Vec<&Prediction<'_>> =
            all.iter().filter(|p| p.device == first.device && p.place == first.place).collect();
        let panels = self.columns(&of).into_iter().map(|column| {
            let ([width, height], count) = column;
            let ranges = (0..modelled().len()).filter_map(|level| Self::middle(&of, level, column));
            LevelRanges {
                title: format!("2 × {width} × {height}, {},000 splats", count / 1000),
                ranges: ranges.map(|[slow, fast]| [fast, slow]).collect(),
            }
        });
        let budgets = RATES_HZ.map(|hz| (format!("budget at {hz} Hz"), budget_ms(hz)));
        plot::levels(&format!("{}: predicted", first.device), &panels.collect::<Vec<_>>(), &budgets)
    }

    fn write(&self, store: &Store) -> Result<()> {
        let all = self.predictions();
        let json = bench::report::json(&all)?;
        store.report("headset.md", &self.markdown())?;
        store.report("headset.csv", &self.csv(&all))?;
        store.report("headset.json", &json)?;
        store.report("headset.svg", &self.svg(&all)?)
    }
}

/// Formats milliseconds with one decimal below 10, and with none from there on.
fn digits(ms: f64) -> String {
    if ms < 10.0 { format!("{ms:.1}") } else { format!("{ms:.0}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_is_within_a_budget_or_may_be() {
        assert_eq!(verdict([9.0, 3.0], 10.0), "yes");
        assert_eq!(verdict([12.0, 3.0], 10.0), "perhaps");
        assert_eq!(verdict([30.0, 11.0], 10.0), "no");
        assert_eq!([104_000, 99_999, 250_000].map(about), [105_000, 100_000, 250_000]);
        assert_eq!(size("2064x2208").expect("a size"), [2064, 2208]);
        for text in ["1440", "0x5", "1x2x3", "axb"] {
            assert_eq!(size(text).expect_err(text).code, "VGS-BEN-044");
        }
    }

    #[test]
    fn levels_are_named_as_in_the_tables() {
        let levels = modelled();
        let names: Vec<String> = levels.iter().map(|r| rendering(&shot(r, [8; 2]))).collect();
        assert_eq!(names[0], "decoded, steps × 0.25");
        assert_eq!(distinct(names.iter()).len(), levels.len());
        let shot = shot(&levels[levels.len() - 1], [100, 80]);
        assert!(shot.depth && shot.views == 2 && shot.size == [100, 80]);
    }
}
