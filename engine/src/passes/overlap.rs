//! Sums over all samples that the Dice loss needs before its adjoints: I = Σ m̂M, Σ m̂ and ΣM, brick by brick, then over
//! the bricks, in a fixed order whatever the chunks.

use shaders_glsl as glsl;
use shaders_glsl::types::{OverlapParams, SumParams, Target};

use super::Storage;
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Recorder};

/// How predicted and wanted mask overlap.
pub struct Overlap {
    overlap_sums: Kernel,
    sum_triples: Kernel,
    /// [slot], all chunks.
    partials: Buffer<[f32; 3]>,
    /// \[0\]: Σ m̂M, Σ m̂, ΣM over the slots recorded so far.
    pub total: Buffer<[f32; 3]>,
}

impl Overlap {
    /// For `slots` slots in all, samples in that storage.
    pub fn new(gpu: &Gpu, storage: Storage, slots: usize) -> Result<Self> {
        Ok(Overlap {
            overlap_sums: Kernel::new(gpu, &glsl::OVERLAP_SUMS, &[storage as u32])?,
            sum_triples: Kernel::new(gpu, &glsl::SUM_TRIPLES, &[])?,
            partials: gpu.buffer("overlap of each brick", "samples", slots)?,
            total: gpu.buffer("overlap", "samples", 1)?,
        })
    }

    /// Records the sums of the chunk that owns `slots`, then the total of all slots up to its last; chunks come in order.
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        targets: &Buffer<Target>,
        reconstructions: &Buffer<u32>,
        slots: std::ops::Range<usize>,
    ) {
        recorder
            .pass(&self.overlap_sums)
            .read(targets)
            .read(reconstructions)
            .write(&mut self.partials)
            .push(&OverlapParams { first_slot: slots.start as u32 })
            .dispatch(slots.len() as u32);
        recorder
            .pass(&self.sum_triples)
            .read(&self.partials)
            .write(&mut self.total)
            .push(&SumParams { count: slots.end as u32 })
            .dispatch(1);
    }
}
