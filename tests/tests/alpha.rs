//! Mode alpha as a whole: what holds without a reference, and how near it comes to mode exact.

use engine::gpu::Gpu;
use engine::render::{Camera, Fov, Look, Renderer, Scene, Settings, baked, mode};
use engine::splat::{Harmonics, Splat, SplatSet};
use engine::transfer::preset;
use engine::unit::Unit;
use glam::{DVec3, Vec3};
use rand::RngExt;
use vgs_tests::Device;
use vgs_tests::fitting::Case;
use vgs_tests::scene::{random, splat};

type Picture = Vec<[f32; 4]>;

fn look(name: &str) -> Look {
    Look::new(preset(name).expect("a preset").over([-1024.0, 3071.0]))
}

/// Opaque and translucent splats in a box of 40 mm about the origin.
fn some(count: usize) -> SplatSet {
    let mut rng = random(12);
    let mut one = |_| {
        let mut s = splat(&mut rng, Vec3::splat(36.0));
        s.mean = s.mean.map(|v| v - 20.0);
        s.intensity = rng.random_range(0.0f32..1500.0);
        s
    };
    SplatSet { splats: (0..count).map(&mut one).collect(), ..SplatSet::default() }
}

/// Pictures of all cameras at once.
fn render(
    gpu: &Gpu,
    name: &str,
    set: &SplatSet,
    look: &Look,
    settings: &Settings,
    cameras: &[Camera],
) -> Vec<Picture> {
    let scene = Scene::new(gpu, Some(set), None, look).expect("a scene");
    let settings = Settings { views: cameras.len() as u32, precise: true, ..settings.clone() };
    let mut renderer =
        Renderer::new(gpu, mode(name).expect("a mode"), &scene, &settings).expect("a renderer");
    renderer.render(&scene, cameras).expect("a picture");
    (0..settings.views).map(|v| renderer.target.read_colour(v).expect("colours")).collect()
}

/// PSNR of the colours on black, dB.
fn psnr(a: &Picture, b: &Picture) -> f64 {
    let squares: f64 =
        a.iter().zip(b).flat_map(|(a, b)| (0..3).map(|k| f64::from(a[k] - b[k]).powi(2))).sum();
    -10.0 * (squares / (3 * a.len()) as f64).log10()
}

/// The phantom's bones, fitted.
fn bones(gpu: &Gpu) -> SplatSet {
    let case = Case::phantom([40, 40, 28], 40);
    let mut fitter = case.fit(gpu);
    let field = case.config.field(fitter.scaling().background);
    SplatSet::from_voxel(&fitter.splats().expect("splats"), &case.volume.world_from_voxel, field)
}

fn front(set: &SplatSet, gpu: &Gpu, look: &Look) -> Camera {
    let [low, high] = Scene::new(gpu, Some(set), None, look).expect("a scene").bounds();
    Camera::from_side("anterior-left", (low + high) * 0.5, (high - low).length() * 0.4, 35.0, 1.0)
        .expect("a camera")
}

#[test]
fn no_splats_give_a_clear_picture() {
    let gpu = Device::boot();
    let camera = Camera::from_side("A", DVec3::ZERO, 30.0, 30.0, 1.0).expect("a camera");
    let settings = Settings { depth: true, ..Settings::new([33, 17]) };
    let pictures = render(&gpu, "alpha", &some(0), &look("CT-Bone"), &settings, &[camera; 2]);
    assert!(pictures.iter().flatten().all(|pixel| *pixel == [0.0; 4]));
}

#[test]
fn equal_cameras_give_equal_layers_and_each_frame_the_same_bits() {
    let gpu = Device::boot();
    let set = some(300);
    let camera = Camera::from_side("left", DVec3::ZERO, 25.0, 30.0, 1.0).expect("a camera");
    let settings = Settings::new([64, 64]);
    let look = look("CT-Soft-Tissue");
    let pair = render(&gpu, "alpha", &set, &look, &settings, &[camera; 2]);
    let one = render(&gpu, "alpha", &set, &look, &settings, &[camera]);
    assert!(pair[0] == pair[1] && pair[0] == one[0]);
    assert!(one[0].iter().filter(|p| p[3] > 0.2).count() > 500, "there is something to see");
}

#[test]
fn the_order_of_the_splats_does_not_matter() {
    let gpu = Device::boot();
    let set = some(300);
    let mut reversed = set.clone();
    reversed.splats.reverse();
    let camera = Camera::from_side("superior", DVec3::ZERO, 25.0, 30.0, 1.0).expect("a camera");
    let settings = Settings::new([64, 64]);
    let pictures =
        [&set, &reversed].map(|s| render(&gpu, "alpha", s, &look("CT-Bone"), &settings, &[camera]).remove(0));
    let worst = (pictures[0].iter().zip(&pictures[1]))
        .flat_map(|(a, b)| (0..4).map(|k| (a[k] - b[k]).abs()))
        .fold(0.0, f32::max);
    assert!(worst < 4e-3, "{worst}: beyond rounding and the edges of ellipses");
}

#[test]
fn nothing_is_out_of_range_wherever_the_eyes_are() {
    let gpu = Device::boot();
    let mut set = some(300);
    set.splats[0].mean = [0.0; 3];
    set.splats[0].log_scale = [3.0, -3.0, 0.0];
    let standard = SplatSet {
        colours: Some(Harmonics { degree: 0, coefficients: vec![1.0; 900] }),
        unit: Unit::Luminance,
        ..set.clone()
    };
    let narrow = Fov::symmetric(1.0, 1.0);
    let wide = Fov::symmetric(150.0, 1.0);
    let lopsided = Fov { left: -1.6, right: 0.4, up: 0.3, down: -2.0 };
    let mut seen = 0;
    for fov in [narrow, wide, lopsided] {
        // Inside a splat, among them, far off, looking away, and with a centre in the plane of the eye.
        for (eye, target) in [
            (DVec3::ZERO, DVec3::Y),
            (DVec3::new(0.0, 1e-3, 0.0), DVec3::Y),
            (DVec3::new(0.0, -2.0, 0.0), DVec3::ZERO),
            (DVec3::new(0.0, -20.0, 5.0), DVec3::new(0.0, 20.0, 0.0)),
            (DVec3::new(0.0, -5000.0, 0.0), DVec3::ZERO),
            (DVec3::new(0.0, -100.0, 0.0), DVec3::new(0.0, -200.0, 0.0)),
            (DVec3::new(-30.0, 0.0, 0.0), DVec3::new(-30.0, 9.0, 0.0)),
        ] {
            let camera = Camera::looking(eye, target, DVec3::Z, fov).expect("a camera");
            let cameras = camera.eyes(6.0);
            let settings = Settings { depth: true, ..Settings::new([40, 40]) };
            for set in [&set, &standard] {
                for picture in render(&gpu, "alpha", set, &look("CT-Bone"), &settings, &cameras) {
                    for pixel in &picture {
                        assert!(
                            pixel.iter().all(|v| (0.0..=1.0).contains(v)),
                            "{eye} {target} {fov:?}: {pixel:?}"
                        );
                    }
                    seen += usize::from(picture.iter().any(|p| p[3] > 0.5));
                }
            }
        }
    }
    assert!(seen > 30, "{seen} pictures of 84 show something");
}

#[test]
fn standard_splats_have_their_own_colours() {
    let gpu = Device::boot();
    // Red from the front, green from behind: -Y₁₁ and its like are odd in the direction.
    let mut one = Splat { rotation: [1.0, 0.0, 0.0, 0.0], log_scale: [1.0; 3], ..Splat::default() };
    one.opacity_logit = 2.0;
    let c1 = 0.488_602_5;
    let coefficients = vec![0.0, 0.0, -1.772_453_9, 0.5 / c1, -0.5 / c1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let set = SplatSet {
        splats: vec![one],
        colours: Some(Harmonics { degree: 1, coefficients }),
        unit: Unit::Luminance,
        ..SplatSet::default()
    };
    let settings = Settings { depth: true, ..Settings::new([65, 65]) };
    let opacity = 1.0 / (1.0 + (-2.0f32).exp());
    for (side, wanted) in [("anterior", [1.0, 0.0]), ("posterior", [0.0, 1.0])] {
        let camera = Camera::from_side(side, DVec3::ZERO, 10.0, 30.0, 1.0).expect("a camera");
        // Whatever the transfer function.
        for name in ["CT-Bone", "CT-Skin"] {
            let picture = render(&gpu, "alpha", &set, &look(name), &settings, &[camera]).remove(0);
            let [r, g, b, a] = picture[65 * 32 + 32];
            assert!((a - opacity).abs() < 2e-3, "{side}: {a} for {opacity}");
            assert!(
                (r - a * wanted[0]).abs() < 2e-3 && (g - a * wanted[1]).abs() < 2e-3 && b.abs() < 2e-3,
                "{r} {g} {b}"
            );
        }
        let scene = Scene::new(&gpu, Some(&set), None, &look("CT-Bone")).expect("a scene");
        let mut renderer =
            Renderer::new(&gpu, mode("alpha").unwrap(), &scene, &settings).expect("a renderer");
        renderer.render(&scene, &[camera]).expect("a picture");
        let depth = renderer.target.read_depth(0).expect("depth");
        assert!(
            (f64::from(depth[65 * 32 + 32]) - camera.eye.length()).abs() < 0.1,
            "{}",
            depth[65 * 32 + 32]
        );
        assert_eq!(depth[0], f32::INFINITY, "nothing is in the corner");
    }
}

#[test]
fn what_is_cut_away_or_hidden_by_the_transfer_function_is_not_drawn() {
    let gpu = Device::boot();
    let set = some(200);
    let camera = Camera::from_side("anterior", DVec3::ZERO, 25.0, 30.0, 1.0).expect("a camera");
    let settings = Settings::new([32, 32]);
    let mut cut = look("CT-Bone");
    cut.clip = vec![engine::render::ClipPlane { normal: DVec3::X, offset: 500.0 }];
    let picture = render(&gpu, "alpha", &set, &cut, &settings, &[camera]).remove(0);
    assert!(picture.iter().all(|p| *p == [0.0; 4]), "all of it lies before 500 mm");
    cut.clip[0].offset = -500.0;
    let whole = render(&gpu, "alpha", &set, &cut, &settings, &[camera]).remove(0);
    assert!(whole == render(&gpu, "alpha", &set, &look("CT-Bone"), &settings, &[camera]).remove(0));
}

#[test]
fn one_order_for_both_eyes_and_the_likeness_to_exact() {
    let gpu = Device::boot();
    let set = bones(&gpu);
    for (name, nearness) in [("CT-Bones-Steep", 18.0), ("CT-Soft-Tissue", 21.0)] {
        let look = look(name);
        let camera = front(&set, &gpu, &look);
        let eyes = camera.eyes(64.0 * (camera.eye - set.origin_mm).length() / 500.0);
        let settings = Settings::new([160, 160]);
        let shared = render(&gpu, "alpha", &set, &look, &settings, &eyes);
        for (eye, picture) in eyes.iter().zip(&shared) {
            let own = render(&gpu, "alpha", &set, &look, &settings, &[*eye]).remove(0);
            let db = psnr(picture, &own);
            println!("{name}: one order for both eyes against an order for each: {db:.1} dB");
            assert!(db >= 60.0, "{name}: {db} dB");
        }
        let exact = render(&gpu, "exact", &set, &look, &settings, &[eyes[0]]).remove(0);
        let db = psnr(&shared[0], &exact);
        println!("{name}: alpha against exact {db:.2} dB");
        assert!(db >= nearness, "{name}: {db} dB");
    }
}

/// What programs draw that know only colours and Gaussians is near to what this mode draws.
#[test]
fn baked_splats_look_alike_without_the_transfer_function() {
    let gpu = Device::boot();
    let set = bones(&gpu);
    let mut labelled = set.clone();
    labelled.labels = Some((0..set.splats.len()).map(|i| (i % 3) as u8).collect());
    let settings = Settings::new([96, 96]);
    for (name, least_db) in [("CT-Bone", 25.0), ("CT-Soft-Tissue", 25.0), ("CT-X-Ray", 34.0)] {
        let look = look(name);
        let made = baked(&gpu, &labelled, &look).expect("colours");
        assert_eq!(made.set.splats.len() + made.hidden, set.splats.len());
        let colours = made.set.colours.as_ref().expect("colours");
        assert_eq!(colours.degree, if look.transfer.material.shade { 2 } else { 0 }, "{name}");
        assert_eq!(made.set.labels.as_ref().map(Vec::len), Some(made.set.splats.len()));
        let [low, high] = Scene::new(&gpu, Some(&set), None, &look).expect("a scene").bounds();
        let (centre, radius) = ((low + high) * 0.5, (high - low).length() * 0.4);
        for side in ["anterior-left", "posterior", "right"] {
            let camera = Camera::from_side(side, centre, radius, 35.0, 1.0).expect("a camera");
            let [ours, theirs] = [&set, &made.set]
                .map(|set| render(&gpu, "alpha", set, &look, &settings, &[camera]).remove(0));
            let db = psnr(&ours, &theirs);
            println!("{name} from {side}: {db:.1} dB, {} hidden", made.hidden);
            assert!(db > least_db, "{name} from {side}: {db:.1} dB");
        }
        let again = baked(&gpu, &made.set, &look);
        assert_eq!(again.err().map(|error| error.code), Some("VGS-RENDER-028"));
    }
}

#[test]
fn baking_leaves_out_what_the_transfer_function_hides() {
    let gpu = Device::boot();
    let mut set = SplatSet::default();
    for (x, intensity) in [(-30.0, 1200.0), (0.0, -500.0), (30.0, 1200.0)] {
        set.splats.push(Splat {
            mean: [x, 0.0, 0.0],
            log_scale: [1.0, 0.8, 1.2],
            rotation: [1.0, 0.0, 0.0, 0.0],
            opacity_logit: 3.0,
            intensity,
        });
    }
    let made = baked(&gpu, &set, &look("CT-Bone")).expect("colours");
    assert_eq!((made.hidden, made.set.splats.len()), (1, 2));
    assert_eq!(made.set.splats.iter().map(|s| s.mean[0]).collect::<Vec<_>>(), [-30.0, 30.0]);
}
