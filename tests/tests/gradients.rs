//! Derivatives: the f64 reference implementations against central differences of the whole objective, and the
//! device against them.
//!
//! Every sample has a target and a mask value of its own, so that no error hides in a mean. Splats of a Gaussian
//! kernel are placed so that no sample lies at its cut-off, where the objective jumps.

use engine::passes::loss::{TERMS, Weighted};
use engine::splat::kernel::KERNELS;
use engine::splat::{Kernel, Splat};
use engine::volume::Bricks;
use glam::{IVec3, UVec3, Vec3};
use rand::RngExt;
use rand_pcg::Pcg64;
use reference::types::LANES;
use reference::{Gradient, Samples, objective};
use shaders_glsl::types::Target;
use vgs_tests::scene::{EPSILON, random, splat};
use vgs_tests::{Bound, Device, assert_close, step};

const LANE_NAMES: [&str; LANES] = [
    "mean x",
    "mean y",
    "mean z",
    "logit",
    "rotation 1",
    "rotation 2",
    "rotation 3",
    "ln scale 1",
    "ln scale 2",
    "ln scale 3",
    "intensity",
];

/// A small grid of 2 × 2 × 1 bricks with random targets.
struct Small {
    bricks: Bricks,
    splats: Vec<Splat>,
    targets: Vec<Target>,
    offset: [f32; 3],
    kernel: Kernel,
    soft: bool,
}

impl Small {
    fn new(seed: u64, kernel: Kernel, soft: bool, make: impl Fn(&mut Pcg64) -> Splat) -> Self {
        let mut rng = random(seed);
        let bricks = Bricks::of_box(IVec3::ZERO, UVec3::new(12, 11, 8), |v| (v.x + v.y + v.z) % 5 != 0);
        let offset = std::array::from_fn(|_| rng.random_range(-0.5f32..0.5));
        let positions = Samples::all(&bricks, offset).positions();
        let clear = |splat: &Splat| {
            let footprint = reference::splat_bounds::footprint(&splat.into(), kernel);
            kernel == Kernel::Compact
                || positions.iter().all(|&x| {
                    let q = (footprint.whitening * (x - footprint.mean)).length_squared();
                    let cut = (x - footprint.mean).abs().max_element() - kernel.row().reach;
                    (q - kernel.support_q()).abs() > 2e-3 && (cut - 1e-3).abs() > 2e-3
                })
        };
        let splats = (0..12)
            .map(|_| {
                std::iter::repeat_with(|| make(&mut rng))
                    .find(&clear)
                    .expect("one without a sample at its cut-off")
            })
            .collect();
        let targets = (0..bricks.len() * 512)
            .map(|i| {
                let (value, m) = (rng.random_range(-0.5f32..0.5), rng.random_range(0.0f32..1.0));
                let active = bricks.is_active(i / 512, i % 512);
                if !active { Target::IDLE } else { Target::new(value, if soft { m } else { m.round() }) }
            })
            .collect();
        Small { bricks, splats, targets, offset, kernel, soft }
    }

    fn terms(&self) -> Vec<Weighted> {
        step::all_terms(self.soft)
    }
}

fn scenes(make: impl Fn(&mut Pcg64) -> Splat + Copy) -> Vec<Small> {
    let mut seed = 40;
    let mut out = Vec::new();
    for kernel in KERNELS.map(|row| row.kernel) {
        for soft in [false, true] {
            seed += 1;
            out.push(Small::new(seed, kernel, soft, make));
        }
    }
    out
}

fn usual(rng: &mut Pcg64) -> Splat {
    splat(rng, Vec3::new(11.0, 10.0, 7.0))
}

/// The ends of what the fit allows: nearly transparent and nearly opaque, smallest and largest, needles and discs.
fn extreme(rng: &mut Pcg64) -> Splat {
    let mut splat = usual(rng);
    splat.opacity_logit = if rng.random_bool(0.5) { 8.5 } else { -8.5 };
    splat.log_scale = std::array::from_fn(|_| if rng.random_bool(0.6) { 0.4f32.ln() } else { 10f32.ln() });
    splat
}

/// Compares all parameters of all splats with central differences. The error is measured against the largest
/// derivative of the same kind: a small one is a difference of large contributions.
fn check_reference(what: &str, small: &Small, bound: f64) {
    let samples = Samples::all(&small.bricks, small.offset);
    let positions = samples.positions();
    let targets: Vec<reference::Target> = small.targets.iter().map(Into::into).collect();
    let splats: Vec<reference::Splat> = small
        .splats
        .iter()
        .map(|s| {
            let s = reference::Splat::from(s);
            reference::Splat { rotation: s.rotation.normalize(), ..s }
        })
        .collect();
    let epsilon = f64::from(EPSILON);
    for term in small.terms() {
        let terms = step::terms64(&[term]);
        let gradient = objective::gradient(&splats, &positions, &targets, &terms, small.kernel, epsilon);
        let loss = |splats: &[reference::Splat]| {
            reference::objective(splats, &positions, &targets, &terms, small.kernel, epsilon)
        };
        // A long needle multiplies the step of a rotation by 60 in units of its short axis.
        let h = 1e-5;
        // What the rounding of the objective, some units of its last place, leaves of a difference.
        let noise = 8.0 * f64::EPSILON * loss(&splats).abs() / h;
        let mut pairs = vec![Vec::new(); LANES];
        for (i, splat) in splats.iter().enumerate() {
            let mut moved = splats.clone();
            for (lane, pairs) in pairs.iter_mut().enumerate() {
                let mut at = |step: f64| {
                    moved[i] = splat.moved(lane, step);
                    loss(&moved)
                };
                let difference = (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
                pairs.push((gradient[i].lanes()[lane], difference));
            }
        }
        for (lane, pairs) in pairs.into_iter().enumerate() {
            let name = format!("{what}: {}, {}", TERMS[term.term].name, LANE_NAMES[lane]);
            let largest = pairs.iter().fold(0.0f64, |a, p| a.max(p.1.abs()));
            if !terms[0].knows_intensity() && lane == 10 {
                assert_eq!(largest, 0.0, "{name}: W knows no intensity");
                continue;
            }
            assert!(largest > 1e-6, "{name}: there is something to compare");
            assert_close(&name, Bound::new(bound * largest + noise, bound), pairs);
        }
    }
}

#[test]
fn the_reference_has_the_derivative_of_the_objective() {
    for small in scenes(usual) {
        check_reference(&format!("{}, soft {}", small.kernel.name(), small.soft), &small, 1e-6);
    }
}

#[test]
fn the_reference_has_the_derivative_at_the_ends_of_the_range() {
    for small in scenes(extreme) {
        check_reference(&format!("extreme, {}, soft {}", small.kernel.name(), small.soft), &small, 1e-5);
    }
}

#[test]
fn a_parameter_moves_along_its_own_axis() {
    let splat: reference::Splat = (&usual(&mut random(1))).into();
    let axes = glam::DMat3::from_quat(splat.rotation);
    for k in 0..3 {
        let turned = glam::DMat3::from_quat(splat.moved(4 + k, 0.3).rotation);
        assert!((turned.col(k) - axes.col(k)).length() < 1e-6, "the axis of a rotation stays");
        let turn = turned.col((k + 1) % 3) - axes.col((k + 1) % 3);
        assert!(turn.dot(axes.col((k + 2) % 3)) > 0.2, "the next axis turns towards the one after it");
    }
}

/// The whole chain on the device, from parameters to gradient rows, against the whole chain in f64.
#[test]
fn the_device_has_the_gradient_of_the_reference() {
    let gpu = Device::boot();
    for (which, scenes, bound) in [("usual", scenes(usual), 5e-5), ("extreme", scenes(extreme), 3e-4)] {
        for small in scenes {
            let Small { bricks, splats, targets, offset, kernel, soft } = &small;
            // All together, then each alone.
            let all = small.terms();
            for terms in std::iter::once(&all[..]).chain(all.chunks(1)) {
                let pass = step::run_with(&gpu, bricks, splats, targets, *kernel, *offset, terms);
                let samples = Samples::all(bricks, *offset);
                let wanted = objective::gradient(
                    &splats.iter().map(Into::into).collect::<Vec<_>>(),
                    &samples.positions(),
                    &targets.iter().map(Into::into).collect::<Vec<_>>(),
                    &step::terms64(terms),
                    *kernel,
                    f64::from(EPSILON),
                );
                let got: Vec<Gradient> = pass.gradients.iter().map(Into::into).collect();
                for (lane, parameter) in LANE_NAMES.iter().enumerate() {
                    let pairs: Vec<_> =
                        got.iter().zip(&wanted).map(|(g, w)| (g.lanes()[lane], w.lanes()[lane])).collect();
                    let largest = pairs.iter().fold(0.0f64, |a, p| a.max(p.1.abs()));
                    let names: Vec<_> = terms.iter().map(|t| TERMS[t.term].name).collect();
                    let name =
                        format!("device, {which}, {}, soft {soft}, {names:?}: {parameter}", kernel.name());
                    assert_close(&name, Bound::new(bound * largest, bound), pairs);
                }
            }
        }
    }
}
