//! Plots (SVG): predicted against measured times, and ranges of times by rung.

use engine::{Error, Kind, Result};
use plotters::prelude::*;

use super::rates::BAND;

const INK: RGBColor = RGBColor(51, 51, 51);
const GRID: RGBColor = RGBColor(228, 228, 228);
const COLOURS: [RGBColor; 6] = [
    RGBColor(30, 120, 180),
    RGBColor(210, 105, 30),
    RGBColor(60, 140, 70),
    RGBColor(150, 80, 160),
    RGBColor(170, 40, 60),
    RGBColor(90, 90, 90),
];
const PANEL: (u32, u32) = (480, 440);

/// Points of one kind.
pub struct Series {
    /// What the legend calls it.
    pub label: String,
    /// Measured and predicted, ms.
    pub points: Vec<(f64, f64)>,
}

/// One pair of axes.
pub struct Panel {
    /// Above it.
    pub title: String,
    /// What is drawn.
    pub series: Vec<Series>,
}

type Drawn = std::result::Result<(), Box<dyn std::error::Error>>;

fn failed(e: &dyn std::fmt::Display) -> Error {
    Error::new(Kind::Internal, "VGS-BEN-042", format!("drawing a plot failed: {e}"))
}

/// Predicted over measured times, both axes logarithmic, with the line of equals and the band of [`BAND`] about it.
pub fn against(title: &str, panels: &[Panel]) -> Result<String> {
    let mut text = String::new();
    draw_against(&mut text, title, panels).map_err(|e| failed(&e))?;
    Ok(text)
}

fn drawable(&(x, y): &(f64, f64)) -> bool {
    x > 0.0 && y > 0.0 && x.is_finite() && y.is_finite()
}

fn draw_against(out: &mut String, title: &str, panels: &[Panel]) -> Drawn {
    let root =
        SVGBackend::with_string(out, (PANEL.0 * panels.len() as u32, PANEL.1 + 40)).into_drawing_area();
    root.fill(&WHITE)?;
    let font = |size: i32| ("sans-serif", size).into_font().color(&INK);
    let area = root.titled(title, font(18))?;
    for (area, panel) in area.split_evenly((1, panels.len())).iter().zip(panels) {
        let all = || panel.series.iter().flat_map(|s| &s.points).filter(|p| drawable(p));
        let low = all().map(|&(x, y)| x.min(y)).fold(f64::INFINITY, f64::min);
        let high = all().map(|&(x, y)| x.max(y)).fold(0.0, f64::max);
        let range = if low <= high { low.log10() - 0.1..high.log10() + 0.1 } else { 0.0..1.0 };
        let mut chart = ChartBuilder::on(area)
            .caption(&panel.title, font(14))
            .margin(8)
            .margin_right(20)
            .x_label_area_size(40)
            .y_label_area_size(52)
            .build_cartesian_2d(range.clone(), range.clone())?;
        let ms = |x: &f64| three_digits(10f64.powf(*x));
        chart
            .configure_mesh()
            .x_desc("measured / ms")
            .y_desc("predicted / ms")
            .x_labels(6)
            .y_labels(6)
            .x_label_formatter(&ms)
            .y_label_formatter(&ms)
            .axis_desc_style(font(13))
            .label_style(font(12))
            .bold_line_style(GRID)
            .light_line_style(TRANSPARENT)
            .draw()?;
        let line = |factor: f64| [range.start, range.end].map(|x| (x, x + factor.log10()));
        chart.draw_series(LineSeries::new(line(1.0), INK))?;
        for factor in [1.0 - BAND, 1.0 + BAND] {
            chart.draw_series(LineSeries::new(line(factor), INK.mix(0.35)))?;
        }
        for (series, colour) in panel.series.iter().zip(COLOURS.iter().cycle()) {
            let points = series.points.iter().filter(|p| drawable(p)).map(|&(x, y)| (x.log10(), y.log10()));
            chart
                .draw_series(points.map(|p| Circle::new(p, 2, colour.mix(0.7).filled())))?
                .label(&series.label)
                .legend(move |(x, y)| Circle::new((x + 8, y), 3, colour.filled()));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::LowerRight)
            .background_style(WHITE.mix(0.8))
            .border_style(GRID)
            .label_font(font(12))
            .draw()?;
    }
    root.present()?;
    Ok(())
}

/// A range of times for each rung.
pub struct Rungs {
    /// Above it.
    pub title: String,
    /// By rung: least and most, ms.
    pub ranges: Vec<[f64; 2]>,
}

/// Ranges of times by rung on a logarithmic axis, with lines at the `budgets`, ms, and what they are called.
pub fn rungs(title: &str, panels: &[Rungs], budgets: &[(String, f64)]) -> Result<String> {
    let mut text = String::new();
    draw_rungs(&mut text, title, panels, budgets).map_err(|e| failed(&e))?;
    Ok(text)
}

fn draw_rungs(out: &mut String, title: &str, panels: &[Rungs], budgets: &[(String, f64)]) -> Drawn {
    let columns = 2;
    let rows = panels.len().div_ceil(columns).max(1);
    let size = (PANEL.0 * columns as u32, 300 * rows as u32 + 40);
    let root = SVGBackend::with_string(out, size).into_drawing_area();
    root.fill(&WHITE)?;
    let font = |size: i32| ("sans-serif", size).into_font().color(&INK);
    let area = root.titled(title, font(18))?;
    let all = || panels.iter().flat_map(|p| &p.ranges).flatten().copied().chain(budgets.iter().map(|b| b.1));
    let low = all().fold(f64::INFINITY, f64::min).max(1e-3).log10() - 0.1;
    let high = all().fold(1e-2, f64::max).log10() + 0.1;
    for (area, panel) in area.split_evenly((rows, columns)).iter().zip(panels) {
        let last = panel.ranges.len() as f64;
        let mut chart = ChartBuilder::on(area)
            .caption(&panel.title, font(14))
            .margin(8)
            .margin_right(16)
            .x_label_area_size(36)
            .y_label_area_size(52)
            .build_cartesian_2d(-0.5..last - 0.5, low..high)?;
        chart
            .configure_mesh()
            .x_desc("rung")
            .y_desc("frame / ms")
            .x_labels(panel.ranges.len())
            .y_labels(6)
            .x_label_formatter(&|x| format!("{x:.0}"))
            .y_label_formatter(&|y| three_digits(10f64.powf(*y)))
            .axis_desc_style(font(13))
            .label_style(font(12))
            .bold_line_style(GRID)
            .light_line_style(TRANSPARENT)
            .disable_x_mesh()
            .draw()?;
        for ((name, ms), colour) in budgets.iter().zip(&COLOURS[1..]) {
            let line = [(-0.5, ms.log10()), (last - 0.5, ms.log10())];
            chart
                .draw_series(LineSeries::new(line, colour.stroke_width(1)))?
                .label(name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], *colour));
        }
        let bars = panel.ranges.iter().enumerate().map(|(rung, [least, most])| {
            let x = rung as f64;
            Rectangle::new(
                [(x - 0.3, least.max(1e-3).log10()), (x + 0.3, most.max(1e-3).log10())],
                COLOURS[0].mix(0.6).filled(),
            )
        });
        chart.draw_series(bars)?;
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.8))
            .border_style(GRID)
            .label_font(font(12))
            .draw()?;
    }
    root.present()?;
    Ok(())
}

/// A positive number with about three digits.
fn three_digits(x: f64) -> String {
    let decimals = (2.0 - x.log10().floor()).clamp(0.0, 3.0) as usize;
    format!("{x:.decimals$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_and_ranges_are_drawn_and_those_that_have_no_place_are_not() {
        let series =
            |label: &str, points: &[(f64, f64)]| Series { label: label.into(), points: points.to_vec() };
        let panel = |series: Vec<Series>| Panel { title: "a mode".into(), series };
        let good = series("bones", &[(1.0, 1.2), (30.0, 25.0), (0.0, 5.0), (2.0, f64::NAN)]);
        let text = against("Frames", &[panel(vec![good]), panel(vec![series("none", &[])])]).expect("a plot");
        assert!(text.contains("a mode") && text.contains("bones") && text.contains("predicted / ms"));
        assert!(!text.contains("NaN") && !text.contains("inf"));
        // The legend has a larger circle for each kind.
        assert_eq!(text.matches("<circle").count(), 2 + 2);
        let rung = |ranges: &[[f64; 2]]| Rungs { title: "a headset".into(), ranges: ranges.to_vec() };
        let budgets = [("72 Hz".to_owned(), 12.5)];
        let text = rungs("Rungs", &[rung(&[[1.0, 3.0], [0.5, 1.0]]), rung(&[])], &budgets).expect("a plot");
        assert!(text.contains("72 Hz") && text.contains("a headset") && !text.contains("NaN"));
    }
}
