//! Sums over all samples that a Dice loss needs before its adjoints: Σ pt, Σ p and Σ t of the predicted
//! numbers p and the wanted numbers t. They are summed brick by brick, then over the bricks, in a fixed order
//! whatever the chunks.

use shaders_glsl as glsl;
use shaders_glsl::types::{OverlapParams, SumParams, Target};

use super::{Storage, WorkgroupShape};
use base::error::Result;
use gpu::{Buffer, Gpu, Kernel, Recorder};

/// The kernels that sum the overlap of predicted and wanted numbers.
pub struct Overlap {
    region: f32,
    low: f32,
    overlap_sums: Kernel,
    sum_triples: Kernel,
    /// Sums of each slot, [slot], all chunks.
    pub(super) partials: Buffer<[f32; 3]>,
    /// Σ pt, Σ p, Σ t over the slots recorded so far, in the only element.
    pub total: Buffer<[f32; 3]>,
}

impl Overlap {
    /// Creates the kernels for `slots` slots in all, with samples in `storage`. The other arguments are those
    /// of [`super::loss::Weighted`] and the quantity of its row.
    pub fn new(
        gpu: &Gpu,
        storage: Storage,
        slots: usize,
        quantity: u32,
        region: f32,
        low: f32,
    ) -> Result<Self> {
        let constants = [storage as u32, WorkgroupShape::of(gpu) as u32, quantity];
        Ok(Overlap {
            region,
            low,
            overlap_sums: Kernel::new(gpu, &glsl::OVERLAP_SUMS, &constants)?,
            sum_triples: Kernel::new(gpu, &glsl::SUM_TRIPLES, &[])?,
            partials: gpu.buffer("overlap of each brick", "samples", slots)?,
            total: gpu.buffer("overlap", "samples", 1)?,
        })
    }

    /// Records the sums of the chunk that owns `slots`, then the total of all slots up to its last; chunks
    /// come in order. A slot without a pair in `starts` takes its sums from `untouched`.
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        [reconstructions, starts]: [&Buffer<u32>; 2],
        targets: &Buffer<Target>,
        untouched: &Buffer<[f32; 3]>,
        slots: &std::ops::Range<usize>,
    ) {
        recorder
            .pass(&self.overlap_sums)
            .read("targets", targets)
            .read("reconstructions", reconstructions)
            .write("partials", &mut self.partials)
            .read("starts", starts)
            .read("untouched_sums", untouched)
            .push(&OverlapParams { first_slot: slots.start as u32, region: self.region, low: self.low })
            .dispatch(slots.len() as u32);
        recorder
            .pass(&self.sum_triples)
            .read("partials", &self.partials)
            .write("total", &mut self.total)
            .push(&SumParams { count: slots.end as u32 })
            .dispatch(1);
    }
}
