//! Writes the curves of a fit and of baking as tables (CSV) and plots (SVG).

use std::fmt::Write;

use engine::bake;
use engine::fit::CurvePoint;
use engine::{Error, Kind, Result};
use plotters::prelude::*;

/// Returns the curve as CSV.
pub fn csv(curve: &[CurvePoint]) -> String {
    let mut out = String::from("iteration,seconds,psnr_db,mse,occupancy_rmse,dice_loss,leak\n");
    // A cell is empty if its term is off.
    let cell = |value: Option<f64>| value.map(|v| v.to_string()).unwrap_or_default();
    for CurvePoint { seconds, progress: p } in curve {
        let psnr = if p.psnr_db.is_finite() { p.psnr_db.to_string() } else { "inf".into() };
        // Writing to a string cannot fail.
        let _ = writeln!(
            out,
            "{},{seconds:.3},{psnr},{},{},{},{}",
            p.iteration,
            p.mse,
            p.occupancy_rmse,
            cell(p.dice),
            cell(p.leak)
        );
    }
    out
}

const SIZE: (u32, u32) = (900, 640);
const INK: RGBColor = RGBColor(51, 51, 51);
const GRID: RGBColor = RGBColor(228, 228, 228);

/// One panel of the plot.
struct Panel {
    title: String,
    y_title: &'static str,
    colour: RGBColor,
    points: Vec<(f64, f64)>,
    /// True if the axis starts at 0.
    from_zero: bool,
}

/// Returns the curve as SVG: PSNR above occupancy error, over iterations.
pub fn svg(curve: &[CurvePoint], title: &str, [low, high]: [f32; 2], unit: &str) -> Result<String> {
    let points = |value: fn(&CurvePoint) -> f64| -> Vec<(f64, f64)> {
        let all = curve.iter().map(|p| (f64::from(p.progress.iteration), value(p)));
        all.filter(|(_, y)| y.is_finite()).collect()
    };
    let panels = [
        Panel {
            title: format!("PSNR in the region of interest, over {low} to {high}{unit}"),
            y_title: "PSNR / dB",
            colour: RGBColor(0, 104, 170),
            points: points(|p| p.progress.psnr_db),
            from_zero: false,
        },
        Panel {
            title: "occupancy error in the region and its shell".into(),
            y_title: "RMS of O - M",
            colour: RGBColor(200, 80, 20),
            points: points(|p| p.progress.occupancy_rmse),
            from_zero: true,
        },
    ];
    plot(&panels, title)
}

/// Returns the curve of baking as CSV.
pub fn csv_of_baking(curve: &[bake::CurvePoint]) -> String {
    let mut out = String::from("iteration,seconds,splats,psnr_db,worst_psnr_db\n");
    for bake::CurvePoint { step, seconds, splats, psnr_db, worst_psnr_db } in curve {
        // Writing to a string cannot fail.
        let _ = writeln!(out, "{step},{seconds:.3},{splats},{psnr_db},{worst_psnr_db}");
    }
    out
}

/// Returns the curve of baking as SVG: PSNR of the views above the number of splats, over iterations.
pub fn svg_of_baking(curve: &[bake::CurvePoint], title: &str) -> Result<String> {
    let points = |value: fn(&bake::CurvePoint) -> f64| -> Vec<(f64, f64)> {
        let all = curve.iter().map(|p| (f64::from(p.step), value(p)));
        all.filter(|(_, y)| y.is_finite()).collect()
    };
    let panels = [
        Panel {
            title: "PSNR of the views that are not fitted, mean".into(),
            y_title: "PSNR / dB",
            colour: RGBColor(0, 104, 170),
            points: points(|p| p.psnr_db),
            from_zero: false,
        },
        Panel {
            title: "number of splats".into(),
            y_title: "splats",
            colour: RGBColor(200, 80, 20),
            points: points(|p| p.splats as f64),
            from_zero: true,
        },
    ];
    plot(&panels, title)
}

fn plot(panels: &[Panel], title: &str) -> Result<String> {
    let mut text = String::new();
    draw(&mut text, panels, title)
        .map_err(|e| Error::new(Kind::Internal, "VGS-CLI-034", format!("drawing the curve failed: {e}")))?;
    Ok(text)
}

fn draw(
    out: &mut String,
    panels: &[Panel],
    title: &str,
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let root = SVGBackend::with_string(out, SIZE).into_drawing_area();
    root.fill(&WHITE)?;
    let area = root.titled(title, ("sans-serif", 22).into_font().color(&INK))?;
    for (area, panel) in area.split_evenly((panels.len(), 1)).iter().zip(panels) {
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
    let last = panel.points.last().map_or(1.0, |p| p.0).max(1.0);
    let values = || panel.points.iter().map(|p| p.1);
    let low = values().fold(f64::INFINITY, f64::min);
    let high = values().fold(f64::NEG_INFINITY, f64::max);
    let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
    let margin = (0.08 * (high - low)).max(1e-3);
    let y = if panel.from_zero { 0.0..high + margin } else { low - margin..high + margin };
    let font = |size: i32| ("sans-serif", size).into_font().color(&INK);
    let mut chart = ChartBuilder::on(area)
        .caption(&panel.title, font(15))
        .margin(8)
        .margin_right(24)
        .x_label_area_size(42)
        .y_label_area_size(64)
        .build_cartesian_2d(0.0..last, y)?;
    chart
        .configure_mesh()
        .x_desc("iteration")
        .y_desc(panel.y_title)
        .x_labels(9)
        .y_labels(6)
        .x_label_formatter(&|x| format!("{x:.0}"))
        .y_label_formatter(&|y| match high {
            ..10.0 => format!("{y:.2}"),
            ..1000.0 => format!("{y:.1}"),
            _ => format!("{y:.0}"),
        })
        .axis_desc_style(font(14))
        .label_style(font(13))
        .axis_style(INK)
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .draw()?;
    chart.draw_series(LineSeries::new(panel.points.iter().copied(), panel.colour.stroke_width(2)))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use engine::fit::Progress;

    use super::*;

    #[test]
    fn curves_of_any_length_and_with_infinities_are_drawn() {
        for n in [0, 1, 2, 50] {
            let curve: Vec<_> = (0..n)
                .map(|i| CurvePoint {
                    seconds: f64::from(i),
                    progress: Progress {
                        iteration: i * 10,
                        mse: 0.0,
                        psnr_db: if i % 2 == 0 { f64::INFINITY } else { 30.0 },
                        occupancy_rmse: 0.0,
                        dice: (i % 2 == 0).then_some(0.25),
                        leak: None,
                    },
                })
                .collect();
            let table = csv(&curve);
            assert_eq!(table.lines().count(), n as usize + 1);
            let columns = |line: &str| line.split(',').count();
            assert!(table.lines().all(|line| columns(line) == 7), "{table}");
            let text = svg(&curve, "a <b> & c", [0.0, 0.0], " HU").unwrap();
            assert!(text.contains("</svg>") && !text.contains("<b>"), "{n}");
        }
    }
}
