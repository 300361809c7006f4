//! Rasterization, from splats to samples: binning, then the forward pass, chunk by chunk.

use shaders_glsl as glsl;
use shaders_glsl::types::{RasterParams, Reconstruction};

use super::bin::CELLS;
use super::{Binner, SampleGrid, Storage, SubmissionPacer, WorkgroupShape};
use base::error::Result;
use gpu::{Buffer, Gpu, Kernel, Recorder};
use splat::Splat;
use volume::Bricks;
use volume::bricks::SAMPLES;

/// Cells of one workgroup.
const CELLS_PER_GROUP: usize = glsl::splat_to_volume::CELLS_PER_GROUP as usize;

/// The forward pass over a fixed sample grid and a fixed number of splats.
pub struct Rasterizer {
    gpu: Gpu,
    kernel: Kernel,
    pace: SubmissionPacer,
    /// The sample grid.
    pub grid: SampleGrid,
    /// Bins of the chunk that was rasterized last.
    pub bins: Binner,
    /// Σw and V̂ of the chunk that was rasterized last, [slot][Morton place], as `storage` says.
    pub reconstructions: Buffer<u32>,
    storage: Storage,
    /// Number of pairs that each chunk needed.
    pub pair_totals: Buffer<u32>,
    epsilon: f32,
}

impl Rasterizer {
    /// Creates the pass for `splat_count` splats in local voxel coordinates of `bricks`, in full storage.
    /// `epsilon` is ε of equation (2).
    pub fn new(
        gpu: &Gpu,
        kernel: splat::Kernel,
        epsilon: f32,
        bricks: &Bricks,
        splat_count: usize,
    ) -> Result<Self> {
        Self::with_storage(gpu, kernel, epsilon, bricks, splat_count, Storage::Full)
    }

    /// Creates the pass with the given storage.
    pub fn with_storage(
        gpu: &Gpu,
        kernel: splat::Kernel,
        epsilon: f32,
        bricks: &Bricks,
        splat_count: usize,
        storage: Storage,
    ) -> Result<Self> {
        Self::with_shape(gpu, kernel, epsilon, bricks, splat_count, storage, WorkgroupShape::of(gpu))
    }

    /// Creates the pass with the given storage and workgroup shape; the result has the same bits in any
    /// shape.
    pub fn with_shape(
        gpu: &Gpu,
        kernel: splat::Kernel,
        epsilon: f32,
        bricks: &Bricks,
        splat_count: usize,
        storage: Storage,
        shape: WorkgroupShape,
    ) -> Result<Self> {
        let grid = SampleGrid::new(gpu, bricks, storage.bytes())?;
        Ok(Rasterizer {
            gpu: gpu.clone(),
            kernel: Kernel::new(gpu, &glsl::SPLAT_TO_VOLUME, &[kernel.id(), shape as u32, storage as u32])?,
            pace: SubmissionPacer::new(glsl::SPLAT_TO_VOLUME.name),
            bins: Binner::new(gpu, kernel, &grid, splat_count)?,
            reconstructions: gpu.buffer(
                "reconstruction",
                "samples",
                grid.chunk_slots() * SAMPLES * storage.words(),
            )?,
            storage,
            pair_totals: gpu.buffer("pair totals", "sorting", grid.chunks())?,
            grid,
            epsilon,
        })
    }

    /// Makes room for another number of splats. Nothing may be in flight.
    pub fn resize(&mut self, splat_count: usize) -> Result<()> {
        self.bins.resize(splat_count)
    }

    /// Records binning and forward pass of one chunk. May submit in between.
    pub fn record(
        &mut self,
        recorder: &mut Recorder,
        splats: &Buffer<Splat>,
        chunk: usize,
        offset: [f32; 3],
    ) -> Result<()> {
        self.bins.record(recorder, &self.grid, splats, chunk, offset, &mut self.pair_totals);
        let grid = self.grid.params(chunk, offset);
        let limit = self.gpu.limits().workgroups as usize;
        let (kernel, coordinates, bins) = (&self.kernel, &self.grid.coordinates, &self.bins);
        let (epsilon, out) = (self.epsilon, &mut self.reconstructions);
        let groups = grid.slot_count as usize * CELLS / CELLS_PER_GROUP;
        self.pace.run(&self.gpu, recorder, groups, limit, |recorder, first, count| {
            recorder
                .pass(kernel)
                .read("starts", bins.starts())
                .read("pair_splats", bins.pair_splats())
                .read("cell_masks", &bins.cell_masks)
                .read("footprints", &bins.footprints)
                .read("brick_coordinates", coordinates)
                .write("reconstructions", out)
                .push(&RasterParams { grid, first_cell: (first * CELLS_PER_GROUP) as u32, epsilon })
                .dispatch(count as u32);
        })
    }

    /// Rasterizes one chunk and waits for it. Grows bins that are too small.
    pub fn rasterize_chunk(&mut self, splats: &Buffer<Splat>, chunk: usize, offset: [f32; 3]) -> Result<()> {
        loop {
            let mut recorder = self.gpu.record()?;
            self.record(&mut recorder, splats, chunk, offset)?;
            let ticket = recorder.submit()?;
            self.gpu.wait(ticket)?;
            let needed = self.pair_totals.read_range(chunk, 1)?[0] as usize;
            if needed <= self.bins.capacity() {
                return Ok(());
            }
            self.bins.grow(needed)?;
        }
    }

    /// Rasterizes all chunks at one offset and reads the samples back, in memory order of the bricks.
    pub fn rasterize(&mut self, splats: &Buffer<Splat>, offset: [f32; 3]) -> Result<Vec<Reconstruction>> {
        let mut out = Vec::with_capacity(self.grid.slot_count * SAMPLES);
        for chunk in 0..self.grid.chunks() {
            self.rasterize_chunk(splats, chunk, offset)?;
            let words = self.grid.chunk(chunk).len() * SAMPLES * self.storage.words();
            out.extend(self.storage.unpack::<Reconstruction>(&self.reconstructions.read_range(0, words)?));
        }
        Ok(out)
    }
}
