//! Writes tables, CSV, JSON and plots of a sweep.

use std::fmt::Write;

use engine::Result;
use engine::splat::Kernel;
use serde::Serialize;

use super::design::{FitRow, Part};
use crate::paper::runs::Record;
use crate::trade::front::{Point, front};
use crate::trade::plot::{self, Panel, Series};
use bench::report::Table;
use bench::store::Store;

/// Fit of the design, and its result if there is one.
pub struct Measured {
    pub row: FitRow,
    pub record: Option<Record>,
}

/// Results of a sweep.
pub struct FitTradeReport {
    /// Case, mask and profile.
    pub title: String,
    /// Device and driver.
    pub device: String,
    /// True if the device is the processor itself: its CPU time is then that of the fit.
    pub is_cpu: bool,
    /// All fits of the design.
    pub rows: Vec<Measured>,
}

/// Figures of a fit. The field names are those of the JSON and the CSV.
#[derive(Clone, Debug, Serialize)]
struct Figures {
    part: String,
    name: String,
    density_times: f64,
    density: f64,
    splats: usize,
    iterations: u32,
    kernel: &'static str,
    storage: engine::fit::Storage,
    offsets: usize,
    psnr_worst_db: f64,
    psnr_mean_db: f64,
    psnr_grid_db: f64,
    rmse_hu: f64,
    p99_hu: f64,
    soft_dice: f64,
    seconds: f64,
    core_seconds: Option<f64>,
    setup_seconds: f64,
    file_bytes: u64,
    device_peak_bytes: u64,
    /// True if no other fit is as good for less; for time, file and memory, in this order.
    on_front: [bool; 3],
}

/// Title of an axis of costs, and the figure.
type Cost = (&'static str, fn(&Figures, bool) -> f64);

/// Costs of a fit, in the order of [`Figures::on_front`].
const COSTS: [Cost; 3] = [
    ("time of the fit / s", |f, is_cpu| f.time(is_cpu)),
    ("file / MB", |f, _| f.file_bytes as f64 * 1e-6),
    ("device memory / MB", |f, _| f.device_peak_bytes as f64 * 1e-6),
];

/// Title of an axis of gains, and the figure, of which more is better.
type Gain = (&'static str, fn(&Figures) -> f64);

/// Gains of a fit.
const GAINS: [Gain; 2] =
    [("PSNR, worst between voxels / dB", |f| f.psnr_worst_db), ("− 99th percentile of |ΔHU|", |f| -f.p99_hu)];

impl Figures {
    /// Returns the time of the fit, seconds; on a CPU driver the CPU time of all cores, which other programs
    /// do not lengthen.
    fn time(&self, is_cpu: bool) -> f64 {
        self.core_seconds.filter(|_| is_cpu).unwrap_or(self.seconds)
    }

    fn of(measured: &Measured) -> Option<Self> {
        let Measured { row, record } = measured;
        let record = record.as_ref()?;
        let (last, cost, end) = (record.last?, record.cost?, record.end()?);
        let (errors, held_out) = (last.errors?, last.held_out?);
        let config = &row.job.config;
        Some(Figures {
            part: format!("{:?}", row.part).to_lowercase(),
            name: row.name.clone(),
            density_times: row.density_times,
            density: config.count.density,
            splats: end.splats,
            iterations: config.iterations,
            kernel: Kernel::name(config.kernel),
            storage: config.storage,
            offsets: config.offset_count(),
            psnr_worst_db: held_out.worst,
            psnr_mean_db: held_out.mean,
            psnr_grid_db: end.psnr(),
            rmse_hu: errors.rmse_hu,
            p99_hu: errors.p99_hu,
            soft_dice: last.soft_dice,
            seconds: cost.seconds,
            core_seconds: cost.core_seconds,
            setup_seconds: cost.setup_seconds,
            file_bytes: cost.file_bytes,
            device_peak_bytes: record.device_peak_bytes,
            on_front: [false; 3],
        })
    }
}

impl FitTradeReport {
    /// Returns the figures of all results, with their fronts.
    fn figures(&self) -> Vec<Figures> {
        let mut all: Vec<Figures> = self.rows.iter().filter_map(Figures::of).collect();
        for (k, (_, cost)) in COSTS.iter().enumerate() {
            let points: Vec<Point> =
                all.iter().map(|f| Point { cost: cost(f, self.is_cpu), gain: f.psnr_worst_db }).collect();
            for (figures, on) in all.iter_mut().zip(front(&points)) {
                figures.on_front[k] = on;
            }
        }
        all
    }

    /// Returns the table in Markdown, the fastest fit first.
    pub fn markdown(&self) -> String {
        let mut all = self.figures();
        all.sort_by(|a, b| a.time(self.is_cpu).total_cmp(&b.time(self.is_cpu)));
        let rows = all.iter().map(|f| {
            let on: Vec<&str> =
                ["time", "file", "memory"].into_iter().zip(f.on_front).filter(|r| r.1).map(|r| r.0).collect();
            vec![
                f.name.clone(),
                format!("{}", f.density_times),
                f.splats.to_string(),
                f.iterations.to_string(),
                format!("{:.2}", f.psnr_worst_db),
                format!("{:.2}", f.psnr_mean_db),
                format!("{:.2}", f.psnr_grid_db),
                format!("{:.1}", f.rmse_hu),
                format!("{:.0}", f.p99_hu),
                format!("{:.1}", f.seconds),
                f.core_seconds.map_or_else(|| "–".to_owned(), |s| format!("{s:.1}")),
                format!("{:.2}", f.file_bytes as f64 * 1e-6),
                format!("{:.1}", f.device_peak_bytes as f64 * 1e-6),
                on.join(", "),
            ]
        });
        let columns = vec![
            "fit",
            "density ×",
            "splats",
            "iterations",
            "between: worst, dB",
            "mean, dB",
            "on the grid, dB",
            "RMSE, HU",
            "99 % within, HU",
            "s",
            "core-s",
            "file, MB",
            "device, MB",
            "on the front of",
        ];
        Table { title: format!("{}; {}", self.title, self.device), columns, rows: rows.collect() }.markdown()
    }

    fn csv(&self) -> String {
        let mut out = String::from(
            "part,name,density_times,splats,iterations,kernel,storage,offsets,psnr_worst_db,psnr_mean_db,psnr_grid_db,\
             rmse_hu,p99_hu,soft_dice,seconds,core_seconds,setup_seconds,file_bytes,device_peak_bytes,\
             front_time,front_file,front_memory\n",
        );
        for f in self.figures() {
            let core = f.core_seconds.map(|s| format!("{s:.3}")).unwrap_or_default();
            let storage = serde_json::to_string(&f.storage).unwrap_or_default().replace('"', "");
            let [time, file, memory] = f.on_front;
            // Writing to a string cannot fail.
            let _ = writeln!(
                out,
                "{},{},{},{},{},{},{storage},{},{:.4},{:.4},{:.4},{:.4},{:.4},{:.5},{:.3},{core},{:.3},{},{},{time},{file},{memory}",
                f.part,
                f.name,
                f.density_times,
                f.splats,
                f.iterations,
                f.kernel,
                f.offsets,
                f.psnr_worst_db,
                f.psnr_mean_db,
                f.psnr_grid_db,
                f.rmse_hu,
                f.p99_hu,
                f.soft_dice,
                f.seconds,
                f.setup_seconds,
                f.file_bytes,
                f.device_peak_bytes
            );
        }
        out
    }

    fn json(&self) -> Result<String> {
        #[derive(Serialize)]
        struct All<'a> {
            title: &'a str,
            device: &'a str,
            is_cpu: bool,
            rows: Vec<Figures>,
        }
        let all = All { title: &self.title, device: &self.device, is_cpu: self.is_cpu, rows: self.figures() };
        bench::report::json(&all)
    }

    fn svg(&self) -> Result<String> {
        let all = self.figures();
        let mut panels = Vec::new();
        for (gain, of) in GAINS {
            for (k, (cost, figure)) in COSTS.iter().enumerate() {
                let unit = if k == 0 && self.is_cpu { "time of the fit / core-s" } else { cost };
                let point = |f: &Figures| Point { cost: figure(f, self.is_cpu), gain: of(f) };
                let series = |label: &str, keep: &dyn Fn(&Figures) -> bool| Series {
                    label: label.to_owned(),
                    points: all.iter().filter(|f| keep(f)).map(point).collect(),
                };
                let part = |f: &Figures, part: Part| f.part == format!("{part:?}").to_lowercase();
                let mut names: Vec<String> =
                    all.iter().filter(|f| part(f, Part::Grid)).map(|f| f.name.clone()).collect();
                names.dedup();
                let mut shown: Vec<Series> = names
                    .iter()
                    .map(|name| series(name, &|f| part(f, Part::Grid) && f.name == *name))
                    .collect();
                shown.push(series("one thing other", &|f| part(f, Part::Spokes)));
                shown.push(series("--quality", &|f| part(f, Part::Qualities)));
                let named = all.iter().filter(|f| part(f, Part::Qualities));
                panels.push(Panel {
                    title: String::new(),
                    cost: unit.to_owned(),
                    gain: gain.to_owned(),
                    series: shown,
                    named: named.map(|f| (f.name.clone(), point(f))).collect(),
                });
            }
        }
        plot::svg(&self.title, &panels, COSTS.len())
    }

    /// Writes all reports.
    pub fn write(&self, store: &Store) -> Result<()> {
        store.report("fit.md", &self.markdown())?;
        store.report("fit.csv", &self.csv())?;
        store.report("fit.json", &self.json()?)?;
        store.report("fit.svg", &self.svg()?)
    }
}
