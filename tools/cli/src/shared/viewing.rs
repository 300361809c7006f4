//! Where a scene is seen from, and what is behind it, as flags have it.

use std::ops::RangeInclusive;
use std::path::Path;
use std::str::FromStr;

use engine::render::{CameraFile, hex_colour};

use super::texts::text_of;

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

/// Parses a number of a range.
pub fn number(text: &str, range: RangeInclusive<f64>) -> Result<f64, String> {
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
