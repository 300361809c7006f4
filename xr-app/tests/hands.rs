//! Hands as both eyes see them: where they are, before and behind the patient, and what they cost.

use crate::support::{device, options, script, session, silent};
use engine::render::Fov;
use glam::{DQuat, DVec3};
use xr_app::headset::simulated::{Script, Simulated};
use xr_app::headset::{Eye, Hand, Hands, Headset as _, JOINTS, Joint, Pose};
use xr_app::viewer::Options;

fn still(frames: u64, hands: fn(f64) -> Hands) -> Script {
    Script { head: |_| (Pose::IDENTITY, true), hands, eye_size: [240, 240], ..script(frames) }
}

fn best() -> Options {
    Options { level: Some(0), ..options() }
}

/// Returns hands with controllers at these places.
fn at(places: [DVec3; 2]) -> Hands {
    places.map(|position| {
        let grip = Some(Pose { position, orientation: DQuat::IDENTITY });
        Hand { grip, ..Hand::default() }
    })
}

const BESIDE: [DVec3; 2] = [DVec3::new(-0.2, -0.15, -0.5), DVec3::new(0.2, -0.1, -0.4)];

/// Returns the pixel in which an eye sees a place.
fn pixel(eye: &Eye, place: DVec3, [width, height]: [u32; 2]) -> [u32; 2] {
    let seen = eye.pose.orientation.inverse() * (place - eye.pose.position);
    let Fov { left, right, up, down } = eye.fov;
    let part = [(seen.x / -seen.z - left) / (right - left), (up - seen.y / -seen.z) / (up - down)];
    [(part[0] * f64::from(width)) as u32, (part[1] * f64::from(height)) as u32]
}

/// Returns the colour in which each eye shows a place.
fn shown(headset: &Simulated, place: DVec3) -> [[u8; 4]; 2] {
    let size @ [width, height] = headset.description().eye_size;
    let texels: Vec<[u8; 4]> = headset.picture().read().expect("the picture");
    let eyes = headset.shown.expect("a frame");
    [0, 1].map(|eye| {
        let [x, y] = pixel(&eyes[eye], place, size);
        texels[((eye as u32 * height + y) * width + x) as usize]
    })
}

fn is_grey([r, g, b, _]: [u8; 4]) -> bool {
    r > 90 && r.abs_diff(g) < 12 && b.abs_diff(g) < 14
}

/// Both eyes see a controller where it is held, and nothing a hand's breadth beside it; the pictures that are
/// written show the same.
#[test]
fn controllers_are_seen_where_they_are_held() {
    let gpu = device();
    let (mut viewer, headset) = session(&gpu, still(6, |_| at(BESIDE)), best());
    for place in BESIDE {
        assert!(shown(&headset, place).into_iter().all(is_grey), "{place}: {:?}", shown(&headset, place));
        let beside = place + DVec3::X * 0.1f64.copysign(place.x);
        assert!(!shown(&headset, beside).into_iter().any(is_grey), "beside {place}");
    }
    let found: Vec<[u8; 4]> = headset.picture().read().expect("the picture");
    let kept: Vec<[u8; 4]> = viewer.picture().expect("the same again").read().expect("the picture");
    assert!(found == kept, "the picture that is written shows the same");
    let (_, none) = session(&gpu, still(6, |_| Hands::default()), best());
    assert!(!shown(&none, BESIDE[1]).into_iter().any(is_grey), "no hands, no bodies");
    silent(&gpu);
}

/// Behind the arm of the cross that goes from left to right, for both eyes; the patient stands 0.6 m ahead.
const BEHIND: DVec3 = DVec3::new(0.0, -0.0346, -0.75);

/// Where the headset takes depth, a hand behind the patient is hidden; where it does not, hands are over
/// everything.
#[test]
fn the_patient_hides_a_hand_behind_it() {
    let gpu = device();
    let nearer = BEHIND * 0.6;
    for depth in [true, false] {
        let script = |hands: fn(f64) -> Hands| Script { depth, ..still(6, hands) };
        let (_, before) = session(&gpu, script(|_| at([BEHIND * 0.6; 2])), best());
        let (_, behind) = session(&gpu, script(|_| at([BEHIND; 2])), best());
        let (_, none) = session(&gpu, script(|_| Hands::default()), best());
        assert!(shown(&before, nearer).into_iter().all(is_grey), "before it: {:?}", shown(&before, nearer));
        let [found, bare] = [&behind, &none].map(|headset| shown(headset, BEHIND));
        assert_eq!(found == bare, depth, "depth {depth}: {found:?} with a hand behind, {bare:?} without");
    }
    silent(&gpu);
}

/// Hands without controllers are gloves, or what their joints say; a frame allocates nothing for them.
#[test]
fn bare_hands_are_seen_and_cost_no_memory() {
    let gpu = device();
    fn bare(_: f64) -> Hands {
        let [left, right] = at(BESIDE);
        // A finger straight up from where the right hand is, 15 cm of it.
        let joint = |n: usize| Joint { place: BESIDE[1] + DVec3::Y * (0.006 * n as f64), radius: 0.01 };
        let joints = Some(std::array::from_fn::<_, JOINTS, _>(joint));
        [Hand { bare: true, ..left }, Hand { bare: true, joints, ..right }]
    }
    let (viewer, headset) = session(&gpu, still(40, bare), best());
    let report = viewer.report(&headset);
    assert_eq!((report.allocations, report.pipelines), (0, 0));
    // The fingers of a hand at rest are along -y of its grip.
    for place in [BESIDE[0] - DVec3::Y * 0.03, BESIDE[1] + DVec3::Y * 0.12] {
        assert!(shown(&headset, place).into_iter().all(is_grey), "{place}: {:?}", shown(&headset, place));
    }
    assert!(!shown(&headset, BESIDE[1] - DVec3::Y * 0.05).into_iter().any(is_grey), "joints are no glove");
    silent(&gpu);
}
