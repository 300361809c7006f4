//! Adam on splat parameters, in voxel units.

use shaders_glsl as glsl;
use shaders_glsl::types::{AdamParams, History, SplatGrad};

use base::error::Result;
use gpu::{Buffer, Gpu, Kernel, Recorder};
use splat::Splat;

/// Cap of the log scales that stands for no cap.
pub const NO_CAP: f32 = 1e30;

/// Splats with what Adam keeps of each.
pub struct AdamState {
    /// Parameters.
    pub splats: Buffer<Splat>,
    /// First moments.
    pub first: Buffer<SplatGrad>,
    /// Second moments.
    pub second: Buffer<SplatGrad>,
    /// Σ |dL/dμ| over the steps, in units of the fit per voxel, and the cap of the scales.
    pub histories: Buffer<History>,
}

impl AdamState {
    /// Creates buffers of zeros for `count` splats. A cap of 0 limits the scales too; write [`NO_CAP`] for
    /// splats without a cap.
    pub fn zeroed(gpu: &Gpu, count: usize) -> Result<Self> {
        Ok(AdamState {
            splats: gpu.buffer("splats", "splats", count)?,
            first: gpu.buffer("first moments", "optimiser", count)?,
            second: gpu.buffer("second moments", "optimiser", count)?,
            histories: gpu.buffer("histories", "optimiser", count)?,
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
    /// Creates the optimiser, for any number of splats.
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
        state: &mut AdamState,
        pair_totals: &Buffer<u32>,
        params: &AdamParams,
    ) {
        recorder
            .pass(&self.kernel)
            .read("gradients", gradients)
            .write("splats", &mut state.splats)
            .write("first_moments", &mut state.first)
            .write("second_moments", &mut state.second)
            .read("pair_totals", pair_totals)
            .write("frozen", &mut self.frozen)
            .write("histories", &mut state.histories)
            .push(params)
            .dispatch_over(params.splat_count);
    }
}
