//! The state of the user's hands.

use glam::{DVec2, DVec3};

use super::pose::Pose;

/// Number of joints of a tracked hand.
pub const JOINTS: usize = 26;

/// A joint of a tracked hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Joint {
    /// Place of its middle in the room, metres.
    pub place: DVec3,
    /// Distance from there to the skin, metres.
    pub radius: f64,
}

/// Squeeze from which a hand holds; it lets go below half of it.
pub const HOLDS: f64 = 0.6;

/// A vibration of the controller in a hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pulse {
    /// Duration, seconds.
    pub seconds: f64,
    /// Strength, 0 to 1.
    pub strength: f64,
}

/// State of a hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hand {
    /// Pose in which it holds things, if it is known.
    pub grip: Option<Pose>,
    /// Pose from which it points, if it is known.
    pub aim: Option<Pose>,
    /// Joints of a hand without a controller, if they are known, in the order of XR_EXT_hand_tracking: palm,
    /// wrist, four of the thumb and five of each finger, from the wrist to the tips.
    pub joints: Option<[Joint; JOINTS]>,
    /// Firmness of the grab, 0 to 1.
    pub squeeze: f64,
    /// True if the trigger or its like is pulled.
    pub select: bool,
    /// The thumbstick: to the right and up, -1 to 1.
    pub stick: DVec2,
    /// The first button: the next preset with the right hand, the last one with the left.
    pub next: bool,
    /// The second button: the cutting plane with the right hand, undo and reset with the left.
    pub other: bool,
    /// The button that shows and hides the panel.
    pub panel: bool,
    /// True if the hand has no controller, and so none of these buttons.
    pub bare: bool,
}

impl Hand {
    /// Returns the ray that the hand points with, if its pose is known.
    pub fn ray(&self) -> Option<Pose> {
        self.aim.or(self.grip)
    }
}

/// The left and the right hand.
pub type Hands = [Hand; 2];
