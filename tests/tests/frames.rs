//! Frames without waiting: what they show, what they cost the loop, and what is said of them afterwards.

use std::time::Duration;

use engine::gpu::{Gpu, Ticket};
use engine::render::{
    Appearance, Camera, ClipPlane, Fov, Frames, Look, Part, Quality, QualityLevel, Rays, Renderer, Scene,
    Settings, SplatKind, VisibilityMask, mode, quality_levels,
};
use engine::splat::{Field, Form, Grid, Splat, SplatSet};
use engine::transfer::preset;
use engine::unit::Unit;
use glam::{DAffine3, DVec2, DVec3, Vec3};
use rand::RngExt;
use vgs_tests::Device;
use vgs_tests::scene::{random, splat};

const SIZE: [u32; 2] = [80, 64];

/// Each thing that can be given up, in all modes that levels have.
fn all_levels() -> Vec<QualityLevel> {
    let level = |mode, resolution, coarseness| QualityLevel {
        mode,
        quality: Quality { resolution, coarseness, occlusion: true },
        cost: 1.0,
    };
    vec![
        level("slab", 1.0, 1.0),
        level("slab", 0.85, 1.0),
        level("slab", 1.0, 2.0),
        level("slab", 0.5, 1.5),
        level("decoded", 1.0, 1.0),
        level("decoded", 0.5, 2.0),
        level("alpha", 1.0, 1.0),
        level("alpha", 0.7, 1.0),
    ]
}

/// Splats in ten blocks of 30, each with a label of its own.
fn scene(gpu: &Gpu) -> Scene {
    let mut rng = random(31);
    let splats = (0..300)
        .map(|_| {
            let mut s = splat(&mut rng, Vec3::splat(50.0));
            s.intensity = rng.random_range(100.0f32..900.0);
            s
        })
        .collect();
    let origin_mm = DVec3::new(-120.0, 340.0, 1000.0);
    let labels = Some((0..300).map(|i| (i / 30) as u8).collect());
    let set = SplatSet {
        splats,
        origin_mm,
        field: Field::default(),
        unit: Unit::Hu,
        labels,
        ..SplatSet::default()
    };
    let transfer = preset("CT-Bone").expect("a preset").over([-100.0, 900.0]);
    Scene::new(gpu, Some(&set), None, &Look::new(transfer)).expect("a scene")
}

fn settings() -> Settings {
    Settings { views: 2, ..Settings::new(SIZE) }
}

/// Two eyes with asymmetric fields of view, turned towards each other by 2 x 4 degrees.
fn eyes(scene: &Scene) -> [Camera; 2] {
    let [low, high] = scene.bounds();
    let centre = (low + high) * 0.5;
    let head =
        Camera::from_side("anterior", centre, (high - low).length() * 0.4, 40.0, 1.25).expect("a head");
    let [left, right] = head.eyes(63.0);
    let canted = |eye: Camera, degrees: f64| eye.turned(eye.eye, eye.up, f64::to_radians(degrees));
    let fov = Fov { left: -0.5, right: 0.36, up: 0.35, down: -0.4 };
    let mirrored = Fov { left: -fov.right, right: -fov.left, ..fov };
    [Camera { fov, ..canted(left, -4.0) }, Camera { fov: mirrored, ..canted(right, 4.0) }]
}

/// Waits for a frame without the waits that are counted.
fn until_finished(gpu: &Gpu, ticket: Ticket) {
    while !gpu.has_finished(ticket).expect("a live device") {
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// On every level the picture is that of a renderer made for its size and step, bit for bit, in both views.
#[test]
fn each_level_shows_what_a_renderer_made_for_it_shows() {
    let gpu = Device::boot();
    let scene = scene(&gpu);
    let cameras = eyes(&scene);
    let mut frames = Frames::new(&gpu, &scene, &settings(), &all_levels()).expect("frames");
    frames.warm_up(&scene, &cameras).expect("all levels");
    for (number, level) in all_levels().iter().enumerate() {
        let frame = frames.begin(&scene, number).expect("a frame");
        let size = frame.size;
        let ticket = frames.submit(frame, &scene, &cameras).expect("submitted");
        gpu.wait(ticket).expect("rendered");
        assert_eq!(size, level.quality.size(SIZE));
        let alone = Settings { size, step: settings().step * level.quality.coarseness, ..settings() };
        let mut renderer =
            Renderer::new(&gpu, mode(level.mode).expect("a mode"), &scene, &alone).expect("alone");
        renderer.render(&scene, &cameras).expect("a picture");
        for view in 0..2 {
            let wide = frames.target.read_colour(view).expect("the target");
            let row = |y: usize| &wide[y * SIZE[0] as usize..][..size[0] as usize];
            let corner: Vec<_> = (0..size[1] as usize).flat_map(row).copied().collect();
            let expected = renderer.target.read_colour(view).expect("the picture");
            assert!(expected.iter().any(|p| p[3] > 0.1), "level {number}: something is seen");
            assert!(corner == expected, "level {number}, view {view}: other bits");
        }
    }
}

/// Two triangles of tangents for a rectangle.
fn rectangle(low: DVec2, high: DVec2) -> [[DVec2; 3]; 2] {
    let (a, b) = (DVec2::new(high.x, low.y), DVec2::new(low.x, high.y));
    [[low, a, high], [low, b, high]]
}

/// Where a picture is seen it has the bits that it has when all of it is; where no eye sees it nothing is
/// shown in mode slab, and in mode alpha nothing that lies there altogether.
#[test]
fn what_no_eye_sees_changes_nothing_else() {
    let gpu = Device::boot();
    let scene = scene(&gpu);
    let cameras = eyes(&scene);
    let asked = Settings { masked: true, depth: true, ..settings() };
    let all = Settings { depth: true, ..settings() };
    // The right half of the first view, where the scene is, and the middle of the second.
    let right = rectangle(DVec2::new(-0.07, -2.0), DVec2::new(2.0, 2.0));
    let middle = rectangle(DVec2::new(-0.25, -0.25), DVec2::new(0.25, 0.25));
    let masks = [VisibilityMask::of(&cameras[0].fov, &right), VisibilityMask::of(&cameras[1].fov, &middle)];
    let mut whole = Frames::new(&gpu, &scene, &all, &all_levels()).expect("frames");
    let mut frames = Frames::new(&gpu, &scene, &asked, &all_levels()).expect("frames");
    whole.warm_up(&scene, &cameras).expect("all levels");
    frames.warm_up(&scene, &cameras).expect("all levels");
    for (number, level) in all_levels().iter().enumerate() {
        for unseen in [false, true] {
            let shown = if unseen { masks.clone() } else { Default::default() };
            frames.set_visibility_masks(&shown);
            let mut size = SIZE;
            for frames in [&mut whole, &mut frames] {
                let frame = frames.begin(&scene, number).expect("a frame");
                size = frame.size;
                let ticket = frames.submit(frame, &scene, &cameras).expect("submitted");
                gpu.wait(ticket).expect("rendered");
            }
            for view in 0..2 {
                let [expected, found] =
                    [&whole, &frames].map(|frames| frames.target.read_colour(view).expect("a picture"));
                let [far, deep] =
                    [&whole, &frames].map(|frames| frames.target.read_depth(view).expect("a depth"));
                let mut spared = 0;
                for (y, x) in (0..size[1]).flat_map(|y| (0..size[0]).map(move |x| (y, x))) {
                    let pixel = (y * SIZE[0] + x) as usize;
                    let patch = [(x * 64 / size[0]) as usize, (y * 64 / size[1]) as usize];
                    let same = found[pixel] == expected[pixel] && deep[pixel] == far[pixel];
                    assert!(
                        same || shown[view as usize].at(patch),
                        "level {number}, view {view}: {x}, {y} has other bits"
                    );
                    spared += usize::from(found[pixel][3] == 0.0 && expected[pixel][3] > 0.0);
                }
                let least = if level.mode == "slab" { 200 } else { 5 };
                let least = least * (size[0] * size[1]) as usize / (SIZE[0] * SIZE[1]) as usize;
                assert_eq!(spared > least, unseen, "level {number}, view {view}: {spared} of {least}");
            }
        }
    }
}

/// Returns a look of a drag: every part of it differs from one step to the next.
fn dragged(step: usize) -> Look {
    let turn = step as f64 * 0.7;
    let transfer =
        preset("CT-Bone").expect("a preset").over([-100.0 - 40.0 * turn.sin(), 900.0 + 50.0 * turn.cos()]);
    let normal = DVec3::new(turn.cos(), turn.sin(), 0.0);
    let clip = vec![ClipPlane { normal, offset: normal.dot(DVec3::new(-95.0, 365.0, 1025.0)) - 20.0 }];
    let seen = Appearance { opacity: 0.5 + 0.4 * turn.sin() as f32, ..Appearance::default() };
    let objects = [(3, seen), (4, Appearance { visible: step.is_multiple_of(2), ..seen })].into();
    Look { clip, objects, ..Look::new(transfer) }
}

/// After a warm-up a frame allocates nothing, makes no pipeline and waits for nothing, whatever its level and though
/// the look is another one in each; and each is reported once, with its level and a time.
#[test]
fn frames_cause_no_hitches_and_are_all_reported() {
    let gpu = Device::boot();
    let mut scene = scene(&gpu);
    scene.set_look(&dragged(1)).expect("a look");
    let head = eyes(&scene);
    let mut frames = Frames::new(&gpu, &scene, &settings(), &all_levels()).expect("frames");
    frames.warm_up(&scene, &head).expect("all levels");
    // The first frames of a loop make the command buffers that are in flight at the same time.
    let before = gpu.hitches();
    let mut reported = Vec::new();
    let mut last = None;
    let count = 4 * all_levels().len();
    for number in 0..count {
        let turned = head.map(|eye| eye.turned(scene.bounds()[0], DVec3::Z, 0.01 * number as f64));
        scene.set_look(&dragged(number)).expect("a look");
        let frame = frames.begin(&scene, number % all_levels().len()).expect("a frame");
        let ticket = frames.submit(frame, &scene, &turned).expect("submitted");
        // As a display does: the next frame is not begun while three are in flight.
        if let Some(earlier) = last.replace(ticket) {
            until_finished(&gpu, earlier);
        }
        reported.extend(frames.finished().expect("news"));
    }
    until_finished(&gpu, last.expect("frames"));
    reported.extend(frames.finished().expect("news"));
    assert_eq!(gpu.hitches(), before);
    let found: Vec<_> = reported.iter().map(|f| f.level).collect();
    assert_eq!(found, (0..count).map(|n| n % all_levels().len()).collect::<Vec<_>>());
    assert!(reported.iter().all(|f| f.gpu_ms > 0.0 && f.gpu_ms < 60_000.0), "{reported:?}");
    assert!(reported.is_sorted_by_key(|f| f.ticket));
}

/// A frame shows the look that was set last before it, also if another one is set while it is in flight.
#[test]
fn a_look_that_is_set_meanwhile_is_that_of_the_next_frame() {
    let gpu = Device::boot();
    let mut scene = scene(&gpu);
    let head = eyes(&scene);
    let levels = all_levels();
    for (number, level) in levels.iter().enumerate() {
        let alone = |look: &Look, scene: &mut Scene| {
            scene.set_look(look).expect("a look");
            let row = mode(level.mode).expect("a mode");
            let mut renderer = Renderer::new(&gpu, row, scene, &settings()).expect("a renderer");
            renderer.render_at(scene, &head, &level.quality).expect("a picture");
            renderer.target.read_colour(0).expect("a picture")
        };
        let looks = [1, 2, 3, 4].map(dragged);
        let expected = looks.each_ref().map(|look| alone(look, &mut scene));
        assert!(expected.windows(2).all(|two| two[0] != two[1]), "{}: looks differ", level.mode);
        let mut frames = Frames::new(&gpu, &scene, &settings(), &levels[number..=number]).expect("frames");
        frames.warm_up(&scene, &head).expect("room");
        for (at, expected) in expected.iter().enumerate() {
            scene.set_look(&looks[at]).expect("a look");
            let frame = frames.begin(&scene, 0).expect("a frame");
            frames.submit(frame, &scene, &head).expect("submitted");
            scene.set_look(&looks[(at + 1) % looks.len()]).expect("a look");
            assert!(frames.target.read_colour(0).expect("a picture") == *expected, "{}: {at}", level.mode);
        }
    }
}

/// A picture in parts, with other submissions between them, has the bits of one at once.
#[test]
fn parts_are_the_whole_picture() {
    let gpu = Device::boot();
    let mut scene = scene(&gpu);
    scene.set_look(&dragged(1)).expect("a look");
    let head = eyes(&scene);
    for level in all_levels() {
        let row = mode(level.mode).expect("a mode");
        for rays in [Rays::Rasterized, Rays::Computed] {
            let settings = Settings { depth: true, rays, ..settings() };
            let [mut whole, mut parts] =
                [0, 1].map(|_| Renderer::new(&gpu, row, &scene, &settings).expect("a renderer"));
            whole.render_at(&scene, &head, &level.quality).expect("a picture");
            for _ in 0..2 {
                let (mut part, mut bands) = (Part::first(40), 40);
                loop {
                    let ticket = parts.submit(&scene, &head, &level.quality, part).expect("submitted");
                    whole.render_at(&scene, &head, &level.quality).expect("a picture");
                    gpu.wait(ticket).expect("rendered");
                    bands += 31;
                    let Some(next) = part.next(bands) else { break };
                    part = next;
                }
                // The first time may have found out what room it needs.
                parts.settle().expect("room");
            }
            for view in 0..2 {
                let [a, b] = [&whole, &parts].map(|r| r.target.read_colour(view).expect("a picture"));
                let [near, far] = [&whole, &parts].map(|r| r.target.read_depth(view).expect("a depth"));
                assert!(a.iter().any(|pixel| pixel[3] > 0.5), "{}: something is seen", level.mode);
                assert!(a == b && near == far, "{} {rays:?}: view {view}", level.mode);
            }
        }
    }
}

/// A frame that needs more room than all before it makes room for the next.
#[test]
fn a_frame_that_needs_more_room_makes_it() {
    let gpu = Device::boot();
    let scene = scene(&gpu);
    let far = eyes(&scene);
    // Everything is before the eyes from near by, in many tiles.
    let fov = Fov::symmetric(90.0, 1.25);
    let centre = (scene.bounds()[0] + scene.bounds()[1]) * 0.5;
    let near = far.map(|eye| Camera { eye: centre - eye.forward() * 30.0, fov, ..eye });
    let size = [640, 512];
    let settings = Settings { size, ..settings() };
    let mut frames = Frames::new(&gpu, &scene, &settings, &all_levels()[..1]).expect("frames");
    frames.warm_up(&scene, &far).expect("a first frame");
    let picture = |frames: &mut Frames| {
        let frame = frames.begin(&scene, 0).expect("a frame");
        let ticket = frames.submit(frame, &scene, &near).expect("submitted");
        gpu.wait(ticket).expect("rendered");
        frames.finished().expect("news");
        frames.target.read_colour(0).expect("a picture")
    };
    picture(&mut frames);
    let second = picture(&mut frames);
    let mut renderer = Renderer::new(&gpu, mode("slab").expect("a mode"), &scene, &settings).expect("alone");
    renderer.render(&scene, &near).expect("a picture");
    assert!(second == renderer.target.read_colour(0).expect("a picture"), "the second frame is whole");
}

/// Four bodies with a label each: a rod, a plate, a ball and a dot, apart from each other; mm.
fn bodies(form: Form) -> SplatSet {
    let (mut splats, mut labels) = (Vec::new(), Vec::new());
    let mut add = |label, mean: [f32; 3]| {
        let log_scale = [1.2f32.ln(); 3];
        splats.push(Splat {
            mean,
            opacity_logit: 3.0,
            rotation: [1.0, 0.0, 0.0, 0.0],
            log_scale,
            intensity: 600.0,
        });
        labels.push(label);
    };
    for i in 0..26 {
        let at = i as f32 * 1.5;
        add(1, [at - 18.0, 0.0, -14.0]);
        add(2, [at % 12.0 - 4.0, 3.0, (at / 12.0).floor() * 2.0 + 6.0]);
    }
    for i in 0..8 {
        let side = |bit: usize| if i >> bit & 1 == 1 { 1.2 } else { -1.2 };
        add(3, [side(0) - 12.0, side(1), side(2) + 8.0]);
    }
    for i in 0..3 {
        add(4, [14.0 + i as f32, 0.0, -2.0]);
    }
    let affine = DAffine3::from_translation(DVec3::splat(-32.0));
    SplatSet {
        splats,
        labels: Some(labels),
        unit: Unit::Hu,
        form,
        grid: Some(Grid { size: [64; 3], world_from_voxel: affine }),
        ..SplatSet::default()
    }
}

/// Whatever is given up, what is seen of each object in full is seen on every level for every kind of splats,
/// by its area.
#[test]
fn nothing_vanishes_on_the_way_down() {
    const TINTS: [[f32; 3]; 4] = [[1.0, 0.1, 0.1], [0.1, 1.0, 0.1], [0.1, 0.1, 1.0], [1.0, 1.0, 0.1]];
    let gpu = Device::boot();
    let settings = Settings::new([200, 160]);
    for kind in SplatKind::ALL {
        // Mode alpha shows these as it shows coloured ones, and they can be told apart.
        let form = if kind == SplatKind::Grid { Form::Grid } else { Form::Field };
        let tinted = |(i, &tint): (usize, &[f32; 3])| {
            (i as u8 + 1, Appearance { tint: Some(tint), ..Appearance::default() })
        };
        let transfer = preset("CT-Bone").expect("a preset").over([-100.0, 900.0]);
        let look = Look { objects: TINTS.iter().enumerate().map(tinted).collect(), ..Look::new(transfer) };
        let scene = Scene::new(&gpu, Some(&bodies(form)), None, &look).expect("a scene");
        let camera = Camera::from_side("anterior", DVec3::ZERO, 24.0, 30.0, 1.25).expect("a camera");
        let mut frames = Frames::new(&gpu, &scene, &settings, quality_levels(kind)).expect("frames");
        frames.warm_up(&scene, &[camera]).expect("all levels");
        let mut areas = |number: usize| {
            let frame = frames.begin(&scene, number).expect("a frame");
            let [width, height] = frame.size;
            let ticket = frames.submit(frame, &scene, &[camera]).expect("submitted");
            gpu.wait(ticket).expect("rendered");
            frames.finished().expect("news");
            let picture = frames.target.read_colour(0).expect("a picture");
            let mut areas = [0.0; 4];
            for i in 0..width * height {
                let pixel = picture[(i / width * settings.size[0] + i % width) as usize];
                let likeness = |tint: &[f32; 3]| {
                    let dot: f32 = (0..3).map(|c| tint[c] * pixel[c]).sum();
                    dot / Vec3::from_array(*tint).length()
                };
                let at = (0..4).max_by(|a, b| likeness(&TINTS[*a]).total_cmp(&likeness(&TINTS[*b])));
                if pixel[3] > 0.3 {
                    areas[at.expect("four tints")] += 1.0 / f64::from(width * height);
                }
            }
            areas
        };
        let full = areas(0);
        assert!(full.iter().all(|&area| area > 5e-4), "{kind:?}: all are seen in full: {full:?}");
        for level in 1..quality_levels(kind).len() {
            let found = areas(level);
            for (label, (&found, &full)) in (1..).zip(found.iter().zip(&full)) {
                assert!(
                    (0.6..1.7).contains(&(found / full)),
                    "{kind:?}, level {level}: object {label} takes {found:.5} of the picture, \
                     {full:.5} in full"
                );
            }
        }
    }
}
