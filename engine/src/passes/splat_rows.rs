//! The splats of a scene on the device, in full or packed.

use shaders_glsl::types::{PackedChunk, PackedRange};

use crate::error::Result;
use crate::gpu::{Buffer, Gpu};
use crate::splat::{Packed, Splat};

/// Splats on the device, in full or packed: what kernels bind that include `rows.glsl` or `packed.glsl`.
pub struct SplatRows {
    /// Three of these a splat in full, one when packed.
    pub rows: Buffer<[u32; 4]>,
    /// One for every [`CHUNK`](crate::splat::packed::CHUNK) packed rows.
    pub chunks: Buffer<PackedChunk>,
    /// Ranges of a packed set.
    pub range: PackedRange,
    /// True if they are packed; the constant that kernels take.
    pub packed: bool,
}

impl SplatRows {
    /// Uploads splats as they are, 48 bytes each.
    pub fn full(gpu: &Gpu, splats: &[Splat]) -> Result<Self> {
        Ok(SplatRows {
            rows: gpu.upload("splats", "splats", bytemuck::cast_slice::<Splat, [u32; 4]>(splats))?,
            chunks: gpu.buffer("no chunks", "splats", 1)?,
            range: PackedRange::default(),
            packed: false,
        })
    }

    /// Uploads a packed set, 16 bytes a splat.
    pub fn packed(gpu: &Gpu, packed: &Packed) -> Result<Self> {
        Ok(SplatRows {
            rows: gpu.upload("packed splats", "splats", &packed.splats)?,
            chunks: gpu.upload("packed chunks", "splats", &packed.chunks)?,
            range: packed.range,
            packed: true,
        })
    }

    /// Reads the splats as kernels see them. Waits for the device.
    pub fn read(&self) -> Result<Vec<Splat>> {
        let rows = self.rows.read()?;
        if !self.packed {
            return Ok(bytemuck::cast_slice::<[u32; 4], Splat>(&rows).to_vec());
        }
        let packed =
            Packed { splats: rows, chunks: self.chunks.read()?, range: self.range, order: Vec::new() };
        Ok(packed.unpack_all())
    }
}
