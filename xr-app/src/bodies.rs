//! Bodies of the hands, so that a viewer sees where they are and what they do: a controller, or a glove without
//! one. A hand whose joints are known is drawn after them.

use glam::{DQuat, DVec3};
use view::panels::theme::{ACCENT, SIGNAL};

use crate::headset::{HOLDS, Hand, Hands, JOINTS, Joint, Pose};
use crate::rods::Rod;

/// Colour of a hand at rest, and of its pointing finger.
const REST: [u8; 3] = [176, 180, 186];
const TIP: [u8; 3] = [232, 234, 238];

/// A rod of a controller, in the space of the grip: both ends, metres, and the radii there, metres. The space
/// has -z from the little finger to the thumb.
const HANDLE: ([DVec3; 2], [f64; 2]) =
    ([DVec3::new(0.0, 0.0, 0.045), DVec3::new(0.0, 0.0, -0.03)], [0.014, 0.016]);
/// Where the handle meets the head of a controller, and the radius of the head, metres.
const HEAD: (DVec3, f64) = (DVec3::new(0.0, 0.0, -0.042), 0.022);
/// Length and radii of the nose, which points where the hand does, metres.
const NOSE: (f64, [f64; 2]) = (0.042, [0.011, 0.006]);

/// A finger of a glove: how far its knuckle is towards the thumb, the length of its two pieces, metres.
const FINGERS: [(f64, f64); 4] = [(0.03, 0.037), (0.01, 0.041), (-0.01, 0.038), (-0.028, 0.03)];
/// Distances from the grip to the wrist and to the knuckles, and radii of palm, finger and tip, metres.
const WRIST: f64 = 0.05;
const KNUCKLES: f64 = 0.035;
const THICK: [f64; 3] = [0.012, 0.009, 0.007];
/// Bend of each of the two joints of a finger in a fist, radians.
const FIST: f64 = 1.4;

/// Returns the bodies of the hands whose poses are known.
pub fn rods(hands: &Hands) -> Vec<Rod> {
    let body = |(side, hand): (usize, &Hand)| match (&hand.joints, hand.grip) {
        (Some(joints), _) if hand.bare || hand.grip.is_none() => skeleton(joints, hand),
        (_, Some(grip)) if hand.bare => glove(&grip, side, hand),
        (_, Some(grip)) => controller(&grip, hand),
        (_, None) => Vec::new(),
    };
    hands.iter().enumerate().flat_map(body).collect()
}

/// Returns the colours of what holds and of what points.
fn colours(hand: &Hand) -> [[u8; 3]; 2] {
    let of = |colour: egui::Color32| [colour.r(), colour.g(), colour.b()];
    let holds = if hand.squeeze >= HOLDS { of(ACCENT) } else { REST };
    [holds, if hand.select { of(SIGNAL) } else { TIP }]
}

fn controller(grip: &Pose, hand: &Hand) -> Vec<Rod> {
    let [holds, points] = colours(hand);
    let head = grip.place(HEAD.0);
    let ahead = hand.ray().map_or(grip.forward(), |ray| ray.forward());
    let rod = |ends, radii, colour| Rod { ends, radii, colour };
    vec![
        rod(HANDLE.0.map(|end| grip.place(end)), HANDLE.1, holds),
        rod([head; 2], [HEAD.1; 2], holds),
        rod([head, head + ahead * NOSE.0], NOSE.1, points),
    ]
}

/// Returns a glove around a grip, whose fingers bend as firmly as the hand holds.
fn glove(grip: &Pose, side: usize, hand: &Hand) -> Vec<Rod> {
    let [holds, points] = colours(hand);
    // +x goes out of the left palm, and into the right one; the fingers of an open hand are along -y.
    let out = if side == 0 { 1.0 } else { -1.0 };
    let rod = |ends: [DVec3; 2], radii, colour| Rod { ends: ends.map(|end| grip.place(end)), radii, colour };
    let [palm, finger, tip] = THICK;
    let mut rods = Vec::new();
    for (number, (towards_thumb, length)) in FINGERS.into_iter().enumerate() {
        let colour = if number == 0 { points } else { holds };
        let knuckle = DVec3::new(0.0, -KNUCKLES, -towards_thumb);
        rods.push(rod([DVec3::new(0.0, WRIST, -0.5 * towards_thumb), knuckle], [palm; 2], holds));
        let pinches = number == 0 && hand.select;
        let bend = 0.25 + (FIST - 0.25) * hand.squeeze.max(if pinches { 0.7 } else { 0.0 }).clamp(0.0, 1.0);
        let along = |turn: f64| DQuat::from_rotation_z(out * turn) * DVec3::NEG_Y * length;
        let middle = knuckle + along(bend);
        rods.push(rod([knuckle, middle], [finger; 2], colour));
        rods.push(rod([middle, middle + along(2.0 * bend)], [finger, tip], colour));
    }
    let root = DVec3::new(0.0, 0.5 * WRIST, -0.02);
    let joint = DVec3::new(0.012 * out, -0.005, -0.05);
    rods.push(rod([root, joint], [palm; 2], holds));
    rods.push(rod([joint, joint + DVec3::new(0.012 * out, -0.035, -0.008)], [finger, tip], points));
    rods
}

/// Returns a rod for each bone between two joints.
fn skeleton(joints: &[Joint; JOINTS], hand: &Hand) -> Vec<Rod> {
    let [holds, points] = colours(hand);
    const WRIST: usize = 1;
    // Where each finger begins, of those that are listed one after the other; the index finger points.
    let fingers = [2..6, 6..11, 11..16, 16..21, 21..26];
    let bone = |from: usize, to: usize, colour| Rod {
        ends: [joints[from].place, joints[to].place],
        radii: [joints[from].radius, joints[to].radius],
        colour,
    };
    let finger = |(number, finger): (usize, std::ops::Range<usize>)| {
        let colour = if number == 1 { points } else { holds };
        let first = finger.start;
        let within = (first..finger.end - 1).map(move |joint| bone(joint, joint + 1, colour));
        std::iter::once(bone(WRIST, first, holds)).chain(within)
    };
    fingers.into_iter().enumerate().flat_map(finger).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRIP: Pose = Pose { position: DVec3::new(0.1, 1.2, -0.4), orientation: DQuat::IDENTITY };

    #[test]
    fn a_controller_points_where_the_ray_does_and_tells_what_is_pressed() {
        let aim = Pose { orientation: DQuat::from_rotation_y(0.7), ..GRIP };
        let hand = Hand { grip: Some(GRIP), aim: Some(aim), ..Hand::default() };
        let rest = rods(&[Hand::default(), hand]);
        let nose = rest[2].ends[1] - rest[2].ends[0];
        assert!(rest.len() == 3 && nose.normalize().distance(aim.forward()) < 1e-9, "{rest:?}");
        let near = |rod: &Rod| rod.ends.iter().all(|end| end.distance(GRIP.position) < 0.12);
        assert!(rest.iter().all(near), "as large as a hand");
        let held = rods(&[Hand::default(), Hand { squeeze: 1.0, ..hand }]);
        assert!(held[0].colour != rest[0].colour && held[2].colour == rest[2].colour);
        let clicked = rods(&[Hand::default(), Hand { select: true, ..hand }]);
        assert!(clicked[0].colour == rest[0].colour && clicked[2].colour != rest[2].colour);
        assert!(rods(&[Hand::default(), Hand { squeeze: 1.0, ..Hand::default() }]).is_empty());
    }

    #[test]
    fn a_glove_bends_to_its_palm() {
        for (side, out) in [(0, 1.0), (1, -1.0)] {
            let of = |squeeze| {
                let mut hands = [Hand::default(); 2];
                hands[side] = Hand { grip: Some(GRIP), bare: true, squeeze, ..Hand::default() };
                rods(&hands)
            };
            let tip = |squeeze: f64| of(squeeze)[2].ends[1] - GRIP.position;
            assert!(tip(0.0).y < -0.09, "straight, along the palm: {}", tip(0.0));
            assert!(out * tip(1.0).x > 0.02 && tip(1.0).y > -0.06, "bent, before the palm: {}", tip(1.0));
            assert_eq!(of(0.0).len(), 14);
        }
    }

    #[test]
    fn joints_are_joined_by_bones() {
        let joint = |n: usize| Joint { place: DVec3::X * n as f64, radius: 0.01 };
        let joints: [Joint; JOINTS] = std::array::from_fn(joint);
        let hand = Hand { grip: Some(GRIP), joints: Some(joints), bare: true, ..Hand::default() };
        let bones = rods(&[hand, Hand::default()]);
        assert_eq!(bones.len(), 24, "19 within fingers, and five of the palm");
        let ends: Vec<_> = bones.iter().map(|bone| bone.ends.map(|end| end.x as usize)).collect();
        assert!(ends.contains(&[1, 21]) && ends.contains(&[24, 25]) && !ends.contains(&[5, 6]), "{ends:?}");
        let with_controller = Hand { bare: false, ..hand };
        assert_eq!(rods(&[with_controller, Hand::default()]).len(), 3, "joints are a guess there");
    }
}
