//! The input and the result of a change of the splats.

use glam::{DVec3, IVec3};
use rayon::prelude::*;

use crate::evaluate::FieldSample;
use crate::{FitConfig, Scaling};
use splat::Splat;
use splat::activation::Activations;
use volume::bricks::SAMPLES;
use volume::{Bricks, Roi, Volume};

/// The input of a change, in voxel space and HU.
pub struct Scene<'a> {
    /// The volume that is fitted.
    pub volume: &'a Volume,
    /// Its region of interest.
    pub roi: &'a Roi,
    /// Hyper-parameters.
    pub config: &'a FitConfig,
    /// The clip range, and the range in which intensities stay.
    pub scaling: &'a Scaling,
    /// Least and greatest scale of a splat, voxels, whatever unit the configuration states them in.
    pub scale_range: (f32, f32),
    /// All splats.
    pub splats: &'a [Splat],
    /// Σ |dL/dμ| of each splat since the last change.
    pub gradient_norms: &'a [f32],
    /// The sample grid.
    pub bricks: &'a Bricks,
    /// The field of the splats at the voxel centres, [slot][Morton place].
    pub samples: &'a [FieldSample],
    /// Part of the schedule that is done, 0..1.
    pub share: f64,
    /// Maximum number of splats.
    pub limit: usize,
}

/// The splats after a change.
#[derive(Clone, Debug, Default)]
pub struct Change {
    /// All splats, in voxel space and HU.
    pub splats: Vec<Splat>,
    /// For each splat, the index of the old one whose moments of Adam it keeps; a new splat has none and
    /// starts without moments.
    pub keeps: Vec<Option<u32>>,
}

impl Change {
    /// Returns a change that keeps all splats.
    pub(super) fn none(scene: &Scene) -> Change {
        let keeps = (0..scene.splats.len() as u32).map(Some).collect();
        Change { splats: scene.splats.to_vec(), keeps }
    }

    /// Adds a new splat, without moments.
    pub(super) fn add(&mut self, splat: Splat) {
        self.splats.push(splat);
        self.keeps.push(None);
    }
}

impl Scene<'_> {
    /// Returns the most splats that one change adds or moves: `topology_share` of all, rounded down.
    pub(super) fn most_at_once(&self) -> usize {
        // Computed in f32, where a share of 0.7 of 10 is 7 and not 6.99.
        (self.config.topology.share * self.splats.len() as f32) as usize
    }

    /// Returns the most splats that a change adds when `remaining` of the old ones stay.
    pub(super) fn most_added(&self, remaining: usize) -> usize {
        self.most_at_once().min(self.limit.saturating_sub(remaining))
    }

    /// Returns `f(field, voxel, m)` at each voxel of the ROI and `idle` at all other samples, in memory order
    /// of the samples. m is the weight of the intensity error: 1 in a binary ROI, the mask in a soft one.
    pub(super) fn map_roi<T: Copy + Send + Sync>(
        &self,
        idle: T,
        f: impl Fn(&FieldSample, IVec3, f32) -> T + Sync,
    ) -> Vec<T> {
        let mut out = vec![idle; self.samples.len()];
        out.par_chunks_mut(SAMPLES).zip(self.samples.par_chunks(SAMPLES)).enumerate().for_each(
            |(slot, (out, samples))| {
                for (morton, (out, sample)) in out.iter_mut().zip(samples).enumerate() {
                    if !self.bricks.is_active(slot, morton) {
                        continue;
                    }
                    let voxel = self.bricks.voxel(slot, morton);
                    let m = self.roi.at(voxel);
                    if m > 0.5 || self.roi.soft && m > 0.0 {
                        *out = f(sample, voxel, if self.roi.soft { m } else { 1.0 });
                    }
                }
            },
        );
        out
    }

    /// Returns V at `x` (voxel space), as the fit sees it: clipped and trilinear, HU.
    pub(super) fn target(&self, x: DVec3) -> f64 {
        self.volume.sample_clipped(x, self.scaling.range, self.scaling.background)
    }

    /// Returns the voxel of the sample with this index.
    pub(super) fn voxel(&self, index: usize) -> IVec3 {
        self.bricks.voxel(index / SAMPLES, index % SAMPLES)
    }

    /// Creates a round splat at `mean` (voxel space) with the intensity of the volume there.
    pub(super) fn new_splat(&self, mean: DVec3, scale: f32, opacity: f32) -> Splat {
        let mut splat = Splat { mean: mean.as_vec3().to_array(), ..Splat::default() };
        splat.rotation = [1.0, 0.0, 0.0, 0.0];
        splat.set_scale([scale; 3]);
        splat.set_opacity(opacity);
        let (low, high) = self.scaling.intensity_range;
        splat.intensity = (self.target(splat.mean.map(f64::from).into()) as f32).clamp(low, high);
        self.clamp(&mut splat);
        splat
    }

    /// Puts a splat within the clamps of the optimiser: its mean in the brick grid, scales and opacity in
    /// their ranges.
    pub(super) fn clamp(&self, splat: &mut Splat) {
        let low = self.bricks.origin.as_vec3() - 0.5;
        let high = low + (self.bricks.grid * 8).as_vec3();
        for axis in 0..3 {
            splat.mean[axis] = splat.mean[axis].clamp(low[axis], high[axis]);
        }
        let (least, most) = self.scale_range;
        splat.log_scale = splat.log_scale.map(|log| log.clamp(least.ln(), most.ln()));
        splat.opacity_logit = splat.opacity_logit.clamp(-self.config.logit_max, self.config.logit_max);
    }
}
