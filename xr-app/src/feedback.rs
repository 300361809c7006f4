//! What a user is told beside the picture of the patient: pulses in the hands, and a few words before the eyes.

use crate::headset::Pulse;

/// Pulse of a hand that takes hold.
pub const GRAB: Pulse = Pulse { seconds: 0.03, strength: 0.5 };
/// Pulse of a click on the panel, or of the end of a distance.
pub const CLICK: Pulse = Pulse { seconds: 0.015, strength: 0.3 };
/// Pulse of what snaps: real size, and a button that was held long enough.
pub const SNAP: Pulse = Pulse { seconds: 0.05, strength: 0.9 };

/// What is to be told, gathered during a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Feedback {
    /// Hands with their pulses.
    pub pulses: Vec<(usize, Pulse)>,
    /// A few words; the last ones count.
    pub notice: Option<String>,
}

impl Feedback {
    /// Adds a pulse for the left (0) or the right (1) hand.
    pub fn pulse(&mut self, side: usize, pulse: Pulse) {
        self.pulses.push((side, pulse));
    }

    /// Sets the words.
    pub fn say(&mut self, text: impl Into<String>) {
        self.notice = Some(text.into());
    }
}
