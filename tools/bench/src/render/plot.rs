//! What accuracy costs, and how it falls as slabs grow, as pictures (SVG): a panel for each case and transfer function.

use engine::{Error, Kind, Result};
use plotters::prelude::*;

use super::config::Section;
use super::record::{Comparison, Role};
use super::report::{Report, thousands};

const INK: RGBColor = RGBColor(51, 51, 51);
const GRID: RGBColor = RGBColor(228, 228, 228);
const COLOURS: [RGBColor; 5] = [
    RGBColor(30, 120, 180),
    RGBColor(210, 105, 30),
    RGBColor(60, 140, 70),
    RGBColor(150, 80, 160),
    RGBColor(120, 120, 120),
];
const PANEL: (u32, u32) = (560, 400);

/// A mode in one way to classify, by growing x.
struct Line {
    label: String,
    points: Vec<(f64, f64)>,
}

/// A case in a transfer function.
struct Panel {
    title: String,
    lines: Vec<Line>,
}

/// An x axis.
struct Axis {
    title: String,
    /// Whether x are decimal logarithms of what is told.
    logarithmic: bool,
}

/// PSNR over the median cost of a frame, of all modes of `renderer-error`.
pub fn cost(report: &Report<'_>) -> Result<String> {
    let is_cpu = report.device.is_cpu;
    let panels = panels(report, |row| (row.cost(is_cpu) > 0.0).then(|| row.cost(is_cpu).log10()));
    let axis = Axis { title: format!("{} a frame", report.device.unit()), logarithmic: true };
    svg("PSNR against mode exact, over what a frame costs", &panels, &axis)
}

/// PSNR over the distance of slabs, of all that are of mode `slab`.
pub fn ladder(report: &Report<'_>) -> Result<String> {
    let panels = panels(report, |row| (row.mode == "slab").then_some(row.step));
    let axis = Axis { title: "distance of slabs / standard deviations".into(), logarithmic: false };
    svg("PSNR against mode exact, over the distance of slabs", &panels, &axis)
}

fn panels(report: &Report<'_>, x: impl Fn(&Comparison) -> Option<f64>) -> Vec<Panel> {
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

fn svg(title: &str, panels: &[Panel], axis: &Axis) -> Result<String> {
    let mut text = String::new();
    draw(&mut text, title, panels, axis)
        .map_err(|e| Error::new(Kind::Internal, "VGS-BEN-025", format!("drawing a plot failed: {e}")))?;
    Ok(text)
}

fn draw(
    out: &mut String,
    title: &str,
    panels: &[Panel],
    axis: &Axis,
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let rows = panels.len().div_ceil(2).max(1);
    let root = SVGBackend::with_string(out, (PANEL.0 * 2, PANEL.1 * rows as u32 + 40)).into_drawing_area();
    root.fill(&WHITE)?;
    let area = root.titled(title, ("sans-serif", 20).into_font().color(&INK))?;
    for (area, panel) in area.split_evenly((rows, 2)).iter().zip(panels) {
        draw_panel(area, panel, axis)?;
    }
    root.present()?;
    Ok(())
}

fn draw_panel<DB: DrawingBackend>(
    area: &DrawingArea<DB, plotters::coord::Shift>,
    panel: &Panel,
    axis: &Axis,
) -> std::result::Result<(), Box<dyn std::error::Error>>
where
    DB::ErrorType: 'static,
{
    let all = || panel.lines.iter().flat_map(|line| &line.points);
    let range = |of: fn(&(f64, f64)) -> f64, least: f64| {
        let low = all().map(of).fold(f64::INFINITY, f64::min);
        let high = all().map(of).fold(f64::NEG_INFINITY, f64::max);
        let margin = (0.08 * (high - low)).max(least);
        low - margin..high + margin
    };
    let font = |size: i32| ("sans-serif", size).into_font().color(&INK);
    let mut chart = ChartBuilder::on(area)
        .caption(&panel.title, font(15))
        .margin(8)
        .margin_right(20)
        .x_label_area_size(40)
        .y_label_area_size(52)
        .build_cartesian_2d(range(|p| p.0, 0.05), range(|p| p.1, 1.0))?;
    chart
        .configure_mesh()
        .x_desc(&axis.title)
        .y_desc("PSNR / dB")
        .x_labels(7)
        .y_labels(7)
        .x_label_formatter(&|&x| {
            if axis.logarithmic { format!("{:.0}", 10f64.powf(x)) } else { format!("{x:.2}") }
        })
        .y_label_formatter(&|y| format!("{y:.0}"))
        .axis_desc_style(font(13))
        .label_style(font(12))
        .axis_style(INK)
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .draw()?;
    for (line, colour) in panel.lines.iter().zip(COLOURS.iter().cycle()) {
        let style = colour.stroke_width(2);
        chart
            .draw_series(LineSeries::new(line.points.iter().copied(), style))?
            .label(&line.label)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], style));
        chart.draw_series(line.points.iter().map(|&point| Circle::new(point, 3, colour.filled())))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .background_style(WHITE.mix(0.8))
        .border_style(GRID)
        .label_font(font(11))
        .draw()?;
    Ok(())
}
