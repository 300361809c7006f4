//! The whole objective of the fit, from splats to one number, and its gradient.

use glam::DVec3;

use super::loss::{adjoints, fold, sums};
use super::splat_bounds::footprint;
use super::splat_to_volume::splat_to_volume;
use super::splat_to_volume_grad::splat_to_volume_grad;
use super::{Footprint, Gradient, Splat, Target, Term};
use splat::Kernel;

/// Returns L, the sum over the terms of [`Term::total`] of their sums over all samples.
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
    let all = targets.len().max(1);
    terms
        .iter()
        .map(|term| sums(term, targets, &got, all).iter().map(|&sum| term.total(sum)).sum::<f64>())
        .sum()
}

/// Returns dL/d(parameters) of every splat, computed by the reference implementations of the kernels.
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
