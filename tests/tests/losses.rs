//! The paper's losses: extremes, which no scene has, and fits that follow the mask.

use engine::fit::{FitConfig, FitForm, Progress};
use engine::gpu::{Gpu, GpuOptions};
use engine::passes::loss::{ChunkSamples, DICE, LEAK, Sum, Weighted};
use engine::passes::{Losses, Storage};
use engine::splat::{Kernel, Splat};
use engine::volume::bricks::SAMPLES;
use engine::volume::{Roi, Volume};
use glam::DAffine3;
use shaders_glsl::types::{Adjoint, Reconstruction, Target};
use vgs_tests::fitting::Case;
use vgs_tests::scene::EPSILON;
use vgs_tests::storage::{STORAGES, pack};
use vgs_tests::{Bound, Device, Scene, assert_close, step};

/// Dice and leak of one brick: sums and folded adjoints, which are dL/dW as no term looks at V̂.
fn brick(gpu: &Gpu, targets: &[Target], weights: &[f32]) -> (Vec<Sum>, Vec<Adjoint>) {
    let terms = [DICE, LEAK].map(|term| Weighted {
        term,
        parameter: if term == LEAK { 1.0 } else { 0.0 },
        ..Weighted::default()
    });
    let samples: Vec<_> = weights.iter().map(|&weight| Reconstruction { weight, value: 0.0 }).collect();
    let targets = gpu.upload("targets", "test", targets).expect("targets");
    let samples = gpu.upload("samples", "test", &pack(Storage::Full, &samples)).expect("samples");
    let mut losses = Losses::new(gpu, &terms, EPSILON, Storage::Full, 1, 1).expect("losses");
    let mut recorder = gpu.record().expect("a recorder");
    let samples =
        ChunkSamples { chunk: 0, slots: 0..1, targets: &targets, reconstructions: &samples, touched: None };
    losses.record_overlap(&mut recorder, &samples);
    losses.record(&mut recorder, &terms, &samples);
    gpu.wait(recorder.submit().expect("submitting")).expect("waiting");
    let adjoints = Storage::Full.unpack(&losses.adjoints.read().expect("adjoints"));
    (losses.sums().expect("sums"), adjoints)
}

/// Weights and masks as large and as small as they come give the means that they should, and nothing that is no number.
#[test]
fn extremes_have_a_loss() {
    let gpu = Device::boot();
    let half = |i: usize| i < SAMPLES / 2;
    type Mask = fn(usize) -> f32;
    type Row<'a> = (&'a str, &'a dyn Fn(usize) -> f32, [[f64; 2]; 4]);
    let masks: [(&str, Mask); 4] = [
        ("all", |_| 1.0),
        ("none", |_| 0.0),
        ("half", |i| f32::from(u8::from(i < SAMPLES / 2))),
        ("soft", |_| 0.5),
    ];
    let dark = |_: usize| 0.0;
    let huge = |_: usize| f32::MAX;
    let right = |i: usize| if half(i) { 1e30 } else { 0.0 };
    let wrong = |i: usize| if half(i) { 0.0 } else { 1e30 };
    // Dice loss and leak for the masks above; the soft one is 16384 / 32767.
    let rows: [Row; 4] = [
        ("W = 0", &dark, [[1.0, 0.0], [0.0, 0.0], [1.0, 0.0], [1.0, 0.0]]),
        ("W huge", &huge, [[0.0, 0.0], [1.0, 1.0], [1.0 / 3.0, 1.0], [1.0 / 3.0, 1.0]]),
        ("W where the half is", &right, [[1.0 / 3.0, 0.0], [1.0, 0.5], [0.0, 0.0], [0.5, 0.5]]),
        ("W where the half is not", &wrong, [[1.0 / 3.0, 0.0], [1.0, 0.5], [1.0, 1.0], [0.5, 0.5]]),
    ];
    for (weights_name, weights, wanted) in rows {
        for ((mask_name, mask), wanted) in masks.iter().zip(wanted) {
            let name = format!("{weights_name}, mask {mask_name}");
            let targets: Vec<_> = (0..SAMPLES).map(|i| Target::new(0.0, mask(i))).collect();
            let weights: Vec<_> = (0..SAMPLES).map(weights).collect();
            let (sums, adjoints) = brick(&gpu, &targets, &weights);
            let means = sums.iter().map(Sum::mean);
            assert_close(&name, Bound::new(1e-4, 0.0), means.zip(wanted));
            assert!(adjoints.iter().all(|a| a.value == 0.0 && a.weight.is_finite()), "{name}: adjoints");
            for (i, a) in adjoints.iter().enumerate() {
                let saturated = weights[i] > 0.0;
                assert!(!saturated || a.weight == 0.0, "{name}: what is full cannot become fuller");
            }
        }
    }
    // Nothing takes part.
    let (sums, adjoints) = brick(&gpu, &[Target::IDLE; SAMPLES], &[1.0; SAMPLES]);
    assert!(sums == [Sum::default(); 2] && adjoints.iter().all(|a| *a == Adjoint::default()));
    // Without the leak a sample outside the mask is pushed down and one inside is pulled up.
    let targets: Vec<_> = (0..SAMPLES).map(|i| Target::new(0.0, masks[2].1(i))).collect();
    let (_, adjoints) = brick(&gpu, &targets, &[0.3; SAMPLES]);
    assert!(adjoints.iter().enumerate().all(|(i, a)| (a.weight < 0.0) == half(i) && a.weight != 0.0));
}

const SIZE: [usize; 3] = [40, 36, 40];

/// A phantom on its grid, where the mask is binary, with the weights of MSE, mask, leak and occupancy.
fn case(iterations: u32, [mse, mask, leak, occupancy]: [f32; 4]) -> Case {
    let mut case = Case::phantom(SIZE, iterations);
    case.config = case.config.with(|c| {
        c.loss.mse_weight = mse;
        c.loss.mask_weight = mask;
        c.loss.leak_weight = leak;
        c.loss.occupancy_weight = occupancy;
        c.samples.form = FitForm::Field;
        c.samples.offsets = 1;
    });
    case
}

fn progress(case: &Case, gpu: &Gpu) -> (Vec<Splat>, Progress) {
    let mut fitter = case.fit(gpu);
    let progress = fitter.progress().expect("progress");
    assert_eq!(fitter.frozen().expect("a count"), 0);
    (fitter.splats().expect("splats"), progress)
}

/// Structure alone: the mask is found, intensities keep still, and the bits are the same each time.
#[test]
fn a_fit_of_the_structure_finds_the_mask() {
    let gpu = Device::boot();
    let weights = [0.0, 1.0, 0.1, 0.0];
    let (_, first) = progress(&case(1, weights), &gpu);
    let whole = case(60, weights);
    let (splats, last) = progress(&whole, &gpu);
    let (dice, leak) = (|p: Progress| p.dice.expect("the term is on"), |p: Progress| p.leak.expect("on"));
    println!("Dice loss {:.4} -> {:.4}", dice(first), dice(last));
    println!("leak {:.4} -> {:.4}", leak(first), leak(last));
    assert!(dice(first) > 0.25 && dice(last) < 0.12, "{} -> {}", dice(first), dice(last));
    assert!((0.0..0.12).contains(&leak(last)), "{}", leak(last));
    assert_eq!(last.occupancy_rmse, 0.0, "that term is off");
    // As a fit takes them: intensities in the range of the region.
    let start = whole.fitter(&gpu, &whole.start()).splats().expect("splats");
    for (before, after) in start.iter().zip(&splats) {
        assert_eq!(before.intensity, after.intensity, "no term looks at intensities");
        assert_ne!(before.log_scale, after.log_scale, "every splat is moved");
    }
    assert!(progress(&whole, &gpu).0 == splats, "two runs differ");
}

/// Any mixture of terms is a fit, and its objective falls.
#[test]
fn every_mixture_of_terms_is_a_fit() {
    let gpu = Device::boot();
    for bits in 1..16u32 {
        let on = |k: usize| bits >> k & 1 == 1;
        let weights = [1.0, 1.0, 0.1, 0.004].map(f64::from);
        let weights: [f64; 4] = std::array::from_fn(|k| if on(k) { weights[k] } else { 0.0 });
        let whole = case(12, weights.map(|w| w as f32));
        let samples = {
            let fitter = whole.fitter(&gpu, &whole.start());
            let bricks = fitter.bricks();
            let all = 0..bricks.len() * SAMPLES;
            all.filter(|i| bricks.is_active(i / SAMPLES, i % SAMPLES)).count() as f64
        };
        // The objective over |ROI|/2: the occupancy is a sum over all samples, the others are means.
        let objective = |p: Progress| {
            weights[0] * p.mse
                + weights[1] * p.dice.unwrap_or(0.0)
                + weights[2] * p.leak.unwrap_or(0.0)
                + weights[3] * p.occupancy_rmse.powi(2) * samples / whole.roi.weight_sum()
        };
        let (_, first) = progress(&case(1, weights.map(|w| w as f32)), &gpu);
        let (_, last) = progress(&whole, &gpu);
        println!("{weights:?}: {} -> {}, {last:?}", objective(first), objective(last));
        assert_eq!(
            (last.occupancy_rmse > 0.0, last.dice.is_some(), last.leak.is_some()),
            (on(3), on(1), on(2))
        );
        assert!(objective(last) < 0.8 * objective(first), "{weights:?}");
    }
}

/// A mask that fills its volume leaves nothing to leak into: the term is 0 and harms nothing.
#[test]
fn nothing_outside_means_no_leak() {
    let gpu = Device::boot();
    let volume =
        Volume::new([9, 8, 10], DAffine3::IDENTITY, (0..720).map(|i| (i * 37 % 101) as f32).collect());
    let roi = Roi::new(vec![1.0; 720], &volume).expect("a region");
    let config = FitConfig::default().with(|c| {
        c.iterations = 6;
        c.samples.offsets = 1;
        c.loss.shell = 0;
        c.loss.mask_weight = 1.0;
        c.loss.leak_weight = 1.0;
        c.loss.hold_weight = 0.0;
        c.loss.rim_weight = 0.0;
    });
    let (splats, progress) = progress(&Case { volume, roi, config }, &gpu);
    assert_eq!(progress.leak, Some(0.0));
    assert!(progress.dice.is_some_and(|d| d < 0.5) && progress.mse.is_finite());
    assert!(bytemuck::cast_slice::<Splat, f32>(&splats).iter().all(|v| v.is_finite()));
}

/// One sum runs over all samples, so a splat that is not a number could spoil the gradient of every other.
#[test]
fn a_bad_splat_does_not_spoil_the_sums_of_all() {
    let gpu = Device::boot();
    let whole = case(5, [1.0, 1.0, 0.1, 0.0]);
    let mut poisoned = whole.start();
    poisoned[0].opacity_logit = f32::NAN;
    let mut fitter = whole.fitter(&gpu, &poisoned);
    whole.run(&mut fitter, 5);
    let got = fitter.splats().expect("splats");
    let still = got.iter().zip(&poisoned).filter(|(a, b)| a.mean == b.mean).count();
    println!("{still} of {} splats keep still", got.len());
    assert!(0 < still && still < got.len() / 2, "{still} of {} splats keep still", got.len());
}

/// A small storage-buffer range cuts the grid into chunks. The sums of the Dice loss are those of all chunks, added in the
/// same order: the first step has the same losses to the bit.
#[test]
fn chunks_have_the_dice_loss_of_the_whole() {
    let whole = Device::boot();
    // 21 bricks to a chunk.
    let small = Device::boot_with(GpuOptions { storage_range_limit: Some(90_000), ..GpuOptions::default() });
    let weights = [1.0, 1.0, 0.1, 0.0];
    let ((_, a), (_, b)) = (progress(&case(1, weights), &whole), progress(&case(1, weights), &small));
    assert_close("first step", Bound::new(0.0, 1e-12), figures(b).into_iter().zip(figures(a)));
    let ((one, a), (many, b)) = (progress(&case(4, weights), &whole), progress(&case(4, weights), &small));
    assert_close("fourth step", Bound::new(0.0, 1e-4), figures(b).into_iter().zip(figures(a)));
    // As in `fit`: where a gradient is nearly zero, rounding may turn a step of Adam.
    let lanes = |s: &Splat| {
        let lanes: [f32; 12] = bytemuck::cast(Splat { intensity: s.intensity / 4095.0, ..*s });
        lanes.map(f64::from)
    };
    let pairs = many.iter().zip(&one).flat_map(|(x, y)| lanes(x).into_iter().zip(lanes(y)));
    assert_close("parameters", Bound::new(1e-4, 1e-5).outliers(0.05, 0.8), pairs);
}

/// Bricks that no splat reaches are left out with the same bits: sums, and what every splat is told.
#[test]
fn bricks_that_no_splat_reaches_need_not_be_computed() {
    let whole = Device::boot();
    let small = Device::boot_with(GpuOptions { storage_range_limit: Some(90_000), ..GpuOptions::default() });
    for (gpu, storage) in [&whole, &small].into_iter().flat_map(|gpu| STORAGES.map(|storage| (gpu, storage)))
    {
        // Few enough that most bricks are left out, and at least one is not.
        let scene = Scene::random(3, 8, Kernel::Gaussian, true);
        let terms = step::all_terms(true);
        let every = step::run_stored(gpu, &scene, &terms, storage);
        let touched = step::run_touched(gpu, &scene, &terms, storage);
        let left_out = every.adjoints.chunks(SAMPLES).zip(touched.adjoints.chunks(SAMPLES));
        let left_out = left_out.filter(|(a, b)| a != b).count();
        let bricks = scene.bricks.len();
        assert!(bricks / 4 < left_out && left_out < bricks, "{left_out} of {bricks} bricks left out");
        assert_eq!(every.sums, touched.sums, "{storage:?}");
        assert_eq!(every.moments, touched.moments, "{storage:?}");
    }
}

fn figures(p: Progress) -> [f64; 3] {
    [p.mse, p.dice.expect("the term is on"), p.leak.expect("the term is on")]
}
