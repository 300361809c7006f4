//! Runs the frame-budget controller on simulated GPUs, counts late frames and plots the traces.

use std::path::{Path, PathBuf};

use clap::Args;
use engine::budget::budget_ms;
use engine::budget::simulation::{BEHAVIOURS, Frame, trace};
use engine::render::{SplatKind, level_costs, quality_levels};
use engine::{Error, Kind, Result, output};
use plotters::prelude::*;
use xr_app::statistics::Histogram;

use crate::plot::{Area, Axis, Drawn, GRID, INK, axes, font};
use crate::report::{Outputs, Table};

/// Time of a frame at the best quality level, in units of the budget.
const EXCESS: f64 = 1.7;
/// Top of the axis of times, in units of the budget.
const TOP: f64 = 2.6;
const TIME: RGBColor = RGBColor(30, 120, 180);
const LATE: RGBColor = RGBColor(200, 60, 40);
const LEVEL: RGBColor = RGBColor(210, 150, 60);

/// The frame-budget controller on simulated GPUs
#[derive(Args)]
pub struct BudgetArguments {
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

/// Simulates each behaviour of a GPU, prints a row for each and, if asked to, plots the traces.
pub fn run(arguments: &BudgetArguments) -> Result<()> {
    let budget = budget_ms(arguments.rate);
    let costs = level_costs(quality_levels(SplatKind::Field));
    let traces: Vec<(&str, Vec<Frame>)> = BEHAVIOURS
        .iter()
        .map(|&(name, behaviour)| (name, trace(&costs, behaviour, EXCESS * budget, budget, arguments.frames)))
        .collect();
    let rows = traces.iter().map(|(name, frames)| {
        let mut times: Vec<f64> = frames.iter().map(|f| f.gpu_ms).collect();
        times.sort_by(f64::total_cmp);
        let part = |p: f64| times[((times.len() - 1) as f64 * p).round() as usize] / budget * 100.0;
        let late = times.iter().filter(|&&ms| ms > budget).count();
        let mean = frames.iter().map(|f| f.level as f64).sum::<f64>() / frames.len() as f64;
        let changes = frames.windows(2).filter(|pair| pair[0].level != pair[1].level).count();
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
        "The controller on simulated GPUs: {} frames at {} Hz, a budget of {budget:.1} ms, \
         of which the best level takes {EXCESS}",
        arguments.frames, arguments.rate
    );
    let columns =
        vec!["GPU", "late frames", "median / % of budget", "p99 / % of budget", "mean level", "changes"];
    let table = Table { title, columns, rows: rows.collect() };
    if let Some(path) = &arguments.plot {
        let parts: Vec<_> = traces
            .iter()
            .map(|(name, frames)| {
                let frames = frames.iter().map(|f| (f.level, f.gpu_ms / budget)).collect();
                Trace { name: (*name).to_owned(), frames, latency_ms: None }
            })
            .collect();
        write_plot(path, &parts, arguments.outputs.force)?;
    }
    arguments.outputs.finish(&[table])
}

/// Frames of one session, to be plotted.
pub struct Trace {
    /// Caption of the plot.
    pub name: String,
    /// Quality level of each frame, and its time as a part of the budget.
    pub frames: Vec<(usize, f64)>,
    /// Histogram of motion-to-photon latency, ms, if it was measured.
    pub latency_ms: Option<Histogram>,
}

/// Width of the plot, pixels. If a histogram is drawn beside the frames, these get the first `FRAMES_WIDTH`
/// pixels.
const WIDTH: u32 = 1000;
const FRAMES_WIDTH: i32 = 690;

/// Writes a plot (SVG) to `path`: for each trace the frame times with the quality levels below them, and
/// beside them the histogram of motion-to-photon latency.
pub fn write_plot(path: &Path, traces: &[Trace], force: bool) -> Result<()> {
    let mut svg = String::new();
    draw(&mut svg, traces)
        .map_err(|e| Error::new(Kind::Internal, "VGS-BEN-026", format!("drawing a plot failed: {e}")))?;
    output::write_atomic(path, force, |w| w.write_all(svg.as_bytes()))
}

fn draw(svg: &mut String, traces: &[Trace]) -> Drawn {
    let root = SVGBackend::with_string(svg, (WIDTH, 200 * traces.len() as u32)).into_drawing_area();
    root.fill(&WHITE)?;
    for (area, trace) in root.split_evenly((traces.len(), 1)).iter().zip(traces) {
        match &trace.latency_ms {
            None => draw_frames(area, trace)?,
            Some(latency_ms) => {
                let (left, right) = area.split_horizontally(FRAMES_WIDTH);
                draw_frames(&left, trace)?;
                draw_latency(&right, latency_ms)?;
            }
        }
    }
    Ok(root.present()?)
}

fn draw_frames(area: &Area<'_>, trace: &Trace) -> Drawn {
    let (frames, most) = (&trace.frames, quality_levels(SplatKind::Field).len() as f64);
    let mut chart = ChartBuilder::on(area)
        .caption(&trace.name, font(15))
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
        .y_desc("quality level")
        .label_style(font(11))
        .axis_desc_style(font(12))
        .draw()?;
    let levels = frames.iter().enumerate().map(|(n, f)| (n as f64, f.0 as f64));
    chart.draw_secondary_series(LineSeries::new(levels, LEVEL.stroke_width(2)))?;
    let time = |(n, f): (usize, &(usize, f64))| (n as f64, f.1.min(TOP));
    chart.draw_series(LineSeries::new(frames.iter().enumerate().map(time), TIME))?;
    let late = frames.iter().enumerate().filter(|(_, f)| f.1 > 1.0);
    chart.draw_series(late.map(time).map(|at| Circle::new(at, 2, LATE.filled())))?;
    chart.draw_series(LineSeries::new([(0.0, 1.0), (frames.len() as f64, 1.0)], INK))?;
    Ok(())
}

fn draw_latency(area: &Area<'_>, latency_ms: &Histogram) -> Drawn {
    let Histogram { from, width, counts } = latency_ms;
    let end = |bin: usize| from + width * bin as f64;
    let most = counts.iter().copied().max().unwrap_or(0) as f64;
    // The axis has a bin's width to spare on either side, so that a single bin looks like a bar and not like
    // a wall.
    let x = Axis {
        title: &format!("ms, in bins of {width}"),
        range: from - width..end(counts.len() + 1),
        tick: &|x| format!("{:.1$}", x, usize::from(*width < 1.0)),
    };
    let y = Axis { title: "frames", range: 0.0..1.1 * most, tick: &|y| format!("{y:.0}") };
    let mut chart = axes(area, "motion to photon", x, y)?;
    let bars = counts.iter().enumerate().filter(|(_, count)| **count > 0);
    chart.draw_series(bars.map(|(bin, &count)| {
        Rectangle::new([(end(bin), 0.0), (end(bin + 1), count as f64)], TIME.filled())
    }))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plot_has_a_bar_for_each_bin_that_holds_something() {
        let latency_ms = Histogram { from: 20.0, width: 2.0, counts: vec![3, 0, 5] };
        let trace =
            |latency_ms| Trace { name: "a session".into(), frames: vec![(0, 0.5), (1, 1.2)], latency_ms };
        let drawn = |trace| {
            let mut svg = String::new();
            draw(&mut svg, &[trace]).expect("a plot");
            svg
        };
        let (with, without) = (drawn(trace(Some(latency_ms))), drawn(trace(None)));
        let bars = |svg: &str| svg.matches("<rect").count();
        assert_eq!(bars(&with), bars(&without) + 2);
        assert!(with.contains("ms, in bins of 2") && !without.contains("motion to photon"));
    }
}
