//! Work between two iterations, on the host: splats are added, removed and moved (`topology`), and
//! intensities and opacities that are not learned are sampled.

use glam::{DMat3, DVec3, IVec3};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use rayon::prelude::*;
use shaders_glsl::types::History;

use super::evaluate::FieldSample;
use super::fitter::{Fitter, Work, to_local};
use super::state::SplatRow;
use super::topology::{Change, Scene};
use base::error::Result;
use splat::space::reshaped;
use splat::{Activations, Splat};

impl Fitter<'_> {
    /// Returns true if the fit must pause before its next iteration.
    pub(super) fn is_pause_due(&self) -> bool {
        let is_new = self.iteration > 0 && self.paused_at != Some(self.iteration);
        is_new && (self.is_change_due() || self.is_sampling_due())
    }

    fn is_change_due(&self) -> bool {
        let window = self.config.topology.from..=self.config.topology.until;
        window.contains(&self.iteration)
            && self.iteration.is_multiple_of(self.config.topology.every)
            && self.config.topology().is_ok_and(|row| row.change.is_some())
    }

    fn is_sampling_due(&self) -> bool {
        let c = &self.config;
        c.rates.sample_every > 0
            && self.iteration.is_multiple_of(c.rates.sample_every)
            && !(c.rates.learn_intensity && c.rates.learn_opacity)
    }

    /// Changes splats and samples intensities and opacities, as far as either is due. Nothing may be in
    /// flight.
    pub(super) fn pause(&mut self, share: f64) -> Result<()> {
        if self.is_change_due() {
            self.change_topology(share)?;
        }
        if self.is_sampling_due() {
            let splats = self.splats()?;
            let mut rows = self.work.read_rows()?;
            for (row, splat) in rows.iter_mut().zip(&splats) {
                if !self.config.rates.learn_intensity {
                    row.splat.intensity = self.scaling.value(splat.intensity);
                }
                if !self.config.rates.learn_opacity {
                    row.splat.opacity_logit = splat.opacity_logit;
                }
            }
            self.work.write_rows(&rows)?;
        }
        self.paused_at = Some(self.iteration);
        Ok(())
    }

    fn change_topology(&mut self, share: f64) -> Result<()> {
        let Some(change) = self.config.topology()?.change else { return Ok(()) };
        let splats = self.splats()?;
        let samples = self.field_at_voxels()?;
        let histories = self.work.all.histories.read()?;
        let gradient_norms: Vec<f32> = histories.iter().map(|h| h.gradient_norm).collect();
        let seed = self.config.seed ^ (u64::from(self.iteration) << 32) ^ 0x746f_706f_6c6f_6779;
        let scene = Scene {
            volume: self.volume,
            roi: self.roi,
            config: &self.config,
            scaling: &self.scaling,
            scale_range: (self.config.scales.min, self.config.scales.max),
            splats: &splats,
            gradient_norms: &gradient_norms,
            bricks: &self.bricks,
            samples: &samples,
            share,
            limit: (self.first_count as f64 * f64::from(self.config.topology.limit)).round() as usize,
        };
        let changed = change(&scene, &mut Pcg64::seed_from_u64(seed));
        self.replace(&splats, &changed)
    }

    /// Returns the field of all splats at the voxel centres, [slot][Morton place], HU.
    fn field_at_voxels(&mut self) -> Result<Vec<FieldSample>> {
        let got = self.objective.at_voxels(&self.work.all.splats)?;
        let (scaling, w0) = (self.scaling, self.config.loss.occupancy_w0);
        let sample = |weight: f32, value: f32| FieldSample {
            hu: scaling.hu(value),
            occupancy: weight / (weight + w0),
            weight,
        };
        Ok(got.into_iter().map(|r| sample(r.weight, r.value)).collect())
    }

    /// Replaces the splats `old` by those of a change, with all gradient norms at zero.
    fn replace(&mut self, old: &[Splat], changed: &Change) -> Result<()> {
        let before = self.work.read_rows()?;
        let rows: Vec<SplatRow> = changed
            .splats
            .iter()
            .zip(&changed.keeps)
            .map(|(splat, keeps)| {
                let kept = keeps.map(|i| i as usize);
                // A splat that stays as it is keeps its bits: converting it there and back is not exact.
                let same = kept.filter(|&i| old[i] == *splat);
                let moments = kept.map_or(SplatRow::default(), |i| before[i]);
                let local = same.map_or_else(|| self.changed(splat), |i| before[i].splat);
                let history = match same {
                    Some(i) => History { gradient_norm: 0.0, ..before[i].history },
                    None => self.history(&local),
                };
                SplatRow { splat: local, history, ..moments }
            })
            .collect();
        if rows.len() != before.len() {
            self.work = Work::new(&self.gpu, rows.len(), &self.config)?;
            self.objective.resize(self.work.counts())?;
        }
        self.work.write_rows(&rows)
    }

    /// Converts a splat from voxel space and HU to the space and the numbers of the fit.
    fn changed(&self, splat: &Splat) -> Splat {
        let local = to_local(splat, &self.bricks, &self.scaling);
        if self.stretch == DVec3::ONE {
            return local;
        }
        reshaped(&local, &DMat3::from_diagonal(self.stretch.recip()))
    }

    /// Sets the opacities to those of the mask around the means: a weighted mean over 27 points, one standard
    /// deviation away along the axes. As in the code of the paper's authors, the points are not turned with
    /// the splat. The splats are in voxel coordinates and shaped in the space of `scale_unit`.
    pub(super) fn sample_opacities(&self, splats: &mut [Splat]) {
        let last = DVec3::from_array(self.volume.size.map(|n| n.saturating_sub(1) as f64));
        let weight = |step: DVec3| (-0.5 * step.length_squared()).exp();
        let steps: Vec<DVec3> =
            (0..27).map(|i: i32| (IVec3::new(i % 3, i / 3 % 3, i / 9) - 1).as_dvec3()).collect();
        let whole: f64 = steps.iter().map(|&step| weight(step)).sum();
        splats.par_iter_mut().for_each(|splat| {
            let mean = glam::Vec3::from_array(splat.mean).as_dvec3();
            let reach = self.stretch * DVec3::from_array(splat.scale().map(f64::from));
            let at = |step: DVec3| (mean + reach * step).clamp(DVec3::ZERO, last);
            let sum: f64 = steps.iter().map(|&step| weight(step) * self.roi.trilinear(at(step))).sum();
            splat.set_opacity((sum / whole) as f32);
            let limit = self.config.logit_max;
            splat.opacity_logit = splat.opacity_logit.clamp(-limit, limit);
        });
    }

    /// Sets the intensities to those of the volume at the means.
    pub(super) fn sample_intensities(&self, splats: &mut [Splat]) {
        let (range, (low, high)) = (self.scaling.range, self.scaling.intensity_range);
        for splat in splats {
            let at = glam::Vec3::from_array(splat.mean).as_dvec3();
            let hu = self.volume.sample_clipped(at, range, self.scaling.background) as f32;
            splat.intensity = hu.clamp(low, high);
        }
    }
}
