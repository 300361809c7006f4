//! Numbers in 16 bits: samples as halves, targets and intensities as steps of their range.

use engine::fit::Storage;
use engine::gpu::Kernel;
use engine::passes::Reconstruction;
use engine::passes::loss::Weighted;
use engine::splat::{self, Packed, Splat};
use engine::volume::bricks::SAMPLES;
use rand::RngExt;
use reference::half;
use shaders_glsl::types::Target;
use vgs_tests::numerics::keep;
use vgs_tests::sampling::{bricks, one, some_splats};
use vgs_tests::scene::{EPSILON, Scene, random};
use vgs_tests::storage::pack;
use vgs_tests::{Device, step};

/// The squared error with V = 0 and V̂ a power of two has the adjoint λ V̂ to the bit: every f32 can be sent to storage
/// through λ and the exponent.
#[test]
fn n11_halves() {
    let gpu = Device::boot();
    let kernel =
        Kernel::new(&gpu, &shaders_glsl::LOSS_MSE, &[0, 0, Storage::Mixed as u32, 64]).expect("a kernel");
    let samples: Vec<Reconstruction> = (0..SAMPLES as i32)
        .map(|i| {
            let size = 2f32.powi(i / 2 % 40 - 24);
            Reconstruction { weight: 1.0, value: if i % 2 == 0 { size } else { -size } }
        })
        .collect();
    let targets = gpu.upload("targets", "test", &vec![Target::new(0.0, 1.0); SAMPLES]).expect("targets");
    let reconstructions = gpu.upload("samples", "test", &pack(Storage::Mixed, &samples)).expect("samples");
    let starts = gpu.upload("starts", "test", &[0u32, 1]).expect("starts");
    let step = 2f32.powi(-11);
    let ulp = f32::EPSILON;
    let mut weights = vec![
        1.0,
        1.0 + step,       // a tie
        1.0 + step - ulp, // next to it
        1.0 + step + ulp,
        1.0 + 3.0 * step, // a tie to the other side
        2.0 - ulp,        // rounds up to a power of two
        2047.9,           // at 2⁵: 65532.8, beyond the largest half
        2047.0,           // at 2⁵: the largest half itself
        1e30,
        f32::MAX,
        f32::INFINITY,
    ];
    let mut rng = random(11);
    weights.extend((0..20).map(|_| rng.random_range(1.0f32..2.0)));
    let mut wrong = 0;
    for weight in weights {
        let mut adjoints = gpu.buffer::<u32>("adjoints", "test", SAMPLES).expect("adjoints");
        let mut sums = gpu.buffer::<[f32; 2]>("sums", "test", 1).expect("sums");
        let mut recorder = gpu.record().expect("a recorder");
        recorder
            .pass(&kernel)
            .read("targets", &targets)
            .read("reconstructions", &reconstructions)
            .write("adjoints", &mut adjoints)
            .write("loss_sums", &mut sums)
            .read("starts", &starts)
            .read("untouched_sums", &gpu.buffer::<[f32; 2]>("untouched", "test", 1).expect("sums"))
            .push(&Weighted { weight, region: 0.5, ..Weighted::default() }.params(EPSILON))
            .dispatch(1);
        gpu.wait(recorder.submit().expect("submitting")).expect("waiting");
        let got = Storage::Mixed.unpack::<[f32; 2]>(&adjoints.read().expect("adjoints"));
        for ([value, _], sample) in got.into_iter().zip(&samples) {
            let wanted = half(f64::from(weight * sample.value)) as f32;
            wrong += usize::from(value.to_bits() != wanted.to_bits() || !value.is_finite());
        }
    }
    keep("N11a", wrong as f64);
}

/// The steps of halves, of 16 bits over a range, and what is far outside it.
#[test]
fn n11_intensities() {
    let gpu = Device::boot();
    let span = 4095.0f32;
    let mut halves = 0.0f64;
    for hu in [-1024.0f32, -1000.0, 0.0, 40.0, 300.0, 1000.0, 2047.0, 3071.0, 32767.0] {
        let targets = vec![Target::new(0.0, 1.0); bricks().len() * SAMPLES];
        // One splat that is the same everywhere, relative to a background of 40 HU, in spans of a CT's range.
        let scene = Scene {
            bricks: bricks(),
            splats: vec![one([9.0, 8.0, 6.0], [6.0; 3], 3.0, (hu - 40.0) / span)],
            targets,
            kernel: splat::Kernel::Compact,
            offset: [0.0; 3],
        };
        let full = step::run(&gpu, &scene, &step::terms(false));
        let mixed = step::run_stored(&gpu, &scene, &step::terms(false), Storage::Mixed);
        for (f, m) in full.reconstructions.iter().zip(&mixed.reconstructions) {
            assert!(m.value.is_finite() && m.weight.is_finite());
            // 11 digits: half a step is 2^-12 of the power of two above.
            let half_step = 2f64.powi(f64::from(f.value.abs()).log2().floor().max(-14.0) as i32 - 11);
            halves = halves.max(f64::from((f.value - m.value).abs()) / half_step);
        }
    }
    keep("N11b", halves);
    let mut targets = 0.0f64;
    for hu in -1024..=3071 {
        let value = (hu as f32 - 40.0) / span;
        targets = targets.max(f64::from((Target::new(value, 1.0).value() - value).abs()) * f64::from(span));
    }
    keep("N11c", targets);
    let mut splats: Vec<Splat> = some_splats(11, 500);
    splats[0].intensity = -1024.0;
    splats[1].intensity = 32767.0;
    let packed = Packed::new(&splats, None);
    let range = f64::from(packed.range.intensity_high - packed.range.intensity_low);
    let mut steps = 0.0f64;
    for (row, &from) in packed.order.iter().enumerate() {
        let error = f64::from((packed.unpack(row).intensity - splats[from as usize].intensity).abs());
        steps = steps.max(error / (range / 65535.0));
    }
    keep("N11d", steps);
    for beyond in [f32::INFINITY, f32::NEG_INFINITY, f32::NAN] {
        splats[2].intensity = beyond;
        let unpacked = Packed::new(&splats, None).unpack_all();
        assert!(unpacked.iter().all(|s| s.intensity.is_finite()), "{beyond}");
    }
}
