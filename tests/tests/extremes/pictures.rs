//! Pictures: any camera, thin splats on one another, a million in one tile, steps of the transfer function.

use engine::render::{Camera, Fov, Look, Renderer, Scene, Settings, VolumeSource, mode};
use engine::splat::{Field, Harmonics, Kernel, Splat, SplatSet};
use engine::transfer::{ColourPoint, OpacityPoint, TransferFunction};
use engine::unit::Unit;
use engine::volume::Volume;
use glam::{DAffine3, DVec3};
use rand::RngExt;
use vgs_tests::Device;
use vgs_tests::numerics::keep;
use vgs_tests::rendering::{camera, look, of_splats, render, set, settings};
use vgs_tests::sampling::{IDENTITY, one};
use vgs_tests::scene::random;

/// The largest difference of a channel between two pictures.
fn apart(a: &[[f32; 4]], b: &[[f32; 4]]) -> f64 {
    assert_eq!(a.len(), b.len());
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    // Not f32::max, which would lose a NaN.
    pairs.fold(0.0, |worst, (a, b)| if (a - b).abs() <= worst { worst } else { (a - b).abs() }).into()
}

#[test]
fn n22_any_camera() {
    let gpu = Device::boot();
    let set = set(60, Kernel::Compact);
    let small = || Settings { size: [40, 31], ..settings() };
    let (mut wrong, mut differ) = (0, 0);
    for shade in [false, true] {
        let scene = Scene::new(&gpu, Some(&set), None, &look("CT-Bone", shade)).expect("a scene");
        let [low, high] = scene.bounds();
        let centre = (low + high) * 0.5;
        let first = set.origin_mm + DVec3::from_array(set.splats[0].mean.map(f64::from));
        let at = |eye: DVec3, target: DVec3, fov: Fov| {
            Camera::looking(eye, target, DVec3::Z, fov).expect("a camera")
        };
        let usual = Fov::symmetric(40.0, 1.3);
        let lopsided = Fov { left: -1.4, right: 0.7, up: 0.9, down: -1.2 };
        let cameras = [
            ("0.1 mm from a splat", at(first + DVec3::Y * 0.1, first, usual)),
            ("in a splat", at(first, centre + DVec3::X, usual)),
            ("all behind", at(centre + DVec3::Y * 100.0, centre + DVec3::Y * 200.0, usual)),
            ("1 degree", at(centre + DVec3::Y * 4000.0, centre, Fov::symmetric(1.0, 1.3))),
            ("150 degrees", at(centre + DVec3::Y * 10.0, centre, Fov::symmetric(150.0, 1.3))),
            ("asymmetric", at(centre + DVec3::Y * 90.0, centre, lopsided)),
        ];
        for row in of_splats() {
            for (name, camera) in &cameras {
                let mut renderer = Renderer::new(&gpu, row, &scene, &Settings { depth: true, ..small() })
                    .expect("a renderer");
                renderer.render(&scene, &[*camera]).expect("a frame");
                let pixels = renderer.target.read_colour(0).expect("a picture");
                let depth = renderer.target.read_depth(0).expect("depth");
                let number = |v: &&f32| v.is_finite() && (-1e-3..=1.01).contains(*v);
                wrong += pixels.iter().flatten().filter(|v| !number(v)).count();
                wrong += depth.iter().filter(|d| d.is_nan()).count();
                let seen = pixels.iter().filter(|p| p[3] > 0.01).count();
                assert_eq!(seen == 0, *name == "all behind", "{}: {name}: {seen} pixels", row.name);
            }
            // Culled alike: an eye sees the same alone and beside the other. Mode alpha sorts once for both.
            if row.name == "alpha" {
                continue;
            }
            let eyes = at(centre + DVec3::Y * 60.0, centre, lopsided).eyes(64.0);
            let both = render(&gpu, row, &scene, &Settings { views: 2, ..small() }, &eyes);
            for (eye, both) in eyes.iter().zip(&both) {
                let alone = &render(&gpu, row, &scene, &small(), &[*eye])[0];
                assert!(alone.pixels.iter().any(|p| p[3] > 0.5), "{}: something is seen", row.name);
                differ += alone.pixels.iter().zip(&both.pixels).filter(|(a, b)| a != b).count();
            }
        }
    }
    keep("N22a", wrong as f64);
    keep("N22b", differ as f64);
}

#[test]
fn n12_far_from_the_origin() {
    let gpu = Device::boot();
    let set = set(120, Kernel::Compact);
    let look = look("CT-Bone", false);
    let mut worst = 0.0f64;
    for row in of_splats() {
        let picture = |shift: DVec3| {
            let moved = SplatSet { origin_mm: set.origin_mm + shift, ..set.clone() };
            let scene = Scene::new(&gpu, Some(&moved), None, &look).expect("a scene");
            render(&gpu, row, &scene, &settings(), &[camera(&scene)]).remove(0)
        };
        let here = picture(DVec3::ZERO);
        for shift in [DVec3::new(1e5, -1e5, 1e5), DVec3::new(-1e7, 1e7, 0.0)] {
            let found = apart(&here.pixels, &picture(shift).pixels);
            println!("{}: {found:.1e}", row.name);
            worst = worst.max(found);
        }
    }
    keep("N12c", worst);
}

#[test]
fn n23_thin_splats_on_one_another() {
    let gpu = Device::boot();
    let alpha = 1.0 / 254.0f64;
    let camera = Camera::looking(DVec3::Y * -100.0, DVec3::ZERO, DVec3::Z, Fov::symmetric(1.0, 1.0))
        .expect("a camera");
    // So wide that the opacity is that of the middle in every pixel.
    let wide = one([0.0; 3], [1e3f32.ln(); 3], (alpha / (1.0 - alpha)).ln() as f32, 0.0);
    let transmittance = |count: usize, precise: bool| {
        let set = SplatSet {
            splats: vec![wide; count],
            colours: Some(Harmonics { degree: 0, coefficients: vec![1.0; 3 * count] }),
            unit: Unit::Luminance,
            ..SplatSet::default()
        };
        let scene = Scene::new(&gpu, Some(&set), None, &look("CT-Bone", false)).expect("a scene");
        let settings = Settings { precise, ..Settings::new([4, 4]) };
        let picture = render(&gpu, mode("alpha").expect("a mode"), &scene, &settings, &[camera]).remove(0);
        picture.pixels.iter().map(|p| 1.0 - f64::from(p[3])).collect::<Vec<_>>()
    };
    for (id, counts, precise) in
        [("N23a", &[1, 16, 100, 255, 1000, 1_000_000][..], true), ("N23b", &[1, 16, 100][..], false)]
    {
        let mut worst = 0.0f64;
        for &count in counts {
            let wanted = (count as f64 * (-alpha).ln_1p()).exp();
            let off = transmittance(count, precise).iter().fold(0.0f64, |off, t| off.max((t - wanted).abs()));
            println!("{count} splats, precise {precise}: T = {wanted:.4}, off by {off:.1e}");
            worst = worst.max(off);
        }
        keep(id, worst);
    }
}

#[test]
fn n10_a_million_in_one_tile() {
    let gpu = Device::boot();
    let mut rng = random(1010);
    let splats: Vec<Splat> = (0..1_000_000)
        .map(|_| {
            let mean = [0; 3].map(|_| rng.random_range(-2.0f32..2.0));
            one(mean, [-0.5; 3], rng.random_range(-4.0..4.0), rng.random_range(0.0..900.0))
        })
        .collect();
    let camera =
        Camera::looking(DVec3::Y * -60.0, DVec3::ZERO, DVec3::Z, Fov::symmetric(5.0, 1.0)).expect("a camera");
    let picture = |splats: Vec<Splat>| {
        let set = SplatSet {
            splats,
            field: Field { background: 400.0, ..Field::default() },
            ..SplatSet::default()
        };
        let scene = Scene::new(&gpu, Some(&set), None, &look("CT-Soft-Tissue", false)).expect("a scene");
        let settings = Settings { precise: true, ..Settings::new([16, 16]) };
        render(&gpu, mode("slab").expect("a mode"), &scene, &settings, &[camera]).remove(0)
    };
    let first = picture(splats.clone());
    assert!(first.pixels.iter().filter(|p| p[3] > 0.1).count() > 50, "something is seen");
    keep("N10d", apart(&first.pixels, &picture(splats.into_iter().rev().collect()).pixels));
}

#[test]
fn n24_a_step_of_one_hu() {
    let gpu = Device::boot();
    // Opaque above `at`, clear below, over one HU.
    let step = |at: f64| {
        let colour = vec![ColourPoint { intensity: 0.0, colour: DVec3::ONE }];
        let points = [(at - 0.5, 0.0), (at + 0.5, 1.0), (at + 500.0, 1.0)];
        let opacity = points.map(|(intensity, opacity)| OpacityPoint { intensity, opacity }).to_vec();
        Look::new(TransferFunction::new("step", colour, opacity, Default::default()).expect("a function"))
    };
    let wide = Splat { rotation: IDENTITY, ..one([0.0; 3], [4.0; 3], 12.0, 200.0) };
    let splats = SplatSet {
        splats: vec![wide],
        field: Field { background: 200.0, ..Field::default() },
        ..SplatSet::default()
    };
    let volume =
        Volume::new([24; 3], DAffine3::from_translation(DVec3::splat(-11.5)), vec![200.0; 24 * 24 * 24]);
    let camera = Camera::looking(DVec3::Y * -200.0, DVec3::ZERO, DVec3::Z, Fov::symmetric(1.0, 1.0))
        .expect("a camera");
    let source = VolumeSource { volume: &volume, roi: None };
    let mut slab = Scene::new(&gpu, Some(&splats), None, &step(200.0)).expect("splats");
    let mut march = Scene::new(&gpu, None, Some(&source), &step(200.0)).expect("a volume");
    let settings = Settings { precise: true, ..Settings::new([2, 2]) };
    let (mut off, mut differ) = (0.0f64, 0);
    for quarter in -14..=14 {
        // The step lies so far above the intensity.
        let above = f64::from(quarter) * 0.25;
        let mut shown = |scene: &mut Scene, name: &str| {
            scene.set_look(&step(200.0 + above)).expect("a look");
            let picture = render(&gpu, mode(name).expect("a mode"), scene, &settings, &[camera]).remove(0);
            let seen = picture.pixels.iter().all(|p| p[3] > 0.5);
            assert!(seen || picture.pixels.iter().all(|p| p[3] <= 0.5), "all pixels alike");
            // Opaque half a HU above the middle, clear half a HU below; between, either is right.
            if seen != (above < 0.0) {
                off = off.max(above.abs() - 0.5);
            }
            seen
        };
        let (a, b) = (shown(&mut slab, "slab"), shown(&mut march, "volume"));
        if above.abs() > 0.5 {
            differ += usize::from(a != b);
        }
    }
    keep("N24a", off);
    keep("N24b", differ as f64);
}
