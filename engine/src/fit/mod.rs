//! The fit: splats for the voxels of a region of interest.
//!
//! [`Fitter::new`] samples targets and initialises splats on the host; [`Fitter::step`] is one iteration on the device,
//! the list of passes below with nothing hidden. Inside, lengths are voxels, positions count from the first voxel
//! of the brick grid, and intensities are relative to the ROI mean in spans of the HU range ([`Scaling`]).

mod config;
pub mod evaluate;
pub mod init;
mod profiles;
mod targets;
mod terms;
pub mod topology;

use std::collections::VecDeque;
use std::sync::Arc;

use shaders_glsl::types::{AdamParams, Target};

pub use config::{Background, FitConfig, Parameter, ScaleUnit, Storage};
pub use profiles::{PROFILES, Profile};
pub use targets::{Scaling, offsets, sample};

use crate::error::{Error, Kind, Result};
use crate::gpu::{Buffer, Gpu, Ticket};
use crate::passes::loss::{DICE, LEAK, MSE, OCCUPANCY, Weighted};
use crate::passes::{Adam, Gradient, Losses, Rasteriser};
use crate::splat::Splat;
use crate::splat::activation::normalised;
use crate::volume::{Bricks, Roi, Volume};

/// Steps that may be in flight at once: one runs while the next is recorded.
const IN_FLIGHT: usize = 2;

/// From so many bricks on the losses get a submission of their own, so that none takes long: on a CPU driver they need
/// some 20 µs a brick.
const LONG_LOSSES: usize = 4096;

/// A fit in progress.
pub struct Fitter {
    gpu: Gpu,
    config: FitConfig,
    scaling: Scaling,
    bricks: Arc<Bricks>,
    rasteriser: Rasteriser,
    losses: Losses,
    /// [offset]: the loss terms with their weights there.
    terms: Vec<Vec<Weighted>>,
    gradient: Gradient,
    adam: Adam,
    splats: Buffer<Splat>,
    offsets: Vec<[f32; 3]>,
    /// [offset][chunk]
    targets: Vec<Vec<Buffer<Target>>>,
    /// Pairs that each chunk needed in this step, then in the one before it.
    pair_totals: Buffer<u32>,
    /// Steps done, counting those in flight.
    iteration: u32,
    flying: VecDeque<Flight>,
    /// Read-back buffers of finished steps, to be used again.
    readbacks: Vec<Buffer<u32>>,
}

struct Flight {
    iteration: u32,
    ticket: Ticket,
    /// What `pair_totals` held.
    readback: Buffer<u32>,
}

/// How a fit stands, from the sums of its last step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Progress {
    /// Steps done.
    pub iteration: u32,
    /// Mean squared intensity error at the last step's offset, in squared spans of the HU range.
    pub mse: f64,
    /// PSNR over the span of the HU range, dB.
    pub psnr_db: f64,
    /// Root mean square of O - M over ROI and shell; 0 when the term is off.
    pub occupancy_rmse: f64,
    /// Dice loss of the predicted mask 1 - exp(-W) over ROI and shell, 0..1; nothing when the term is off.
    pub dice: Option<f64>,
    /// Mean of the predicted mask outside the ROI, 0..1; nothing when the term is off.
    pub leak: Option<f64>,
}

impl Fitter {
    /// Prepares a fit of `splats`, given in voxel coordinates of the volume and in HU. `config` must have passed
    /// [`FitConfig::check`].
    pub fn new(gpu: &Gpu, volume: &Volume, roi: &Roi, splats: &[Splat], config: &FitConfig) -> Result<Self> {
        if splats.is_empty() {
            return Err(Error::new(Kind::NothingToDo, "VGS-FIT-002", "no splats to fit"));
        }
        let bricks = Arc::new(Bricks::around(roi, terms::shell(config)));
        let scaling = Scaling::new(volume, roi, config);
        let rasteriser = Rasteriser::new(gpu, config.kernel, config.epsilon, &bricks, splats.len())?;
        let grid = &rasteriser.grid;
        let offsets = offsets(config.offsets, config.seed);
        let (mut targets, mut terms) = (Vec::new(), Vec::new());
        for (i, &offset) in offsets.iter().enumerate() {
            let mut outside = 0.0;
            let row: Result<Vec<_>> = (0..grid.chunks())
                .map(|c| {
                    let sampled = sample(&bricks, grid.chunk(c), volume, roi, &scaling, offset);
                    outside += terms::outside(&sampled);
                    gpu.upload(&format!("targets {i}.{c}"), "targets", &sampled)
                })
                .collect();
            targets.push(row?);
            terms.push(terms::weighted(config, roi, outside));
        }
        let losses = Losses::new(gpu, &terms[0], config.epsilon, grid.chunk_slots(), grid.chunks())?;
        let local: Vec<Splat> = splats.iter().map(|s| to_local(s, &bricks, &scaling)).collect();
        let pair_totals = gpu.buffer("pair totals of two steps", "sorting", 2 * rasteriser.grid.chunks())?;
        Ok(Fitter {
            gpu: gpu.clone(),
            gradient: Gradient::new(gpu, config.kernel, splats.len())?,
            adam: Adam::new(gpu, splats.len())?,
            splats: gpu.upload("splats", "splats", &local)?,
            config: config.clone(),
            scaling,
            bricks,
            rasteriser,
            losses,
            terms,
            offsets,
            targets,
            iteration: 0,
            flying: VecDeque::new(),
            readbacks: Vec::new(),
            pair_totals,
        })
    }

    /// How HU map to the fit's numbers.
    pub fn scaling(&self) -> &Scaling {
        &self.scaling
    }

    /// The sample grid.
    pub fn bricks(&self) -> &Bricks {
        &self.bricks
    }

    /// Steps done.
    pub fn iteration(&self) -> u32 {
        self.iteration
    }

    /// One iteration. The rates follow `share`, the part of the schedule that is done (0..1): iterations, or the time
    /// budget.
    pub fn step(&mut self, share: f64) -> Result<()> {
        let turn = self.iteration;
        let index = if self.config.grid_every > 0 && turn.is_multiple_of(self.config.grid_every) {
            0
        } else {
            turn as usize % self.offsets.len()
        };
        let offset = self.offsets[index];
        let chunks = self.rasteriser.grid.chunks();
        let mut recorder = self.gpu.record()?;
        recorder.copy(&self.rasteriser.pair_totals, 0, &mut self.pair_totals, chunks, chunks);
        // One chunk is rasterised once. More share their buffers: a loss that needs sums over all samples first
        // (`Losses::need_overlap`) takes a sweep of its own.
        let sweeps = if self.losses.need_overlap() && chunks > 1 { 2 } else { 1 };
        for (sweep, chunk) in (0..sweeps).flat_map(|sweep| (0..chunks).map(move |chunk| (sweep, chunk))) {
            let slots = self.rasteriser.grid.chunk(chunk);
            let (slot_count, targets) = (slots.len(), &self.targets[index][chunk]);
            self.rasteriser.record(&mut recorder, &self.splats, chunk, offset)?;
            if slot_count > LONG_LOSSES {
                recorder.split()?;
            }
            let samples = &self.rasteriser.reconstructions;
            if sweep == 0 {
                self.losses.record_overlap(&mut recorder, targets, samples, slots);
            }
            if sweep + 1 < sweeps {
                continue;
            }
            self.losses.record(&mut recorder, &self.terms[index], targets, samples, chunk, slot_count);
            if slot_count > LONG_LOSSES {
                recorder.split()?;
            }
            self.gradient.gather(
                &mut recorder,
                &self.rasteriser.grid,
                &self.rasteriser.bins.footprints,
                &self.losses.adjoints,
                chunk,
                offset,
            )?;
        }
        self.gradient.record(&mut recorder, &self.splats);
        recorder.copy(&self.rasteriser.pair_totals, 0, &mut self.pair_totals, 0, chunks);
        let params = self.adam_params(turn, share);
        self.adam.record(&mut recorder, &self.gradient.rows, &mut self.splats, &self.pair_totals, &params);
        let mut readback = match self.readbacks.pop() {
            Some(buffer) => buffer,
            None => self.gpu.readback("step read back", 2 * chunks)?,
        };
        recorder.copy(&self.pair_totals, 0, &mut readback, 0, 2 * chunks);
        let ticket = recorder.submit()?;
        self.flying.push_back(Flight { iteration: turn, ticket, readback });
        self.iteration += 1;
        // Behind the submission and not before the next: a void step sets the count back, and the caller takes the
        // share of the next step from the count.
        while self.flying.len() >= IN_FLIGHT {
            self.land()?;
        }
        Ok(())
    }

    /// Waits for all steps in flight. Afterwards splats and sums are those of [`Fitter::iteration`] steps.
    pub fn finish(&mut self) -> Result<()> {
        while !self.flying.is_empty() {
            self.land()?;
        }
        Ok(())
    }

    /// Waits for the oldest step in flight. Where its pairs did not fit, neither it nor those after it moved anything
    /// (`adam.comp`): the buffers grow and the count goes back to it.
    fn land(&mut self) -> Result<()> {
        let Some(flight) = self.flying.pop_front() else { return Ok(()) };
        self.gpu.wait(flight.ticket)?;
        let needed = flight.readback.mapped()?.iter().copied().max().unwrap_or_default() as usize;
        self.readbacks.push(flight.readback);
        if needed > self.rasteriser.bins.capacity() {
            while let Some(later) = self.flying.pop_front() {
                self.gpu.wait(later.ticket)?;
                self.readbacks.push(later.readback);
            }
            self.rasteriser.bins.grow(needed)?;
            self.iteration = flight.iteration;
        }
        Ok(())
    }

    fn adam_params(&self, turn: u32, share: f64) -> AdamParams {
        let c = &self.config;
        let t = f64::from(turn + 1);
        let decay = f64::from(c.rate_decay).powf(share.clamp(0.0, 1.0)) as f32;
        let correction = |beta: f32| (1.0 / (1.0 - f64::from(beta).powf(t))) as f32;
        AdamParams {
            splat_count: self.splats.len() as u32,
            // With one step in flight before this one, what that needed counts too: had it no room, it moved nothing and
            // will be repeated, so this one must not move anything either.
            chunk_count: (IN_FLIGHT * self.rasteriser.grid.chunks()) as u32,
            capacity: self.rasteriser.bins.capacity() as u32,
            beta1: c.beta1,
            beta2: c.beta2,
            correction1: correction(c.beta1),
            correction2: correction(c.beta2),
            epsilon: c.adam_epsilon,
            rate_mean: c.rate_mean * decay,
            rate_rotation: c.rate_rotation * decay,
            rate_log_scale: c.rate_log_scale * decay,
            rate_opacity: c.rate_opacity * decay,
            rate_intensity: c.rate_intensity * decay,
            min_log_scale: c.scale_min.ln(),
            max_log_scale: c.scale_max.ln(),
            max_logit: c.logit_max,
            min_intensity: self.scaling.value(self.scaling.roi_range.0),
            max_intensity: self.scaling.value(self.scaling.roi_range.1),
            max_mean: self.rasteriser.grid.max_mean(),
        }
    }

    /// How the fit stands. Waits for the device.
    pub fn progress(&mut self) -> Result<Progress> {
        self.finish()?;
        let sums = self.losses.sums()?;
        let mean = |term| self.terms[0].iter().position(|t| t.term == term).map(|i| sums[i].mean());
        let mse = mean(MSE).unwrap_or_default();
        Ok(Progress {
            iteration: self.iteration,
            mse,
            psnr_db: -10.0 * mse.log10(),
            occupancy_rmse: mean(OCCUPANCY).map(f64::sqrt).unwrap_or_default(),
            dice: mean(DICE),
            leak: mean(LEAK),
        })
    }

    /// Number of times that a splat kept still because its gradient was not finite. Waits for the device.
    pub fn frozen(&mut self) -> Result<u32> {
        self.finish()?;
        Ok(self.adam.frozen.read()?[0])
    }

    /// The splats as they are now, in voxel coordinates of the volume and in HU. Waits for the device.
    pub fn splats(&mut self) -> Result<Vec<Splat>> {
        self.finish()?;
        let local = self.splats.read()?;
        Ok(local.iter().map(|s| from_local(s, &self.bricks, &self.scaling)).collect())
    }
}

/// From voxel coordinates and HU to the brick grid and the fit's numbers.
fn to_local(s: &Splat, bricks: &Bricks, scaling: &Scaling) -> Splat {
    let origin = bricks.origin.as_vec3().to_array();
    Splat {
        mean: std::array::from_fn(|i| s.mean[i] - origin[i]),
        intensity: scaling.value(s.intensity.clamp(scaling.roi_range.0, scaling.roi_range.1)),
        rotation: normalised(s.rotation),
        ..*s
    }
}

fn from_local(s: &Splat, bricks: &Bricks, scaling: &Scaling) -> Splat {
    let origin = bricks.origin.as_vec3().to_array();
    Splat {
        mean: std::array::from_fn(|i| s.mean[i] + origin[i]),
        intensity: scaling.hu(s.intensity).clamp(scaling.roi_range.0, scaling.roi_range.1),
        ..*s
    }
}
