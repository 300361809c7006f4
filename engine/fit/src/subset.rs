//! Mini-batches: each iteration updates one block of the splats. The blocks of an epoch are a random order of
//! all splats cut into pieces, so after an epoch every splat has been updated, and the number of its updates
//! is taken to be the number of epochs.

use bytemuck::Pod;
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64;
use shaders_glsl::types::SplatGrad;

use super::FitConfig;
use base::error::Result;
use gpu::{Buffer, Gpu, Recorder};
use passes::Rows;
use passes::adam::AdamState;

/// The blocks of all splats, and the device's copy of the current one.
pub(super) struct Subset {
    rows: Rows,
    seed: u64,
    count: usize,
    /// Number of splats in a block.
    size: usize,
    blocks: u32,
    /// The epoch that `order` belongs to.
    epoch: Option<u32>,
    order: Buffer<u32>,
    /// Parameters and optimiser state of the current block.
    pub active: AdamState,
}

impl Subset {
    /// Divides `count` splats into blocks of at most `config.subset.size`, as equal as they can be; returns
    /// nothing if one block would hold them all.
    pub fn of(gpu: &Gpu, count: usize, config: &FitConfig) -> Result<Option<Self>> {
        if config.subset.size == 0 || config.subset.size >= count {
            return Ok(None);
        }
        let blocks = count.div_ceil(config.subset.size);
        let size = count.div_ceil(blocks);
        Ok(Some(Subset {
            rows: Rows::new(gpu)?,
            seed: config.seed,
            count,
            size,
            blocks: blocks as u32,
            epoch: None,
            order: gpu.buffer("order of the subsets", "optimiser", count)?,
            active: AdamState::zeroed(gpu, size)?,
        }))
    }

    /// Returns the number of splats in a block.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Returns the epoch of iteration `turn`: how often each splat has been updated before it.
    pub fn epoch(&self, turn: u32) -> u32 {
        turn / self.blocks
    }

    /// Returns true if the order of the epoch of iteration `turn` is on the device.
    pub fn is_ready(&self, turn: u32) -> bool {
        self.epoch == Some(self.epoch(turn))
    }

    /// Shuffles the splats for the epoch of iteration `turn` and writes their order to the device. Nothing
    /// may be in flight.
    pub fn shuffle(&mut self, turn: u32) -> Result<()> {
        let epoch = self.epoch(turn);
        let mut order: Vec<u32> = (0..self.count as u32).collect();
        order.shuffle(&mut Pcg64::seed_from_u64(self.seed ^ (u64::from(epoch) << 32) ^ 0x7375_6273_6574));
        self.order.write_range(0, &order)?;
        self.epoch = Some(epoch);
        Ok(())
    }

    /// Returns where the block of iteration `turn` begins in the order. The last block of an epoch ends with
    /// the order, so it may share some splats with the one before.
    fn first(&self, turn: u32) -> usize {
        ((turn % self.blocks) as usize * self.size).min(self.count - self.size)
    }

    /// Records copying the rows of the block of iteration `turn` out of those of all splats.
    pub fn take<T: Pod>(&self, recorder: &mut Recorder, all: &Buffer<T>, block: &mut Buffer<T>, turn: u32) {
        self.rows.gather(recorder, all, &self.order, self.first(turn), block);
    }

    /// Records copying the block of iteration `turn` out of `all`.
    pub fn take_state(&mut self, recorder: &mut Recorder, all: &AdamState, turn: u32) {
        let (rows, first, active) = (&self.rows, self.first(turn), &mut self.active);
        rows.gather(recorder, &all.splats, &self.order, first, &mut active.splats);
        rows.gather(recorder, &all.first, &self.order, first, &mut active.first);
        rows.gather(recorder, &all.second, &self.order, first, &mut active.second);
        rows.gather(recorder, &all.histories, &self.order, first, &mut active.histories);
    }

    /// Records copying the block back into `all`.
    pub fn put_state(&self, recorder: &mut Recorder, all: &mut AdamState, turn: u32) {
        let (rows, first, active) = (&self.rows, self.first(turn), &self.active);
        rows.scatter(recorder, &active.splats, &self.order, first, &mut all.splats);
        rows.scatter(recorder, &active.first, &self.order, first, &mut all.first);
        rows.scatter(recorder, &active.second, &self.order, first, &mut all.second);
        rows.scatter(recorder, &active.histories, &self.order, first, &mut all.histories);
    }

    /// Records copying the block's gradients into those of all splats.
    pub fn put_gradients(
        &self,
        recorder: &mut Recorder,
        rows: &Buffer<SplatGrad>,
        all: &mut Buffer<SplatGrad>,
        turn: u32,
    ) {
        self.rows.scatter(recorder, rows, &self.order, self.first(turn), all);
    }
}
