//! The gesture by which a hand without a controller calls the panel: its palm is held open before the eyes
//! for half a second, as for hand menus elsewhere. No pinch belongs to it, since headsets keep a pinch with
//! the palm towards the face for themselves; and nobody who grabs or clicks shows an open palm.

use glam::DVec3;

use crate::headset::{Hand, Hands, Pose};

/// Time that the palm must be shown before it counts, seconds.
const HELD: f64 = 0.5;
/// Largest angles from the palm's direction to the eyes, and from the viewing direction to the hand, radians:
/// to begin, and to continue.
const TOWARDS: [f64; 2] = [0.6, 0.85];
/// Least and greatest distance from the eyes, metres: an arm's length, but not a hand at the face.
const REACH: [f64; 2] = [0.15, 0.75];
/// Largest squeeze of an open hand.
const OPEN: f64 = 0.3;

/// Palms that are shown.
#[derive(Default)]
pub struct Palms {
    /// Time at which each palm was first shown, seconds.
    since: [Option<f64>; 2],
}

impl Palms {
    /// Returns true for each hand that has shown its palm long enough at this time, seconds, to the eyes of a
    /// head. It stays true until the palm is turned away.
    pub fn shown(&mut self, hands: &Hands, head: &Pose, seconds: f64) -> [bool; 2] {
        [0, 1].map(|side| {
            let since = &mut self.since[side];
            let most = TOWARDS[usize::from(since.is_some())];
            *since = faces(&hands[side], side, head, most).then(|| since.unwrap_or(seconds));
            since.is_some_and(|since| seconds - since >= HELD)
        })
    }
}

/// Returns true if the head looks at an open hand whose palm faces the eyes, both within `most` radians.
fn faces(hand: &Hand, side: usize, head: &Pose, most: f64) -> bool {
    let (true, Some(grip)) = (hand.bare && hand.squeeze < OPEN && !hand.select, hand.grip) else {
        return false;
    };
    // +x of a grip goes out of the left palm, and into the right one.
    let palm = grip.orientation * if side == 0 { DVec3::X } else { DVec3::NEG_X };
    let eyes = head.position - grip.position;
    (REACH[0]..REACH[1]).contains(&eyes.length())
        && palm.angle_between(eyes) < most
        && head.forward().angle_between(-eyes) < most
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;

    const HEAD: Pose = Pose { position: DVec3::new(0.0, 1.6, 0.0), orientation: DQuat::IDENTITY };

    /// Returns an open hand 0.4 m before the eyes, whose palm is turned away from them by an angle.
    fn hand(side: usize, turned: f64) -> Hand {
        let position = HEAD.position + DVec3::new(0.0, -0.1, -0.4);
        let palm = if side == 0 { DVec3::X } else { DVec3::NEG_X };
        let facing = DQuat::from_rotation_arc(palm, (HEAD.position - position).normalize());
        let orientation = DQuat::from_rotation_y(turned) * facing;
        Hand { grip: Some(Pose { position, orientation }), bare: true, ..Hand::default() }
    }

    /// Returns true if the palm of a hand counts after it was shown for so many seconds.
    fn shown(side: usize, hand: Hand, seconds: f64) -> bool {
        let mut hands = [Hand::default(); 2];
        hands[side] = hand;
        let mut palms = Palms::default();
        let frames = (seconds * 90.0).round() as u32;
        let last = (0..=frames).map(|n| palms.shown(&hands, &HEAD, 5.0 + f64::from(n) / 90.0)).last();
        last.expect("a frame")[side]
    }

    #[test]
    fn an_open_palm_before_the_eyes_counts_after_half_a_second() {
        for side in [0, 1] {
            let held = hand(side, 0.0);
            assert!(shown(side, held, 0.6) && !shown(side, held, 0.4), "hand {side}");
            assert!(shown(side, hand(side, 0.5), 0.6), "it need not be exact");
            let grip = held.grip.expect("a pose");
            let at = |position| {
                let mut moved = held;
                moved.grip = Some(Pose { position, ..grip });
                moved
            };
            for (what, hand) in [
                ("the back of the hand", hand(side, 3.1)),
                ("the edge of the hand", hand(side, 1.2)),
                ("a controller", Hand { bare: false, ..held }),
                ("a fist", Hand { squeeze: 1.0, ..held }),
                ("a pinch", Hand { select: true, ..held }),
                ("a hand nobody knows of", Hand { grip: None, ..held }),
                ("a hand at the hip", at(HEAD.position + DVec3::new(0.2, -0.7, 0.0))),
                ("a hand at the face", at(HEAD.position + DVec3::new(0.0, 0.0, -0.1))),
                ("a hand across the room", at(HEAD.position + DVec3::new(0.0, -0.3, -1.2))),
            ] {
                assert!(!shown(side, hand, 2.0), "{what}, hand {side}");
            }
        }
    }

    #[test]
    fn a_palm_that_trembles_goes_on_and_one_that_was_lost_begins_anew() {
        let mut palms = Palms::default();
        let mut step = |hand: Hand, seconds| palms.shown(&[hand, Hand::default()], &HEAD, seconds)[0];
        let (still, beyond) = (hand(0, 0.0), hand(0, 0.7));
        assert!(!step(beyond, 0.0), "too far to begin with");
        assert!(!step(still, 0.1) && !step(beyond, 0.4) && step(beyond, 0.61));
        assert!(!step(Hand::default(), 0.7) && !step(still, 0.8) && !step(still, 1.2) && step(still, 1.31));
    }
}
