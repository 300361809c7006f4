//! The initialiser "reference", as in the code of the paper's authors: means even over the voxels of the
//! region, not more than four in a cell of 2³ voxels, and one random scale for each splat, so that it is
//! round in the space of the scales' unit.
//!
//! A voxel is in the region if the mask is at least 0.05, however much more it is: a soft mask is no
//! probability here. A mean lies evenly within its voxel and is drawn again if it falls into a voxel outside
//! the region. If there is no room for so many splats, cells take more.

use glam::{DMat3, IVec3};
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

/// Least mask of a voxel in the region.
const INSIDE: f32 = 0.05;
/// The most means in a cell of 2³ voxels.
const MOST_IN_CELL: usize = 4;
/// Most that a mean moves beyond half a voxel.
const JITTER: f32 = 0.01;

/// Places exactly `count` splats; the contract is that of [`super::Initialiser::run`]. One sequence of random
/// numbers is drawn for all splats, so the result does not depend on the number of threads.
pub(super) fn initialise(volume: &Volume, roi: &Roi, count: usize, seed: u64, init: &Init) -> Vec<Splat> {
    assert_eq!(volume.size, roi.size, "a region of interest lies on the grid of its volume");
    let Some(density) = Density::of(volume, roi, GradientWeights::of(init)).filter(|_| count > 0) else {
        return Vec::new();
    };
    let mut rng = Pcg64::seed_from_u64(seed);
    let means = means(roi, count, &mut rng);
    let span = init.scale_max - init.scale_min;
    let scales: Vec<f32> = (0..count).map(|_| init.scale_min + span * rng.random::<f32>()).collect();
    let millimetres = (init.unit == ScaleUnit::Spacing).then(|| {
        let voxel_from_mm = volume.world_from_voxel.matrix3.inverse();
        (voxel_from_mm, voxel_from_mm.transpose(), (volume.spacing_mm().element_sum() / 3.0) as f32)
    });
    let per_mm: Option<&DMat3> = millimetres.as_ref().map(|(_, per_mm, _)| per_mm);
    let turns = (init.cue().run)(&density, &means, per_mm);
    let prototype = prototype(init);
    (means, scales, turns)
        .into_par_iter()
        .map(|(mean, scale, turn)| {
            let mut splat = Splat { mean, ..prototype };
            splat.rotation = turn.unwrap_or(splat.rotation);
            splat.set_scale([scale; 3]);
            if let Some((voxel_from_mm, _, mean_spacing)) = &millimetres {
                splat.set_scale([scale * mean_spacing; 3]);
                splat = reshaped(&splat, voxel_from_mm);
            }
            splat.intensity = intensity(volume, &density, &splat, init.footprint);
            set_opacity(&mut splat, roi, init);
            splat
        })
        .collect()
}

/// Draws the means, in voxel space. If no voxel reaches the threshold of the region, those with any mask are
/// the region.
fn means(roi: &Roi, count: usize, rng: &mut Pcg64) -> Vec<[f32; 3]> {
    let above = |least: f32| -> Vec<usize> {
        (0..roi.weight.len()).filter(|&i| roi.weight[i] >= least && roi.weight[i] > 0.0).collect()
    };
    let (mut voxels, mut least) = (above(INSIDE), INSIDE);
    if voxels.is_empty() {
        // The smallest number there is: every positive weight passes.
        (voxels, least) = (above(0.0), f32::from_bits(1));
    }
    let cells = roi.size.map(|n| n.div_ceil(2));
    let mut taken = vec![0usize; cells.iter().product()];
    let mut most = MOST_IN_CELL;
    let mut refused = 0;
    let mut means = Vec::with_capacity(count);
    while means.len() < count {
        let i = voxels[rng.random_range(0..voxels.len())];
        let [nx, ny, _] = roi.size;
        let voxel = [i % nx, i / nx % ny, i / (nx * ny)];
        let mean: [f32; 3] = std::array::from_fn(|k| {
            let jitter = rng.random::<f32>() - 0.5 + JITTER * (2.0 * rng.random::<f32>() - 1.0);
            (voxel[k] as f32 + jitter).clamp(0.0, roi.size[k] as f32 - 1.0)
        });
        let nearest = mean.map(|c| c.round() as i32);
        let [x, y, z] = nearest.map(|c| c as usize / 2);
        let cell = &mut taken[(z * cells[1] + y) * cells[0] + x];
        if roi.at(IVec3::from_array(nearest)) < least || *cell >= most {
            refused += 1;
            // Nearly all cells are full.
            if refused > 50 * (means.len() + voxels.len()) {
                (most, refused) = (2 * most, 0);
            }
            continue;
        }
        *cell += 1;
        means.push(mean);
    }
    means
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;

    #[test]
    fn the_faintest_weights_are_drawn_from() {
        let volume = Volume::new([4, 4, 4], DAffine3::IDENTITY, vec![0.0; 64]);
        let roi = Roi::new(vec![1e-40; 64], &volume).unwrap();
        assert_eq!(means(&roi, 5, &mut Pcg64::seed_from_u64(1)).len(), 5);
    }

    #[test]
    fn means_are_even_over_the_region_and_in_it() {
        let size = [20, 16, 12];
        let count = size.iter().product::<usize>();
        let weight: Vec<f32> = (0..count)
            .map(|i| match i % 20 {
                0..8 => 1.0,
                8..10 => 0.04,
                _ => 0.06,
            })
            .collect();
        let volume = Volume::new(size, DAffine3::IDENTITY, (0..count).map(|i| i as f32).collect());
        let roi = Roi::new(weight, &volume).unwrap();
        let init = Init {
            scale_min: 1.5,
            scale_max: 4.0,
            unit: ScaleUnit::Box,
            opacity_mask: true,
            ..Init::default()
        };
        let splats = initialise(&volume, &roi, 900, 3, &init);
        assert_eq!(splats.len(), 900);
        assert!(splats == initialise(&volume, &roi, 900, 3, &init), "the same seed gives the same splats");
        let mut cells = std::collections::BTreeMap::new();
        for s in &splats {
            let nearest = s.mean.map(|c| c.round() as i32);
            assert!(roi.at(IVec3::from_array(nearest)) >= INSIDE, "{nearest:?}");
            *cells.entry(nearest.map(|c| c / 2)).or_insert(0) += 1;
            let scale = s.scale();
            assert!(scale.iter().all(|&v| (v - scale[0]).abs() < 1e-5), "round: {scale:?}");
            assert!((1.5..4.0001).contains(&scale[0]));
            let m = roi.trilinear(glam::Vec3::from_array(s.mean).as_dvec3()) as f32;
            assert!((s.opacity() - m.clamp(1e-7, 1.0)).abs() < 1e-5, "{} at {m}", s.opacity());
        }
        assert!(cells.values().all(|&n| n <= MOST_IN_CELL));
        // A mask of 0.06 draws as many as one of 1: no probability.
        let faint = splats.iter().filter(|s| s.mean[0] > 9.5).count();
        assert!((350..650).contains(&faint), "{faint} of 900 where 10 of 18 voxels are faint");
        // More than there is room for.
        assert_eq!(initialise(&volume, &roi, 9000, 3, &init).len(), 9000);
    }
}
