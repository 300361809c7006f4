//! Tests of where the field is wrong, and of the two changes that go there.

use glam::DVec3;

use super::super::growth::growth;
use super::super::relocate::{relocate, scores};
use super::super::residual::smoothed_residuals;
use super::super::spread::spread;
use super::*;

#[test]
fn residuals_are_smoothed_within_the_region_and_across_bricks() {
    for weight in [1.0, 0.25] {
        let world = World::new(crowd(40, 7), FitConfig::default(), weight);
        let found = smoothed_residuals(&world.scene());
        let indices = world.roi_indices();
        let squared = |i: usize| {
            let v = world.scene().voxel(i).as_dvec3();
            f64::from(weight) * (f64::from(world.samples[i].hu) - world.volume.trilinear(v)).powi(2)
        };
        let all: Vec<(DVec3, f64)> =
            indices.iter().map(|&i| (world.scene().voxel(i).as_dvec3(), squared(i))).collect();
        let line = |d: f64| (-0.5 * d * d).exp();
        let total: f64 = (-3..=3).map(|d| line(f64::from(d))).sum();
        for &i in indices.iter().step_by(7) {
            let here = world.scene().voxel(i).as_dvec3();
            let near = all.iter().filter(|(v, _)| (*v - here).abs().max_element() <= 3.0);
            let expected: f64 = near
                .map(|(v, r)| {
                    let d = *v - here;
                    r * line(d.x) * line(d.y) * line(d.z) / total.powi(3)
                })
                .sum();
            assert!((f64::from(found[i]) - expected).abs() <= 1e-4 * expected + 1e-3, "{here}");
        }
        let outside = (0..found.len()).filter(|i| !indices.contains(i));
        assert!(outside.map(|i| found[i]).all(|r| r == 0.0), "nothing outside the region");
    }
}

#[test]
fn growth_adds_at_the_worst_voxels_and_apart() {
    let config = FitConfig::default().with(|c| c.topology.share = 0.5);
    let mut world = World::new(crowd(60, 8), config, 1.0);
    world.share = 0.49;
    let change = growth(&world.scene(), &mut random());
    assert_consistent(&world, &change, "growth");
    assert_eq!(change.keeps[..60], (0..60).map(Some).collect::<Vec<_>>()[..], "all stay");
    let new = &change.splats[60..];
    assert_eq!(new.len(), 30);

    let residuals = smoothed_residuals(&world.scene());
    let at = |s: &Splat| {
        let voxel = DVec3::from_array(s.mean.map(f64::from)).as_ivec3();
        world.roi_indices().into_iter().find(|&i| world.scene().voxel(i) == voxel).expect("in the region")
    };
    let values: Vec<f32> = new.iter().map(|s| residuals[at(s)]).collect();
    assert!(values.is_sorted_by(|a, b| a >= b), "the worst come first");
    assert_eq!(values[0], residuals.iter().copied().fold(0.0, f32::max));
    let distance = |a: &Splat, b: &Splat| (0..3).map(|k| (a.mean[k] - b.mean[k]).powi(2)).sum::<f32>().sqrt();
    for (i, s) in new.iter().enumerate() {
        assert!(new[..i].iter().all(|other| distance(s, other) >= 2.0), "{:?}", s.mean);
        assert_eq!(s.intensity, world.volume.samples[at_volume(s, &world)]);
        assert_eq!((s.opacity_logit, s.rotation), (0.0, [1.0, 0.0, 0.0, 0.0]));
        assert!(s.scale().iter().all(|s| (s - 0.8).abs() < 1e-6));
    }
    // Greedy: a voxel that is worse than the last taken lies near one that was taken.
    for i in world.roi_indices().into_iter().filter(|&i| residuals[i] > values[29]) {
        let v = world.scene().voxel(i).as_vec3().to_array();
        let near = |s: &Splat| distance(s, &Splat { mean: v, ..Splat::default() }) < 2.0;
        assert!(new.iter().any(near), "{v:?} was passed over");
    }

    world.share = 0.5;
    let late = growth(&world.scene(), &mut random());
    assert_eq!(bits(&late.splats), bits(&world.splats), "nothing in the second half");
}

fn at_volume(s: &Splat, world: &World) -> usize {
    let [x, y, z] = s.mean.map(|c| c as usize);
    world.volume.index(x, y, z)
}

#[test]
fn scores_are_those_of_the_full_sum() {
    for (kernel, weight_of_roi) in
        [(Kernel::Compact, 1.0), (Kernel::Gaussian, 1.0), (Kernel::Density, 1.0), (Kernel::Compact, 0.3)]
    {
        let config = FitConfig { kernel, ..FitConfig::default() };
        let mut world = World::new(crowd(50, 9), config, weight_of_roi);
        world.splats[7].mean = [3.0, 3.0, 3.0]; // reaches the region hardly or not
        world.splats[8].set_scale([9.0, 0.4, 0.4]);
        world.sum_field();
        let indices = world.roi_indices();
        let found = scores(&world.scene());
        for (splat, found) in world.splats.iter().zip(&found) {
            let expected: f64 = indices
                .iter()
                .map(|&i| {
                    let sample = &world.samples[i];
                    let share = weight(splat, world.scene().voxel(i).as_dvec3(), kernel)
                        / f64::from(sample.weight + world.config.epsilon);
                    let error = f64::from(splat.intensity) - f64::from(sample.hu);
                    f64::from(weight_of_roi) * (share * error).powi(2)
                })
                .sum();
            assert!((found - expected).abs() <= 1e-5 * expected, "{kernel:?}: {found}, not {expected}");
        }
        assert!(found.iter().filter(|&&score| score > 0.0).count() > 40);
        world.splats[0].mean[1] = f32::NAN;
        world.splats[1].log_scale = [f32::INFINITY; 3];
        let odd = scores(&world.scene());
        assert!(odd.iter().all(|s| s.is_finite()));
        assert_eq!(odd[0], 0.0);
        assert_eq!(odd[2..], found[2..]);
    }
}

#[test]
fn idle_splats_move_to_the_worst_voxels() {
    let config = FitConfig::default().with(|c| c.topology.share = 0.1);
    let mut world = World::new(crowd(50, 10), config, 1.0);
    // All in the region, but for idle ones: far outside or transparent.
    for (i, s) in world.splats.iter_mut().enumerate() {
        s.mean = [12.0 + (i % 4) as f32, 10.0 + (i / 4 % 4) as f32, 9.0 + (i / 16) as f32];
    }
    let idle = [4usize, 17, 30, 31, 49];
    for i in idle {
        world.splats[i].mean = [0.0, 0.0, 0.0];
        world.splats[i].set_scale([0.5; 3]);
    }
    world.splats[17].mean = [15.0, 12.0, 11.0];
    world.splats[17].opacity_logit = -40.0;
    world.sum_field();
    let change = relocate(&world.scene(), &mut random());
    assert_consistent(&world, &change, "relocate");
    assert_eq!(change.splats.len(), 50, "their number stays");
    let moved: Vec<usize> = (0..50).filter(|&i| change.keeps[i].is_none()).collect();
    assert_eq!(moved, idle);
    assert!((0..50).all(|i| change.keeps[i].is_none_or(|old| old as usize == i)), "places in the list stay");
    let grown = growth(&world.scene(), &mut random());
    let mut targets: Vec<_> = grown.splats[50..].iter().map(|s| s.mean.map(f32::to_bits)).collect();
    let mut places: Vec<_> = moved.iter().map(|&i| change.splats[i].mean.map(f32::to_bits)).collect();
    targets.sort_unstable();
    places.sort_unstable();
    assert_eq!(places, targets, "they go where growth would add");

    world.share = 0.5;
    let late = relocate(&world.scene(), &mut random());
    assert_eq!(bits(&late.splats), bits(&world.splats), "nothing in the second half");
    assert!(late.keeps.iter().all(Option::is_some));
}

#[test]
fn samples_keep_apart_across_bricks() {
    let world = World::new(crowd(1, 0), FitConfig::default(), 1.0);
    let indices = world.roi_indices();
    for (distance, most) in [(0.0, 9999), (1.0, 9999), (2.0, 9999), (3.7, 9999), (2.0, 10), (2.0, 0)] {
        let chosen = spread(&world.bricks, indices.iter().copied(), distance, most);
        let at: Vec<DVec3> = chosen.iter().map(|&i| world.scene().voxel(i).as_dvec3()).collect();
        for (k, v) in at.iter().enumerate() {
            assert!(at[..k].iter().all(|other| other.distance(*v) >= distance), "{distance}: {v}");
        }
        if most < 9999 {
            assert_eq!(chosen.len(), most);
        } else {
            let near = |i: &usize| {
                let v = world.scene().voxel(*i).as_dvec3();
                at.iter().any(|other| other.distance(v) < distance || *other == v)
            };
            assert!(indices.iter().all(near), "{distance}: one more had found a place");
        }
        assert!(chosen.is_sorted(), "in the order of the candidates");
    }
    assert_eq!(spread(&world.bricks, indices.iter().copied(), 1.0, 9999), indices);
}
