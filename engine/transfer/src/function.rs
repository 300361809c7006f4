//! Transfer functions: control points, and the lines between them.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use base::error::{Error, Kind, Result};

/// The greatest opacity per millimetre that differs from 1, whose extinction would be infinite.
pub const MAX_OPACITY: f64 = 0.9995;
/// Control points lie within this distance of 0, so that `f32` holds all that follows from them.
pub const MAX_INTENSITY: f64 = 1e36;
/// How far a number of a file may lie beyond 0 to 1: the last digit of a rounded number.
const ROUNDING: f64 = 1e-6;

/// The colour at an intensity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColourPoint {
    /// Intensity, HU for CT.
    pub intensity: f64,
    /// Red, green, blue from 0 to 1, display-referred: the numbers of an sRGB picture.
    pub colour: DVec3,
}

/// The opacity at an intensity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OpacityPoint {
    /// Intensity, HU for CT; for gradient opacity, the magnitude of the gradient of the intensity.
    pub intensity: f64,
    /// Share of light that one millimetre absorbs, 0 to 1.
    pub opacity: f64,
}

/// How a surface reflects light, as in VTK and Slicer (Blinn-Phong).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// True if there is shading; otherwise colours appear as they are.
    pub shade: bool,
    /// Share of the colour that does not depend on the light.
    pub ambient: f64,
    /// Share of the colour that depends on the angle to the light.
    pub diffuse: f64,
    /// Strength of the highlight.
    pub specular: f64,
    /// Exponent of the highlight: the greater, the smaller the highlight.
    pub power: f64,
    /// Share of the light that is lost where all around is opaque, 0 to 1: ambient occlusion. Modes that march rays
    /// show it.
    #[serde(default)]
    pub occlusion: f64,
}

impl Default for Material {
    /// Returns the material that VTK starts with: no shading.
    fn default() -> Self {
        Material { shade: false, ambient: 0.1, diffuse: 0.7, specular: 0.2, power: 10.0, occlusion: 0.0 }
    }
}

/// Colour and opacity per millimetre over intensity: linear between control points, constant beyond them. Two
/// points at one intensity are a step; the later one holds from there on.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferFunction {
    /// Name for people; may be empty.
    pub name: String,
    /// Reflection of light.
    pub material: Material,
    colours: Vec<ColourPoint>,
    opacities: Vec<OpacityPoint>,
    gradient_opacities: Vec<OpacityPoint>,
}

/// A control point: its intensity and a value that can be interpolated.
pub(super) trait Point: Copy {
    type Value: Copy + std::ops::Mul<f64, Output = Self::Value> + std::ops::Add<Output = Self::Value>;
    fn intensity(&self) -> f64;
    fn value(&self) -> Self::Value;
}

impl Point for ColourPoint {
    type Value = DVec3;
    fn intensity(&self) -> f64 {
        self.intensity
    }
    fn value(&self) -> DVec3 {
        self.colour
    }
}

impl Point for OpacityPoint {
    type Value = f64;
    fn intensity(&self) -> f64 {
        self.intensity
    }
    fn value(&self) -> f64 {
        self.opacity
    }
}

/// The side from which a function is evaluated; it matters only at a step.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum From {
    Below,
    Above,
}

/// Returns the value at `v` of the straight lines through the sorted `points`.
pub(super) fn interpolate<P: Point>(points: &[P], v: f64, from: From) -> P::Value {
    let next = points.partition_point(|p| match from {
        From::Above => p.intensity() <= v,
        From::Below => p.intensity() < v,
    });
    if next == 0 {
        return points[0].value();
    }
    let low = points[next - 1];
    let Some(high) = points.get(next) else { return low.value() };
    let share = (v - low.intensity()) / (high.intensity() - low.intensity());
    low.value() * (1.0 - share) + high.value() * share
}

/// Returns the extinction, 1/mm, for an opacity per millimetre.
pub(super) fn extinction_of(opacity: f64) -> f64 {
    -(-opacity.min(MAX_OPACITY)).ln_1p()
}

/// Sorts points by intensity. Points of equal intensity stay in the given order, and only the first and the
/// last of them are kept.
fn sorted<P: Point>(mut points: Vec<P>) -> Vec<P> {
    points.sort_by(|a, b| a.intensity().total_cmp(&b.intensity()));
    let same = |i: usize, j: usize, all: &[P]| all[i].intensity() == all[j].intensity();
    let keep: Vec<bool> = (0..points.len())
        .map(|i| {
            let between = i > 0 && i + 1 < points.len();
            !(between && same(i - 1, i, &points) && same(i, i + 1, &points))
        })
        .collect();
    points.iter().zip(keep).filter(|(_, keep)| *keep).map(|(p, _)| *p).collect()
}

fn invalid(message: String) -> Error {
    Error::new(Kind::BadData, "VGS-TF-001", message)
        .help("intensities must be finite numbers, colours and opacities between 0 and 1")
}

fn checked_intensity(what: &str, index: usize, intensity: f64) -> Result<f64> {
    if intensity.abs() <= MAX_INTENSITY {
        // Without the sign of -0, which would sort before 0.
        return Ok(intensity + 0.0);
    }
    Err(invalid(format!("{what} point {}: its intensity is {intensity}", index + 1)))
}

fn share(what: &str, index: usize, value: f64) -> Result<f64> {
    if (-ROUNDING..=1.0 + ROUNDING).contains(&value) {
        return Ok(value.clamp(0.0, 1.0));
    }
    Err(invalid(format!("{what} point {}: {value} is not between 0 and 1", index + 1)))
}

fn checked_opacities(what: &str, points: Vec<OpacityPoint>) -> Result<Vec<OpacityPoint>> {
    let check = |(i, p): (usize, OpacityPoint)| {
        let intensity = checked_intensity(what, i, p.intensity)?;
        Ok(OpacityPoint { intensity, opacity: share(what, i, p.opacity)? })
    };
    points.into_iter().enumerate().map(check).collect::<Result<_>>().map(sorted)
}

fn checked_colours(points: Vec<ColourPoint>) -> Result<Vec<ColourPoint>> {
    let check = |(i, p): (usize, ColourPoint)| {
        let intensity = checked_intensity("colour", i, p.intensity)?;
        let [r, g, b] = p.colour.to_array().map(|value| share("colour", i, value));
        Ok(ColourPoint { intensity, colour: DVec3::new(r?, g?, b?) })
    };
    points.into_iter().enumerate().map(check).collect::<Result<_>>().map(sorted)
}

impl TransferFunction {
    /// Creates a transfer function from control points in any order; points at one intensity stay in the
    /// order in which they are given.
    ///
    /// # Errors
    /// [`Kind::BadData`] if there is no colour or no opacity, if a number is not finite or too large, if a
    /// colour or an opacity is not between 0 and 1, if a coefficient of the material is negative, or if its
    /// ambient occlusion is not between 0 and 1.
    pub fn new(
        name: impl Into<String>,
        colours: Vec<ColourPoint>,
        opacities: Vec<OpacityPoint>,
        material: Material,
    ) -> Result<Self> {
        for (what, count) in [("colour", colours.len()), ("opacity", opacities.len())] {
            if count == 0 {
                let message = format!("the transfer function has no {what} points");
                return Err(Error::new(Kind::BadData, "VGS-TF-002", message)
                    .help("give at least one control point of colour and one of opacity"));
            }
        }
        let Material { ambient, diffuse, specular, power, .. } = material;
        for (what, value) in
            [("ambient", ambient), ("diffuse", diffuse), ("specular", specular), ("specular power", power)]
        {
            if !(0.0..=f64::from(f32::MAX)).contains(&value) {
                let message = format!("the {what} coefficient of the material is {value}");
                return Err(Error::new(Kind::BadData, "VGS-TF-003", message)
                    .help("coefficients of a material are 0 or more"));
            }
        }
        if !(0.0..=1.0).contains(&material.occlusion) {
            let message = format!("the ambient occlusion of the material is {}", material.occlusion);
            return Err(Error::new(Kind::BadData, "VGS-TF-012", message).help(
                "it is a share of the light: 0 is none, 1 leaves no light where all around is opaque",
            ));
        }
        Ok(TransferFunction {
            name: name.into(),
            material,
            colours: checked_colours(colours)?,
            opacities: checked_opacities("opacity", opacities)?,
            gradient_opacities: Vec::new(),
        })
    }

    /// Adds factors of the opacity over the magnitude of the gradient, as VTK has them: of the change of the
    /// intensity over the mean edge of the CT's voxels. Modes that march rays draw them.
    ///
    /// # Errors
    /// [`Kind::BadData`] as in [`TransferFunction::new`].
    pub fn with_gradient_opacity(mut self, points: Vec<OpacityPoint>) -> Result<Self> {
        self.gradient_opacities = checked_opacities("gradient opacity", points)?;
        Ok(self)
    }

    /// Returns the control points of colour, sorted; at most two at one intensity.
    pub fn colours(&self) -> &[ColourPoint] {
        &self.colours
    }

    /// Returns the control points of opacity per millimetre, sorted; at most two at one intensity.
    pub fn opacities(&self) -> &[OpacityPoint] {
        &self.opacities
    }

    /// Returns the control points of gradient opacity; often there are none.
    pub fn gradient_opacities(&self) -> &[OpacityPoint] {
        &self.gradient_opacities
    }

    /// Returns true if there is a gradient opacity other than 1, which changes the picture.
    pub fn depends_on_gradient(&self) -> bool {
        self.gradient_opacities.iter().any(|p| p.opacity != 1.0)
    }

    /// Returns the colour and opacity per millimetre at an intensity.
    pub fn at(&self, v: f64) -> (DVec3, f64) {
        self.side(v, From::Above)
    }

    pub(super) fn side(&self, v: f64, from: From) -> (DVec3, f64) {
        (interpolate(&self.colours, v, from), interpolate(&self.opacities, v, from))
    }

    /// Returns the extinction at an intensity, 1/mm.
    pub fn extinction(&self, v: f64) -> f64 {
        extinction_of(interpolate(&self.opacities, v, From::Above))
    }

    /// Returns the least and the greatest intensity between which the function has an opacity, ±∞ where it
    /// goes on beyond the last control point; `None` if all is transparent. There may be transparent
    /// stretches inside.
    pub fn visible(&self) -> Option<[f64; 2]> {
        let points = &self.opacities;
        let first = points.iter().position(|p| p.opacity > 0.0)?;
        let last = points.iter().rposition(|p| p.opacity > 0.0)?;
        // Opacity rises from the last transparent point and falls to the next one.
        let low = if first == 0 { f64::NEG_INFINITY } else { points[first - 1].intensity };
        let high = points.get(last + 1).map_or(f64::INFINITY, |p| p.intensity);
        Some([low, high])
    }

    /// Returns the intensities of a colour bar: those that the function shows, as far as there are any in `range`;
    /// `None` if there are none. Where the function goes on without end, its last control point is the end.
    pub fn shown_in(&self, range: [f64; 2]) -> Option<[f64; 2]> {
        let ([low, high], [first, last]) = (self.visible()?, self.extent());
        let low = if low.is_finite() { low } else { first }.max(range[0]);
        let high = if high.is_finite() { high } else { last }.min(range[1]);
        (low < high).then_some([low, high])
    }

    /// Returns the intensities of the first and the last control point of colour or opacity.
    pub fn extent(&self) -> [f64; 2] {
        let ends = |first: f64, last: f64, other: [f64; 2]| [first.min(other[0]), last.max(other[1])];
        let colours = (self.colours[0].intensity, self.colours[self.colours.len() - 1].intensity);
        let opacities = [self.opacities[0].intensity, self.opacities[self.opacities.len() - 1].intensity];
        ends(colours.0, colours.1, opacities)
    }

    /// Returns the same function with all intensities greater by `by`.
    ///
    /// # Errors
    /// [`Kind::BadData`] if control points would leave ±[`MAX_INTENSITY`].
    pub fn shifted(&self, by: f64) -> Result<Self> {
        self.moved(|v| v + by, 1.0)
    }

    /// Returns the same function over other intensities: the linear map that takes `from[0]` to `to[0]` and
    /// `from[1]` to `to[1]` is applied to all control points.
    ///
    /// # Errors
    /// [`Kind::Usage`] if a range is empty or not finite, [`Kind::BadData`] if control points would leave
    /// ±[`MAX_INTENSITY`].
    pub fn stretched(&self, from: [f64; 2], to: [f64; 2]) -> Result<Self> {
        for [low, high] in [from, to] {
            if !(low < high && (high - low).is_finite()) {
                let message = format!("cannot stretch a transfer function over {low} to {high}");
                return Err(Error::new(Kind::Usage, "VGS-TF-004", message)
                    .help("give two different finite intensities, the smaller one first"));
            }
        }
        let factor = (to[1] - to[0]) / (from[1] - from[0]);
        self.moved(|v| to[0] + (v - from[0]) * factor, factor)
    }

    fn moved(&self, place: impl Fn(f64) -> f64, factor: f64) -> Result<Self> {
        let colours = self.colours.iter().map(|p| ColourPoint { intensity: place(p.intensity), ..*p });
        let opacities = self.opacities.iter().map(|p| OpacityPoint { intensity: place(p.intensity), ..*p });
        // Gradients are differences of intensities: a shift does not change them.
        let gradients =
            self.gradient_opacities.iter().map(|p| OpacityPoint { intensity: p.intensity * factor, ..*p });
        TransferFunction::new(self.name.clone(), colours.collect(), opacities.collect(), self.material)?
            .with_gradient_opacity(gradients.collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn opacity(points: &[(f64, f64)]) -> Vec<OpacityPoint> {
        points.iter().map(|&(intensity, opacity)| OpacityPoint { intensity, opacity }).collect()
    }

    fn grey(points: &[(f64, f64)]) -> Vec<ColourPoint> {
        points.iter().map(|&(intensity, g)| ColourPoint { intensity, colour: DVec3::splat(g) }).collect()
    }

    fn tf(opacities: &[(f64, f64)]) -> TransferFunction {
        TransferFunction::new("t", grey(&[(0.0, 0.2), (100.0, 1.0)]), opacity(opacities), Material::default())
            .unwrap()
    }

    #[test]
    fn linear_between_points_and_constant_beyond() {
        let f = tf(&[(100.0, 0.5), (0.0, 0.1)]);
        for (v, colour, alpha) in
            [(-1e9, 0.2, 0.1), (0.0, 0.2, 0.1), (25.0, 0.4, 0.2), (100.0, 1.0, 0.5), (1e9, 1.0, 0.5)]
        {
            let (c, a) = f.at(v);
            assert!((c - DVec3::splat(colour)).abs().max_element() < 1e-12, "{v}: {c}");
            assert!((a - alpha).abs() < 1e-12, "{v}: {a}");
        }
        assert!((f.extinction(200.0) - 2f64.ln()).abs() < 1e-12);
        assert_eq!(tf(&[(0.0, 1.0)]).extinction(0.0), -(1.0 - MAX_OPACITY).ln());
    }

    #[test]
    fn of_several_points_at_one_intensity_the_last_holds_to_the_right() {
        let f = tf(&[(50.0, 0.2), (50.0, 0.9), (50.0, 0.4), (0.0, 0.0), (100.0, 0.8)]);
        assert_eq!(f.opacities().len(), 4, "the middle one of three counts for nothing");
        assert_eq!(f.at(50.0).1, 0.4);
        assert!((f.side(50.0, From::Below).1 - 0.2).abs() < 1e-12);
        assert!((f.at(49.999).1 - 0.2).abs() < 1e-4);
        assert!((f.at(75.0).1 - 0.6).abs() < 1e-12);
    }

    #[test]
    fn visible_reaches_to_the_transparent_neighbours() {
        let inf = f64::INFINITY;
        for (points, expected) in [
            (&[(0.0, 0.0), (10.0, 0.0)][..], None),
            (&[(0.0, 0.0), (10.0, 0.0), (20.0, 0.5)], Some([10.0, inf])),
            (&[(0.0, 0.0), (0.0, 0.5), (30.0, 0.5), (30.0, 0.0)], Some([0.0, 30.0])),
            (&[(0.0, 0.3)], Some([-inf, inf])),
            (&[(0.0, 0.3), (10.0, 0.0), (20.0, 0.0), (30.0, 0.1), (40.0, 0.0)], Some([-inf, 40.0])),
        ] {
            assert_eq!(tf(points).visible(), expected, "{points:?}");
        }
    }

    #[test]
    fn shifted_and_stretched() {
        let f = tf(&[(0.0, 0.0), (100.0, 0.5)])
            .with_gradient_opacity(opacity(&[(0.0, 0.0), (50.0, 1.0)]))
            .unwrap();
        let moved = f.shifted(-40.0).unwrap();
        let wide = f.stretched([0.0, 100.0], [1000.0, 3000.0]).unwrap();
        for v in [-20.0, 10.0, 33.3, 120.0] {
            assert!((moved.at(v - 40.0).1 - f.at(v).1).abs() < 1e-12);
            assert!((wide.at(1000.0 + 20.0 * v).1 - f.at(v).1).abs() < 1e-12);
            assert!((wide.at(1000.0 + 20.0 * v).0 - f.at(v).0).length() < 1e-12);
        }
        assert_eq!(moved.gradient_opacities()[1].intensity, 50.0);
        assert_eq!(wide.gradient_opacities()[1].intensity, 1000.0);
        assert_eq!(wide.extent(), [1000.0, 3000.0]);
        assert_eq!(f.stretched([1.0, 1.0], [0.0, 1.0]).unwrap_err().code, "VGS-TF-004");
        assert_eq!(f.stretched([0.0, 1.0], [f64::NAN, 1.0]).unwrap_err().code, "VGS-TF-004");
        assert_eq!(f.shifted(f64::NAN).unwrap_err().code, "VGS-TF-001");
    }

    #[test]
    fn what_makes_no_function_is_refused() {
        let ok = || grey(&[(0.0, 0.5)]);
        let material = Material::default();
        let new = TransferFunction::new;
        for (result, code, text) in [
            (new("", vec![], opacity(&[(0.0, 0.0)]), material), "VGS-TF-002", "no colour points"),
            (new("", ok(), vec![], material), "VGS-TF-002", "no opacity points"),
            (new("", ok(), opacity(&[(0.0, 0.1), (f64::NAN, 0.0)]), material), "VGS-TF-001", "point 2"),
            (new("", ok(), opacity(&[(f64::INFINITY, 0.0)]), material), "VGS-TF-001", "inf"),
            (new("", ok(), opacity(&[(0.0, 1.1)]), material), "VGS-TF-001", "1.1 is not between"),
            (new("", ok(), opacity(&[(0.0, f64::NAN)]), material), "VGS-TF-001", "NaN"),
            (new("", grey(&[(0.0, -0.5)]), opacity(&[(0.0, 0.0)]), material), "VGS-TF-001", "-0.5"),
            (
                new("", ok(), opacity(&[(0.0, 0.0)]), Material { power: -1.0, ..material }),
                "VGS-TF-003",
                "specular power",
            ),
            (
                new("", ok(), opacity(&[(0.0, 0.0)]), Material { occlusion: 1.5, ..material }),
                "VGS-TF-012",
                "ambient occlusion of the material is 1.5",
            ),
            (
                new("", ok(), opacity(&[(0.0, 0.0)]), Material { occlusion: f64::NAN, ..material }),
                "VGS-TF-012",
                "NaN",
            ),
        ] {
            let error = result.unwrap_err();
            assert_eq!((error.kind, error.code), (Kind::BadData, code));
            assert!(error.message.contains(text), "{}", error.message);
        }
        let rounded = new("", ok(), opacity(&[(0.0, 1.000_000_4)]), material).unwrap();
        assert_eq!(rounded.at(0.0).1, 1.0);
    }
}
