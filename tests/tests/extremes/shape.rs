//! Splats of every shape: smaller than a voxel, larger than the volume, needles, any quaternion; and where they end.

use engine::fit::FitConfig;
use engine::splat::activation::limit_anisotropy;
use engine::splat::{Field, Kernel, ReadOptions, Splat, SplatSet, describe, write};
use engine::volume::Bricks;
use engine::volume::bricks::SAMPLES;
use glam::{DAffine3, DMat3, DVec3, IVec3, UVec3};
use rand::RngExt;
use reference::splat_bounds;
use shaders_glsl::types::Target;
use vgs_tests::fitting::Case;
use vgs_tests::numerics::keep;
use vgs_tests::sampling::{EXTENT, IDENTITY, KERNELS, bricks, field, one, sample};
use vgs_tests::scene::{random, rotation};
use vgs_tests::{Device, Scene, step};

/// The fit's least scale, voxels.
fn least_scale() -> f32 {
    FitConfig::default().scales.min
}

/// A splat on or between voxel centres that reaches none of them is widened to the floor, and then has weight and learns.
#[test]
fn n2_smaller_than_a_voxel() {
    let gpu = Device::boot();
    let case = Case::ball(
        16,
        6.0,
        FitConfig::default().with(|c| {
            c.iterations = 12;
            c.samples.offsets = 1;
        }),
    );
    let tiny: Vec<Splat> =
        [[7.5, 7.5, 7.5], [6.5, 8.5, 7.5], [9.5, 6.5, 8.5], [8.0, 8.0, 8.0], [7.5, 6.0, 8.0]]
            .map(|mean| one(mean, [0.05f32.ln(); 3], 0.0, 20.0))
            .to_vec();
    let mut fitter = case.fitter(&gpu, &tiny);
    case.run(&mut fitter, 1);
    let first = fitter.splats().expect("splats");
    let widened = |s: &Splat| s.log_scale.iter().all(|v| (v - least_scale().ln()).abs() < 1e-6);
    let mut dead = first.iter().filter(|s| !widened(s)).count();
    case.run(&mut fitter, 12);
    for (before, after) in first.iter().zip(fitter.splats().expect("splats")) {
        let values: [f32; 12] = bytemuck::cast(after);
        assert!(values.iter().all(|v| v.is_finite()));
        dead += usize::from(before.intensity == after.intensity);
    }
    keep("N2a", dead as f64);
    // The worst place for the floor is the middle between eight voxel centres.
    let mut share = 0.0f64;
    for kernel in [Kernel::Compact, Kernel::Gaussian] {
        let splat = one([7.5, 7.5, 5.5], [least_scale().ln(); 3], 20.0, 20.0);
        let got = sample(&gpu, &[splat], &field(kernel, 0.0), &bricks(), [0.0; 3]);
        let most = got.iter().fold(0.0f32, |most, s| most.max(s.weight));
        share = share.max(0.01 / f64::from(most));
    }
    keep("N2b", share);
}

#[test]
fn n3_larger_than_the_volume() {
    let gpu = Device::boot();
    let (mut ulps, mut pairs) = (0.0f64, 0.0f64);
    let slots = bricks().len() as f64;
    for kernel in KERNELS {
        let huge = one([7.3, 8.1, 5.5], [1e4f32.ln(); 3], 0.0, 1000.0);
        for s in sample(&gpu, &[huge], &Field { epsilon: 0.0, ..field(kernel, 0.0) }, &bricks(), [0.2; 3]) {
            ulps = ulps.max(f64::from((s.hu.to_bits() as i32 - 1000f32.to_bits() as i32).abs()));
        }
        let buffer = gpu.upload("splats", "test", &[huge]).expect("splats");
        let mut raster =
            engine::passes::Rasterizer::new(&gpu, kernel, 0.0, &bricks(), 1).expect("a rasterizer");
        raster.rasterize(&buffer, [0.2; 3]).expect("samples");
        pairs = pairs.max(f64::from(raster.pair_totals.read().expect("totals")[0]) / slots);
    }
    keep("N3a", ulps);
    keep("N3b", pairs);
}

/// The largest |q - q64| of needles and discs within 3 σ, with the footprint of the device and the arithmetic of the
/// kernel.
fn off(gpu: &Device, splats: &[Splat]) -> f64 {
    let mut rng = random(45);
    let targets = vec![Target::new(0.0, 1.0); bricks().len() * SAMPLES];
    let pass =
        step::run_with(gpu, &bricks(), splats, &targets, Kernel::Gaussian, [0.0; 3], &step::terms(false));
    let mut worst = 0.0f64;
    for (s, f) in splats.iter().zip(&pass.footprints) {
        let exact = reference::Splat::from(s);
        // The quaternion is unit to f32 only; its matrix is a rotation to as much, on both sides alike.
        let axes = DMat3::from_quat(exact.rotation);
        for _ in 0..30 {
            let z: [f64; 3] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
            let along = DVec3::from_array(z).normalize() * rng.random_range(0.0..3.0);
            let d = (axes * (exact.log_scale.exp() * along)).as_vec3();
            let want = (splat_bounds::whitening(&exact) * d.as_dvec3()).length_squared();
            let u = [
                f.t_x[0] * d.x + f.t_x[1] * d.y + f.t_x[2] * d.z,
                f.t_y[0] * d.y + f.t_y[1] * d.z,
                f.t_z * d.z,
            ];
            let q = u[0] * u[0] + u[1] * u[1] + u[2] * u[2];
            assert!(q.is_finite() && q >= 0.0);
            worst = worst.max((f64::from(q) - want).abs());
        }
    }
    worst
}

/// Needles, discs and what is between, the first along the axes, a hundred turned.
fn needles(ratio: f32) -> Vec<Splat> {
    let mut rng = random(44);
    (0..101)
        .map(|k| {
            let long = ratio.ln();
            let log_scale = [[long, 0.0, 0.0], [0.0, long, long], [long, 0.5 * long, 0.0]][k % 3];
            let turned = if k == 0 { IDENTITY } else { rotation(&mut rng) };
            Splat { rotation: turned, ..one([4.0; 3], log_scale, 0.0, 1.0) }
        })
        .collect()
}

#[test]
fn n4_needles_and_discs() {
    let gpu = Device::boot();
    for (id, ratio) in [("N4a", 1f32), ("N4b", 10.0), ("N4c", 100.0), ("N4d", 1000.0), ("N4e", 1e4)] {
        keep(id, off(&gpu, &needles(ratio)));
    }
    // Beyond that the reader widens them, and says how many.
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("needles.ply");
    let (mut worst, mut unsaid) = (0.0f64, 0);
    for ratio in [1e5f32, 1e6] {
        let set = SplatSet { splats: needles(ratio), ..SplatSet::default() };
        write(&path, &set, true).expect("a file");
        let read = engine::splat::read(&path, &ReadOptions::default()).expect("needles");
        unsaid += set.splats.len() - describe(&path, &ReadOptions::default()).expect("a summary").widened;
        assert!(
            read.splats.iter().zip(&set.splats).all(|(a, b)| a.log_scale == limit_anisotropy(b.log_scale))
        );
        worst = worst.max(off(&gpu, &read.splats));
    }
    keep("N4f", worst);
    keep("N4g", unsaid as f64);
}

#[test]
fn n16_the_step_at_the_cut_off() {
    let gpu = Device::boot();
    let at = |kernel: Kernel, q: f32| {
        // One splat beside the sample (8, 8, 6), σ = 1, so that q is the squared distance; α = 1/2.
        let splat = one([8.0 + q.sqrt(), 8.0, 6.0], [0.0; 3], 0.0, 1.0);
        let samples = [UVec3::new(8, 8, 6)];
        let bricks = Bricks::of_box(IVec3::ZERO, EXTENT, |v| samples.contains(&v));
        f64::from(sample(&gpu, &[splat], &field(kernel, 0.0), &bricks, [0.0; 3])[0].weight)
    };
    let step = (-4.5f64).exp();
    let density = step / std::f64::consts::TAU.powf(1.5);
    for (kernel, step, id) in
        [(Kernel::Compact, 0.0, "N16a"), (Kernel::Gaussian, step, "N16b"), (Kernel::Density, density, "N16c")]
    {
        let support = kernel.support_q() as f32;
        let (inside, outside) = (at(kernel, support * 0.9999), at(kernel, support * 1.0001));
        assert_eq!(outside, 0.0, "{}", kernel.name());
        assert!((inside / 0.5 - step).abs() < 1e-5, "{}: {inside} for {step}", kernel.name());
        keep(id, inside / 0.5);
    }
}

#[test]
fn n17_quaternions() {
    let gpu = Device::boot();
    let mut differ = 0;
    for kernel in KERNELS {
        let scene = Scene::random(17, 60, kernel, false);
        let splats = scene.splats.iter().map(|s| Splat { rotation: s.rotation.map(|v| -v), ..*s }).collect();
        let negative = Scene { splats, ..scene.clone() };
        let (a, b) =
            (step::run(&gpu, &scene, &step::terms(false)), step::run(&gpu, &negative, &step::terms(false)));
        let samples = a.reconstructions.iter().zip(&b.reconstructions).filter(|(a, b)| a != b).count();
        differ += samples + a.gradients.iter().zip(&b.gradients).filter(|(a, b)| a != b).count();
    }
    keep("N17a", differ as f64);
    // Sets come into a fit through `to_voxel`, which makes unit quaternions of them.
    let case = Case::ball(18, 6.0, FitConfig { iterations: 3, ..FitConfig::default() });
    let fitted = |rotation: [f32; 4]| {
        let splats = case.start().into_iter().map(|s| Splat { rotation, ..s }).collect();
        let set = SplatSet { splats, ..SplatSet::default() };
        let start = set.to_voxel(&DAffine3::IDENTITY);
        for s in &start {
            let length = s.rotation.iter().map(|v| f64::from(*v).powi(2)).sum::<f64>();
            assert!((length - 1.0).abs() < 1e-6, "{rotation:?} became {:?}", s.rotation);
        }
        let mut fitter = case.fitter(&gpu, &start);
        case.run(&mut fitter, 3);
        assert_eq!(fitter.frozen().expect("a count"), 0);
        fitter.splats().expect("splats")
    };
    let unit = [0.5, -0.5, 0.5, 0.5];
    let expected = fitted(unit);
    let differ = |other: &[Splat], expected: &[Splat]| -> usize {
        other.iter().zip(expected).filter(|(a, b)| a != b).count()
    };
    let mut wrong = 0;
    for factor in [2.0, 1e-18, 1e18] {
        wrong += differ(&fitted(unit.map(|v| v * factor)), &expected);
    }
    let back = |s: Splat| Splat { rotation: s.rotation.map(|v| -v), ..s };
    wrong += differ(&fitted(unit.map(|v: f32| -v)).into_iter().map(back).collect::<Vec<_>>(), &expected);
    let none = fitted(IDENTITY);
    for lost in [[0.0; 4], [1e-30, 0.0, 0.0, 0.0], [1e30, 0.0, 0.0, 0.0]] {
        wrong += differ(&fitted(lost), &none);
    }
    keep("N17b", wrong as f64);
}
