//! The shape of workgroups for GPUs gives the same bits as the one for CPU drivers, in every variant of the kernels that
//! have both; in mode alpha the same but for rounding. A driver of eight invocations in lockstep runs both.

use engine::gpu::{Gpu, GpuOptions};
use engine::render::{
    Appearance, Camera, Classification, ClipPlane, Fov, Look, Quality, Rays, Renderer, Scene, Settings,
    VisibilityMask, mode,
};
use engine::splat::{Kernel, SplatSet};
use glam::{DVec2, DVec3};
use vgs_tests::Device;
use vgs_tests::rendering::{look, set};

/// Neither edge is a multiple of a tile's or of a part's.
const SIZE: [u32; 2] = [75, 43];

/// Renders the scene in the shape of a device and returns all numbers of the pictures.
fn pictures(
    gpu: &Gpu,
    set: &SplatSet,
    look: &Look,
    (name, settings): (&str, &Settings),
    quality: &Quality,
) -> Vec<f32> {
    let scene = Scene::new(gpu, Some(set), None, look).expect("a scene");
    let [low, high] = scene.bounds();
    let camera =
        Camera::from_side("anterior-left", (low + high) * 0.5, (high - low).length() * 0.4, 40.0, 1.7);
    let eyes = camera.expect("a camera").eyes(64.0);
    let mut renderer = Renderer::new(gpu, mode(name).expect("a mode"), &scene, settings).expect("a renderer");
    if settings.masked {
        let Fov { left, right, up, down } = eyes[0].fov;
        let corner = [DVec2::new(left, up), DVec2::new(left, down), DVec2::new(right, down)];
        renderer.set_visibility_masks(&[0, 1].map(|_| VisibilityMask::of(&eyes[0].fov, &[corner])));
    }
    let cameras = &eyes[..settings.views as usize];
    renderer.render_at(&scene, cameras, quality).expect("a frame");
    let mut found = Vec::new();
    for view in 0..settings.views {
        let colour = renderer.target.read_colour(view).expect("a picture");
        assert!(colour.iter().filter(|pixel| pixel[3] > 0.1).count() > 100, "{name}: something is seen");
        found.extend(colour.iter().flatten());
        if settings.depth {
            found.extend(renderer.target.read_depth(view).expect("depths"));
        }
    }
    found
}

#[test]
fn both_shapes_give_the_same_bits() {
    let plain = set(150, Kernel::Compact);
    let labels = plain.splats.iter().map(|s| if s.mean[2] > 0.0 { 4 } else { 7 }).collect();
    let objects = SplatSet { labels: Some(labels), ..plain.clone() };
    let tint = |tint, opacity| Appearance { visible: true, tint: Some(tint), opacity };
    let tints = [(4, tint([0.1, 0.4, 1.0], 0.3)), (7, tint([1.0, 0.3, 0.1], 1.0))];
    let tinted = |look: Look| Look { objects: tints.into(), ..look };
    let normal = DVec3::new(0.6, 0.0, 0.8);
    let middle = plain.origin_mm;
    let clip = vec![ClipPlane { normal, offset: normal.dot(middle) - 4.0 }];
    let usual =
        Settings { precise: true, depth: true, rays: Rays::Computed, step: 0.7, ..Settings::new(SIZE) };
    let reduced = Quality { resolution: 0.61, ..Quality::FULL };
    let devices = [8, 64]
        .map(|width| Device::boot_with(GpuOptions { subgroup_size: Some(width), ..GpuOptions::default() }));
    let is_rough = devices[0].description().driver.contains("SwiftShader");
    let mut worst = 0.0f32;
    for name in ["slab", "exact", "decoded", "alpha"] {
        for shade in [false, true] {
            for classification in [Classification::Point, Classification::PreIntegrated] {
                let one = Settings { classification: Some(classification), ..usual.clone() };
                let two = Settings { views: 2, masked: true, ..one.clone() };
                let bone = look("CT-Bone", shade);
                let clipped = Look { clip: clip.clone(), ..tinted(bone.clone()) };
                for (how, set, look, settings, quality) in [
                    ("one eye", &plain, &bone, &one, &Quality::FULL),
                    ("two eyes with masks", &plain, &bone, &two, &reduced),
                    ("tinted objects, clipped", &objects, &clipped, &two, &Quality::FULL),
                ] {
                    let [narrow, wide] =
                        devices.each_ref().map(|gpu| pictures(gpu, set, look, (name, settings), quality));
                    let label = format!("{name}, {how}, lit {shade}, {classification:?}");
                    assert_eq!(narrow.len(), wide.len(), "{label}");
                    let pairs = || narrow.iter().zip(&wide);
                    if name == "alpha" {
                        // Triangles of other corners: places in them are interpolated with another rounding.
                        // (Infinite depths are equal; SwiftShader's corners lie on sixteenths of a pixel.)
                        let far = |(a, b): (&f32, &f32)| match a == b {
                            true => 0.0,
                            false => (a - b).abs() / b.abs().max(1.0),
                        };
                        let (bound, most) = if is_rough { (0.05, narrow.len() / 20) } else { (1e-4, 0) };
                        let off = pairs().map(far).filter(|far| far.is_nan() || *far >= bound).count();
                        assert!(off <= most, "{label}: {off} of {} numbers are off", narrow.len());
                        worst = pairs().map(far).filter(|far| *far < bound).fold(worst, f32::max);
                    } else {
                        let differ = pairs().filter(|(a, b)| a.to_bits() != b.to_bits()).count();
                        assert_eq!(differ, 0, "{label}: bits of {} numbers differ", narrow.len());
                    }
                }
            }
        }
    }
    println!("alpha: the shapes differ by {worst} at most");
}
