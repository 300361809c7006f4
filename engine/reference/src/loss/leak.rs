//! `loss_leak`: λ/2 Σ n m̂^k, n = 1 - M without a threshold and \[M ≤ region\] with one; the parameter is k.

use super::loss::{Loss, Numbers, Overlap, Quantity, TermAt, Trial, is_inside, predicted_mask};
use crate::{Reconstruction, Target};

/// The row.
pub const LOSS: Loss = Loss {
    name: "leak",
    at,
    total: |numbers, [value, _]| numbers.half(value),
    overlaps: false,
    of_intensity: false,
    trial: Trial { weight: 0.6, parameters: &[1.0, 2.0], tolerances: &[0.0], rounding: 3e-6 },
};

fn at(numbers: &Numbers, wanted: Target, got: Reconstruction, _: &Overlap) -> TermAt {
    let outside = match numbers.region < 0.0 {
        true => 1.0 - wanted.occupancy,
        false => f64::from(u8::from(!is_inside(wanted, numbers.region))),
    };
    let (power, predicted) = (numbers.parameter as i32, predicted_mask(got.weight));
    let slope = f64::from(power) * predicted.powi(power - 1);
    TermAt {
        value: outside * predicted.powi(power),
        weight: outside,
        adjoint: Quantity::Mask.adjoint(numbers.half(outside * slope), got),
    }
}
