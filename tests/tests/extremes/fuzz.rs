//! Random splats over the full range of f32: V̂ in the hull of the intensities, derivatives finite.

use std::cell::Cell;

use engine::splat::activation::{LOG_SCALE_LIMIT, limit_anisotropy};
use engine::splat::{Splat, SplatSet, defect};
use engine::volume::Bricks;
use engine::volume::bricks::SAMPLES;
use glam::{DAffine3, IVec3, UVec3};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed};
use rand::RngExt;
use rand_pcg::Pcg64;
use shaders_glsl::types::Target;
use vgs_tests::numerics::keep;
use vgs_tests::sampling::{KERNELS, field, sample};
use vgs_tests::scene::random;
use vgs_tests::{Device, step};

/// A finite float of any size.
fn any_float(rng: &mut Pcg64) -> f32 {
    loop {
        let v = f32::from_bits(rng.random());
        if v.is_finite() {
            return v;
        }
    }
}

/// Any splat that a file may hold: half of the parameters are random bits, half lie where they matter.
fn any_splat(rng: &mut Pcg64) -> Splat {
    loop {
        let mut either = |low: f32, high: f32| {
            if rng.random_bool(0.5) { any_float(rng) } else { rng.random_range(low..high) }
        };
        let mean = [0; 3].map(|_| either(-4.0, 12.0));
        let opacity_logit = either(-20.0, 20.0);
        let rotation = [0; 4].map(|_| either(-1.0, 1.0));
        let intensity = either(-1024.0, 3071.0);
        let log = rng.random_range(-LOG_SCALE_LIMIT..LOG_SCALE_LIMIT);
        let mut scale = || {
            let near = if rng.random_bool(0.7) {
                rng.random_range(-2.0f32..3.0)
            } else {
                log + rng.random_range(-12.0f32..12.0)
            };
            near.clamp(-LOG_SCALE_LIMIT, LOG_SCALE_LIMIT)
        };
        let splat =
            Splat { mean, opacity_logit, rotation, log_scale: [scale(), scale(), scale()], intensity };
        if defect(&splat).is_none() {
            return splat;
        }
    }
}

/// How far a value lies outside a range.
fn outside([low, high]: [f32; 2], v: f32) -> f64 {
    (f64::from(low) - f64::from(v)).max(f64::from(v) - f64::from(high)).max(0.0)
}

/// Splats at a time; 25 draws of them make 10⁵ cases.
const BATCH: usize = 4000;

#[test]
fn n27_any_parameters() {
    let gpu = Device::boot();
    let bricks = Bricks::of_box(IVec3::ZERO, UVec3::splat(8), |_| true);
    let targets: Vec<Target> = (0..SAMPLES).map(|i| Target::new(0.1, (i % 2) as f32)).collect();
    let (beyond, endless) = (Cell::new(0.0f64), Cell::new(0));
    let config =
        Config { cases: 25, rng_seed: RngSeed::Fixed(27), failure_persistence: None, ..Config::default() };
    proptest!(config, |(seed in any::<u64>(), kernel in 0usize..3)| {
        let mut rng = random(seed);
        // As files are read: unusable ones are dropped, needles widened, and `to_voxel` makes unit quaternions.
        let splats: Vec<Splat> = (0..BATCH)
            .map(|_| any_splat(&mut rng))
            .map(|s| Splat { log_scale: limit_anisotropy(s.log_scale), ..s })
            .collect();
        let voxel = SplatSet { splats, ..SplatSet::default() }.to_voxel(&DAffine3::IDENTITY);
        // Some alone, some together, all at once.
        for splats in [&voxel[..1], &voxel[1..40], &voxel[40..]] {
            let kernel = KERNELS[kernel];
            let (low, high) = splats.iter().fold((40.0f32, 40.0f32), |(low, high), s| {
                (low.min(s.intensity), high.max(s.intensity))
            });
            let width = f64::from(high) - f64::from(low);
            for s in sample(&gpu, splats, &field(kernel, 40.0), &bricks, [0.0; 3]) {
                let out = outside([low, high], s.hu) / (1e-6 * width);
                let sound = s.hu.is_finite() && (0.0..=1.0).contains(&s.occupancy);
                beyond.set(if sound { beyond.get().max(out) } else { f64::INFINITY });
            }
            // A fit keeps intensities within a few spans.
            let spans: Vec<Splat> =
                splats.iter().map(|s| Splat { intensity: (s.intensity / 4095.0).clamp(-1.0, 1.0), ..*s }).collect();
            let pass = step::run_with(&gpu, &bricks, &spans, &targets, kernel, [0.1, 0.2, 0.3], &step::terms(true));
            let rows: &[f32] = bytemuck::cast_slice(&pass.gradients);
            endless.set(endless.get() + rows.iter().filter(|v| !v.is_finite()).count());
        }
        prop_assert!(beyond.get() <= 1.0, "V̂ leaves the hull: {}", beyond.get());
        prop_assert_eq!(endless.get(), 0);
    });
    keep("N27a", beyond.get());
    keep("N27b", endless.get() as f64);
}
