//! Plots (SVG) of predicted against measured times, and of ranges of times by quality level.

use engine::Result;
use plotters::prelude::*;

use super::rates::BAND;
use bench::plot::{Axis, COLOURS, INK, axes, legend, line, sheet, three_digits};

/// Points of one kind.
pub struct Series {
    /// Name in the legend.
    pub label: String,
    /// Measured and predicted times, ms.
    pub points: Vec<(f64, f64)>,
}

/// One pair of axes with its points.
pub struct Panel {
    /// Title above the axes.
    pub title: String,
    /// Points that are drawn.
    pub series: Vec<Series>,
}

/// Returns true if the point has a place on logarithmic axes: both its coordinates are positive and finite.
fn drawable(&(x, y): &(f64, f64)) -> bool {
    x > 0.0 && y > 0.0 && x.is_finite() && y.is_finite()
}

/// Plots predicted over measured times as SVG, with the line of equal times and the band of [`BAND`] around
/// it.
pub fn against(title: &str, panels: &[Panel]) -> Result<String> {
    sheet(title, panels.len(), 2, [480, 440], |n, area| {
        let panel = &panels[n];
        let all = || panel.series.iter().flat_map(|s| &s.points).filter(|p| drawable(p));
        let low = all().map(|&(x, y)| x.min(y)).fold(f64::INFINITY, f64::min);
        let high = all().map(|&(x, y)| x.max(y)).fold(0.0, f64::max);
        let range = if low <= high { low.log10() - 0.1..high.log10() + 0.1 } else { 0.0..1.0 };
        let tick = |x: &f64| three_digits(10f64.powf(*x));
        let axis = |title| Axis { title, range: range.clone(), tick: &tick };
        let mut chart = axes(area, &panel.title, axis("measured / ms"), axis("predicted / ms"))?;
        for (factor, ink) in [(1.0, 1.0), (1.0 - BAND, 0.35), (1.0 + BAND, 0.35)] {
            let ends = [range.start, range.end].map(|x| (x, x + f64::log10(factor)));
            chart.draw_series(LineSeries::new(ends, INK.mix(ink)))?;
        }
        for (series, colour) in panel.series.iter().zip(COLOURS.iter().cycle()) {
            let points = series.points.iter().filter(|p| drawable(p)).map(|&(x, y)| (x.log10(), y.log10()));
            chart
                .draw_series(points.map(|p| Circle::new(p, 2, colour.mix(0.7).filled())))?
                .label(&series.label)
                .legend(move |(x, y)| Circle::new((x + 8, y), 3, colour.filled()));
        }
        legend(&mut chart, SeriesLabelPosition::LowerRight)
    })
}

/// Ranges of times by quality level, for one pair of axes.
pub struct LevelRanges {
    /// Title above the axes.
    pub title: String,
    /// Least and greatest time of each quality level, ms.
    pub ranges: Vec<[f64; 2]>,
}

/// Plots ranges of times by quality level as SVG, with a logarithmic axis of time and a line for each of the
/// `budgets`, which have a name and a time in ms.
pub fn levels(title: &str, panels: &[LevelRanges], budgets: &[(String, f64)]) -> Result<String> {
    let all = || panels.iter().flat_map(|p| &p.ranges).flatten().copied().chain(budgets.iter().map(|b| b.1));
    let low = all().fold(f64::INFINITY, f64::min).clamp(1e-3, 1e6).log10() - 0.1;
    let high = all().fold(1e-2, f64::max).log10() + 0.1;
    sheet(title, panels.len(), 2, [480, 300], |n, area| {
        let panel = &panels[n];
        let end = panel.ranges.len().max(1) as f64 - 0.5;
        let x = Axis { title: "level", range: -0.5..end, tick: &|x| format!("{x:.0}") };
        let y = Axis { title: "frame / ms", range: low..high, tick: &|y| three_digits(10f64.powf(*y)) };
        let mut chart = axes(area, &panel.title, x, y)?;
        for ((name, ms), colour) in budgets.iter().zip(&COLOURS[1..]) {
            line(&mut chart, name, *colour, [(-0.5, ms.log10()), (end, ms.log10())])?;
        }
        let bars = panel.ranges.iter().enumerate().map(|(level, range)| {
            let [least, most] = range.map(|ms| ms.max(1e-3).log10());
            Rectangle::new(
                [(level as f64 - 0.3, least), (level as f64 + 0.3, most)],
                COLOURS[0].mix(0.6).filled(),
            )
        });
        chart.draw_series(bars)?;
        legend(&mut chart, SeriesLabelPosition::UpperRight)
    })
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
        let level = |ranges: &[[f64; 2]]| LevelRanges { title: "a headset".into(), ranges: ranges.to_vec() };
        let budgets = [("72 Hz".to_owned(), 12.5)];
        let text =
            levels("LevelRanges", &[level(&[[1.0, 3.0], [0.5, 1.0]]), level(&[])], &budgets).expect("a plot");
        assert!(text.contains("72 Hz") && text.contains("a headset") && !text.contains("NaN"));
    }
}
