//! Slicer's format `.vp`: nine lines of text, one item on each, and no names.

use super::super::{Material, TransferFunction};
use super::entry::{Entry, broken};
use super::list;
use base::error::Result;

/// The content of the lines, in order.
const LINES: [&str; 9] = [
    "interpolation",
    "shade",
    "diffuse",
    "ambient",
    "specular",
    "specular power",
    "scalar opacity",
    "gradient opacity",
    "colour",
];

pub fn sniff(text: &str) -> bool {
    // The first line is the kind of interpolation, the second whether there is shading.
    let mut lines = text.lines().map(content);
    let mut is_number =
        |empty: bool| lines.next().is_some_and(|l| l.parse::<f64>().is_ok() || (empty && l.is_empty()));
    is_number(false) && is_number(true)
}

pub fn read(text: &str) -> Result<Vec<Entry>> {
    Ok(vec![Entry { name: String::new(), function: function(text) }])
}

/// Returns a line without the explanation after "=>" that Slicer's manual adds.
fn content(line: &str) -> &str {
    line.split("=>").next().unwrap_or_default().trim()
}

fn function(text: &str) -> Result<TransferFunction> {
    let lines: Vec<&str> = text.lines().map(content).collect();
    let line = |index: usize| lines.get(index).copied().unwrap_or_default();
    let what = |index: usize| format!("line {} ({})", index + 1, LINES[index]);
    let needed = |index: usize| match line(index) {
        "" => Err(broken(format!("{} is missing", what(index)))),
        text => Ok(text),
    };
    // Slicer keeps its default where a line is empty.
    let coefficient = |index: usize, default: f64| match line(index) {
        "" => Ok(default),
        text => text.parse::<f64>().map_err(|_| broken(format!("{} is {text:?}", what(index)))),
    };
    let default = Material::default();
    let material = Material {
        shade: coefficient(1, 0.0)? != 0.0,
        diffuse: coefficient(2, default.diffuse)?,
        ambient: coefficient(3, default.ambient)?,
        specular: coefficient(4, default.specular)?,
        power: coefficient(5, default.power)?,
        occlusion: default.occlusion,
    };
    let opacities = list::opacities(&what(6), needed(6)?)?;
    let gradient = match line(7) {
        "" | "0" => Vec::new(),
        text => list::opacities(&what(7), text)?,
    };
    let colours = list::colours(&what(8), needed(8)?)?;
    TransferFunction::new("", colours, opacities, material)?.with_gradient_opacity(gradient)
}
