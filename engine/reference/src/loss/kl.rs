//! `loss_kl`: λ/2 Σ t ln(t/p) over the region, p and t kept in [[`LEAST`], 1].

use super::loss::{Loss, Numbers, Overlap, TermAt, Trial, is_inside};
use crate::{Reconstruction, Target};

/// The least p and t.
pub const LEAST: f64 = 1e-7;

/// The row. t / p has the rounding of p, which is a difference: 1 - exp(-W), or V less the lower end of the range.
pub const LOSS: Loss = Loss {
    name: "kl",
    at,
    total: |numbers, [value, _]| numbers.half(value),
    overlaps: false,
    of_intensity: false,
    trial: Trial { weight: 0.1, parameters: &[0.0], tolerances: &[0.0], rounding: 4e-5 },
};

fn at(numbers: &Numbers, wanted: Target, got: Reconstruction, _: &Overlap) -> TermAt {
    if !is_inside(wanted, numbers.region) {
        return TermAt::default();
    }
    let quantity = numbers.quantity;
    let (p, t) = (quantity.predicted(got), quantity.wanted(wanted).clamp(LEAST, 1.0));
    let kept = p.clamp(LEAST, 1.0);
    let slope = if p == kept { -0.5 * numbers.weight * t / p } else { 0.0 };
    TermAt { value: t * (t / kept).ln(), weight: 1.0, adjoint: quantity.adjoint(slope, got) }
}
