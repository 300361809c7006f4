//! The table of losses, and terms of a fit: losses with their numbers.

use super::loss::{Loss, Numbers, Overlap, Quantity, TermAt};
use super::{dice, kl, leak, mse, occupancy, square, tail};
use crate::{Adjoint, Reconstruction, Target};

/// All losses.
pub static LOSSES: [Loss; 7] =
    [mse::LOSS, occupancy::LOSS, dice::LOSS, leak::LOSS, square::LOSS, kl::LOSS, tail::LOSS];

/// A loss with its numbers.
#[derive(Clone, Copy)]
pub struct Term {
    /// The loss.
    pub loss: &'static Loss,
    /// Its numbers.
    pub numbers: Numbers,
}

impl Term {
    /// Creates a term of the loss called `name`.
    ///
    /// # Panics
    /// If there is no such loss.
    pub fn new(name: &str, numbers: Numbers) -> Self {
        let loss = LOSSES.iter().find(|loss| loss.name == name);
        Term {
            loss: loss.unwrap_or_else(|| panic!("the loss {name} has no reference implementation")),
            numbers,
        }
    }

    /// Returns λ.
    pub fn lambda(&self) -> f64 {
        self.numbers.weight
    }

    /// Returns true if its derivatives by intensities are not all 0.
    pub fn knows_intensity(&self) -> bool {
        self.loss.of_intensity || self.numbers.quantity != Quantity::Mask
    }

    /// Returns what the term adds to the objective, given its sums of value and weight over all samples.
    pub fn total(&self, sums: [f64; 2]) -> f64 {
        (self.loss.total)(&self.numbers, sums)
    }

    /// Returns the overlap over all samples that the term needs; zeros for terms that need none.
    pub fn overlap(&self, targets: &[Target], got: &[Reconstruction]) -> Overlap {
        let Numbers { quantity, region, .. } = self.numbers;
        if self.loss.overlaps { Overlap::of(targets, got, quantity, region) } else { Overlap::default() }
    }

    /// Evaluates the term at one sample; returns zeros if the sample takes no part. `overlap` is that of all
    /// samples.
    pub fn at(&self, wanted: Target, got: Reconstruction, overlap: &Overlap) -> TermAt {
        if wanted.occupancy < 0.0 {
            return TermAt::default();
        }
        (self.loss.at)(&self.numbers, wanted, got, overlap)
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
