//! `splat_to_volume`: W = Σ a κ(q) and V̂ = Σ a κ(q) c / (W + ε) at each sample.

use glam::DVec3;

use super::{Footprint, Reconstruction};
use splat::Kernel;

/// Returns w = a κ(q) of one splat at a sample.
pub fn weight(footprint: &Footprint, position: DVec3, kernel: Kernel) -> f64 {
    let d = position - footprint.mean;
    footprint.amplitude * kernel.cut_value(d, (footprint.whitening * d).length_squared())
}

/// Evaluates all splats at all samples.
pub fn splat_to_volume(
    footprints: &[Footprint],
    positions: &[DVec3],
    kernel: Kernel,
    epsilon: f64,
) -> Vec<Reconstruction> {
    let at = |&x: &DVec3| {
        let (mut total, mut sum) = (0.0, 0.0);
        for footprint in footprints {
            let w = weight(footprint, x, kernel);
            total += w;
            sum += w * footprint.intensity;
        }
        // Without ε a sample that no splat reaches has the background too.
        let value = if total > 0.0 { sum / (total + epsilon) } else { 0.0 };
        Reconstruction { weight: total, value }
    };
    positions.iter().map(at).collect()
}
