//! What a loss is, and what all losses share.

use crate::{Adjoint, Reconstruction, Target};

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
    pub(super) fn adjoint(&self, slope: f64, got: Reconstruction) -> Adjoint {
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
pub(super) fn is_inside(wanted: Target, region: f64) -> bool {
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

impl Default for Numbers {
    fn default() -> Self {
        Numbers { weight: 1.0, parameter: 0.0, region: -1.0, tolerance: 0.0, quantity: Quantity::Mask }
    }
}

impl Numbers {
    /// Returns λ/2 of a sum.
    pub(super) fn half(&self, value: f64) -> f64 {
        0.5 * self.weight * value
    }
}
