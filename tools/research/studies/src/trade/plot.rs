//! Plots gain over cost (SVG): all points, and the Pareto front as a line.

use engine::Result;
use plotters::prelude::*;

use super::front::{Point, front};
use bench::plot::{Area, Axis, COLOURS, Drawn, INK, axes, font, legend, sheet, span, three_digits};

const PANEL: [u32; 2] = [480, 360];

/// Points of one kind.
pub struct Series {
    /// Name in the legend.
    pub label: String,
    /// The points.
    pub points: Vec<Point>,
}

/// Plot with one pair of axes.
pub struct Panel {
    /// Title above the plot.
    pub title: String,
    /// Title of the cost axis, which is logarithmic.
    pub cost: String,
    /// Title of the gain axis.
    pub gain: String,
    /// Series of points.
    pub series: Vec<Series>,
    /// Points with a name beside them.
    pub named: Vec<(String, Point)>,
}

/// Plots panels in rows of `columns`, and returns them as SVG.
pub fn svg(title: &str, panels: &[Panel], columns: usize) -> Result<String> {
    sheet(title, panels.len(), columns.max(1), PANEL, |n, area| panels[n].draw(area))
}

/// Returns true if the point can be drawn on a logarithmic axis.
fn drawable(p: &Point) -> bool {
    p.cost > 0.0 && p.cost.is_finite() && p.gain.is_finite()
}

impl Panel {
    fn draw(&self, area: &Area<'_>) -> Drawn {
        let all: Vec<Point> = self.series.iter().flat_map(|s| &s.points).copied().filter(drawable).collect();
        let place = |p: &Point| (p.cost.log10(), p.gain);
        let x = Axis {
            title: &self.cost,
            range: span(all.iter().map(|p| p.cost.log10()), 0.05),
            tick: &|x| three_digits(10f64.powf(*x)),
        };
        let y = Axis {
            title: &self.gain,
            range: span(all.iter().map(|p| p.gain), 0.5),
            tick: &|y| format!("{y:.0}"),
        };
        let mut chart = axes(area, &self.title, x, y)?;
        let mut best: Vec<Point> =
            all.iter().zip(front(&all)).filter(|(_, on)| *on).map(|(p, _)| *p).collect();
        best.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        chart.draw_series(LineSeries::new(best.iter().map(place), INK.mix(0.5).stroke_width(2)))?;
        for (series, colour) in self.series.iter().zip(COLOURS.iter().cycle()) {
            let points = series.points.iter().filter(|p| drawable(p));
            chart
                .draw_series(points.map(|p| Circle::new(place(p), 3, colour.filled())))?
                .label(&series.label)
                .legend(move |(x, y)| Circle::new((x + 8, y), 3, colour.filled()));
        }
        for (name, point) in self.named.iter().filter(|(_, p)| drawable(p)) {
            chart.draw_series([Circle::new(place(point), 6, INK.stroke_width(1))])?;
            let text = EmptyElement::at(place(point)) + Text::new(name.clone(), (6, 6), font(11));
            chart.draw_series([text])?;
        }
        legend(&mut chart, SeriesLabelPosition::LowerRight)
    }
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
