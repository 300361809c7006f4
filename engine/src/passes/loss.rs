//! Loss terms. A term reads samples and targets and adds its adjoints; it never sees a splat. To add one: a
//! kernel `fit/loss_x.comp`, its twin in `reference::loss`, and a row here.
//!
//! With the sums of value and weight over all samples a term adds λ/2 · Σ value to the objective; a term that
//! needs the overlap ([`Term::overlap`]) adds λ/2 · Σ value / Σ weight.

use std::ops::Range;

use shaders_glsl as glsl;
use shaders_glsl::Shader;
use shaders_glsl::types::{LossParams, Target};

use super::{Overlap, Storage, WorkgroupShape};
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Recorder};
use crate::volume::bricks::SAMPLES;

/// A row of [`TERMS`].
pub struct Term {
    /// Name in reports and curves.
    pub name: &'static str,
    /// Kernel of the term.
    pub shader: &'static Shader,
    /// True if it needs the sums of [`Overlap`] over all samples of all chunks first.
    pub overlap: bool,
    /// What it compares, where its kernel can compare either: [`MASKS`] or [`INTENSITIES`].
    pub quantity: Option<u32>,
}

/// A term compares the predicted mask 1 - exp(-W) with the mask.
pub const MASKS: u32 = glsl::samples::QUANTITY_MASK;
/// A term compares the intensities V̂ and V, from the lower end of their range on.
pub const INTENSITIES: u32 = glsl::samples::QUANTITY_INTENSITY;

/// Every loss term there is.
pub const TERMS: &[Term] = &[
    Term { name: "mse", shader: &glsl::LOSS_MSE, overlap: false, quantity: None },
    Term { name: "occupancy", shader: &glsl::LOSS_OCCUPANCY, overlap: false, quantity: None },
    Term { name: "dice", shader: &glsl::LOSS_DICE, overlap: true, quantity: Some(MASKS) },
    Term { name: "leak", shader: &glsl::LOSS_LEAK, overlap: false, quantity: None },
    Term { name: "square", shader: &glsl::LOSS_SQUARE, overlap: false, quantity: None },
    Term { name: "kl", shader: &glsl::LOSS_KL, overlap: false, quantity: Some(MASKS) },
    Term { name: "intensity dice", shader: &glsl::LOSS_DICE, overlap: true, quantity: Some(INTENSITIES) },
    Term { name: "intensity kl", shader: &glsl::LOSS_KL, overlap: false, quantity: Some(INTENSITIES) },
];

/// Row of the squared intensity error.
pub const MSE: usize = 0;
/// Row of the occupancy error.
pub const OCCUPANCY: usize = 1;
/// Row of the Dice loss of the mask.
pub const DICE: usize = 2;
/// Row of the leak penalty.
pub const LEAK: usize = 3;
/// Row of the squared error of the predicted mask.
pub const SQUARE: usize = 4;
/// Row of the divergence of the predicted mask.
pub const KL: usize = 5;
/// Row of the Dice loss of the intensity.
pub const INTENSITY_DICE: usize = 6;
/// Row of the divergence of the intensity.
pub const INTENSITY_KL: usize = 7;

/// A term with its λ and its parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighted {
    /// Index into [`TERMS`].
    pub term: usize,
    /// λ.
    pub weight: f32,
    /// What the term needs besides; see its kernel.
    pub parameter: f32,
    /// A sample is of the region where the mask is above this; below 0 the term has the mask itself, or all
    /// samples.
    pub region: f32,
    /// The lower end of the intensity range, relative to the background in units of the fit.
    pub low: f32,
}

impl Default for Weighted {
    /// The squared error of intensities in a soft mask.
    fn default() -> Self {
        Weighted { term: MSE, weight: 1.0, parameter: 0.0, region: -1.0, low: 0.0 }
    }
}

impl Weighted {
    /// Returns what its kernel is told; ε is that of equation (2).
    pub fn params(&self, epsilon: f32) -> LossParams {
        let &Weighted { weight, parameter, region, low, .. } = self;
        LossParams { weight, parameter, epsilon, region, low }
    }
}

/// Value and weight of a term, summed over all samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sum {
    /// Σ of the unweighted term (without λ and without ½).
    pub value: f64,
    /// Σ of what the mean divides by.
    pub weight: f64,
}

impl Sum {
    /// Returns the mean value; 0 where nothing has a weight.
    pub fn mean(&self) -> f64 {
        if self.weight > 0.0 { self.value / self.weight } else { 0.0 }
    }
}

/// The terms of one fit.
pub struct Losses {
    /// Of each term.
    kernels: Vec<Kernel>,
    /// Of each term that needs it.
    overlaps: Vec<Option<Overlap>>,
    /// Adjoints of the chunk in work, in the storage that was asked for.
    pub adjoints: Buffer<u32>,
    /// One row per term: the sums of each slot, all chunks.
    sums: Vec<Buffer<[f32; 2]>>,
    epsilon: f32,
}

impl Losses {
    /// Makes the given terms over chunks of at most `chunk_slots` slots, `chunks` of them; samples and
    /// adjoints in that storage.
    pub fn new(
        gpu: &Gpu,
        terms: &[Weighted],
        epsilon: f32,
        storage: Storage,
        chunk_slots: usize,
        chunks: usize,
    ) -> Result<Self> {
        let last = terms.len().saturating_sub(1);
        let shape = WorkgroupShape::of(gpu);
        let kernels: Result<Vec<_>> = terms
            .iter()
            .enumerate()
            .map(|(i, t)| {
                // The first term overwrites the adjoints, the last one folds them; see loss.glsl.
                let mut constants =
                    vec![u32::from(i > 0), u32::from(i == last), storage as u32, shape as u32];
                constants.extend(TERMS[t.term].quantity);
                Kernel::new(gpu, TERMS[t.term].shader, &constants)
            })
            .collect();
        let sums: Result<Vec<_>> = (0..terms.len() * chunks)
            .map(|i| gpu.buffer(&format!("loss sums {i}"), "samples", chunk_slots))
            .collect();
        let slots = chunk_slots * chunks;
        let overlaps: Result<Vec<_>> = terms
            .iter()
            .map(|t| match TERMS[t.term] {
                Term { overlap: true, quantity, .. } => {
                    let quantity = quantity.unwrap_or(MASKS);
                    Overlap::new(gpu, storage, slots, quantity, t.region, t.low).map(Some)
                }
                _ => Ok(None),
            })
            .collect();
        Ok(Losses {
            kernels: kernels?,
            overlaps: overlaps?,
            adjoints: gpu.buffer("adjoints", "samples", chunk_slots * SAMPLES * storage.words())?,
            sums: sums?,
            epsilon,
        })
    }

    /// True if all chunks must be rasterized and summed by [`Losses::record_overlap`] before the first
    /// [`Losses::record`] of a step.
    pub fn need_overlap(&self) -> bool {
        self.overlaps.iter().any(Option::is_some)
    }

    /// Records what terms need of all samples before they begin, of the chunk that owns `slots`; chunks come
    /// in order. Nothing where no term needs it.
    pub fn record_overlap(
        &mut self,
        recorder: &mut Recorder,
        targets: &Buffer<Target>,
        reconstructions: &Buffer<u32>,
        slots: Range<usize>,
    ) {
        for overlap in self.overlaps.iter_mut().flatten() {
            overlap.record(recorder, targets, reconstructions, slots.clone());
        }
    }

    /// Records all terms of one chunk and folds their adjoints for the backward pass. `terms` are those of
    /// [`Losses::new`], in that order; weights and parameters may change from step to step.
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        terms: &[Weighted],
        targets: &Buffer<Target>,
        reconstructions: &Buffer<u32>,
        chunk: usize,
        slots: usize,
    ) {
        let count = self.kernels.len();
        assert_eq!(count, terms.len(), "the terms of a fit stay the same");
        for (i, (term, kernel)) in terms.iter().zip(&self.kernels).enumerate() {
            let mut pass = recorder
                .pass(kernel)
                .read("targets", targets)
                .read("reconstructions", reconstructions)
                .write("adjoints", &mut self.adjoints)
                .write("loss_sums", &mut self.sums[chunk * count + i]);
            if let Some(overlap) = &self.overlaps[i] {
                pass = pass.read("overlap", &overlap.total);
            }
            pass.push(&term.params(self.epsilon)).dispatch(slots as u32);
        }
    }

    /// Reads the sums of the step that was finished last, one per term in the order given. Waits for the
    /// device; summed in f64 in a fixed order.
    pub fn sums(&self) -> Result<Vec<Sum>> {
        let count = self.kernels.len();
        let mut out = vec![Sum::default(); count];
        for (i, buffer) in self.sums.iter().enumerate() {
            for [value, weight] in buffer.read()? {
                out[i % count].value += f64::from(value);
                out[i % count].weight += f64::from(weight);
            }
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_where_their_names_say() {
        let rows = [
            (MSE, "mse"),
            (OCCUPANCY, "occupancy"),
            (DICE, "dice"),
            (LEAK, "leak"),
            (SQUARE, "square"),
            (KL, "kl"),
            (INTENSITY_DICE, "intensity dice"),
            (INTENSITY_KL, "intensity kl"),
        ];
        for (row, name) in rows {
            assert_eq!(TERMS[row].name, name);
        }
    }
}
