//! `loss_tail`: λ/2 Σ m t(V̂ - V), t(r) = r⁴/(2 s²) up to |r| = 4 s and 16 r² - 128 s² beyond; the parameter is s. Without a
//! threshold m = M; with one m = [M > region].

use super::loss::{Loss, Numbers, Overlap, TermAt, Trial, is_inside};
use crate::{Adjoint, Reconstruction, Target};

/// The row.
pub const LOSS: Loss = Loss {
    name: "tail",
    at,
    total: |numbers, [value, _]| numbers.half(value),
    overlaps: false,
    of_intensity: true,
    // Errors of trials lie on both sides of 4 s.
    trial: Trial { weight: 0.5, parameters: &[0.3, 0.02], tolerances: &[0.0], rounding: 3e-6 },
};

/// Greatest part of the derivative of r² that the term's is.
const MOST: f64 = 16.0;

fn at(numbers: &Numbers, wanted: Target, got: Reconstruction, _: &Overlap) -> TermAt {
    let m = match numbers.region < 0.0 {
        true => wanted.occupancy,
        false => f64::from(u8::from(is_inside(wanted, numbers.region))),
    };
    let (r, s) = (got.value - wanted.value, numbers.parameter);
    let times = (r / s).powi(2);
    let value = if times < MOST { 0.5 * times * r * r } else { MOST * (r * r - 0.5 * MOST * s * s) };
    let slope = r * times.min(MOST);
    TermAt {
        value: m * value,
        weight: m,
        adjoint: Adjoint { value: numbers.weight * m * slope, weight: 0.0 },
    }
}
