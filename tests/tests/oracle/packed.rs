//! Splats in 16 bytes.

use engine::passes::{PackedSplats, Unpack};
use engine::splat::{Packed, Splat};
use glam::Vec3;
use vgs_tests::scene::{random, splat};
use vgs_tests::{Bound, Device, assert_close};

use super::run;

/// What the kernel makes of a set, and what it should; their labels agree.
fn both(gpu: &Device, splats: &[Splat]) -> (Vec<Splat>, Vec<Splat>) {
    let labels: Vec<u8> = (0..splats.len()).map(|i| (i * 37) as u8).collect();
    let packed = Packed::new(splats, Some(&labels));
    let kernel = Unpack::new(gpu).unwrap();
    let rows = PackedSplats::new(gpu, &packed).unwrap();
    let mut got = gpu.buffer::<Splat>("unpacked", "test", splats.len()).unwrap();
    let mut got_labels = gpu.buffer::<u32>("labels", "test", splats.len()).unwrap();
    run(gpu, |r| kernel.record(r, &rows, &mut got, &mut got_labels));
    let want: Vec<u32> = packed.order.iter().map(|&from| u32::from(labels[from as usize])).collect();
    assert_eq!(got_labels.read().unwrap(), want);
    (got.read().unwrap(), packed.unpack_all())
}

pub fn unpack() {
    let gpu = Device::boot();
    let mut rng = random(41);
    // Not a whole number of chunks, nor of workgroups; as far from the origin as a patient may lie.
    let mut splats: Vec<Splat> =
        (0..CHUNKED).map(|_| splat(&mut rng, Vec3::new(400.0, 300.0, 900.0))).collect();
    for (i, s) in splats.iter_mut().enumerate() {
        s.mean[2] += 1e3;
        s.intensity = (i as f32 * 17.3) % 4095.0 - 1024.0;
        // Every component is the largest in turn; some are not there at all.
        match i % 9 {
            k @ 0..4 => s.rotation = std::array::from_fn(|j| f32::from(u8::from(j == k))),
            4 => s.rotation = [0.5, -0.5, 0.5, -0.5],
            _ => {}
        }
    }
    let (got, want) = both(&gpu, &splats);
    let lanes = |splats: &[Splat], first: usize, count: usize| -> Vec<f64> {
        let rows: &[[f32; 12]] = bytemuck::cast_slice(splats);
        rows.iter().flat_map(|row| row[first..first + count].iter().map(|&v| f64::from(v))).collect()
    };
    for (what, first, count, bound) in [
        ("mean", 0, 3, Bound::new(1e-6, 3e-7)),
        ("opacity logit", 3, 1, Bound::new(2e-6, 3e-7)),
        ("rotation", 4, 4, Bound::new(2e-7, 3e-7)),
        ("log scale", 8, 3, Bound::new(1e-6, 3e-7)),
        ("intensity", 11, 1, Bound::new(1e-3, 3e-7)),
    ] {
        let pairs = lanes(&got, first, count).into_iter().zip(lanes(&want, first, count));
        assert_close(&format!("unpack: {what}"), bound, pairs);
    }

    // Ranges as wide as f32 goes: finite, the ends exactly.
    let wide: Vec<Splat> = (0..4)
        .map(|i| {
            let end = if i % 2 == 0 { f32::MIN } else { f32::MAX };
            Splat { mean: [end; 3], intensity: end, log_scale: [end, 0.0, -end], ..splats[i] }
        })
        .collect();
    let (got, want) = both(&gpu, &wide);
    for (got, want) in got.iter().zip(&want) {
        assert_eq!((got.mean, got.intensity), (want.mean, want.intensity));
        assert_eq!([got.log_scale[0], got.log_scale[2]], [want.log_scale[0], want.log_scale[2]]);
    }
    assert!(got.iter().any(|s| s.intensity == f32::MAX) && got.iter().any(|s| s.intensity == f32::MIN));
    // Nothing to do is no error.
    assert!(both(&gpu, &[]).0.is_empty());
}

/// Three whole chunks and a part of one.
const CHUNKED: usize = 3 * 256 + 77;
