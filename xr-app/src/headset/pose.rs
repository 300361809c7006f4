//! Places and directions in the room, of eyes too.

#[cfg(doc)]
use super::Timing;
use engine::render::Fov;
use glam::{DQuat, DVec3};

/// A place and a direction in the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Metres.
    pub position: DVec3,
    /// Turns +x to the right of whoever has this pose, +y to its top and -z to where it looks.
    pub orientation: DQuat,
}

impl Pose {
    /// In the room's middle, looking ahead.
    pub const IDENTITY: Self = Pose { position: DVec3::ZERO, orientation: DQuat::IDENTITY };

    /// Returns the place in the room of what is at `local` as seen from here.
    pub fn place(&self, local: DVec3) -> DVec3 {
        self.position + self.orientation * local
    }

    /// Returns where it looks or points to.
    pub fn forward(&self) -> DVec3 {
        self.orientation * DVec3::NEG_Z
    }
}

/// An eye in the room.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eye {
    /// Where it is and where it looks.
    pub pose: Pose,
    /// What it sees.
    pub fov: Fov,
}

/// Both eyes at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eyes {
    /// Left and right.
    pub eyes: [Eye; 2],
    /// True if the headset knows where it looks; otherwise these are its last poses.
    pub tracked: bool,
    /// When this was asked, on the clock of [`Timing`], if the headset has one that the host can read.
    pub asked_ns: Option<i64>,
}
