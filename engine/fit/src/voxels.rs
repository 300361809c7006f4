//! The objective of a fit: splats rasterized at voxels, held against volume and mask.

use std::collections::HashMap;
use std::sync::Arc;

use shaders_glsl::types::{Footprint, SplatGrad, Target};

use super::config::FitConfig;
use super::subset::Subset;
use super::targets::{Scaling, offsets, sample};
use super::terms;
use base::error::Result;
use gpu::{Buffer, Gpu, Recorder};
use passes::loss::{ChunkSamples, UntouchedSums, Weighted};
use passes::{Gradient, Losses, Objective, Rasterizer, Reconstruction};
use splat::Splat;
use volume::{Bricks, Roi, Volume};

/// Number of bricks above which the losses get a submission of their own, so that none takes long: on a CPU
/// driver they need some 20 µs a brick.
const LONG_LOSSES: usize = 4096;

/// The error at the voxels of a region, at one of several sub-voxel offsets in each step.
pub(super) struct VoxelObjective {
    gpu: Gpu,
    config: FitConfig,
    bricks: Arc<Bricks>,
    counts: Counts,
    /// Rasterizer of all splats, or of a mini-batch where that is rasterized alone.
    pub(super) rasterizer: Rasterizer,
    /// Rasterizer of all splats where `rasterizer` has a mini-batch; it is created when it is first needed.
    whole: Option<Rasterizer>,
    gradient: Gradient,
    losses: Losses,
    /// [offset]: the loss terms with their weights at that offset.
    terms: Vec<Vec<Weighted>>,
    /// [offset][chunk]: sums of the losses in bricks that no splat reaches, which a mini-batch leaves out;
    /// empty where all splats are rasterized.
    untouched: Vec<Vec<UntouchedSums>>,
    offsets: Vec<[f32; 3]>,
    /// [offset][chunk]: the targets.
    targets: Vec<Vec<Buffer<Target>>>,
    /// Footprints of a mini-batch, where all splats are rasterized.
    footprints: Option<Buffer<Footprint>>,
    /// Number of pairs that each chunk needed in this step, then in the one before it.
    pair_totals: Buffer<u32>,
}

/// Numbers of splats.
#[derive(Clone, Copy, Debug)]
pub(super) struct Counts {
    pub all: usize,
    /// That move in a step: fewer than all where there are mini-batches.
    pub moving: usize,
}

/// The splats of a step: all of them, and the mini-batch that moves where there is one.
pub(super) struct Moving<'a> {
    pub all: &'a Buffer<Splat>,
    pub subset: Option<&'a Subset>,
}

impl VoxelObjective {
    /// Samples the targets, and makes room for `counts` splats.
    #[expect(clippy::too_many_arguments, reason = "what a fit is made of, at its one place")]
    pub fn new(
        gpu: &Gpu,
        volume: &Volume,
        roi: &Roi,
        config: &FitConfig,
        bricks: &Arc<Bricks>,
        scaling: &Scaling,
        stretch: [f32; 3],
        counts: Counts,
    ) -> Result<Self> {
        let rasterizer = rasterizer(gpu, bricks, counts.rasterized(config), config, stretch)?;
        let grid = &rasterizer.grid;
        let offsets = offsets(config.offset_count(), config.seed);
        // What is shown in the rim is the region's own.
        let own = config.has_rim(roi).then(|| volume.of_region_alone(roi));
        let aimed = own.as_ref().unwrap_or(volume);
        let (mut targets, mut terms) = (Vec::new(), Vec::new());
        for (i, &offset) in offsets.iter().enumerate() {
            let mut outside = 0.0;
            let row: Result<Vec<_>> = (0..grid.chunks())
                .map(|c| {
                    let rim = config.has_rim(roi);
                    let sampled = sample(bricks, grid.chunk(c), aimed, roi, scaling, offset, rim);
                    outside += terms::outside(config, &sampled);
                    gpu.upload(&format!("targets {i}.{c}"), "targets", &sampled)
                })
                .collect();
            targets.push(row?);
            terms.push(terms::weighted(config, roi, scaling, outside));
        }
        let (slots, chunks) = (grid.chunk_slots(), grid.chunks());
        let mut losses = Losses::new(gpu, &terms[0], config.epsilon, config.storage, slots, chunks)?;
        let untouched = untouched_sums(gpu, config, &rasterizer, &mut losses, &terms, &targets)?;
        Ok(VoxelObjective {
            gpu: gpu.clone(),
            config: config.clone(),
            bricks: bricks.clone(),
            counts,
            gradient: Gradient::new(gpu, config.kernel, counts.moving, config.storage)?,
            footprints: footprints(gpu, config, counts)?,
            pair_totals: gpu.buffer("pair totals of two steps", "sorting", 2 * chunks)?,
            rasterizer,
            whole: None,
            losses,
            terms,
            untouched,
            offsets,
            targets,
        })
    }

    /// Makes room for `counts` splats.
    pub fn resize(&mut self, counts: Counts) -> Result<()> {
        self.counts = counts;
        self.whole = None;
        self.rasterizer.resize(counts.rasterized(&self.config))?;
        self.gradient.resize(counts.moving)?;
        self.footprints = footprints(&self.gpu, &self.config, counts)?;
        Ok(())
    }

    /// Returns the index of the offset that step `turn` samples at.
    fn offset_index(&self, turn: u32) -> usize {
        if self.config.samples.grid_every > 0 && turn.is_multiple_of(self.config.samples.grid_every) {
            0
        } else {
            turn as usize % self.offsets.len()
        }
    }

    /// Returns the means of the last step, by row of [`passes::loss::TERMS`]. Waits for the device.
    pub fn means(&self) -> Result<HashMap<usize, f64>> {
        let sums = self.losses.sums()?;
        Ok(self.terms[0].iter().zip(sums).map(|(weighted, sum)| (weighted.term, sum.mean())).collect())
    }

    /// Computes the sums of the losses over all splats as step `turn` has them, where it has only those of its
    /// mini-batch. Values, unlike adjoints, do not need the overlap first.
    pub fn measure_all(&mut self, splats: &Buffer<Splat>, turn: u32) -> Result<()> {
        let index = self.offset_index(turn);
        let offset = self.offsets[index];
        self.make_whole()?;
        let rasterizer = self.whole.as_mut().unwrap_or(&mut self.rasterizer);
        for chunk in 0..rasterizer.grid.chunks() {
            rasterizer.rasterize_chunk(splats, chunk, offset)?;
            let mut recorder = self.gpu.record()?;
            let samples = ChunkSamples {
                chunk,
                slots: rasterizer.grid.chunk(chunk),
                targets: &self.targets[index][chunk],
                reconstructions: &rasterizer.reconstructions,
                touched: None,
            };
            self.losses.record(&mut recorder, &self.terms[index], &samples);
            self.gpu.wait(recorder.submit()?)?;
        }
        Ok(())
    }

    /// Returns what all `splats` are at the voxel centres, by slot and Morton place.
    pub fn at_voxels(&mut self, splats: &Buffer<Splat>) -> Result<Vec<Reconstruction>> {
        self.make_whole()?;
        self.whole.as_mut().unwrap_or(&mut self.rasterizer).rasterize(splats, [0.0; 3])
    }

    fn make_whole(&mut self) -> Result<()> {
        let Counts { all, .. } = self.counts;
        if self.counts.rasterized(&self.config) < all && self.whole.is_none() {
            let stretch = self.rasterizer.grid.stretch;
            self.whole = Some(rasterizer(&self.gpu, &self.bricks, all, &self.config, stretch)?);
        }
        Ok(())
    }
}

impl Objective for VoxelObjective {
    type Splats<'a> = Moving<'a>;

    fn record(&mut self, recorder: &mut Recorder, splats: &Moving<'_>, turn: u32) -> Result<()> {
        let index = self.offset_index(turn);
        let offset = self.offsets[index];
        let (rasterizer, losses, gradient) = (&mut self.rasterizer, &mut self.losses, &mut self.gradient);
        let chunks = rasterizer.grid.chunks();
        recorder.copy(&rasterizer.pair_totals, 0, &mut self.pair_totals, chunks, chunks);
        let moving = splats.subset.map_or(splats.all, |subset| &subset.active.splats);
        let rasterized = if self.config.subset.alone { moving } else { splats.all };
        // One chunk is rasterized once. More share their buffers: a loss that needs sums over all samples
        // first (`Losses::need_overlap`) takes a sweep of its own.
        let sweeps = if losses.need_overlap() && chunks > 1 { 2 } else { 1 };
        for (sweep, chunk) in (0..sweeps).flat_map(|sweep| (0..chunks).map(move |chunk| (sweep, chunk))) {
            let slots = rasterizer.grid.chunk(chunk);
            let slot_count = slots.len();
            rasterizer.record(recorder, rasterized, chunk, offset)?;
            if slot_count > LONG_LOSSES {
                recorder.split()?;
            }
            let samples = ChunkSamples {
                chunk,
                slots,
                targets: &self.targets[index][chunk],
                reconstructions: &rasterizer.reconstructions,
                touched: self.untouched.get(index).map(|row| (rasterizer.bins.starts(), &row[chunk])),
            };
            if sweep == 0 {
                losses.record_overlap(recorder, &samples);
            }
            if sweep + 1 < sweeps {
                continue;
            }
            losses.record(recorder, &self.terms[index], &samples);
            if slot_count > LONG_LOSSES {
                recorder.split()?;
            }
            let footprints = match (splats.subset, &mut self.footprints) {
                (Some(subset), Some(footprints)) => {
                    subset.take(recorder, &rasterizer.bins.footprints, footprints, turn);
                    &*footprints
                }
                _ => &rasterizer.bins.footprints,
            };
            gradient.gather(recorder, &rasterizer.grid, footprints, &losses.adjoints, chunk, offset)?;
        }
        gradient.record(recorder, moving, rasterizer.grid.stretch);
        recorder.copy(&rasterizer.pair_totals, 0, &mut self.pair_totals, 0, chunks);
        Ok(())
    }

    fn gradients(&self) -> &Buffer<SplatGrad> {
        &self.gradient.rows
    }

    /// By chunk, of the last step and then of the one before it.
    fn pair_totals(&self) -> &Buffer<u32> {
        &self.pair_totals
    }

    fn capacity(&self) -> usize {
        self.rasterizer.bins.capacity()
    }

    fn grow(&mut self, pairs: usize) -> Result<()> {
        self.rasterizer.bins.grow(pairs)
    }
}

impl Counts {
    /// Returns how many splats are rasterized in a step.
    fn rasterized(self, config: &FitConfig) -> usize {
        if config.subset.alone { self.moving } else { self.all }
    }
}

/// Creates the footprints of a mini-batch where all splats are rasterized.
fn footprints(gpu: &Gpu, config: &FitConfig, counts: Counts) -> Result<Option<Buffer<Footprint>>> {
    let needed = counts.moving < counts.all && !config.subset.alone;
    needed.then(|| gpu.buffer("footprints of the subset", "splats", counts.moving)).transpose()
}

/// Computes what the losses sum up to in bricks that no splat reaches, by [offset][chunk]. Most bricks are of
/// this kind where a mini-batch is rasterized alone; for other fits nothing is returned.
fn untouched_sums(
    gpu: &Gpu,
    config: &FitConfig,
    rasterizer: &Rasterizer,
    losses: &mut Losses,
    terms: &[Vec<Weighted>],
    targets: &[Vec<Buffer<Target>>],
) -> Result<Vec<Vec<UntouchedSums>>> {
    if config.subset.size == 0 || !config.subset.alone {
        return Ok(Vec::new());
    }
    let Rasterizer { grid, reconstructions: nothing, .. } = rasterizer;
    let mut chunks = |terms: &[Weighted], targets: &[Buffer<Target>]| {
        let of_chunk =
            |(chunk, targets)| losses.untouched_sums(gpu, terms, targets, nothing, chunk, grid.chunk(chunk));
        targets.iter().enumerate().map(of_chunk).collect()
    };
    terms.iter().zip(targets).map(|(terms, targets)| chunks(terms, targets)).collect()
}

/// Creates a rasterizer whose samples are stored as the losses of the fit read them.
fn rasterizer(
    gpu: &Gpu,
    bricks: &Bricks,
    count: usize,
    config: &FitConfig,
    stretch: [f32; 3],
) -> Result<Rasterizer> {
    let mut rasterizer =
        Rasterizer::with_storage(gpu, config.kernel, config.epsilon, bricks, count, config.storage)?;
    rasterizer.grid.stretch = stretch;
    Ok(rasterizer)
}
