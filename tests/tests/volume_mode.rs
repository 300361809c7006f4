//! What holds of the mode `volume` without any reference.

use engine::error::Kind;
use engine::gpu::{Gpu, GpuOptions};
use engine::image::Image;
use engine::render::{
    Camera, Classification, ClipPlane, Fov, Look, Quality, Renderer, Scene, Settings, VolumeSource, mode,
};
use engine::transfer::{ColourPoint, Material, OpacityPoint, Table, TransferFunction, preset};
use engine::volume::{Roi, Volume};
use glam::{DAffine3, DMat3, DVec3};
use reference::eye::Eye;
use reference::raymarch;
use reference::slab::Look as ReferenceLook;
use vgs_tests::{Device, picture, rendering};

const SIZE: [u32; 2] = [72, 56];

/// A ball of bone with a soft shell, in voxels of 1 × 1 × 2 mm, far from the world's origin.
fn volume() -> Volume {
    let size = [40, 36, 20];
    let samples = places(size)
        .map(|[x, y, z]| {
            let at = DVec3::new(x as f64 - 19.0, y as f64 - 18.0, 2.0 * (z as f64 - 9.5));
            let away = at.length() + 1.5 * (0.7 * at.x).sin();
            let v = if away < 9.0 { 700.0 } else { 60.0 };
            (v - 1060.0 * ((away - 15.0) / 3.0).clamp(0.0, 1.0)).round() as f32
        })
        .collect();
    let affine = DAffine3::from_mat3_translation(
        DMat3::from_diagonal(DVec3::new(1.0, 1.0, 2.0)),
        DVec3::new(-300.0, 120.0, 800.0),
    );
    Volume::new(size, affine, samples)
}

fn places(size: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..size.iter().product()).map(move |i| [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])])
}

fn constant(size: [usize; 3], value: f32) -> Volume {
    Volume::new(size, DAffine3::from_scale(DVec3::new(0.8, 1.1, 1.7)), vec![value; size.iter().product()])
}

/// Half of a volume along x, with a soft edge.
fn half(volume: &Volume) -> Roi {
    let middle = volume.size[0] as f32 * 0.5;
    let weight = places(volume.size).map(|[x, _, _]| (middle - x as f32).clamp(0.0, 2.0) / 2.0).collect();
    Roi::new(weight, volume).expect("a region")
}

fn look(name: &str, shade: bool) -> Look {
    let mut transfer = preset(name).expect("a preset").over([-1000.0, 1000.0]);
    transfer.material.shade = shade;
    Look::new(transfer)
}

/// The same extinction everywhere.
fn fog(extinction: f64) -> Look {
    let colours = vec![ColourPoint { intensity: 0.0, colour: DVec3::new(0.8, 0.4, 0.2) }];
    let opacities = vec![OpacityPoint { intensity: 0.0, opacity: 1.0 - (-extinction).exp() }];
    Look::new(TransferFunction::new("fog", colours, opacities, Material::default()).expect("a function"))
}

fn settings() -> Settings {
    Settings { precise: true, step: 0.5, cell: Some(1.0), ..Settings::new(SIZE) }
}

fn scene(gpu: &Gpu, volume: &Volume, roi: Option<&Roi>, look: &Look) -> Scene {
    Scene::new(gpu, None, Some(&VolumeSource { volume, roi }), look).expect("a scene")
}

fn render(gpu: &Gpu, scene: &Scene, settings: &Settings, cameras: &[Camera]) -> Vec<Image> {
    rendering::render(gpu, mode("volume").expect("the mode"), scene, settings, cameras)
}

fn camera(scene: &Scene) -> Camera {
    let [low, high] = scene.bounds();
    let aspect = f64::from(SIZE[0]) / f64::from(SIZE[1]);
    Camera::from_side("anterior-left", (low + high) * 0.5, (high - low).length() * 0.35, 40.0, aspect)
        .expect("a camera")
}

fn worst(a: &Image, b: &Image) -> f32 {
    a.pixels.iter().flatten().zip(b.pixels.iter().flatten()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// Peak signal-to-noise ratio, dB.
fn psnr(a: &Image, b: &Image) -> f64 {
    engine::image::psnr(a, b).expect("pictures of one size")
}

fn visible(image: &Image) -> usize {
    image.pixels.iter().filter(|p| p[3] > 0.05).count()
}

#[test]
fn pictures_are_those_of_the_reference() {
    let gpu = Device::boot();
    let volume = volume();
    let roi = half(&volume);
    for (name, roi, look) in [
        ("volume-soft", None, look("CT-Soft-Tissue", false)),
        ("volume-bone-lit", Some(&roi), look("CT-Bone", true)),
    ] {
        let scene = scene(&gpu, &volume, roi, &look);
        let camera = camera(&scene);
        let settings = Settings { dark: 1e-4, classification: Some(Classification::Point), ..settings() };
        let found = render(&gpu, &scene, &settings, &[camera]);
        picture::check(name, &found[0], || {
            let scene_from_voxel = DAffine3::from_translation(-scene.origin) * volume.world_from_voxel;
            let mask = roi.map(|roi| roi.weight.as_slice());
            let [visible, _] = look.transfer.visible().expect("something to see");
            let medium = raymarch::Medium::new(volume.size, scene_from_voxel, &volume.samples, mask)
                .with_own_gradients(visible);
            let reference_look = ReferenceLook {
                table: &Table::new(&look.transfer, [-1000.0, 700.0]),
                functions: &[],
                material: &look.transfer.material,
                light: &look.light,
                dark: visible,
                planes: &[],
                segments: false,
                gradient_edge: None,
                least_light: 1e-4,
            };
            let eye = Eye::from(&camera.view(scene.origin));
            let cells = raymarch::Cells { length: 1.0, parts: 2, slack: 1700.0 / 32.0 };
            Image {
                size: SIZE.map(|n| n as usize),
                pixels: raymarch::render(&medium, &eye, SIZE, &reference_look, &cells),
            }
        });
    }
}

/// Bone with a groove towards the front, three voxels wide, that a view from the front left looks into.
fn groove() -> Volume {
    let round = volume();
    let samples = places(round.size)
        .map(|[x, y, _]| if y < 24 && !(y > 10 && (18..21).contains(&x)) { 700.0 } else { -1000.0 })
        .collect();
    Volume::new(round.size, round.world_from_voxel, samples)
}

/// A ball of soft bone with a dense shell one voxel thick, as a vertebra is, in voxels of 3 mm.
fn shell() -> Volume {
    let size = [40; 3];
    let share = |v: f64| v.clamp(0.0, 1.0);
    let samples = places(size)
        .map(|at| {
            let away = DVec3::from_array(at.map(|v| v as f64)).distance(DVec3::new(19.5, 19.3, 19.7));
            (-100.0 + 1000.0 * share(13.0 - away) - 550.0 * share(11.6 - away)) as f32
        })
        .collect();
    Volume::new(size, DAffine3::from_scale(DVec3::splat(3.0)), samples)
}

/// At coarse steps, as in drafts, samples lie behind the crest of a thin shell here and there, where the field falls
/// inwards. Hardly any point of its outside is dark all the same: without that care 1 of 15 is at steps of a voxel.
#[test]
fn occlusion_leaves_hardly_a_dark_point_in_a_shell_at_long_steps() {
    let gpu = Device::boot();
    let shell = shell();
    for step in [0.25, 0.5, 1.0] {
        let [plain, occluded] = [0.0, 1.0].map(|occlusion| {
            let mut look = look("CT-Bone", true);
            look.transfer.material.occlusion = occlusion;
            let scene = scene(&gpu, &shell, None, &look);
            render(&gpu, &scene, &Settings { step, ..settings() }, &[camera(&scene)]).remove(0).pixels
        });
        let seen: Vec<_> = plain.iter().zip(&occluded).filter(|(plain, _)| plain[3] > 0.9).collect();
        let dark = seen.iter().filter(|(plain, occluded)| occluded[0] < 0.6 * plain[0]).count();
        println!("steps of {step}: {dark} of {} pixels are dark", seen.len());
        assert!(
            seen.len() > 500 && 30 * dark <= seen.len(),
            "{dark} of {} pixels at steps of {step}",
            seen.len()
        );
    }
}

/// Ambient occlusion takes light away from crevices, the more the stronger it is, and no opacity; hardly any from what
/// bulges. At strength 0, in lower qualities and where nothing is lit, pictures have the bits that they have without
/// it.
#[test]
fn occlusion_takes_light_from_crevices_and_nothing_else() {
    let gpu = Device::boot();
    let (groove, ball) = (groove(), volume());
    let picture = |volume: &Volume, occlusion: f64, shade: bool, quality: &Quality| {
        let mut look = look("CT-Bone", shade);
        look.transfer.material.occlusion = occlusion;
        let scene = scene(&gpu, volume, None, &look);
        let mut renderer =
            Renderer::new(&gpu, mode("volume").expect("the mode"), &scene, &settings()).expect("a renderer");
        renderer.render_at(&scene, &[camera(&scene)], quality).expect("a frame");
        renderer.target.read_colour(0).expect("a picture")
    };
    let lower = Quality { occlusion: false, ..Quality::FULL };
    let of = |volume: &Volume| {
        [0.0, 0.3, 0.6, 1.0].map(|strength| picture(volume, strength, true, &Quality::FULL))
    };
    let pictures = of(&groove);
    for pair in pictures.windows(2) {
        for (before, after) in pair[0].iter().zip(&pair[1]) {
            assert_eq!(before[3], after[3], "the opacity");
            assert!((0..3).all(|k| after[k] <= before[k] + 1e-6), "{before:?} {after:?}");
        }
    }
    let darker = |pictures: &[Vec<[f32; 4]>; 4]| {
        pictures[0].iter().zip(&pictures[3]).filter(|(before, after)| after[0] < before[0] - 0.02).count()
    };
    let [crevices, bulges] = [darker(&pictures), darker(&of(&ball))];
    println!("{crevices} pixels of a groove are darker, {bulges} of a ball");
    assert!(crevices > 50 && bulges == 0, "{crevices} {bulges}");
    assert!(picture(&groove, 1.0, true, &lower) == pictures[0], "a lower quality");
    let [unlit, plain] = [1.0, 0.0].map(|strength| picture(&groove, strength, false, &Quality::FULL));
    assert!(unlit == plain, "nothing is lit");
}

/// A function whose opacity has factors over the gradient.
fn graded(look: &Look, points: &[[f64; 2]]) -> Look {
    let points = points.iter().map(|&[intensity, opacity]| OpacityPoint { intensity, opacity }).collect();
    let transfer = look.transfer.clone().with_gradient_opacity(points).expect("gradient opacities");
    Look { transfer, ..look.clone() }
}

/// Factors of 1 give the bits of a function without any; a factor that is the same everywhere is one of the opacity per
/// mm; and where nothing changes, the opacity is that of no gradient.
#[test]
fn gradient_opacity_is_a_factor_of_the_opacity() {
    let gpu = Device::boot();
    let (ball, settings) = (volume(), Settings { dark: 1e-5, ..settings() });
    let of = |volume: &Volume, look: &Look, settings: &Settings| {
        let scene = scene(&gpu, volume, None, look);
        render(&gpu, &scene, settings, &[camera(&scene)]).remove(0)
    };
    for (name, shade) in [("CT-Bone", true), ("CT-Soft-Tissue", false)] {
        let look = look(name, shade);
        let plain = of(&ball, &look, &settings);
        let ones = of(&ball, &graded(&look, &[[0.0, 1.0], [10.0, 1.0], [900.0, 1.0]]), &settings);
        assert!(plain == ones, "{name}: factors of 1");
        for classification in [Classification::Point, Classification::PreIntegrated] {
            let settings = Settings { classification: Some(classification), ..settings.clone() };
            let fog = fog(0.1);
            let thinner = 1.0 - (1.0 - (-0.1f64).exp()) * 0.25;
            let expected = of(&ball, &self::fog(-thinner.ln()), &settings);
            let found = of(&ball, &graded(&fog, &[[0.0, 0.25]]), &settings);
            let worst = expected.pixels.iter().zip(&found.pixels).map(|(a, b)| (a[3] - b[3]).abs());
            let worst = worst.fold(0.0, f32::max);
            // Extinctions are halves on the device.
            assert!(worst < 3e-4, "{classification:?}: {worst}");
        }
    }
    // The middle of a volume that is the same everywhere; its faces are an edge.
    let mut even = constant([24; 3], 40.0);
    // What the gradient is against: the least intensity.
    even.samples[0] = -960.0;
    let shell = of(&even, &graded(&fog(0.1), &[[0.0, 0.0], [1.0, 1.0]]), &settings);
    let whole = of(&even, &fog(0.1), &settings);
    let middle = SIZE[1] as usize / 2 * SIZE[0] as usize + SIZE[0] as usize / 2;
    let [shell, whole] = [&shell, &whole].map(|image| image.pixels[middle][3]);
    assert!(0.05 < shell && shell < 0.5 * whole, "{shell} of {whole}");
}

/// Gradients are over the edge of a voxel, so that the same samples show the same parts however large they are.
#[test]
fn gradients_do_not_depend_on_the_size_of_voxels() {
    let gpu = Device::boot();
    let ball = volume();
    let shares = [1.0, 4.0].map(|size| {
        let affine = DAffine3::from_scale(DVec3::splat(size)) * ball.world_from_voxel;
        let volume = Volume::new(ball.size, affine, ball.samples.clone());
        let of = |points: &[[f64; 2]]| {
            let scene = scene(&gpu, &volume, None, &graded(&fog(1e-3 / size), points));
            let image = render(&gpu, &scene, &settings(), &[camera(&scene)]).remove(0);
            image.pixels.iter().map(|p| f64::from(p[3])).sum::<f64>()
        };
        of(&[[20.0, 0.0], [300.0, 1.0]]) / of(&[])
    });
    println!("{shares:?} of the opacity stays");
    assert!(0.05 < shares[0] && shares[0] < 0.9 && (shares[0] / shares[1] - 1.0).abs() < 0.01, "{shares:?}");
}

/// What is the same everywhere absorbs by its thickness alone, at any step, with clip planes or without.
#[test]
fn fog_absorbs_by_its_thickness() {
    let gpu = Device::boot();
    let volume = constant([30, 24, 20], 40.0);
    let size = DVec3::new(30.0 * 0.8, 24.0 * 1.1, 20.0 * 1.7);
    for extinction in [0.005, 0.05, 0.3] {
        let look = fog(extinction);
        for step in [0.25, 1.0, 3.0] {
            for classification in [Classification::Point, Classification::PreIntegrated] {
                let settings = Settings {
                    step,
                    dark: 1e-5,
                    classification: Some(classification),
                    ..Settings { size: [9, 9], ..settings() }
                };
                for cut in [None, Some(ClipPlane { normal: DVec3::Y, offset: 9.3 })] {
                    let look = Look { clip: cut.into_iter().collect(), ..look.clone() };
                    let scene = scene(&gpu, &volume, None, &look);
                    // From so far that the middle ray is along y.
                    let [low, high] = scene.bounds();
                    assert!(((high - low) - size).length() < 1e-3, "{low} {high}");
                    let camera =
                        Camera::from_side("anterior", (low + high) * 0.5, 1.0, 1.0, 1.0).expect("a camera");
                    let middle = render(&gpu, &scene, &settings, &[camera])[0].pixels[40];
                    let thickness = if cut.is_some() { high.y - 9.3 } else { size.y };
                    let expected = 1.0 - (-extinction * thickness).exp();
                    // The faces are ramps of O over two voxels, which coarse steps see less exactly.
                    let bound = if step > 1.0 { 0.03 } else { 5e-3 };
                    let found = f64::from(middle[3]);
                    assert!(
                        (found - expected).abs() < bound,
                        "{found} for {expected}: step {step}, extinction {extinction}, {classification:?}, {cut:?}"
                    );
                    assert!((middle[1] - 0.5 * middle[0]).abs() < 1e-4, "{middle:?}");
                }
            }
        }
    }
}

#[test]
fn halving_the_step_converges() {
    let gpu = Device::boot();
    let volume = volume();
    for (classification, floors) in
        [(Classification::Point, [43.0, 49.0, 54.0]), (Classification::PreIntegrated, [38.0, 44.0, 50.0])]
    {
        let scene = scene(&gpu, &volume, Some(&half(&volume)), &look("CT-Soft-Tissue", true));
        let camera = camera(&scene);
        let at = |step: f64| {
            let settings = Settings { step, dark: 1e-4, classification: Some(classification), ..settings() };
            render(&gpu, &scene, &settings, &[camera]).remove(0)
        };
        let finest = at(0.06);
        let found = [1.0, 0.5, 0.25].map(|step| psnr(&at(step), &finest));
        println!("{classification:?}: {found:.1?} dB");
        assert!(visible(&finest) > 500);
        assert!(found.iter().zip(floors).all(|(found, floor)| *found > floor), "{found:?}");
        assert!(found[0] < found[1] && found[1] < found[2], "{found:?}");
    }
}

/// Cells that are cut only where something can show make the picture of even steps, by fewer samples.
#[test]
fn nothing_is_lost_where_cells_are_not_cut() {
    let gpu = Device::boot();
    let volume = volume();
    for (name, shade, fewer) in [
        ("CT-Bones-Steep", true, 0.9),
        ("CT-Bone", true, 0.9),
        ("CT-Bone", false, 0.9),
        ("CT-Soft-Tissue", true, 1.3),
    ] {
        let scene = scene(&gpu, &volume, Some(&half(&volume)), &look(name, shade));
        for classification in [Classification::Point, Classification::PreIntegrated] {
            let at = |cell, counting| {
                let settings = Settings {
                    step: 0.25,
                    cell: Some(cell),
                    counting,
                    classification: Some(classification),
                    ..settings()
                };
                render(&gpu, &scene, &settings, &[camera(&scene)]).remove(0)
            };
            let samples = |cell| at(cell, true).pixels.iter().map(|work| f64::from(work[1])).sum::<f64>();
            let (even, cut) = (at(0.25, false), at(1.0, false));
            let (found, share) = (psnr(&cut, &even), samples(1.0) / samples(0.25));
            println!("{name}, lit {shade}, {classification:?}: {found:.1} dB, {share:.2} of the samples");
            assert!(visible(&even) > 300 && found > 50.0, "{name} {classification:?}: {found} dB");
            assert!(share < fewer, "{name} {classification:?}: {share} of the samples");
        }
    }
}

#[test]
fn jitter_is_noise_about_the_same_picture() {
    let gpu = Device::boot();
    let volume = volume();
    let scene = scene(&gpu, &volume, None, &look("CT-Soft-Tissue", false));
    let camera = camera(&scene);
    let plain = render(&gpu, &scene, &settings(), &[camera]).remove(0);
    let jittered = Settings { jitter: true, ..settings() };
    let noisy = render(&gpu, &scene, &jittered, &[camera]).remove(0);
    assert_eq!(noisy, render(&gpu, &scene, &jittered, &[camera]).remove(0), "the same noise every time");
    assert!(worst(&plain, &noisy) > 1e-4, "there is noise");
    assert!(psnr(&plain, &noisy) > 35.0, "{} dB", psnr(&plain, &noisy));
}

/// Cameras inside the volume, behind it, with the narrowest and widest fields of view and those of a headset; nothing
/// that is not a number, and what must be seen is.
#[test]
fn strange_cameras_see_numbers() {
    let gpu = Device::boot();
    let volume = volume();
    for (roi, look) in [(None, look("CT-Soft-Tissue", true)), (Some(half(&volume)), look("CT-Skin", true))] {
        let scene = scene(&gpu, &volume, roi.as_ref(), &look);
        let [low, high] = scene.bounds();
        let centre = (low + high) * 0.5;
        let symmetric = |degrees| Fov::symmetric(degrees, 1.3);
        let headset = Fov { left: -1.4, right: 0.9, up: 1.1, down: -1.3 };
        let far = DVec3::Y * 5e3;
        for (eye, target, fov, seen) in [
            (centre, centre + DVec3::Y, symmetric(150.0), true),
            (centre, centre - DVec3::Z, symmetric(1.0), true),
            (low, centre, symmetric(90.0), true),
            (centre + far, centre, symmetric(1.0), true),
            (centre + far, centre + 2.0 * far, symmetric(150.0), false),
            (centre + DVec3::X * 60.0, centre, headset, true),
            // Along an axis, through voxel centres and along faces.
            (DVec3::new(-300.0, 119.0, 810.0), DVec3::new(-300.0, 200.0, 810.0), symmetric(1.0), false),
            (centre + far * 1e6, centre, symmetric(1.0), false),
        ] {
            let camera = Camera::looking(eye, target, DVec3::new(0.1, 0.2, 1.0), fov).expect("a camera");
            for settings in
                [settings(), Settings { classification: Some(Classification::PreIntegrated), ..settings() }]
            {
                let image = render(&gpu, &scene, &settings, &[camera]).remove(0);
                assert!(image.pixels.iter().flatten().all(|v| (0.0..=1.0001).contains(v)), "{eye} {fov:?}");
                assert_eq!(visible(&image) > 0, seen, "{eye} to {target}, {fov:?}");
            }
        }
    }
}

#[test]
fn two_views_are_the_pictures_of_either() {
    let gpu = Device::boot();
    let volume = volume();
    let scene = scene(&gpu, &volume, Some(&half(&volume)), &look("CT-Bone", true));
    let cameras = camera(&scene).eyes(64.0);
    let both = render(&gpu, &scene, &Settings { views: 2, ..settings() }, &cameras);
    for (camera, image) in cameras.iter().zip(&both) {
        assert_eq!(*image, render(&gpu, &scene, &settings(), &[*camera]).remove(0));
    }
    assert!(worst(&both[0], &both[1]) > 0.1);
}

/// A look that is set later gives the same bits as one from the start, and what a look cannot show is not there.
#[test]
fn looks_change() {
    let gpu = Device::boot();
    let volume = volume();
    let mut changed = scene(&gpu, &volume, None, &look("CT-Lung", false));
    let camera = camera(&changed);
    for name in ["CT-Bone", "CT-Soft-Tissue", "CT-Skin"] {
        changed.set_look(&look(name, true)).expect("a look");
        let fresh = scene(&gpu, &volume, None, &look(name, true));
        let found = render(&gpu, &changed, &settings(), &[camera]).remove(0);
        assert!(visible(&found) > 100, "{name}");
        assert_eq!(found, render(&gpu, &fresh, &settings(), &[camera]).remove(0), "{name}");
    }
    let nothing = constant(volume.size, -1000.0);
    let empty = scene(&gpu, &nothing, None, &look("CT-Bone", true));
    assert_eq!(visible(&render(&gpu, &empty, &settings(), &[camera]).remove(0)), 0);
}

/// A region is what the volume is with all else transparent: around it nothing changes the picture.
#[test]
fn outside_the_region_is_nothing() {
    let gpu = Device::boot();
    let volume = volume();
    let look = look("CT-Soft-Tissue", true);
    // A region well inside, so that its box has voxels around it.
    let weight = places(volume.size).map(|[x, y, z]| {
        f32::from(u8::from((8..20).contains(&x) && (5..30).contains(&y) && (4..13).contains(&z)))
    });
    let roi = Roi::new(weight.collect(), &volume).expect("a region");
    let first = scene(&gpu, &volume, Some(&roi), &look);
    let [low, high] = first.bounds();
    let expected = volume.world_from_voxel.transform_point3(DVec3::new(7.5, 4.5, 3.5));
    assert!((low - expected).length() < 1e-6 && (high - low - DVec3::new(12.0, 25.0, 18.0)).length() < 1e-6);
    let camera = camera(&first);
    let found = render(&gpu, &first, &settings(), &[camera]).remove(0);
    assert!(visible(&found) > 300);
    // Voxels two away from it are in no interpolation.
    let mut other = volume.clone();
    for ([x, y, z], v) in places(volume.size).zip(&mut other.samples) {
        if !((6..22).contains(&x) && (3..32).contains(&y) && (2..15).contains(&z)) {
            *v = 500.0;
        }
    }
    let second = scene(&gpu, &other, Some(&roi), &look);
    assert_eq!(found, render(&gpu, &second, &settings(), &[camera]).remove(0));
}

/// Voxels without a value are as outside a region, and leave their neighbours as they are.
#[test]
fn what_is_not_finite_is_not_there() {
    let gpu = Device::boot();
    let mut volume = volume();
    for ([x, _, _], v) in places(volume.size).zip(&mut volume.samples) {
        if x >= 20 {
            *v = if x % 2 == 0 { f32::NAN } else { f32::INFINITY };
        }
    }
    let weight: Vec<f32> = places(volume.size).map(|[x, _, _]| f32::from(u8::from(x < 20))).collect();
    let roi = Roi::new(weight, &volume).expect("a region");
    let look = look("CT-Soft-Tissue", true);
    let bare = scene(&gpu, &volume, None, &look);
    let camera = camera(&bare);
    let found = render(&gpu, &bare, &settings(), &[camera]).remove(0);
    assert!(found.pixels.iter().flatten().all(|v| v.is_finite()) && visible(&found) > 300);
    let masked = scene(&gpu, &volume, Some(&roi), &look);
    assert_eq!(found, render(&gpu, &masked, &settings(), &[camera]).remove(0));
    // Nothing but holes: an empty picture.
    volume.samples.fill(f32::NAN);
    let hollow = scene(&gpu, &volume, None, &look);
    assert_eq!(visible(&render(&gpu, &hollow, &settings(), &[camera]).remove(0)), 0);
}

#[test]
fn wrong_settings_and_volumes_are_refused() {
    let gpu = Device::boot();
    let volume = volume();
    let look = look("CT-Bone", true);
    let scene = scene(&gpu, &volume, None, &look);
    for step in [0.0, -1.0, 1e-9, f64::NAN, f64::INFINITY] {
        let row = mode("volume").expect("the mode");
        let error =
            Renderer::new(&gpu, row, &scene, &Settings { step, ..settings() }).err().expect("an error");
        assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-RENDER-023"), "{step}");
    }
    for cell in [0.0, -1.0, 2.5, f64::NAN, f64::INFINITY] {
        let row = mode("volume").expect("the mode");
        let error = Renderer::new(&gpu, row, &scene, &Settings { cell: Some(cell), ..settings() })
            .err()
            .expect("an error");
        assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-RENDER-030"), "{cell}");
    }
    let flat = Volume { world_from_voxel: DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0)), ..volume.clone() };
    let error = Scene::new(&gpu, None, Some(&VolumeSource { volume: &flat, roi: None }), &look)
        .err()
        .expect("an error");
    assert_eq!(error.code, "VGS-RENDER-022");
    assert!(gpu.memory_by_purpose()["volume"] >= 2 * volume.len() as u64);
    let edge = gpu.limits().volume_edge as usize + 1;
    let long = Volume::new([edge, 1, 1], DAffine3::IDENTITY, vec![0.0; edge]);
    let error = Scene::new(&gpu, None, Some(&VolumeSource { volume: &long, roi: None }), &look)
        .err()
        .expect("an error");
    assert_eq!((error.kind, error.code), (Kind::Unavailable, "VGS-GPU-026"));
}

/// A device that binds little at once still renders: bricks are few.
#[test]
fn small_devices_render_the_same() {
    let volume = volume();
    let look = look("CT-Soft-Tissue", true);
    let picture = |gpu: &Device| {
        let scene = scene(gpu, &volume, None, &look);
        render(gpu, &scene, &settings(), &[camera(&scene)]).remove(0)
    };
    let whole = picture(&Device::boot());
    let options = GpuOptions { storage_range_limit: Some(1 << 20), ..GpuOptions::default() };
    assert_eq!(whole, picture(&Device::boot_with(options)));
}
