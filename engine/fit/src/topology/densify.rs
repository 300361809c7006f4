//! The method "densify", sections 3.6 and 3.7 of the paper: splats with a large accumulated position gradient
//! are cloned (small ones) or split (large ones), nearly transparent splats are pruned, and holes are filled.
//!
//! If more splats are wanted than may be added, holes get half of them, or more if refinement wants less.
//! Only a new splat helps a voxel without weight, and filling ends by itself; refinement never does, since a
//! percentile always finds splats above it.

use std::f64::consts::TAU;

use glam::DVec3;
use rand::RngExt;
use rand_pcg::Pcg64;

use super::spread::spread;
use super::{Change, Scene};
use splat::Splat;
use splat::activation::Activations;

/// Ratio of the scales of a split splat to those of its children, from 3D Gaussian splatting.
const SPLIT: f32 = 1.6;

pub(super) fn densify(scene: &Scene, random: &mut Pcg64) -> Change {
    let splats = scene.splats;
    let stays = staying(splats, scene.config.topology.prune_opacity);
    let most = scene.most_added(stays.iter().filter(|&&stays| stays).count());

    let norms: Vec<f32> = scene.gradient_norms.iter().map(|&n| if n.is_finite() { n } else { 0.0 }).collect();
    let threshold = percentile(&norms, scene.config.topology.percentile);
    let mut refined: Vec<usize> =
        (0..splats.len()).filter(|&i| stays[i] && f64::from(norms[i]) > threshold).collect();

    let hole_scale = median_scale(splats);
    let mut holes = holes(scene, f64::from(hole_scale), most, random);
    holes.truncate(most.div_ceil(2).max(most.saturating_sub(refined.len())));

    refined.sort_by(|&a, &b| norms[b].total_cmp(&norms[a]).then(a.cmp(&b)));
    refined.truncate(most - holes.len());
    refined.sort_unstable();

    // Scales are compared as logarithms, as they are stored: a splat of that very scale is not larger.
    let limit = scene.config.topology.split_scale.ln();
    let split = |i: usize| splats[i].log_scale.iter().any(|&log| log > limit);
    let mut parents = vec![false; splats.len()];
    refined.iter().for_each(|&i| parents[i] = split(i));
    let mut change = Change::default();
    for (i, splat) in splats.iter().enumerate().filter(|&(i, _)| stays[i] && !parents[i]) {
        change.splats.push(*splat);
        change.keeps.push(Some(i as u32));
    }
    for &i in &refined {
        if parents[i] {
            change.add(child(scene, &splats[i], random));
            change.add(child(scene, &splats[i], random));
        } else {
            change.add(splats[i]);
        }
    }
    for index in holes {
        let mean =
            scene.voxel(index).as_dvec3() + DVec3::from_array([0; 3].map(|_| random.random::<f64>() - 0.5));
        change.add(scene.new_splat(mean, hole_scale, scene.config.init.opacity));
    }
    change
}

/// Returns, for each splat, true if its opacity is at least `least`; if none has that, the one with the most
/// stays.
pub(super) fn staying(splats: &[Splat], least: f32) -> Vec<bool> {
    let mut stays: Vec<bool> = splats.iter().map(|s| s.opacity() >= least).collect();
    if !stays.contains(&true) {
        // The first of several: `min_by` keeps it, `max_by` would not.
        let strongest =
            (0..splats.len()).min_by(|&a, &b| splats[b].opacity().total_cmp(&splats[a].opacity()));
        strongest.into_iter().for_each(|i| stays[i] = true);
    }
    stays
}

/// Returns the value below which `percent` % of `values` lie, linear between two of them; 0 if there is none.
pub(super) fn percentile(values: &[f32], percent: f32) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f32::total_cmp);
    let Some(last) = sorted.len().checked_sub(1) else { return 0.0 };
    let rank = (f64::from(percent) / 100.0).clamp(0.0, 1.0) * last as f64;
    let low = rank as usize;
    let (a, b) = (f64::from(sorted[low]), f64::from(sorted[(low + 1).min(last)]));
    a + (b - a) * rank.fract()
}

/// Creates a splat at a point drawn from the Gaussian of `parent`, smaller than it.
fn child(scene: &Scene, parent: &Splat, random: &mut Pcg64) -> Splat {
    let scale = parent.scale();
    let along = DVec3::from_array(scale.map(|s| f64::from(s) * normal(random)));
    let step = parent.axes() * along;
    let mut child = *parent;
    for axis in 0..3 {
        child.mean[axis] += step[axis] as f32;
    }
    child.set_scale(scale.map(|s| s / SPLIT));
    scene.clamp(&mut child);
    child
}

/// Draws a standard normal number (Box and Muller).
pub(super) fn normal(random: &mut Pcg64) -> f64 {
    // 1 - u lies in (0, 1], where the logarithm is finite.
    let radius = (-2.0 * (1.0 - random.random::<f64>()).ln()).sqrt();
    radius * (TAU * random.random::<f64>()).cos()
}

/// Returns the median over the splats of the geometric mean of their scales, voxels; 1 if there is no splat.
fn median_scale(splats: &[Splat]) -> f32 {
    let logs: Vec<f32> = splats.iter().map(|s| s.log_scale.iter().sum::<f32>() / 3.0).collect();
    percentile(&logs, 50.0).exp() as f32
}

/// Finds at most `most` holes and returns the indices of their samples in random order. A hole is a voxel of
/// the ROI with a summed weight below `topology_hole_weight`; in a soft ROI it counts with the mask as its
/// probability. A hole within `scale` voxels of one already chosen is taken to be filled with it.
fn holes(scene: &Scene, scale: f64, most: usize, random: &mut Pcg64) -> Vec<usize> {
    let least = scene.config.topology.hole_weight;
    let open = scene.map_roi(0.0, |field, _, m| if field.weight < least { m } else { 0.0 });
    // One number u for each hole decides whether it counts (u < m) and when it comes: given u < m, u / m is
    // even in 0..1 whatever m is.
    let mut turns: Vec<(f64, usize)> = (0..open.len())
        .filter(|&i| open[i] > 0.0)
        .map(|i| (random.random::<f64>() / f64::from(open[i]), i))
        .filter(|&(turn, _)| turn < 1.0)
        .collect();
    turns.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    spread(scene.bricks, turns.into_iter().map(|(_, i)| i), scale, most)
}
