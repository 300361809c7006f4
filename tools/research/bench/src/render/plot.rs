//! Plots PSNR over the cost of a frame and over the distance of slabs (SVG), a panel for each case and
//! transfer function.

use engine::Result;
use plotters::prelude::*;

use super::config::Section;
use super::figures::thousands;
use super::record::{Comparison, Role};
use super::results::Results;
use crate::plot::{Area, Axis, COLOURS, Drawn, axes, legend, line, sheet, span};

const PANEL: [u32; 2] = [560, 400];

/// Points of a mode with one classification, by growing x.
struct Line {
    label: String,
    points: Vec<(f64, f64)>,
}

/// Plot of one case with one transfer function.
struct Panel {
    title: String,
    lines: Vec<Line>,
}

/// The x axis of the panels.
struct Over {
    title: String,
    /// True if x values are decimal logarithms of what the ticks show.
    logarithmic: bool,
}

/// Plots the PSNR over the median cost of a frame, for all modes of `renderer-error`.
pub fn cost(report: &Results<'_>) -> Result<String> {
    let is_cpu = report.device.is_cpu;
    let panels = panels(report, |row| (row.cost(is_cpu) > 0.0).then(|| row.cost(is_cpu).log10()));
    let over = Over { title: format!("{} a frame", report.device.unit()), logarithmic: true };
    svg("PSNR against mode exact, over what a frame costs", &panels, &over)
}

/// Plots the PSNR over the distance of slabs, for all renderings with mode `slab`.
pub fn slab_distance(report: &Results<'_>) -> Result<String> {
    let panels = panels(report, |row| (row.mode == "slab").then_some(row.step));
    let over = Over { title: "distance of slabs / standard deviations".into(), logarithmic: false };
    svg("PSNR against mode exact, over the distance of slabs", &panels, &over)
}

fn panels(report: &Results<'_>, x: impl Fn(&Comparison) -> Option<f64>) -> Vec<Panel> {
    let mut panels = Vec::new();
    for (unit, record) in report.units(Section::RendererError) {
        for transfer in &unit.transfers {
            let rows = record
                .comparisons
                .iter()
                .filter(|row| row.role == Role::Mode && row.transfer == transfer.name);
            let mut lines: Vec<Line> = Vec::new();
            for row in rows.filter(|row| row.psnr().is_finite()) {
                let Some(x) = x(row) else { continue };
                let label = match row.integrated {
                    None => row.mode.clone(),
                    Some(false) => format!("{}, point", row.mode),
                    Some(true) => format!("{}, integrated", row.mode),
                };
                match lines.iter_mut().find(|line| line.label == label) {
                    Some(line) => line.points.push((x, row.psnr())),
                    None => lines.push(Line { label, points: vec![(x, row.psnr())] }),
                }
            }
            lines.iter_mut().for_each(|line| line.points.sort_by(|a, b| a.0.total_cmp(&b.0)));
            if !lines.is_empty() {
                let title = format!(
                    "{}, {} splats: {}",
                    unit.case.name,
                    thousands(record.splats as u64),
                    transfer.name
                );
                panels.push(Panel { title, lines });
            }
        }
    }
    panels
}

fn svg(title: &str, panels: &[Panel], over: &Over) -> Result<String> {
    sheet(title, panels.len(), 2, PANEL, |n, area| panels[n].draw(area, over))
}

impl Panel {
    fn draw(&self, area: &Area<'_>, over: &Over) -> Drawn {
        let all = || self.lines.iter().flat_map(|line| &line.points);
        let x = Axis {
            title: &over.title,
            range: span(all().map(|p| p.0), 0.05),
            tick: &|&x| if over.logarithmic { format!("{:.0}", 10f64.powf(x)) } else { format!("{x:.2}") },
        };
        let y =
            Axis { title: "PSNR / dB", range: span(all().map(|p| p.1), 1.0), tick: &|y| format!("{y:.0}") };
        let mut chart = axes(area, &self.title, x, y)?;
        for (Line { label, points }, colour) in self.lines.iter().zip(COLOURS.iter().cycle()) {
            line(&mut chart, label, *colour, points.iter().copied())?;
            chart.draw_series(points.iter().map(|&point| Circle::new(point, 3, colour.filled())))?;
        }
        legend(&mut chart, SeriesLabelPosition::UpperRight)
    }
}
