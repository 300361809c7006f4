//! The panel in the room, readings and distances: what a hand's ray does there, and what both eyes see of it.

use std::sync::OnceLock;
use std::sync::atomic::AtomicBool;

use crate::support::{device, options, script, session, silent};
use egui::pos2;
use engine::gpu::Gpu;
use engine::render::{Camera, Fov, Look, Renderer, Scene, Settings, mode};
use engine::splat::{Activations as _, Splat, SplatSet};
use engine::transfer::preset;
use glam::{DQuat, DVec3};
use view::model::transfer::Transfer;
use xr_app::headset::simulated::{Script, Simulated};
use xr_app::headset::{Hand, Hands, Headset as _, Pose};
use xr_app::panel::SIZE;
use xr_app::placement::Placement;
use xr_app::pointing::PickData;
use xr_app::sheets::Plane;
use xr_app::viewer::{Options, Viewer};

/// Returns a hand at the right of the head that points at a place in the room.
fn aims(at: DVec3) -> Hand {
    let position = DVec3::new(0.15, -0.25, -0.1);
    let orientation = DQuat::from_rotation_arc(DVec3::NEG_Z, (at - position).normalize());
    Hand { aim: Some(Pose { position, orientation }), ..Hand::default() }
}

/// Returns the frame of a time, from 1 on: simulated headsets show 72 of them a second unless they are told
/// otherwise.
fn frame(seconds: f64) -> u64 {
    (seconds * Script::default().rate_hz).round() as u64
}

fn still(frames: u64, hands: fn(f64) -> Hands) -> Script {
    Script { head: |_| (Pose::IDENTITY, true), hands, eye_size: [320, 320], ..script(frames) }
}

fn with_panel() -> Options {
    Options { panel: true, level: Some(0), ..options() }
}

/// Returns where the panel stands: beside the cross, for a head in the middle of the room.
fn panel() -> Plane {
    static PANEL: OnceLock<Plane> = OnceLock::new();
    *PANEL.get_or_init(|| {
        let small = Script { eye_size: [32, 32], ..still(3, |_| Hands::default()) };
        let (viewer, _) = session(&device(), small, with_panel());
        *viewer.pointing().panel().expect("it is shown")
    })
}

/// In the first row of presets, the second one: points of the panel.
const SECOND_PRESET: egui::Pos2 = pos2(130.0, 79.0);

/// Points at a preset, pulls the trigger, and lets go.
fn clicks(seconds: f64) -> Hands {
    let at = panel().place(SECOND_PRESET);
    let select = (8..11).contains(&frame(seconds));
    [Hand::default(), Hand { select, squeeze: 1.0, ..aims(at) }]
}

#[test]
fn a_ray_chooses_a_preset_on_the_panel() {
    let gpu = device();
    let (before, _) = session(&gpu, still(7, clicks), with_panel());
    assert_eq!(before.controls().preset(), "CT-Bone");
    let (after, _) = session(&gpu, still(16, clicks), with_panel());
    let chosen = after.controls().preset();
    assert_eq!(chosen, "CT-Bones-Steep");
    let expected = Transfer::new(&preset(chosen).expect("a preset").over(after.controls().range));
    assert_eq!(Transfer::new(&after.scene().look().transfer), expected);
    assert_eq!(after.placement(), before.placement(), "a hand on the panel takes hold of nothing");
    silent(&gpu);
}

/// Returns a left hand without a controller whose open palm is before the eyes, 0.35 m away, in the frames of
/// a range.
fn shows_palm(seconds: f64, frames: std::ops::Range<u64>) -> Hands {
    let position = DVec3::new(-0.05, -0.08, -0.35);
    let away = if frames.contains(&frame(seconds)) { -position } else { position };
    let orientation = DQuat::from_rotation_arc(DVec3::X, away.normalize());
    let grip = Some(Pose { position, orientation });
    [Hand { grip, bare: true, ..Hand::default() }, Hand::default()]
}

/// At 72 frames a second half a second is 36 of them.
#[test]
fn an_open_palm_calls_the_panel_and_sends_it_away() {
    let gpu = device();
    let shown = |frames, hands| {
        let small = Script { eye_size: [64, 64], ..still(frames, hands) };
        let (viewer, _) = session(&gpu, small, Options { panel: false, ..with_panel() });
        viewer.pointing().panel().copied()
    };
    assert!(shown(60, |s| shows_palm(s, 5..35)).is_none(), "a glance");
    let called = shown(60, |s| shows_palm(s, 5..50)).expect("half a second");
    assert_eq!(called, panel());
    assert!(shown(110, |s| shows_palm(s, 5..110)).is_some(), "however long");
    let twice = |s| if frame(s) < 60 { shows_palm(s, 5..50) } else { shows_palm(s, 60..110) };
    assert!(shown(110, twice).is_none(), "the second time it goes");
    silent(&gpu);
}

/// Both eyes see the panel where it stands, in its size: its fill just within its edges, and the background
/// without.
#[test]
fn the_panel_stands_in_the_room() {
    let gpu = device();
    let (viewer, headset) = session(&gpu, still(10, |_| Hands::default()), with_panel());
    let plane = *viewer.pointing().panel().expect("it is shown");
    let [width, height] = headset.description().eye_size;
    let shown = headset.picture().read::<[u8; 4]>().expect("the picture");
    let eyes = headset.shown.expect("a frame");
    let mut places = [0.0; 2];
    for (at, eye) in eyes.iter().enumerate() {
        let seen = |point: egui::Pos2| {
            let x = eye.pose.orientation.inverse() * (plane.place(point) - eye.pose.position);
            let (across, up) = (x.x / -x.z, x.y / -x.z);
            let Fov { left, right, up: top, down } = eye.fov;
            let part = [(across - left) / (right - left), (top - up) / (top - down)];
            [part[0] * f64::from(width), part[1] * f64::from(height)]
        };
        let texel = |[x, y]: [f64; 2]| {
            let inside = x >= 0.0 && y >= 0.0 && x < f64::from(width) && y < f64::from(height);
            inside.then(|| shown[(at as u32 * width * height + y as u32 * width + x as u32) as usize])
        };
        let mut checked = 0;
        for part in [0.1, 0.35, 0.6, 0.85] {
            // 2 mm within, and 4 mm without: a pixel is 4 mm there.
            for (x, y, side) in [
                (SIZE.x, part * SIZE.y, [1.0, 0.0]),
                (part * SIZE.x, 0.0, [0.0, -1.0]),
                (part * SIZE.x, SIZE.y, [0.0, 1.0]),
            ] {
                let off = |mm: f32| texel(seen(pos2(x + side[0] * mm, y + side[1] * mm)));
                let (Some(within), Some(without)) = (off(-3.0), off(5.0)) else { continue };
                assert!(within[..3].iter().all(|&c| (20..45).contains(&c)), "fill at {x}, {y}: {within:?}");
                assert!(
                    without[0].abs_diff(51) <= 1 && without[2] == 0,
                    "background at {x}, {y}: {without:?}"
                );
                checked += 1;
            }
        }
        assert!(checked >= 6, "{checked} places are seen by eye {at}");
        places[at] = seen(pos2(SIZE.x * 0.5, SIZE.y * 0.5))[0];
    }
    silent(&gpu);
}

/// With the panel, a ray that rests on it and a distance, a frame allocates nothing and makes nothing.
#[test]
fn a_panel_that_rests_costs_no_memory() {
    let gpu = device();
    fn rests(_: f64) -> Hands {
        [Hand::default(), aims(panel().place(pos2(200.0, 500.0)))]
    }
    let (viewer, headset) = session(&gpu, still(60, rests), with_panel());
    let report = viewer.report(&headset);
    assert_eq!((report.allocations, report.pipelines), (0, 0));
    silent(&gpu);
}

/// Two balls of 9 mm about 80 mm apart from left to right, as dense as bone.
fn balls() -> SplatSet {
    let mut set = SplatSet { origin_mm: DVec3::new(-20.0, 35.0, 900.0), ..SplatSet::default() };
    for middle in [-40.0, 40.0f32] {
        for i in 0..7i32.pow(3) {
            let [x, y, z] = [i % 7, i / 7 % 7, i / 49].map(|n| 3.0 * (n - 3) as f32);
            if x * x + y * y + z * z > 81.0 {
                continue;
            }
            let mut splat = Splat {
                mean: [middle + x, y, z],
                intensity: 1200.0,
                rotation: [1.0, 0.0, 0.0, 0.0],
                ..Splat::default()
            };
            splat.set_opacity(0.95);
            splat.set_scale([2.0; 3]);
            set.splats.push(splat);
        }
    }
    set
}

/// Hands that stretch the patient to twice the size about its middle, and let go.
const HELD: [[DVec3; 2]; 2] = [
    [DVec3::new(-0.1, 0.0, -0.6), DVec3::new(0.1, 0.0, -0.6)],
    [DVec3::new(-0.2, 0.0, -0.6), DVec3::new(0.2, 0.0, -0.6)],
];

/// Returns where the patient is after that.
fn stretched(bounds: [DVec3; 2]) -> Placement {
    let [low, high] = bounds;
    Placement::before(&Pose::IDENTITY, (low + high) * 0.5, (high - low).length() * 0.5)
        .stretched(HELD[0], HELD[1], 2.0)
}

/// The balls have this middle, mm RAS.
const MIDDLE: DVec3 = DVec3::new(-20.0, 35.0, 900.0);

/// Stretches, then measures from one ball to the other with the right hand.
fn measures(seconds: f64) -> Hands {
    let frame = frame(seconds);
    if frame < 8 {
        let held = HELD[usize::from(frame >= 5)];
        return held.map(|position| Hand {
            grip: Some(Pose { position, ..Pose::IDENTITY }),
            squeeze: 1.0,
            ..Hand::default()
        });
    }
    let placement = stretched([MIDDLE - 49.0, MIDDLE + 49.0]);
    let side = if frame < 20 { -40.0 } else { 40.0 };
    let at = placement.room(MIDDLE + DVec3::X * side);
    let select = matches!(frame, 14..=16 | 26..=28);
    [Hand::default(), Hand { select, ..aims(at) }]
}

/// Returns the depth of the first thing on a ray by the renderer, mm: one pixel, looking along it.
fn depth(gpu: &Gpu, scene: &Scene, from: DVec3, to: DVec3) -> f64 {
    let settings = Settings { depth: true, precise: true, ..Settings::new([9, 9]) };
    let mut renderer =
        Renderer::new(gpu, mode("exact").expect("a mode"), scene, &settings).expect("a renderer");
    let camera = Camera::looking(from, to, DVec3::Z, Fov::symmetric(0.2, 1.0)).expect("a camera");
    renderer.render(scene, &[camera]).expect("a picture");
    f64::from(renderer.target.read_depth(0).expect("depth")[40])
}

#[test]
fn a_distance_is_in_the_patients_millimetres_whatever_the_scale() {
    let gpu = device();
    let set = balls();
    let look = Look::new(preset("CT-Bone").expect("a preset").over([-1000.0, 2000.0]));
    let scene = Scene::new(&gpu, Some(&set), None, &look).expect("a scene");
    // 1.3 mm a pixel where the balls are.
    let left_fov = Fov { left: -0.37, right: 0.33, up: 0.35, down: -0.35 };
    let mut headset = Simulated::new(&gpu, Script { left_fov, ..still(36, measures) }).expect("a headset");
    let mut viewer = Viewer::new(&gpu, scene, &headset, options()).expect("a viewer");
    viewer.set_pick_data(PickData::of(&set));
    viewer.pointing_mut().measure();
    viewer.run(&mut headset, &AtomicBool::new(false)).expect("a session");
    let placement = *viewer.placement();
    assert!((placement.scale - 2.0).abs() < 1e-9, "stretched: {}", placement.scale);
    let [distance] = viewer.controls().state.distances[..] else { panic!("one distance") };
    // What the renderer says about the same two rays.
    let hand = placement.patient(DVec3::new(0.15, -0.25, -0.1));
    let ends = [-40.0, 40.0].map(|side| {
        let to = MIDDLE + DVec3::X * side;
        hand + (to - hand).normalize() * depth(&gpu, viewer.scene(), hand, to)
    });
    for (found, expected) in [(distance.from_mm, ends[0]), (distance.to_mm, ends[1])] {
        // Half of the light against the mean depth of the light.
        assert!(found.distance(expected) < 1.0, "{found} by the probe, {expected} by the renderer");
    }
    assert!((distance.mm() - ends[0].distance(ends[1])).abs() < 0.5, "{} mm", distance.mm());
    assert!((60.0..85.0).contains(&distance.mm()), "{} mm", distance.mm());
    let met = viewer.pointing().hit().expect("the ray rests on the second ball");
    assert!((met.intensity - 1200.0).abs() < 60.0, "{} HU", met.intensity);
    // The line between them is drawn, in the colour of what is measured.
    let shown = headset.picture().read::<[u8; 4]>().expect("the picture");
    let signal = shown.iter().filter(|t| t[0] > 180 && t[1] > 140 && t[2] < 120).count();
    assert!(signal > 60, "{signal} pixels of the line and its length");
    silent(&gpu);
}
