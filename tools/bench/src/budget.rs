//! The frame-budget controller on made-up GPUs: traces as a plot, and how many frames are late.

use std::path::{Path, PathBuf};

use clap::Args;
use engine::budget::budget_ms;
use engine::budget::simulation::{BEHAVIOURS, Frame, trace};
use engine::render::{LADDER, ladder};
use engine::{Error, Kind, Result, output};
use plotters::prelude::*;

use crate::report::{Outputs, Table};

/// What the best rung takes, in units of the budget.
const EXCESS: f64 = 1.7;
/// Top of the axis of times, in units of the budget.
const TOP: f64 = 2.6;
const INK: RGBColor = RGBColor(51, 51, 51);
const GRID: RGBColor = RGBColor(228, 228, 228);
const TIME: RGBColor = RGBColor(30, 120, 180);
const LATE: RGBColor = RGBColor(200, 60, 40);
const RUNG: RGBColor = RGBColor(210, 150, 60);

/// The frame-budget controller on simulated GPUs
#[derive(Args)]
pub struct Arguments {
    /// Frames a second of the display
    #[arg(long, default_value_t = 90.0)]
    rate: f64,
    /// Frames
    #[arg(long, default_value_t = 3000)]
    frames: usize,
    /// Writes the traces as a plot (SVG)
    #[arg(long, value_name = "FILE")]
    plot: Option<PathBuf>,
    #[command(flatten)]
    outputs: Outputs,
}

/// Runs the simulations.
pub fn run(arguments: &Arguments) -> Result<()> {
    let budget = budget_ms(arguments.rate);
    let ladder = ladder(&LADDER);
    let traces: Vec<(&str, Vec<Frame>)> = BEHAVIOURS
        .iter()
        .map(|&(name, behaviour)| {
            (name, trace(&ladder, behaviour, EXCESS * budget, budget, arguments.frames))
        })
        .collect();
    let rows = traces.iter().map(|(name, frames)| {
        let mut times: Vec<f64> = frames.iter().map(|f| f.gpu_ms).collect();
        times.sort_by(f64::total_cmp);
        let part = |p: f64| times[((times.len() - 1) as f64 * p).round() as usize] / budget * 100.0;
        let late = times.iter().filter(|&&ms| ms > budget).count();
        let mean = frames.iter().map(|f| f.rung as f64).sum::<f64>() / frames.len() as f64;
        let changes = frames.windows(2).filter(|pair| pair[0].rung != pair[1].rung).count();
        vec![
            (*name).to_owned(),
            late.to_string(),
            format!("{:.0}", part(0.5)),
            format!("{:.0}", part(0.99)),
            format!("{mean:.1}"),
            changes.to_string(),
        ]
    });
    let title = format!(
        "The controller on simulated GPUs: {} frames at {} Hz, a budget of {budget:.1} ms, of which the best rung takes \
         {EXCESS}",
        arguments.frames, arguments.rate
    );
    let columns =
        vec!["GPU", "late frames", "median / % of budget", "p99 / % of budget", "mean rung", "changes"];
    let table = Table { title, columns, rows: rows.collect() };
    if let Some(path) = &arguments.plot {
        let parts: Vec<_> = traces
            .iter()
            .map(|(name, frames)| {
                ((*name).to_owned(), frames.iter().map(|f| (f.rung, f.gpu_ms / budget)).collect())
            })
            .collect();
        write_plot(path, &parts, arguments.outputs.force)?;
    }
    arguments.outputs.finish(&[table])
}

/// A frame's rung, and its time as a part of the budget.
type Point = (usize, f64);

/// Writes frame times, and the rungs below them, for each trace by its name.
pub fn write_plot(path: &Path, traces: &[(String, Vec<Point>)], force: bool) -> Result<()> {
    let svg = svg(traces)
        .map_err(|e| Error::new(Kind::Internal, "VGS-BEN-026", format!("drawing a plot failed: {e}")))?;
    output::write_atomic(path, force, |w| w.write_all(svg.as_bytes()))
}

fn svg(traces: &[(String, Vec<Point>)]) -> std::result::Result<String, Box<dyn std::error::Error>> {
    let mut text = String::new();
    let root = SVGBackend::with_string(&mut text, (1000, 200 * traces.len() as u32)).into_drawing_area();
    root.fill(&WHITE)?;
    for (area, (name, frames)) in root.split_evenly((traces.len(), 1)).iter().zip(traces) {
        let font = |size: i32| ("sans-serif", size).into_font().color(&INK);
        let most = LADDER.len() as f64;
        let mut chart = ChartBuilder::on(area)
            .caption(name, font(15))
            .margin(6)
            .x_label_area_size(24)
            .y_label_area_size(44)
            .right_y_label_area_size(36)
            .build_cartesian_2d(0.0..frames.len() as f64, 0.0..TOP)?
            .set_secondary_coord(0.0..frames.len() as f64, most..0.0);
        chart
            .configure_mesh()
            .y_desc("of the budget")
            .x_labels(10)
            .y_labels(6)
            .axis_desc_style(font(12))
            .label_style(font(11))
            .bold_line_style(GRID)
            .light_line_style(TRANSPARENT)
            .draw()?;
        chart
            .configure_secondary_axes()
            .y_desc("rung")
            .label_style(font(11))
            .axis_desc_style(font(12))
            .draw()?;
        let rungs = frames.iter().enumerate().map(|(n, f)| (n as f64, f.0 as f64));
        chart.draw_secondary_series(LineSeries::new(rungs, RUNG.stroke_width(2)))?;
        let time = |(n, f): (usize, &Point)| (n as f64, f.1.min(TOP));
        chart.draw_series(LineSeries::new(frames.iter().enumerate().map(time), TIME))?;
        let late = frames.iter().enumerate().filter(|(_, f)| f.1 > 1.0);
        chart.draw_series(late.map(time).map(|at| Circle::new(at, 2, LATE.filled())))?;
        chart.draw_series(LineSeries::new([(0.0, 1.0), (frames.len() as f64, 1.0)], INK))?;
    }
    root.present()?;
    drop(root);
    Ok(text)
}
