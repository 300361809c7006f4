//! Mixing of colours between two control points: the colour spaces of ParaView.
//!
//! Lab is CIE 1976 L*a*b* under D65, from sRGB. Diverging is Moreland's ("Diverging Color Maps for Scientific
//! Visualization", 2009): a polar form of Lab, with white between two saturated colours of different hue. HSV goes
//! from one hue to the other along the numbers, so blue to red passes green; only wrapped HSV takes the shorter way
//! around the circle of hues.

use std::f64::consts::{PI, TAU};

use glam::{DMat3, DVec3};

/// How two colours are mixed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ColourSpace {
    Rgb,
    Hsv,
    /// HSV by the shorter way around the circle of hues.
    HsvWrapped,
    Lab,
    Diverging,
    /// Colours are not mixed: the second colour holds from the first point on.
    Step,
}

/// ParaView's names of its colour spaces. Its path through Lab with even steps of CIEDE2000 is searched for on a coarse
/// grid of colours; the straight line in Lab is close to it.
pub const NAMES: [(&str, ColourSpace); 7] = [
    ("RGB", ColourSpace::Rgb),
    ("HSV", ColourSpace::Hsv),
    ("Lab", ColourSpace::Lab),
    ("CIELAB", ColourSpace::Lab),
    (CIEDE2000, ColourSpace::Lab),
    ("Diverging", ColourSpace::Diverging),
    ("Step", ColourSpace::Step),
];

/// The one space of [`NAMES`] that is not mixed exactly as ParaView does.
pub const CIEDE2000: &str = "Lab/CIEDE2000";

/// Returns the colour space that ParaView calls by this name.
pub fn find(name: &str) -> Option<ColourSpace> {
    NAMES.iter().find(|(known, _)| name.eq_ignore_ascii_case(known)).map(|(_, space)| *space)
}

impl ColourSpace {
    /// Returns the colour at `share` of the way from `a` to `b`, in display-referred RGB.
    pub fn mix(self, a: DVec3, b: DVec3, share: f64) -> DVec3 {
        let mixed = match self {
            ColourSpace::Rgb => a.lerp(b, share),
            ColourSpace::Step => b,
            ColourSpace::Hsv => mix_hsv(a, b, share, false),
            ColourSpace::HsvWrapped => mix_hsv(a, b, share, true),
            ColourSpace::Lab => rgb_from_lab(lab_from_rgb(a).lerp(lab_from_rgb(b), share)),
            ColourSpace::Diverging => mix_diverging(a, b, share),
        };
        mixed.clamp(DVec3::ZERO, DVec3::ONE)
    }
}

/// Reference white D65.
const WHITE: DVec3 = DVec3::new(0.9505, 1.0, 1.089);

/// Matrix from linear sRGB to CIE XYZ, by columns.
const XYZ_FROM_LINEAR: DMat3 = DMat3::from_cols(
    DVec3::new(0.4124, 0.2126, 0.0193),
    DVec3::new(0.3576, 0.7152, 0.1192),
    DVec3::new(0.1805, 0.0722, 0.9505),
);

fn lab_from_rgb(rgb: DVec3) -> DVec3 {
    let linear = rgb.map(|v| if v > 0.04045 { ((v + 0.055) / 1.055).powf(2.4) } else { v / 12.92 });
    let root = |v: f64| if v > 0.008856 { v.cbrt() } else { 7.787 * v + 16.0 / 116.0 };
    let f = (XYZ_FROM_LINEAR * linear / WHITE).map(root);
    DVec3::new(116.0 * f.y - 16.0, 500.0 * (f.x - f.y), 200.0 * (f.y - f.z))
}

fn rgb_from_lab(lab: DVec3) -> DVec3 {
    let y = (lab.x + 16.0) / 116.0;
    let f = DVec3::new(y + lab.y / 500.0, y, y - lab.z / 200.0);
    let xyz = f.map(|v| if v.powi(3) > 0.008856 { v.powi(3) } else { (v - 16.0 / 116.0) / 7.787 }) * WHITE;
    let linear = XYZ_FROM_LINEAR.inverse() * xyz;
    let rgb = linear.map(|v| if v > 0.003_130_8 { 1.055 * v.powf(1.0 / 2.4) - 0.055 } else { 12.92 * v });
    // A colour that is too bright for the display keeps its hue, as in VTK.
    rgb / rgb.max_element().max(1.0)
}

/// A colour in Moreland's polar Lab: magnitude, saturation, hue.
#[derive(Clone, Copy)]
struct Msh {
    magnitude: f64,
    saturation: f64,
    hue: f64,
}

impl Msh {
    fn of(rgb: DVec3) -> Self {
        let lab = lab_from_rgb(rgb);
        let magnitude = lab.length();
        let saturation = if magnitude > 1e-3 { (lab.x / magnitude).clamp(-1.0, 1.0).acos() } else { 0.0 };
        Msh { magnitude, saturation, hue: if saturation > 1e-3 { lab.z.atan2(lab.y) } else { 0.0 } }
    }

    fn rgb(self) -> DVec3 {
        let (sin, cos) = self.saturation.sin_cos();
        rgb_from_lab(self.magnitude * DVec3::new(cos, sin * self.hue.cos(), sin * self.hue.sin()))
    }

    /// Returns the hue to give an unsaturated colour of this `magnitude` next to this one, so that the way
    /// between them looks even.
    fn hue_towards(self, magnitude: f64) -> f64 {
        if self.magnitude >= magnitude - 0.1 {
            return self.hue;
        }
        let spin = self.saturation * (magnitude * magnitude - self.magnitude * self.magnitude).sqrt()
            / (self.magnitude * self.saturation.sin());
        // Away from purple.
        if self.hue > -0.3 * PI { self.hue + spin } else { self.hue - spin }
    }
}

fn mix_diverging(a: DVec3, b: DVec3, mut share: f64) -> DVec3 {
    const SATURATED: f64 = 0.05;
    let (mut a, mut b) = (Msh::of(a), Msh::of(b));
    let apart = (a.hue - b.hue).abs();
    let apart = apart.min(TAU - apart);
    if a.saturation > SATURATED && b.saturation > SATURATED && apart > PI / 3.0 {
        let white = Msh { magnitude: a.magnitude.max(b.magnitude).max(88.0), saturation: 0.0, hue: 0.0 };
        if share < 0.5 {
            b = white;
            share *= 2.0;
        } else {
            a = white;
            share = 2.0 * share - 1.0;
        }
    }
    if a.saturation < SATURATED && b.saturation > SATURATED {
        a.hue = b.hue_towards(a.magnitude);
    } else if b.saturation < SATURATED && a.saturation > SATURATED {
        b.hue = a.hue_towards(b.magnitude);
    }
    let mix = |a: f64, b: f64| a + (b - a) * share;
    Msh {
        magnitude: mix(a.magnitude, b.magnitude),
        saturation: mix(a.saturation, b.saturation),
        hue: mix(a.hue, b.hue),
    }
    .rgb()
}

/// Converts RGB to hue in turns, saturation and value.
fn hsv_from_rgb(rgb: DVec3) -> DVec3 {
    let (max, min) = (rgb.max_element(), rgb.min_element());
    let width = max - min;
    if width <= 0.0 {
        return DVec3::new(0.0, 0.0, max);
    }
    let sixths = if rgb.x == max {
        (rgb.y - rgb.z) / width
    } else if rgb.y == max {
        2.0 + (rgb.z - rgb.x) / width
    } else {
        4.0 + (rgb.x - rgb.y) / width
    };
    DVec3::new((sixths / 6.0).rem_euclid(1.0), width / max, max)
}

fn rgb_from_hsv(hsv: DVec3) -> DVec3 {
    let channel = |shift: f64| {
        let k = (shift + 6.0 * hsv.x).rem_euclid(6.0);
        hsv.z * (1.0 - hsv.y * k.min(4.0 - k).clamp(0.0, 1.0))
    };
    DVec3::new(channel(5.0), channel(3.0), channel(1.0))
}

fn mix_hsv(a: DVec3, b: DVec3, share: f64, wraps: bool) -> DVec3 {
    let (mut a, b) = (hsv_from_rgb(a), hsv_from_rgb(b));
    if wraps && (a.x - b.x).abs() > 0.5 {
        a.x += if a.x < b.x { 1.0 } else { -1.0 };
    }
    rgb_from_hsv(a.lerp(b, share))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(a: DVec3, b: DVec3, tolerance: f64) -> bool {
        (a - b).abs().max_element() < tolerance
    }

    #[test]
    fn every_space_has_the_colours_at_its_ends() {
        let colours =
            [[0.23, 0.30, 0.75], [0.70, 0.02, 0.15], [0.0; 3], [1.0; 3], [0.5, 0.5, 0.0], [0.2, 0.2, 0.2]];
        let spaces = [
            ColourSpace::Rgb,
            ColourSpace::Hsv,
            ColourSpace::HsvWrapped,
            ColourSpace::Lab,
            ColourSpace::Diverging,
        ];
        for space in spaces {
            for a in colours.map(DVec3::from_array) {
                for b in colours.map(DVec3::from_array) {
                    assert!(near(space.mix(a, b, 0.0), a, 2e-3), "{space:?} {a} {b}");
                    assert!(near(space.mix(a, b, 1.0), b, 2e-3), "{space:?} {a} {b}");
                    assert!(space.mix(a, b, 0.3).is_finite());
                }
            }
        }
    }

    #[test]
    fn known_colours_lie_where_they_should() {
        // sRGB red in Lab (D65): 53.24, 80.09, 67.20.
        assert!(near(lab_from_rgb(DVec3::X), DVec3::new(53.24, 80.09, 67.20), 0.05));
        // Middle grey of Lab is L* = 50: sRGB 0.466.
        assert!(near(ColourSpace::Lab.mix(DVec3::ZERO, DVec3::ONE, 0.5), DVec3::splat(0.4663), 1e-3));
        // Moreland's cool to warm has a light grey in its middle: 221, 221, 221 of 255.
        let (cool, warm) = (DVec3::new(0.230, 0.299, 0.754), DVec3::new(0.706, 0.016, 0.150));
        assert!(near(ColourSpace::Diverging.mix(cool, warm, 0.5), DVec3::splat(0.865), 5e-3));
        assert_eq!(find("cielab"), Some(ColourSpace::Lab));
        assert_eq!(find("wrapped"), None);
    }

    /// Colours of vtkColorTransferFunction, VTK 9.7.2, at eighths of the way.
    #[test]
    fn every_space_mixes_as_vtk_does() {
        let (blue, red, white) = (DVec3::Z, DVec3::X, DVec3::ONE);
        let (cool, warm) = (DVec3::new(0.230, 0.299, 0.754), DVec3::new(0.706, 0.016, 0.150));
        let (gold, plum) = (DVec3::new(0.9, 0.9, 0.2), DVec3::new(0.5, 0.0, 0.4));
        let cases = [
            (ColourSpace::Rgb, cool, warm, 3, [0.4085, 0.1929, 0.5275]),
            (ColourSpace::Hsv, blue, red, 2, [0.0, 1.0, 1.0]),
            (ColourSpace::Hsv, blue, red, 4, [0.0, 1.0, 0.0]),
            (ColourSpace::Hsv, blue, red, 7, [1.0, 0.5, 0.0]),
            (ColourSpace::Hsv, white, blue, 5, [0.375, 1.0, 0.6875]),
            (ColourSpace::HsvWrapped, blue, red, 4, [1.0, 0.0, 1.0]),
            (ColourSpace::HsvWrapped, blue, red, 1, [0.25, 0.0, 1.0]),
            (ColourSpace::Lab, cool, warm, 4, [0.5806, 0.2032, 0.444]),
            (ColourSpace::Lab, blue, red, 2, [0.6052, 0.0, 0.7629]),
            (ColourSpace::Lab, blue, red, 7, [0.9572, 0.0, 0.192]),
            (ColourSpace::Diverging, cool, warm, 2, [0.5532, 0.689, 0.9954]),
            (ColourSpace::Diverging, cool, warm, 4, [0.8654, 0.8654, 0.8654]),
            (ColourSpace::Diverging, cool, warm, 7, [0.8695, 0.3785, 0.3003]),
            (ColourSpace::Diverging, blue, red, 6, [1.0, 0.6844, 0.443]),
            (ColourSpace::Step, gold, plum, 1, [0.5, 0.0, 0.4]),
        ];
        for (space, a, b, eighths, expected) in cases {
            let mixed = space.mix(a, b, f64::from(eighths) / 8.0);
            assert!(near(mixed, DVec3::from(expected), 2e-3), "{space:?} {a} {b} {eighths}: {mixed}");
        }
    }
}
