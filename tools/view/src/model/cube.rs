//! The orientation cube: which way the patient lies, and sides to click on.
//!
//! Places are in half edges of the cube from its middle, x to the right, y downwards; without perspective.

use glam::{DVec2, DVec3, Vec3Swizzles};

use crate::model::orbit::{Orbit, Side};

/// Greatest distance of a corner from the middle.
pub const REACH: f64 = 1.733;

/// Cosine between a face and the view below which it is seen from its edge.
const EDGE: f64 = 0.02;

/// A face of the cube that is turned to the viewer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Face {
    /// Side of the patient that the face shows.
    pub side: Side,
    /// Corners, in their order around the face.
    pub corners: [DVec2; 4],
    /// Middle of the face.
    pub middle: DVec2,
    /// Cosine of the angle to the viewer: 1 if one looks straight at it.
    pub towards: f64,
}

impl Face {
    /// Returns the letter of the side.
    pub fn letter(&self) -> char {
        self.side.name().chars().next().unwrap_or('?').to_ascii_uppercase()
    }

    /// Returns true if a place is within the face.
    fn holds(&self, place: DVec2) -> bool {
        let turns = (0..4).map(|i| {
            let (from, to) = (self.corners[i], self.corners[(i + 1) % 4]);
            (to - from).perp_dot(place - from)
        });
        let (mut left, mut right) = (true, true);
        for turn in turns {
            left &= turn >= 0.0;
            right &= turn <= 0.0;
        }
        left || right
    }
}

/// Returns the direction, RAS, in which a side lies.
fn direction(side: Side) -> DVec3 {
    match side {
        Side::Anterior => DVec3::Y,
        Side::Posterior => -DVec3::Y,
        Side::Left => -DVec3::X,
        Side::Right => DVec3::X,
        Side::Superior => DVec3::Z,
        Side::Inferior => -DVec3::Z,
    }
}

/// Returns the faces that are turned to the viewer: one, two or three.
pub fn faces(orbit: &Orbit) -> Vec<Face> {
    let [right, up, towards] = orbit.axes();
    let place = |p: DVec3| DVec2::new(p.dot(right), -p.dot(up));
    let face = |side: Side| {
        let normal = direction(side);
        // Any two axes across the normal span the face.
        let (u, v) = (normal.yzx(), normal.zxy());
        let corners = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];
        Face {
            side,
            corners: corners.map(|[a, b]| place(normal + a * u + b * v)),
            middle: place(normal),
            towards: normal.dot(towards),
        }
    };
    Side::ALL.into_iter().map(face).filter(|face| face.towards > EDGE).collect()
}

/// Returns the side whose face is at a place.
pub fn hit(orbit: &Orbit, place: DVec2) -> Option<Side> {
    faces(orbit).into_iter().find(|face| face.holds(place)).map(|face| face.side)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_side_that_one_looks_at_is_the_only_face() {
        for side in Side::ALL {
            let mut orbit = Orbit::default();
            orbit.look_from(side);
            let seen = faces(&orbit);
            assert_eq!(seen.len(), 1, "{side:?}: {seen:?}");
            assert_eq!((seen[0].side, hit(&orbit, DVec2::ZERO)), (side, Some(side)));
            assert!(seen[0].towards > 0.999 && seen[0].middle.length() < 1e-9);
        }
    }

    #[test]
    fn from_the_front_and_above_left_is_to_the_right() {
        let orbit = Orbit { azimuth_deg: 40.0, elevation_deg: 30.0, ..Orbit::default() };
        let seen = faces(&orbit);
        let at = |side: Side| seen.iter().find(|face| face.side == side).expect("a face").middle;
        assert_eq!(seen.len(), 3);
        assert!(at(Side::Superior).y < at(Side::Anterior).y, "the head is up: {seen:?}");
        assert!(at(Side::Left).x > at(Side::Anterior).x, "the left side is to the right: {seen:?}");
        for face in &seen {
            assert_eq!(hit(&orbit, face.middle), Some(face.side));
            assert!(face.corners.iter().all(|corner| corner.length() < REACH));
        }
        assert_eq!(hit(&orbit, DVec2::new(1.7, 1.7)), None);
        let letters: Vec<_> = seen.iter().map(Face::letter).collect();
        assert_eq!(letters, ['A', 'L', 'S']);
    }
}
