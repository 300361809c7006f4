//! What a user is told and can take back: words before the eyes, pulses in the hands, the card, undo; and the
//! panel's frame, by which it is carried.

use std::sync::OnceLock;

use crate::support::{device, keep, options, script, session, silent};
use egui::{Pos2, pos2};
use engine::render::Fov;
use glam::{DQuat, DVec3};
use xr_app::feedback::{CLICK, GRAB};
use xr_app::headset::simulated::{Script, Simulated};
use xr_app::headset::{Event, Eye, Hand, Hands, Headset as _, Pose, Pulse};
use xr_app::panel::SIZE;
use xr_app::sheets::Plane;
use xr_app::viewer::Options;

/// Places on the panel: the second preset, the button that undoes, the bar below.
const SECOND_PRESET: Pos2 = pos2(130.0, 79.0);
const UNDO: Pos2 = pos2(28.0, 44.0);
const BAR: Pos2 = pos2(200.0, 577.0);

fn frame(seconds: f64) -> u64 {
    (seconds * Script::default().rate_hz).round() as u64
}

fn still(frames: u64, hands: fn(f64) -> Hands) -> Script {
    Script { head: |_| (Pose::IDENTITY, true), hands, eye_size: [64, 64], ..script(frames) }
}

fn with_panel() -> Options {
    Options { panel: true, level: Some(0), ..options() }
}

/// Returns where the panel stands at first.
fn panel() -> Plane {
    static PANEL: OnceLock<Plane> = OnceLock::new();
    *PANEL.get_or_init(|| {
        let (viewer, _) = session(&device(), still(3, |_| Hands::default()), with_panel());
        *viewer.pointing().panel().expect("it is shown")
    })
}

/// Returns a hand at the right of the head that points at a place in the room.
fn aims(at: DVec3) -> Hand {
    let position = DVec3::new(0.15, -0.25, -0.1);
    let orientation = DQuat::from_rotation_arc(DVec3::NEG_Z, (at - position).normalize());
    Hand { aim: Some(Pose { position, orientation }), ..Hand::default() }
}

/// Returns a right hand that clicks on a place of the panel.
fn click(at: Pos2, select: bool) -> Hands {
    [Hand::default(), Hand { select, ..aims(panel().place(at)) }]
}

/// Chooses a preset, and later clicks on Undo.
fn chooses_and_undoes(seconds: f64) -> Hands {
    match frame(seconds) {
        n if n < 20 => click(SECOND_PRESET, (8..11).contains(&n)),
        n => click(UNDO, (28..31).contains(&n)),
    }
}

/// Returns the hands and pulses without their frames.
fn felt(headset: &Simulated) -> Vec<(usize, Pulse)> {
    headset.pulses.iter().map(|&(_, side, pulse)| (side, pulse)).collect()
}

#[test]
fn a_click_is_felt_and_the_preset_is_named_for_two_seconds() {
    let gpu = device();
    let (viewer, headset) = session(&gpu, still(16, chooses_and_undoes), with_panel());
    assert_eq!(
        (viewer.controls().preset(), viewer.pointing().notice()),
        ("CT-Bones-Steep", Some("CT-Bones-Steep"))
    );
    assert_eq!(felt(&headset), [(1, CLICK)]);
    fn chooses(seconds: f64) -> Hands {
        click(SECOND_PRESET, (8..11).contains(&frame(seconds)))
    }
    let (viewer, _) = session(&gpu, still(145, chooses), with_panel());
    assert!(viewer.pointing().notice().is_some(), "just under two seconds later");
    let (viewer, _) = session(&gpu, still(165, chooses), with_panel());
    assert_eq!(viewer.pointing().notice(), None);
    silent(&gpu);
}

/// Presses the left second button, with nothing to undo.
fn undoes_nothing(seconds: f64) -> Hands {
    let other = (5..9).contains(&frame(seconds));
    [Hand { other, ..Hand::default() }, Hand::default()]
}

#[test]
fn words_cost_no_memory() {
    let gpu = device();
    let (viewer, headset) = session(&gpu, still(30, undoes_nothing), with_panel());
    assert_eq!(viewer.pointing().notice(), Some("Nothing to undo"));
    let report = viewer.report(&headset);
    assert_eq!((report.allocations, report.pipelines), (0, 0), "glyphs are there from the start");
    silent(&gpu);
}

#[test]
fn the_panel_undoes() {
    let gpu = device();
    let (viewer, headset) = session(&gpu, still(36, chooses_and_undoes), with_panel());
    assert_eq!((viewer.controls().preset(), viewer.pointing().notice()), ("CT-Bone", Some("Undone")));
    assert_eq!(felt(&headset), [(1, CLICK), (1, CLICK)]);
    silent(&gpu);
}

/// Points at the bar below the panel, takes hold, and swings to the right by a tenth of a radian.
fn carries_the_panel(seconds: f64) -> Hands {
    let hand = aims(panel().place(BAR));
    let n = frame(seconds);
    let turn = DQuat::from_rotation_y(-0.1 * (n.clamp(10, 20) - 10) as f64 / 10.0);
    let aim = hand.aim.map(|aim| Pose { orientation: turn * aim.orientation, ..aim });
    let squeeze = if (8..30).contains(&n) { 1.0 } else { 0.0 };
    [Hand::default(), Hand { aim, grip: aim, squeeze, ..hand }]
}

#[test]
fn the_panel_is_carried_by_its_frame() {
    let gpu = device();
    let (viewer, headset) = session(&gpu, still(40, carries_the_panel), with_panel());
    let (before, after) = (panel(), *viewer.pointing().panel().expect("it is shown"));
    let middle = (SIZE * 0.5).to_pos2();
    let hand = aims(before.place(BAR)).aim.expect("a pose");
    let turn = DQuat::from_rotation_y(-0.1);
    let expected = hand.position + turn * (before.place(middle) - hand.position);
    assert!(after.place(middle).distance(expected) < 1e-9, "{} {expected}", after.place(middle));
    assert!(after.down.normalize().y < -0.999, "upright");
    let towards = after.right.cross(after.down).normalize().dot(after.place(middle).normalize());
    assert!(towards.abs() > 0.98, "it faces the viewer: {towards}");
    let (resting, _) = session(&gpu, still(4, |_| Hands::default()), with_panel());
    assert_eq!(viewer.placement(), resting.placement(), "the patient stays");
    assert_eq!(felt(&headset), [(1, GRAB)]);
    silent(&gpu);
}

/// Clicks on a preset twice.
fn clicks_twice(seconds: f64) -> Hands {
    click(SECOND_PRESET, matches!(frame(seconds), 8..=11 | 18..=21))
}

#[test]
fn the_card_is_closed_by_a_click_that_does_nothing_else() {
    let gpu = device();
    let with_card = || Options { card: true, ..with_panel() };
    let (viewer, headset) = session(&gpu, still(6, clicks_twice), with_card());
    assert_eq!(viewer.pointing().card(), [true, false]);
    let report = viewer.report(&headset);
    assert_eq!((report.allocations, report.pipelines), (0, 0));
    let (viewer, _) = session(&gpu, still(16, clicks_twice), with_card());
    assert_eq!((viewer.pointing().card(), viewer.controls().preset()), ([false, true], "CT-Bone"));
    let (viewer, _) = session(&gpu, still(26, clicks_twice), with_card());
    assert_eq!(viewer.controls().preset(), "CT-Bones-Steep", "the next one clicks");
    silent(&gpu);
}

/// Returns a head that turns round before it recentres.
fn turns(seconds: f64) -> (Pose, bool) {
    let turn = if frame(seconds) < 3 { 0.0 } else { 2.0 };
    (Pose { orientation: DQuat::from_rotation_y(turn), ..Pose::IDENTITY }, true)
}

/// With the card, both eyes see everything of patient and panel that they see without it; after recentring, too.
#[test]
fn the_card_hides_neither_the_patient_nor_the_panel() {
    let gpu = device();
    let size = [640, 720];
    for (name, head) in [("card", still(0, |_| Hands::default()).head), ("card-recentred", turns)] {
        let [without, with] = [false, true].map(|card| {
            let events = |frame| (frame == 5).then_some(Event::Recentred);
            let script = Script { eye_size: size, head, events, ..still(9, |_| Hands::default()) };
            let (viewer, headset) = session(&gpu, script, Options { card, ..with_panel() });
            assert_eq!(viewer.pointing().card(), [card, false]);
            headset.picture().read::<[u8; 4]>().expect("the picture")
        });
        keep(name, size, &with);
        let texels = (size[0] * size[1]) as usize;
        let background = without[0];
        for eye in 0..2 {
            let eye = eye * texels..(eye + 1) * texels;
            let (mut shown, mut kept) = (0, 0);
            for (without, with) in without[eye.clone()].iter().zip(&with[eye.clone()]) {
                assert!(*without == background || with == without, "{name}: {with:?} hides {without:?}");
                kept += usize::from(*without != background);
                shown += usize::from(with != without);
            }
            // The whole card has 26 by 43 degrees.
            assert!(kept > 1000 && shown > texels / 12, "{name}: {shown} pixels of it, {kept} of the rest");
        }
    }
    silent(&gpu);
}

/// Takes a plane into a hand in the middle of the patient.
fn cuts(seconds: f64) -> Hands {
    let position = DVec3::new(0.04, 0.2, -0.5);
    let grip = Some(Pose { position, orientation: DQuat::IDENTITY });
    let other = (4..7).contains(&frame(seconds)) || (12..15).contains(&frame(seconds));
    [Hand::default(), Hand { grip, other, ..Hand::default() }]
}

/// Returns the pixels within two of the one in which an eye sees a place.
fn around(headset: &Simulated, eye: usize, place: DVec3) -> Vec<[u8; 4]> {
    let [width, height] = headset.description().eye_size.map(|n| n as usize);
    let texels: Vec<[u8; 4]> = headset.picture().read().expect("the picture");
    let Eye { pose, fov: Fov { left, right, up, down } } = headset.shown.expect("a frame")[eye];
    let seen = pose.orientation.inverse() * (place - pose.position);
    let part = [(seen.x / -seen.z - left) / (right - left), (up - seen.y / -seen.z) / (up - down)];
    let [x, y] = [(part[0] * width as f64) as usize, (part[1] * height as f64) as usize];
    assert!((2..width - 2).contains(&x) && (2..height - 2).contains(&y), "{place} is seen at {x}, {y}");
    (0..25).map(|n| texels[(eye * height + y + n / 5 - 2) * width + x + n % 5 - 2]).collect()
}

#[test]
fn a_cutting_plane_has_an_outline_in_the_hand_and_where_it_stands() {
    let gpu = device();
    let is_blue = |p: &[u8; 4]| p[2] > 120 && p[2].saturating_sub(p[0]) > 40;
    for (frames, expected) in [(3, false), (10, true), (20, true)] {
        let script = Script { eye_size: [720, 720], ..still(frames, cuts) };
        let (viewer, headset) = session(&gpu, script, Options { level: Some(0), ..options() });
        let placement = viewer.placement();
        let hand = placement.patient(DVec3::new(0.04, 0.2, -0.5));
        let [low, high] = viewer.scene().bounds();
        // The middles of the upper and of the lower edge.
        for z in [low.z, high.z] {
            let place = placement.room(DVec3::new(hand.x, (low.y + high.y) * 0.5, z));
            for eye in 0..2 {
                let found = around(&headset, eye, place).iter().any(is_blue);
                assert_eq!(found, expected, "after {frames} frames, eye {eye}, {place}");
            }
        }
        let stands = viewer.controls().state.clip.planes.len();
        assert_eq!(stands, usize::from(frames == 20), "after {frames} frames");
    }
    silent(&gpu);
}
