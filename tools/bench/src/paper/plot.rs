//! PSNR over the time of the fit, one panel a case, both profiles (SVG).

use engine::{Error, Kind, Result};
use plotters::prelude::*;

use super::plan::Row;
use super::published::CASES;
use super::results::Results;
use super::runs::Record;

const INK: RGBColor = RGBColor(51, 51, 51);
const GRID: RGBColor = RGBColor(228, 228, 228);
/// From the fewest splats of a case to the most.
const PAPER: [RGBColor; 5] = [
    RGBColor(244, 178, 120),
    RGBColor(232, 142, 72),
    RGBColor(210, 105, 30),
    RGBColor(165, 75, 15),
    RGBColor(110, 48, 8),
];
const OURS: [RGBColor; 5] = [
    RGBColor(140, 195, 225),
    RGBColor(85, 160, 205),
    RGBColor(30, 120, 180),
    RGBColor(12, 85, 140),
    RGBColor(5, 55, 95),
];
const PANEL: (u32, u32) = (620, 420);

/// A curve.
struct Line {
    label: String,
    colour: RGBColor,
    points: Vec<(f64, f64)>,
}

/// One case.
struct Panel {
    title: String,
    lines: Vec<Line>,
}

/// The curves of all finished runs of Tables 2 and 6; cases without any have no panel.
pub fn svg(rows: &[Row], results: &Results) -> Result<String> {
    let panels: Vec<_> = (0..CASES.len())
        .map(|case| panel(case, rows, results))
        .filter(|panel| !panel.lines.is_empty())
        .collect();
    let mut text = String::new();
    draw(&mut text, &panels)
        .map_err(|e| Error::new(Kind::Internal, "VGS-BEN-003", format!("drawing the curves failed: {e}")))?;
    Ok(text)
}

fn panel(case: usize, rows: &[Row], results: &Results) -> Panel {
    let of_case = || rows.iter().filter(|row| row.case == case);
    let mut lines = Vec::new();
    for (profile, colours) in [("--profile paper", &PAPER), ("default", &OURS)] {
        for (i, row) in of_case().enumerate() {
            let job = if profile == "default" { &row.ours } else { &row.paper };
            let Some(record) = results.of(job) else { continue };
            lines.push(Line {
                label: format!("{profile}, {} splats", record.job.config.splats),
                colour: colours[i.min(colours.len() - 1)],
                points: points(record),
            });
        }
    }
    Panel {
        title: format!(
            "{} {}: {} {}",
            CASES[case].name, CASES[case].mask, CASES[case].folder, CASES[case].file
        ),
        lines,
    }
}

fn points(record: &Record) -> Vec<(f64, f64)> {
    record.points.iter().map(|p| (p.seconds, p.psnr())).filter(|(_, y)| y.is_finite()).collect()
}

fn draw(out: &mut String, panels: &[Panel]) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let rows = panels.len().div_ceil(2).max(1);
    let size = (PANEL.0 * 2, PANEL.1 * rows as u32 + 40);
    let root = SVGBackend::with_string(out, size).into_drawing_area();
    root.fill(&WHITE)?;
    let title = "PSNR on the grid, all splats, over the range of the volume";
    let area = root.titled(title, ("sans-serif", 20).into_font().color(&INK))?;
    for (area, panel) in area.split_evenly((rows, 2)).iter().zip(panels) {
        draw_panel(area, panel)?;
    }
    root.present()?;
    Ok(())
}

fn draw_panel<DB: DrawingBackend>(
    area: &DrawingArea<DB, plotters::coord::Shift>,
    panel: &Panel,
) -> std::result::Result<(), Box<dyn std::error::Error>>
where
    DB::ErrorType: 'static,
{
    let all = || panel.lines.iter().flat_map(|line| &line.points);
    let last = all().map(|p| p.0).fold(1.0, f64::max);
    let low = all().map(|p| p.1).fold(f64::INFINITY, f64::min);
    let high = all().map(|p| p.1).fold(f64::NEG_INFINITY, f64::max);
    let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
    let margin = (0.08 * (high - low)).max(0.1);
    let font = |size: i32| ("sans-serif", size).into_font().color(&INK);
    let mut chart = ChartBuilder::on(area)
        .caption(&panel.title, font(15))
        .margin(8)
        .margin_right(20)
        .x_label_area_size(40)
        .y_label_area_size(52)
        .build_cartesian_2d(0.0..last, low - margin..high + margin)?;
    chart
        .configure_mesh()
        .x_desc("time of the iterations / s")
        .y_desc("PSNR / dB")
        .x_labels(7)
        .y_labels(7)
        .x_label_formatter(&|x| if last < 10.0 { format!("{x:.1}") } else { format!("{x:.0}") })
        .y_label_formatter(&|y| format!("{y:.1}"))
        .axis_desc_style(font(13))
        .label_style(font(12))
        .axis_style(INK)
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .draw()?;
    for line in &panel.lines {
        let style = line.colour.stroke_width(2);
        chart
            .draw_series(LineSeries::new(line.points.iter().copied(), style))?
            .label(&line.label)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], style));
    }
    // Between the profiles, which are far apart.
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::MiddleRight)
        .background_style(WHITE.mix(0.8))
        .border_style(GRID)
        .label_font(font(11))
        .draw()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::job::tests::job;
    use crate::paper::plan::Count;
    use crate::paper::published;
    use crate::paper::runs::tests::record;

    #[test]
    fn curves_of_finished_runs_are_drawn_and_labelled() {
        let row = |case: usize, splats: usize| Row {
            case,
            voxels: 1.0,
            splats: Count { paper: 100_000, ours: splats },
            subset: Count { paper: 1, ours: 1 },
            training: published::training_of(case, 100_000),
            paper: job(splats),
            ours: job(splats + 1),
        };
        let rows = [row(0, 10), row(0, 20), row(3, 30)];
        let mut results = Results::default();
        assert!(svg(&rows, &results).expect("an empty plot").contains("</svg>"));
        results.add(record(job(10), &[0.1, 0.01]));
        results.add(record(job(21), &[0.1, 0.0]));
        let text = svg(&rows, &results).expect("a plot");
        assert!(text.contains("--profile paper, 10 splats") && text.contains("default, 21 splats"));
        assert!(text.contains("Case 1 TS") && !text.contains("Case 6"), "only cases with a finished run");
        assert!(!text.contains("NaN") && !text.contains("inf"), "an exact fit is left out");
    }
}
