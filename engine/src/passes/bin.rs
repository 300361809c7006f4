//! Which splats reach which samples: footprints, (slot, splat) pairs sorted by slot, for each pair the cells of the brick
//! that its ellipsoid reaches, and from these for each cell of 2³ samples the pairs that reach it.

use shaders_glsl as glsl;
use shaders_glsl::types::{Footprint, Grid, PairParams, RangeParams, SplatParams};

use super::{RadixSort, Scan};
use crate::error::{Error, Kind, Result};
use crate::gpu::{Buffer, Gpu, Kernel, Recorder};
use crate::splat::{self, Splat};
use crate::volume::Bricks;

/// Cells of 2³ samples in a brick.
pub const CELLS: usize = 64;
/// Pairs of one workgroup.
const PAIR_GROUP: u32 = 256;

/// The sample grid on the device: tables of slots and bricks, cut into chunks that fit a storage-buffer binding.
pub struct SampleGrid {
    /// Brick -> slot.
    pub(super) slots: Buffer<u32>,
    /// Slot -> brick.
    pub(super) coordinates: Buffer<[u32; 3]>,
    /// Slot -> cells that hold a sample which takes part.
    pub(super) active_cells: Buffer<[u32; 2]>,
    /// Bricks along x, y, z.
    bricks: [u32; 3],
    /// Slots in all.
    pub slot_count: usize,
    /// Slots of one chunk; the last chunk may have fewer.
    chunk_slots: usize,
    /// Voxels along each axis to a unit of the space in which splats have their shape: ones where that is voxel space.
    pub stretch: [f32; 3],
}

impl SampleGrid {
    /// Uploads the tables. `bytes_per_sample` is the widest per-sample row that will be bound; chunks are made to fit.
    pub fn new(gpu: &Gpu, bricks: &Bricks, bytes_per_sample: usize) -> Result<Self> {
        if bricks.is_empty() {
            return Err(Error::new(Kind::NothingToDo, "VGS-FIT-001", "no voxel takes part"));
        }
        let coordinates: Vec<[u32; 3]> = bricks.coordinates.iter().map(|c| c.to_array()).collect();
        let fits = gpu.limits().storage_range as usize / (bytes_per_sample * crate::volume::bricks::SAMPLES);
        if fits == 0 {
            return Err(Error::new(
                Kind::Unavailable,
                "VGS-GPU-050",
                format!("one brick does not fit a storage buffer of {} bytes", gpu.limits().storage_range),
            ));
        }
        // Chunks of equal size rather than full ones and a rest.
        let chunk_slots = bricks.len().div_ceil(bricks.len().div_ceil(fits));
        Ok(SampleGrid {
            slots: gpu.upload("brick slots", "bricks", &bricks.slots)?,
            coordinates: gpu.upload("brick coordinates", "bricks", &coordinates)?,
            active_cells: gpu.upload("active cells", "bricks", &bricks.active_cells())?,
            bricks: bricks.grid.to_array(),
            slot_count: bricks.len(),
            chunk_slots,
            stretch: [1.0; 3],
        })
    }

    /// Number of chunks.
    pub fn chunks(&self) -> usize {
        self.slot_count.div_ceil(self.chunk_slots)
    }

    /// Slots of the largest chunk.
    pub fn chunk_slots(&self) -> usize {
        self.chunk_slots
    }

    /// Slots of a chunk.
    pub fn chunk(&self, index: usize) -> std::ops::Range<usize> {
        index * self.chunk_slots..((index + 1) * self.chunk_slots).min(self.slot_count)
    }

    /// The push constants for a chunk, samples displaced by `offset` voxels.
    pub fn params(&self, chunk: usize, offset: [f32; 3]) -> Grid {
        let range = self.chunk(chunk);
        Grid { bricks: self.bricks, first_slot: range.start as u32, offset, slot_count: range.len() as u32 }
    }

    /// Upper corner of the samples in local voxels, with the half voxel that belongs to the last.
    pub fn max_mean(&self) -> [f32; 3] {
        self.bricks.map(|n| n as f32 * 8.0 - 0.5)
    }
}

/// Bins splats into the bricks of one chunk at a time.
pub struct Binner {
    gpu: Gpu,
    bounds: Kernel,
    emit: Kernel,
    ranges: Kernel,
    pair_masks_kernel: Kernel,
    cell_masks_kernel: Kernel,
    scan: Scan,
    sort: RadixSort,
    /// Footprint of each splat, from the chunk that was binned last.
    pub footprints: Buffer<Footprint>,
    pair_counts: Buffer<u32>,
    pair_offsets: Buffer<u32>,
    /// First pair of each slot, and the total.
    pub starts: Buffer<u32>,
    /// Two words a pair: the cells of its brick that it reaches.
    pair_masks: Buffer<u32>,
    /// For every 32 pairs of a slot which of them reach each cell; `brick.glsl` says where a slot begins.
    pub cell_masks: Buffer<u32>,
    /// Bits of the largest key.
    key_bits: u32,
    splat_count: usize,
    chunk_slots: usize,
}

impl Binner {
    /// For `splat_count` splats over `grid`, with buffers for a first guess of pairs.
    pub fn new(gpu: &Gpu, kernel: splat::Kernel, grid: &SampleGrid, splat_count: usize) -> Result<Self> {
        let capacity = (splat_count * 8).max(4096);
        Ok(Binner {
            gpu: gpu.clone(),
            bounds: Kernel::new(gpu, &glsl::SPLAT_BOUNDS, &[kernel.id()])?,
            emit: Kernel::new(gpu, &glsl::EMIT_PAIRS, &[])?,
            ranges: Kernel::new(gpu, &glsl::BRICK_RANGES, &[])?,
            pair_masks_kernel: Kernel::new(gpu, &glsl::PAIR_MASKS, &[kernel.id()])?,
            cell_masks_kernel: Kernel::new(gpu, &glsl::CELL_MASKS, &[])?,
            scan: Scan::new(gpu, splat_count)?,
            sort: RadixSort::new(gpu, capacity)?,
            footprints: gpu.buffer("footprints", "splats", splat_count)?,
            pair_counts: gpu.buffer("pair counts", "sorting", splat_count)?,
            pair_offsets: gpu.buffer("pair offsets", "sorting", splat_count + 1)?,
            starts: gpu.buffer("pair starts", "sorting", grid.chunk_slots() + 1)?,
            pair_masks: gpu.buffer("pair masks", "sorting", capacity * 2)?,
            cell_masks: gpu.buffer("cell masks", "sorting", mask_words(capacity, grid.chunk_slots()))?,
            chunk_slots: grid.chunk_slots(),
            key_bits: usize::BITS - grid.chunk_slots().leading_zeros(),
            splat_count,
        })
    }

    /// Room for another number of splats; the room for pairs stays. Nothing may be in flight.
    pub fn resize(&mut self, splat_count: usize) -> Result<()> {
        let gpu = &self.gpu;
        self.scan = Scan::new(gpu, splat_count)?;
        self.footprints = gpu.buffer("footprints", "splats", splat_count)?;
        self.pair_counts = gpu.buffer("pair counts", "sorting", splat_count)?;
        self.pair_offsets = gpu.buffer("pair offsets", "sorting", splat_count + 1)?;
        self.splat_count = splat_count;
        Ok(())
    }

    /// Pairs that fit the buffers.
    pub fn capacity(&self) -> usize {
        self.sort.capacity()
    }

    /// Makes room for at least `pairs`, with a margin for growth to come. Nothing may be in flight.
    pub fn grow(&mut self, pairs: usize) -> Result<()> {
        let limits = self.gpu.limits();
        // The masks are the longest rows: two words a pair, and a block for each slot.
        let bound = (limits.storage_range as usize / size_of::<u32>() - mask_words(0, self.chunk_slots)) / 2;
        let most = bound.min(limits.workgroups as usize * PAIR_GROUP as usize - 1);
        if pairs > most {
            return Err(Error::new(
                Kind::Temporary,
                "VGS-GPU-051",
                format!("{pairs} splat-brick pairs are needed at once; this device binds at most {most}"),
            )
            .help("use fewer or smaller splats, or a device with a larger storage-buffer range"));
        }
        let capacity = (pairs + pairs / 2).min(most);
        self.sort = RadixSort::new(&self.gpu, capacity)?;
        self.pair_masks = self.gpu.buffer("pair masks", "sorting", capacity * 2)?;
        let words = mask_words(capacity, self.chunk_slots);
        self.cell_masks = self.gpu.buffer("cell masks", "sorting", words)?;
        Ok(())
    }

    /// Records the binning of one chunk. The number of pairs that it needs is copied to `totals[chunk]`; if it exceeds
    /// the capacity, what follows works on a part of the pairs and must be repeated after [`Binner::grow`].
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
        let groups = n.div_ceil(64) as u32;
        recorder
            .pass(&self.bounds)
            .read(splats)
            .read(&grid.slots)
            .write(&mut self.footprints)
            .write(&mut self.pair_counts)
            .push(&params)
            .dispatch(groups);
        self.scan.record(recorder, &self.pair_counts, n, &mut self.pair_offsets);
        recorder.copy(&self.pair_offsets, n, totals, chunk, 1);
        let (keys, values) = self.sort.input();
        recorder
            .pass(&self.emit)
            .read(&self.footprints)
            .read(&grid.slots)
            .read(&self.pair_offsets)
            .write(keys)
            .write(values)
            .push(&params)
            .dispatch(groups);
        let (keys, values) = self.sort.record(recorder, &self.pair_offsets, n, self.key_bits);
        recorder
            .pass(&self.ranges)
            .read(&self.pair_offsets)
            .read(keys)
            .write(&mut self.starts)
            .push(&RangeParams { slot_count: grid_params.slot_count, count_index: n as u32, capacity })
            .dispatch((capacity + 1).div_ceil(PAIR_GROUP));
        recorder
            .pass(&self.pair_masks_kernel)
            .read(&self.pair_offsets)
            .read(keys)
            .read(values)
            .read(&self.footprints)
            .read(&grid.coordinates)
            .read(&grid.active_cells)
            .write(&mut self.pair_masks)
            .push(&PairParams { grid: grid_params, count_index: n as u32, capacity })
            .dispatch(capacity.div_ceil(PAIR_GROUP));
        recorder
            .pass(&self.cell_masks_kernel)
            .read(&self.starts)
            .read(&self.pair_masks)
            .write(&mut self.cell_masks)
            .dispatch(grid_params.slot_count);
    }

    /// Splat of each sorted pair, from the chunk that was binned last.
    pub fn pair_splats(&self) -> &Buffer<u32> {
        self.sort.sorted_values(self.key_bits)
    }
}

/// Words of the cell masks of that many pairs: 64 for every 32 pairs begun in each slot.
fn mask_words(pairs: usize, slots: usize) -> usize {
    (pairs / 32 + slots + 1) * CELLS
}
