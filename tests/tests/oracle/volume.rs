//! Forward pass, loss terms, backward pass.

use engine::gpu::{Gpu, Kernel};
use engine::passes::loss::{INTENSITIES, MASKS, TERMS, Weighted};
use engine::passes::{Storage, WorkgroupShape};
use engine::splat;
use engine::splat::kernel::KERNELS;
use engine::volume::bricks::SAMPLES;
use glam::DVec3;
use rand::RngExt;
use reference::loss::Quantity;
use reference::moments_to_grad as gradient;
use reference::splat_to_volume as forward;
use reference::splat_to_volume_grad as backward;
use reference::{Adjoint, Footprint, Gradient, Reconstruction, Target, loss};
use shaders_glsl::types::{self, MomentParams, OverlapParams};
use vgs_tests::scene::{EPSILON, random};
use vgs_tests::storage::{STORAGES, kept, pack};
use vgs_tests::{Bound, Device, Scene, assert_close, step};

use super::run;

/// Splats of a scene; the reference implementations look at every sample for every one of them.
const SPLATS: usize = 120;

fn scenes() -> impl Iterator<Item = Scene> {
    let soft = |kernel| matches!(kernel, splat::Kernel::Gaussian | splat::Kernel::Gated);
    KERNELS
        .into_iter()
        .map(move |row| (row.kernel, soft(row.kernel)))
        .map(|(kernel, soft)| Scene::random(21 + u64::from(kernel.id()), SPLATS, kernel, soft))
}

/// Whether the cut-off of a Gaussian may fall either way for this sample, and w jump by a·exp(-4.5).
fn on_the_edge(footprints: &[Footprint], x: DVec3, kernel: splat::Kernel) -> bool {
    kernel != splat::Kernel::Compact
        && footprints.iter().any(|f| {
            let q = (f.whitening * (x - f.mean)).length_squared();
            let cut = (x - f.mean).abs().max_element() - kernel.row().reach;
            (q - kernel.support_q()).abs() < 1e-4 || (cut - 1e-3).abs() < 1e-4
        })
}

pub fn splat_to_volume() {
    let gpu = Device::boot();
    for scene in scenes() {
        let pass = step::run(&gpu, &scene, &step::terms(false));
        let footprints: Vec<Footprint> = pass.footprints.iter().map(Into::into).collect();
        let positions = scene.samples().positions();
        let wanted = forward::splat_to_volume(&footprints, &positions, scene.kernel, f64::from(EPSILON));
        let active: Vec<usize> =
            (0..positions.len()).filter(|&i| scene.bricks.is_active(i / SAMPLES, i % SAMPLES)).collect();
        let clear: Vec<usize> = active
            .iter()
            .copied()
            .filter(|&i| !on_the_edge(&footprints, positions[i], scene.kernel))
            .collect();
        println!("{} of {} samples have no cut-off near them", clear.len(), active.len());
        assert!(clear.len() * 100 > active.len() * 99, "the cut-off may fall either way in few places only");
        let got: Vec<Reconstruction> = pass.reconstructions.iter().map(Into::into).collect();
        let name = scene.kernel.name();
        // What counts is the error of q, some 1e-5 in small splats far from the origin.
        let weights = clear.iter().map(|&i| (got[i].weight, wanted[i].weight));
        assert_close(&format!("splat_to_volume: W, {name}"), Bound::new(2e-6, 2e-6), weights);
        let values = clear.iter().map(|&i| (got[i].value, wanted[i].value));
        assert_close(&format!("splat_to_volume: V, {name}"), Bound::new(3e-6, 0.0), values);
        let much = if scene.kernel.row().unit_integral { 1e-4 } else { 0.1 };
        let reached = active.iter().filter(|&&i| wanted[i].weight > much).count();
        assert!(reached * 5 > active.len(), "the scene covers many of its samples");
    }
}

/// Targets, samples and earlier adjoints.
type Samples = (Vec<types::Target>, Vec<types::Reconstruction>, Vec<types::Adjoint>);

/// Random samples, targets and earlier adjoints of some slots.
fn samples(slots: usize) -> Samples {
    let mut rng = random(slots as u64);
    let mut between = |low: f32, high: f32| rng.random_range(low..high);
    (0..slots * SAMPLES)
        .map(|i| {
            let value = between(-0.5, 0.5);
            let target = match i % 4 {
                0 => types::Target::IDLE,
                1 => types::Target::new(value, 1.0),
                _ => types::Target::new(value, between(0.0, 1.0)),
            };
            let weight = if i % 5 == 0 { 0.0 } else { between(0.0, 3.0) };
            (
                target,
                types::Reconstruction { weight, value: between(-0.5, 0.5) },
                types::Adjoint { value: between(-1.0, 1.0), weight: between(-1.0, 1.0) },
            )
        })
        .collect::<Vec<_>>()
        .into_iter()
        .fold(Default::default(), |(mut a, mut b, mut c): (Vec<_>, Vec<_>, Vec<_>), (x, y, z)| {
            a.push(x);
            b.push(y);
            c.push(z);
            (a, b, c)
        })
}

/// The samples that a storage keeps.
fn stored(storage: Storage, (targets, mut got, mut before): Samples) -> Samples {
    for r in &mut got {
        *r = types::Reconstruction { weight: kept(storage, r.weight), value: kept(storage, r.value) };
    }
    for a in &mut before {
        *a = types::Adjoint { value: kept(storage, a.value), weight: kept(storage, a.weight) };
    }
    (targets, got, before)
}

/// A slot that no pair reaches, among five: what begins where the next one begins.
const UNTOUCHED: usize = 3;
const STARTS: [u32; 6] = [0, 4, 5, 7, 7, 8];

/// Checks the kernel of each term with both storages, as the first, a middle, the last and the only term, in both shapes;
/// the slot that no pair reaches has the sums that it is given, and adjoints of 0 by the first term.
fn check_loss(rows: &[Weighted]) {
    let gpu = Device::boot();
    let slots = 5;
    let shapes = [WorkgroupShape::OneByOne, WorkgroupShape::SideBySide];
    for (weighted, storage) in rows.iter().flat_map(|row| STORAGES.map(|storage| (row, storage))) {
        let (shader, quantity) = (TERMS[weighted.term].shader, TERMS[weighted.term].quantity);
        let term = step::terms64(&[*weighted])[0];
        let (targets, got, before) = stored(storage, samples(slots));
        let targets64: Vec<Target> = targets.iter().map(Into::into).collect();
        let got64: Vec<Reconstruction> = got.iter().map(Into::into).collect();
        // What is stored is rounded once more.
        let (half_step, least_step) = match storage {
            Storage::Full => (0.0, 0.0),
            Storage::Mixed => (2f64.powi(-11), 2f64.powi(-25)),
        };
        let mut last = None;
        let places = [(0, 0), (1, 0), (0, 1), (1, 1)];
        for ((accumulate, fold), shape) in places.into_iter().flat_map(|p| shapes.map(|s| (p, s))) {
            let mut constants = vec![accumulate, fold, storage as u32, shape as u32];
            constants.extend(quantity);
            let kernel = Kernel::new(&gpu, shader, &constants).unwrap();
            let target_buffer = gpu.upload("targets", "test", &targets).unwrap();
            let sample_buffer = gpu.upload("samples", "test", &pack(storage, &got)).unwrap();
            let mut adjoints = gpu.upload("adjoints", "test", &pack(storage, &before)).unwrap();
            let mut sums = gpu.buffer::<[f32; 2]>("sums", "test", slots).unwrap();
            let overlap = term.overlap(&targets64, &got64);
            let overlap = [overlap.intersection, overlap.predicted, overlap.wanted].map(|v| v as f32);
            let overlap = gpu.upload("overlap", "test", &[overlap]).unwrap();
            let starts = gpu.upload("starts", "test", &STARTS).unwrap();
            let untouched = gpu.upload("untouched sums", "test", &[[-3.0f32, -4.0]; 5]).unwrap();
            run(&gpu, |r| {
                let mut pass = r
                    .pass(&kernel)
                    .read("targets", &target_buffer)
                    .read("reconstructions", &sample_buffer)
                    .write("adjoints", &mut adjoints)
                    .write("loss_sums", &mut sums)
                    .read("starts", &starts)
                    .read("untouched_sums", &untouched);
                if TERMS[weighted.term].overlap {
                    pass = pass.read("overlap", &overlap);
                }
                pass.push(&weighted.params(EPSILON)).dispatch(slots as u32);
            });
            let bits = (adjoints.read().unwrap(), sums.read().unwrap());
            match shape {
                WorkgroupShape::OneByOne => last = Some(bits),
                WorkgroupShape::SideBySide => {
                    assert!(last == Some(bits), "{}: both shapes have the same bits", shader.name)
                }
            }
            let wanted = loss::adjoints(&[term], &targets64, &got64);
            let found = storage.unpack::<types::Adjoint>(&adjoints.read().unwrap());
            let alone = |i: &usize| i / SAMPLES == UNTOUCHED;
            let left = |i: usize| if accumulate == 1 { before[i] } else { types::Adjoint::default() };
            assert!((0..found.len()).filter(alone).all(|i| found[i] == left(i)), "{}", shader.name);
            let computed = found.iter().zip(&wanted).zip(before.iter().zip(&got64)).enumerate();
            let pairs = computed.filter(|(i, _)| !alone(i)).flat_map(|(_, ((g, w), (b, r)))| {
                let b = if accumulate == 1 { Adjoint::from(b) } else { Adjoint::default() };
                let sum = Adjoint { value: w.value + b.value, weight: w.weight + b.weight };
                let w = if fold == 1 { loss::fold(*r, sum, f64::from(EPSILON)) } else { sum };
                // Folding divides the rounding of the sum by W + ε, and H is a difference.
                let (divisor, size) = match fold {
                    1 => {
                        let divisor = r.weight + f64::from(EPSILON);
                        (divisor, 1.0 + (w.value * r.value).abs() + (r.value / divisor).abs())
                    }
                    _ => (1.0, 1.0),
                };
                [
                    (f64::from(g.value) * divisor, w.value * divisor),
                    (f64::from(g.weight) / size, w.weight / size),
                ]
            });
            let bound = Bound::new(3e-7 + 4.0 * least_step, term.loss.trial.rounding + half_step);
            assert_close(&format!("{}: adjoints, {storage:?}", shader.name), bound, pairs);
            let wanted = loss::sums(&term, &targets64, &got64, SAMPLES);
            let mut found = sums.read().unwrap();
            assert_eq!(found.remove(UNTOUCHED), [-3.0, -4.0], "{}", shader.name);
            let mut wanted = wanted;
            wanted.remove(UNTOUCHED);
            let pairs = found.iter().zip(&wanted).flat_map(|(g, w)| (0..2).map(|i| (f64::from(g[i]), w[i])));
            assert_close(&format!("{}: sums", shader.name), Bound::new(0.0, 2e-6), pairs);
        }
    }
}

/// Every row of the table of terms: with and without a threshold of the region, and with the parameters and tolerances
/// that its reference is tried with.
pub fn losses() {
    for term in 0..TERMS.len() {
        let trial = &step::reference_of(term).trial;
        let mut rows = Vec::new();
        for (&parameter, &tolerance) in
            trial.parameters.iter().flat_map(|p| trial.tolerances.iter().map(move |t| (p, t)))
        {
            rows.extend([-1.0, 0.01, 0.5].map(|region| Weighted {
                term,
                weight: trial.weight,
                parameter,
                region,
                low: step::LOW,
                tolerance,
            }));
        }
        check_loss(&rows);
    }
}

pub fn overlap_sums() {
    let gpu = Device::boot();
    let quantities = [(MASKS, Quantity::Mask), (INTENSITIES, Quantity::Intensity { low: step::LOW.into() })];
    for storage in STORAGES {
        for quantity in quantities {
            for region in [-1.0, 0.01, 0.5] {
                check_overlap_sums(&gpu, storage, quantity, region);
            }
        }
    }
}

fn check_overlap_sums(gpu: &Gpu, storage: Storage, (id, quantity): (u32, Quantity), region: f32) {
    let slots = 5;
    let (targets, mut got, adjoints) = samples(slots);
    // One brick on either side of where the kernel changes from the series to the difference, one beyond all weights.
    for (i, sample) in got.iter_mut().enumerate().take(2 * SAMPLES) {
        sample.weight = if i < SAMPLES { i as f32 / 16384.0 } else { i as f32 * i as f32 };
    }
    let (targets, got, _) = stored(storage, (targets, got, adjoints));
    let targets64: Vec<Target> = targets.iter().map(Into::into).collect();
    let got64: Vec<Reconstruction> = got.iter().map(Into::into).collect();
    let mut wanted = loss::overlap_sums(&targets64, &got64, SAMPLES, quantity, region.into());
    let target_buffer = gpu.upload("targets", "test", &targets).unwrap();
    let sample_buffer = gpu.upload("samples", "test", &pack(storage, &got)).unwrap();
    let first = 3;
    let before = [[-1.0f32; 3]; 9];
    let starts = gpu.upload("starts", "test", &STARTS).unwrap();
    let untouched = gpu.upload("untouched sums", "test", &[[-3.0f32, -4.0, -5.0]; 5]).unwrap();
    let [found, side_by_side] = [WorkgroupShape::OneByOne, WorkgroupShape::SideBySide].map(|shape| {
        let kernel =
            Kernel::new(gpu, &shaders_glsl::OVERLAP_SUMS, &[storage as u32, shape as u32, id]).unwrap();
        let mut partials = gpu.upload("partials", "test", &before).unwrap();
        run(gpu, |r| {
            r.pass(&kernel)
                .read("targets", &target_buffer)
                .read("reconstructions", &sample_buffer)
                .write("partials", &mut partials)
                .read("starts", &starts)
                .read("untouched_sums", &untouched)
                .push(&OverlapParams { first_slot: first as u32, region, low: step::LOW })
                .dispatch(slots as u32);
        });
        partials.read().unwrap()
    });
    assert_eq!(found, side_by_side, "both shapes have the same bits");
    assert_eq!((&found[..first], &found[first + slots..]), (&before[..3], &before[..1]));
    wanted[UNTOUCHED] = [-3.0, -4.0, -5.0];
    let found = found[first..first + slots].as_flattened().iter().map(|&v| f64::from(v));
    let pairs = found.zip(wanted.as_flattened().iter().copied());
    // Behind the series, at W = 1/64, rounding of 1 - exp(-W) is 4e-6 of it.
    assert_close(&format!("overlap_sums, {storage:?}"), Bound::new(0.0, 5e-6), pairs);
}

/// Per moment, the sum of the absolute contributions of all samples: what rounding is measured against.
fn magnitudes(
    footprint: &Footprint,
    positions: &[DVec3],
    folded: &[Adjoint],
    kernel: splat::Kernel,
) -> [f64; 11] {
    let mut sums = [0.0; 11];
    for (x, a) in positions.iter().zip(folded) {
        let one = backward::moments(footprint, std::slice::from_ref(x), std::slice::from_ref(a), kernel);
        for (sum, v) in sums.iter_mut().zip(one.to_row()) {
            *sum += v.abs();
        }
    }
    sums
}

pub fn splat_to_volume_grad() {
    let gpu = Device::boot();
    for (scene, storage) in scenes().flat_map(|scene| STORAGES.map(|storage| (scene.clone(), storage))) {
        let terms = step::terms(scene.kernel == splat::Kernel::Gaussian);
        let pass = step::run_stored(&gpu, &scene, &terms, storage);
        let folded: Vec<Adjoint> = pass.adjoints.iter().map(Into::into).collect();
        let positions = scene.samples().positions();
        let mut reached = 0;
        let mut pairs = Vec::new();
        for (footprint, got) in pass.footprints.iter().zip(&pass.moments) {
            let footprint: Footprint = footprint.into();
            let want = backward::moments(&footprint, &positions, &folded, scene.kernel).to_row();
            let size = magnitudes(&footprint, &positions, &folded, scene.kernel);
            reached += usize::from(size[1] > 0.0);
            for k in 0..11 {
                let size = if size[k] > 0.0 { size[k] } else { 1.0 };
                pairs.push((f64::from(got[k]) / size, want[k] / size));
            }
        }
        assert!(reached * 2 > scene.splats.len(), "most splats reach a sample");
        // Outliers: of a splat that reaches one sample with its very border, the slope there is all that counts. A
        // cut-off that falls the other way moves one splat by a small part of what it sums.
        let limit = if scene.kernel != splat::Kernel::Compact { 0.02 } else { 1e-3 };
        let bound = Bound::new(2e-5, 0.0).outliers(0.005, limit);
        assert_close(&format!("splat_to_volume_grad, {}, {storage:?}", scene.kernel.name()), bound, pairs);
    }
}

pub fn moments_to_grad() {
    let gpu = Device::boot();
    for row in KERNELS {
        for stretch in [[1.0; 3], [1.7, 0.6, 2.5]] {
            check_moments_to_grad(&gpu, row.kernel, stretch);
        }
    }
}

fn check_moments_to_grad(gpu: &Gpu, splat_kernel: splat::Kernel, stretch: [f32; 3]) {
    let kernel = Kernel::new(gpu, &shaders_glsl::MOMENTS_TO_GRAD, &[splat_kernel.id()]).unwrap();
    let scene = Scene::random(23, 200, splat_kernel, false);
    let count = scene.splats.len();
    let mut rng = random(24);
    let moments: Vec<[f32; 11]> =
        (0..count).map(|_| std::array::from_fn(|_| rng.random_range(-1.0f32..1.0))).collect();
    let splats = gpu.upload("splats", "test", &scene.splats).unwrap();
    let rows = gpu.upload("moments", "test", moments.as_flattened()).unwrap();
    let mut gradients = gpu.buffer::<types::SplatGrad>("gradients", "test", count).unwrap();
    run(gpu, |r| {
        r.pass(&kernel)
            .read("splats", &splats)
            .read("moments", &rows)
            .write("gradients", &mut gradients)
            .push(&MomentParams { splat_count: count as u32, stretch })
            .dispatch_over(count as u32);
    });
    let mut pairs = Vec::new();
    let stretch64 = DVec3::from_array(stretch.map(f64::from));
    for ((got, splat), moments) in gradients.read().unwrap().iter().zip(scene.splats64()).zip(&moments) {
        let moments = backward::Moments::from_row(moments.map(f64::from));
        let (got, want) = (
            Gradient::from(got).lanes(),
            gradient::stretched(&splat, &moments, splat_kernel, stretch64).lanes(),
        );
        // Sums of products that may cancel: measured against the products themselves.
        let steepest = (-2.0 * splat.log_scale.min_element()).exp() / stretch64.min_element().powi(2);
        let ratio = (splat.log_scale.max_element() - splat.log_scale.min_element()).exp();
        let amplitude = reference::splat_bounds::amplitude(&splat, splat_kernel);
        for lane in 0..11 {
            let size = amplitude
                * match lane {
                    3 | 10 => 1.0,
                    4..7 => steepest * ratio,
                    // B_kk - S0
                    7..10 if splat_kernel.row().unit_integral => steepest + 1.0,
                    _ => steepest,
                };
            pairs.push((got[lane] / size, want[lane] / size));
        }
    }
    assert_close(&format!("moments_to_grad, {}", splat_kernel.name()), Bound::new(3e-6, 0.0), pairs);
}
