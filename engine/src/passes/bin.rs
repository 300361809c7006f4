//! Which splats reach which samples: footprints, (slot, splat) pairs sorted by slot, for each pair the cells of the brick
//! that its ellipsoid reaches, and from these a list of splats for each cell of 2³ samples.

use shaders_glsl as glsl;
use shaders_glsl::types::{CellParams, Footprint, Grid, PairParams, RangeParams, SplatParams};

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
    cells_kernel: Kernel,
    cell_counts_kernel: Kernel,
    cell_lists_kernel: Kernel,
    cell_scan: Scan,
    scan: Scan,
    sort: RadixSort,
    /// Footprint of each splat, from the chunk that was binned last.
    pub footprints: Buffer<Footprint>,
    pair_counts: Buffer<u32>,
    pair_offsets: Buffer<u32>,
    starts: Buffer<u32>,
    cells: Buffer<[u32; 2]>,
    cell_counts: Buffer<u32>,
    /// First entry of each cell's list, [slot][cell], and the total.
    pub list_starts: Buffer<u32>,
    /// Splats of each cell, one list after the other.
    pub lists: Buffer<u32>,
    /// Bits of the largest key.
    key_bits: u32,
    splat_count: usize,
}

/// What one chunk needs of the buffers whose size is not known beforehand.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Need {
    /// (brick, splat) pairs.
    pub pairs: u32,
    /// Entries in the lists of all cells.
    pub entries: u32,
}

impl Need {
    /// Whether `self` is enough for `other`.
    pub fn covers(self, other: Need) -> bool {
        self.pairs >= other.pairs && self.entries >= other.entries
    }

    /// The larger of each.
    pub fn max(self, other: Need) -> Need {
        Need { pairs: self.pairs.max(other.pairs), entries: self.entries.max(other.entries) }
    }
}

impl Binner {
    /// For `splat_count` splats over `grid`, with buffers for a first guess of pairs.
    pub fn new(gpu: &Gpu, kernel: splat::Kernel, grid: &SampleGrid, splat_count: usize) -> Result<Self> {
        let capacity = (splat_count * 8).max(4096);
        let cells = grid.chunk_slots() * CELLS;
        Ok(Binner {
            gpu: gpu.clone(),
            bounds: Kernel::new(gpu, &glsl::SPLAT_BOUNDS, &[kernel.id()])?,
            emit: Kernel::new(gpu, &glsl::EMIT_PAIRS, &[])?,
            ranges: Kernel::new(gpu, &glsl::BRICK_RANGES, &[])?,
            cells_kernel: Kernel::new(gpu, &glsl::PAIR_CELLS, &[kernel.id()])?,
            cell_counts_kernel: Kernel::new(gpu, &glsl::CELL_COUNTS, &[])?,
            cell_lists_kernel: Kernel::new(gpu, &glsl::CELL_LISTS, &[])?,
            cell_scan: Scan::new(gpu, cells)?,
            cell_counts: gpu.buffer("cell counts", "sorting", cells)?,
            list_starts: gpu.buffer("cell list starts", "sorting", cells + 1)?,
            lists: gpu.buffer("cell lists", "sorting", capacity * 8)?,
            scan: Scan::new(gpu, splat_count)?,
            sort: RadixSort::new(gpu, capacity)?,
            footprints: gpu.buffer("footprints", "splats", splat_count)?,
            pair_counts: gpu.buffer("pair counts", "sorting", splat_count)?,
            pair_offsets: gpu.buffer("pair offsets", "sorting", splat_count + 1)?,
            starts: gpu.buffer("pair starts", "sorting", grid.chunk_slots() + 1)?,
            cells: gpu.buffer("pair cells", "sorting", capacity)?,
            key_bits: usize::BITS - grid.chunk_slots().leading_zeros(),
            splat_count,
        })
    }

    /// What fits the buffers.
    pub fn capacity(&self) -> Need {
        Need { pairs: self.sort.capacity() as u32, entries: self.lists.len() as u32 }
    }

    /// Makes room for at least `need`, with a margin for growth to come. Nothing may be in flight.
    pub fn grow(&mut self, need: Need) -> Result<()> {
        let range = self.gpu.limits().storage_range as usize;
        let dispatched = self.gpu.limits().workgroups as usize * PAIR_GROUP as usize - 1;
        let room = |what: &str, needed: u32, most: usize| {
            if needed as usize > most {
                return Err(Error::new(
                    Kind::Temporary,
                    "VGS-GPU-051",
                    format!("{needed} {what} are needed at once; this device binds at most {most}"),
                )
                .help("use fewer or smaller splats, or a device with a larger storage-buffer range"));
            }
            Ok((needed as usize + needed as usize / 2).min(most))
        };
        if need.pairs > self.capacity().pairs {
            let most = (range / size_of::<[u32; 2]>()).min(dispatched);
            let pairs = room("splat-brick pairs", need.pairs, most)?;
            self.sort = RadixSort::new(&self.gpu, pairs)?;
            self.cells = self.gpu.buffer("pair cells", "sorting", pairs)?;
        }
        if need.entries > self.capacity().entries {
            let entries = room("splat-cell pairs", need.entries, range / size_of::<u32>())?;
            self.lists = self.gpu.buffer("cell lists", "sorting", entries)?;
        }
        Ok(())
    }

    /// Records the binning of one chunk. What it needs is copied to `needs[chunk]`; if that exceeds the capacity, what
    /// follows works on a part and must be repeated after [`Binner::grow`].
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        grid: &SampleGrid,
        splats: &Buffer<Splat>,
        chunk: usize,
        offset: [f32; 3],
        needs: &mut Buffer<Need>,
    ) {
        let Need { pairs: capacity, entries } = self.capacity();
        let n = self.splat_count;
        let grid_params = grid.params(chunk, offset);
        let params = SplatParams { grid: grid_params, splat_count: n as u32, capacity };
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
        recorder.copy_word(&self.pair_offsets, n, needs, chunk * 2);
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
            .pass(&self.cells_kernel)
            .read(&self.pair_offsets)
            .read(keys)
            .read(values)
            .read(&self.footprints)
            .read(&grid.coordinates)
            .read(&grid.active_cells)
            .write(&mut self.cells)
            .push(&PairParams { grid: grid_params, count_index: n as u32, capacity })
            .dispatch(capacity.div_ceil(PAIR_GROUP));
        let slots = grid_params.slot_count;
        recorder
            .pass(&self.cell_counts_kernel)
            .read(&self.starts)
            .read(&self.cells)
            .write(&mut self.cell_counts)
            .dispatch(slots);
        let cells = slots as usize * CELLS;
        self.cell_scan.record(recorder, &self.cell_counts, cells, &mut self.list_starts);
        recorder.copy_word(&self.list_starts, cells, needs, chunk * 2 + 1);
        recorder
            .pass(&self.cell_lists_kernel)
            .read(&self.starts)
            .read(values)
            .read(&self.cells)
            .read(&self.list_starts)
            .write(&mut self.lists)
            .push(&CellParams { capacity: entries })
            .dispatch(slots);
    }
}
