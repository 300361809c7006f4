//! Parts that plots of several panels share (SVG): sheet, axes, legends and colours.

use std::ops::Range;

use engine::{Error, Kind, Result};
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

/// Colour of lines and letters.
pub const INK: RGBColor = RGBColor(51, 51, 51);
/// Colour of the grid lines.
pub const GRID: RGBColor = RGBColor(228, 228, 228);
/// Colours of series that have none of their own.
pub const COLOURS: [RGBColor; 7] = [
    RGBColor(30, 120, 180),
    RGBColor(210, 105, 30),
    RGBColor(60, 140, 70),
    RGBColor(150, 80, 160),
    RGBColor(170, 40, 60),
    RGBColor(90, 90, 90),
    RGBColor(180, 150, 30),
];

/// Result of drawing.
pub type Drawn<T = ()> = std::result::Result<T, Box<dyn std::error::Error>>;
/// Drawing area of a panel.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// Panel with its axes.
pub type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// One axis.
pub struct Axis<'a> {
    /// Quantity on the axis, with its unit.
    pub title: &'a str,
    /// Least and greatest value.
    pub range: Range<f64>,
    /// Formats the label of a tick.
    pub tick: &'a dyn Fn(&f64) -> String,
}

/// Draws a sheet of `count` panels of `size` pixels in rows of `columns`, and returns it as SVG. `draw` is
/// called with the number of each panel and its area.
pub fn sheet(
    title: &str,
    count: usize,
    columns: usize,
    size: [u32; 2],
    draw: impl Fn(usize, &Area<'_>) -> Drawn,
) -> Result<String> {
    let mut text = String::new();
    let mut paint = || -> Drawn {
        let rows = count.div_ceil(columns).max(1);
        let size = (size[0] * columns as u32, size[1] * rows as u32 + 40);
        let root = SVGBackend::with_string(&mut text, size).into_drawing_area();
        root.fill(&WHITE)?;
        let area = root.titled(title, font(20))?;
        for (n, area) in area.split_evenly((rows, columns)).iter().take(count).enumerate() {
            draw(n, area)?;
        }
        root.present()?;
        Ok(())
    };
    paint().map_err(|e| Error::new(Kind::Internal, "VGS-BEN-025", format!("drawing a plot failed: {e}")))?;
    Ok(text)
}

/// Returns a sans-serif font of this size, in pixels.
pub fn font(size: i32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}

/// Draws axes with their grid under a caption, and returns the chart.
pub fn axes<'a, 'b>(area: &'a Area<'b>, caption: &str, x: Axis<'_>, y: Axis<'_>) -> Drawn<Chart<'a, 'b>> {
    let mut chart = ChartBuilder::on(area)
        .caption(caption, font(15))
        .margin(8)
        .margin_right(20)
        .x_label_area_size(40)
        .y_label_area_size(52)
        .build_cartesian_2d(x.range, y.range)?;
    chart
        .configure_mesh()
        .x_desc(x.title)
        .y_desc(y.title)
        .x_labels(7)
        .y_labels(7)
        .x_label_formatter(x.tick)
        .y_label_formatter(y.tick)
        .axis_desc_style(font(13))
        .label_style(font(12))
        .axis_style(INK)
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .draw()?;
    Ok(chart)
}

/// Draws a line and adds it to the legend.
pub fn line<'a, 'b: 'a>(
    chart: &mut Chart<'a, 'b>,
    label: &str,
    colour: RGBColor,
    points: impl IntoIterator<Item = (f64, f64)>,
) -> Drawn {
    let style = colour.stroke_width(2);
    chart
        .draw_series(LineSeries::new(points, style))?
        .label(label)
        .legend(move |(x, y)| PathElement::new([(x, y), (x + 16, y)], style));
    Ok(())
}

/// Draws the legend; to be called when everything else is drawn.
pub fn legend<'a, 'b: 'a>(chart: &mut Chart<'a, 'b>, position: SeriesLabelPosition) -> Drawn {
    chart
        .configure_series_labels()
        .position(position)
        .background_style(WHITE.mix(0.8))
        .border_style(GRID)
        .label_font(font(11))
        .draw()?;
    Ok(())
}

/// Returns the range from the least to the greatest value, extended on both sides by 8 %, and by at least
/// `least`.
pub fn span(values: impl Iterator<Item = f64>, least: f64) -> Range<f64> {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    let (low, high) = if low <= high { (low, high) } else { (0.0, 1.0) };
    let margin = (0.08 * (high - low)).max(least);
    low - margin..high + margin
}

/// Formats a positive number with about three digits.
pub fn three_digits(x: f64) -> String {
    let decimals = (2.0 - x.log10().floor()).clamp(0.0, 3.0) as usize;
    format!("{x:.decimals$}")
}
