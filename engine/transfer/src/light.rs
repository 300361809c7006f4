//! Light: where it comes from. How surfaces respond to it is their [`Material`](super::Material).

use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What a light keeps its direction to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FixedTo {
    /// The camera: the light goes along when it turns.
    #[default]
    Camera,
    /// The patient: the light stays where it is.
    Patient,
}

/// Greatest share of the fill light: then both lights are as strong.
pub const MOST_FILL: f64 = 0.5;

/// A key light, far away, and a fill light that stands opposite: mirrored from left to right in the picture.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Light {
    /// What it is fixed to.
    pub fixed_to: FixedTo,
    /// Direction towards the key light, of any length: fixed to the camera to the right, up and towards the viewer; fixed
    /// to the patient RAS.
    pub towards: [f64; 3],
    /// Share of the light that comes from the fill light, 0 to [`MOST_FILL`].
    pub fill: f64,
}

impl Default for Light {
    /// Returns a single light above the viewer's left shoulder.
    fn default() -> Self {
        Light { fixed_to: FixedTo::Camera, towards: [-0.4, 0.5, 1.0], fill: 0.0 }
    }
}

impl Light {
    /// A light from where the viewer is.
    pub const HEAD: Light = Light { fixed_to: FixedTo::Camera, towards: [0.0, 0.0, 1.0], fill: 0.0 };

    /// Creates a light fixed to the camera, by the angles (degrees) to the right and up from the viewer.
    pub fn at_angles([right, up]: [f64; 2]) -> Self {
        let (sine, cosine) = up.to_radians().sin_cos();
        let (across, along) = right.to_radians().sin_cos();
        Light { towards: [across * cosine, sine, along * cosine], ..Light::default() }
    }

    /// Returns true if there is a direction and a share.
    pub fn is_sound(&self) -> bool {
        DVec3::from_array(self.towards).try_normalize().is_some() && (0.0..=MOST_FILL).contains(&self.fill)
    }

    /// Returns the unit vector towards the key light, in the space that it is fixed to; that of the first light if there
    /// is no direction.
    pub fn direction(&self) -> DVec3 {
        let first = DVec3::from_array(Light::default().towards);
        DVec3::from_array(self.towards).try_normalize().unwrap_or(first.normalize())
    }

    /// Returns the unit vector towards the key light as a viewer sees it: to the right, up and towards the viewer, who has
    /// these `axes`, RAS.
    pub fn seen(&self, axes: [DVec3; 3]) -> DVec3 {
        match self.fixed_to {
            FixedTo::Camera => self.direction(),
            FixedTo::Patient => DVec3::from_array(axes.map(|axis| axis.dot(self.direction()))),
        }
    }

    /// Turns the key light to where a viewer with these `axes` sees it in this direction.
    pub fn aim(&mut self, seen: DVec3, axes: [DVec3; 3]) {
        let [right, up, towards] = axes;
        self.towards = match self.fixed_to {
            FixedTo::Camera => seen,
            FixedTo::Patient => right * seen.x + up * seen.y + towards * seen.z,
        }
        .to_array();
    }

    /// Fixes the light to something else, without moving it for a viewer with these `axes`.
    pub fn fix(&mut self, to: FixedTo, axes: [DVec3; 3]) {
        let seen = self.seen(axes);
        self.fixed_to = to;
        self.aim(seen, axes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_light_keeps_its_direction_to_what_it_is_fixed_to() {
        // In front of the patient, and at the left side: right, up, towards the viewer.
        let front = [DVec3::NEG_X, DVec3::Z, DVec3::Y];
        let left = [DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X];
        let mut light = Light::default();
        assert!(light.seen(front) == light.seen(left) && (light.seen(front).length() - 1.0).abs() < 1e-12);
        let seen = light.seen(front);
        light.fix(FixedTo::Patient, front);
        assert!(light.seen(front).distance(seen) < 1e-12, "it has not moved");
        // From the patient's left side, what was towards the viewer in front is to the left, and what was to the right is
        // towards the viewer.
        let wanted = DVec3::new(-seen.z, seen.y, seen.x);
        assert!(light.seen(left).distance(wanted) < 1e-12, "{} for {wanted}", light.seen(left));
        light.aim(DVec3::Z, left);
        assert!(DVec3::from_array(light.towards).distance(DVec3::NEG_X) < 1e-12, "at the patient's left");
    }

    #[test]
    fn angles_are_those_from_the_viewer() {
        for (angles, wanted) in [([0.0, 0.0], DVec3::Z), ([90.0, 0.0], DVec3::X), ([0.0, 90.0], DVec3::Y)] {
            assert!(Light::at_angles(angles).direction().distance(wanted) < 1e-12, "{angles:?}");
        }
        assert_eq!(Light::at_angles([0.0, 0.0]).direction(), Light::HEAD.direction());
        assert!(Light::default().is_sound() && Light::HEAD.is_sound());
        let none = Light { towards: [0.0; 3], ..Light::default() };
        assert!(!none.is_sound() && none.direction() == Light::default().direction());
        assert!(!Light { fill: 0.6, ..Light::default() }.is_sound());
    }
}
