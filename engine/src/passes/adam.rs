//! Adam on splat parameters, in voxel units.

use shaders_glsl as glsl;
use shaders_glsl::types::{AdamParams, SplatGrad};

use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Recorder};
use crate::splat::Splat;

/// Splats and what the optimiser keeps of each.
pub struct State {
    /// Parameters.
    pub splats: Buffer<Splat>,
    /// First moments.
    pub first: Buffer<SplatGrad>,
    /// Second moments.
    pub second: Buffer<SplatGrad>,
    /// Σ |dL/dμ| over the steps, in units of the fit per voxel.
    pub gradient_norms: Buffer<f32>,
}

impl State {
    /// All zeros, for `count` splats.
    pub fn zeroed(gpu: &Gpu, count: usize) -> Result<Self> {
        Ok(State {
            splats: gpu.buffer("splats", "splats", count)?,
            first: gpu.buffer("first moments", "optimiser", count)?,
            second: gpu.buffer("second moments", "optimiser", count)?,
            gradient_norms: gpu.buffer("gradient norms", "optimiser", count)?,
        })
    }
}

/// The optimiser's kernel.
pub struct Adam {
    kernel: Kernel,
    /// Number of splats whose gradient was not finite, summed over the steps.
    pub frozen: Buffer<u32>,
}

impl Adam {
    /// For any number of splats.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Adam {
            kernel: Kernel::new(gpu, &glsl::ADAM, &[])?,
            frozen: gpu.buffer("frozen splats", "optimiser", 1)?,
        })
    }

    /// Records one step.
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        gradients: &Buffer<SplatGrad>,
        state: &mut State,
        pair_totals: &Buffer<u32>,
        params: &AdamParams,
    ) {
        recorder
            .pass(&self.kernel)
            .read(gradients)
            .write(&mut state.splats)
            .write(&mut state.first)
            .write(&mut state.second)
            .read(pair_totals)
            .write(&mut self.frozen)
            .write(&mut state.gradient_norms)
            .push(params)
            .dispatch(params.splat_count.div_ceil(64));
    }
}
