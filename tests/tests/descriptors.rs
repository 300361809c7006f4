//! Devices that do not take pushed descriptors bind sets from pools: the results are the same to the bit.

use engine::gpu::GpuOptions;
use engine::passes::Scan;
use engine::render::{Camera, Quality, Renderer, Scene as Shown, Settings, mode};
use engine::splat::Kernel;
use reference::scan;
use vgs_tests::rendering::{look, set};
use vgs_tests::{Device, Scene, step};

/// Boots a device that takes pushed descriptors, if the driver does, and one that does not.
fn both() -> [Device; 2] {
    [false, true]
        .map(|descriptor_pools| Device::boot_with(GpuOptions { descriptor_pools, ..GpuOptions::default() }))
}

/// A prefix sum of three passes a level, so often that one submission needs many pools, and twice, so that they serve
/// again.
#[test]
fn a_submission_has_as_many_sets_as_it_needs() {
    for gpu in both() {
        let values: Vec<u32> = (0..10_000).map(|i| i % 17).collect();
        let input = gpu.upload("values", "test", &values).unwrap();
        let mut offsets = gpu.buffer("offsets", "test", values.len() + 1).unwrap();
        let mut pass = Scan::new(&gpu, values.len()).unwrap();
        for _ in 0..2 {
            let mut recorder = gpu.record().unwrap();
            for _ in 0..400 {
                pass.record(&mut recorder, &input, values.len(), &mut offsets);
            }
            gpu.wait(recorder.submit().unwrap()).unwrap();
            assert!(offsets.read().unwrap() == scan::scan(&values));
            recorder = gpu.record().unwrap();
            recorder.clear(&offsets);
            gpu.wait(recorder.submit().unwrap()).unwrap();
        }
    }
}

#[test]
fn steps_of_a_fit_are_the_same() {
    let devices = both();
    for kernel in [Kernel::Compact, Kernel::Gaussian] {
        let scene = Scene::random(72, 150, kernel, false);
        let [a, b] = devices.each_ref().map(|gpu| step::run(gpu, &scene, &step::terms(false)));
        assert!(a.reconstructions == b.reconstructions && a.adjoints == b.adjoints);
        assert_eq!(a.moments, b.moments);
    }
}

#[test]
fn pictures_are_the_same() {
    let devices = both();
    let set = set(120, Kernel::Compact);
    for name in ["slab", "decoded", "alpha"] {
        let settings = Settings { views: 2, depth: true, ..Settings::new([61, 47]) };
        let [pushed, pooled] = devices.each_ref().map(|gpu| {
            let scene = Shown::new(gpu, Some(&set), None, &look("CT-Bone", true)).expect("a scene");
            let [low, high] = scene.bounds();
            let camera =
                Camera::from_side("anterior-left", (low + high) * 0.5, (high - low).length(), 40.0, 1.3);
            let eyes = camera.expect("a camera").eyes(64.0);
            let mut renderer =
                Renderer::new(gpu, mode(name).expect("a mode"), &scene, &settings).expect("a renderer");
            // The second frame records in what the first one has used.
            for _ in 0..3 {
                renderer.render_at(&scene, &eyes, &Quality::FULL).expect("a frame");
            }
            [0, 1].map(|view| renderer.target.read_colour(view).expect("a picture"))
        });
        let seen = pushed.iter().flatten().filter(|pixel| pixel[3] > 0.1).count();
        assert!(seen > 100, "{name}: {seen} pixels show something");
        assert!(pushed == pooled, "{name}");
    }
}
