//! The method "relocate": the splats that the field would miss least move to where the residual is largest,
//! in the first half of the schedule. Their number stays the same.
//!
//! The score of a splat is Σₓ m (w/D)² (c − V̂)², D = W + ε: the squared change of the field per change of ln
//! α, the Gauss-Newton diagonal of ln α. It is 0 for a splat that reaches no voxel of the ROI, that other
//! splats cover, or whose intensity is that of the field already.

use glam::{DVec3, IVec3, UVec3};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::growth::UNTIL;
use super::residual::splats_at_worst;
use super::spread::slot_at;
use super::{Change, Scene};
use splat::activation::Activations;
use splat::{Kernel, Splat};
use volume::Bricks;
use volume::bricks::{BRICK, SAMPLES, brick_morton};

pub(super) fn relocate(scene: &Scene, _: &mut Pcg64) -> Change {
    let mut change = Change::none(scene);
    if scene.share >= UNTIL {
        return change;
    }
    let moved = splats_at_worst(scene, scene.most_at_once());
    if moved.is_empty() {
        return change;
    }
    let scores = scores(scene);
    let mut idle: Vec<usize> = (0..scores.len()).collect();
    idle.sort_unstable_by(|&a, &b| scores[a].total_cmp(&scores[b]).then(a.cmp(&b)));
    for (index, splat) in idle.into_iter().zip(moved) {
        change.splats[index] = splat;
        change.keeps[index] = None;
    }
    change
}

/// Values of a sample that the score needs: m / D² (0 where it does not count) and V̂ in HU.
type Term = [f32; 2];

/// Returns the score of each splat, squared HU. A score that is not finite counts as 0.
pub(super) fn scores(scene: &Scene) -> Vec<f64> {
    let epsilon = scene.config.epsilon;
    let terms = scene.map_roi([0.0; 2], |field, _, m| {
        let d = field.weight + epsilon;
        [m / (d * d), field.hu]
    });
    let score = |splat: &Splat| score(scene.bricks, &terms, splat, scene.config.kernel);
    scene.splats.par_iter().map(score).map(|score| if score.is_finite() { score } else { 0.0 }).collect()
}

/// Returns w of a splat in the middle of its support.
fn peak(splat: &Splat, kernel: Kernel) -> f64 {
    f64::from(splat.opacity()) * kernel.peak(splat.log_scale.map(f64::from))
}

/// Returns the score of a splat: the sum over its support, a row of voxels along x at a time.
fn score(bricks: &Bricks, terms: &[Term], splat: &Splat, kernel: Kernel) -> f64 {
    let support = kernel.support_q();
    let axes = splat.axes();
    let scale = DVec3::from_array(splat.scale().map(f64::from));
    // u = S⁻¹Rᵀ d; its columns are what u grows by per voxel along x, y and z.
    let step = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axes.transpose() * axis / scale);
    // Σ_kk = |row k of R S|².
    let reach = [0, 1, 2].map(|k| (support * (axes.row(k) * scale).length_squared()).sqrt());
    let mean: [f64; 3] = std::array::from_fn(|k| f64::from(splat.mean[k]) - f64::from(bricks.origin[k]));
    let last = (bricks.grid * BRICK as u32).as_ivec3() - 1;
    let range = |centre: f64, reach: f64, axis: usize| {
        ((centre - reach).ceil() as i32).max(0)..=((centre + reach).floor() as i32).min(last[axis])
    };
    let mut sum = 0.0;
    for z in range(mean[2], reach[2], 2) {
        for y in range(mean[1], reach[1], 1) {
            // q = |v + step.x dx|² along the row, below the support between the roots of a quadratic.
            let v = step[1] * (f64::from(y) - mean[1]) + step[2] * (f64::from(z) - mean[2]);
            let (a, b) = (step[0].length_squared(), step[0].dot(v));
            let discriminant = b * b - a * (v.length_squared() - support);
            if discriminant > 0.0 {
                let row = range(mean[0] - b / a, discriminant.sqrt() / a, 0);
                sum += along_row(bricks, terms, row, [y, z], f64::from(splat.intensity), |x| {
                    let d = DVec3::new(f64::from(x), f64::from(y), f64::from(z)) - DVec3::from_array(mean);
                    kernel.cut_value(d, (v + step[0] * d.x).length_squared())
                });
            }
        }
    }
    let peak = peak(splat, kernel);
    peak * peak * sum
}

/// Returns Σ m (κ/D)² (c − V̂)² over the voxels `x` of a row at (y, z), counted from the first of the grid.
fn along_row(
    bricks: &Bricks,
    terms: &[Term],
    x: std::ops::RangeInclusive<i32>,
    [y, z]: [i32; 2],
    intensity: f64,
    kappa: impl Fn(i32) -> f64,
) -> f64 {
    let edge = BRICK as i32;
    let (mut from, last) = x.into_inner();
    let row = brick_morton((IVec3::new(0, y, z) % edge).as_uvec3());
    let mut sum = 0.0;
    while from <= last {
        let to = (from / edge * edge + edge - 1).min(last);
        if let Some(slot) = slot_at(bricks, IVec3::new(from, y, z) / edge) {
            let brick = &terms[slot * SAMPLES..][..SAMPLES];
            for x in from..=to {
                let [share, hu] = brick[row | brick_morton(UVec3::new((x % edge) as u32, 0, 0))];
                if share > 0.0 {
                    let (kappa, error) = (kappa(x), intensity - f64::from(hu));
                    sum += f64::from(share) * kappa * kappa * error * error;
                }
            }
        }
        from = to + 1;
    }
    sum
}
