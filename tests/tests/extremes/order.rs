//! The order of the splats, and the same run twice.

use rand::seq::SliceRandom;
use vgs_tests::fitting::Case;
use vgs_tests::numerics::keep;
use vgs_tests::sampling::KERNELS;
use vgs_tests::scene::random;
use vgs_tests::{Device, Scene, step};

#[test]
fn n19_any_order() {
    let gpu = Device::boot();
    let mut rng = random(77);
    let (mut share, mut differ) = (0.0f64, 0);
    for kernel in KERNELS {
        let scene = Scene::random(4, 90, kernel, false);
        let first = step::run(&gpu, &scene, &step::terms(false));
        let bound = 4.0 * f64::from(f32::EPSILON) * (scene.splats.len() as f64).sqrt();
        let mut order: Vec<usize> = (0..scene.splats.len()).collect();
        for _ in 0..10 {
            order.shuffle(&mut rng);
            let splats = order.iter().map(|&i| scene.splats[i]).collect();
            let again = step::run(&gpu, &Scene { splats, ..scene.clone() }, &step::terms(false));
            for (a, b) in first.reconstructions.iter().zip(&again.reconstructions) {
                // Relative, and absolute below 1: V̂ is a difference of small numbers there.
                for (a, b) in
                    [(a.weight, b.weight), (a.value, b.value)].map(|(a, b)| (f64::from(a), f64::from(b)))
                {
                    share = share.max((a - b).abs() / (bound * (1.0 + a.abs())));
                }
            }
        }
        let same = step::run(&gpu, &scene, &step::terms(false));
        differ += same.reconstructions.iter().zip(&first.reconstructions).filter(|(a, b)| a != b).count();
        differ += same.gradients.iter().zip(&first.gradients).filter(|(a, b)| a != b).count();
    }
    keep("N19a", share);
    keep("N19b", differ as f64);
}

#[test]
fn n20_the_same_seed() {
    let gpu = Device::boot();
    let case = Case::phantom([40, 36, 40], 25);
    let first = case.fit(&gpu).splats().expect("splats");
    let mut differ = 0;
    let mut compare = |gpu: &Device| {
        let again = case.fit(gpu).splats().expect("splats");
        assert_eq!(again.len(), first.len());
        differ += again.iter().zip(&first).filter(|(a, b)| a != b).count();
    };
    compare(&gpu);
    drop(gpu);
    let another = Device::boot();
    compare(&another);
    keep("N20", differ as f64);
    let mut other = case.clone();
    other.config.seed += 1;
    assert!(other.fit(&another).splats().expect("splats") != first, "the seed has no effect");
}
