//! Values of the flags of `vgs render`.

use std::str::FromStr;

use engine::render::{Classification, Precision};
use engine::transfer::OpacityPoint;

use crate::shared::flags::{Size, pair};
use crate::shared::viewing::number;

/// Pixels per inch of a printed picture whose size is a length.
pub const DPI: f64 = 300.0;
/// Greatest width or height of a picture, pixels.
const WIDEST: f64 = 16384.0;

/// Width and height of a picture, on the screen or on paper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PictureSize {
    /// Pixels.
    Pixels([u32; 2]),
    /// Inches on paper.
    Inches([f64; 2]),
}

impl PictureSize {
    /// Returns width and height, pixels, of a picture of so many pixels per inch, at least 1.
    pub fn pixels(self, dpi: Option<f64>) -> [u32; 2] {
        match self {
            PictureSize::Pixels(size) => size,
            PictureSize::Inches(size) => size.map(|n| (n * dpi.unwrap_or(DPI)).round().max(1.0) as u32),
        }
    }

    /// Returns the pixels per inch that the file says, if any.
    pub fn printed(self, dpi: Option<f64>) -> Option<f64> {
        dpi.or(matches!(self, PictureSize::Inches(_)).then_some(DPI))
    }

    /// Returns true if every device can be asked for so many pixels.
    pub fn is_sound(self, dpi: Option<f64>) -> bool {
        self.pixels(dpi).iter().all(|n| (1.0..=WIDEST).contains(&f64::from(*n)))
    }
}

impl FromStr for PictureSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let lengths = [("mm", 25.4), ("cm", 2.54), ("in", 1.0)];
        let found = lengths.iter().find_map(|(unit, each)| Some((text.trim().strip_suffix(unit)?, *each)));
        let Some((text, each_inch)) = found else {
            return text
                .parse()
                .map(|Size(size)| PictureSize::Pixels(size))
                .map_err(|e| format!("{e}, or as 85x60mm"));
        };
        let sides: Result<Vec<f64>, _> = text.split(['x', 'X', ',']).map(|t| t.trim().parse()).collect();
        let size = match sides.as_deref() {
            Ok(&[n]) => [n, n],
            Ok(&[w, h]) => [w, h],
            _ => return Err("width and height are needed, as 1920x1080, 85x60mm or 3.3x2.5in".into()),
        };
        match size.iter().all(|n| n.is_finite() && *n > 0.0) {
            true => Ok(PictureSize::Inches(size.map(|n| n / each_inch))),
            false => Err("lengths above 0 are needed".into()),
        }
    }
}

/// Parses a number of pixels per inch.
pub fn dpi(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(dpi) if (1.0..=10_000.0).contains(&dpi) => Ok(dpi),
        _ => Err("a number from 1 to 10000 is needed, as 300".into()),
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

/// Parses a sample distance.
pub fn step(text: &str) -> Result<f64, String> {
    number(text, 0.01..=100.0)
}

/// Parses a length of the cells of a ray.
pub fn cell(text: &str) -> Result<f64, String> {
    number(text, 0.01..=2.0)
}

/// Parses a distance of voxels.
pub fn pitch(text: &str) -> Result<f64, String> {
    number(text, 0.25..=16.0)
}

/// Parses a number above 0.
pub fn above_zero(text: &str) -> Result<f64, String> {
    let found = text.parse().ok().filter(|v: &f64| *v > 0.0 && v.is_finite());
    found.ok_or_else(|| "a number above 0 is needed".to_owned())
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_pixels_or_lengths() {
        let size = |text: &str| text.parse::<PictureSize>().unwrap();
        assert_eq!(size("1920x1080").pixels(None), [1920, 1080]);
        assert_eq!(
            (size("640").pixels(Some(72.0)), size("640").printed(Some(72.0))),
            ([640, 640], Some(72.0))
        );
        assert_eq!(size("640").printed(None), None);
        for (text, dpi, pixels) in [
            ("85x60mm", None, [1004, 709]),
            ("8.5x6cm", Some(600.0), [2008, 1417]),
            ("3.5x2 in", Some(100.0), [350, 200]),
            ("1in", None, [300, 300]),
        ] {
            assert_eq!(size(text).pixels(dpi), pixels, "{text}");
            assert_eq!(size(text).printed(dpi), Some(dpi.unwrap_or(300.0)));
            assert!(size(text).is_sound(dpi));
        }
        assert!(!size("3000x10mm").is_sound(None) && size("3000x10mm").is_sound(Some(10.0)));
        for text in ["", "0x5mm", "axb", "85x60x3mm", "-1in", "nanmm", "mm", "20000", "85x60pt"] {
            assert!(text.parse::<PictureSize>().is_err(), "{text}");
        }
        for text in ["0", "nan", "1e9", "x"] {
            assert!(dpi(text).is_err(), "{text}");
        }
    }
}
