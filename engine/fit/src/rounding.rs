//! Rounding of a fit for a small file: one group of parameters after the other is rounded and stays, and the
//! groups that follow are fitted again, so that they make up for what rounding has changed.
//!
//! The shape comes first, because the steps of a mean follow from the shape; the intensity comes last, because
//! the field is linear in it.

use std::path::Path;

use super::evaluate::{Protocol, evaluate};
use super::going::{Going, iterate, part};
use super::run::Problem;
use super::unit::ScaleUnit;
use super::{FitConfig, Fitter};
use base::error::Result;
use gpu::Gpu;
use splat::{Group, Rounding, Splat, SplatSet};

/// The order of the groups.
const ORDER: [Group; 4] = [Group::Shape, Group::Mean, Group::Opacity, Group::Intensity];
/// Iterations between the rounding of one group and of the next.
const ITERATIONS: u32 = 30;
/// First learning rates after a rounding, as a share of those of a fit.
const RATES: f32 = 0.35;

/// Iterations that [`Problem::rounded_set`] takes.
pub const ROUNDING_ITERATIONS: u32 = (ORDER.len() as u32 - 1) * ITERATIONS;

impl Problem<'_> {
    /// Returns true if splats of this fit are rounded and fitted again for the format that the extension of
    /// `path` names. A fit of mini-batches has no memory for that; its splats are rounded as they are.
    pub fn is_rounded_in(&self, path: &Path) -> bool {
        splat::rounds(path) && self.config().subset.size == 0
    }

    /// Returns fitted splats (voxel space of the working grid, HU) as [`Problem::splat_set`] does, rounded
    /// to a lattice of steps that suit its error, and fitted again to make up for it. `going` hears how far that is; once it says
    /// stop, what is left is rounded at once. Waits for the device.
    ///
    /// # Errors
    /// Fails if the device fails.
    pub fn rounded_set(
        &self,
        gpu: &Gpu,
        splats: &[Splat],
        iterations: u32,
        going: &mut Going<'_>,
    ) -> Result<SplatSet> {
        let (low, high) = self.scaling().range;
        let protocol = Protocol { offsets: Vec::new(), range: [low, high], shell: 0, threshold: 0.0 };
        let found = evaluate(gpu, splats, &self.field(), self.volume(), self.roi(), &protocol)?;
        let mut rounding = Rounding::for_error(splats, found.on_grid.rmse_hu);
        let mut splats = splats.to_vec();
        for (done, &group) in ORDER.iter().enumerate() {
            let at = |done: usize| (done as f64 - 1.0) / (ORDER.len() as f64 - 1.0);
            if done > 0 && going(at(done)).is_continue() {
                let config = config_after(self.config(), &ORDER[..done], &splats);
                let mut fitter = Fitter::new(gpu, self.volume(), self.roi(), &splats, &config)?;
                iterate(&mut fitter, ITERATIONS, &mut part(going, at(done), at(done + 1)))?;
                let fitted = fitter.splats()?;
                for (splat, fitted) in splats.iter_mut().zip(&fitted) {
                    // What is rounded keeps its bits: converting it to the fit's numbers and back is not exact.
                    for &group in &ORDER[done..] {
                        group.copy(fitted, splat);
                    }
                }
            }
            rounding.round(&mut splats, group);
        }
        Ok(SplatSet { rounding: Some(rounding), ..self.splat_set(&splats, iterations) })
    }
}

/// Returns the configuration of iterations after a fit that leave the groups `rounded` alone.
pub(super) fn config_after(config: &FitConfig, rounded: &[Group], splats: &[Splat]) -> FitConfig {
    let usual = FitConfig::default();
    let rate = |rate: f32, group| if rounded.contains(&group) { 0.0 } else { RATES * rate };
    let scales = || splats.iter().flat_map(|splat| splat.log_scale).map(f32::exp);
    config.clone().with(|c| {
        c.rates.rotation = rate(usual.rates.rotation, Group::Shape);
        c.rates.log_scale = rate(usual.rates.log_scale, Group::Shape);
        c.rates.mean = rate(usual.rates.mean, Group::Mean);
        c.rates.opacity = rate(usual.rates.opacity, Group::Opacity);
        c.rates.intensity = rate(usual.rates.intensity, Group::Intensity);
        c.rates.learn_intensity = true;
        c.rates.learn_opacity = true;
        c.topology.name = usual.topology.name;
        c.subset.size = 0;
        // Splats are shaped in voxels by now. What is rounded may lie beyond the limits of the fit.
        c.init.unit = ScaleUnit::Voxel;
        c.scales.growth = 0.0;
        c.scales.min = scales().fold(f32::INFINITY, f32::min) * 0.9;
        c.scales.max = scales().fold(0.0, f32::max) * 1.1;
        c.logit_max = config.logit_max + 1.0;
    })
}
