//! Tests of refinement, pruning and hole filling.

use glam::{DMat3, DVec3};

use super::super::densify::{densify, percentile};
use super::*;

#[test]
fn percentiles_are_linear_between_ranks() {
    let rows: [(&[f32], f32, f64); 8] = [
        (&[], 60.0, 0.0),
        (&[3.0], 60.0, 3.0),
        (&[4.0, 1.0, 3.0, 2.0, 5.0], 0.0, 1.0),
        (&[4.0, 1.0, 3.0, 2.0, 5.0], 50.0, 3.0),
        (&[4.0, 1.0, 3.0, 2.0, 5.0], 60.0, 3.4),
        (&[4.0, 1.0, 3.0, 2.0, 5.0], 100.0, 5.0),
        (&[7.0, 7.0, 7.0], 60.0, 7.0),
        (&[0.0, 0.0, 0.0, 9.0], 60.0, 0.0),
    ];
    for (values, percent, expected) in rows {
        let found = percentile(values, percent);
        assert!((found - expected).abs() < 1e-6, "{percent} % of {values:?}: {found}");
    }
}

#[test]
fn small_splats_above_the_percentile_are_cloned_and_large_ones_split() {
    let mut world = World::new(crowd(10, 1), open(), 1.0);
    world.norms = vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
    for i in [6, 9] {
        world.splats[i].set_scale([2.75, 0.5, 2.0]); // not larger than the limit
    }
    for i in [7, 8] {
        world.splats[i].set_scale([0.5, 2.8, 1.0]);
    }
    let change = densify(&world.scene(), &mut random());
    assert_consistent(&world, &change, "densify");
    let kept: Vec<u32> = change.keeps.iter().flatten().copied().collect();
    assert_eq!(kept, [0, 1, 2, 3, 4, 5, 6, 9], "the 60th percentile is 5.4; parents of a split go");
    let new = &change.splats[8..];
    assert_eq!(new.len(), 6, "two clones and two pairs of children");
    assert_eq!(bits(&new[..1]), bits(&world.splats[6..7]), "a clone is an exact copy");
    assert_eq!(bits(&new[5..]), bits(&world.splats[9..]), "a clone is an exact copy");
    for (children, parent) in [(&new[1..3], 7), (&new[3..5], 8)] {
        let parent = world.splats[parent];
        assert_ne!(children[0].mean, children[1].mean);
        for child in children {
            assert_eq!((child.rotation, child.intensity), (parent.rotation, parent.intensity));
            assert_eq!(child.opacity_logit, parent.opacity_logit);
            for (c, p) in child.scale().into_iter().zip(parent.scale()) {
                assert!((c - (p / 1.6).max(0.4)).abs() < 1e-6, "{c} of {p}");
            }
        }
    }
}

#[test]
fn children_are_drawn_from_the_gaussian_of_their_parent() {
    let mut parent = splat([15.0, 12.0, 11.0], 1.0, 0.4);
    parent.set_scale([3.0, 1.0, 0.6]);
    parent.rotation = splat::activation::normalised([0.8, -0.3, 0.5, 0.1]);
    let count = 6000;
    let mut world = World::new(vec![parent], open().with(|c| c.topology.percentile = 0.0), 1.0);
    world.splats = vec![parent; count + 1];
    world.limit = 3 * count;
    world.norms = vec![1.0; count + 1];
    world.norms[0] = 0.0;
    let change = densify(&world.scene(), &mut random());
    assert_eq!(change.splats.len(), 2 * count + 1);
    let offset =
        |s: &Splat| DVec3::from_array(std::array::from_fn(|k| f64::from(s.mean[k] - parent.mean[k])));
    let n = 2.0 * count as f64;
    // In the parent's own whitened axes: mean 0, covariance 1.
    let whiten = DMat3::from_diagonal(DVec3::from_array(parent.scale().map(|s| 1.0 / f64::from(s))))
        * parent.axes().transpose();
    let (mut mean, mut covariance) = (DVec3::ZERO, DMat3::ZERO);
    for child in &change.splats[1..] {
        let u = whiten * offset(child);
        mean += u / n;
        covariance += DMat3::from_cols(u * u.x, u * u.y, u * u.z) * n.recip();
    }
    // Standard errors: n^-½ of the mean, (2/n)^½ of a variance; five of them.
    assert!(mean.abs().max_element() < 5.0 / n.sqrt(), "mean {mean}");
    assert!(covariance.abs_diff_eq(DMat3::IDENTITY, 5.0 * (2.0 / n).sqrt()), "covariance {covariance}");
}

#[test]
fn the_largest_gradients_win_and_then_the_first_splats() {
    let mut world = World::new(vec![splat([15.0, 12.0, 11.0], 1.0, 0.5); 20], open(), 1.0);
    for (i, s) in world.splats.iter_mut().enumerate() {
        s.intensity = i as f32;
    }
    world.norms = vec![0.0; 20];
    for (i, norm) in [(3, 5.0), (4, 9.0), (8, 5.0), (11, 5.0), (19, 7.0)] {
        world.norms[i] = norm;
    }
    for (share, expected) in [(0.05, vec![4]), (0.2, vec![3, 4, 8, 19]), (1.0, vec![3, 4, 8, 11, 19])] {
        world.config.topology.share = share;
        let change = densify(&world.scene(), &mut random());
        let new: Vec<i32> = change.splats[20..].iter().map(|s| s.intensity as i32).collect();
        assert_eq!(new, expected, "share {share}");
    }
}

#[test]
fn transparent_splats_go_but_never_all() {
    let mut world = World::new(crowd(6, 3), open().with(|c| c.topology.prune_opacity = 0.01), 1.0);
    let with = |opacities: [f32; 6], world: &mut World| {
        for (s, opacity) in world.splats.iter_mut().zip(opacities) {
            s.set_opacity(opacity);
        }
        let change = densify(&world.scene(), &mut random());
        assert_consistent(world, &change, "prune");
        change.keeps.into_iter().collect::<Option<Vec<u32>>>().expect("nothing is new")
    };
    assert_eq!(with([0.5, 0.005, 0.02, 1e-4, 0.9, 0.0], &mut world), [0, 2, 4]);
    assert_eq!(with([1e-3, 2e-3, 5e-3, 5e-3, 1e-4, 0.0], &mut world), [2], "the first of the strongest");
    world.splats.iter_mut().for_each(|s| s.opacity_logit = f32::NAN);
    let change = densify(&world.scene(), &mut random());
    assert_eq!(change.keeps, [Some(0)]);
    // A large gradient does not save a splat that goes.
    world.norms[0] = 9.0;
    assert_eq!(with([1e-3, 0.5, 0.5, 0.5, 0.5, 0.5], &mut world), [1, 2, 3, 4, 5]);
}

#[test]
fn holes_are_found_and_filled() {
    // Splats in the left part of the ball only.
    let mut left = crowd(60, 5);
    left.retain(|s| s.mean[0] < 12.0);
    left.iter_mut().for_each(|s| s.set_scale([1.5; 3]));
    let config = open().with(|c| {
        c.topology.hole_weight = 0.05;
        c.init.opacity = 0.3;
    });
    let mut world = World::new(left, config, 1.0);
    world.config.topology.share = 0.5;
    let is_hole = |world: &World, i: usize| world.samples[i].weight < 0.05;
    let count_holes = |world: &World| world.roi_indices().into_iter().filter(|&i| is_hole(world, i)).count();
    let before = count_holes(&world);
    assert!(before > 1000, "{before} holes at first");

    let change = densify(&world.scene(), &mut random());
    assert_consistent(&world, &change, "holes");
    let new = &change.splats[world.splats.len()..];
    assert_eq!(new.len(), world.splats.len() / 2, "holes take all that no splat wants");
    for s in new {
        let voxel = DVec3::from_array(s.mean.map(|c| f64::from(c).round())).as_ivec3();
        let found = world.roi_indices().into_iter().find(|&i| world.scene().voxel(i) == voxel);
        assert!(found.is_some_and(|i| is_hole(&world, i)), "{:?} is no hole", s.mean);
        assert!((s.opacity() - 0.3).abs() < 1e-6);
        assert!(s.scale().iter().all(|s| (s - 1.5).abs() < 1e-5), "the median scale");
        assert_eq!(s.rotation, [1.0, 0.0, 0.0, 0.0]);
        let (low, high) = world.scaling.intensity_range;
        let v = world.volume.trilinear(DVec3::from_array(s.mean.map(f64::from))) as f32;
        assert_eq!(s.intensity, v.clamp(low, high));
    }
    assert!(new.iter().any(|s| s.mean.iter().any(|c| c.fract().abs() > 0.1)), "not at the voxel centres");

    // Filling ends by itself.
    for _ in 0..8 {
        world.splats = densify(&world.scene(), &mut random()).splats;
        world.norms = vec![0.0; world.splats.len()];
        world.sum_field();
    }
    assert_eq!(count_holes(&world), 0);
    let filled = densify(&world.scene(), &mut random());
    assert_eq!(bits(&filled.splats), bits(&world.splats), "nothing is left to do");
}

#[test]
fn holes_and_refinement_share_what_may_be_added() {
    let config = open().with(|c| {
        c.topology.hole_weight = 1e9;
        c.topology.share = 0.2;
    });
    let mut world = World::new(vec![splat([15.0, 12.0, 11.0], 1.0, 0.5); 50], config, 1.0);
    // Number of splats with a gradient, and of holes that the 10 new ones fill.
    for (refined, filled) in [(0, 10), (3, 7), (5, 5), (20, 5)] {
        world.norms = (0..50).map(|i| if i < refined { 1.0 } else { 0.0 }).collect();
        let change = densify(&world.scene(), &mut random());
        let holes = change.splats[50..].iter().filter(|s| s.mean != world.splats[0].mean).count();
        assert_eq!((change.splats.len(), holes), (60, filled), "{refined} with a gradient");
    }
}

#[test]
fn a_soft_mask_is_the_probability_of_a_hole() {
    let config = open().with(|c| c.topology.hole_weight = 1.0);
    let mut world = World::new(vec![splat([15.0, 12.0, 11.0], 0.5, 1e-3); 1], config, 0.2);
    assert!(world.roi.soft);
    world.splats = vec![world.splats[0]; 4000];
    world.norms = vec![0.0; 4000];
    world.limit = 8000;
    let count = world.roi_indices().len() as f64;
    let filled = densify(&world.scene(), &mut random()).splats.len() as f64 - 4000.0;
    let expected = 0.2 * count;
    assert!((filled - expected).abs() < 5.0 * (0.8 * expected).sqrt(), "{filled} of {count} holes");
}
