//! Windows as transfer functions: a grey ramp by width and level, as on a radiologist's screen.

use glam::DVec3;

use super::{ColourPoint, Material, OpacityPoint, TransferFunction};
use base::error::{Error, Kind, Result};

/// A window with a name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Lower-case name.
    pub name: &'static str,
    /// Intensities from black to white, HU.
    pub width: f64,
    /// Intensity in the middle of the window, HU.
    pub level: f64,
}

const fn row(name: &'static str, width: f64, level: f64) -> Window {
    Window { name, width, level }
}

/// Windows in common use for CT.
pub const WINDOWS: &[Window] = &[
    row("abdomen", 400.0, 40.0),
    row("angio", 600.0, 300.0),
    row("bone", 1800.0, 400.0),
    row("brain", 80.0, 40.0),
    row("liver", 150.0, 60.0),
    row("lung", 1500.0, -600.0),
    row("mediastinum", 350.0, 50.0),
    row("soft-tissue", 400.0, 50.0),
    row("spine", 300.0, 50.0),
    row("stroke", 40.0, 40.0),
    row("temporal-bone", 2800.0, 600.0),
];

/// Opacity per millimetre of white unless another is given: a few centimetres remain translucent.
pub const WINDOW_OPACITY: f64 = 0.1;

/// Returns the window called `name`, in either case.
pub fn window(name: &str) -> Option<&'static Window> {
    WINDOWS.iter().find(|w| w.name.eq_ignore_ascii_case(name))
}

/// Returns a grey ramp without shading: black and transparent up to `level - width / 2`, white with an
/// opacity of `max_opacity` per millimetre from `level + width / 2` on.
///
/// # Errors
/// [`Kind::Usage`] if `width` is not positive, or a number is out of range.
pub fn window_level(width: f64, level: f64, max_opacity: f64) -> Result<TransferFunction> {
    let refuse = |message: String| {
        Error::new(Kind::Usage, "VGS-TF-005", message)
            .help("a window has a width above 0, a level, and an opacity per millimetre between 0 and 1")
    };
    if width.is_nan() || width <= 0.0 {
        return Err(refuse(format!("a window cannot be {width} wide")));
    }
    let ends = [(level - width / 2.0, 0.0), (level + width / 2.0, 1.0)];
    let colours = ends.map(|(intensity, grey)| ColourPoint { intensity, colour: DVec3::splat(grey) });
    let opacities = ends.map(|(intensity, share)| OpacityPoint { intensity, opacity: share * max_opacity });
    let name = format!("W{width} L{level}");
    TransferFunction::new(name, colours.to_vec(), opacities.to_vec(), Material::default())
        .map_err(|e| refuse(e.message))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_is_a_grey_ramp() {
        let brain = window("Brain").unwrap();
        let tf = window_level(brain.width, brain.level, 0.4).unwrap();
        for (v, share) in [(-500.0, 0.0), (0.0, 0.0), (20.0, 0.25), (40.0, 0.5), (80.0, 1.0), (900.0, 1.0)] {
            let (colour, opacity) = tf.at(v);
            assert!((colour - DVec3::splat(share)).length() < 1e-12 && (opacity - 0.4 * share).abs() < 1e-12);
        }
        assert_eq!(tf.visible(), Some([0.0, f64::INFINITY]));
        assert!(!tf.material.shade);
        for bad in
            [(0.0, 0.0, 0.1), (-1.0, 0.0, 0.1), (f64::NAN, 0.0, 0.1), (1.0, f64::NAN, 0.1), (1.0, 0.0, 2.0)]
        {
            let error = window_level(bad.0, bad.1, bad.2).unwrap_err();
            assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-TF-005"), "{bad:?}");
        }
        for w in WINDOWS {
            window_level(w.width, w.level, WINDOW_OPACITY).unwrap();
        }
    }
}
