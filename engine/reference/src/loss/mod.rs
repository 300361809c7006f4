//! Loss terms: a file for each kernel `loss_x` gives value, weight and adjoint of its term at a sample, and says with what
//! numbers tests try it; it is a row of [`LOSSES`]. `overlap_sums` and `sum_triples` sum what a Dice loss needs of all
//! samples first.

mod dice;
mod kl;
mod leak;
mod mse;
mod occupancy;
mod square;

pub use kl::LEAST as KL_LEAST;

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

/// The loss of a kernel `loss_x`.
pub struct Loss {
    /// Name of the kernel behind `loss_`.
    pub name: &'static str,
    /// Evaluates the term at one sample that takes part; [`Overlap`] is that of all samples.
    pub at: fn(&Numbers, Target, Reconstruction, &Overlap) -> TermAt,
    /// Returns what the term adds to the objective, given its sums of value and weight over all samples.
    pub total: fn(&Numbers, [f64; 2]) -> f64,
    /// True if it needs the overlap of all samples.
    pub overlaps: bool,
    /// True if it compares intensities whatever its quantity.
    pub of_intensity: bool,
    /// How tests try it.
    pub trial: Trial,
}

/// The numbers with which tests try a loss.
pub struct Trial {
    /// λ with which it matters beside other terms.
    pub weight: f32,
    /// Parameters; of fits the first with a binary mask, the last with a soft one.
    pub parameters: &'static [f32],
    /// Tolerances; of fits the last with a binary mask, the first with a soft one.
    pub tolerances: &'static [f32],
    /// Rounding of an adjoint by its kernel, relative.
    pub rounding: f64,
}

/// All losses.
pub static LOSSES: [Loss; 6] = [mse::LOSS, occupancy::LOSS, dice::LOSS, leak::LOSS, square::LOSS, kl::LOSS];

/// The numbers of a term, as its kernel gets them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Numbers {
    /// λ.
    pub weight: f64,
    /// The parameter of the loss; its file says which.
    pub parameter: f64,
    /// A threshold: the region is the samples whose mask M exceeds it. Below 0 there is none.
    pub region: f64,
    /// τ.
    pub tolerance: f64,
    /// p and t.
    pub quantity: Quantity,
}

/// A loss with its numbers.
#[derive(Clone, Copy)]
pub struct Term {
    /// The loss.
    pub loss: &'static Loss,
    /// Its numbers.
    pub numbers: Numbers,
}

impl Default for Numbers {
    fn default() -> Self {
        Numbers { weight: 1.0, parameter: 0.0, region: -1.0, tolerance: 0.0, quantity: Quantity::Mask }
    }
}

impl Numbers {
    /// Returns λ/2 of a sum.
    fn half(&self, value: f64) -> f64 {
        0.5 * self.weight * value
    }
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
