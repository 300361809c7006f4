//! Packed splats on the device, and how they become splats again.

use shaders_glsl as glsl;
use shaders_glsl::types::{PackedChunk, PackedRange, UnpackParams};

use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Recorder};
use crate::splat::{Packed, Splat};

/// A packed set on the device: what kernels bind that include `packed.glsl`.
pub struct PackedSplats {
    /// The rows.
    pub rows: Buffer<[u32; 4]>,
    /// One for every [`CHUNK`](crate::splat::packed::CHUNK) rows.
    pub chunks: Buffer<PackedChunk>,
    /// Ranges of the set.
    pub range: PackedRange,
}

impl PackedSplats {
    /// Uploads a set.
    pub fn new(gpu: &Gpu, packed: &Packed) -> Result<Self> {
        Ok(PackedSplats {
            rows: gpu.upload("packed splats", "splats", &packed.splats)?,
            chunks: gpu.upload("packed chunks", "splats", &packed.chunks)?,
            range: packed.range,
        })
    }
}

/// The kernel.
pub struct Unpack(Kernel);

impl Unpack {
    /// For any set.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Unpack(Kernel::new(gpu, &glsl::UNPACK, &[])?))
    }

    /// Records `splats[i]` and `labels[i]` = row i of `packed`, for all of `splats`.
    ///
    /// # Panics
    /// If there are fewer rows or labels.
    pub fn record(
        &self,
        recorder: &mut Recorder,
        packed: &PackedSplats,
        splats: &mut Buffer<Splat>,
        labels: &mut Buffer<u32>,
    ) {
        assert!(splats.len() <= packed.rows.len().min(labels.len()), "a row and a label for every splat");
        let splat_count = splats.len() as u32;
        recorder
            .pass(&self.0)
            .read(&packed.rows)
            .read(&packed.chunks)
            .write(splats)
            .write(labels)
            .push(&UnpackParams { range: packed.range, splat_count })
            .dispatch(splat_count.div_ceil(64));
    }
}
