//! `loss_mse`, `loss_occupancy`, `loss_dice`, `loss_leak`: value, weight and adjoint of each term at a sample, and their
//! sums; `overlap_sums`, `sum_triples`: what the Dice loss needs of all samples first.

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
    /// λ/2 (1 - 2 Σ m̂M / (Σ m̂ + ΣM)), m̂ = 1 - exp(-W).
    Dice {
        /// λ.
        weight: f64,
    },
    /// λ/2 Σ (1 - M) m̂.
    Leak {
        /// λ.
        weight: f64,
    },
}

/// Sums over all samples that take part: how predicted mask m̂ = 1 - exp(-W) and M overlap.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overlap {
    /// I = Σ m̂M.
    pub intersection: f64,
    /// Σ m̂.
    pub predicted: f64,
    /// ΣM.
    pub wanted: f64,
}

impl Overlap {
    /// Of some samples.
    pub fn of(targets: &[Target], got: &[Reconstruction]) -> Self {
        let mut sum = Overlap::default();
        for (wanted, got) in targets.iter().zip(got).filter(|(t, _)| t.occupancy >= 0.0) {
            let predicted = predicted_mask(got.weight);
            sum.intersection += predicted * wanted.occupancy;
            sum.predicted += predicted;
            sum.wanted += wanted.occupancy;
        }
        sum
    }

    /// S = Σ m̂ + ΣM.
    pub fn size(&self) -> f64 {
        self.predicted + self.wanted
    }
}

/// `overlap_sums`: Σ m̂M, Σ m̂ and ΣM of `samples_per_sum` samples at a time.
pub fn overlap_sums(targets: &[Target], got: &[Reconstruction], samples_per_sum: usize) -> Vec<[f64; 3]> {
    let groups = targets.chunks(samples_per_sum).zip(got.chunks(samples_per_sum));
    groups.map(|(t, r)| Overlap::of(t, r)).map(|o| [o.intersection, o.predicted, o.wanted]).collect()
}

/// `sum_triples`: the sum of all rows.
pub fn sum_triples(rows: &[[f64; 3]]) -> [f64; 3] {
    rows.iter().fold([0.0; 3], |sum, row| std::array::from_fn(|k| sum[k] + row[k]))
}

/// m̂ = 1 - exp(-W).
pub fn predicted_mask(weight: f64) -> f64 {
    -(-weight).exp_m1()
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
            Term::Mse { weight, .. }
            | Term::Occupancy { weight, .. }
            | Term::Dice { weight }
            | Term::Leak { weight } => weight,
        }
    }

    /// What the term adds to the objective, from its sums of value and weight over all samples.
    pub fn total(&self, [value, weight]: [f64; 2]) -> f64 {
        match self {
            Term::Dice { .. } if weight > 0.0 => 0.5 * self.lambda() * value / weight,
            _ => 0.5 * self.lambda() * value,
        }
    }

    /// The term at one sample; nothing where the sample takes no part. `overlap` is that of all samples.
    pub fn at(&self, wanted: Target, got: Reconstruction, overlap: &Overlap) -> TermAt {
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
            Term::Dice { weight } => {
                let (m, predicted, size) = (wanted.occupancy, predicted_mask(got.weight), overlap.size());
                let half_slope = if size > 0.0 { (overlap.intersection / size - m) / size } else { 0.0 };
                TermAt {
                    value: predicted + m - 2.0 * predicted * m,
                    weight: predicted + m,
                    adjoint: Adjoint { value: 0.0, weight: weight * half_slope * (-got.weight).exp() },
                }
            }
            Term::Leak { weight } => {
                let outside = 1.0 - wanted.occupancy;
                TermAt {
                    value: outside * predicted_mask(got.weight),
                    weight: outside,
                    adjoint: Adjoint { value: 0.0, weight: 0.5 * weight * outside * (-got.weight).exp() },
                }
            }
        }
    }
}

/// The adjoint of every sample: the sum over the terms.
pub fn adjoints(terms: &[Term], targets: &[Target], got: &[Reconstruction]) -> Vec<Adjoint> {
    let overlap = Overlap::of(targets, got);
    let mut out = vec![Adjoint::default(); targets.len()];
    for term in terms {
        for ((sum, &t), &r) in out.iter_mut().zip(targets).zip(got) {
            let adjoint = term.at(t, r, &overlap).adjoint;
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
    let overlap = Overlap::of(targets, got);
    let group = |(targets, got): (&[Target], &[Reconstruction])| {
        let mut sum = [0.0; 2];
        for (&t, &r) in targets.iter().zip(got) {
            let at = term.at(t, r, &overlap);
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
