//! Colour maps of ParaView in JSON: an array of maps, each with colours and sometimes with opacities.

use glam::DVec3;
use serde::Deserialize;

use super::super::{ColourPoint, Material, TransferFunction};
use super::colour_space::{self, ColourSpace};
use super::curve::{Node, straightened};
use super::entry::{Entry, MAX_POINTS, broken, opacity_points};
use base::error::Result;

#[derive(Deserialize)]
#[serde(untagged)]
enum Document {
    Maps(Vec<serde_json::Value>),
    Map(serde_json::Value),
}

#[derive(Deserialize)]
#[serde(rename_all = "PascalCase")]
struct Map {
    #[serde(default)]
    name: String,
    #[serde(default)]
    color_space: Option<String>,
    /// True if hues take the shorter way around their circle; ParaView writes 0 and 1.
    #[serde(rename = "HSVWrap", default)]
    hsv_wrap: Option<serde_json::Value>,
    /// Intensity, red, green and blue of each point in turn.
    #[serde(rename = "RGBPoints")]
    rgb_points: Vec<f64>,
    /// Intensity, opacity, midpoint and sharpness of each point in turn.
    #[serde(default)]
    points: Option<Vec<f64>>,
}

pub fn sniff(text: &str) -> bool {
    text.trim_start().starts_with(['[', '{']) && text.contains("\"RGBPoints\"")
}

pub fn read(text: &str) -> Result<Vec<Entry>> {
    let maps = match serde_json::from_str(text).map_err(|e| broken(e.to_string()))? {
        Document::Maps(maps) => maps,
        Document::Map(map) => vec![map],
    };
    let entry = |(i, map): (usize, serde_json::Value)| {
        let name = map.get("Name").and_then(|name| name.as_str()).unwrap_or_default().to_owned();
        let map = serde_json::from_value(map).map_err(|e| broken(e.to_string()));
        let function = map.and_then(function).map_err(|mut e| {
            e.message = format!("map {} {name:?}: {}", i + 1, e.message);
            e
        });
        Entry { name, function }
    };
    Ok(maps.into_iter().enumerate().map(entry).collect())
}

/// Returns the numbers in rows of four.
fn rows(what: &str, numbers: &[f64]) -> Result<Vec<[f64; 4]>> {
    let (rows, rest) = numbers.as_chunks();
    if !rest.is_empty() || rows.is_empty() || rows.len() > MAX_POINTS {
        let message = format!(
            "{what} has {} numbers, a multiple of 4 up to {} is needed",
            numbers.len(),
            4 * MAX_POINTS
        );
        return Err(broken(message));
    }
    Ok(rows.to_vec())
}

fn function(map: Map) -> Result<TransferFunction> {
    let wraps = match map.hsv_wrap.as_ref().map(|value| (value, value.as_bool(), value.as_u64())) {
        None => false,
        Some((_, Some(wraps), _)) => wraps,
        Some((_, _, Some(number @ 0..=1))) => number == 1,
        Some((value, ..)) => return Err(broken(format!("HSVWrap is {value}, 0 or 1 is needed"))),
    };
    let space = match map.color_space.as_deref() {
        None => ColourSpace::Rgb,
        Some(name) => match colour_space::find(name) {
            Some(ColourSpace::Hsv) if wraps => ColourSpace::HsvWrapped,
            Some(space) => space,
            None => {
                let known: Vec<_> = colour_space::NAMES.iter().map(|(name, _)| *name).collect();
                return Err(broken(format!("ColorSpace is {name:?}, which is not known"))
                    .help(format!("known: {}", known.join(", "))));
            }
        },
    };
    if map.color_space.as_deref().is_some_and(|name| name.eq_ignore_ascii_case(colour_space::CIEDE2000)) {
        tracing::warn!(
            "{:?}: colours between control points are mixed in Lab, which is close to {}",
            map.name,
            colour_space::CIEDE2000
        );
    }
    // As in VTK, the colour of a node holds from the node before it.
    let (midpoint, sharpness) = if space == ColourSpace::Step { (0.0, 1.0) } else { (0.5, 0.0) };
    let colours = rows("RGBPoints", &map.rgb_points)?;
    let nodes =
        colours.iter().map(|&[x, r, g, b]| Node { x, value: DVec3::new(r, g, b), midpoint, sharpness });
    let nodes: Vec<_> = nodes.collect();
    if let Some(i) =
        nodes.iter().position(|n| !(n.value.cmpge(DVec3::ZERO) & n.value.cmple(DVec3::ONE)).all())
    {
        return Err(broken(format!("RGBPoints: colour {} is not between 0 and 1", i + 1)));
    }
    let bent = !matches!(space, ColourSpace::Rgb | ColourSpace::Step);
    let colours = straightened(nodes, bent, |a, b, share| space.mix(a, b, share));
    let opacities = match &map.points {
        Some(points) => {
            let nodes = rows("Points", points)?.into_iter();
            let nodes = nodes.map(|[x, value, midpoint, sharpness]| Node { x, value, midpoint, sharpness });
            straightened(nodes.collect(), false, |a, b, share| a + (b - a) * share)
        }
        None => {
            tracing::warn!(
                "{:?} has no opacities: a ramp from 0 to 1 over its colours, as in ParaView",
                map.name
            );
            vec![(colours[0].0, 0.0), (colours[colours.len() - 1].0, 1.0)]
        }
    };
    let colours = colours.into_iter().map(|(intensity, colour)| ColourPoint { intensity, colour });
    TransferFunction::new(map.name, colours.collect(), opacity_points(&opacities), Material::default())
}
