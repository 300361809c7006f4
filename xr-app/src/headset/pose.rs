//! Poses in the room, and eyes.

#[cfg(doc)]
use super::Timing;
use engine::render::Fov;
use glam::{DQuat, DVec3};

/// A position and an orientation in the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Position, metres.
    pub position: DVec3,
    /// Rotation that takes +x to the right, +y to the top and -z to the viewing direction of this pose.
    pub orientation: DQuat,
}

impl Pose {
    /// The pose in the room's middle, looking ahead.
    pub const IDENTITY: Self = Pose { position: DVec3::ZERO, orientation: DQuat::IDENTITY };

    /// Returns the place in the room of a point at `local` in this pose's own space.
    pub fn place(&self, local: DVec3) -> DVec3 {
        self.position + self.orientation * local
    }

    /// Returns the direction in which it looks or points.
    pub fn forward(&self) -> DVec3 {
        self.orientation * DVec3::NEG_Z
    }
}

/// An eye in the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Position and viewing direction.
    pub pose: Pose,
    /// Field of view.
    pub fov: Fov,
}

/// Both eyes at one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eyes {
    /// The left and the right eye.
    pub eyes: [Eye; 2],
    /// True if the headset knows the head's orientation; otherwise these are its last poses.
    pub tracked: bool,
    /// Time of the request, on the clock of [`Timing`], if the headset has one that the host can read.
    pub asked_ns: Option<i64>,
}
