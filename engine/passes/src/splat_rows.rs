//! The splats of a scene on the device, in full or packed.

use shaders_glsl::types::{PackedChunk, PackedRange};

use base::error::Result;
use gpu::{Buffer, Gpu};
use splat::{Packed, Splat};

/// Splats on the device, in full or packed, as kernels bind them that include `rows.glsl` or `packed.glsl`.
pub struct SplatRows {
    /// Splats: three rows each in full, one when packed.
    pub rows: Buffer<[u32; 4]>,
    /// Chunks of packed splats, one for every [`CHUNK`](splat::packed::CHUNK) rows.
    pub chunks: Buffer<PackedChunk>,
    /// Ranges of a packed set.
    pub range: PackedRange,
    /// True if the splats are packed; a constant of the kernels.
    pub packed: bool,
}

impl SplatRows {
    /// Uploads splats in full, 48 bytes each.
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

    /// Reads the splats with the values that kernels see. Waits for the device.
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
