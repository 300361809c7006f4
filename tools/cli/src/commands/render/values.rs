//! Values of the flags of `vgs render`.

use std::path::Path;
use std::str::FromStr;

use engine::render::{CameraFile, Classification, Precision, hex_colour};
use engine::transfer::OpacityPoint;

use crate::shared::flags::pair;
use crate::shared::texts::text_of;

/// Background colour; `None` keeps the opacity.
#[derive(Clone, Copy, Debug)]
pub struct Background(pub Option<[f32; 3]>);

impl FromStr for Background {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let named = match text.to_lowercase().as_str() {
            "transparent" | "none" => return Ok(Background(None)),
            "black" => Some([0.0; 3]),
            "white" => Some([1.0; 3]),
            "grey" | "gray" => Some([0.5; 3]),
            _ => None,
        };
        let colour = named.or_else(|| hex_colour(text));
        colour.map(|c| Background(Some(c))).ok_or_else(|| "black, white, grey, #rrggbb or transparent".into())
    }
}

/// Place that a picture is taken from.
#[derive(Clone, Debug)]
pub enum View {
    /// A side of the patient.
    Side(String),
    /// A camera read from a file.
    File(CameraFile),
}

impl FromStr for View {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if !text.to_lowercase().ends_with(".json") {
            return Ok(View::Side(text.to_owned()));
        }
        let content = text_of(Path::new(text)).map_err(|e| format!("{text}: {e}"))?;
        serde_json::from_str(&content).map(View::File).map_err(|e| {
            format!("{text}: {e}; needed: {{\"eye_mm\": [x, y, z], \"target_mm\": [x, y, z], \"up\": [0, 0, 1], \"fov_deg\": 30}}")
        })
    }
}

/// Classification of a transfer function; `None` leaves it to the function's shape.
#[derive(Clone, Copy, Debug)]
pub struct Classified(pub Option<Classification>);

/// Parses a classification.
pub fn classification(text: &str) -> Result<Classified, String> {
    match text {
        "auto" => Ok(Classified(None)),
        "point" => Ok(Classified(Some(Classification::Point))),
        "pre-integrated" => Ok(Classified(Some(Classification::PreIntegrated))),
        _ => Err("auto, point or pre-integrated".into()),
    }
}

fn number(text: &str, range: std::ops::RangeInclusive<f64>) -> Result<f64, String> {
    let found = text.trim().parse::<f64>().ok().filter(|v| range.contains(v));
    found.ok_or_else(|| format!("a number from {} to {} is needed", range.start(), range.end()))
}

/// Parses a field of view, degrees.
pub fn degrees(text: &str) -> Result<f64, String> {
    number(text, 0.01..=170.0)
}

/// Parses a magnification.
pub fn zoom(text: &str) -> Result<f64, String> {
    number(text, 0.01..=1000.0)
}

/// Parses a sample distance.
pub fn step(text: &str) -> Result<f64, String> {
    number(text, 0.01..=100.0)
}

/// Parses a distance of voxels.
pub fn pitch(text: &str) -> Result<f64, String> {
    number(text, 0.25..=16.0)
}

/// Parses a share.
pub fn share(text: &str) -> Result<f64, String> {
    number(text, 0.0..=1.0)
}

/// Control points of an opacity over the gradient.
#[derive(Clone, Debug)]
pub struct GradientOpacity(pub Vec<OpacityPoint>);

/// Parses `LOW,HIGH`, gradients from which on there is something and all, or `none`.
pub fn gradient_opacity(text: &str) -> Result<GradientOpacity, String> {
    if text.trim() == "none" {
        return Ok(GradientOpacity(Vec::new()));
    }
    match pair(text).map(|ends| ends.map(f64::from)) {
        Ok([low, high]) if 0.0 <= low && low <= high => {
            let point = |intensity, opacity| OpacityPoint { intensity, opacity };
            Ok(GradientOpacity(vec![point(low, 0.0), point(high, 1.0)]))
        }
        _ => Err("two gradients from 0 on are needed, the lower one first, as 20,80; or none".into()),
    }
}

/// Parses a precision.
pub fn precision(text: &str) -> Result<Precision, String> {
    match text {
        "full" => Ok(Precision::Full),
        "packed" => Ok(Precision::Packed),
        _ => Err("full or packed".into()),
    }
}

/// Parses `on` or `off`.
pub fn on_off(text: &str) -> Result<bool, String> {
    match text {
        "on" => Ok(true),
        "off" => Ok(false),
        _ => Err("on or off".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backgrounds() {
        assert_eq!("#ff0080".parse::<Background>().unwrap().0.unwrap()[0], 1.0);
        assert!("transparent".parse::<Background>().unwrap().0.is_none());
        for text in ["", "#ff00", "#gg0000", "pink", "#é2345"] {
            assert!(text.parse::<Background>().is_err(), "{text}");
        }
    }
}
