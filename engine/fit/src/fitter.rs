//! A fit in progress, on the device.
//!
//! [`Fitter::step`] records one iteration for the device: the error at the voxels (`voxels`), and Adam. What
//! happens between iterations (splats are added, removed and moved, intensities are sampled) is in `pause`. Inside, lengths are voxels, positions count from the first voxel of the brick
//! grid, and intensities are relative to the background in spans of the HU range ([`Scaling`]).

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use glam::{DMat3, DVec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use shaders_glsl::types::{AdamParams, History, SplatGrad};

use super::config::FitConfig;
use super::schedule::Schedule;
use super::state::{FitState, SplatRow};
use super::subset::Subset;
use super::targets::Scaling;
use super::terms;
use super::unit::ScaleUnit;
use super::voxels::{Counts, Moving, VoxelObjective};
use base::error::{Error, Kind, Result};
use gpu::{Buffer, Gpu, Ticket};
use passes::loss::{DICE, LEAK, MSE, OCCUPANCY};
use passes::{Adam, Objective, adam};
use splat::Splat;
use splat::activation::normalised;
use splat::space::reshaped;
use volume::{Bricks, Roi, Volume};

/// Number of steps that may be in flight at once: one runs while the next is recorded.
const IN_FLIGHT: usize = 2;

/// A fit in progress.
pub struct Fitter<'a> {
    pub(super) gpu: Gpu,
    pub(super) volume: &'a Volume,
    pub(super) roi: &'a Roi,
    pub(super) config: FitConfig,
    pub(super) scaling: Scaling,
    pub(super) bricks: Arc<Bricks>,
    /// Voxels along each axis that are one unit of the space in which splats have their shape.
    pub(super) stretch: DVec3,
    /// Least and greatest log scale along each of a splat's own axes.
    pub(super) log_scale_range: [[f32; 3]; 2],
    pub(super) objective: VoxelObjective,
    pub(super) adam: Adam,
    pub(super) work: Work,
    /// Number of steps done, counting those in flight.
    pub(super) iteration: u32,
    /// The iteration before which the fit paused last.
    pub(super) paused_at: Option<u32>,
    /// Number of splats that the fit began with.
    pub(super) first_count: usize,
    pub(super) flying: VecDeque<Flight>,
    /// Read-back buffers of finished steps, to be used again.
    pub(super) readbacks: Vec<Buffer<u32>>,
}

/// Buffers that have a row per splat.
pub(super) struct Work {
    pub(super) all: adam::AdamState,
    pub(super) subset: Option<Subset>,
    /// Gradients of all splats, 0 outside the mini-batch, used where Adam takes a step for all splats.
    pub(super) dense: Option<Buffer<SplatGrad>>,
}

pub(super) struct Flight {
    iteration: u32,
    ticket: Ticket,
    /// Copy of the pairs that it and the step before it needed.
    readback: Buffer<u32>,
}

/// Figures of a fit in progress, from the sums of its last step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Progress {
    /// Number of steps done.
    pub iteration: u32,
    /// Mean squared intensity error at the last step's offset as the loss weighs it (with the rim of a fit
    /// for the grid), in squared spans of the HU range.
    pub mse: f64,
    /// PSNR over the span of the HU range, dB; infinite where the error is 0, which not every file format can
    /// hold.
    #[serde(skip)]
    pub psnr_db: f64,
    /// Root mean square of what |O - M| has beyond the tolerance, over ROI and shell; 0 when the term is off.
    pub occupancy_rmse: f64,
    /// Dice loss of the predicted mask 1 - exp(-W) over ROI and shell, 0..1; none when the term is off.
    pub dice: Option<f64>,
    /// Mean of the predicted mask outside the ROI, 0..1; none when the term is off.
    pub leak: Option<f64>,
}

impl<'a> Fitter<'a> {
    /// Prepares a fit of `splats` as an initialiser gives them: in voxel coordinates of the volume and in HU,
    /// and shaped in the space of `scale_unit`. `config` must have passed [`FitConfig::check`]. Fails if
    /// there are no splats.
    pub fn new(
        gpu: &Gpu,
        volume: &'a Volume,
        roi: &'a Roi,
        splats: &[Splat],
        config: &FitConfig,
    ) -> Result<Self> {
        let mut fitter = Fitter::of_count(gpu, volume, roi, splats.len(), config)?;
        let local: Vec<Splat> = splats.iter().map(|s| to_local(s, &fitter.bricks, &fitter.scaling)).collect();
        fitter.work.all.splats.write_range(0, &local)?;
        let histories: Vec<_> = local.iter().map(|s| fitter.history(s)).collect();
        fitter.work.all.histories.write_range(0, &histories)?;
        Ok(fitter)
    }

    /// Returns the history of a splat that is new to the fit: no gradient yet, and the cap of its log scales.
    pub(super) fn history(&self, splat: &Splat) -> History {
        let largest = splat.log_scale.into_iter().fold(f32::NEG_INFINITY, f32::max);
        let log_scale_cap = match self.config.scales.growth {
            0.0 => adam::NO_CAP,
            growth => largest + growth.ln(),
        };
        History { gradient_norm: 0.0, log_scale_cap }
    }

    /// Prepares a fit that goes on from what [`Fitter::state`] returned, with the same inputs and the same
    /// configuration.
    pub fn resume(
        gpu: &Gpu,
        volume: &'a Volume,
        roi: &'a Roi,
        state: &FitState,
        config: &FitConfig,
    ) -> Result<Self> {
        let mut fitter = Fitter::of_count(gpu, volume, roi, state.rows.len(), config)?;
        fitter.iteration = state.iteration;
        fitter.paused_at = state.paused_at;
        fitter.first_count = state.first_count;
        fitter.adam.frozen.write_range(0, &[state.frozen])?;
        fitter.work.write_rows(&state.rows)?;
        Ok(fitter)
    }

    /// Prepares a fit of `count` splats, except for the splats themselves. Fails if `count` is 0.
    fn of_count(
        gpu: &Gpu,
        volume: &'a Volume,
        roi: &'a Roi,
        count: usize,
        config: &FitConfig,
    ) -> Result<Self> {
        if count == 0 {
            return Err(Error::new(Kind::NothingToDo, "VGS-FIT-002", "no splats to fit"));
        }
        let around = if config.loss.shell_beyond { Bricks::around_and_beyond } else { Bricks::around };
        let bricks = Arc::new(around(roi, terms::shell(config, roi)));
        let scaling = Scaling::new(volume, roi, config);
        let stretch = config.init.unit.stretch(volume);
        let work = Work::new(gpu, count, config)?;
        let local = stretch.as_vec3().to_array();
        let counts = work.counts();
        let objective = VoxelObjective::new(gpu, volume, roi, config, &bricks, &scaling, local, counts)?;
        let (scale_min, scale_max) = config.scale_clamp(volume);
        Ok(Fitter {
            gpu: gpu.clone(),
            volume,
            roi,
            adam: Adam::new(gpu)?,
            config: config.clone().with(|c| {
                c.scales.min = scale_min;
                c.scales.max = scale_max;
            }),
            scaling,
            bricks,
            stretch,
            log_scale_range: log_scale_range(scale_min, scale_max, config, stretch),
            work,
            objective,
            iteration: 0,
            paused_at: None,
            first_count: count,
            flying: VecDeque::new(),
            readbacks: Vec::new(),
        })
    }

    /// Returns the map between HU and the fit's numbers.
    pub fn scaling(&self) -> &Scaling {
        &self.scaling
    }

    /// Returns the sample grid.
    pub fn bricks(&self) -> &Bricks {
        &self.bricks
    }

    /// Returns the number of steps done, counting those in flight.
    pub fn iteration(&self) -> u32 {
        self.iteration
    }

    /// Submits one iteration to the device. The learning rates follow `share`, the part of the schedule that
    /// is done (0..1), by iterations or by the time budget.
    pub fn step(&mut self, share: f64) -> Result<()> {
        self.prepare(share)?;
        let turn = self.iteration;
        let params = self.adam_params(turn, share);
        let Work { all, subset, dense } = &mut self.work;
        let mut recorder = self.gpu.record()?;
        if let Some(subset) = subset {
            subset.take_state(&mut recorder, all, turn);
        }
        let splats = Moving { all: &all.splats, subset: subset.as_ref() };
        self.objective.record(&mut recorder, &splats, turn)?;
        let (adam, objective) = (&mut self.adam, &self.objective);
        let (gradients, totals) = (objective.gradients(), objective.pair_totals());
        match (subset, dense) {
            (None, _) => adam.record(&mut recorder, gradients, all, totals, &params),
            (Some(subset), Some(dense)) => {
                recorder.clear(dense);
                subset.put_gradients(&mut recorder, gradients, dense, turn);
                adam.record(&mut recorder, dense, all, totals, &params);
            }
            (Some(subset), None) => {
                adam.record(&mut recorder, gradients, &mut subset.active, totals, &params);
                subset.put_state(&mut recorder, all, turn);
            }
        }
        let mut readback = match self.readbacks.pop() {
            Some(buffer) => buffer,
            None => self.gpu.readback("step read back", totals.len())?,
        };
        recorder.copy(totals, 0, &mut readback, 0, totals.len());
        let ticket = recorder.submit()?;
        self.flying.push_back(Flight { iteration: turn, ticket, readback });
        self.iteration += 1;
        // This waits after the submission and not before the next one: a step that must be repeated sets the
        // count back, and the caller takes the share of the next step from the count.
        while self.flying.len() >= IN_FLIGHT {
            self.finish_oldest_step()?;
        }
        Ok(())
    }

    /// Runs steps until `iteration` of them are done, and waits for the device. The rates follow the
    /// iterations of `schedule`, not its time.
    pub fn run_to(&mut self, iteration: u32, schedule: Schedule) -> Result<()> {
        while self.iteration < iteration {
            while self.iteration < iteration {
                self.step(schedule.share(self.iteration, Duration::ZERO))?;
            }
            // A step whose buffers were too small does not count.
            self.finish()?;
        }
        Ok(())
    }

    /// Pauses the fit and shuffles the mini-batches where that must happen before the next iteration, with
    /// nothing in flight. Waiting may set the count back.
    fn prepare(&mut self, share: f64) -> Result<()> {
        loop {
            let shuffled = self.work.subset.as_ref().is_none_or(|subset| subset.is_ready(self.iteration));
            let pause = self.is_pause_due();
            if shuffled && !pause {
                return Ok(());
            }
            if !self.flying.is_empty() {
                self.finish()?;
            } else if pause {
                self.pause(share)?;
            } else if let Some(subset) = &mut self.work.subset {
                subset.shuffle(self.iteration)?;
            }
        }
    }

    /// Waits for all steps in flight. Afterwards splats and sums are those of [`Fitter::iteration`] steps.
    pub fn finish(&mut self) -> Result<()> {
        while !self.flying.is_empty() {
            self.finish_oldest_step()?;
        }
        Ok(())
    }

    /// Waits for the oldest step in flight. If its pairs did not fit, neither it nor those after it moved
    /// anything (`adam.comp`): the buffers grow and the count goes back to it.
    fn finish_oldest_step(&mut self) -> Result<()> {
        let Some(flight) = self.flying.pop_front() else { return Ok(()) };
        self.gpu.wait(flight.ticket)?;
        let needed = flight.readback.mapped()?.iter().copied().max().unwrap_or_default() as usize;
        self.readbacks.push(flight.readback);
        if needed > self.objective.capacity() {
            while let Some(later) = self.flying.pop_front() {
                self.gpu.wait(later.ticket)?;
                self.readbacks.push(later.readback);
            }
            self.objective.grow(needed)?;
            self.iteration = flight.iteration;
        }
        Ok(())
    }

    fn adam_params(&self, turn: u32, share: f64) -> AdamParams {
        let c = &self.config;
        let subset = self.work.subset.as_ref();
        // Number of updates of each splat that moves now, this one included.
        let block = subset.filter(|_| !c.subset.dense);
        let t = f64::from(block.map_or(turn, |subset| subset.epoch(turn)) + 1);
        let decay = f64::from(c.rates.decay).powf(share.clamp(0.0, 1.0)) as f32;
        let spent = f64::from(turn) / f64::from(c.rates.mean_decay_iterations);
        let mean_decay = decay * f64::from(c.rates.mean_decay).powf(spent) as f32;
        let correction = |beta: f32| (1.0 / (1.0 - f64::from(beta).powf(t))) as f32;
        AdamParams {
            splat_count: block.map_or(self.work.all.splats.len(), Subset::size) as u32,
            // If a step is in flight before this one, its needs count too: if its pairs had no room, it moved
            // nothing and will be repeated, so this one must not move anything either.
            chunk_count: self.objective.pair_totals().len() as u32,
            capacity: self.objective.capacity() as u32,
            beta1: c.adam.beta1,
            beta2: c.adam.beta2,
            correction1: correction(c.adam.beta1),
            correction2: correction(c.adam.beta2),
            epsilon: c.adam.epsilon,
            rate_mean: self.edges().map(|edge| c.rates.mean * mean_decay * edge),
            rate_rotation: c.rates.rotation * decay,
            rate_log_scale: c.rates.log_scale * decay,
            rate_opacity: if c.rates.learn_opacity { c.rates.opacity * decay } else { 0.0 },
            rate_intensity: if c.rates.learn_intensity { c.rates.intensity * decay } else { 0.0 },
            min_log_scale: self.log_scale_range[0],
            max_log_scale: self.log_scale_range[1],
            scale_weight: self.scale_weight(),
            max_logit: c.logit_max,
            min_intensity: self.scaling.value(self.scaling.intensity_range.0),
            max_intensity: self.scaling.value(self.scaling.intensity_range.1),
            max_mean: self.objective.rasterizer.grid.max_mean(),
        }
    }

    /// Returns the voxels along each axis that are one unit of `rate_mean`.
    fn edges(&self) -> [f32; 3] {
        match self.config.init.unit {
            ScaleUnit::Voxel | ScaleUnit::Spacing => [1.0; 3],
            ScaleUnit::Box => self.volume.size.map(|n| n as f32 - 1.0),
        }
    }

    /// Returns λ of Σ |s| over the splats, from `scale_weight`, which is that of the mean, for an objective
    /// that is a sum over samples (`terms`).
    fn scale_weight(&self) -> f32 {
        let edge = match self.config.init.unit {
            ScaleUnit::Voxel | ScaleUnit::Spacing => 1.0,
            ScaleUnit::Box => self.stretch.x / f64::from(self.edges()[0]).max(1.0),
        };
        let count = self.work.all.splats.len() as f64;
        let size = terms::region_size(&self.config, self.roi);
        (f64::from(self.config.loss.scale_weight) * 0.5 * size * edge / count) as f32
    }

    /// Returns the figures of the last step. Waits for the device.
    pub fn progress(&mut self) -> Result<Progress> {
        self.finish()?;
        if self.work.subset.is_some() && self.config.subset.alone {
            self.objective.measure_all(&self.work.all.splats, self.iteration.saturating_sub(1))?;
        }
        let means = self.objective.means()?;
        let mean = |term| means.get(&term).copied();
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

    /// Returns how many times a splat was left as it was because its gradient was not finite. Waits for the
    /// device.
    pub fn frozen(&mut self) -> Result<u32> {
        self.finish()?;
        Ok(self.adam.frozen.read()?[0])
    }

    /// Returns the splats as they are now, in voxel coordinates of the volume and in HU. Waits for the
    /// device.
    pub fn splats(&mut self) -> Result<Vec<Splat>> {
        self.finish()?;
        let local = self.work.all.splats.read()?;
        let shape = DMat3::from_diagonal(self.stretch);
        let mut splats: Vec<_> = local.par_iter().map(|s| self.to_voxel(s)).collect();
        if !self.config.rates.learn_intensity {
            self.sample_intensities(&mut splats);
        }
        if !self.config.rates.learn_opacity {
            self.sample_opacities(&mut splats);
        }
        if self.stretch != DVec3::ONE {
            splats = splats.par_iter().map(|s| reshaped(s, &shape)).collect();
        }
        Ok(splats)
    }

    /// Returns the state of the fit, for [`Fitter::resume`]. Waits for the device.
    pub fn state(&mut self) -> Result<FitState> {
        self.finish()?;
        Ok(FitState {
            iteration: self.iteration,
            paused_at: self.paused_at,
            frozen: self.adam.frozen.read()?[0],
            first_count: self.first_count,
            rows: self.work.read_rows()?,
        })
    }
}

impl Work {
    pub(super) fn new(gpu: &Gpu, count: usize, config: &FitConfig) -> Result<Self> {
        let subset = Subset::of(gpu, count, config)?;
        // Gradients of all splats are needed if there are mini-batches and Adam takes a step for all splats.
        let dense = subset.is_some() && config.subset.dense;
        Ok(Work {
            dense: dense.then(|| gpu.buffer("gradients of all splats", "optimiser", count)).transpose()?,
            all: adam::AdamState::zeroed(gpu, count)?,
            subset,
        })
    }

    pub(super) fn counts(&self) -> Counts {
        let all = self.all.splats.len();
        Counts { all, moving: self.subset.as_ref().map_or(all, Subset::size) }
    }

    pub(super) fn read_rows(&self) -> Result<Vec<SplatRow>> {
        let (splats, first) = (self.all.splats.read()?, self.all.first.read()?);
        let (second, histories) = (self.all.second.read()?, self.all.histories.read()?);
        let rows = splats.into_iter().zip(first).zip(second).zip(histories);
        Ok(rows
            .map(|(((splat, first), second), history)| SplatRow { splat, first, second, history })
            .collect())
    }

    /// Writes `rows` to the device; their number must be that of the splats.
    pub(super) fn write_rows(&mut self, rows: &[SplatRow]) -> Result<()> {
        self.all.splats.write_range(0, &rows.iter().map(|r| r.splat).collect::<Vec<_>>())?;
        self.all.first.write_range(0, &rows.iter().map(|r| r.first).collect::<Vec<_>>())?;
        self.all.second.write_range(0, &rows.iter().map(|r| r.second).collect::<Vec<_>>())?;
        self.all.histories.write_range(0, &rows.iter().map(|r| r.history).collect::<Vec<_>>())
    }
}

/// Returns the least and greatest log scale along each of a splat's own axes. In the unit cube of the box,
/// axis k has the clamps in voxels of the volume's axis k, however the splat is turned, as in the code of the
/// paper's authors.
fn log_scale_range(least: f32, most: f32, config: &FitConfig, stretch: DVec3) -> [[f32; 3]; 2] {
    let unit = match config.init.unit {
        ScaleUnit::Voxel | ScaleUnit::Spacing => [1.0; 3],
        ScaleUnit::Box => stretch.as_vec3().to_array(),
    };
    [least, most].map(|scale| unit.map(|unit| (scale / unit).ln()))
}

/// Converts a splat from voxel coordinates and HU to the brick grid and the fit's numbers; its intensity is
/// clamped and its rotation normalised.
pub(super) fn to_local(s: &Splat, bricks: &Bricks, scaling: &Scaling) -> Splat {
    let origin = bricks.origin.as_vec3().to_array();
    Splat {
        mean: std::array::from_fn(|i| s.mean[i] - origin[i]),
        intensity: scaling.value(s.intensity.clamp(scaling.intensity_range.0, scaling.intensity_range.1)),
        rotation: normalised(s.rotation),
        ..*s
    }
}

impl Fitter<'_> {
    /// Converts a splat from the fit's numbers to voxel coordinates of the volume and HU; its shape stays in
    /// the space of `scale_unit`.
    fn to_voxel(&self, s: &Splat) -> Splat {
        let origin = self.bricks.origin.as_vec3().to_array();
        let (low, high) = self.scaling.intensity_range;
        Splat {
            mean: std::array::from_fn(|i| s.mean[i] + origin[i]),
            intensity: self.scaling.hu(s.intensity).clamp(low, high),
            ..*s
        }
    }
}
