//! The whole objective and its gradient, from splats to a number: what a step of the fit makes smaller.

use glam::DVec3;

use super::loss::adjoints;
use super::loss::fold;
use super::splat_bounds::footprint;
use super::splat_to_volume::splat_to_volume;
use super::splat_to_volume_grad::splat_to_volume_grad;
use super::{Footprint, Gradient, Splat, Target, Term};
use crate::splat::Kernel;

/// L = Σ over terms and samples of λ/2 · value.
pub fn objective(
    splats: &[Splat],
    positions: &[DVec3],
    targets: &[Target],
    terms: &[Term],
    kernel: Kernel,
    epsilon: f64,
) -> f64 {
    let footprints: Vec<Footprint> = splats.iter().map(|s| footprint(s, kernel)).collect();
    let got = splat_to_volume(&footprints, positions, kernel, epsilon);
    let mut total = 0.0;
    for term in terms {
        for (&wanted, &got) in targets.iter().zip(&got) {
            total += 0.5 * term.lambda() * term.at(wanted, got).value;
        }
    }
    total
}

/// dL/d(parameters) through the twins of the kernels.
pub fn gradient(
    splats: &[Splat],
    positions: &[DVec3],
    targets: &[Target],
    terms: &[Term],
    kernel: Kernel,
    epsilon: f64,
) -> Vec<Gradient> {
    let footprints: Vec<Footprint> = splats.iter().map(|s| footprint(s, kernel)).collect();
    let got = splat_to_volume(&footprints, positions, kernel, epsilon);
    let folded: Vec<_> =
        adjoints(terms, targets, &got).into_iter().zip(&got).map(|(a, &r)| fold(r, a, epsilon)).collect();
    splat_to_volume_grad(splats, positions, &folded, kernel)
}
