//! What holds of rendering without any reference, and the golden pictures.

use engine::image::psnr;
use engine::render::{Appearance, Camera, ClipPlane, Fov, Look, Renderer, Scene, Settings, mode};
use engine::splat::{Field, Kernel, Splat, SplatSet};
use engine::transfer::TransferFunction;
use glam::DVec3;
use vgs_tests::rendering::{camera, empty, look, of_splats, reference_picture, render, set, settings};
use vgs_tests::{Bound, Device, assert_close, picture};

#[test]
fn pictures_are_those_of_the_reference() {
    let gpu = Device::boot();
    let tint = |tint, opacity| Appearance { tint: Some(tint), opacity, ..Appearance::default() };
    let objects = [(1, tint([0.1, 0.4, 1.0], 0.3)), (2, tint([1.0, 0.3, 0.1], 1.0))];
    for (name, kernel, look) in [
        ("slab-soft", Kernel::Compact, look("CT-Soft-Tissue", false)),
        ("slab-bone-lit", Kernel::Gaussian, look("CT-Bone", true)),
        ("slab-objects", Kernel::Compact, Look { objects: objects.into(), ..look("CT-Soft-Tissue", true) }),
    ] {
        let mut set = set(150, kernel);
        // Two objects that overlap in a wide strip.
        set.labels = Some(set.splats.iter().map(|s| if s.mean[2] > 0.0 { 1 } else { 2 }).collect());
        let scene = Scene::new(&gpu, Some(&set), None, &look).expect("a scene");
        let camera = camera(&scene);
        let settings = Settings {
            step: 0.5,
            dark: 1e-4,
            classification: Some(engine::render::Classification::Point),
            ..settings()
        };
        let found = render(&gpu, mode("slab").expect("a mode"), &scene, &settings, &[camera]);
        picture::check(name, &found[0], || reference_picture(&set, &scene, &camera, &look, 0.5));
    }
}

#[test]
fn what_a_look_cannot_show_is_dropped_and_nothing_else() {
    let gpu = Device::boot();
    // Small ones, the soft apart from the dense.
    let mut set = set(150, Kernel::Compact);
    for s in &mut set.splats {
        s.log_scale = s.log_scale.map(|v| v - 1.2);
        s.mean[0] += 12.0f32.copysign(s.mean[0]);
    }
    let look = look("CT-Bone", false);
    let scene = Scene::new(&gpu, Some(&set), None, &look).expect("a scene");
    let active = scene.splats.as_ref().expect("splats").active_count().expect("a count");
    assert!((20..140).contains(&active), "{active} of 150");
    let camera = camera(&scene);
    let settings = Settings {
        step: 0.5,
        dark: 1e-4,
        classification: Some(engine::render::Classification::Point),
        ..settings()
    };
    let found = render(&gpu, mode("slab").expect("a mode"), &scene, &settings, &[camera]);
    // The reference implementation has all splats.
    let wanted = reference_picture(&set, &scene, &camera, &look, 0.5);
    let pairs = found[0]
        .pixels
        .iter()
        .zip(&wanted.pixels)
        .flat_map(|(g, w)| (0..4).map(|c| (f64::from(g[c]), f64::from(w[c]))));
    assert_close("active splats", Bound::new(3e-3, 0.0).outliers(0.01, 0.1), pairs);
}

#[test]
fn views_do_not_depend_on_each_other() {
    let gpu = Device::boot();
    let set = set(120, Kernel::Gaussian);
    let scene = Scene::new(&gpu, Some(&set), None, &look("CT-Soft-Tissue", false)).expect("a scene");
    let [left, right] = camera(&scene).eyes(20.0);
    let two = Settings { views: 2, ..settings() };
    for row in of_splats().filter(|row| row.name != "alpha") {
        let both = render(&gpu, row, &scene, &two, &[left, right]);
        let swapped = render(&gpu, row, &scene, &two, &[right, left]);
        assert_eq!(both[0], swapped[1], "{}: eyes swapped, pictures swapped", row.name);
        assert_eq!(both[1], swapped[0], "{}", row.name);
        let alone = render(&gpu, row, &scene, &settings(), &[left]);
        assert_eq!(both[0], alone[0], "{}: an eye alone sees the same", row.name);
        assert_ne!(both[0], both[1], "{}: the eyes are apart", row.name);
    }
}

#[test]
fn the_order_of_splats_and_the_place_in_the_world_change_only_rounding() {
    let gpu = Device::boot();
    let set = set(120, Kernel::Compact);
    let look = look("CT-Bone", false);
    let mut turned_round = set.clone();
    turned_round.splats.reverse();
    let mut elsewhere = set.clone();
    elsewhere.origin_mm += DVec3::new(1e5, -1e5, 1e5);
    for row in of_splats() {
        let picture = |set: &SplatSet| {
            let scene = Scene::new(&gpu, Some(set), None, &look).expect("a scene");
            let camera = camera(&scene);
            render(&gpu, row, &scene, &settings(), &[camera]).remove(0)
        };
        let first = picture(&set);
        assert_eq!(first, picture(&set), "{}: the same bits", row.name);
        let least = if row.name == "alpha" { 50.0 } else { 80.0 };
        for (what, other) in [("order", picture(&turned_round)), ("place", picture(&elsewhere))] {
            let db = psnr(&first, &other).expect("pictures of one size");
            println!("{}: {what}: {db:.1} dB", row.name);
            assert!(db > least, "{}: {what}: {db}", row.name);
        }
    }
}

#[test]
fn clip_planes_cut_and_no_splats_show_nothing() {
    let gpu = Device::boot();
    let set = set(120, Kernel::Compact);
    let all = look("CT-Soft-Tissue", false);
    let mut scene = Scene::new(&gpu, Some(&set), None, &all).expect("a scene");
    let camera = camera(&scene);
    let [low, high] = scene.bounds();
    let centre = (low + high) * 0.5;
    for row in of_splats() {
        let mut renderer =
            Renderer::new(&gpu, row, &scene, &Settings { depth: true, ..settings() }).expect("a renderer");
        let mut opacity = |scene: &Scene| {
            renderer.render(scene, &[camera]).expect("a frame");
            let depth = renderer.target.read_depth(0).expect("depth");
            let sum: f32 = renderer.target.read_colour(0).expect("a picture").iter().map(|p| p[3]).sum();
            (sum, depth.iter().copied().fold(f32::INFINITY, f32::min))
        };
        scene.set_look(&all).expect("a look");
        let (whole, nearest) = opacity(&scene);
        // The half towards the viewer is cut away: less is seen, and from further back.
        let towards = -camera.forward();
        let plane = ClipPlane { normal: -towards, offset: -towards.dot(centre) };
        scene.set_look(&Look { clip: vec![plane], ..all.clone() }).expect("a look");
        let (half, behind) = opacity(&scene);
        assert!(half < 0.9 * whole && half > 0.05 * whole, "{}: {half} of {whole}", row.name);
        assert!(behind > nearest + 3.0, "{}: {behind} after {nearest} mm", row.name);
        // A box beside everything leaves nothing.
        let clip = ClipPlane::around(high + 10.0, high + 20.0).to_vec();
        scene.set_look(&Look { clip, ..all.clone() }).expect("a look");
        assert_eq!(opacity(&scene).0, 0.0, "{}", row.name);
        scene.set_look(&all).expect("a look");
        assert_eq!(opacity(&scene).0, whole, "{}: as before", row.name);
    }
    let nothing = Scene::new(&gpu, Some(&empty()), None, &all).expect("a scene of no splats");
    for row in of_splats() {
        let picture = render(&gpu, row, &nothing, &settings(), &[camera]);
        assert!(picture[0].pixels.iter().all(|p| *p == [0.0; 4]), "{}", row.name);
    }
}

#[test]
fn one_wide_splat_absorbs_by_its_thickness() {
    // A splat so wide that V and O are the same all along the rays, cut to a slice of 20 mm by two planes.
    let gpu = Device::boot();
    let wide = Splat {
        rotation: [1.0, 0.0, 0.0, 0.0],
        log_scale: [5.0; 3],
        opacity_logit: 12.0,
        intensity: 500.0,
        ..Splat::default()
    };
    let set =
        SplatSet { splats: vec![wide], field: Field { background: 500.0, ..Field::default() }, ..empty() };
    let opacity_per_mm = 0.04;
    let transfer = TransferFunction::new(
        "flat",
        vec![engine::transfer::ColourPoint { intensity: 0.0, colour: DVec3::new(1.0, 0.5, 0.25) }],
        vec![engine::transfer::OpacityPoint { intensity: 0.0, opacity: opacity_per_mm }],
        Default::default(),
    )
    .expect("a transfer function");
    let clip = ClipPlane::around(DVec3::new(-500.0, -10.0, -500.0), DVec3::new(500.0, 10.0, 500.0)).to_vec();
    let look = Look { clip, ..Look::new(transfer) };
    let scene = Scene::new(&gpu, Some(&set), None, &look).expect("a scene");
    let camera =
        Camera::looking(DVec3::Y * 900.0, DVec3::ZERO, DVec3::Z, Fov::symmetric(1.0, 1.3)).expect("a camera");
    // sigma is 148 mm: fine planes are asked for.
    let settings = Settings { step: 0.02, ..settings() };
    let found = render(&gpu, mode("slab").expect("a mode"), &scene, &settings, &[camera]);
    // Over these 20 mm the weight falls from 1 to 0.997, so O is 1/1.05.
    let occupancy = 1.0 / 1.05;
    let expected = 1.0 - (occupancy * 20.0 * (1.0f64 - opacity_per_mm).ln()).exp();
    for pixel in &found[0].pixels {
        assert!((f64::from(pixel[3]) - expected).abs() < 0.05, "{pixel:?} for {expected}");
        assert!((pixel[1] / pixel[0] - 0.5).abs() < 1e-3 && (pixel[2] / pixel[0] - 0.25).abs() < 1e-3);
    }
}
