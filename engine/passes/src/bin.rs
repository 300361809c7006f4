//! Binning: which splats reach which samples. It computes footprints, (slot, splat) pairs sorted by slot, for
//! each pair the cells of the brick that its ellipsoid reaches, and from these for each cell of 2³ samples
//! the pairs that reach it.

use shaders_glsl as glsl;
use shaders_glsl::types::{Footprint, PairParams, SplatParams};

use super::SampleGrid;
use super::pair_lists::{PairLists, key_bits};
use base::error::{Error, Kind, Result};
use gpu::{Buffer, Gpu, Kernel, Recorder};
use splat::Splat;

/// Cells of 2³ samples in a brick.
pub const CELLS: usize = glsl::brick::CELLS as usize;

/// Bins splats into the bricks of one chunk at a time.
pub struct Binner {
    gpu: Gpu,
    bounds: Kernel,
    emit: Kernel,
    pair_masks_kernel: Kernel,
    cell_masks_kernel: Kernel,
    pairs: PairLists,
    /// Footprint of each splat, for the chunk that was binned last.
    pub footprints: Buffer<Footprint>,
    /// Cells of its brick that each pair reaches, two words a pair.
    pair_masks: Buffer<u32>,
    /// Masks of the pairs that reach each cell, for every 32 pairs of a slot; `brick.glsl` says where a slot
    /// begins.
    pub cell_masks: Buffer<u32>,
    /// Bits of the largest key.
    key_bits: u32,
    splat_count: usize,
    chunk_slots: usize,
}

impl Binner {
    /// Creates a binner of `splat_count` splats over `grid`, with buffers for a first guess of pairs.
    pub fn new(gpu: &Gpu, kernel: splat::Kernel, grid: &SampleGrid, splat_count: usize) -> Result<Self> {
        let chunk_slots = grid.chunk_slots();
        let pairs = PairLists::new(gpu, splat_count, chunk_slots)?;
        let capacity = pairs.capacity();
        Ok(Binner {
            gpu: gpu.clone(),
            bounds: Kernel::new(gpu, &glsl::SPLAT_BOUNDS, &[kernel.id()])?,
            emit: Kernel::new(gpu, &glsl::EMIT_PAIRS, &[])?,
            pair_masks_kernel: Kernel::new(gpu, &glsl::PAIR_MASKS, &[kernel.id()])?,
            cell_masks_kernel: Kernel::new(gpu, &glsl::CELL_MASKS, &[])?,
            pairs,
            footprints: gpu.buffer("footprints", "splats", splat_count)?,
            pair_masks: gpu.buffer("pair masks", "sorting", capacity * 2)?,
            cell_masks: gpu.buffer("cell masks", "sorting", mask_words(capacity, chunk_slots))?,
            key_bits: key_bits(chunk_slots),
            splat_count,
            chunk_slots,
        })
    }

    /// Makes room for another number of splats; the room for pairs stays. Nothing may be in flight.
    pub fn resize(&mut self, splat_count: usize) -> Result<()> {
        self.pairs.resize(splat_count)?;
        self.footprints = self.gpu.buffer("footprints", "splats", splat_count)?;
        self.splat_count = splat_count;
        Ok(())
    }

    /// Returns the number of pairs that fit the buffers.
    pub fn capacity(&self) -> usize {
        self.pairs.capacity()
    }

    /// Grows the buffers to at least `pairs` pairs, with a margin for growth to come. Nothing may be in
    /// flight.
    pub fn grow(&mut self, pairs: usize) -> Result<()> {
        let range = self.gpu.limits().storage_range as usize;
        // The masks are the longest rows: two words a pair, and a block for each slot.
        let most = self.pairs.most((range / size_of::<u32>() - mask_words(0, self.chunk_slots)) / 2);
        if pairs > most {
            return Err(Error::new(
                Kind::Temporary,
                "VGS-GPU-051",
                format!("{pairs} splat-brick pairs are needed at once; this device binds at most {most}"),
            )
            .help("use fewer or smaller splats, or a device with a larger storage-buffer range"));
        }
        let capacity = (pairs + pairs / 2).min(most);
        self.pairs.make_room(capacity)?;
        self.pair_masks = self.gpu.buffer("pair masks", "sorting", capacity * 2)?;
        let words = mask_words(capacity, self.chunk_slots);
        self.cell_masks = self.gpu.buffer("cell masks", "sorting", words)?;
        Ok(())
    }

    /// Records the binning of one chunk. The number of pairs that it needs is copied to `totals[chunk]`. If
    /// it exceeds the capacity, later passes see only a part of the pairs, and all must be repeated after
    /// [`Binner::grow`].
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        grid: &SampleGrid,
        splats: &Buffer<Splat>,
        chunk: usize,
        offset: [f32; 3],
        totals: &mut Buffer<u32>,
    ) {
        let capacity = self.capacity() as u32;
        let n = self.splat_count;
        let grid_params = grid.params(chunk, offset);
        let params =
            SplatParams { grid: grid_params, splat_count: n as u32, capacity, stretch: grid.stretch };
        recorder
            .pass(&self.bounds)
            .read("splats", splats)
            .read("slots", &grid.slots)
            .write("footprints", &mut self.footprints)
            .write("pair_counts", &mut self.pairs.counts)
            .push(&params)
            .dispatch_over(n as u32);
        self.pairs.sum(recorder, n, totals, chunk);
        let (pair_offsets, keys, values) = self.pairs.input();
        recorder
            .pass(&self.emit)
            .read("footprints", &self.footprints)
            .read("slots", &grid.slots)
            .read("pair_offsets", pair_offsets)
            .write("keys", keys)
            .write("values", values)
            .push(&params)
            .dispatch_over(n as u32);
        self.pairs.sort(recorder, n, self.key_bits, grid_params.slot_count);
        recorder
            .pass(&self.pair_masks_kernel)
            .read("pair_offsets", &self.pairs.offsets)
            .read("keys", self.pairs.keys(self.key_bits))
            .read("pair_splats", self.pairs.values(self.key_bits))
            .read("footprints", &self.footprints)
            .read("brick_coordinates", &grid.coordinates)
            .read("active_cells", &grid.active_cells)
            .write("pair_masks", &mut self.pair_masks)
            .push(&PairParams { grid: grid_params, count_index: n as u32, capacity })
            .dispatch_over(capacity);
        recorder
            .pass(&self.cell_masks_kernel)
            .read("starts", &self.pairs.starts)
            .read("pair_masks", &self.pair_masks)
            .write("cell_masks", &mut self.cell_masks)
            .dispatch(grid_params.slot_count);
    }

    /// Returns the first pair of each slot, and the total.
    pub fn starts(&self) -> &Buffer<u32> {
        &self.pairs.starts
    }

    /// Returns the splat of each sorted pair, from the chunk that was binned last.
    pub fn pair_splats(&self) -> &Buffer<u32> {
        self.pairs.values(self.key_bits)
    }
}

/// Returns the number of words of the cell masks for `pairs` pairs: 64 for every 32 pairs begun in each slot.
fn mask_words(pairs: usize, slots: usize) -> usize {
    (pairs / 32 + slots + 1) * CELLS
}
