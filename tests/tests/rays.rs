//! Rays that are started by rasterization gather the same bits as those that a kernel starts, in the modes `volume` and
//! `decoded`.

use engine::gpu::Gpu;
use engine::render::{
    Appearance, Camera, Classification, ClipPlane, Fov, Look, Quality, Rays, Renderer, Scene, Settings,
    VisibilityMask, VolumeSource, mode,
};
use engine::splat::{Kernel, SplatSet};
use engine::volume::{Roi, Volume};
use glam::{DAffine3, DMat3, DQuat, DVec2, DVec3};
use rand::RngExt;
use vgs_tests::Device;
use vgs_tests::rendering::{look, set};
use vgs_tests::scene::random;

const SIZE: [u32; 2] = [101, 78];

/// Crumbs of bone in air, some at corners and edges of the volume, on an oblique grid of 1 × 1.2 × 2 mm.
fn crumbs(count: usize) -> Volume {
    let size = [43, 37, 21];
    let mut samples = vec![-1000.0; size.iter().product()];
    let mut rng = random(5);
    let mut set = |[x, y, z]: [usize; 3]| samples[x + size[0] * (y + size[1] * z)] = 900.0;
    for k in 0..count {
        set(std::array::from_fn(|axis| match k >> axis & 1 {
            _ if k >= 8 => rng.random_range(0..size[axis]),
            0 => 0,
            _ => size[axis] - 1,
        }));
    }
    let turn = DMat3::from_quat(DQuat::from_euler(glam::EulerRot::XYZ, 0.3, -0.2, 0.5));
    let matrix = turn * DMat3::from_diagonal(DVec3::new(-1.0, 1.2, 2.0));
    Volume::new(size, DAffine3::from_mat3_translation(matrix, DVec3::new(-300.0, 120.0, 800.0)), samples)
}

fn of_volume(gpu: &Gpu, volume: &Volume, roi: Option<&Roi>, look: &Look) -> Scene {
    Scene::new(gpu, None, Some(&VolumeSource { volume, roi }), look).expect("a scene")
}

fn settings() -> Settings {
    Settings { precise: true, depth: true, step: 0.5, ..Settings::new(SIZE) }
}

/// Renders both ways, holds them against each other, and returns the number of pixels that show something.
fn check(
    label: &str,
    (gpu, name, scene): (&Gpu, &str, &Scene),
    settings: &Settings,
    cameras: &[Camera],
    (quality, masks): (&Quality, &[VisibilityMask]),
) -> usize {
    let settings = Settings { views: cameras.len() as u32, ..settings.clone() };
    let render = |settings: &Settings| {
        let mut renderer =
            Renderer::new(gpu, mode(name).expect("a mode"), scene, settings).expect("a renderer");
        if settings.masked {
            renderer.set_visibility_masks(masks);
        }
        renderer.render_at(scene, cameras, quality).expect("a frame");
        renderer
    };
    let [computed, rasterized] =
        [Rays::Computed, Rays::Rasterized].map(|rays| render(&Settings { rays, ..settings.clone() }));
    let [width, height] = quality.size(settings.size).map(|n| n as usize);
    let [all, _] = settings.size.map(|n| n as usize);
    let rendered = |i: &usize| i % all < width && i / all < height;
    let mut visible = 0;
    for view in 0..settings.views {
        let [a, b] = [&computed, &rasterized].map(|renderer| {
            let target = &renderer.target;
            let depths = if settings.depth { target.read_depth(view).expect("depths") } else { Vec::new() };
            (target.read_colour(view).expect("a picture"), depths)
        });
        let bits = |pixel: [f32; 4]| pixel.map(f32::to_bits);
        let differ = |i: &usize| bits(a.0[*i]) != bits(b.0[*i]);
        let others: Vec<usize> = (0..a.0.len()).filter(rendered).filter(differ).collect();
        assert!(
            others.is_empty(),
            "{label}, view {view}: {} pixels differ, such as {:?} and {:?}",
            others.len(),
            a.0[others[0]],
            b.0[others[0]]
        );
        let deep = |depths: &[f32]| -> Vec<u32> {
            (0..depths.len()).filter(rendered).map(|i| depths[i].to_bits()).collect()
        };
        assert_eq!(deep(&a.1), deep(&b.1), "{label}, view {view}: depth");
        visible += (0..a.0.len()).filter(rendered).filter(|&i| a.0[i][3] > 0.0).count();
    }
    println!("{label}: {visible} pixels show something");
    visible
}

/// Returns the number of rays that faces start, and that of pixels.
fn started((gpu, name, scene): (&Gpu, &str, &Scene), cameras: &[Camera]) -> [usize; 2] {
    let views = cameras.len() as u32;
    let settings = Settings { views, rays: Rays::Rasterized, counting: true, depth: false, ..settings() };
    let mut renderer = Renderer::new(gpu, mode(name).expect("a mode"), scene, &settings).expect("a renderer");
    renderer.render(scene, cameras).expect("a frame");
    let counts: Vec<[f32; 4]> =
        (0..views).flat_map(|view| renderer.target.read_colour(view).expect("counts")).collect();
    [counts.iter().filter(|c| c[3] == 1.0).count(), counts.len()]
}

fn occluded(mut look: Look) -> Look {
    look.transfer.material.occlusion = 0.8;
    look
}

fn around(scene: &Scene, name: &str, part: f64) -> Camera {
    let [low, high] = scene.bounds();
    Camera::from_side(name, (low + high) * 0.5, (high - low).length() * part, 40.0, 1.3).expect("a camera")
}

/// Holds both ways against each other in all variants of the shaders.
fn check_variants(gpu: &Gpu, name: &str, scenes: &[(&str, Scene)]) {
    let coarse = Quality { resolution: 0.61, ..Quality::FULL };
    // Longer than a voxel, so that a step may come from a brick that another ray leaps over.
    let coarser = Quality { resolution: 0.8, coarseness: 3.0, occlusion: true };
    for (k, (label, scene)) in scenes.iter().enumerate() {
        let eyes = around(scene, "anterior-left", 0.4).eyes(30.0);
        // A corner beyond the lens.
        let Fov { left, right, up, down } = eyes[0].fov;
        let corner = [DVec2::new(left, up), DVec2::new(left, down), DVec2::new(right, down)];
        let masks = [0, 1].map(|_| VisibilityMask::of(&eyes[0].fov, &[corner]));
        let of = |how: &str, classification, changed: Settings, cameras: &[Camera], quality: &Quality| {
            let label = format!("{label}, {classification:?}, {how}");
            let changed = Settings { classification: Some(classification), ..changed };
            let masks = &masks[..cameras.len()];
            let visible = check(&label, (gpu, name, scene), &changed, cameras, (quality, masks));
            assert!(visible > 20, "{label}");
            visible
        };
        let both = [Classification::Point, Classification::PreIntegrated];
        for classification in both {
            of("two eyes", classification, settings(), &eyes, &Quality::FULL);
            of("fewer samples", classification, settings(), &eyes, &coarser);
        }
        let [one, other] = [both[k % 2], both[(k + 1) % 2]];
        let all = of("one eye", one, settings(), &eyes[..1], &Quality::FULL);
        of("fewer pixels", other, settings(), &eyes, &coarse);
        of("jitter", other, Settings { jitter: true, ..settings() }, &eyes, &Quality::FULL);
        of("halves", other, Settings { precise: false, depth: false, ..settings() }, &eyes, &Quality::FULL);
        let masked = of("masks", one, Settings { masked: true, ..settings() }, &eyes[..1], &Quality::FULL);
        assert!(masked < all, "{label}: {masked} of {all}");
        let [rays, pixels] = started((gpu, name, scene), &eyes);
        println!("{label}: {rays} rays, {pixels} pixels");
        assert!(rays < pixels, "{label}: no face covers the corners of the picture");
    }
}

#[test]
fn volumes_gather_the_same_bits() {
    let gpu = Device::boot();
    let volume = crumbs(150);
    let weight = (0..volume.len()).map(|i| f32::from(u8::from(i % 43 < 30))).collect();
    let roi = Roi::new(weight, &volume).expect("a region");
    let plain = of_volume(&gpu, &volume, None, &look("CT-Bones-Steep", false));
    let lit = of_volume(&gpu, &volume, Some(&roi), &look("CT-Bone", true));
    let [low, high] = plain.bounds();
    let normal = DVec3::new(0.6, 0.0, 0.8);
    let clip = vec![ClipPlane { normal, offset: normal.dot((low + high) * 0.5) - 4.0 }];
    let clipped = of_volume(&gpu, &volume, None, &Look { clip: clip.clone(), ..look("CT-Bone", true) });
    let occluded = of_volume(&gpu, &volume, None, &Look { clip, ..occluded(look("CT-Bone", true)) });
    let scenes = [
        ("plain", plain),
        ("a region, lit", lit),
        ("clipped, lit", clipped),
        ("clipped, occluded", occluded),
    ];
    check_variants(&gpu, "volume", &scenes);
}

#[test]
fn decoded_fields_gather_the_same_bits() {
    let gpu = Device::boot();
    let shown = |visible, tint, opacity| Appearance { visible, tint, opacity };
    let tints = [(4, shown(true, Some([0.1, 0.4, 1.0]), 0.3)), (7, shown(true, Some([1.0, 0.3, 0.1]), 1.0))];
    let tinted = Look { objects: tints.into(), ..look("CT-Soft-Tissue", true) };
    let hidden = Look { objects: [(4, shown(false, None, 1.0))].into(), ..look("CT-Bone", false) };
    let splats = set(120, Kernel::Compact);
    let labels = splats.splats.iter().map(|s| if s.mean[2] > 0.0 { 4 } else { 7 }).collect();
    let objects = SplatSet { labels: Some(labels), ..splats.clone() };
    let scene = |set: &SplatSet, look: Look| Scene::new(&gpu, Some(set), None, &look).expect("a scene");
    let scenes = [
        ("soft", scene(&splats, look("CT-Soft-Tissue", false))),
        ("bone, lit", scene(&splats, look("CT-Bone", true))),
        ("tints, occluded", scene(&objects, occluded(tinted.clone()))),
        ("tints, lit", scene(&objects, tinted)),
        ("hidden", scene(&objects, hidden)),
    ];
    check_variants(&gpu, "decoded", &scenes);
}

/// From within, from behind, along faces, with the narrowest, widest and most askew fields of view; and with looks that
/// change.
#[test]
fn no_ray_is_missed_wherever_the_eye_is() {
    let gpu = Device::boot();
    let volume = crumbs(40);
    let mut scene = of_volume(&gpu, &volume, None, &look("CT-Bones-Steep", false));
    let [low, high] = scene.bounds();
    let centre = (low + high) * 0.5;
    let at = |x: f64, y: f64, z: f64| volume.world_from_voxel.transform_point3(DVec3::new(x, y, z));
    let symmetric = |degrees| Fov::symmetric(degrees, 1.3);
    let askew = Fov { left: -1.4, right: 0.2, up: 0.3, down: -1.3 };
    let far = DVec3::new(3.0, 5.0, 1.0) * 1e3;
    let mut eyes = vec![
        (centre, centre + DVec3::Y, symmetric(150.0)),
        (centre, centre - DVec3::Z, askew),
        (centre + far, centre, symmetric(1.0)),
        (centre + 10.0 * far, centre, symmetric(1.0)),
        (centre + far, centre, symmetric(30.0)),
        (centre + far, centre + 2.0 * far, symmetric(150.0)),
        (low, high, symmetric(100.0)),
        // At a crumb, at the face of a brick, on that of a cell, and along the volume's own.
        (at(0.0, 0.0, 0.0), centre, symmetric(120.0)),
        (at(42.0, 36.0, 20.0), at(0.0, 36.0, 20.0), symmetric(170.0)),
        (at(15.0, 15.0, 7.0), at(30.0, 15.0, 7.0), symmetric(140.0)),
        (at(15.25, 15.0, 7.0), at(15.25, 30.0, 7.5), symmetric(140.0)),
        (at(42.25, -30.0, 3.0), at(42.25, 30.0, 3.0), symmetric(90.0)),
    ];
    let mut rng = random(9);
    for _ in 0..40 {
        let mut place =
            |reach: f64| centre + DVec3::from_array(std::array::from_fn(|_| rng.random_range(-reach..reach)));
        eyes.push((place(45.0), place(25.0), symmetric(60.0)));
    }
    let mut seen = 0;
    for (k, (eye, target, fov)) in eyes.into_iter().enumerate() {
        let camera = Camera::looking(eye, target, DVec3::new(0.1, 0.2, 1.0), fov).expect("a camera");
        // The second eye is canted.
        let canted = camera.turned(eye, DVec3::new(0.2, 0.1, 1.0).normalize(), 0.3);
        let name = if k % 2 == 0 { "CT-Bones-Steep" } else { "CT-Bone" };
        scene.set_look(&look(name, k % 3 == 0)).expect("a look");
        let label = format!("{k}: {eye} to {target}");
        let visible =
            check(&label, (&gpu, "volume", &scene), &settings(), &[camera, canted], (&Quality::FULL, &[]));
        seen += usize::from(visible > 0);
    }
    assert!(seen > 35, "{seen}");
}

/// What is listed follows the look, in the same renderer.
#[test]
fn rays_follow_the_look() {
    let gpu = Device::boot();
    let splats = set(120, Kernel::Compact);
    let mut scene = Scene::new(&gpu, Some(&splats), None, &look("CT-Bone", false)).expect("a scene");
    let camera = around(&scene, "left", 0.4);
    let renderer = |scene: &Scene, rays| {
        let row = mode("decoded").expect("a mode");
        Renderer::new(&gpu, row, scene, &Settings { rays, ..settings() }).expect("a renderer")
    };
    let [mut computed, mut rasterized] =
        [Rays::Computed, Rays::Rasterized].map(|rays| renderer(&scene, rays));
    for name in ["CT-Soft-Tissue", "CT-Bones-Steep", "CT-Bone", "CT-Soft-Tissue"] {
        scene.set_look(&look(name, true)).expect("a look");
        let [a, b] = [&mut computed, &mut rasterized].map(|renderer| {
            renderer.render(&scene, &[camera]).expect("a frame");
            renderer.target.read_colour(0).expect("a picture")
        });
        assert!(a.iter().filter(|c| c[3] > 0.1).count() > 100, "{name}");
        assert_eq!(a, b, "{name}");
    }
}
