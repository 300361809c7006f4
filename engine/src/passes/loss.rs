//! Loss terms. A term reads samples and targets and adds its adjoints; it never sees a splat. To add one: a kernel
//! `fit/loss_x.comp`, its twin in `reference::loss`, and a row here.

use shaders_glsl as glsl;
use shaders_glsl::Shader;
use shaders_glsl::types::{LossParams, Target};

use super::Storage;
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Recorder};
use crate::volume::bricks::SAMPLES;

/// A row of [`TERMS`].
pub struct Term {
    /// Name in reports and curves.
    pub name: &'static str,
    /// Kernel of the term.
    pub shader: &'static Shader,
}

/// Every loss term there is.
pub const TERMS: &[Term] = &[
    Term { name: "mse", shader: &glsl::LOSS_MSE },
    Term { name: "occupancy", shader: &glsl::LOSS_OCCUPANCY },
];

/// Which term, with which λ and which parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weighted {
    /// Index into [`TERMS`].
    pub term: usize,
    /// λ.
    pub weight: f32,
    /// What the term needs besides; see its kernel.
    pub parameter: f32,
}

/// Value and weight of a term, summed over all samples: the mean is value / weight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sum {
    /// Σ of the unweighted term (without λ and without ½).
    pub value: f64,
    /// Σ of what the mean divides by.
    pub weight: f64,
}

/// The terms of one fit.
pub struct Losses {
    terms: Vec<(Weighted, Kernel)>,
    /// Adjoints of the chunk in work, in the storage that was asked for.
    pub adjoints: Buffer<u32>,
    /// One row per term: the sums of each slot, all chunks.
    sums: Vec<Buffer<[f32; 2]>>,
    epsilon: f32,
}

impl Losses {
    /// The given terms over chunks of at most `chunk_slots` slots, `chunks` of them; samples and adjoints in that
    /// storage.
    pub fn new(
        gpu: &Gpu,
        terms: &[Weighted],
        epsilon: f32,
        storage: Storage,
        chunk_slots: usize,
        chunks: usize,
    ) -> Result<Self> {
        let last = terms.len().saturating_sub(1);
        let kernels: Result<Vec<_>> = terms
            .iter()
            .enumerate()
            .map(|(i, &t)| {
                // The first term overwrites the adjoints, the last one folds them; see loss.glsl.
                let constants = [u32::from(i > 0), u32::from(i == last), storage as u32];
                Ok((t, Kernel::new(gpu, TERMS[t.term].shader, &constants)?))
            })
            .collect();
        let sums: Result<Vec<_>> = (0..terms.len() * chunks)
            .map(|i| gpu.buffer(&format!("loss sums {i}"), "samples", chunk_slots))
            .collect();
        Ok(Losses {
            terms: kernels?,
            adjoints: gpu.buffer("adjoints", "samples", chunk_slots * SAMPLES * storage.words())?,
            sums: sums?,
            epsilon,
        })
    }

    /// Records all terms of one chunk and folds their adjoints for the backward pass.
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        targets: &Buffer<Target>,
        reconstructions: &Buffer<u32>,
        chunk: usize,
        slots: usize,
    ) {
        let count = self.terms.len();
        for (i, (term, kernel)) in self.terms.iter().enumerate() {
            recorder
                .pass(kernel)
                .read(targets)
                .read(reconstructions)
                .write(&mut self.adjoints)
                .write(&mut self.sums[chunk * count + i])
                .push(&LossParams { weight: term.weight, parameter: term.parameter, epsilon: self.epsilon })
                .dispatch(slots as u32);
        }
    }

    /// The sums of the step that was finished last, one per term in the order given. Waits for the device; summed in
    /// f64 in a fixed order.
    pub fn sums(&self) -> Result<Vec<Sum>> {
        let count = self.terms.len();
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
