//! Transfer function as it is edited: control points with intensity, opacity and colour.
//!
//! The engine keeps points of colour and points of opacity apart. Here they are one list: where either has a
//! point, the joint list has one with both values, so that the function between them does not change.

use engine::Result;
use engine::transfer::{ColourPoint, Material, OpacityPoint, TransferFunction};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// Greatest distance of the ends of a window from 0; far beyond any unit, and within the precision of
/// numbers.
const FARTHEST: f64 = 1e12;

/// Control point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Intensity before the shift, HU for CT.
    pub intensity: f64,
    /// Opacity per millimetre, 0 to 1.
    pub opacity: f64,
    /// Red, green, blue from 0 to 1, display-referred.
    pub colour: DVec3,
}

/// Transfer function as a user edits it. Points ascend; two at one intensity are a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Transfer {
    /// Name for people; may be empty.
    pub name: String,
    /// Added to the intensity of all points, HU for CT.
    #[serde(default)]
    pub shift: f64,
    /// Response to light.
    pub material: Material,
    /// The control points.
    pub points: Vec<Point>,
    /// Factors of the opacity over the magnitude of the gradient, intensity over a mean edge of the CT's voxels.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gradient_opacities: Vec<[f64; 2]>,
}

impl Transfer {
    /// Creates the same function with joint points.
    pub fn new(function: &TransferFunction) -> Self {
        let gradient_opacities =
            function.gradient_opacities().iter().map(|p| [p.intensity, p.opacity]).collect();
        Transfer {
            name: function.name.clone(),
            shift: 0.0,
            material: function.material,
            points: joint(function),
            gradient_opacities,
        }
    }

    /// Returns the gradients below which there is nothing and above which there is all, if the opacity follows such a
    /// ramp.
    pub fn gradient_ramp(&self) -> Option<[f64; 2]> {
        match self.gradient_opacities[..] {
            [[low, 0.0], [high, 1.0]] => Some([low, high]),
            _ => None,
        }
    }

    /// Lets the opacity follow a ramp over the gradient, or the intensity alone.
    pub fn set_gradient_ramp(&mut self, ramp: Option<[f64; 2]>) {
        self.gradient_opacities = ramp.map_or_else(Vec::new, |[low, high]| vec![[low, 0.0], [high, 1.0]]);
    }

    /// Returns the window that the function spans, from the first to the last point, shift included.
    pub fn window(&self) -> [f64; 2] {
        let end = |p: Option<&Point>| p.map_or(0.0, |p| p.intensity + self.shift);
        [end(self.points.first()), end(self.points.last())]
    }

    /// Moves and stretches all points so that they span this window. Points at one intensity are only moved,
    /// and a window that is empty or not finite changes nothing.
    pub fn set_window(&mut self, [low, high]: [f64; 2]) {
        let [old_low, old_high] = self.window();
        let factor = if old_high > old_low { (high - low) / (old_high - old_low) } else { 1.0 };
        if !(low < high && low.abs() <= FARTHEST && high.abs() <= FARTHEST && factor.is_finite()) {
            return;
        }
        for point in &mut self.points {
            point.intensity = low + (point.intensity + self.shift - old_low) * factor - self.shift;
        }
    }

    /// Returns the engine's function, with the shift applied.
    ///
    /// # Errors
    /// Returns the errors of [`TransferFunction::new`]: no points, or a number that is out of range.
    pub fn function(&self) -> Result<TransferFunction> {
        let opacity = |intensity: f64, opacity: f64| OpacityPoint { intensity, opacity };
        let colours = self
            .points
            .iter()
            .map(|p| ColourPoint { intensity: p.intensity + self.shift, colour: p.colour })
            .collect();
        let opacities = self.points.iter().map(|p| opacity(p.intensity + self.shift, p.opacity)).collect();
        let gradients = self.gradient_opacities.iter().map(|&[v, o]| opacity(v, o)).collect();
        TransferFunction::new(self.name.clone(), colours, opacities, self.material)?
            .with_gradient_opacity(gradients)
    }
}

/// Joins points of colour and of opacity into one list.
fn joint(function: &TransferFunction) -> Vec<Point> {
    let (colours, opacities) = (function.colours(), function.opacities());
    let mut intensities: Vec<f64> =
        colours.iter().map(|p| p.intensity).chain(opacities.iter().map(|p| p.intensity)).collect();
    intensities.sort_by(f64::total_cmp);
    intensities.dedup();
    let mut points = Vec::new();
    for v in intensities {
        let (colour, opacity) = function.at(v);
        let here = Point { intensity: v, opacity, colour };
        let colours: Vec<_> = colours.iter().filter(|p| p.intensity == v).collect();
        let opacities: Vec<_> = opacities.iter().filter(|p| p.intensity == v).collect();
        // The first point of a step has the values to the left of it.
        if colours.len() == 2 || opacities.len() == 2 {
            let colour = if colours.len() == 2 { colours[0].colour } else { colour };
            let opacity = if opacities.len() == 2 { opacities[0].opacity } else { opacity };
            points.push(Point { intensity: v, opacity, colour });
        }
        points.push(here);
    }
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use engine::transfer::PRESETS;

    #[test]
    fn joint_points_are_the_same_function() {
        for preset in PRESETS {
            let function = preset.over([-1000.0, 2000.0]);
            let back = Transfer::new(&function).function().expect("a function");
            for i in -1200..2200 {
                let v = f64::from(i) + 0.25;
                let ((c, o), (d, p)) = (function.at(v), back.at(v));
                assert!(c.distance(d) < 1e-12 && (o - p).abs() < 1e-12, "{} at {v}", preset.name);
            }
        }
    }

    #[test]
    fn a_step_stays_a_step() {
        let opacity = |intensity, opacity| OpacityPoint { intensity, opacity };
        let colour = |intensity, grey| ColourPoint { intensity, colour: DVec3::splat(grey) };
        let function = TransferFunction::new(
            "step",
            vec![colour(0.0, 0.0), colour(100.0, 1.0)],
            vec![opacity(50.0, 0.1), opacity(50.0, 0.9), opacity(80.0, 0.2)],
            Material::default(),
        )
        .expect("a function");
        let transfer = Transfer::new(&function);
        let rows: Vec<_> = transfer.points.iter().map(|p| (p.intensity, p.opacity, p.colour.x)).collect();
        assert_eq!(
            rows,
            [(0.0, 0.1, 0.0), (50.0, 0.1, 0.5), (50.0, 0.9, 0.5), (80.0, 0.2, 0.8), (100.0, 0.2, 1.0)]
        );
        let shifted = Transfer { shift: 7.0, ..transfer }.function().expect("a function");
        assert_eq!(shifted.at(57.0).1, 0.9);
        assert!((shifted.at(56.999).1 - 0.1).abs() < 1e-12);
    }

    #[test]
    fn a_window_is_moved_and_stretched() {
        let mut transfer = Transfer::new(&PRESETS[0].over([0.0, 1.0]));
        let before = transfer.clone();
        let [low, high] = transfer.window();
        transfer.shift = 25.0;
        assert_eq!(transfer.window(), [low + 25.0, high + 25.0]);
        transfer.set_window([-100.0, 900.0]);
        let [a, b] = transfer.window();
        assert!((a + 100.0).abs() < 1e-9 && (b - 900.0).abs() < 1e-9 && transfer.shift == 25.0);
        transfer.set_window([low + 25.0, high + 25.0]);
        for (p, q) in transfer.points.iter().zip(&before.points) {
            assert!((p.intensity - q.intensity).abs() < 1e-9);
        }
        let kept = transfer.clone();
        for bad in [[1.0, 1.0], [2.0, 1.0], [f64::NAN, 1.0], [0.0, f64::INFINITY], [0.0, 1e300]] {
            transfer.set_window(bad);
        }
        assert_eq!(transfer, kept);
    }

    #[test]
    fn what_is_no_function_is_an_error() {
        let good = Transfer::new(&PRESETS[0].over([0.0, 1.0]));
        assert!(Transfer { points: Vec::new(), ..good.clone() }.function().is_err());
        assert!(Transfer { shift: f64::NAN, ..good }.function().is_err());
    }
}
