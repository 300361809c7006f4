//! The placement of the patient in the room, with its magnification.

use engine::render::Camera;
use glam::{DMat3, DQuat, DVec3};
use view::model::state::InHeadset;

use crate::headset::{DEPTH_RANGE, Eye, Pose};

/// mm in a metre.
const MM: f64 = 1000.0;
/// Smallest and greatest magnification.
const SCALES: [f64; 2] = [0.05, 50.0];
/// Distance from the head to the patient's middle at the start, metres; greater for a large patient.
const REACH: f64 = 0.6;

/// Transformation from the patient to the room: rotation, magnification, translation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// The patient's point that stays with `position`, mm RAS.
    pub centre_mm: DVec3,
    /// Place of that point in the room, metres.
    pub position: DVec3,
    /// Rotation from the patient's axes (right, anterior, superior) to those of the room.
    pub orientation: DQuat,
    /// Magnification; 1 is real size.
    pub scale: f64,
}

impl Placement {
    /// Creates the placement of a patient before a head: in real size, upright, the face to the viewer.
    pub fn before(head: &Pose, centre_mm: DVec3, radius_mm: f64) -> Self {
        // The direction is level, however the head is tilted.
        let ahead = (head.forward() * DVec3::new(1.0, 0.0, 1.0)).try_normalize().unwrap_or(DVec3::NEG_Z);
        let distance = REACH.max(1.5 * radius_mm / MM);
        // The patient's right is at the viewer's left, anterior towards the viewer, superior up.
        let right = ahead.cross(DVec3::Y);
        let axes = DMat3::from_cols(-right, -ahead, DVec3::Y);
        Placement {
            centre_mm,
            position: head.position + ahead * distance,
            orientation: DQuat::from_mat3(&axes),
            scale: 1.0,
        }
    }

    /// Returns where this is from a placement at home.
    pub fn from_home(&self, home: &Placement) -> InHeadset {
        let axes = home.orientation.inverse();
        InHeadset {
            moved_m: axes * (self.position - home.position),
            turned: (axes * self.orientation).normalize(),
            scale: self.scale / home.scale,
        }
    }

    /// Returns the placement that is there from this one, at home.
    #[must_use]
    pub fn at(&self, place: &InHeadset) -> Self {
        Placement {
            position: self.position + self.orientation * place.moved_m,
            orientation: (self.orientation * place.turned).normalize(),
            scale: (self.scale * place.scale).clamp(SCALES[0], SCALES[1]),
            ..*self
        }
    }

    /// Returns the place of a point of the patient in the room, metres.
    pub fn room(&self, mm: DVec3) -> DVec3 {
        self.position + self.orientation * ((mm - self.centre_mm) * (self.scale / MM))
    }

    /// Returns the point of the patient at a place in the room, mm RAS.
    pub fn patient(&self, room: DVec3) -> DVec3 {
        self.centre_mm + self.orientation.inverse() * (room - self.position) * (MM / self.scale)
    }

    /// Returns a direction of the room as one in the patient.
    pub fn patient_direction(&self, room: DVec3) -> DVec3 {
        self.orientation.inverse() * room
    }

    /// Returns an offset in the room, metres, as one in the patient, mm.
    pub fn patient_offset(&self, room: DVec3) -> DVec3 {
        self.patient_direction(room) * self.patient_length(1.0)
    }

    /// Returns a length in the room, metres, as one in the patient, mm.
    pub fn patient_length(&self, metres: f64) -> f64 {
        metres * (MM / self.scale)
    }

    /// Returns the range of depths in the patient, mm.
    pub fn depth_range(&self) -> [f32; 2] {
        DEPTH_RANGE.map(|metres| self.patient_length(metres) as f32)
    }

    /// Returns an eye of the room as a camera in the patient.
    pub fn camera(&self, eye: &Eye) -> Camera {
        let axis = |v: DVec3| self.patient_direction(eye.pose.orientation * v);
        Camera {
            eye: self.patient(eye.pose.position),
            right: axis(DVec3::X),
            up: axis(DVec3::Y),
            fov: eye.fov,
        }
    }

    /// Returns the placement after a hand has carried the patient from its pose to the next.
    #[must_use]
    pub fn carried(&self, from: &Pose, to: &Pose) -> Self {
        let turn = (to.orientation * from.orientation.inverse()).normalize();
        Placement {
            position: to.position + turn * (self.position - from.position),
            orientation: (turn * self.orientation).normalize(),
            ..*self
        }
    }

    /// Returns the magnification after two hands have stretched the patient that had `scale` before.
    pub fn stretched_scale(scale: f64, from: [DVec3; 2], to: [DVec3; 2]) -> f64 {
        let factor = (to[1] - to[0]).length() / (from[1] - from[0]).length();
        let wanted = scale * factor;
        if wanted > 0.0 && wanted.is_finite() { wanted.clamp(SCALES[0], SCALES[1]) } else { scale }
    }

    /// Returns the placement after two hands have stretched the patient: turned with the line between them,
    /// scaled to this magnification, moved with their middle. There is no turn about that line, since two
    /// points do not determine it.
    #[must_use]
    pub fn stretched(&self, from: [DVec3; 2], to: [DVec3; 2], scale: f64) -> Self {
        let (before, after) = (from[1] - from[0], to[1] - to[0]);
        let (Some(a), Some(b)) = (before.try_normalize(), after.try_normalize()) else { return *self };
        let turn = DQuat::from_rotation_arc(a, b);
        let (old, new) = ((from[0] + from[1]) * 0.5, (to[0] + to[1]) * 0.5);
        Placement {
            position: new + turn * (self.position - old) * (scale / self.scale),
            orientation: (turn * self.orientation).normalize(),
            scale,
            ..*self
        }
    }
}

#[cfg(test)]
mod tests {
    use engine::render::Fov;

    use super::*;

    fn near(a: DVec3, b: DVec3) -> bool {
        a.distance(b) < 1e-9
    }

    fn placed() -> Placement {
        Placement::before(
            &Pose { position: DVec3::new(0.0, 1.6, 0.0), ..Pose::IDENTITY },
            DVec3::splat(50.0),
            100.0,
        )
    }

    #[test]
    fn a_patient_stands_in_real_size_and_faces_the_viewer() {
        let p = placed();
        assert!(near(p.room(p.centre_mm), DVec3::new(0.0, 1.6, -0.6)));
        let moved = |mm: DVec3| p.room(p.centre_mm + mm) - p.room(p.centre_mm);
        assert!(near(moved(DVec3::X * 10.0), DVec3::NEG_X * 0.01), "10 mm are 10 mm; right is at the left");
        assert!(near(moved(DVec3::Y * 10.0), DVec3::Z * 0.01), "anterior is towards the viewer");
        assert!(near(moved(DVec3::Z * 10.0), DVec3::Y * 0.01), "superior is up");
        let place = DVec3::new(3.0, -4.0, 5.0);
        assert!(near(p.patient(p.room(place)), place));
    }

    #[test]
    fn the_viewer_sees_what_stands_there() {
        let p = placed();
        let pose = Pose { position: DVec3::new(0.0, 1.6, 0.0), ..Pose::IDENTITY };
        let camera = p.camera(&Eye { pose, fov: Fov::symmetric(90.0, 1.0) });
        assert!(near(camera.forward(), DVec3::NEG_Y), "from the front to the back");
        assert!(near(camera.up, DVec3::Z) && near(camera.right, DVec3::NEG_X));
        assert!((camera.eye.distance(p.centre_mm) - 600.0).abs() < 1e-9);
    }

    #[test]
    fn a_hand_keeps_hold_of_what_it_grabbed() {
        let p = placed();
        let from = Pose { position: DVec3::new(0.1, 1.5, -0.5), orientation: DQuat::from_rotation_y(0.3) };
        let to = Pose { position: DVec3::new(-0.2, 1.1, -0.3), orientation: DQuat::from_rotation_x(1.1) };
        let held = p.patient(from.position);
        let carried = p.carried(&from, &to);
        assert!(near(carried.room(held), to.position));
        let ahead = p.patient(from.place(DVec3::NEG_Z * 0.1));
        assert!(near(carried.room(ahead), to.place(DVec3::NEG_Z * 0.1)), "turned with the hand");
        assert_eq!(carried.scale, 1.0);
    }

    #[test]
    fn two_hands_keep_hold_of_two_points() {
        let p = placed();
        let from = [DVec3::new(-0.1, 1.5, -0.5), DVec3::new(0.1, 1.5, -0.5)];
        let to = [DVec3::new(-0.3, 1.4, -0.4), DVec3::new(0.1, 1.7, -0.6)];
        let held = from.map(|room| p.patient(room));
        let stretched = p.stretched(from, to, Placement::stretched_scale(p.scale, from, to));
        for (point, hand) in held.into_iter().zip(to) {
            assert!(near(stretched.room(point), hand));
        }
        let wide = to.map(|room| room * 1e6);
        assert_eq!(Placement::stretched_scale(p.scale, from, wide), 50.0, "there is a limit");
        let nowhere = [from[0]; 2];
        assert_eq!(Placement::stretched_scale(p.scale, nowhere, to), 1.0, "hands in one place say nothing");
        assert_eq!(p.stretched(nowhere, to, 1.0), p);
    }

    #[test]
    fn a_place_from_home_is_the_same_from_any_home() {
        let head = |turn: f64| Pose {
            position: DVec3::new(turn, 1.6, 0.3),
            orientation: DQuat::from_rotation_y(turn),
        };
        let centre = DVec3::new(10.0, -20.0, 30.0);
        let home = Placement::before(&head(0.4), centre, 100.0);
        assert_eq!(home.from_home(&home).scale, 1.0);
        let turned = DQuat::from_rotation_x(0.7);
        let there = Placement { position: home.position + DVec3::X * 0.2, scale: 2.5, ..home };
        let there = Placement { orientation: (turned * home.orientation).normalize(), ..there };
        let place = there.from_home(&home);
        let back = home.at(&place);
        assert!((back.position - there.position).length() < 1e-12 && back.scale == 2.5, "{back:?}");
        assert!(back.orientation.angle_between(there.orientation) < 1e-6);
        // Another day the viewer looks elsewhere: the patient stands as far and as turned from there.
        let other = Placement::before(&head(-1.2), centre, 100.0);
        let again = other.at(&place).from_home(&other);
        assert!((again.moved_m - place.moved_m).length() < 1e-12);
        assert!(again.turned.angle_between(place.turned) < 1e-6);
    }
}
