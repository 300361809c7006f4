//! `loss_occupancy`: λ/2 Σ max(|O - M| - τ, 0)², O = W / (W + w0); the parameter is w0.

use super::loss::{Loss, Numbers, Overlap, TermAt, Trial};
use crate::{Adjoint, Reconstruction, Target};

/// The row.
pub const LOSS: Loss = Loss {
    name: "occupancy",
    at,
    total: |numbers, [value, _]| numbers.half(value),
    overlaps: false,
    of_intensity: false,
    trial: Trial { weight: 0.3, parameters: &[0.05, 1.0], tolerances: &[0.0, 0.4, 0.1], rounding: 3e-6 },
};

fn at(numbers: &Numbers, wanted: Target, got: Reconstruction, _: &Overlap) -> TermAt {
    let w0 = numbers.parameter;
    let error = got.weight / (got.weight + w0) - wanted.occupancy;
    let r = (error.abs() - numbers.tolerance).max(0.0).copysign(error);
    let slope = w0 / ((got.weight + w0) * (got.weight + w0));
    let adjoint = Adjoint { value: 0.0, weight: numbers.weight * r * slope };
    TermAt { value: r * r, weight: 1.0, adjoint }
}
