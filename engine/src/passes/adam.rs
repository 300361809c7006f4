//! Adam on splat parameters, in voxel units.

use shaders_glsl as glsl;
use shaders_glsl::types::{AdamParams, SplatGrad};

use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Recorder};
use crate::splat::Splat;

/// The optimiser's kernel and state.
pub struct Adam {
    kernel: Kernel,
    /// First moments.
    pub first: Buffer<SplatGrad>,
    /// Second moments.
    pub second: Buffer<SplatGrad>,
    /// Number of splats whose gradient was not finite, summed over the steps.
    pub frozen: Buffer<u32>,
}

impl Adam {
    /// For `splat_count` splats; moments start at zero.
    pub fn new(gpu: &Gpu, splat_count: usize) -> Result<Self> {
        Ok(Adam {
            kernel: Kernel::new(gpu, &glsl::ADAM, &[])?,
            first: gpu.buffer("first moments", "optimiser", splat_count)?,
            second: gpu.buffer("second moments", "optimiser", splat_count)?,
            frozen: gpu.buffer("frozen splats", "optimiser", 1)?,
        })
    }

    /// Records one step.
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        gradients: &Buffer<SplatGrad>,
        splats: &mut Buffer<Splat>,
        pair_totals: &Buffer<u32>,
        params: &AdamParams,
    ) {
        recorder
            .pass(&self.kernel)
            .read(gradients)
            .write(splats)
            .write(&mut self.first)
            .write(&mut self.second)
            .read(pair_totals)
            .write(&mut self.frozen)
            .push(params)
            .dispatch(params.splat_count.div_ceil(64));
    }
}
