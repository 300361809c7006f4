//! The backward pass: samples to moments, chunk by chunk, and moments to splat gradients.

use shaders_glsl as glsl;
use shaders_glsl::types::{Adjoint, Footprint, GradParams, MomentParams, SplatGrad};

use super::Pace;
use super::bin::SampleGrid;
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Recorder};
use crate::splat::{self, Splat};

/// Floats of a row of moments: S0, C0, S1 (3), S2 (6).
const MOMENTS: usize = 11;

/// The backward pass and the gradient rows it fills.
pub struct Gradient {
    gpu: Gpu,
    gather: Kernel,
    pace: Pace,
    moments_to_grad: Kernel,
    /// What `gather` sums, 11 floats a splat.
    pub moments: Buffer<f32>,
    /// dL/d(parameters), one row a splat.
    pub rows: Buffer<SplatGrad>,
}

impl Gradient {
    /// For `splat_count` splats.
    pub fn new(gpu: &Gpu, kernel: splat::Kernel, splat_count: usize) -> Result<Self> {
        Ok(Gradient {
            gpu: gpu.clone(),
            gather: Kernel::new(gpu, &glsl::SPLAT_TO_VOLUME_GRAD, &[kernel.id()])?,
            pace: Pace::new(glsl::SPLAT_TO_VOLUME_GRAD.name),
            moments_to_grad: Kernel::new(gpu, &glsl::MOMENTS_TO_GRAD, &[])?,
            moments: gpu.buffer("moments", "optimiser", splat_count * MOMENTS)?,
            rows: gpu.buffer("gradients", "optimiser", splat_count)?,
        })
    }

    /// Records the moments of one chunk; the first overwrites, later ones add. May submit in between.
    pub fn gather(
        &mut self,
        recorder: &mut Recorder,
        grid: &SampleGrid,
        footprints: &Buffer<Footprint>,
        adjoints: &Buffer<Adjoint>,
        chunk: usize,
        offset: [f32; 3],
    ) -> Result<()> {
        let n = footprints.len();
        let params = grid.params(chunk, offset);
        let limit = self.gpu.limits().workgroups as usize;
        let (kernel, moments) = (&self.gather, &mut self.moments);
        // A unit is a workgroup: a splat.
        self.pace.run(&self.gpu, recorder, n, limit, |recorder, first, count| {
            recorder
                .pass(kernel)
                .read(footprints)
                .read(&grid.slots)
                .read(adjoints)
                .write(moments)
                .push(&GradParams {
                    grid: params,
                    first_splat: first as u32,
                    splat_count: n as u32,
                    accumulate: u32::from(chunk > 0),
                })
                .dispatch(count as u32);
        })
    }

    /// Records the gradients, once the moments of all chunks are there.
    pub fn record(&mut self, recorder: &mut Recorder, splats: &Buffer<Splat>) {
        let n = splats.len() as u32;
        recorder
            .pass(&self.moments_to_grad)
            .read(splats)
            .read(&self.moments)
            .write(&mut self.rows)
            .push(&MomentParams { splat_count: n })
            .dispatch(n.div_ceil(64));
    }
}
