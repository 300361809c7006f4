//! What is given over what it costs, as pictures (SVG): all points, and the front as a line.

use engine::{Error, Kind, Result};
use plotters::prelude::*;

use super::front::{Point, front};

const INK: RGBColor = RGBColor(51, 51, 51);
const GRID: RGBColor = RGBColor(228, 228, 228);
const COLOURS: [RGBColor; 7] = [
    RGBColor(30, 120, 180),
    RGBColor(210, 105, 30),
    RGBColor(60, 140, 70),
    RGBColor(150, 80, 160),
    RGBColor(170, 40, 60),
    RGBColor(90, 90, 90),
    RGBColor(180, 150, 30),
];
const PANEL: (u32, u32) = (480, 360);

/// Points of one kind.
pub struct Series {
    /// What the legend calls it.
    pub label: String,
    /// The points.
    pub points: Vec<Point>,
}

/// One pair of axes.
pub struct Panel {
    /// Above it.
    pub title: String,
    /// Of the cost, which has a logarithmic axis.
    pub cost: String,
    /// Of the gain.
    pub gain: String,
    /// What is drawn.
    pub series: Vec<Series>,
    /// Points with a name beside them.
    pub named: Vec<(String, Point)>,
}

/// Panels in rows of `columns`.
pub fn svg(title: &str, panels: &[Panel], columns: usize) -> Result<String> {
    let mut text = String::new();
    draw(&mut text, title, panels, columns.max(1))
        .map_err(|e| Error::new(Kind::Internal, "VGS-BEN-025", format!("drawing a plot failed: {e}")))?;
    Ok(text)
}

fn draw(
    out: &mut String,
    title: &str,
    panels: &[Panel],
    columns: usize,
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let rows = panels.len().div_ceil(columns).max(1);
    let size = (PANEL.0 * columns as u32, PANEL.1 * rows as u32 + 40);
    let root = SVGBackend::with_string(out, size).into_drawing_area();
    root.fill(&WHITE)?;
    let area = root.titled(title, ("sans-serif", 18).into_font().color(&INK))?;
    for (area, panel) in area.split_evenly((rows, columns)).iter().zip(panels) {
        draw_panel(area, panel)?;
    }
    root.present()?;
    Ok(())
}

/// Can be drawn on a logarithmic axis.
fn drawable(p: &Point) -> bool {
    p.cost > 0.0 && p.cost.is_finite() && p.gain.is_finite()
}

fn draw_panel<DB: DrawingBackend>(
    area: &DrawingArea<DB, plotters::coord::Shift>,
    panel: &Panel,
) -> std::result::Result<(), Box<dyn std::error::Error>>
where
    DB::ErrorType: 'static,
{
    let all: Vec<Point> = panel.series.iter().flat_map(|s| &s.points).copied().filter(drawable).collect();
    let place = |p: &Point| (p.cost.log10(), p.gain);
    let range = |of: fn(&Point) -> f64, least: f64| {
        let low = all.iter().map(of).fold(f64::INFINITY, f64::min);
        let high = all.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
        let margin = (0.08 * (high - low)).max(least);
        low - margin..high + margin
    };
    let font = |size: i32| ("sans-serif", size).into_font().color(&INK);
    let mut chart = ChartBuilder::on(area)
        .caption(&panel.title, font(14))
        .margin(8)
        .margin_right(20)
        .x_label_area_size(40)
        .y_label_area_size(52)
        .build_cartesian_2d(range(|p| p.cost.log10(), 0.05), range(|p| p.gain, 0.5))?;
    chart
        .configure_mesh()
        .x_desc(&panel.cost)
        .y_desc(&panel.gain)
        .x_labels(6)
        .y_labels(7)
        .x_label_formatter(&|x| three_digits(10f64.powf(*x)))
        .y_label_formatter(&|y| format!("{y:.0}"))
        .axis_desc_style(font(13))
        .label_style(font(12))
        .axis_style(INK)
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .draw()?;
    let mut best: Vec<Point> = all.iter().zip(front(&all)).filter(|(_, on)| *on).map(|(p, _)| *p).collect();
    best.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    chart.draw_series(LineSeries::new(best.iter().map(place), INK.mix(0.5).stroke_width(2)))?;
    for (series, colour) in panel.series.iter().zip(COLOURS.iter().cycle()) {
        let points = series.points.iter().filter(|p| drawable(p));
        chart
            .draw_series(points.map(|p| Circle::new(place(p), 3, colour.filled())))?
            .label(&series.label)
            .legend(move |(x, y)| Circle::new((x + 8, y), 3, colour.filled()));
    }
    for (name, point) in panel.named.iter().filter(|(_, p)| drawable(p)) {
        chart.draw_series([Circle::new(place(point), 6, INK.stroke_width(1))])?;
        let text = EmptyElement::at(place(point)) + Text::new(name.clone(), (6, 6), font(11));
        chart.draw_series([text])?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE.mix(0.8))
        .border_style(GRID)
        .label_font(font(11))
        .draw()?;
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
    fn points_are_drawn_and_those_that_have_no_place_are_not() {
        let point = |cost, gain| Point { cost, gain };
        let panel = |points: Vec<Point>| Panel {
            title: "a case".into(),
            cost: "seconds".into(),
            gain: "PSNR / dB".into(),
            named: vec![("fine".into(), point(2.0, 11.0))],
            series: vec![Series { label: "grid".into(), points }],
        };
        let good = vec![point(1.0, 10.0), point(2.0, 11.0), point(3.0, f64::INFINITY), point(0.0, 5.0)];
        let text = svg("Fits", &[panel(good), panel(Vec::new())], 2).expect("a plot");
        assert!(text.contains("a case") && text.contains("grid") && text.contains("fine"));
        assert!(!text.contains("NaN") && !text.contains("inf"));
        assert_eq!(
            [0.1234, 1.234, 12.34, 123.4, 12345.0].map(three_digits),
            ["0.123", "1.23", "12.3", "123", "12345"]
        );
    }
}
