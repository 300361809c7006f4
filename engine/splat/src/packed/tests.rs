//! Bounds of the round trip, and sets that are as bad as they come.

use proptest::prelude::*;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::*;
use crate::Activations;

fn random(count: usize, seed: u64) -> Vec<Splat> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut between = |low: f32, high: f32| rng.random_range(low..high);
    (0..count)
        .map(|_| Splat {
            mean: [between(-200.0, 200.0), between(0.0, 300.0), between(900.0, 1000.0)],
            opacity_logit: between(-5.0, 5.0),
            rotation: [between(-1.0, 1.0), between(-1.0, 1.0), between(-1.0, 1.0), between(-1.0, 1.0)],
            log_scale: [between(-0.9, 1.6), between(-0.9, 1.6), between(-0.9, 1.6)],
            intensity: between(-1024.0, 3071.0),
        })
        .collect()
}

/// Returns half a step of a range plus the rounding of f32.
fn half_step(low: f32, high: f32, last: u32) -> f64 {
    let (low, high) = (f64::from(low), f64::from(high));
    0.5 * (high - low) / f64::from(last) * (1.0 + 1e-9) + 1.2e-7 * low.abs().max(high.abs())
}

/// Asserts what holds for every set: the order is a permutation, and every parameter is off by half a step at
/// most.
fn check(splats: &[Splat], labels: &[u8]) {
    let packed = Packed::new(splats, Some(labels));
    let range = packed.range;
    assert_eq!((packed.len(), packed.chunks.len()), (splats.len(), splats.len().div_ceil(CHUNK)));
    assert_eq!(packed.bytes(), 16 * splats.len() + 32 * packed.chunks.len());
    let mut seen = packed.order.clone();
    seen.sort_unstable();
    assert!(seen.into_iter().eq(0..splats.len() as u32), "every splat once");
    for (row, &from) in packed.order.iter().enumerate() {
        let (got, full) = (packed.unpack(row), &splats[from as usize]);
        let (want, chunk) = (tame(full), &packed.chunks[row / CHUNK]);
        assert!(bytemuck::cast_ref::<_, [f32; 12]>(&got).iter().all(|v| v.is_finite()), "{full:?}: {got:?}");
        let near = |what: &str, got: f32, want: f32, low: f32, high: f32, last: u32| {
            let error = (f64::from(got) - f64::from(want)).abs();
            assert!(error <= half_step(low, high, last), "{what}: {got} for {want} in {low}..{high}");
        };
        for k in 0..3 {
            near("mean", got.mean[k], want.mean[k], chunk.low[k], chunk.high[k], 4095);
            let (low, high) = (chunk.log_scale_low, chunk.log_scale_high);
            near("log scale", got.log_scale[k], want.log_scale[k], low, high, 511);
        }
        near("logit", got.opacity_logit, want.opacity_logit, range.logit_low, range.logit_high, 511);
        near("intensity", got.intensity, want.intensity, range.intensity_low, range.intensity_high, 65535);
        // Three components are off by 1/√2/511/2 at most and the fourth, the largest, by no more than their
        // sum; a rotation turns by twice the angle between the quaternions.
        let (a, b) = (unit_quaternion(got.rotation), unit_quaternion(full.rotation));
        let length: f64 = got.rotation.iter().map(|&v| f64::from(v).powi(2)).sum();
        assert!((length - 1.0).abs() < 1e-6, "a unit quaternion: {:?}", got.rotation);
        let angle = 2.0 * (a.dot(b).abs().min(1.0)).acos();
        assert!(angle < 5e-3, "{:?} turned by {angle}", full.rotation);
        assert_eq!(packed.label(row), labels[from as usize]);
    }
    assert_eq!(packed.unpack_all(), (0..packed.len()).map(|row| packed.unpack(row)).collect::<Vec<_>>());
    assert_eq!(Packed::new(splats, Some(labels)), packed, "the same input gives the same bits");
}

#[test]
fn sets_of_every_size() {
    for count in [0, 1, 2, 255, 256, 257, 1000] {
        let labels: Vec<u8> = (0..count).map(|i| (i * 7) as u8).collect();
        check(&random(count, 1), &labels);
    }
    assert!(Packed::new(&[], None).is_empty());
    let one = random(1, 2);
    let packed = Packed::new(&one, None);
    let got = packed.unpack(0);
    assert_eq!(
        (got.mean, got.opacity_logit, got.intensity),
        (one[0].mean, one[0].opacity_logit, one[0].intensity)
    );
    assert_eq!(packed.label(0), 0);
}

#[test]
fn extremes() {
    let good = random(300, 3);
    let labels = vec![255; 300];
    let with = |change: &dyn Fn(usize, &mut Splat)| {
        let mut splats = good.clone();
        splats.iter_mut().enumerate().for_each(|(i, s)| change(i, s));
        check(&splats, &labels);
    };
    with(&|_, s| s.mean = [7.0; 3]);
    with(&|i, s| s.mean = [i as f32 * 1e-40, -0.0, 0.0]);
    with(&|i, s| s.log_scale = [[-40.0, 0.0, 40.0], [-1e3, 1e3, f32::NAN]][i % 2]);
    with(&|i, s| s.opacity_logit = [f32::INFINITY, f32::NEG_INFINITY, f32::NAN, 200.0, 0.5][i % 5]);
    with(&|i, s| s.intensity = [f32::MAX, f32::MIN, f32::NAN, f32::INFINITY, 3.0][i % 5]);
    with(&|i, s| s.mean[i % 3] = [f32::MAX, f32::MIN, f32::NEG_INFINITY, f32::NAN, 0.1][i % 5]);
    with(&|i, s| s.rotation = [[0.0; 4], [f32::NAN; 4], [1e-38, 0.0, 0.0, 1e-38], [0.5; 4]][i % 4]);
    with(&|i, s| s.rotation = [[1.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 1.0, 0.0], [0.0, 0.0, -3.0, 3.0]][i % 3]);
    with(&|_, s| *s = Splat { rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() });
}

#[test]
fn what_is_exact_stays_exact() {
    // Both ends of every range, no rotation and quarter turns.
    let mut splats = random(256, 4);
    splats[0].mean = [-500.0, -500.0, -500.0];
    splats[1].mean = [1500.0, 1500.0, 1500.0];
    (splats[2].opacity_logit, splats[3].opacity_logit) = (-9.1, 8.7);
    (splats[4].intensity, splats[5].intensity) = (-2000.3, 4000.7);
    (splats[6].log_scale, splats[7].log_scale) = ([-1.1; 3], [2.3; 3]);
    let turns = [[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.5; 4], [0.0, 0.0, 0.0, -1.0]];
    for (splat, rotation) in splats.iter_mut().zip(turns) {
        splat.rotation = rotation;
    }
    let packed = Packed::new(&splats, None);
    let mut got = splats.clone();
    for (row, &from) in packed.order.iter().enumerate() {
        got[from as usize] = packed.unpack(row);
    }
    assert_eq!((got[0].mean, got[1].mean), (splats[0].mean, splats[1].mean));
    assert_eq!((got[2].opacity_logit, got[3].opacity_logit), (-9.1, 8.7));
    assert_eq!((got[4].intensity, got[5].intensity), (-2000.3, 4000.7));
    assert_eq!((got[6].log_scale, got[7].log_scale), ([-1.1; 3], [2.3; 3]));
    for i in [0, 1, 3] {
        assert!(got[i].axes().abs_diff_eq(splats[i].axes(), 0.0), "turn {i}: {:?}", got[i].rotation);
    }
}

#[test]
fn chunks_are_compact() {
    // 16 384 means on a grid of 32 × 32 × 16: along the curve 256 of them fill a block of 8 × 8 × 4.
    let grid = (0..16_384u32).map(|i| {
        let i = i * 5_381 % 16_384;
        Splat { mean: [i % 32, i / 32 % 32, i / 1024].map(|v| v as f32), ..Splat::default() }
    });
    let packed = Packed::new(&grid.collect::<Vec<_>>(), None);
    for chunk in &packed.chunks {
        let extent: Vec<f32> = (0..3).map(|k| chunk.high[k] - chunk.low[k]).collect();
        assert!(extent.iter().product::<f32>() < 600.0, "{extent:?}");
    }
}

proptest! {
    #[test]
    fn any_splats_survive(
        rows in prop::collection::vec((prop::array::uniform12(any::<f32>()), any::<u8>()), 0..40),
        mild: bool,
    ) {
        let (mut splats, labels): (Vec<Splat>, Vec<u8>) =
            rows.iter().map(|(values, label)| (bytemuck::cast::<_, Splat>(*values), *label)).unzip();
        if mild {
            // Within ranges that real sets have; the rest of the bits stay random.
            for splat in &mut splats {
                splat.mean = splat.mean.map(|v| v % 1e3);
                splat.intensity %= 4e3;
                splat.log_scale = splat.log_scale.map(|v| v % 3.0);
            }
        }
        check(&splats, &labels);
    }
}
