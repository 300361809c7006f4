//! What splats add up to: constants, opacities from 0 to 1, places that none reaches, a million on one spot.

use engine::passes::Rasterizer;
use engine::splat::{Activations, Field, Kernel, Splat};
use engine::volume::Bricks;
use engine::volume::bricks::SAMPLES;
use glam::{IVec3, UVec3};
use rand::RngExt;
use rand::seq::SliceRandom;
use reference::{Samples, splat_bounds, splat_to_volume};
use vgs_tests::numerics::keep;
use vgs_tests::sampling::{KERNELS, bricks, fainter, field, one, sample, some_splats};
use vgs_tests::scene::{EPSILON, random};
use vgs_tests::{Device, step};

/// How many of the samples are something.
fn count<T>(all: &[T], what: impl Fn(&T) -> bool) -> f64 {
    all.iter().filter(|s| what(s)).count() as f64
}

/// W and V̂ in HU in f64, of the samples that take part.
fn truth(splats: &[Splat], field: &Field, bricks: &Bricks, offset: [f32; 3]) -> Vec<(f64, f64)> {
    let footprints: Vec<_> = splats
        .iter()
        .map(|s| {
            splat_bounds::footprint(
                &(&Splat { intensity: s.intensity - field.background, ..*s }).into(),
                field.kernel,
            )
        })
        .collect();
    let positions = Samples::all(bricks, offset).positions();
    let got =
        splat_to_volume::splat_to_volume(&footprints, &positions, field.kernel, f64::from(field.epsilon));
    let active = |i: &usize| bricks.is_active(i / SAMPLES, i % SAMPLES);
    (0..got.len())
        .filter(active)
        .map(|i| (got[i].weight, got[i].value + f64::from(field.background)))
        .collect()
}

#[test]
fn n1_constants() {
    let gpu = Device::boot();
    let (mut background_off, mut constant_off, mut share_off) = (0.0, 0.0, 0.0f64);
    for kernel in KERNELS {
        let mut splats = some_splats(1, 80);
        for hu in [40.0f32, -1024.0, 0.1, 3071.0] {
            splats.iter_mut().for_each(|s| s.intensity = hu);
            let got = sample(&gpu, &splats, &field(kernel, hu), &bricks(), [0.1; 3]);
            background_off += count(&got, |s| s.hu != hu);
        }
        for (hu, factor) in [(1040.0, 1.0), (-1024.0, 1e-6), (3071.0, 1e-30), (40.0, 0.3)] {
            let constant: Vec<Splat> =
                fainter(&splats, factor).into_iter().map(|s| Splat { intensity: hu, ..s }).collect();
            let free = Field { epsilon: 0.0, ..field(kernel, 200.0) };
            let got = sample(&gpu, &constant, &free, &bricks(), [0.1; 3]);
            constant_off += count(&got, |s| s.weight > 0.0 && s.hu != hu);
            assert!(count(&got, |s| s.weight > 0.0) > 1000.0, "the splats cover the grid");
        }
        splats.iter_mut().for_each(|s| s.intensity = 1040.0);
        for s in sample(&gpu, &splats, &field(kernel, 40.0), &bricks(), [0.1; 3]) {
            let w = f64::from(s.weight);
            let wanted = 40.0 + 1000.0 * w / (w + f64::from(EPSILON));
            share_off = share_off.max((f64::from(s.hu) - wanted).abs());
        }
    }
    keep("N1a", background_off);
    keep("N1b", constant_off);
    keep("N1c", share_off);
}

#[test]
fn n5_opacities() {
    let gpu = Device::boot();
    // Within 200 HU, where an f32 has steps of 2e-5 HU and less.
    let splats: Vec<Splat> =
        some_splats(5, 60).into_iter().map(|s| Splat { intensity: s.intensity * 0.05, ..s }).collect();
    let alpha = |opacity: f32| {
        let set = |s: &Splat| {
            let mut s = *s;
            s.set_opacity(opacity);
            s
        };
        splats.iter().map(set).collect::<Vec<_>>()
    };
    let logit = |opacity_logit: f32| splats.iter().map(|s| Splat { opacity_logit, ..*s }).collect::<Vec<_>>();
    let targets = vec![shaders_glsl::types::Target::new(0.1, 1.0); bricks().len() * SAMPLES];
    let (mut unfit, mut apart) = (0.0, 0.0f64);
    for kernel in KERNELS {
        let free = Field { epsilon: 0.0, ..field(kernel, 50.0) };
        let half = sample(&gpu, &alpha(0.5), &free, &bricks(), [0.2; 3]);
        let sets = [0.0, 1e-30, 1e-7, 0.5, 1.0 - 6e-8, 1.0].map(alpha);
        let raw = [16.0, -16.0, 50.0, -50.0, 80.0, -80.0, 200.0, -200.0].map(logit);
        for (set, raw) in sets.iter().map(|s| (s, false)).chain(raw.iter().map(|s| (s, true))) {
            let got = sample(&gpu, set, &free, &bricks(), [0.2; 3]);
            unfit += count(&got, |s| !s.hu.is_finite() || !(0.0..=1.0).contains(&s.occupancy));
            let spans: Vec<Splat> =
                set.iter().map(|s| Splat { intensity: s.intensity / 4095.0, ..*s }).collect();
            let pass =
                step::run_with(&gpu, &bricks(), &spans, &targets, kernel, [0.2; 3], &step::terms(false));
            let gradients: &[f32] = bytemuck::cast_slice(&pass.gradients);
            unfit += count(gradients, |v| !v.is_finite());
            // An opacity of e^-80 is no normal number times κ, and may be flushed.
            if raw && set[0].opacity_logit < -60.0 {
                continue;
            }
            for (a, b) in half.iter().zip(&got) {
                // At the rim, κ times the least opacity is no normal number.
                if a.weight > 1e-5 {
                    apart = apart.max(f64::from((a.hu - b.hu).abs()));
                }
            }
        }
    }
    keep("N5a", unfit);
    keep("N5b", apart);
}

#[test]
fn n6_all_opacities_scaled() {
    let gpu = Device::boot();
    let (mut free_change, mut share) = (0.0f64, 0.0f64);
    for kernel in KERNELS {
        let splats = some_splats(2, 60);
        let background = 1000.0;
        let range = 4000.0;
        for epsilon in [0.0, EPSILON] {
            let field = Field { epsilon, ..field(kernel, background) };
            let full = sample(&gpu, &splats, &field, &bricks(), [0.0; 3]);
            for k in [0.5, 1e-3, 1e-6] {
                let got = sample(&gpu, &fainter(&splats, k), &field, &bricks(), [0.0; 3]);
                for (a, b) in full.iter().zip(&got).filter(|(a, _)| a.weight > 0.0) {
                    let changed = f64::from((a.hu - b.hu).abs());
                    assert!((-1001.0..=3001.0).contains(&b.hu), "k = {k}: {}", b.hu);
                    if epsilon == 0.0 {
                        free_change = free_change.max(changed);
                    } else {
                        let epsilon = f64::from(epsilon);
                        // Twice the steps of an f32 at the ends of the range, besides.
                        let documented = range * epsilon / (k * f64::from(a.weight) + epsilon) + 5e-4;
                        share = share.max(changed / documented);
                    }
                }
            }
        }
    }
    keep("N6a", free_change);
    keep("N6b", share);
}

#[test]
fn n7_no_splat() {
    let gpu = Device::boot();
    let mut wrong = 0.0;
    for kernel in KERNELS {
        for epsilon in [0.0, EPSILON] {
            let background = -123.456;
            let field = Field { epsilon, ..field(kernel, background) };
            let corner = one([1.0, 1.0, 1.0], [0.0; 3], 2.0, 900.0);
            let got = sample(&gpu, &[corner], &field, &bricks(), [0.0; 3]);
            let reached: Vec<bool> =
                truth(&[corner], &field, &bricks(), [0.0; 3]).iter().map(|(w, _)| *w > 0.0).collect();
            wrong += got
                .iter()
                .zip(&reached)
                .filter(|(s, reached)| **reached != (s.weight > 0.0) || !**reached && s.hu != background)
                .count() as f64;
            assert!(got.iter().any(|s| s.hu > 800.0) && reached.iter().any(|r| !r));
            let outside = one([1.0, 1.0, -90.0], [0.0; 3], 2.0, 900.0);
            for splats in [vec![], vec![outside]] {
                let got = sample(&gpu, &splats, &field, &bricks(), [0.4; 3]);
                wrong += count(&got, |s| s.hu != background || s.occupancy != 0.0 || s.weight != 0.0);
            }
        }
    }
    keep("N7a", wrong);
}

#[test]
fn n8_weights_that_vanish() {
    let gpu = Device::boot();
    let mut off = 0.0f64;
    for kernel in KERNELS {
        let field = field(kernel, 40.0);
        for (sigma, distances) in [(0.5f32, 20.0), (0.3, 50.0)] {
            let splat = one([2.0, 2.0, 2.0], [sigma.ln(); 3], 5.0, 1040.0);
            let positions = Samples::all(&bricks(), [0.0; 3]).positions();
            let far = |i: usize| (positions[i] - 2.0).length() >= distances * f64::from(sigma);
            let got = sample(&gpu, &[splat], &field, &bricks(), [0.0; 3]);
            let wanted = truth(&[splat], &field, &bricks(), [0.0; 3]);
            let places = (0..positions.len()).filter(|&i| bricks().is_active(i / SAMPLES, i % SAMPLES));
            let far: Vec<_> = places.zip(got.iter().zip(wanted)).filter(|(i, _)| far(*i)).collect();
            assert!(!far.is_empty(), "some samples are {distances} σ away");
            off = far.iter().fold(off, |off, (_, (s, (_, hu)))| off.max((f64::from(s.hu) - hu).abs()));
        }
        for logit in [-69.0, -87.0, -103.0, -200.0] {
            let splats: Vec<Splat> =
                some_splats(8, 30).into_iter().map(|s| Splat { opacity_logit: logit, ..s }).collect();
            let got = sample(&gpu, &splats, &field, &bricks(), [0.1; 3]);
            for (s, (_, hu)) in got.iter().zip(truth(&splats, &field, &bricks(), [0.1; 3])) {
                off = off.max((f64::from(s.hu) - hu).abs());
            }
        }
    }
    keep("N8", off);
}

/// A million: the scenarios of one spot and of one voxel.
const MILLION: usize = 1_000_000;

#[test]
fn n9_a_million_on_one_spot() {
    let gpu = Device::boot();
    // σ of half a voxel reaches few samples, and a logit of −2.197 is an opacity of 0.1.
    let splat = one([1.2, 2.4, 3.6], [-0.6; 3], -2.197, 1000.0);
    let bricks = Bricks::of_box(IVec3::ZERO, UVec3::splat(8), |_| true);
    let mut rng = random(9);
    let random: Vec<Splat> =
        (0..MILLION).map(|_| Splat { intensity: rng.random_range(-1024.0f32..3071.0), ..splat }).collect();
    let mean = random.iter().map(|s| f64::from(s.intensity)).sum::<f64>() / MILLION as f64;
    let (mut equal_off, mut random_off, mut weight_off) = (0.0f64, 0.0f64, 0.0f64);
    for kernel in [Kernel::Compact, Kernel::Gaussian] {
        let field = field(kernel, 0.0);
        // W of one splat; a million have a million times that.
        let alone: Vec<f64> = truth(&[splat], &field, &bricks, [0.0; 3]).iter().map(|(w, _)| *w).collect();
        for (splats, mean, off) in
            [(vec![splat; MILLION], 1000.0, &mut equal_off), (random.clone(), mean, &mut random_off)]
        {
            let got = sample(&gpu, &splats, &field, &bricks, [0.0; 3]);
            let mut reached = 0;
            // At the rim of the support the rounding of q decides on w.
            for (s, w) in got.iter().zip(&alone).filter(|(_, w)| **w > 1e-4) {
                reached += 1;
                let total = w * MILLION as f64;
                let wanted = mean * total / (total + f64::from(EPSILON));
                // Exact is the nearest float.
                *off = off.max(f64::from(s.hu - wanted as f32).abs());
                weight_off = weight_off.max((f64::from(s.weight) / total - 1.0).abs());
            }
            assert!(reached >= 8, "{reached} samples");
        }
    }
    keep("N9a", equal_off);
    keep("N9b", random_off);
    keep("N9c", weight_off);
}

#[test]
fn n10_a_million_in_one_voxel() {
    let gpu = Device::boot();
    let mut rng = random(10);
    let bricks = Bricks::of_box(IVec3::ZERO, UVec3::splat(8), |_| true);
    let mut splats: Vec<Splat> = (0..MILLION)
        .map(|_| {
            let mean = [0; 3].map(|_| rng.random_range(3.5f32..4.5));
            let log_scale = [0; 3].map(|_| rng.random_range(-0.9f32..-0.5));
            one(mean, log_scale, rng.random_range(-3.0..3.0), rng.random_range(-0.5..0.5))
        })
        .collect();
    let run = |splats: &[Splat]| {
        let mut raster =
            Rasterizer::new(&gpu, Kernel::Compact, EPSILON, &bricks, MILLION).expect("a rasterizer");
        let buffer = gpu.upload("splats", "test", splats).expect("splats");
        let samples = raster.rasterize(&buffer, [0.0; 3]).expect("samples");
        (samples, raster.pair_totals.read().expect("totals")[0])
    };
    let (first, pairs) = run(&splats);
    let wanted = truth(&splats, &field(Kernel::Compact, 0.0), &bricks, [0.0; 3]);
    // Every sample of one brick takes part, so both lists have them all, in memory order.
    assert_eq!(first.len(), wanted.len());
    let mut off = 0.0f64;
    for (got, (w, v)) in first.iter().zip(&wanted).filter(|(_, (w, _))| *w > 1.0) {
        off = off.max((f64::from(got.weight) / w - 1.0).abs()).max((f64::from(got.value) - v).abs());
    }
    splats.shuffle(&mut rng);
    let (second, _) = run(&splats);
    // In units of the last place of the sums.
    let mut apart = 0.0f64;
    for (a, b) in first.iter().zip(&second).filter(|(a, _)| a.weight > 1.0) {
        apart = apart.max(f64::from((a.weight / b.weight - 1.0).abs()) / f64::from(f32::EPSILON));
    }
    keep("N10a", f64::from(pairs.abs_diff(MILLION as u32)));
    keep("N10b", off);
    keep("N10c", apart / (4.0 * (MILLION as f64).sqrt()));
}
