//! Estimates what a run costs, from rates of two CPU cores with a software driver.

use bench::scene::{EVALUATIONS_A_SECOND, SAMPLES_A_VOXEL, SMALL_SPLAT};
use engine::splat::Kernel;

use super::job::Job;
use super::library::Place;

/// Samples in the support of a splat of the paper's size, for isotropic voxels.
const SAMPLES_A_SPLAT: f64 = 2000.0;
/// Time of the loss per brick, seconds.
const BRICK: f64 = 20e-6;
/// Time of a measurement on the host per voxel, seconds.
const COMPARED: f64 = 1e-7;

/// Estimates the seconds that a run takes.
pub fn estimate(job: &Job, place: &Place) -> f64 {
    let c = &job.config;
    let evaluations = |splats: usize| match c.kernel {
        Kernel::Compact => place.voxels * SAMPLES_A_VOXEL + splats as f64 * SMALL_SPLAT,
        _ => splats as f64 * SAMPLES_A_SPLAT * place.aspect,
    };
    let moving = if c.subset.size > 0 { c.subset.size } else { c.count.splats };
    let rasterized = if c.subset.alone { moving } else { c.count.splats };
    let step =
        (evaluations(rasterized) + evaluations(moving)) / EVALUATIONS_A_SECOND + place.bricks as f64 * BRICK;
    let measurement =
        evaluations(c.count.splats) / EVALUATIONS_A_SECOND + place.bricks as f64 * 512.0 * COMPARED;
    let measurements = c.iterations / job.measure_every + 2 + job.held_out as u32;
    f64::from(c.iterations) * step + f64::from(measurements) * measurement + 1.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::job::tests::job;
    use bench::scene::Scene;

    #[test]
    fn a_subset_costs_less_than_all_and_more_when_all_are_rasterized() {
        let place = Place::new(Scene::phantom(24).expect("a phantom"));
        let with = |subset: usize, alone: bool| {
            let mut job = job(10_000);
            job.config.kernel = Kernel::Gaussian;
            (job.config.subset.size, job.config.subset.alone) = (subset, alone);
            estimate(&job, &place)
        };
        assert!(with(100, true) < with(100, false) && with(100, false) < with(0, true));
        assert!((place.aspect - 1.0).abs() < 1e-9 && place.bricks > 0);
    }
}
