//! What happens between two iterations, on the host: splats come, go and move (`topology`), and intensities that are not
//! learned are sampled at the means.

use rand::SeedableRng;
use rand_pcg::Pcg64;

use super::evaluate::FieldSample;
use super::state::Row;
use super::topology::{Change, Scene};
use super::{Fitter, Work, to_local};
use crate::error::Result;
use crate::splat::Splat;

impl Fitter<'_> {
    /// Whether the fit must pause before its next iteration.
    pub(super) fn is_pause_due(&self) -> bool {
        let k = self.iteration;
        let on_time = k > 0 && k.is_multiple_of(self.config.topology_every) && self.paused_at != Some(k);
        on_time && (self.is_change_due() || !self.config.learn_intensity)
    }

    fn is_change_due(&self) -> bool {
        let window = self.config.topology_from..=self.config.topology_until;
        window.contains(&self.iteration) && self.config.topology().is_ok_and(|row| row.change.is_some())
    }

    /// Changes splats and samples intensities. Nothing may be in flight.
    pub(super) fn pause(&mut self, share: f64) -> Result<()> {
        if self.is_change_due() {
            self.change_topology(share)?;
        }
        if !self.config.learn_intensity {
            let splats = self.splats()?;
            let mut rows = self.work.read_rows()?;
            for (row, splat) in rows.iter_mut().zip(&splats) {
                row.splat.intensity = self.scaling.value(splat.intensity);
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
        let gradient_norms = self.work.all.gradient_norms.read()?;
        let seed = self.config.seed ^ (u64::from(self.iteration) << 32) ^ 0x746f_706f_6c6f_6779;
        let scene = Scene {
            volume: self.volume,
            roi: self.roi,
            config: &self.config,
            scaling: &self.scaling,
            scale_range: (self.config.scale_min, self.config.scale_max),
            splats: &splats,
            gradient_norms: &gradient_norms,
            bricks: &self.bricks,
            samples: &samples,
            share,
            limit: (self.first_count as f64 * f64::from(self.config.topology_limit)).round() as usize,
        };
        let changed = change(&scene, &mut Pcg64::seed_from_u64(seed));
        self.replace(&splats, &changed)
    }

    /// The field of all splats at the voxel centres, [slot][Morton place], HU.
    fn field_at_voxels(&mut self) -> Result<Vec<FieldSample>> {
        let (rasteriser, splats) = self.work.whole(&self.gpu, &self.bricks, &self.config)?;
        let got = rasteriser.rasterise(splats, [0.0; 3])?;
        let (scaling, w0) = (self.scaling, self.config.occupancy_w0);
        let sample = |weight: f32, value: f32| FieldSample {
            hu: scaling.hu(value),
            occupancy: weight / (weight + w0),
            weight,
        };
        Ok(got.into_iter().map(|r| sample(r.weight, r.value)).collect())
    }

    /// Puts the splats of a change in place of `old`, all gradient norms at zero.
    fn replace(&mut self, old: &[Splat], changed: &Change) -> Result<()> {
        let before = self.work.read_rows()?;
        let rows: Vec<Row> = changed
            .splats
            .iter()
            .zip(&changed.keeps)
            .map(|(splat, keeps)| {
                let kept = keeps.map(|i| i as usize);
                // A splat that stays as it is keeps its bits: there and back again is not exact.
                let same = kept.filter(|&i| old[i] == *splat);
                let moments = kept.map_or(Row::default(), |i| before[i]);
                let local = to_local(splat, &self.bricks, &self.scaling);
                Row { splat: same.map_or(local, |i| before[i].splat), gradient_norm: 0.0, ..moments }
            })
            .collect();
        if rows.len() != before.len() {
            self.work.resize(&self.gpu, rows.len(), &self.config)?;
        }
        self.work.write_rows(&rows)
    }

    /// Intensities that are those of the volume at the means.
    pub(super) fn sample_intensities(&self, splats: &mut [Splat]) {
        let (range, (low, high)) = (self.scaling.range, self.scaling.intensity_range);
        for splat in splats {
            let at = glam::Vec3::from_array(splat.mean).as_dvec3();
            let hu = self.volume.sample_clipped(at, range, self.scaling.background) as f32;
            splat.intensity = hu.clamp(low, high);
        }
    }
}

impl Work {
    /// Room for another number of splats; what the rows hold is lost.
    fn resize(&mut self, gpu: &crate::gpu::Gpu, count: usize, config: &super::FitConfig) -> Result<()> {
        self.whole = None;
        self.subset = super::Subset::of(gpu, count, config)?;
        let moving = self.subset.as_ref().map_or(count, super::Subset::size);
        self.rasteriser.resize(if config.subset_alone { moving } else { count })?;
        self.gradient.resize(moving)?;
        self.all = crate::passes::adam::State::zeroed(gpu, count)?;
        Ok(())
    }
}
