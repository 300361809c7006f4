//! What must hold without any reference: properties of the field and of the
//! fit's step; `extremes` has the scenarios. Intensities are in HU and sampled through `fit::evaluate::Sampler`.

use engine::passes::WorkgroupShape;
use engine::passes::{Gradient, Rasterizer};
use engine::splat::kernel::LN_PEAK_MAX;
use engine::splat::{Kernel, Splat};
use engine::volume::Bricks;
use engine::volume::bricks::SAMPLES;
use glam::{DVec3, IVec3, Vec3};
use reference::{Footprint, Samples, splat_to_volume};
use shaders_glsl::types::Target;
use vgs_tests::sampling::{KERNELS, bricks, field, one, sample, some_splats};
use vgs_tests::scene::{EPSILON, random, rotation};
use vgs_tests::storage::STORAGES;
use vgs_tests::{Device, Scene, step};

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

/// P6: every parameter within its limits gives a finite value, a finite gradient and finite sums.
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
                doubtful |= (d.abs().max_element() - kernel.row().reach - 1e-3).abs() <= 1e-4;
                let w = splat_to_volume::weight(f, x, kernel);
                let k_error = match kernel {
                    Kernel::Compact => {
                        let (t, t_error) = ((1.0 - q / 6.0).max(0.0), q_error / 6.0 + 3.0 * unit);
                        (t + t_error).powi(3) - t.powi(3) + 2.0 * unit * t.powi(3)
                    }
                    Kernel::Gaussian | Kernel::Density => {
                        (-0.5 * q).exp() * (0.5 * q_error + (3.0 + q) * unit)
                    }
                    // Steepest where q is least; the gate is a second exp, a root and a quotient.
                    Kernel::Gated => {
                        let least = (q - q_error).max(0.0);
                        0.5 * kernel.slope(least) * q_error + kernel.value(least) * (12.0 + 2.0 * q) * unit
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

/// The samples of the reference implementations are those of the grid: what all the above rests on.
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
            let mut rasterizer =
                Rasterizer::with_shape(&gpu, kernel, EPSILON, &bricks, splats.len(), storage, shape)
                    .expect("a rasterizer");
            let samples = rasterizer.rasterize(&buffer, [0.2, -0.3, 0.4]).expect("samples");
            // Any adjoints will do: here W and V̂ themselves.
            let adjoints = &rasterizer.reconstructions;
            let mut gradient =
                Gradient::with_shape(&gpu, kernel, splats.len(), storage, shape).expect("a gradient");
            let mut recorder = gpu.record().expect("a recorder");
            let footprints = &rasterizer.bins.footprints;
            gradient
                .gather(&mut recorder, &rasterizer.grid, footprints, adjoints, 0, [0.2, -0.3, 0.4])
                .expect("the backward pass");
            gpu.wait(recorder.submit().expect("a submission")).expect("the end of it");
            (samples, gradient.moments.read().expect("moments"))
        };
        let ((narrow, narrow_moments), (wide, wide_moments)) =
            (run(WorkgroupShape::OneByOne), run(WorkgroupShape::SideBySide));
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
