//! Plots (SVG) of ranges of times by quality level.

use engine::Result;
use plotters::prelude::*;

use bench::plot::{Axis, COLOURS, axes, legend, line, sheet, three_digits};

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
    fn ranges_are_drawn() {
        let level = |ranges: &[[f64; 2]]| LevelRanges { title: "a headset".into(), ranges: ranges.to_vec() };
        let budgets = [("72 Hz".to_owned(), 12.5)];
        let text =
            levels("LevelRanges", &[level(&[[1.0, 3.0], [0.5, 1.0]]), level(&[])], &budgets).expect("a plot");
        assert!(text.contains("72 Hz") && text.contains("a headset") && !text.contains("NaN"));
    }
}
