//! Plots PSNR over the time of the fit, one panel per case, for both profiles (SVG).

use engine::Result;
use plotters::prelude::*;

use super::plan::TableRow;
use super::published::CASES;
use super::results::Results;
use super::runs::Record;
use bench::plot::{Area, Axis, Drawn, axes, legend, line, sheet, span};

/// Colours of `--profile paper`, from the fewest splats of a case to the most.
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
const PANEL: [u32; 2] = [620, 420];

/// One curve.
struct Line {
    label: String,
    colour: RGBColor,
    points: Vec<(f64, f64)>,
}

/// Curves of one case.
struct Panel {
    title: String,
    lines: Vec<Line>,
}

/// Plots all finished runs of Tables 2 and 6 as SVG; cases without any have no panel.
pub fn svg(rows: &[TableRow], results: &Results) -> Result<String> {
    let panels: Vec<_> = (0..CASES.len())
        .map(|case| panel(case, rows, results))
        .filter(|panel| !panel.lines.is_empty())
        .collect();
    let title = "PSNR on the grid, all splats, over the range of the volume";
    sheet(title, panels.len(), 2, PANEL, |n, area| panels[n].draw(area))
}

fn panel(case: usize, rows: &[TableRow], results: &Results) -> Panel {
    let of_case = || rows.iter().filter(|row| row.case == case);
    let mut lines = Vec::new();
    for (profile, colours) in [("--profile paper", &PAPER), ("default", &OURS)] {
        for (i, row) in of_case().enumerate() {
            let job = if profile == "default" { &row.ours } else { &row.paper };
            let Some(record) = results.of(job) else { continue };
            lines.push(Line {
                label: format!("{profile}, {} splats", record.job.config.count.splats),
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
    let cores = record.cores();
    record.points.iter().map(|p| (cores * p.seconds, p.psnr())).filter(|(_, y)| y.is_finite()).collect()
}

impl Panel {
    fn draw(&self, area: &Area<'_>) -> Drawn {
        let all = || self.lines.iter().flat_map(|line| &line.points);
        let last = all().map(|p| p.0).fold(1.0, f64::max);
        let x = Axis {
            title: "CPU time of the iterations / core-s",
            range: 0.0..last,
            tick: &|x| if last < 10.0 { format!("{x:.1}") } else { format!("{x:.0}") },
        };
        let y =
            Axis { title: "PSNR / dB", range: span(all().map(|p| p.1), 0.1), tick: &|y| format!("{y:.1}") };
        let mut chart = axes(area, &self.title, x, y)?;
        for Line { label, colour, points } in &self.lines {
            line(&mut chart, label, *colour, points.iter().copied())?;
        }
        // The legend stands between the profiles, which are far apart.
        legend(&mut chart, SeriesLabelPosition::MiddleRight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::count::Count;
    use crate::paper::job::tests::job;
    use crate::paper::published;
    use crate::paper::runs::tests::record;

    #[test]
    fn curves_of_finished_runs_are_drawn_and_labelled() {
        let row = |case: usize, splats: usize| TableRow {
            case,
            voxels: 1.0,
            splats: Count { paper: 100_000, ours: splats },
            subset: Count { paper: 1, ours: 1 },
            training: published::training_of(case, 100_000),
            paper: job(splats),
            reference: job(splats + 2),
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
