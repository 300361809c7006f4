//! What the hands of the user do.

use glam::DVec2;

use super::pose::Pose;

/// What a hand does.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hand {
    /// Where it holds things, if that is known.
    pub grip: Option<Pose>,
    /// Where it points from, and to.
    pub aim: Option<Pose>,
    /// How firmly it grabs, 0 to 1.
    pub squeeze: f64,
    /// True if the trigger or its like is pulled.
    pub select: bool,
    /// The thumbstick: to the right and up, -1 to 1.
    pub stick: DVec2,
    /// The first button: the next preset with the right hand, the last one with the left.
    pub next: bool,
    /// The second button: clip plane on and off with the right hand, reset with the left.
    pub other: bool,
    /// The button that shows and hides the panel.
    pub panel: bool,
    /// True if there is no controller in it, and with it no such button.
    pub bare: bool,
}

impl Hand {
    /// Returns the ray that it points with, if it is known where it is.
    pub fn ray(&self) -> Option<Pose> {
        self.aim.or(self.grip)
    }
}

/// Left and right.
pub type Hands = [Hand; 2];
