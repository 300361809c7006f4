//! Loss terms: `loss_mse`, `loss_occupancy`, `loss_dice`, `loss_leak`, `loss_square` and `loss_kl` give
//! value, weight and adjoint of each term at a sample, and their sums; `overlap_sums` and `sum_triples` sum
//! what a Dice loss needs of all samples first.

use super::{Adjoint, Reconstruction, Target};

/// The pair of numbers, predicted and wanted, that a term compares.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Quantity {
    /// m̂ = 1 - exp(-W) is compared with M.
    Mask,
    /// V̂ is compared with V, both less the lower end of their range.
    Intensity {
        /// The lower end of the range, relative to the background.
        low: f64,
    },
}

impl Quantity {
    /// Returns the predicted number, in 0..1.
    pub fn predicted(&self, got: Reconstruction) -> f64 {
        match self {
            Quantity::Mask => predicted_mask(got.weight),
            Quantity::Intensity { low } => got.value - low,
        }
    }

    /// Returns the wanted number, in 0..1.
    pub fn wanted(&self, wanted: Target) -> f64 {
        match self {
            Quantity::Mask => wanted.occupancy,
            Quantity::Intensity { low } => wanted.value - low,
        }
    }

    /// Returns the adjoint of a sample, given the derivative `slope` of its loss by the predicted number.
    fn adjoint(&self, slope: f64, got: Reconstruction) -> Adjoint {
        match self {
            Quantity::Mask => Adjoint { value: 0.0, weight: slope * (-got.weight).exp() },
            Quantity::Intensity { .. } => Adjoint { value: slope, weight: 0.0 },
        }
    }
}

/// A loss term with its λ. In each term, `region` is a threshold: the region is the samples whose mask M
/// exceeds it. If it is below 0 there is no threshold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Term {
    /// λ/2 Σ m (V̂ - V)². Without a threshold m = M; with one m = 1 where M > region and m = `rim` where 0 <
    /// M ≤ region.
    Mse {
        /// λ.
        weight: f64,
        /// Weight of the rim.
        rim: f64,
        /// Threshold.
        region: f64,
    },
    /// λ/2 Σ max(|O - M| - τ, 0)², O = W / (W + w0).
    Occupancy {
        /// λ.
        weight: f64,
        /// w0.
        w0: f64,
        /// τ.
        tolerance: f64,
    },
    /// λ/2 (1 - (2 Σ pt + s) / (Σ p + Σ t + s)) over the region.
    Dice {
        /// λ.
        weight: f64,
        /// s.
        smoothing: f64,
        /// Threshold.
        region: f64,
        /// p and t.
        quantity: Quantity,
    },
    /// λ/2 Σ n m̂^k, n = 1 - M without a threshold and \[M ≤ region\] with one.
    Leak {
        /// λ.
        weight: f64,
        /// k.
        power: i32,
        /// Threshold.
        region: f64,
    },
    /// λ/2 Σ (m̂ - M)² over the region.
    Square {
        /// λ.
        weight: f64,
        /// Threshold.
        region: f64,
    },
    /// λ/2 Σ t ln(t/p) over the region, p and t kept in [[`KL_LEAST`], 1].
    Kl {
        /// λ.
        weight: f64,
        /// Threshold.
        region: f64,
        /// p and t.
        quantity: Quantity,
    },
}

/// The least p and t of [`Term::Kl`].
pub const KL_LEAST: f64 = 1e-7;

/// Overlap of the predicted numbers p and the wanted numbers t, as sums over all samples of the region.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Overlap {
    /// I = Σ pt.
    pub intersection: f64,
    /// Σ p.
    pub predicted: f64,
    /// Σ t.
    pub wanted: f64,
}

/// Returns true if a sample takes part in the sums over a region with the threshold `region`.
fn is_inside(wanted: Target, region: f64) -> bool {
    wanted.occupancy >= 0.0 && wanted.occupancy > region
}

impl Overlap {
    /// Computes the overlap of some samples.
    pub fn of(targets: &[Target], got: &[Reconstruction], quantity: Quantity, region: f64) -> Self {
        let mut sum = Overlap::default();
        for (&target, &got) in targets.iter().zip(got).filter(|(t, _)| is_inside(**t, region)) {
            let (predicted, wanted) = (quantity.predicted(got), quantity.wanted(target));
            sum.intersection += predicted * wanted;
            sum.predicted += predicted;
            sum.wanted += wanted;
        }
        sum
    }

    /// Returns S = Σ p + Σ t.
    pub fn size(&self) -> f64 {
        self.predicted + self.wanted
    }
}

/// Returns Σ pt, Σ p and Σ t of `samples_per_sum` samples at a time.
pub fn overlap_sums(
    targets: &[Target],
    got: &[Reconstruction],
    samples_per_sum: usize,
    quantity: Quantity,
    region: f64,
) -> Vec<[f64; 3]> {
    let groups = targets.chunks(samples_per_sum).zip(got.chunks(samples_per_sum));
    groups
        .map(|(t, r)| Overlap::of(t, r, quantity, region))
        .map(|o| [o.intersection, o.predicted, o.wanted])
        .collect()
}

/// Returns the sum of all rows.
pub fn sum_triples(rows: &[[f64; 3]]) -> [f64; 3] {
    rows.iter().fold([0.0; 3], |sum, row| std::array::from_fn(|k| sum[k] + row[k]))
}

/// Returns m̂ = 1 - exp(-W).
pub fn predicted_mask(weight: f64) -> f64 {
    -(-weight).exp_m1()
}

/// A term at one sample: the unweighted value, what a mean divides by, and λ times the derivative of half the
/// value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TermAt {
    /// Value of the term without λ and ½.
    pub value: f64,
    /// Weight by which a mean over samples divides.
    pub weight: f64,
    /// dL/dV̂ and dL/dW.
    pub adjoint: Adjoint,
}

impl Term {
    /// Returns λ.
    pub fn lambda(&self) -> f64 {
        match *self {
            Term::Mse { weight, .. }
            | Term::Occupancy { weight, .. }
            | Term::Dice { weight, .. }
            | Term::Leak { weight, .. }
            | Term::Square { weight, .. }
            | Term::Kl { weight, .. } => weight,
        }
    }

    /// Returns what the term adds to the objective, given its sums of value and weight over all samples.
    pub fn total(&self, [value, weight]: [f64; 2]) -> f64 {
        match self {
            Term::Dice { smoothing, .. } if weight + smoothing > 0.0 => {
                0.5 * self.lambda() * value / (weight + smoothing)
            }
            _ => 0.5 * self.lambda() * value,
        }
    }

    /// Returns the overlap over all samples that the term needs; zeros for terms that need none.
    pub fn overlap(&self, targets: &[Target], got: &[Reconstruction]) -> Overlap {
        match *self {
            Term::Dice { quantity, region, .. } => Overlap::of(targets, got, quantity, region),
            _ => Overlap::default(),
        }
    }

    /// Evaluates the term at one sample; returns zeros if the sample takes no part. `overlap` is that of all
    /// samples.
    pub fn at(&self, wanted: Target, got: Reconstruction, overlap: &Overlap) -> TermAt {
        if wanted.occupancy < 0.0 {
            return TermAt::default();
        }
        let m = wanted.occupancy;
        match *self {
            Term::Mse { weight, rim, region } => {
                let m = match is_inside(wanted, region) {
                    _ if region < 0.0 => m,
                    true => 1.0,
                    false if m > 0.0 => rim,
                    false => 0.0,
                };
                let r = got.value - wanted.value;
                TermAt {
                    value: m * r * r,
                    weight: m,
                    adjoint: Adjoint { value: weight * m * r, weight: 0.0 },
                }
            }
            Term::Occupancy { weight, w0, tolerance } => {
                let error = got.weight / (got.weight + w0) - m;
                let r = (error.abs() - tolerance).max(0.0).copysign(error);
                let slope = w0 / ((got.weight + w0) * (got.weight + w0));
                TermAt {
                    value: r * r,
                    weight: 1.0,
                    adjoint: Adjoint { value: 0.0, weight: weight * r * slope },
                }
            }
            Term::Dice { weight, smoothing, region, quantity } => {
                if !is_inside(wanted, region) {
                    return TermAt::default();
                }
                let (p, t) = (quantity.predicted(got), quantity.wanted(wanted));
                let size = overlap.size() + smoothing;
                let whole = overlap.intersection + 0.5 * smoothing;
                let half_slope = if size > 0.0 { (whole / size - t) / size } else { 0.0 };
                TermAt {
                    value: p + t - 2.0 * p * t,
                    weight: p + t,
                    adjoint: quantity.adjoint(weight * half_slope, got),
                }
            }
            Term::Leak { weight, power, region } => {
                let outside = match region < 0.0 {
                    true => 1.0 - m,
                    false => f64::from(u8::from(!is_inside(wanted, region))),
                };
                let predicted = predicted_mask(got.weight);
                let slope = f64::from(power) * predicted.powi(power - 1);
                TermAt {
                    value: outside * predicted.powi(power),
                    weight: outside,
                    adjoint: Quantity::Mask.adjoint(0.5 * weight * outside * slope, got),
                }
            }
            Term::Square { weight, region } => {
                if !is_inside(wanted, region) {
                    return TermAt::default();
                }
                let r = predicted_mask(got.weight) - m;
                TermAt { value: r * r, weight: 1.0, adjoint: Quantity::Mask.adjoint(weight * r, got) }
            }
            Term::Kl { weight, region, quantity } => {
                if !is_inside(wanted, region) {
                    return TermAt::default();
                }
                let (p, t) = (quantity.predicted(got), quantity.wanted(wanted).clamp(KL_LEAST, 1.0));
                let kept = p.clamp(KL_LEAST, 1.0);
                let slope = if p == kept { -0.5 * weight * t / p } else { 0.0 };
                TermAt { value: t * (t / kept).ln(), weight: 1.0, adjoint: quantity.adjoint(slope, got) }
            }
        }
    }
}

/// Returns the adjoint of every sample: the sum over the terms.
pub fn adjoints(terms: &[Term], targets: &[Target], got: &[Reconstruction]) -> Vec<Adjoint> {
    let mut out = vec![Adjoint::default(); targets.len()];
    for term in terms {
        let overlap = term.overlap(targets, got);
        for ((sum, &t), &r) in out.iter_mut().zip(targets).zip(got) {
            let adjoint = term.at(t, r, &overlap).adjoint;
            sum.value += adjoint.value;
            sum.weight += adjoint.weight;
        }
    }
    out
}

/// Returns Σ value and Σ weight of a term over `samples_per_sum` samples at a time.
pub fn sums(
    term: &Term,
    targets: &[Target],
    got: &[Reconstruction],
    samples_per_sum: usize,
) -> Vec<[f64; 2]> {
    let overlap = term.overlap(targets, got);
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

/// Folds the adjoint of one sample as the last term does: A = dL/dV̂ / (W + ε) and H = dL/dW - A V̂, so that
/// dL/dw = A c + H and dL/dc = A w.
pub fn fold(got: Reconstruction, adjoint: Adjoint, epsilon: f64) -> Adjoint {
    let a = adjoint.value / (got.weight + epsilon);
    Adjoint { value: a, weight: adjoint.weight - a * got.value }
}
