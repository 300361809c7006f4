//! The whole loop without a runtime: what the eyes see, what hands do, what happens to a session, and what a
//! frame costs the host.

use std::sync::atomic::AtomicBool;

use crate::support::{all_levels, device, options, scene, script, session, silent};
use engine::gpu::Gpu;
use engine::render::{Fov, Renderer, Settings, VisibilityMask, mode};
use glam::{DQuat, DVec2, DVec3};
use xr_app::headset::simulated::{Script, Simulated, sway};
use xr_app::headset::{Blend, Event, Hand, Hands, Headset, Pose};
use xr_app::viewer::{Options, Viewer};

/// The pictures of both eyes are those of the offscreen renderer for the poses that were shown, over the
/// background, to 1 of 255; and they are different ones.
#[test]
fn eyes_see_what_the_renderer_shows() {
    let gpu = device();
    let (viewer, headset) = session(&gpu, script(12), options());
    let shown = headset.shown.expect("a frame was shown");
    let cameras = shown.map(|eye| viewer.placement().camera(&eye));
    let size = headset.description().eye_size;
    let settings = Settings { views: 2, ..Settings::new(size) };
    let mut renderer =
        Renderer::new(&gpu, mode("slab").expect("a mode"), viewer.scene(), &settings).expect("a renderer");
    renderer.render(viewer.scene(), &cameras).expect("a picture");
    let found: Vec<[u8; 4]> = headset.picture().read().expect("the picture");
    let texels = (size[0] * size[1]) as usize;
    let mut covered = [0, 0];
    for eye in 0..2 {
        let expected = renderer.target.read_colour(eye as u32).expect("a picture");
        for (found, expected) in found[eye * texels..].iter().zip(&expected) {
            covered[eye] += usize::from(expected[3] > 0.5);
            for (channel, background) in [0.2, 0.1, 0.0].into_iter().enumerate() {
                let wanted = (expected[channel] + (1.0 - expected[3]) * background).clamp(0.0, 1.0) * 255.0;
                assert!((f32::from(found[channel]) - wanted).abs() <= 1.0, "{found:?}, {expected:?}");
            }
            assert_eq!(found[3], 255, "opaque");
        }
    }
    assert!(covered.iter().all(|&n| n > 20), "{covered:?} pixels are covered");
    assert!(found[..texels] != found[texels..], "two eyes, two pictures");
    silent(&gpu);
}

/// Where the room is behind the picture it is premultiplied with its opacity, and nothing is left of older
/// frames.
#[test]
fn the_room_shows_through_where_there_is_nothing() {
    let gpu = device();
    for (blend, nothing) in [(Blend::Alpha, [0, 0, 0, 0]), (Blend::Additive, [0, 0, 0, 255])] {
        let (_, headset) = session(&gpu, Script { blend, ..script(8) }, options());
        let found: Vec<[u8; 4]> = headset.picture().read().expect("the picture");
        assert_eq!(found[0], nothing, "{blend:?}: the corner");
        assert!(found.iter().any(|p| p[0] > 100 && p[3] > 200), "{blend:?}: something is seen");
    }
    silent(&gpu);
}

/// After the start no frame allocates device memory or makes a pipeline, whatever levels are taken and lenses
/// become known.
#[test]
fn frames_allocate_nothing() {
    let gpu = device();
    // A budget that nothing fits, so that the controller goes all the way down.
    let tight = Options { budget_ms: Some(1e-6), ..options() };
    let (viewer, headset) = session(&gpu, Script { round_from: Some(20), ..script(60) }, tight);
    let report = viewer.report(&headset);
    assert_eq!((report.allocations, report.pipelines), (0, 0));
    assert_eq!(report.frames, 60);
    let last = report.samples.last().expect("frames").level;
    assert_eq!(last, all_levels().len() - 1, "down to the last level");
    assert!(report.frames_on[0] < 10, "at once: {:?}", report.frames_on);
    silent(&gpu);
}

/// Returns what a session with this script shows at last, by the bytes of both eyes.
fn last_picture(gpu: &Gpu, script: Script, options: Options) -> (Viewer, Simulated, Vec<[u8; 4]>) {
    let (viewer, headset) = session(gpu, script, options);
    let found = headset.picture().read().expect("the picture");
    (viewer, headset, found)
}

/// Returns a head that goes near to the patient and leans over, so that the cross reaches the corners of the
/// pictures.
fn nearing(seconds: f64) -> (Pose, bool) {
    let near = Pose { position: DVec3::new(0.0, 0.0, -0.55), orientation: DQuat::from_rotation_z(0.8) };
    (if seconds < 0.05 { Pose::IDENTITY } else { near }, true)
}

/// Where lenses are round the corners are background, though they would show something, and what is seen has
/// the same bits; it makes no difference whether that is known from the start.
#[test]
fn nothing_is_shown_behind_the_rims_of_round_lenses() {
    let gpu = device();
    for level in [0, all_levels().len() - 1] {
        let script = |round_from| Script { head: nearing, round_from, ..script(12) };
        let options = Options { level: Some(level), ..options() };
        let (_, _, whole) = last_picture(&gpu, script(None), options.clone());
        let [first, later] = [0, 6].map(|from| last_picture(&gpu, script(Some(from)), options.clone()));
        assert!(first.2 == later.2, "level {level}: other bits when lenses change");
        let (viewer, headset, found) = first;
        let eyes = headset.shown.expect("a frame");
        let [width, height] = headset.description().eye_size.map(|n| n as usize);
        let mut spared = 0;
        for (eye, lens) in headset.lenses().iter().enumerate() {
            let mask = VisibilityMask::of(&eyes[eye].fov, lens);
            // An ellipse has π/4 of its rectangle.
            assert!((0.17..0.2146).contains(&mask.share()), "{}", mask.share());
            for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
                let pixel = (eye * height + y) * width + x;
                let same = found[pixel] == whole[pixel];
                assert!(same || mask.at([x * 64 / width, y * 64 / height]), "level {level}: {x}, {y}");
                spared += usize::from(!same);
            }
        }
        // In mode alpha only what lies in the corners altogether is left out.
        assert!(spared > if level == 0 { 100 } else { 0 }, "level {level}: {spared} pixels are spared");
        let report = viewer.report(&headset);
        assert!(report.hidden.iter().all(|part| (0.17..0.2146).contains(part)), "{:?}", report.hidden);
    }
    silent(&gpu);
}

/// Returns a script in which the head stays where it is.
fn still(frames: u64, hands: fn(f64) -> Hands) -> Script {
    Script { head: |_| (Pose::IDENTITY, true), hands, ..script(frames) }
}

/// Returns a right hand that holds from the start and moves 1 cm to the right with each frame of 72 a second.
fn carrying(seconds: f64) -> Hands {
    let position = DVec3::new(0.01 * (seconds * 72.0).round(), 0.0, -0.4);
    let grip = Pose { position, orientation: DQuat::IDENTITY };
    [Hand::default(), Hand { grip: Some(grip), squeeze: 1.0, ..Hand::default() }]
}

#[test]
fn a_hand_carries_the_patient_along() {
    let gpu = device();
    let (resting, _) = session(&gpu, still(10, |_| Hands::default()), options());
    let (carried, _) = session(&gpu, still(10, carrying), options());
    let moved = carried.placement().position - resting.placement().position;
    assert!((moved - DVec3::X * 0.09).length() < 1e-9, "nine steps of 1 cm: {moved}");
    assert_eq!(carried.placement().scale, 1.0);
    silent(&gpu);
}

/// While window and level move and a cutting plane is in the hand, every frame has a look of its own; no frame allocates
/// memory, makes a pipeline or waits for anything but its turn.
#[test]
fn a_look_for_every_frame_makes_none_late() {
    fn cuts(seconds: f64) -> Hands {
        let frame = (seconds * 72.0).round();
        let grip = Pose { position: DVec3::new(0.002 * frame, 0.0, -0.5), orientation: DQuat::IDENTITY };
        let stick = DVec2::new(0.4, 0.8 * (0.2 * frame).cos());
        let other = (2.0..4.0).contains(&frame);
        [Hand::default(), Hand { grip: Some(grip), stick, other, ..Hand::default() }]
    }
    let gpu = device();
    let before = scene(&gpu).look().clone();
    let (viewer, headset) = session(&gpu, still(60, cuts), options());
    let (report, look) = (viewer.report(&headset), viewer.scene().look());
    assert!(look.transfer != before.transfer && look.clip.len() == 1, "{:?}", look.clip);
    assert_eq!((report.allocations, report.pipelines), (0, 0));
    assert!(report.waits <= report.frames + 1, "{} waits in {} frames", report.waits, report.frames);
    silent(&gpu);
}

/// The patient stands before the viewer when the head is first known; after the viewer has turned and
/// recentred, there.
#[test]
fn recentring_puts_the_patient_before_the_viewer() {
    let gpu = device();
    fn turning(seconds: f64) -> (Pose, bool) {
        let turned = Pose { orientation: DQuat::from_rotation_y(-1.0), ..Pose::IDENTITY };
        // Unknown in the first frames, and lost in some later ones.
        let frame = (seconds * 72.0).round() as u64;
        let known = !(frame <= 3 || (8..10).contains(&frame));
        (if frame > 5 { turned } else { Pose::IDENTITY }, known)
    }
    let turned = Script { head: turning, ..script(20) };
    let (viewer, headset) = session(&gpu, turned, options());
    assert!(viewer.placement().position.z < -0.1 && viewer.placement().position.x.abs() < 1e-9);
    assert_eq!(viewer.report(&headset).untracked, 5);
    let recentred =
        Script { head: turning, events: |frame| (frame == 15).then_some(Event::Recentred), ..script(20) };
    let (viewer, _) = session(&gpu, recentred, options());
    assert!(viewer.placement().position.x > 0.1, "to the right: {}", viewer.placement().position);
    silent(&gpu);
}

#[test]
fn a_stop_ends_the_session_by_the_headset() {
    let gpu = device();
    let mut headset = Simulated::new(&gpu, Script { frames: None, ..script(0) }).expect("a headset");
    let mut viewer = Viewer::new(&gpu, scene(&gpu), &headset, options()).expect("a viewer");
    viewer.run(&mut headset, &AtomicBool::new(true)).expect("a session");
    assert!(!headset.running());
    silent(&gpu);
}

#[test]
fn the_swaying_head_looks_ahead() {
    for tenth in 0..100 {
        let pose = sway(f64::from(tenth) * 0.1);
        let ahead = (DVec3::NEG_Z * 0.6 - pose.position).normalize();
        assert!(pose.forward().dot(ahead) > 0.99, "{pose:?}");
    }
    let fov = Script::default().left_fov;
    assert!(fov.left.abs() > fov.right && fov != Fov::symmetric(90.0, 1.0), "an eye sees more outwards");
}

/// On every level but the first a dot and a word tell both eyes, in one direction, that this is a draft.
#[test]
fn a_draft_is_marked_for_both_eyes() {
    let gpu = device();
    // So large that the middle of the dot holds the middle of a pixel.
    let size @ [width, height] = [320usize, 360];
    for level in [0, 1, all_levels().len() - 1] {
        let options = Options { level: Some(level), ..options() };
        let script = Script { eye_size: size.map(|n| n as u32), ..script(6) };
        let (mut viewer, headset) = session(&gpu, script, options);
        let eyes = headset.shown.expect("a frame");
        let shown: Vec<[u8; 4]> = headset.picture().read().expect("the picture");
        let kept: Vec<[u8; 4]> = viewer.picture().expect("the same again").read().expect("the picture");
        for (eye, Fov { left, right, up, down }) in eyes.map(|eye| eye.fov).into_iter().enumerate() {
            // Straight ahead, and 0.36 below.
            let place = [-left / (right - left), (up + 0.36) / (up - down)];
            let [x, y] = [(place[0] * width as f64) as usize, (place[1] * height as f64) as usize];
            for picture in [&shown, &kept] {
                let mut around =
                    (0..9).map(|i| picture[(eye * height + y + i / 3 - 1) * width + x + i % 3 - 1]);
                let is_amber = |p: [u8; 4]| p[0] > 250 && p[1].abs_diff(191) < 4 && p[2].abs_diff(26) < 6;
                assert_eq!(around.any(is_amber), level > 0, "level {level}, eye {eye}");
                // The word is 2 to 10.7 radii of 0.009 to the right of it, and as high as 2.1 of them.
                let radius = 0.009 / (right - left) * width as f64;
                let columns = x + (2.0 * radius) as usize..x + (10.7 * radius) as usize;
                let rows = y - radius as usize..=y + radius as usize;
                let word = rows.flat_map(|y| columns.clone().map(move |x| (eye * height + y) * width + x));
                let (amber, dark) = word.fold((0, 0), |(amber, dark), at| {
                    let is_dark = picture[at][..3].iter().all(|c| c.abs_diff(26) < 3);
                    (amber + usize::from(is_amber(picture[at])), dark + usize::from(is_dark))
                });
                assert_eq!(amber > 8 && dark > 8, level > 0, "level {level}: {amber} and {dark} pixels");
            }
        }
    }
    silent(&gpu);
}
