//! The backward pass: samples to splat gradients.

use shaders_glsl as glsl;
use shaders_glsl::types::{Adjoint, GradParams, SplatGrad};

use super::Pace;
use super::bin::SampleGrid;
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Recorder};
use crate::splat::{self, Splat};

/// Splats of one workgroup.
const GROUP: usize = 64;

/// The backward pass and the gradient rows it fills.
pub struct Gradient {
    gpu: Gpu,
    kernel: Kernel,
    pace: Pace,
    /// dL/d(parameters), one row a splat.
    pub rows: Buffer<SplatGrad>,
}

impl Gradient {
    /// For `splat_count` splats.
    pub fn new(gpu: &Gpu, kernel: splat::Kernel, splat_count: usize) -> Result<Self> {
        Ok(Gradient {
            gpu: gpu.clone(),
            kernel: Kernel::new(gpu, &glsl::SPLAT_TO_VOLUME_GRAD, &[kernel.id()])?,
            pace: Pace::new(glsl::SPLAT_TO_VOLUME_GRAD.name),
            rows: gpu.buffer("gradients", "optimiser", splat_count)?,
        })
    }

    /// Records the gradient of one chunk; the first overwrites, later ones add. May submit in between.
    #[allow(clippy::too_many_arguments, reason = "a pass names each buffer it reads")]
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        grid: &SampleGrid,
        splats: &Buffer<Splat>,
        footprints: &Buffer<glsl::types::Footprint>,
        adjoints: &Buffer<Adjoint>,
        chunk: usize,
        offset: [f32; 3],
    ) -> Result<()> {
        let n = splats.len();
        let params = grid.params(chunk, offset);
        let limit = self.gpu.limits().workgroups as usize;
        let (kernel, rows) = (&self.kernel, &mut self.rows);
        self.pace.run(&self.gpu, recorder, n.div_ceil(GROUP), limit, |recorder, first, count| {
            recorder
                .pass(kernel)
                .read(splats)
                .read(footprints)
                .read(&grid.slots)
                .read(adjoints)
                .write(rows)
                .push(&GradParams {
                    grid: params,
                    first_splat: (first * GROUP) as u32,
                    splat_count: n as u32,
                    accumulate: u32::from(chunk > 0),
                })
                .dispatch(count as u32);
        })
    }
}
