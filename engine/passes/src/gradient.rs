//! The backward pass: from samples to moments, chunk by chunk, and from moments to splat gradients.

use shaders_glsl as glsl;
use shaders_glsl::types::{Footprint, GradParams, MomentParams, SplatGrad};

use super::{SampleGrid, Storage, SubmissionPacer, WorkgroupShape};
use base::error::Result;
use gpu::{Buffer, Gpu, Kernel, Recorder};
use splat::Splat;

/// Floats of a row of moments: S0, C0, S1 (3), S2 (6).
const MOMENTS: usize = glsl::splat::MOMENTS as usize;
/// Invocations that own a splat.
const LANES: usize = glsl::splat_to_volume_grad::LANES as usize;

/// The backward pass and the gradient rows it fills.
pub struct Gradient {
    gpu: Gpu,
    gather: Kernel,
    splats_per_group: usize,
    pace: SubmissionPacer,
    moments_to_grad: Kernel,
    /// Moments that `gather` sums, 11 floats a splat.
    pub moments: Buffer<f32>,
    /// dL/d(parameters), one row a splat.
    pub rows: Buffer<SplatGrad>,
}

impl Gradient {
    /// Creates the pass for `splat_count` splats, with adjoints in `storage`.
    pub fn new(gpu: &Gpu, kernel: splat::Kernel, splat_count: usize, storage: Storage) -> Result<Self> {
        Self::with_shape(gpu, kernel, splat_count, storage, WorkgroupShape::of(gpu))
    }

    /// Creates the pass with the given workgroup shape; the result has the same bits.
    pub fn with_shape(
        gpu: &Gpu,
        kernel: splat::Kernel,
        splat_count: usize,
        storage: Storage,
        shape: WorkgroupShape,
    ) -> Result<Self> {
        Ok(Gradient {
            gpu: gpu.clone(),
            gather: Kernel::new(
                gpu,
                &glsl::SPLAT_TO_VOLUME_GRAD,
                &[kernel.id(), shape as u32, storage as u32],
            )?,
            splats_per_group: shape as usize / LANES,
            pace: SubmissionPacer::new(glsl::SPLAT_TO_VOLUME_GRAD.name),
            moments_to_grad: Kernel::new(gpu, &glsl::MOMENTS_TO_GRAD, &[kernel.id()])?,
            moments: gpu.buffer("moments", "optimiser", splat_count * MOMENTS)?,
            rows: gpu.buffer("gradients", "optimiser", splat_count)?,
        })
    }

    /// Makes room for another number of splats. Nothing may be in flight.
    pub fn resize(&mut self, splat_count: usize) -> Result<()> {
        self.moments = self.gpu.buffer("moments", "optimiser", splat_count * MOMENTS)?;
        self.rows = self.gpu.buffer("gradients", "optimiser", splat_count)?;
        Ok(())
    }

    /// Records the moments of one chunk; the first chunk overwrites, later ones add. May submit in between.
    pub fn gather(
        &mut self,
        recorder: &mut Recorder,
        grid: &SampleGrid,
        footprints: &Buffer<Footprint>,
        adjoints: &Buffer<u32>,
        chunk: usize,
        offset: [f32; 3],
    ) -> Result<()> {
        let n = footprints.len();
        let params = grid.params(chunk, offset);
        let limit = self.gpu.limits().workgroups as usize;
        let (kernel, moments) = (&self.gather, &mut self.moments);
        let splats_per_group = self.splats_per_group;
        // A unit is a workgroup.
        let groups = n.div_ceil(splats_per_group);
        self.pace.run(&self.gpu, recorder, groups, limit, |recorder, first, count| {
            recorder
                .pass(kernel)
                .read("footprints", footprints)
                .read("slots", &grid.slots)
                .read("adjoints", adjoints)
                .write("moments", moments)
                .push(&GradParams {
                    grid: params,
                    first_splat: (first * splats_per_group) as u32,
                    splat_count: n as u32,
                    accumulate: u32::from(chunk > 0),
                })
                .dispatch(count as u32);
        })
    }

    /// Records the gradients after the moments of all chunks. `stretch` is that of the sample grid.
    pub fn record(&mut self, recorder: &mut Recorder, splats: &Buffer<Splat>, stretch: [f32; 3]) {
        let n = splats.len() as u32;
        recorder
            .pass(&self.moments_to_grad)
            .read("splats", splats)
            .read("moments", &self.moments)
            .write("gradients", &mut self.rows)
            .push(&MomentParams { splat_count: n, stretch })
            .dispatch_over(n);
    }
}
