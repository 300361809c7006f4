//! Mixed storage: what the device keeps of a sample is a rounded one, never an infinity, and the fit that goes on from it is
//! as good and as repeatable as with full storage. That it is the nearest f16 is N11, in `extremes/storage.rs`.

use engine::fit::Storage;
use engine::splat::activation::LOG_SCALE_LIMIT;
use engine::splat::kernel::KERNELS;
use engine::splat::{self, Splat};
use reference::half;
use shaders_glsl::types::Target;
use vgs_tests::fitting::Case;
use vgs_tests::{Bound, Device, Scene, assert_close, step};

/// The forward pass adds up the same numbers and rounds them once; the gradient follows within the rounding.
#[test]
fn mixed_samples_are_full_ones_rounded() {
    let gpu = Device::boot();
    for row in &KERNELS {
        let scene = Scene::random(91, 150, row.kernel, false);
        let full = step::run(&gpu, &scene, &step::terms(false));
        let mixed = step::run_stored(&gpu, &scene, &step::terms(false), Storage::Mixed);
        let rounded = |v: f32| half(f64::from(v)) as f32;
        for (f, m) in full.reconstructions.iter().zip(&mixed.reconstructions) {
            assert_eq!((m.weight, m.value), (rounded(f.weight), rounded(f.value)), "{}", row.name);
        }
        let lanes = |pass: &step::Pass| -> Vec<[f64; 11]> {
            pass.gradients.iter().map(|g| reference::Gradient::from(g).lanes()).collect()
        };
        let (got, wanted) = (lanes(&mixed), lanes(&full));
        for lane in 0..11 {
            let largest = wanted.iter().fold(0.0f64, |a, g| a.max(g[lane].abs()));
            let pairs = got.iter().zip(&wanted).map(|(g, w)| (g[lane] / largest, w[lane] / largest));
            // 2⁻¹¹ of every A, and of the ones with little W what rounding makes of ε + W.
            let name = format!("mixed gradient, {}, parameter {lane}", row.name);
            assert_close(&name, Bound::new(2e-3, 2e-3), pairs);
        }
    }
}

#[test]
fn extreme_splats_give_no_infinity() {
    let gpu = Device::boot();
    let scene = Scene::random(92, 40, splat::Kernel::Density, false);
    let at_sample = scene.offset.map(|offset| 8.0 + offset);
    let mut splats = scene.splats.clone();
    for log_scale in [-LOG_SCALE_LIMIT, -10.0, -6.0, 0.0, 3.0, LOG_SCALE_LIMIT] {
        for opacity_logit in [-200.0, 0.0, 200.0] {
            splats.push(Splat {
                mean: at_sample,
                log_scale: [log_scale; 3],
                opacity_logit,
                rotation: [1.0, 0.0, 0.0, 0.0],
                intensity: 0.5,
            });
        }
    }
    for row in &KERNELS {
        let targets = vec![Target::new(-1.0, 1.0); scene.targets.len()];
        let scene = Scene { splats: splats.clone(), targets, kernel: row.kernel, ..scene.clone() };
        let pass = step::run_stored(&gpu, &scene, &step::terms(true), Storage::Mixed);
        let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
        assert!(finite(bytemuck::cast_slice(&pass.reconstructions)), "{}: a sample", row.name);
        assert!(finite(bytemuck::cast_slice(&pass.adjoints)), "{}: an adjoint", row.name);
        assert!(finite(bytemuck::cast_slice(&pass.gradients)), "{}: a gradient", row.name);
        let most = pass.reconstructions.iter().fold(0.0f32, |a, r| a.max(r.weight));
        if row.unit_integral {
            assert_eq!(most, 65504.0, "a larger W is kept at the largest half");
        }
    }
}

#[test]
fn a_mixed_fit_repeats_and_is_nearly_as_good() {
    let mut case = Case::phantom([40, 36, 40], 60);
    let mut fit = |storage| {
        let gpu = Device::boot();
        case.config.storage = storage;
        let mut fitter = case.fit(&gpu);
        let splats = fitter.splats().expect("splats");
        let db = fitter.progress().expect("progress").psnr_db;
        (splats, db, gpu.peak_bytes())
    };
    let (_, full_db, full_bytes) = fit(Storage::Full);
    let (first, mixed_db, mixed_bytes) = fit(Storage::Mixed);
    let (second, ..) = fit(Storage::Mixed);
    println!("{full_db:.2} dB full, {mixed_db:.2} dB mixed; {full_bytes} and {mixed_bytes} bytes");
    assert!(first == second, "two runs differ");
    assert!((mixed_db - full_db).abs() < 0.5, "{mixed_db} dB for {full_db} dB");
    assert!(mixed_bytes < full_bytes, "{mixed_bytes} bytes for {full_bytes}");
}
