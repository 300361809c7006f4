//! Derivatives of a thousand splats against differences of the objective, and gradients that are no numbers.

use engine::passes::Adam;
use engine::passes::adam::AdamState;
use engine::passes::loss::{OCCUPANCY, Weighted};
use engine::splat::{Kernel, Splat};
use engine::volume::Bricks;
use engine::volume::bricks::SAMPLES;
use glam::{DVec3, IVec3, UVec3, Vec3};
use rand::RngExt;
use rayon::prelude::*;
use reference::types::LANES;
use reference::{Footprint, Gradient, Samples, splat_bounds, splat_to_volume};
use shaders_glsl::types::{AdamParams, History, SplatGrad, Target};
use vgs_tests::numerics::keep;
use vgs_tests::sampling::some_splats;
use vgs_tests::scene::{EPSILON, random, splat};
use vgs_tests::{Device, step};

/// The objective of `step`'s first two terms as a sum over samples of W and Σ w c, so that moving one splat costs the
/// samples it reaches and no more.
struct Objective {
    kernel: Kernel,
    positions: Vec<DVec3>,
    targets: Vec<reference::Target>,
    /// Of all splats.
    sums: Vec<[f64; 2]>,
}

impl Objective {
    fn new(kernel: Kernel, splats: &[reference::Splat], positions: Vec<DVec3>, targets: &[Target]) -> Self {
        let footprints: Vec<Footprint> = splats.iter().map(|s| splat_bounds::footprint(s, kernel)).collect();
        let sums = positions
            .par_iter()
            .map(|&x| {
                footprints.iter().fold([0.0; 2], |[w, wc], f| {
                    let own = splat_to_volume::weight(f, x, kernel);
                    [w + own, wc + own * f.intensity]
                })
            })
            .collect();
        Objective { kernel, positions, targets: targets.iter().map(Into::into).collect(), sums }
    }

    /// ½ Σ m (V̂ - V)² + 0.3/2 Σ (O - M)² at a sample.
    fn at(&self, sample: usize, [w, wc]: [f64; 2]) -> f64 {
        let wanted = &self.targets[sample];
        let inside = f64::from(u8::from(wanted.occupancy > 0.5));
        let value = wc / (w + f64::from(EPSILON)) - wanted.value;
        let occupancy = w / (w + 0.05) - wanted.occupancy;
        0.5 * inside * value * value + 0.5 * 0.3 * occupancy * occupancy
    }

    /// dL/d(lane) by the difference of fourth order.
    fn slope(&self, splat: &reference::Splat, lane: usize) -> f64 {
        let h = 1e-5;
        let own = |s: &reference::Splat| splat_bounds::footprint(s, self.kernel);
        let now = own(splat);
        let moved = [h, -h, 2.0 * h, -2.0 * h].map(|step| own(&splat.moved(lane, step)));
        let (mut near, mut far) = (0.0, 0.0);
        let reach = now.extent + 0.01;
        for (i, &x) in self.positions.iter().enumerate() {
            if self.targets[i].occupancy < 0.0 || (x - now.mean).abs().cmpgt(reach).any() {
                continue;
            }
            let w = splat_to_volume::weight(&now, x, self.kernel);
            let [sum, sum_c] = self.sums[i];
            let rest = [sum - w, sum_c - w * now.intensity];
            let value = moved.map(|f| {
                let w = splat_to_volume::weight(&f, x, self.kernel);
                self.at(i, [rest[0] + w, rest[1] + w * f.intensity])
            });
            near += value[0] - value[1];
            far += value[2] - value[3];
        }
        (8.0 * near - far) / (12.0 * h)
    }
}

/// Usual ones and, every third, one at the ends of what the fit allows.
fn thousand(kernel: Kernel, clear: impl Fn(&Splat) -> bool) -> Vec<Splat> {
    let mut rng = random(1500 + kernel as u64);
    let mut next = |k: usize| {
        let mut s = splat(&mut rng, Vec3::new(30.0, 28.0, 22.0));
        if kernel == Kernel::Gaussian {
            // Large ones have a sample at their cut-off always.
            s.log_scale = s.log_scale.map(|v| v.min(0.4));
        } else if k.is_multiple_of(3) {
            s.log_scale = std::array::from_fn(|_| if rng.random_bool(0.8) { 0.4f32.ln() } else { 6f32.ln() });
        }
        if k.is_multiple_of(3) {
            s.opacity_logit = if rng.random_bool(0.5) { 8.5 } else { -8.5 };
        }
        s
    };
    (0..1000).map(|k| std::iter::repeat_with(|| next(k)).find(|s| clear(s)).expect("one")).collect()
}

#[test]
fn n15_a_thousand_gradients() {
    let gpu = Device::boot();
    let bricks = Bricks::of_box(IVec3::ZERO, UVec3::new(31, 29, 23), |v| (v.x + v.y + v.z) % 5 != 0);
    let mut rng = random(15);
    let targets: Vec<Target> = (0..bricks.len() * SAMPLES)
        .map(|i| {
            let (value, m) = (rng.random_range(-0.5f32..0.5), rng.random_range(0.0f32..1.0).round());
            if bricks.is_active(i / SAMPLES, i % SAMPLES) { Target::new(value, m) } else { Target::IDLE }
        })
        .collect();
    let terms = [
        Weighted { region: 0.5, ..Weighted::default() },
        Weighted { term: OCCUPANCY, weight: 0.3, parameter: 0.05, ..Weighted::default() },
    ];
    let positions = Samples::all(&bricks, [0.1, -0.2, 0.3]).positions();
    for (kernel, id) in [(Kernel::Compact, "N15a"), (Kernel::Gaussian, "N15b")] {
        // Where a Gaussian is cut the objective jumps, and a difference across the jump is no derivative.
        let clear = |s: &Splat| {
            let f = splat_bounds::footprint(&s.into(), kernel);
            kernel == Kernel::Compact
                || positions.iter().all(|&x| {
                    let q = (f.whitening * (x - f.mean)).length_squared();
                    (q - kernel.support_q()).abs() > 1e-3
                })
        };
        let splats = thousand(kernel, clear);
        let pass = step::run_with(&gpu, &bricks, &splats, &targets, kernel, [0.1, -0.2, 0.3], &terms);
        let exact: Vec<reference::Splat> = splats
            .iter()
            .map(|s| {
                let s = reference::Splat::from(s);
                reference::Splat { rotation: s.rotation.normalize(), ..s }
            })
            .collect();
        let objective = Objective::new(kernel, &exact, positions.clone(), &targets);
        let wanted: Vec<[f64; LANES]> =
            exact.par_iter().map(|s| std::array::from_fn(|lane| objective.slope(s, lane))).collect();
        let got: Vec<[f64; LANES]> = pass.gradients.iter().map(|g| Gradient::from(g).lanes()).collect();
        let mut worst = 0.0f64;
        for lane in 0..LANES {
            let largest = wanted.iter().fold(0.0f64, |a, g| a.max(g[lane].abs()));
            for (g, w) in got.iter().zip(&wanted) {
                let error = (g[lane] - w[lane]).abs();
                // Relative, but for derivatives that are small differences of large parts.
                worst = worst.max(error / (w[lane].abs() + 1e-3 * largest));
            }
        }
        keep(id, worst);
    }
}

/// A gradient that is not finite freezes its splat, is counted, and changes no bit of the others.
#[test]
fn n18_gradients_that_are_no_numbers() {
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
        rate_mean: [0.2; 3],
        rate_rotation: 0.1,
        rate_log_scale: 0.1,
        rate_opacity: 0.2,
        rate_intensity: 0.02,
        min_log_scale: [-1.0; 3],
        max_log_scale: [2.0; 3],
        scale_weight: 0.0,
        max_logit: 9.0,
        min_intensity: -5000.0,
        max_intensity: 5000.0,
        max_mean: [100.0; 3],
    };
    let step = |rows: &[SplatGrad]| {
        let mut adam = Adam::new(&gpu).expect("a kernel");
        let mut state = AdamState::zeroed(&gpu, 200).expect("moments");
        state.splats.write_range(0, &splats).expect("splats");
        let free = History { gradient_norm: 0.0, log_scale_cap: engine::passes::adam::NO_CAP };
        state.histories.write_range(0, &[free; 200]).expect("histories");
        let needs = gpu.buffer::<u32>("pair totals", "test", 1).expect("totals");
        let gradients = gpu.upload("gradients", "test", rows).expect("gradients");
        let mut recorder = gpu.record().expect("a recorder");
        adam.record(&mut recorder, &gradients, &mut state, &needs, &params);
        gpu.wait(recorder.submit().expect("a submission")).expect("the end of it");
        let moments = (state.first.read().expect("moments"), state.second.read().expect("moments"));
        (state.splats.read().expect("splats"), moments, adam.frozen.read().expect("a count")[0])
    };
    let (expected, moments, none) = step(&good);
    assert_eq!(none, 0);
    assert!(expected.iter().zip(&splats).all(|(a, b)| a != b), "every splat moves");
    let (mut changed, mut uncounted) = (0, 0);
    for (at, poison) in [(0, f32::NAN), (63, f32::INFINITY), (64, f32::NEG_INFINITY), (199, 1e20)] {
        let mut bad = good.clone();
        bad[at].rotation[1] = poison;
        let (got, got_moments, frozen) = step(&bad);
        uncounted += frozen.abs_diff(1);
        for i in 0..200 {
            let wanted = if i == at { splats[i] } else { expected[i] };
            let kept = if i == at { Default::default() } else { (moments.0[i], moments.1[i]) };
            changed +=
                usize::from(got[i] != wanted) + usize::from((got_moments.0[i], got_moments.1[i]) != kept);
        }
    }
    // Gradients of 0 and 1e-30 are ordinary ones: nothing is frozen.
    let mut moved = 0.0f64;
    for tiny in [0.0, 1e-30] {
        let mut rows = good.clone();
        rows[5] = SplatGrad { mean: [tiny; 3], ..SplatGrad::default() };
        let (got, _, frozen) = step(&rows);
        uncounted += frozen;
        for k in 0..3 {
            moved = moved.max(f64::from((got[5].mean[k] - splats[5].mean[k].clamp(-0.5, 100.0)).abs()));
        }
    }
    keep("N18a", changed as f64);
    keep("N18b", f64::from(uncounted));
    keep("N18c", moved);
}
