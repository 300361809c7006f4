//! Where a headset shows the patient: a part of the session that the desktop viewer keeps as it is.

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// Place, turn and size of the patient in a headset, from where a session places the patient before the viewer: upright,
/// in real size, the face to the viewer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InHeadset {
    /// Way of the patient's middle, metres: to the patient's right, to the front, up, as the patient first stands.
    pub moved_m: DVec3,
    /// Rotation about that middle, a unit quaternion x, y, z, w in the same axes.
    pub turned: DQuat,
    /// Magnification; 1 is real size.
    pub scale: f64,
}

impl InHeadset {
    /// Where the patient first stands.
    pub const HOME: Self = InHeadset { moved_m: DVec3::ZERO, turned: DQuat::IDENTITY, scale: 1.0 };

    /// Returns false if the numbers are no place.
    pub(super) fn is_sound(&self) -> bool {
        self.moved_m.is_finite() && self.turned.is_normalized() && self.scale.is_finite() && self.scale > 0.0
    }
}
