//! `loss_dice`: λ/2 (1 - (2 Σ pt + s) / (Σ p + Σ t + s)) over the region; the parameter is s.

use super::loss::{Loss, Numbers, Overlap, TermAt, Trial, is_inside};
use crate::{Reconstruction, Target};

/// The row. The slope by one sample is small, about 1 / S; λ makes it matter beside the adjoints of other terms.
pub const LOSS: Loss = Loss {
    name: "dice",
    at,
    total: |numbers, [value, weight]| {
        let size = weight + numbers.parameter;
        numbers.half(if size > 0.0 { value / size } else { value })
    },
    overlaps: true,
    of_intensity: false,
    trial: Trial { weight: 1500.0, parameters: &[0.0, 1.0], tolerances: &[0.0], rounding: 3e-6 },
};

fn at(numbers: &Numbers, wanted: Target, got: Reconstruction, overlap: &Overlap) -> TermAt {
    if !is_inside(wanted, numbers.region) {
        return TermAt::default();
    }
    let Numbers { weight, parameter: smoothing, quantity, .. } = *numbers;
    let (p, t) = (quantity.predicted(got), quantity.wanted(wanted));
    let size = overlap.size() + smoothing;
    let whole = overlap.intersection + 0.5 * smoothing;
    let half_slope = if size > 0.0 { (whole / size - t) / size } else { 0.0 };
    let adjoint = quantity.adjoint(weight * half_slope, got);
    TermAt { value: p + t - 2.0 * p * t, weight: p + t, adjoint }
}
