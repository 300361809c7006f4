//! The method "growth": new splats are added where the residual is largest, in the first half of the
//! schedule. A new splat needs time to settle, and the rates have fallen too far in the second half.

use rand_pcg::Pcg64;

use super::residual::splats_at_worst;
use super::{Change, Scene};

/// Part of the schedule from which on nothing changes.
pub(super) const UNTIL: f64 = 0.5;

pub(super) fn growth(scene: &Scene, _: &mut Pcg64) -> Change {
    let mut change = Change::none(scene);
    if scene.share < UNTIL {
        splats_at_worst(scene, scene.most_added(scene.splats.len())).into_iter().for_each(|s| change.add(s));
    }
    change
}
