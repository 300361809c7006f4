//! Cameras in the world, and the views of one or two eyes that kernels see.

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};
use shaders_glsl::types::View;

use base::error::{Error, Kind, Result};

/// Tangents of the angles from the viewing direction to the edges of the picture; a headset's are asymmetric.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fov {
    /// Tangent to the left edge; negative if the edge is to the left.
    pub left: f64,
    /// Tangent to the right edge.
    pub right: f64,
    /// Tangent to the upper edge.
    pub up: f64,
    /// Tangent to the lower edge; negative if the edge is below.
    pub down: f64,
}

impl Fov {
    /// Creates a symmetric field of view, `degrees` from the upper to the lower edge, `aspect` times as wide
    /// as high.
    pub fn symmetric(degrees: f64, aspect: f64) -> Self {
        let y = (degrees.to_radians() * 0.5).tan();
        Fov { left: -y * aspect, right: y * aspect, up: y, down: -y }
    }
}

/// One eye in the world, mm RAS.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Position of the eye, mm RAS.
    pub eye: DVec3,
    /// Unit vector to the right of the picture.
    pub right: DVec3,
    /// Unit vector to the top of the picture, at right angles to `right`.
    pub up: DVec3,
    /// Field of view of the picture.
    pub fov: Fov,
}

/// A direction to look from, as anatomy names it: the letters of RAS and LPS or a word.
struct Side {
    names: [&'static str; 2],
    /// Direction from the target to the eye, RAS.
    towards: DVec3,
    up: DVec3,
}

/// Sides of the patient. The picture's up is away from the feet, except in a view along the body: there it is
/// the front.
const SIDES: [Side; 6] = [
    Side { names: ["anterior", "A"], towards: DVec3::Y, up: DVec3::Z },
    Side { names: ["posterior", "P"], towards: DVec3::NEG_Y, up: DVec3::Z },
    Side { names: ["left", "L"], towards: DVec3::NEG_X, up: DVec3::Z },
    Side { names: ["right", "R"], towards: DVec3::X, up: DVec3::Z },
    Side { names: ["superior", "S"], towards: DVec3::Z, up: DVec3::Y },
    Side { names: ["inferior", "I"], towards: DVec3::NEG_Z, up: DVec3::Y },
];

impl Camera {
    /// Creates a camera at `eye` that looks at `target`, with `up` upwards in the picture.
    pub fn looking(eye: DVec3, target: DVec3, up: DVec3, fov: Fov) -> Result<Self> {
        let bad = |found: &str| {
            Err(Error::new(Kind::Usage, "VGS-CAM-001", format!("a camera {found}")).help(
                "give an eye, a target apart from it, and an up that is not the direction between them",
            ))
        };
        let (Some(forward), true) = ((target - eye).try_normalize(), eye.is_finite()) else {
            return bad("whose eye is where it looks, or nowhere");
        };
        let Some(right) = forward.cross(up).try_normalize() else {
            return bad("whose up is the direction it looks in");
        };
        let finite = [fov.left, fov.right, fov.up, fov.down].iter().all(|t| t.is_finite());
        let empty = fov.left >= fov.right || fov.down >= fov.up;
        if empty || !finite {
            return bad("whose field of view is empty");
        }
        Ok(Camera { eye, right, up: right.cross(forward), fov })
    }

    /// Creates a camera that looks at a ball from the side called `name` (anterior, A, left, superior …), or
    /// from several at once (`anterior-left-superior`), at the distance from which the ball fills the
    /// picture.
    pub fn from_side(name: &str, centre: DVec3, radius: f64, degrees: f64, aspect: f64) -> Result<Self> {
        let mut towards = DVec3::ZERO;
        let mut up = DVec3::ZERO;
        for part in name.split(['-', '+', ' ']).filter(|p| !p.is_empty()) {
            let found = SIDES.iter().find(|s| s.names.iter().any(|n| n.eq_ignore_ascii_case(part)));
            let Some(side) = found else {
                let names: Vec<_> = SIDES.iter().map(|s| s.names[0]).collect();
                return Err(Error::new(Kind::Usage, "VGS-CAM-002", format!("no side is called {part:?}"))
                    .help(format!(
                        "sides are {} or their first letters, and several joined by '-'",
                        names.join(", ")
                    )));
            };
            towards += side.towards;
            up = if up == DVec3::ZERO { side.up } else { DVec3::Z };
        }
        let Some(towards) = towards.try_normalize() else {
            return Err(Error::new(Kind::Usage, "VGS-CAM-003", format!("{name:?} names no direction"))
                .help("for example anterior, or anterior-left-superior"));
        };
        // The ball touches the cone of the narrower angle.
        let half = (degrees.to_radians() * 0.5).tan() * aspect.min(1.0);
        let distance = radius * (1.0 + half.powi(-2)).sqrt();
        Camera::looking(centre + towards * distance, centre, up, Fov::symmetric(degrees, aspect))
    }

    /// Returns the unit vector into the picture.
    pub fn forward(&self) -> DVec3 {
        self.up.cross(self.right)
    }

    /// Returns the camera turned about `axis` through `centre` by `radians`.
    #[must_use]
    pub fn turned(&self, centre: DVec3, axis: DVec3, radians: f64) -> Self {
        let turn = DMat3::from_axis_angle(axis, radians);
        Camera {
            eye: centre + turn * (self.eye - centre),
            right: turn * self.right,
            up: turn * self.up,
            ..*self
        }
    }

    /// Returns the two eyes, `distance` mm apart, of a viewer whose head is this camera.
    pub fn eyes(&self, distance: f64) -> [Self; 2] {
        [-0.5, 0.5].map(|side| Camera { eye: self.eye + self.right * (side * distance), ..*self })
    }

    /// Returns the view for kernels, in the space of a scene whose origin is at `origin` in the world, mm
    /// RAS.
    pub fn view(&self, origin: DVec3) -> View {
        let narrow = |v: DVec3| v.as_vec3().to_array();
        View {
            eye: narrow(self.eye - origin),
            right: narrow(self.right),
            up: narrow(self.up),
            forward: narrow(self.forward()),
            tangents: [self.fov.left, self.fov.right, self.fov.up, self.fov.down].map(|t| t as f32),
        }
    }
}

/// A camera as it is written in a file: JSON with `eye_mm`, `target_mm`, `up` and `fov_deg`, all in RAS.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraFile {
    /// Position of the eye, mm RAS.
    pub eye_mm: [f64; 3],
    /// Point in the middle of the picture, mm RAS.
    pub target_mm: [f64; 3],
    /// Direction that is upwards in the picture.
    #[serde(default = "CameraFile::head_up")]
    pub up: [f64; 3],
    /// Angle from the upper to the lower edge, degrees.
    #[serde(default = "CameraFile::usual_fov")]
    pub fov_deg: f64,
}

impl CameraFile {
    fn head_up() -> [f64; 3] {
        [0.0, 0.0, 1.0]
    }

    fn usual_fov() -> f64 {
        FOV_DEGREES
    }

    /// Returns the camera for a picture `aspect` times as wide as high.
    pub fn camera(&self, aspect: f64) -> Result<Camera> {
        if !(0.01..=170.0).contains(&self.fov_deg) {
            return Err(Error::new(
                Kind::Usage,
                "VGS-CAM-004",
                format!("a field of view of {} degrees", self.fov_deg),
            )
            .help("fov_deg is between 0.01 and 170"));
        }
        let at = DVec3::from_array;
        Camera::looking(
            at(self.eye_mm),
            at(self.target_mm),
            at(self.up),
            Fov::symmetric(self.fov_deg, aspect),
        )
    }
}

/// Default field of view, degrees from the upper to the lower edge.
pub const FOV_DEGREES: f64 = 30.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_are_those_of_the_patient() {
        let at = |name: &str| Camera::from_side(name, DVec3::splat(5.0), 10.0, 30.0, 1.0).expect(name);
        let front = at("anterior");
        assert!(front.eye.y > 40.0 && front.right == DVec3::NEG_X && front.up == DVec3::Z, "{front:?}");
        assert!((front.forward() - DVec3::NEG_Y).length() < 1e-12);
        let above = at("S");
        assert!(above.eye.z > 40.0 && above.up == DVec3::Y);
        let oblique = at("anterior-left-superior");
        assert!(
            (oblique.eye - DVec3::splat(5.0)).normalize().distance(DVec3::new(-1.0, 1.0, 1.0).normalize())
                < 1e-12
        );
        assert!(oblique.up.z > 0.5);
        // The ball touches the edge of the picture.
        let angle = (10.0 / (front.eye - DVec3::splat(5.0)).length()).asin();
        assert!((angle - 15f64.to_radians()).abs() < 1e-12, "{angle}");
        for name in ["", "above", "left-right"] {
            assert_eq!(
                Camera::from_side(name, DVec3::ZERO, 1.0, 30.0, 1.0).expect_err(name).kind,
                Kind::Usage
            );
        }
    }

    #[test]
    fn a_camera_without_a_direction_is_refused() {
        let fov = Fov::symmetric(30.0, 1.0);
        for (eye, target, up) in [
            (DVec3::ZERO, DVec3::ZERO, DVec3::Z),
            (DVec3::ZERO, DVec3::Z, DVec3::Z),
            (DVec3::NAN, DVec3::Z, DVec3::Y),
        ] {
            assert!(Camera::looking(eye, target, up, fov).is_err(), "{eye} {target} {up}");
        }
        let empty = Fov { left: 0.1, right: -0.1, ..fov };
        assert!(Camera::looking(DVec3::ZERO, DVec3::Y, DVec3::Z, empty).is_err());
    }

    #[test]
    fn eyes_are_apart_and_parallel() {
        let head = Camera::from_side("A", DVec3::ZERO, 100.0, 40.0, 1.5).expect("a camera");
        let [left, right] = head.eyes(64.0);
        assert!(((right.eye - left.eye) - head.right * 64.0).length() < 1e-12);
        assert_eq!(left.forward(), right.forward());
        let around = head.turned(DVec3::ZERO, DVec3::Z, std::f64::consts::TAU);
        assert!(around.eye.distance(head.eye) < 1e-9);
    }
}
