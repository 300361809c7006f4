//! Measures a session in a simulated headset whose head follows a script in real time: how regular frames
//! are, what they cost, which quality levels they take, and how old their poses are. The table has one row
//! for each number of splats and each budget.

use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;
use engine::gpu::Gpu;
use engine::render::{Look, Scene, SplatKind, quality_levels};
use engine::splat::SplatSet;
use engine::{Result, transfer};
use xr_app::headset::simulated::{Script, Simulated};
use xr_app::statistics::{Distribution, Sample, SessionReport};
use xr_app::viewer::{Options, Viewer};

use crate::budget::{Trace, write_plot};
use crate::cost::mean;
use crate::report::{Outputs, Table};
use crate::scene::splats_by_importance;

/// Number of frames at the start that do not count, while the controller finds its level.
const SETTLING: usize = 60;

/// Sessions in a simulated headset
#[derive(Args)]
pub struct XrArguments {
    /// The splats (PLY)
    splats: PathBuf,
    /// Numbers of splats, of which the most important are taken
    #[arg(long, value_delimiter = ',', default_values_t = [100_000, 250_000])]
    counts: Vec<usize>,
    /// Budgets, ms; the display shows frames in such a period
    #[arg(long, value_delimiter = ',', default_values_t = [50.0, 200.0])]
    budgets: Vec<f64>,
    /// Frames of a session
    #[arg(long, default_value_t = 300)]
    frames: u64,
    /// Width and height of an eye's picture, pixels
    #[arg(long, num_args = 2, value_names = ["WIDTH", "HEIGHT"], default_values_t = [160, 160])]
    size: Vec<u32>,
    /// Transfer function
    #[arg(long, default_value = "CT-Bone")]
    tf: String,
    /// Writes frame times, levels, and a histogram of motion to photon as a plot (SVG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    outputs: Outputs,
}

/// Runs the sessions and writes the table and, if asked to, the plot.
pub fn run(gpu: &Gpu, arguments: &XrArguments) -> Result<()> {
    let set = splats_by_importance(&arguments.splats)?;
    let mut reports = Vec::new();
    for &count in &arguments.counts {
        let mut part = set.clone();
        part.truncate(count);
        for &budget in &arguments.budgets {
            reports.push((part.splats.len(), budget, session(gpu, &part, budget, arguments)?));
        }
    }
    let rows = reports.iter().map(|(splats, budget, report)| row(*splats, *budget, report)).collect();
    let [width, height] = [arguments.size[0], arguments.size[1]];
    let title = format!(
        "Sessions in a simulated headset: {}, {}, two eyes of {width}x{height}, {} frames, \
         of which the first {SETTLING} do not count for device times and quality levels; {} ({})",
        arguments.splats.file_name().unwrap_or_default().display(),
        arguments.tf,
        arguments.frames,
        gpu.description().name,
        gpu.description().driver
    );
    let columns = vec![
        "splats",
        "period / ms",
        "interval p50 / p99 / ms",
        "periods without a frame",
        "device p50 / p99 / ms",
        "over budget / %",
        "mean level",
        "changes of level",
        "motion to photon p5 / p50 / p95 / p99 / max / ms",
    ];
    if let Some(path) = &arguments.plot {
        let traces: Vec<_> = reports
            .iter()
            .map(|(splats, budget, report)| {
                let frames = report.samples.iter().map(|s| (s.level, s.gpu_ms / s.budget_ms)).collect();
                let name = format!("{splats} splats, a frame each {budget} ms");
                Trace { name, frames, latency_ms: report.latency_histogram_ms.clone() }
            })
            .collect();
        write_plot(path, &traces, arguments.outputs.force)?;
    }
    arguments.outputs.finish_with(&[Table { title, columns, rows }], &reports)
}

fn session(gpu: &Gpu, set: &SplatSet, budget: f64, arguments: &XrArguments) -> Result<SessionReport> {
    let range = set.intensity_range().unwrap_or_default();
    let look = Look::new(transfer::load(&arguments.tf, range)?);
    let scene = Scene::new(gpu, Some(set), None, &look)?;
    let script = Script {
        eye_size: [arguments.size[0], arguments.size[1]],
        rate_hz: 1000.0 / budget,
        frames: Some(arguments.frames),
        ..Script::default()
    };
    let mut headset = Simulated::new(gpu, script)?;
    let options = Options::of_levels(quality_levels(SplatKind::of(set)).to_vec());
    let mut viewer = Viewer::new(gpu, scene, &headset, options)?;
    viewer.run(&mut headset, &AtomicBool::new(false))?;
    Ok(viewer.report(&headset))
}

fn row(splats: usize, period: f64, report: &SessionReport) -> Vec<String> {
    let two =
        |d: Option<Distribution>| d.map_or("-".to_owned(), |d| format!("{:.0} / {:.0}", d.median, d.p99));
    let settled = &report.samples[SETTLING.min(report.samples.len())..];
    // No frames have no mean.
    let one = |values: Vec<f64>| mean(&values).map_or("-".to_owned(), |value| format!("{value:.1}"));
    let late = |s: &Sample| if s.gpu_ms > s.budget_ms { 100.0 } else { 0.0 };
    let changes = settled.windows(2).filter(|pair| pair[0].level != pair[1].level).count();
    vec![
        splats.to_string(),
        format!("{period:.0}"),
        two(report.interval_ms),
        report.missed.to_string(),
        two(Distribution::of(settled.iter().map(|s| s.gpu_ms))),
        one(settled.iter().map(late).collect()),
        one(settled.iter().map(|s| s.level as f64).collect()),
        changes.to_string(),
        report.latency_ms.map_or("-".to_owned(), |d| {
            [d.p5, d.median, d.p95, d.p99, d.most].map(|ms| format!("{ms:.0}")).join(" / ")
        }),
    ]
}
