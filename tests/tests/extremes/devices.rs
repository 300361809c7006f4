//! The same on every device at hand, and numbers that some devices flush to zero.
//!
//! Here that is lavapipe as it is, with vectors of 128 and with vectors of 256 bits: other code, and sums over workgroups
//! of another size. The width is read when the driver is loaded, so each runs in a process of its own.

use std::process::Command;

use engine::gpu::devices;
use engine::image::{Image, flip};
use engine::render::{Classification, Scene, Settings, mode};
use engine::splat::{Field, Kernel, Splat};
use engine::volume::Bricks;
use engine::volume::bricks::SAMPLES;
use glam::{IVec3, UVec3};
use reference::{Footprint, splat_to_volume};
use vgs_tests::numerics::keep;
use vgs_tests::rendering::{camera, look, reference_picture, render, set, settings};
use vgs_tests::sampling::{KERNELS, field, one, sample};
use vgs_tests::scene::EPSILON;
use vgs_tests::{Device, step};

/// Where a process that was started for one width leaves what it measured.
const FOUND: &str = "VGS_TEST_FOUND";

/// The error of W (relative, above 1e-3) and V̂ on the device, and the mean FLIP of a picture against the
/// reference implementation.
fn measure(gpu: &Device) -> [f64; 2] {
    let mut off = 0.0f64;
    for kernel in KERNELS {
        let scene = vgs_tests::Scene::random(8, 100, kernel, false);
        let pass = step::run(gpu, &scene, &step::terms(false));
        let footprints: Vec<Footprint> = pass.footprints.iter().map(Into::into).collect();
        let positions = scene.samples().positions();
        let wanted = splat_to_volume::splat_to_volume(&footprints, &positions, kernel, f64::from(EPSILON));
        for (i, (got, want)) in pass.reconstructions.iter().zip(&wanted).enumerate() {
            // At the cut-off of a Gaussian the sample may fall either way.
            let edge = |f: &Footprint| {
                let q = (f.whitening * (positions[i] - f.mean)).length_squared();
                let cut = (positions[i] - f.mean).abs().max_element() - kernel.row().reach;
                (q - kernel.support_q()).abs() < 1e-4 || (cut - 1e-3).abs() < 1e-4
            };
            let idle = !scene.bricks.is_active(i / SAMPLES, i % SAMPLES);
            if idle || kernel != Kernel::Compact && footprints.iter().any(edge) {
                continue;
            }
            off = off.max((f64::from(got.weight) - want.weight).abs() / (want.weight + 1.0));
            off = off.max((f64::from(got.value) - want.value).abs());
        }
    }
    let set = set(150, Kernel::Compact);
    let look = look("CT-Soft-Tissue", false);
    let scene = Scene::new(gpu, Some(&set), None, &look).expect("a scene");
    let camera = camera(&scene);
    let settings =
        Settings { step: 0.5, dark: 1e-4, classification: Some(Classification::Point), ..settings() };
    let found = render(gpu, mode("slab").expect("a mode"), &scene, &settings, &[camera]).remove(0);
    let wanted = reference_picture(&set, &scene, &camera, &look, 0.5);
    let black = |image: &Image| image.over([0.0; 3]);
    [off, flip(&black(&wanted), &black(&found)).expect("pictures of one size").mean]
}

/// What [`n21_every_device`] measures in a process of its own with this width of vectors.
fn with_width(bits: u32) -> [f64; 2] {
    let file = tempfile::NamedTempFile::new().expect("a temporary file");
    let program = std::env::args().next().expect("the test's own path");
    let mut command = match std::env::var_os("VGS_RUNNER") {
        Some(runner) => {
            let mut command = Command::new(runner);
            command.arg(program);
            command
        }
        None => Command::new(program),
    };
    let output = command
        .args(["--exact", "extremes::devices::n21_every_device", "--nocapture"])
        .env("LP_NATIVE_VECTOR_WIDTH", bits.to_string())
        .env(FOUND, file.path())
        .output()
        .expect("the test starts itself");
    let said =
        String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "with vectors of {bits} bits: {said}");
    let text = std::fs::read_to_string(file.path()).expect("what it measured");
    let values: Vec<f64> = text.split_whitespace().map(|v| v.parse().expect("a number")).collect();
    [values[0], values[1]]
}

#[test]
fn n21_every_device() {
    let mut worst = measure(&Device::boot());
    if let Some(path) = std::env::var_os(FOUND) {
        return std::fs::write(path, format!("{:e} {:e}", worst[0], worst[1])).expect("a file");
    }
    for bits in [128, 256] {
        let found = with_width(bits);
        println!("vectors of {bits} bits: {found:?}");
        worst = [worst[0].max(found[0]), worst[1].max(found[1])];
    }
    for other in devices().expect("devices").iter().skip(1).filter(|d| d.missing.is_empty()) {
        let options = engine::gpu::GpuOptions { device: Some(other.index.to_string()), ..Default::default() };
        let found = measure(&Device::boot_with(options));
        println!("{}: {found:?}", other.name);
        worst = [worst[0].max(found[0]), worst[1].max(found[1])];
    }
    keep("N21a", worst[0]);
    keep("N21b", worst[1]);
}

/// Weights around the least normal number: a device may keep what lies below it or take it for zero, sample by sample.
/// V̂ must be the splat's intensity or the background, and nothing else.
#[test]
fn n28_subnormal_weights() {
    let gpu = Device::boot();
    let bricks = Bricks::of_box(IVec3::ZERO, UVec3::splat(8), |_| true);
    let mut wrong = 0;
    let mut seen = [0; 2];
    for kernel in [Kernel::Compact, Kernel::Gaussian] {
        for exponent in (-46..=-30).map(f64::from) {
            let logit = (exponent * std::f64::consts::LN_10) as f32;
            let splat = Splat { opacity_logit: logit, ..one([3.5; 3], [1.0; 3], 0.0, 1040.0) };
            let free = Field { epsilon: 0.0, ..field(kernel, 40.0) };
            for s in sample(&gpu, &[splat], &free, &bricks, [0.0; 3]) {
                let (kept, flushed) = (s.hu == 1040.0, s.hu == 40.0);
                wrong += usize::from(!kept && !flushed || kept && s.weight == 0.0);
                seen[0] += usize::from(kept);
                seen[1] += usize::from(flushed && exponent > -37.0 && s.weight > 1e-37);
            }
        }
    }
    assert!(seen[0] > 1000, "normal weights are kept: {seen:?}");
    assert_eq!(seen[1], 0, "no normal weight is lost");
    keep("N28", wrong as f64);
}
