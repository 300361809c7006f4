//! What must hold without any reference: P1 to P7 and the scenarios N1 to N19 of the numerics notes, as far as they
//! concern the field and the fit's step. Intensities are in HU and sampled through `fit::evaluate::Sampler`.
#![forbid(unsafe_code)]

use engine::fit::evaluate::{FieldSample, Sampler};
use engine::gpu::Gpu;
use engine::passes::adam::State;
use engine::passes::{Adam, Gradient, Rasteriser, Shape};
use engine::reference::{Footprint, Samples, splat_bounds, splat_to_volume};
use engine::splat::kernel::LN_PEAK_MAX;
use engine::splat::{Field, Kernel, Splat};
use engine::volume::Bricks;
use engine::volume::bricks::SAMPLES;
use glam::{DVec3, IVec3, UVec3, Vec3};
use rand::RngExt;
use rand::seq::SliceRandom;
use shaders_glsl::types::{AdamParams, SplatGrad, Target};
use vgs_tests::scene::{EPSILON, random, rotation, splat};
use vgs_tests::storage::STORAGES;
use vgs_tests::{Bound, Device, Scene, assert_close, step};

const KERNELS: [Kernel; 3] = [Kernel::Compact, Kernel::Gaussian, Kernel::Density];
const IDENTITY: [f32; 4] = [1.0, 0.0, 0.0, 0.0];
const EXTENT: UVec3 = UVec3::new(20, 17, 12);

fn bricks() -> Bricks {
    Bricks::of_box(IVec3::ZERO, EXTENT, |_| true)
}

fn field(kernel: Kernel, background: f32) -> Field {
    Field { kernel, background, epsilon: EPSILON, occupancy_w0: 0.05 }
}

/// All samples that take part.
fn sample(gpu: &Gpu, splats: &[Splat], field: &Field, bricks: &Bricks, offset: [f32; 3]) -> Vec<FieldSample> {
    let mut sampler = Sampler::new(gpu, splats, field, bricks).expect("a sampler");
    let all = sampler.sample(offset).expect("samples");
    let active = |i: &usize| bricks.is_active(i / SAMPLES, i % SAMPLES);
    (0..all.len()).filter(active).map(|i| all[i]).collect()
}

/// W from O = W / (W + w0).
fn weight(s: &FieldSample) -> f64 {
    let o = f64::from(s.occupancy);
    0.05 * o / (1.0 - o)
}

fn some_splats(seed: u64, count: usize) -> Vec<Splat> {
    let mut rng = random(seed);
    let hu = |s: Splat| Splat { intensity: s.intensity * 4000.0 + 1000.0, ..s };
    (0..count).map(|_| hu(splat(&mut rng, EXTENT.as_vec3()))).collect()
}

fn one(mean: [f32; 3], log_scale: [f32; 3], opacity_logit: f32, intensity: f32) -> Splat {
    Splat { mean, opacity_logit, rotation: IDENTITY, log_scale, intensity }
}

/// P1: V̂ lies between the least and the greatest of the intensities and the background.
#[test]
fn p1_values_stay_in_the_hull_of_the_intensities() {
    let gpu = Device::boot();
    for kernel in KERNELS {
        for seed in 0..5 {
            let splats = some_splats(seed, 60);
            let background = 500.0;
            let (low, high) = splats
                .iter()
                .fold((background, background), |(l, h), s| (s.intensity.min(l), s.intensity.max(h)));
            let slack = (high - low) * 1e-6;
            for s in sample(&gpu, &splats, &field(kernel, background), &bricks(), [0.3, -0.2, 0.1]) {
                assert!((low - slack..=high + slack).contains(&s.hu), "{} not in {low}..{high}", s.hu);
                assert!((0.0..=1.0).contains(&s.occupancy));
            }
        }
    }
}

/// P2, N1: splats that all have the background's intensity give exactly that, wherever and whatever they are. Other
/// constants are pulled towards the background by ε / (W + ε) and by nothing else.
#[test]
fn p2_constants_are_reproduced() {
    let gpu = Device::boot();
    for kernel in KERNELS {
        let mut splats = some_splats(1, 80);
        for background in [40.0f32, -1024.0, 0.1, 3071.0] {
            splats.iter_mut().for_each(|s| s.intensity = background);
            let got = sample(&gpu, &splats, &field(kernel, background), &bricks(), [0.1; 3]);
            assert!(got.iter().all(|s| s.hu == background), "{background} HU exactly");
        }
        splats.iter_mut().for_each(|s| s.intensity = 1040.0);
        let got = sample(&gpu, &splats, &field(kernel, 40.0), &bricks(), [0.1; 3]);
        let pairs = got.iter().map(|s| {
            let w = weight(s);
            (f64::from(s.hu), 40.0 + 1000.0 * w / (w + f64::from(EPSILON)))
        });
        // W is taken back out of O: near O = 1 it is known to a few parts in a million only.
        assert_close(&format!("N1, {}", kernel.name()), Bound::new(2e-3, 2e-6), pairs);
    }
}

/// P3, N6: all opacities times k change V̂ by at most the share that ε has, range · ε / (k W + ε).
#[test]
fn p3_opacities_may_be_scaled() {
    let gpu = Device::boot();
    for kernel in KERNELS {
        let splats = some_splats(2, 60);
        let background = 1000.0;
        let full = sample(&gpu, &splats, &field(kernel, background), &bricks(), [0.0; 3]);
        let range = 4000.0;
        for k in [0.5, 1e-3, 1e-6] {
            let scaled: Vec<Splat> = splats
                .iter()
                .map(|s| {
                    let alpha = k / (1.0 + (-f64::from(s.opacity_logit)).exp());
                    Splat { opacity_logit: (alpha / (1.0 - alpha)).ln() as f32, ..*s }
                })
                .collect();
            let got = sample(&gpu, &scaled, &field(kernel, background), &bricks(), [0.0; 3]);
            let mut worst = 0.0f64;
            for (a, b) in full.iter().zip(&got) {
                let changed = f64::from((a.hu - b.hu).abs());
                let epsilon = f64::from(EPSILON);
                // W from O to a few parts in a million; logits rounded to f32 move α by as much.
                let bound = range * epsilon / (k * weight(a) + epsilon) + range * 1e-5;
                worst = worst.max(changed / bound);
                assert!(changed <= bound, "k = {k}: {} became {}", a.hu, b.hu);
                assert!((-1001.0..=3001.0).contains(&b.hu));
            }
            println!("P3 {}: k = {k:e}: at most {worst:.3} of the bound", kernel.name());
        }
    }
}

/// P4: a field that is moved by whole voxels together with its grid has the same bits.
#[test]
fn p4_translation_by_whole_voxels_changes_no_bit() {
    let gpu = Device::boot();
    let shift = IVec3::new(64, -128, 256);
    for kernel in KERNELS {
        // Means on a grid of 2⁻¹⁰ voxels: moving them is exact.
        let splats: Vec<Splat> = some_splats(3, 60)
            .into_iter()
            .map(|s| Splat { mean: s.mean.map(|v| (v * 1024.0).round() / 1024.0), ..s })
            .collect();
        let moved: Vec<Splat> = splats
            .iter()
            .map(|s| Splat { mean: (Vec3::from(s.mean) + shift.as_vec3()).to_array(), ..*s })
            .collect();
        let far = Bricks { origin: shift, ..bricks() };
        let here = sample(&gpu, &splats, &field(kernel, 0.0), &bricks(), [0.25, 0.0, -0.4]);
        let there = sample(&gpu, &moved, &field(kernel, 0.0), &far, [0.25, 0.0, -0.4]);
        assert!(here == there);
        assert!(here.iter().any(|s| s.hu != 0.0));
    }
}

/// P5, N19: the order of splats changes rounding only: 4 ulp · √n of the sums.
#[test]
fn p5_permutation_changes_rounding_only() {
    let gpu = Device::boot();
    let mut rng = random(77);
    for kernel in KERNELS {
        let scene = Scene::random(4, 90, kernel, false);
        let first = step::run(&gpu, &scene, &step::terms(false));
        let bound = 4.0 * f64::from(f32::EPSILON) * (scene.splats.len() as f64).sqrt();
        let mut order: Vec<usize> = (0..scene.splats.len()).collect();
        for turn in 0..10 {
            order.shuffle(&mut rng);
            let shuffled = Scene {
                splats: order.iter().map(|&i| scene.splats[i]).collect(),
                bricks: scene.bricks.clone(),
                targets: scene.targets.clone(),
                ..scene
            };
            let again = step::run(&gpu, &shuffled, &step::terms(false));
            let samples = first.reconstructions.iter().zip(&again.reconstructions);
            let weights = samples.clone().map(|(a, b)| (f64::from(b.weight), f64::from(a.weight)));
            assert_close(&format!("N19 {turn}: W"), Bound::new(bound, bound), weights);
            let values = samples.map(|(a, b)| (f64::from(b.value), f64::from(a.value)));
            assert_close(&format!("N19 {turn}: V"), Bound::new(bound, bound), values);
        }
        // The same order is the same bits.
        let same = step::run(&gpu, &scene, &step::terms(false));
        assert!(same.reconstructions == first.reconstructions && same.gradients == first.gradients);
    }
}

/// P6, N5, N17, N27: every parameter within its limits gives a finite value, a finite gradient and finite sums.
#[test]
fn p6_extreme_parameters_stay_finite() {
    let gpu = Device::boot();
    let bricks = bricks();
    // Inside and outside by turns, so that every term has something to sum.
    let targets: Vec<Target> =
        (0..bricks.len() * SAMPLES).map(|i| Target::new(0.1, (i % 2) as f32)).collect();
    let mut rng = random(6);
    let middle = [9.5, 8.2, 6.1];
    let base = one(middle, [0.0; 3], 0.0, 0.3);
    let mut rows: Vec<(String, Splat)> = Vec::new();
    for logit in [-200.0, -103.0, -88.0, -16.1, 16.6, 88.0, 200.0, f32::MAX, f32::MIN] {
        rows.push((format!("logit {logit}"), Splat { opacity_logit: logit, ..base }));
    }
    let limit = engine::splat::activation::LOG_SCALE_LIMIT;
    for log in [-limit, -20.0, -3.0, 3.0, 20.0, limit] {
        rows.push((format!("log scale {log}"), Splat { log_scale: [log; 3], ..base }));
        rows.push((
            format!("log scale {log} turned"),
            Splat { log_scale: [log; 3], rotation: rotation(&mut rng), ..base },
        ));
    }
    for ratio in [1e2f32, 1e3, 1e4] {
        for k in 0..20 {
            let half = ratio.ln() / 2.0;
            let log_scale = [[half, -half, 0.0], [-half, half, half], [-half, -half, half]][k % 3];
            let turned = Splat { log_scale, rotation: rotation(&mut rng), ..base };
            rows.push((format!("anisotropy {ratio}, {k}"), turned));
        }
    }
    for far in [1e3, -1e6, 1e30, f32::MAX, f32::MIN] {
        for axis in 0..3 {
            let mut mean = middle;
            mean[axis] = far;
            rows.push((format!("mean {far} on axis {axis}"), Splat { mean, ..base }));
            rows.push((
                format!("mean {far} on axis {axis}, large"),
                Splat { mean, log_scale: [limit; 3], ..base },
            ));
        }
    }
    for q in [[-1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, -1.0], [0.5, -0.5, 0.5, -0.5]] {
        rows.push((format!("quaternion {q:?}"), Splat { rotation: q, ..base }));
    }
    for kernel in KERNELS {
        // A few of a kind at a time, and all together.
        for rows in rows.chunks(6).chain([rows.as_slice()]) {
            let splats: Vec<Splat> = rows.iter().map(|r| r.1).collect();
            let name = format!("{} to {}", rows[0].0, rows[rows.len() - 1].0);
            let pass =
                step::run_with(&gpu, &bricks, &splats, &targets, kernel, [0.1, 0.2, 0.3], &step::terms(true));
            let context = format!("{name}, {}", kernel.name());
            let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
            assert!(finite(bytemuck::cast_slice(&pass.reconstructions)), "{context}: a sample");
            assert!(finite(bytemuck::cast_slice(&pass.adjoints)), "{context}: an adjoint");
            assert!(finite(bytemuck::cast_slice(&pass.gradients)), "{context}: a gradient");
            assert!(pass.sums.iter().all(|s| s.value.is_finite() && s.weight > 0.0), "{context}: a sum");
            let most = if kernel.row().unit_integral { LN_PEAK_MAX.exp() as f32 * 1.001 } else { 1.0 };
            assert!(
                pass.footprints.iter().all(|f| (0.0..=most).contains(&f.amplitude)),
                "{context}: amplitude"
            );
        }
    }
}

/// P6: random parameters in the whole range of the limits, many at a time.
#[test]
fn p6_random_parameters_stay_finite_and_in_the_hull() {
    let gpu = Device::boot();
    let bricks = bricks();
    let mut rng = random(66);
    for turn in 0..40 {
        let splats: Vec<Splat> = (0..200)
            .map(|_| {
                let log = rng.random_range(-9.0f32..9.0);
                Splat {
                    mean: std::array::from_fn(|axis| {
                        let wide = 10f32.powf(rng.random_range(0.0..5.0));
                        EXTENT.as_vec3()[axis] / 2.0 + rng.random_range(-1.0..1.0) * wide
                    }),
                    opacity_logit: rng.random_range(-100.0..100.0),
                    rotation: rotation(&mut rng),
                    log_scale: std::array::from_fn(|_| log + rng.random_range(-4.6..4.6)),
                    intensity: rng.random_range(-1024.0..3071.0),
                }
            })
            .collect();
        let kernel = KERNELS[turn % 3];
        for s in sample(&gpu, &splats, &field(kernel, 40.0), &bricks, [0.0; 3]) {
            assert!((-1024.1..=3071.1).contains(&s.hu), "turn {turn}: {}", s.hu);
            assert!((0.0..=1.0).contains(&s.occupancy), "turn {turn}: O {}", s.occupancy);
        }
    }
}

/// P7: W and V̂ of the device lie within bounds that follow from the rounding of each operation (twice the unit
/// roundoff for each, since Vulkan does not promise round-to-nearest; exp has 3 + 2|x| ulp).
#[test]
fn p7_the_device_keeps_the_bounds_of_its_arithmetic() {
    let gpu = Device::boot();
    let unit = 2f64.powi(-23);
    for kernel in KERNELS {
        let scene = Scene::random(8, 100, kernel, false);
        let pass = step::run(&gpu, &scene, &step::terms(false));
        let footprints: Vec<Footprint> = pass.footprints.iter().map(Into::into).collect();
        let (mut worst_w, mut worst_v, mut count) = (0.0f64, 0.0f64, 0);
        for (i, x) in scene.samples().positions().into_iter().enumerate() {
            if !scene.bricks.is_active(i / SAMPLES, i % SAMPLES) {
                continue;
            }
            let (mut w_sum, mut wc_sum, mut w_error, mut wc_error) = (0.0, 0.0, 0.0, 0.0);
            let (mut terms, mut doubtful) = (0.0, false);
            for f in &footprints {
                let d = x - f.mean;
                let u = f.whitening * d;
                let q = u.length_squared();
                // The position is rounded when the offset is added, the difference once more.
                let d_error = unit * (x.abs() + d.abs());
                let absolute =
                    |m: glam::DMat3| glam::DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
                let t = absolute(f.whitening);
                let u_error = t * d_error + 3.0 * unit * (t * d.abs());
                let q_error = 2.0 * u.abs().dot(u_error) + u_error.length_squared() + 3.0 * unit * q;
                if q - q_error > kernel.support_q() {
                    continue;
                }
                doubtful |= kernel != Kernel::Compact && (q - kernel.support_q()).abs() <= q_error;
                let w = splat_to_volume::weight(f, x, kernel);
                let k_error = match kernel {
                    Kernel::Compact => {
                        let (t, t_error) = ((1.0 - q / 6.0).max(0.0), q_error / 6.0 + 3.0 * unit);
                        (t + t_error).powi(3) - t.powi(3) + 2.0 * unit * t.powi(3)
                    }
                    Kernel::Gaussian | Kernel::Density => {
                        (-0.5 * q).exp() * (0.5 * q_error + (3.0 + q) * unit)
                    }
                };
                let error = f.amplitude * k_error + unit * w;
                w_sum += w;
                wc_sum += w * f.intensity;
                w_error += error;
                wc_error += (error + unit * w) * f.intensity.abs();
                terms += 1.0;
            }
            if doubtful {
                continue;
            }
            // Sums of n terms, one rounding each, of at most the sum of absolute values.
            w_error += terms * unit * w_sum;
            wc_error += terms * unit * 0.5 * w_sum;
            let divisor = w_sum + f64::from(EPSILON);
            let v = wc_sum / divisor;
            let v_error = (wc_error + v.abs() * (w_error + unit * divisor)) / divisor + 2.5 * unit * v.abs();
            let got = pass.reconstructions[i];
            let floor = 1e-37; // what may be flushed to zero
            worst_w = worst_w.max((f64::from(got.weight) - w_sum).abs() / (w_error + floor));
            worst_v = worst_v.max((f64::from(got.value) - v).abs() / (v_error + floor));
            count += 1;
        }
        println!(
            "P7 {}: {count} samples, W at {worst_w:.3} and V at {worst_v:.3} of the bound",
            kernel.name()
        );
        assert!(count > 10_000 && worst_w <= 1.0 && worst_v <= 1.0);
    }
}

/// N3: one splat of 10⁴ voxels is flat over the whole volume.
#[test]
fn n3_a_huge_splat_is_flat() {
    let gpu = Device::boot();
    for kernel in KERNELS {
        let huge = one([7.3, 8.1, 5.5], [1e4f32.ln(); 3], 0.0, 1000.0);
        let w = 0.5 * kernel.peak(huge.log_scale.map(f64::from));
        let expected = 1000.0 * w / (w + f64::from(EPSILON));
        for s in sample(&gpu, &[huge], &field(kernel, 0.0), &bricks(), [0.2; 3]) {
            assert!((f64::from(s.hu) - expected).abs() < 1e-3, "{} for {expected}", s.hu);
        }
    }
}

/// N4: q of needles and discs, with the footprint of the device and the arithmetic of the kernel.
#[test]
fn n4_whitened_distance_of_needles_and_discs() {
    let gpu = Device::boot();
    let mut rng = random(44);
    for (ratio, bound) in [(1f32, 1e-5), (10.0, 1e-4), (100.0, 1e-3), (1000.0, 1e-3), (1e4, 1e-2)] {
        let splats: Vec<Splat> = (0..101)
            .map(|k| {
                let long = ratio.ln();
                let log_scale = [[long, 0.0, 0.0], [0.0, long, long], [long, 0.5 * long, 0.0]][k % 3];
                let turned = if k == 0 { IDENTITY } else { rotation(&mut rng) };
                Splat { rotation: turned, ..one([4.0; 3], log_scale, 0.0, 1.0) }
            })
            .collect();
        let targets = vec![Target::new(0.0, 1.0); bricks().len() * SAMPLES];
        let pass = step::run_with(
            &gpu,
            &bricks(),
            &splats,
            &targets,
            Kernel::Gaussian,
            [0.0; 3],
            &step::terms(false),
        );
        let mut worst = 0.0f64;
        for (s, f) in splats.iter().zip(&pass.footprints) {
            let exact = engine::reference::Splat::from(s);
            // The quaternion is unit to f32 only; its matrix is a rotation to as much, on both sides alike.
            let axes = glam::DMat3::from_quat(exact.rotation);
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
        println!("N4: 1:{ratio}: {worst:.1e} of {bound:.0e}");
        assert!(worst <= bound, "anisotropy {ratio}: q is off by {worst}");
    }
}

/// N7: where no splat reaches, the background is exact and the occupancy is zero; also without any splat in the grid.
#[test]
fn n7_without_a_splat_there_is_the_background() {
    let gpu = Device::boot();
    for kernel in KERNELS {
        let background = -123.456;
        let corner = one([1.0, 1.0, 1.0], [0.0; 3], 2.0, 900.0);
        let got = sample(&gpu, &[corner], &field(kernel, background), &bricks(), [0.0; 3]);
        assert!(got.iter().filter(|s| s.hu == background && s.occupancy == 0.0).count() > got.len() / 2);
        assert!(got.iter().any(|s| s.hu > 800.0));
        let outside = one([1.0, 1.0, -90.0], [0.0; 3], 2.0, 900.0);
        for splats in [vec![], vec![outside]] {
            let got = sample(&gpu, &splats, &field(kernel, background), &bricks(), [0.4; 3]);
            assert!(got.iter().all(|s| s.hu == background && s.occupancy == 0.0), "{} splats", splats.len());
        }
    }
}

/// N9: splats on one spot add up: equal intensities come out, to the rounding of the sum.
#[test]
fn n9_coincident_splats() {
    let gpu = Device::boot();
    let splat = one([9.2, 8.4, 6.6], [0.3; 3], -2.197, 1000.0);
    let got = sample(&gpu, &vec![splat; 3000], &field(Kernel::Compact, 0.0), &bricks(), [0.0; 3]);
    let nearest = got.iter().max_by(|a, b| a.occupancy.total_cmp(&b.occupancy)).unwrap();
    // Two sums of n terms of one sign, each rounded by at most 2⁻²⁴ of the sum so far; ε is 4e-6 of W.
    let bound = 1000.0 * (3000.0 * 2f32.powi(-24) + 8e-6);
    println!("N9: {} for 1000, bound {bound}", nearest.hu);
    assert!((nearest.hu - 1000.0).abs() < bound, "{}", nearest.hu);
    let equal = Splat { intensity: 0.0, ..splat };
    let got = sample(&gpu, &vec![equal; 3000], &field(Kernel::Compact, 0.0), &bricks(), [0.0; 3]);
    assert!(got.iter().all(|s| s.hu == 0.0), "the background's own intensity is exact however many add up");
}

/// N16: at the cut-off the compact kernel has no step, the Gaussian ones of a·exp(-4.5).
#[test]
fn n16_the_step_at_the_cut_off() {
    let gpu = Device::boot();
    let at = |kernel: Kernel, q: f32| {
        // One splat beside the sample (8, 8, 6), σ = 1, so that q is the squared distance; α = 1/2.
        let splat = one([8.0 + q.sqrt(), 8.0, 6.0], [0.0; 3], 0.0, 1.0);
        let samples = [UVec3::new(8, 8, 6)];
        let bricks = Bricks::of_box(IVec3::ZERO, EXTENT, |v| samples.contains(&v));
        weight(&sample(&gpu, &[splat], &field(kernel, 0.0), &bricks, [0.0; 3])[0])
    };
    let step = 0.5 * (-4.5f64).exp();
    let density = step / std::f64::consts::TAU.powf(1.5);
    for (kernel, step) in [(Kernel::Compact, 0.0), (Kernel::Gaussian, step), (Kernel::Density, density)] {
        let support = kernel.support_q() as f32;
        let (inside, outside) = (at(kernel, support * 0.9999), at(kernel, support * 1.0001));
        assert_eq!(outside, 0.0, "{}", kernel.name());
        assert!((inside - step).abs() < 1e-5, "{}: {inside} for {step}", kernel.name());
    }
}

/// N17: q and -q are the same rotation, to the bit.
#[test]
fn n17_a_quaternion_and_its_negative_are_the_same() {
    let gpu = Device::boot();
    for kernel in KERNELS {
        let scene = Scene::random(17, 60, kernel, false);
        let negative = Scene {
            splats: scene.splats.iter().map(|s| Splat { rotation: s.rotation.map(|v| -v), ..*s }).collect(),
            bricks: scene.bricks.clone(),
            targets: scene.targets.clone(),
            ..scene
        };
        let (a, b) =
            (step::run(&gpu, &scene, &step::terms(false)), step::run(&gpu, &negative, &step::terms(false)));
        assert!(a.reconstructions == b.reconstructions && a.gradients == b.gradients);
    }
}

/// N18: a gradient that is not finite freezes its splat, is counted, and changes no bit of the others.
#[test]
fn n18_a_bad_gradient_touches_its_own_splat_only() {
    let gpu = Device::boot();
    let splats = some_splats(18, 200);
    let good: Vec<SplatGrad> = (0..200)
        .map(|i| SplatGrad {
            mean: [0.1, -0.2, 0.01 * i as f32],
            log_scale: [0.3; 3],
            intensity: -0.1,
            ..SplatGrad::default()
        })
        .collect();
    let params = AdamParams {
        splat_count: 200,
        chunk_count: 1,
        capacity: 1,
        beta1: 0.8,
        beta2: 0.9,
        correction1: 5.0,
        correction2: 10.0,
        epsilon: 1e-15,
        rate_mean: 0.2,
        rate_rotation: 0.1,
        rate_log_scale: 0.1,
        rate_opacity: 0.2,
        rate_intensity: 0.02,
        min_log_scale: -1.0,
        max_log_scale: 2.0,
        max_logit: 9.0,
        min_intensity: -5000.0,
        max_intensity: 5000.0,
        max_mean: [100.0; 3],
    };
    let step = |rows: &[SplatGrad]| {
        let mut adam = Adam::new(&gpu).unwrap();
        let mut state = State::zeroed(&gpu, 200).unwrap();
        state.splats.write_range(0, &splats).unwrap();
        let needs = gpu.buffer::<u32>("pair totals", "test", 1).unwrap();
        let gradients = gpu.upload("gradients", "test", rows).unwrap();
        let mut recorder = gpu.record().unwrap();
        adam.record(&mut recorder, &gradients, &mut state, &needs, &params);
        gpu.wait(recorder.submit().unwrap()).unwrap();
        let moments = (state.first.read().unwrap(), state.second.read().unwrap());
        (state.splats.read().unwrap(), moments, adam.frozen.read().unwrap()[0])
    };
    let (expected, moments, none) = step(&good);
    assert_eq!(none, 0);
    assert!(expected.iter().zip(&splats).all(|(a, b)| a != b), "every splat moves");
    for (at, poison) in [(0, f32::NAN), (63, f32::INFINITY), (64, f32::NEG_INFINITY), (199, 1e20)] {
        let mut bad = good.clone();
        bad[at].rotation[1] = poison;
        let (got, got_moments, frozen) = step(&bad);
        assert_eq!(frozen, 1, "{poison} is counted");
        for i in 0..200 {
            let wanted = if i == at { splats[i] } else { expected[i] };
            assert_eq!(got[i], wanted, "splat {i} beside {poison} at {at}");
            let wanted = if i == at { Default::default() } else { (moments.0[i], moments.1[i]) };
            assert_eq!((got_moments.0[i], got_moments.1[i]), wanted, "moments of splat {i}");
        }
    }
    // Gradients of 0 and 1e-30 are ordinary ones: no motion worth the name, nothing frozen.
    for tiny in [0.0, 1e-30] {
        let mut rows = good.clone();
        rows[5] = SplatGrad { mean: [tiny; 3], ..SplatGrad::default() };
        let (got, _, frozen) = step(&rows);
        assert_eq!(frozen, 0);
        assert!((0..3).all(|k| (got[5].mean[k] - splats[5].mean[k].clamp(-0.5, 100.0)).abs() < 1e-6));
    }
}

/// The twin's samples are those of the grid: what all the above rests on.
#[test]
fn positions_follow_the_bricks() {
    let bricks = bricks();
    let samples = Samples::all(&bricks, [0.25, -0.5, 0.0]);
    let positions = samples.positions();
    for slot in 0..bricks.len() {
        for morton in [0, 1, 7, 8, 100, 511] {
            let wanted = bricks.voxel(slot, morton).as_dvec3() + DVec3::new(0.25, -0.5, 0.0);
            assert_eq!(positions[slot * SAMPLES + morton], wanted);
        }
    }
}

/// Forward and backward pass have one shape for narrow devices and one for wide ones; a machine runs one of them, so
/// both are run here.
#[test]
fn both_shapes_of_the_passes_give_the_same_bits() {
    let gpu = Device::boot();
    let bricks = bricks();
    for (kernel, storage) in KERNELS.into_iter().flat_map(|kernel| STORAGES.map(|storage| (kernel, storage)))
    {
        let splats = some_splats(31, 301);
        let buffer = gpu.upload("splats", "test", &splats).expect("splats");
        let run = |shape| {
            let mut rasteriser =
                Rasteriser::with_shape(&gpu, kernel, EPSILON, &bricks, splats.len(), storage, shape)
                    .expect("a rasteriser");
            let samples = rasteriser.rasterise(&buffer, [0.2, -0.3, 0.4]).expect("samples");
            // Any adjoints will do: here W and V̂ themselves.
            let adjoints = &rasteriser.reconstructions;
            let mut gradient =
                Gradient::with_shape(&gpu, kernel, splats.len(), storage, shape).expect("a gradient");
            let mut recorder = gpu.record().expect("a recorder");
            let footprints = &rasteriser.bins.footprints;
            gradient
                .gather(&mut recorder, &rasteriser.grid, footprints, adjoints, 0, [0.2, -0.3, 0.4])
                .expect("the backward pass");
            gpu.wait(recorder.submit().expect("a submission")).expect("the end of it");
            (samples, gradient.moments.read().expect("moments"))
        };
        let ((narrow, narrow_moments), (wide, wide_moments)) = (run(Shape::OneByOne), run(Shape::SideBySide));
        assert!(narrow_moments.iter().filter(|m| **m != 0.0).count() > 1000, "the splats have moments");
        let bits = |rows: &[f32]| rows.iter().map(|m| m.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&narrow_moments), bits(&wide_moments));
        assert!(narrow.iter().filter(|r| r.weight > 1e-3).count() > 1000, "the splats cover the grid");
        for (i, (a, b)) in narrow.iter().zip(&wide).enumerate() {
            assert_eq!(
                (a.weight.to_bits(), a.value.to_bits()),
                (b.weight.to_bits(), b.value.to_bits()),
                "sample {i}"
            );
        }
    }
}
