//! `loss_mse`: λ/2 Σ m (V̂ - V)². Without a threshold m = M; with one m = 1 where M > region, and where 0 < M ≤ region it is
//! the parameter, the weight of the rim.

use super::loss::{Loss, Numbers, Overlap, TermAt, Trial, is_inside};
use crate::{Adjoint, Reconstruction, Target};

/// The row.
pub const LOSS: Loss = Loss {
    name: "mse",
    at,
    total: |numbers, [value, _]| numbers.half(value),
    overlaps: false,
    of_intensity: true,
    trial: Trial { weight: 0.7, parameters: &[0.0, 0.1], tolerances: &[0.0], rounding: 3e-6 },
};

fn at(numbers: &Numbers, wanted: Target, got: Reconstruction, _: &Overlap) -> TermAt {
    let m = match is_inside(wanted, numbers.region) {
        _ if numbers.region < 0.0 => wanted.occupancy,
        true => 1.0,
        false if wanted.occupancy > 0.0 => numbers.parameter,
        false => 0.0,
    };
    let r = got.value - wanted.value;
    TermAt { value: m * r * r, weight: m, adjoint: Adjoint { value: numbers.weight * m * r, weight: 0.0 } }
}
