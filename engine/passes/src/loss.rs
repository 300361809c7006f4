//! Loss terms. A term reads samples and targets and adds its adjoints; it never sees a splat. A new term
//! needs a kernel `fit/loss_x.comp`, its reference implementation in `reference::loss`, and a row here.
//!
//! Given the sums of value and weight over all samples, a term adds λ/2 · Σ value to the objective; a term
//! that needs the overlap ([`Term::overlap`]) adds λ/2 · Σ value / Σ weight.

use std::ops::Range;

use shaders_glsl as glsl;
use shaders_glsl::Shader;
use shaders_glsl::types::{LossParams, Target};

use super::{Overlap, Storage, WorkgroupShape};
use base::error::Result;
use gpu::{Buffer, Gpu, Kernel, Recorder};
use volume::bricks::SAMPLES;

/// A row of [`TERMS`].
pub struct Term {
    /// Name in reports and curves.
    pub name: &'static str,
    /// Kernel of the term.
    pub shader: &'static Shader,
    /// True if it needs the sums of [`Overlap`] over all samples of all chunks first.
    pub overlap: bool,
    /// Quantity that it compares, if its kernel can compare either: [`MASKS`] or [`INTENSITIES`].
    pub quantity: Option<u32>,
}

/// Quantity of a term that compares the predicted mask 1 - exp(-W) with the mask.
pub const MASKS: u32 = glsl::samples::QUANTITY_MASK;
/// Quantity of a term that compares the intensities V̂ and V, from the lower end of their range on.
pub const INTENSITIES: u32 = glsl::samples::QUANTITY_INTENSITY;

/// All loss terms.
pub const TERMS: &[Term] = &[
    Term { name: "mse", shader: &glsl::LOSS_MSE, overlap: false, quantity: None },
    Term { name: "occupancy", shader: &glsl::LOSS_OCCUPANCY, overlap: false, quantity: None },
    Term { name: "dice", shader: &glsl::LOSS_DICE, overlap: true, quantity: Some(MASKS) },
    Term { name: "leak", shader: &glsl::LOSS_LEAK, overlap: false, quantity: None },
    Term { name: "square", shader: &glsl::LOSS_SQUARE, overlap: false, quantity: None },
    Term { name: "kl", shader: &glsl::LOSS_KL, overlap: false, quantity: Some(MASKS) },
    Term { name: "intensity dice", shader: &glsl::LOSS_DICE, overlap: true, quantity: Some(INTENSITIES) },
    Term { name: "intensity kl", shader: &glsl::LOSS_KL, overlap: false, quantity: Some(INTENSITIES) },
    Term { name: "tail", shader: &glsl::LOSS_TAIL, overlap: false, quantity: None },
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
/// Row of what large intensity errors weigh besides.
pub const TAIL: usize = 8;

/// A term with its λ and its parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighted {
    /// Index into [`TERMS`].
    pub term: usize,
    /// λ.
    pub weight: f32,
    /// Further parameter of the term; see its kernel.
    pub parameter: f32,
    /// Threshold: a sample is in the region if the mask exceeds it. Below 0 the term uses the mask itself, or
    /// all samples.
    pub region: f32,
    /// The lower end of the intensity range, relative to the background in units of the fit.
    pub low: f32,
    /// An error of the occupancy up to this costs nothing, 0 to 1.
    pub tolerance: f32,
}

impl Default for Weighted {
    /// Returns the squared error of intensities in a soft mask, with weight 1.
    fn default() -> Self {
        Weighted { term: MSE, weight: 1.0, parameter: 0.0, region: -1.0, low: 0.0, tolerance: 0.0 }
    }
}

impl Weighted {
    /// Returns the push constants of its kernel; ε is that of equation (2).
    pub fn params(&self, epsilon: f32) -> LossParams {
        let &Weighted { weight, parameter, region, low, tolerance, .. } = self;
        LossParams { weight, parameter, epsilon, region, low, tolerance }
    }
}

/// Value and weight of a term, summed over all samples.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sum {
    /// Σ of the unweighted term (without λ and without ½).
    pub value: f64,
    /// Σ of the weights by which the mean divides.
    pub weight: f64,
}

impl Sum {
    /// Returns the mean value; 0 if the weights sum to 0.
    pub fn mean(&self) -> f64 {
        if self.weight > 0.0 { self.value / self.weight } else { 0.0 }
    }
}

/// The samples of one chunk, for which the terms are computed.
pub struct ChunkSamples<'a> {
    /// Number of the chunk.
    pub chunk: usize,
    /// The slots that it owns.
    pub slots: Range<usize>,
    /// Targets, [slot of the chunk][Morton place].
    pub targets: &'a Buffer<Target>,
    /// W and V̂, ordered as the targets, in the storage of the fit.
    pub reconstructions: &'a Buffer<u32>,
    /// First pair of each slot ([`super::Binner::starts`]), and the sums of untouched bricks, if bricks that
    /// no splat reaches are left out; `None` if all bricks are computed.
    pub touched: Option<(&'a Buffer<u32>, &'a UntouchedSums)>,
}

/// Sums of the terms in bricks that no splat reaches: constants of the targets of one offset and chunk.
pub struct UntouchedSums {
    /// Value and weight, [term][slot of the chunk].
    losses: Vec<Buffer<[f32; 2]>>,
    /// Overlap of the terms that need it, [term][slot of the chunk].
    overlaps: Vec<Option<Buffer<[f32; 3]>>>,
}

impl UntouchedSums {
    fn new(gpu: &Gpu, terms: &[Weighted], slots: usize) -> Result<Self> {
        let losses = terms.iter().map(|_| gpu.buffer("sums of untouched bricks", "samples", slots));
        let overlaps = terms.iter().map(|t| {
            let overlap = || gpu.buffer("overlap of untouched bricks", "samples", slots);
            TERMS[t.term].overlap.then(overlap).transpose()
        });
        Ok(UntouchedSums {
            losses: losses.collect::<Result<_>>()?,
            overlaps: overlaps.collect::<Result<_>>()?,
        })
    }
}

/// The terms of one fit.
pub struct Losses {
    /// Kernel of each term.
    kernels: Vec<Kernel>,
    /// Overlap of each term that needs it.
    overlaps: Vec<Option<Overlap>>,
    /// Adjoints of the chunk in work, in the storage that was asked for.
    pub adjoints: Buffer<u32>,
    /// Value and weight of each slot, [chunk × term][slot].
    sums: Vec<Buffer<[f32; 2]>>,
    /// Stands for the first pairs of slots if every brick is computed: no two are the same.
    every: Buffer<u32>,
    /// Stands for the sums of untouched bricks, which are not read then.
    none: UntouchedSums,
    epsilon: f32,
}

impl Losses {
    /// Creates the given terms for `chunks` chunks of at most `chunk_slots` slots, with samples and adjoints
    /// in `storage`.
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
            every: gpu.upload("all slots", "samples", &(0..=chunk_slots as u32).collect::<Vec<_>>())?,
            none: UntouchedSums::new(gpu, terms, 1)?,
            epsilon,
        })
    }

    /// Returns true if all chunks must be rasterized and summed by [`Losses::record_overlap`] before the
    /// first [`Losses::record`] of a step.
    pub fn need_overlap(&self) -> bool {
        self.overlaps.iter().any(Option::is_some)
    }

    /// Records the sums over all samples that terms need before they begin; chunks come in order. Records
    /// nothing if no term needs them.
    pub fn record_overlap(&mut self, recorder: &mut Recorder, samples: &ChunkSamples) {
        let (starts, untouched) = samples.touched.unwrap_or((&self.every, &self.none));
        for (overlap, untouched) in self.overlaps.iter_mut().zip(&untouched.overlaps) {
            if let (Some(overlap), Some(untouched)) = (overlap, untouched) {
                let words = [samples.reconstructions, starts];
                overlap.record(recorder, words, samples.targets, untouched, &samples.slots);
            }
        }
    }

    /// Records all terms of one chunk and folds their adjoints for the backward pass. `terms` are those of
    /// [`Losses::new`], in that order; weights and parameters may change from step to step. In bricks that
    /// are left out ([`ChunkSamples::touched`]) the adjoints are 0.
    pub fn record(&mut self, recorder: &mut Recorder, terms: &[Weighted], samples: &ChunkSamples) {
        let count = self.kernels.len();
        assert_eq!(count, terms.len(), "the terms of a fit stay the same");
        let (starts, untouched) = samples.touched.unwrap_or((&self.every, &self.none));
        for (i, (term, kernel)) in terms.iter().zip(&self.kernels).enumerate() {
            let mut pass = recorder
                .pass(kernel)
                .read("targets", samples.targets)
                .read("reconstructions", samples.reconstructions)
                .write("adjoints", &mut self.adjoints)
                .write("loss_sums", &mut self.sums[samples.chunk * count + i])
                .read("starts", starts)
                .read("untouched_sums", &untouched.losses[i]);
            if let Some(overlap) = &self.overlaps[i] {
                pass = pass.read("overlap", &overlap.total);
            }
            pass.push(&term.params(self.epsilon)).dispatch(samples.slots.len() as u32);
        }
    }

    /// Computes the sums of bricks that no splat reaches, for all slots of a chunk. `nothing` is as large as
    /// the chunk's reconstructions and is cleared. Waits for the device.
    pub fn untouched_sums(
        &mut self,
        gpu: &Gpu,
        terms: &[Weighted],
        targets: &Buffer<Target>,
        nothing: &Buffer<u32>,
        chunk: usize,
        slots: Range<usize>,
    ) -> Result<UntouchedSums> {
        let mut untouched = UntouchedSums::new(gpu, terms, slots.len())?;
        let mut recorder = gpu.record()?;
        recorder.clear(nothing);
        let (first, count) = (slots.start, slots.len());
        let samples = ChunkSamples { chunk, slots, targets, reconstructions: nothing, touched: None };
        self.record_overlap(&mut recorder, &samples);
        self.record(&mut recorder, terms, &samples);
        let sums = &self.sums[chunk * terms.len()..][..terms.len()];
        for (from, to) in sums.iter().zip(&mut untouched.losses) {
            recorder.copy(from, 0, to, 0, count);
        }
        for (from, to) in self.overlaps.iter().zip(&mut untouched.overlaps) {
            if let (Some(from), Some(to)) = (from, to) {
                recorder.copy(&from.partials, first, to, 0, count);
            }
        }
        gpu.wait(recorder.submit()?)?;
        Ok(untouched)
    }

    /// Reads the sums of the step that was finished last, one per term in the order given; they are added in
    /// f64 in a fixed order. Waits for the device.
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
            (TAIL, "tail"),
        ];
        for (row, name) in rows {
            assert_eq!(TERMS[row].name, name);
        }
    }
}
