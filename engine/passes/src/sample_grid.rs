//! The samples of a fit on the device: the bricks, cut into chunks that a binding holds.

use shaders_glsl::types::Grid;

use base::error::{Error, Kind, Result};
use gpu::{Buffer, Gpu};
use volume::Bricks;

/// The sample grid on the device: tables of slots and bricks, cut into chunks that fit a storage-buffer
/// binding.
pub struct SampleGrid {
    /// Brick -> slot.
    pub(super) slots: Buffer<u32>,
    /// Slot -> brick.
    pub(super) coordinates: Buffer<[u32; 3]>,
    /// Slot -> cells that hold a sample which takes part.
    pub(super) active_cells: Buffer<[u32; 2]>,
    /// Bricks along x, y, z.
    bricks: [u32; 3],
    /// Number of slots.
    pub slot_count: usize,
    /// Number of slots of one chunk; the last chunk may have fewer.
    chunk_slots: usize,
    /// Voxels along each axis per unit of the space in which splats have their shape: ones for voxel space.
    pub stretch: [f32; 3],
}

impl SampleGrid {
    /// Uploads the tables. `bytes_per_sample` is the widest per-sample row that will be bound; the chunks'
    /// size follows from it.
    pub fn new(gpu: &Gpu, bricks: &Bricks, bytes_per_sample: usize) -> Result<Self> {
        if bricks.is_empty() {
            return Err(Error::new(Kind::NothingToDo, "VGS-FIT-001", "no voxel takes part"));
        }
        let coordinates: Vec<[u32; 3]> = bricks.coordinates.iter().map(|c| c.to_array()).collect();
        let fits = gpu.limits().storage_range as usize / (bytes_per_sample * volume::bricks::SAMPLES);
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

    /// Returns the number of chunks.
    pub fn chunks(&self) -> usize {
        self.slot_count.div_ceil(self.chunk_slots)
    }

    /// Returns the number of slots of the largest chunk.
    pub fn chunk_slots(&self) -> usize {
        self.chunk_slots
    }

    /// Returns the slots of a chunk.
    pub fn chunk(&self, index: usize) -> std::ops::Range<usize> {
        index * self.chunk_slots..((index + 1) * self.chunk_slots).min(self.slot_count)
    }

    /// Returns the push constants for a chunk whose samples are displaced by `offset` voxels.
    pub fn params(&self, chunk: usize, offset: [f32; 3]) -> Grid {
        let range = self.chunk(chunk);
        Grid { bricks: self.bricks, first_slot: range.start as u32, offset, slot_count: range.len() as u32 }
    }

    /// Returns the upper corner of the samples in local voxels, including the half voxel of the last sample.
    pub fn max_mean(&self) -> [f32; 3] {
        self.bricks.map(|n| n as f32 * 8.0 - 0.5)
    }
}
