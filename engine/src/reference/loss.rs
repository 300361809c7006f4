//! `loss_mse`, `loss_occupancy`: value, weight and adjoint of each term at a sample, and their sums.

use super::{Adjoint, Reconstruction, Target};

/// A loss term with its λ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Term {
    /// λ/2 Σ m (V̂ - V)², m = M for a soft mask and \[M > ½\] for a binary one.
    Mse {
        /// λ.
        weight: f64,
        /// Whether the mask is soft.
        soft: bool,
    },
    /// λ/2 Σ (O - M)², O = W / (W + w0).
    Occupancy {
        /// λ.
        weight: f64,
        /// w0.
        w0: f64,
    },
}

/// A term at one sample: the unweighted value, what a mean divides by, and λ times the derivative of half the value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TermAt {
    /// Without λ and ½.
    pub value: f64,
    /// What a mean over samples divides by.
    pub weight: f64,
    /// dL/dV̂ and dL/dW.
    pub adjoint: Adjoint,
}

impl Term {
    /// λ.
    pub fn lambda(&self) -> f64 {
        match *self {
            Term::Mse { weight, .. } | Term::Occupancy { weight, .. } => weight,
        }
    }

    /// The term at one sample; nothing where the sample takes no part.
    pub fn at(&self, wanted: Target, got: Reconstruction) -> TermAt {
        if wanted.occupancy < 0.0 {
            return TermAt::default();
        }
        match *self {
            Term::Mse { weight, soft } => {
                let hard = if wanted.occupancy > 0.5 { 1.0 } else { 0.0 };
                let m = if soft { wanted.occupancy } else { hard };
                let r = got.value - wanted.value;
                TermAt {
                    value: m * r * r,
                    weight: m,
                    adjoint: Adjoint { value: weight * m * r, weight: 0.0 },
                }
            }
            Term::Occupancy { weight, w0 } => {
                let r = got.weight / (got.weight + w0) - wanted.occupancy;
                let slope = w0 / ((got.weight + w0) * (got.weight + w0));
                TermAt {
                    value: r * r,
                    weight: 1.0,
                    adjoint: Adjoint { value: 0.0, weight: weight * r * slope },
                }
            }
        }
    }
}

/// The adjoint of every sample: the sum over the terms.
pub fn adjoints(terms: &[Term], targets: &[Target], got: &[Reconstruction]) -> Vec<Adjoint> {
    let mut out = vec![Adjoint::default(); targets.len()];
    for term in terms {
        for ((sum, &t), &r) in out.iter_mut().zip(targets).zip(got) {
            let adjoint = term.at(t, r).adjoint;
            sum.value += adjoint.value;
            sum.weight += adjoint.weight;
        }
    }
    out
}

/// Σ value and Σ weight of a term over `samples_per_sum` samples at a time.
pub fn sums(
    term: &Term,
    targets: &[Target],
    got: &[Reconstruction],
    samples_per_sum: usize,
) -> Vec<[f64; 2]> {
    let group = |(targets, got): (&[Target], &[Reconstruction])| {
        let mut sum = [0.0; 2];
        for (&t, &r) in targets.iter().zip(got) {
            let at = term.at(t, r);
            sum[0] += at.value;
            sum[1] += at.weight;
        }
        sum
    };
    targets.chunks(samples_per_sum).zip(got.chunks(samples_per_sum)).map(group).collect()
}

/// The adjoint of one sample as the last term leaves it: A = dL/dV̂ / (W + ε) and H = dL/dW - A V̂, so that
/// dL/dw = A c + H and dL/dc = A w.
pub fn fold(got: Reconstruction, adjoint: Adjoint, epsilon: f64) -> Adjoint {
    let a = adjoint.value / (got.weight + epsilon);
    Adjoint { value: a, weight: adjoint.weight - a * got.value }
}
