//! The initialiser "uniform", from the paper's section 3.4: means at random in the region of interest, scales
//! at random.
//!
//! A voxel is drawn with the probability M / ΣM, and the mean evenly within it; the three scales are drawn
//! from U(`scale_min`, `scale_max`). Where the volume has a direction (`orientation`), the smallest scale
//! goes along the thin axis and the largest along the long one; elsewhere they stay as drawn, along the axes.
//!
//! With [`ScaleUnit::Voxel`] all this is in voxel space. With [`ScaleUnit::Spacing`] a scale counts in the
//! mean of the three voxel spacings and the direction is one of the patient's space: the splat is an
//! ellipsoid in millimetres, which the volume's matrix takes to voxel space.

use glam::DMat3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use rayon::prelude::*;

use super::density::{Density, GradientWeights};
use super::intensity::intensity;
use super::prototype::{prototype, set_opacity};
use crate::ScaleUnit;
use crate::config::Init;
use splat::space::reshaped;
use splat::{Activations, Splat};
use volume::{Roi, Volume};

/// Places exactly `count` splats; the contract is that of [`super::Initialiser::run`]. One sequence of random
/// numbers is drawn for all splats, so the result does not depend on the number of threads.
pub(super) fn initialise(volume: &Volume, roi: &Roi, count: usize, seed: u64, init: &Init) -> Vec<Splat> {
    assert_eq!(volume.size, roi.size, "a region of interest lies on the grid of its volume");
    // Without the gradient the density is the mask.
    let even = GradientWeights { exponent: 0.0, ..GradientWeights::of(init) };
    let Some(density) = Density::of(volume, roi, even).filter(|_| count > 0) else { return Vec::new() };
    let mut rng = Pcg64::seed_from_u64(seed);
    let means = density.draw_points(count, &mut rng);
    let span = init.scale_max - init.scale_min;
    let mut scale = || init.scale_min + span * rng.random::<f32>();
    let scales: Vec<[f32; 3]> = (0..count).map(|_| [scale(), scale(), scale()]).collect();
    let millimetres = match init.unit {
        // With the unit "box", scales and directions are those of the box.
        ScaleUnit::Voxel | ScaleUnit::Box => None,
        ScaleUnit::Spacing => Some(Millimetres::of(volume)),
    };
    let turns = (init.cue().run)(&density, &means, millimetres.as_ref().map(|m| &m.per_mm));
    let prototype = prototype(init);
    (means, scales, turns)
        .into_par_iter()
        .map(|(mean, mut scale, turn)| {
            let mut splat = Splat { mean, ..prototype };
            if let Some(rotation) = turn {
                splat.rotation = rotation;
                scale.sort_by(|a, b| b.total_cmp(a));
            }
            match &millimetres {
                None => splat.set_scale(scale),
                Some(m) => {
                    splat.set_scale(scale.map(|s| s * m.mean_spacing));
                    splat = reshaped(&splat, &m.voxel_from_mm);
                }
            }
            splat.intensity = intensity(volume, &density, &splat, init.footprint);
            set_opacity(&mut splat, roi, init);
            splat
        })
        .collect()
}

/// Maps between millimetres and the voxels of a volume.
struct Millimetres {
    /// L⁻¹, with L the linear part of the index-to-world map.
    voxel_from_mm: DMat3,
    /// L⁻ᵀ, which turns gradients per voxel into gradients per millimetre.
    per_mm: DMat3,
    /// Mean of the three voxel spacings, mm.
    mean_spacing: f32,
}

impl Millimetres {
    fn of(volume: &Volume) -> Self {
        let voxel_from_mm = volume.world_from_voxel.matrix3.inverse();
        let mean_spacing = (volume.spacing_mm().element_sum() / 3.0) as f32;
        Millimetres { voxel_from_mm, per_mm: voxel_from_mm.transpose(), mean_spacing }
    }
}
