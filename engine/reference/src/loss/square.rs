//! `loss_square`: λ/2 Σ (m̂ - M)² over the region.

use super::loss::{Loss, Numbers, Overlap, Quantity, TermAt, Trial, is_inside, predicted_mask};
use crate::{Reconstruction, Target};

/// The row.
pub const LOSS: Loss = Loss {
    name: "square",
    at,
    total: |numbers, [value, _]| numbers.half(value),
    overlaps: false,
    of_intensity: false,
    trial: Trial { weight: 0.6, parameters: &[0.0], tolerances: &[0.0], rounding: 3e-6 },
};

fn at(numbers: &Numbers, wanted: Target, got: Reconstruction, _: &Overlap) -> TermAt {
    if !is_inside(wanted, numbers.region) {
        return TermAt::default();
    }
    let r = predicted_mask(got.weight) - wanted.occupancy;
    TermAt { value: r * r, weight: 1.0, adjoint: Quantity::Mask.adjoint(numbers.weight * r, got) }
}
