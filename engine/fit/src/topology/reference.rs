//! The method "reference": densification as in the code of the paper's authors, where the paper's text leaves
//! it open.
//!
//! - Refine: this concerns splats whose position gradient exceeds 0.6 times the percentile. A splat whose
//!   largest scale is at most 0.01 of the volume's edge gets a copy beside it with scales × 0.8. A larger one
//!   is replaced by two of scales × ½; if nothing was copied in this change, this happens only to splats that
//!   stand alone.
//! - Fill: if fewer than 78 % of the splats have three others within three times their mean scale, 5 % of the
//!   splats are copied: those that stand most alone. Voxels without weight are not looked for.
//! - Prune: splats with an opacity below the limit are removed.
//!
//! At most 10,000 splats are added at once, and `topology_share` does not count. A splat that would lie
//! outside the mask is drawn anew. Their code turns new splats by the gradient again; here they keep the
//! rotation of their parent.

use glam::{DMat3, DVec3};
use rand_pcg::Pcg64;

use super::densify::{normal, percentile, staying};
use super::{Change, Scene};
use crate::init::PointGrid;
use splat::Splat;
use splat::activation::Activations;
use splat::space::reshaped;

/// Factor of the percentile of the position gradients.
const THRESHOLD: f64 = 0.6;
/// Greatest scale of a splat that is copied, in edges of the volume.
const SMALL: f32 = 0.01;
/// Ratio of the scales of a copy to those of its original.
const COPY: f32 = 0.8;
/// Ratio of the scales of a half to those of its parent.
const HALF: f32 = 0.5;
/// A splat stands alone if one of its three nearest neighbours is further than this many of its mean scales.
const NEAR: f32 = 3.0;
/// If fewer splats than this share stand close, others are copied ...
const CLOSE: f64 = 0.78;
/// ... as many as this share of all.
const FILLED: f64 = 0.05;
/// Maximum number of splats that are added at once.
const MOST: usize = 10_000;
/// Number of draws of a place in the mask before a splat stays where its parent is.
const DRAWS: usize = 16;
/// Least mask at a place that counts as in the mask.
const INSIDE: f64 = 0.05;

pub(super) fn densify(scene: &Scene, random: &mut Pcg64) -> Change {
    let splats = scene.splats;
    let stays = staying(splats, scene.config.topology.prune_opacity);
    let remaining = stays.iter().filter(|&&stays| stays).count();
    let mut room = MOST.min(scene.limit.saturating_sub(remaining));

    let norms: Vec<f32> = scene.gradient_norms.iter().map(|&n| if n.is_finite() { n } else { 0.0 }).collect();
    let threshold = THRESHOLD * percentile(&norms, scene.config.topology.percentile);
    let refined = |i: &usize| stays[*i] && f64::from(norms[*i]) > threshold;
    let (small, large): (Vec<usize>, Vec<usize>) =
        (0..splats.len()).filter(refined).partition(|&i| is_small(scene, &splats[i]));
    let loneliness = loneliness(splats);

    let mut copied = small;
    copied.truncate(room);
    room -= copied.len();
    let mut split: Vec<usize> =
        large.into_iter().filter(|&i| !copied.is_empty() || loneliness[i] > NEAR).collect();
    split.truncate(room);
    room -= split.len();
    let close = loneliness.iter().filter(|&&l| l <= NEAR).count();
    let mut filled = Vec::new();
    if (close as f64) < CLOSE * splats.len() as f64 {
        filled = (0..splats.len()).filter(|&i| stays[i] && split.binary_search(&i).is_err()).collect();
        filled.sort_by(|&a, &b| loneliness[b].total_cmp(&loneliness[a]).then(a.cmp(&b)));
        filled.truncate(room.min((FILLED * splats.len() as f64) as usize));
    }

    let mut change = Change::default();
    for (i, splat) in splats.iter().enumerate() {
        if stays[i] && split.binary_search(&i).is_err() {
            change.splats.push(*splat);
            change.keeps.push(Some(i as u32));
        }
    }
    for &i in copied.iter().chain(&filled) {
        change.add(child(scene, &splats[i], COPY, random));
    }
    for &i in &split {
        change.add(child(scene, &splats[i], HALF, random));
        change.add(child(scene, &splats[i], HALF, random));
    }
    change
}

/// Returns true if the largest scale of a splat, in the unit cube of the volume's box, is small enough for it
/// to be copied.
fn is_small(scene: &Scene, splat: &Splat) -> bool {
    let edges = DVec3::from_array(scene.volume.size.map(|n| n.max(2) as f64 - 1.0));
    let limit = SMALL.ln();
    reshaped(splat, &DMat3::from_diagonal(edges.recip())).log_scale.iter().all(|&log| log <= limit)
}

/// Returns, for each splat, the distance to its third nearest neighbour over its mean scale; infinite if that
/// neighbour is not near.
fn loneliness(splats: &[Splat]) -> Vec<f32> {
    let mean = |s: &Splat| s.scale().iter().sum::<f32>() / 3.0;
    let widest = splats.iter().map(mean).fold(0.0, f32::max).max(f32::MIN_POSITIVE);
    let mut grid = PointGrid::new(widest, splats.len());
    splats.iter().for_each(|s| grid.insert(s.mean));
    let alone = |(i, s): (usize, &Splat)| {
        let nearest: [f32; 3] = grid.nearest_squared(i, NEAR * mean(s));
        nearest[2].sqrt() / mean(s)
    };
    splats.iter().enumerate().map(alone).collect()
}

/// Creates a splat at a point drawn from the Gaussian of `parent` and in the mask, with its scales times
/// `factor`. If no draw lies in the mask, it stays where its parent is.
fn child(scene: &Scene, parent: &Splat, factor: f32, random: &mut Pcg64) -> Splat {
    let scale = parent.scale();
    let mut child = *parent;
    for _ in 0..DRAWS {
        let along = DVec3::from_array(scale.map(|s| f64::from(s) * normal(random)));
        let step = (parent.axes() * along).as_vec3().to_array();
        let mean: [f32; 3] = std::array::from_fn(|k| parent.mean[k] + step[k]);
        if scene.roi.trilinear(glam::Vec3::from_array(mean).as_dvec3()) >= INSIDE {
            child.mean = mean;
            break;
        }
    }
    child.set_scale(scale.map(|s| s * factor));
    let (low, high) = scene.scaling.intensity_range;
    child.intensity = (scene.target(child.mean.map(f64::from).into()) as f32).clamp(low, high);
    scene.clamp(&mut child);
    child
}
