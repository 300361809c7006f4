//! Camera that turns around a pivot.
//!
//! Azimuth and elevation are kept, not a rotation: the head stays up however one turns, a session file says
//! where one looked from, and at the poles the picture's axes are still given by the azimuth.
//!
//! Places in a picture are fractions of it: (0, 0) is its upper left corner, (1, 1) its lower right one.

use engine::error::{Error, Kind, Result};
use engine::render::{Camera, FOV_DEGREES, Fov};
use glam::{DVec2, DVec3};
use serde::{Deserialize, Serialize};

/// Range of the field of view from the upper to the lower edge, degrees.
pub const FOV_RANGE: [f64; 2] = [5.0, 120.0];
/// Range of the distance from the pivot, mm.
const DISTANCE_RANGE: [f64; 2] = [1.0, 1e6];
/// Factor of the distance at which a scene just fits the picture, to leave a border.
const MARGIN: f64 = 1.05;

/// Side to look from, in the patient's own terms.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// The patient's front.
    Anterior,
    /// The patient's back.
    Posterior,
    /// The patient's left.
    Left,
    /// The patient's right.
    Right,
    /// The head.
    Superior,
    /// The feet.
    Inferior,
}

impl Side {
    /// All six sides, in pairs.
    pub const ALL: [Side; 6] =
        [Side::Anterior, Side::Posterior, Side::Left, Side::Right, Side::Superior, Side::Inferior];

    /// Returns the name of the side.
    pub fn name(self) -> &'static str {
        match self {
            Side::Anterior => "anterior",
            Side::Posterior => "posterior",
            Side::Left => "left",
            Side::Right => "right",
            Side::Superior => "superior",
            Side::Inferior => "inferior",
        }
    }

    /// Returns azimuth and elevation, degrees. From above and below the front of the patient is up.
    fn angles(self) -> [f64; 2] {
        match self {
            Side::Anterior => [0.0, 0.0],
            Side::Posterior => [180.0, 0.0],
            Side::Left => [90.0, 0.0],
            Side::Right => [-90.0, 0.0],
            Side::Superior => [180.0, 90.0],
            Side::Inferior => [0.0, -90.0],
        }
    }
}

/// Camera that looks at a pivot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Orbit {
    /// Point in the middle of the picture, mm RAS.
    pub pivot_mm: DVec3,
    /// Distance from the pivot to the eye, mm.
    pub distance_mm: f64,
    /// Direction of the eye about the body's axis, degrees: 0 in front, 90 at the patient's left.
    pub azimuth_deg: f64,
    /// Angle of the eye above the pivot, degrees: 90 at the head, -90 at the feet.
    pub elevation_deg: f64,
    /// Field of view from the upper to the lower edge of the picture, degrees.
    pub fov_deg: f64,
}

impl Default for Orbit {
    /// Returns a camera in front of the world's origin, half a metre away.
    fn default() -> Self {
        Orbit {
            pivot_mm: DVec3::ZERO,
            distance_mm: 500.0,
            azimuth_deg: 0.0,
            elevation_deg: 0.0,
            fov_deg: FOV_DEGREES,
        }
    }
}

impl Orbit {
    /// Returns unit vectors to the right, upwards and towards the viewer, RAS.
    pub fn axes(&self) -> [DVec3; 3] {
        let (azimuth_sine, azimuth_cosine) = self.azimuth_deg.to_radians().sin_cos();
        let (sine, cosine) = self.elevation_deg.to_radians().sin_cos();
        // `around` points to the eye, seen from above; at azimuth 0 it is in front, at +A.
        let around = DVec3::new(-azimuth_sine, azimuth_cosine, 0.0);
        let right = DVec3::new(-azimuth_cosine, -azimuth_sine, 0.0);
        [right, DVec3::Z * cosine - around * sine, around * cosine + DVec3::Z * sine]
    }

    /// Returns the place of the eye, mm RAS.
    pub fn eye_mm(&self) -> DVec3 {
        self.pivot_mm + self.axes()[2] * self.distance_mm
    }

    /// Returns the camera of a picture `aspect` times as wide as high.
    pub fn camera(&self, aspect: f64) -> Camera {
        let [right, up, _] = self.axes();
        Camera { eye: self.eye_mm(), right, up, fov: Fov::symmetric(self.fov_deg, aspect) }
    }

    /// Turns about the pivot by degrees: the eye goes to the patient's left and upwards. It stops above head
    /// and feet.
    pub fn turn(&mut self, azimuth_deg: f64, elevation_deg: f64) {
        self.azimuth_deg = wrapped(self.azimuth_deg + azimuth_deg);
        self.elevation_deg = (self.elevation_deg + elevation_deg).clamp(-90.0, 90.0);
    }

    /// Turns to look from a side; pivot and distance stay.
    pub fn look_from(&mut self, side: Side) {
        [self.azimuth_deg, self.elevation_deg] = side.angles();
    }

    /// Moves the pivot so that the scene at the pivot's depth follows the cursor, which moved by `by`
    /// (fractions of the picture).
    pub fn pan(&mut self, by: DVec2, aspect: f64) {
        let [right, up, _] = self.axes();
        let height = self.height_mm();
        self.pivot_mm += up * (by.y * height) - right * (by.x * height * aspect);
    }

    /// Multiplies the distance by `factor`. What is seen at `place` at the pivot's depth stays there.
    pub fn zoom(&mut self, factor: f64, place: DVec2, aspect: f64) {
        let old = self.distance_mm;
        let under = self.at_pivot(place, aspect);
        self.distance_mm = (old * factor).clamp(DISTANCE_RANGE[0], DISTANCE_RANGE[1]);
        self.pivot_mm = under + (self.pivot_mm - under) * (self.distance_mm / old);
    }

    /// Changes the field of view. What is at the pivot keeps its size.
    pub fn set_fov(&mut self, degrees: f64) {
        let height = self.height_mm();
        self.fov_deg = degrees.clamp(FOV_RANGE[0], FOV_RANGE[1]);
        let distance = height / (2.0 * (self.fov_deg.to_radians() * 0.5).tan());
        self.distance_mm = distance.clamp(DISTANCE_RANGE[0], DISTANCE_RANGE[1]);
    }

    /// Moves the pivot to the middle of a box (two corners, mm RAS) and the eye as near as all its corners
    /// allow.
    pub fn fit(&mut self, [low, high]: [DVec3; 2], aspect: f64) {
        if !(low.is_finite() && high.is_finite()) {
            return;
        }
        self.pivot_mm = (low + high) * 0.5;
        let [right, up, back] = self.axes();
        let half_height = (self.fov_deg.to_radians() * 0.5).tan();
        let half = (high - low).abs() * 0.5;
        let needed = (0..8).map(|corner| {
            let sign = |axis: usize| if corner >> axis & 1 == 1 { 1.0 } else { -1.0 };
            let x = half * DVec3::new(sign(0), sign(1), sign(2));
            let beside = (x.dot(right).abs() / (half_height * aspect)).max(x.dot(up).abs() / half_height);
            beside * MARGIN + x.dot(back)
        });
        let distance = needed.fold(0.0, f64::max);
        self.distance_mm = distance.clamp(DISTANCE_RANGE[0], DISTANCE_RANGE[1]);
    }

    /// Returns the height of the picture at the depth of the pivot, mm.
    pub fn height_mm(&self) -> f64 {
        2.0 * self.distance_mm * (self.fov_deg.to_radians() * 0.5).tan()
    }

    /// Returns the point (mm RAS) that is seen at a place, in the plane through the pivot across the view.
    pub fn at_pivot(&self, place: DVec2, aspect: f64) -> DVec3 {
        let [right, up, _] = self.axes();
        let height = self.height_mm();
        self.pivot_mm + right * ((place.x - 0.5) * height * aspect) + up * ((0.5 - place.y) * height)
    }

    /// Returns the place at which a point (mm RAS) is seen, and its depth in mm; `None` if it is not before
    /// the eye.
    pub fn seen(&self, x: DVec3, aspect: f64) -> Option<(DVec2, f64)> {
        let [right, up, back] = self.axes();
        let x = x - self.eye_mm();
        let depth = -x.dot(back);
        let half = (self.fov_deg.to_radians() * 0.5).tan();
        let place = DVec2::new(
            0.5 + 0.5 * x.dot(right) / (depth * half * aspect),
            0.5 - 0.5 * x.dot(up) / (depth * half),
        );
        (depth > 0.0 && place.is_finite()).then_some((place, depth))
    }

    /// Returns the point (mm RAS) that is seen at a place, `depth_mm` along the viewing direction.
    pub fn at_depth(&self, place: DVec2, depth_mm: f64, aspect: f64) -> DVec3 {
        let eye = self.eye_mm();
        // The plane of the pivot is `distance_mm` away, and all points of a ray are in proportion.
        eye + (self.at_pivot(place, aspect) - eye) * (depth_mm / self.distance_mm)
    }

    /// Returns an error for a camera that cannot make a picture, as a session file may hold.
    ///
    /// # Errors
    /// Returns [`Kind::BadData`].
    pub fn check(&self) -> Result<()> {
        let within = |v: f64, [low, high]: [f64; 2]| (low..=high).contains(&v);
        let rows = [
            (self.pivot_mm.is_finite(), "pivot_mm is not finite"),
            (within(self.distance_mm, DISTANCE_RANGE), "distance_mm is not between 1 and 1000000"),
            (self.azimuth_deg.is_finite(), "azimuth_deg is not finite"),
            (within(self.elevation_deg, [-90.0, 90.0]), "elevation_deg is not between -90 and 90"),
            (within(self.fov_deg, FOV_RANGE), "fov_deg is not between 5 and 120"),
        ];
        match rows.iter().find(|(good, _)| !good) {
            None => Ok(()),
            Some((_, what)) => Err(Error::new(Kind::BadData, "VGS-VIEW-003", format!("[orbit] {what}"))
                .help("correct the number, or remove the section to look from the front")),
        }
    }
}

/// Wraps an angle into (-180, 180] degrees.
fn wrapped(degrees: f64) -> f64 {
    let turned = degrees.rem_euclid(360.0);
    if turned > 180.0 { turned - 360.0 } else { turned }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
