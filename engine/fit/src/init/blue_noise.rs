//! Blue-noise points that follow a density: dart throwing with a radius that follows the local spacing and
//! shrinks until the wanted number has found a place.
//!
//! A dart is drawn by density. It sticks if no earlier point lies nearer than the shrink factor times the
//! smaller of the two local spacings. When few darts stick the factor shrinks, so the process ends with
//! exactly the wanted number, at the latest when the factor is so small that every dart sticks: then it is
//! plain weighted jitter.

use std::time::Instant;

use rand::RngExt;

use super::density::Density;
use super::grid::PointGrid;

/// First shrink factor: two thirds of what random sequential packing can hold at all (ρr³ ≈ 0.73).
const FIRST_SHRINK: f32 = 0.8;
/// The shrink factor is multiplied by this after a round in which few darts stuck.
const SHRINK: f32 = 0.93;
/// Shrink factor below which the distance no longer matters.
const LEAST_SHRINK: f32 = 0.05;
/// Number of darts in a round for every wanted point; a round has at least [`LEAST_ROUND`].
const ROUND: f32 = 0.25;
const LEAST_ROUND: usize = 64;
/// Number of darts after which the clock is looked at.
const DARTS_A_LOOK: usize = 1024;
/// The shrink factor falls when a smaller share than this of a round's darts sticks.
const STICKING: f32 = 0.12;

/// Scattered points in voxel space.
pub(super) struct Points {
    pub grid: PointGrid,
    /// Spacing that the density asks for at each point, in voxels.
    pub spacing: Vec<f32>,
}

/// Throws darts until exactly `count` of them have stuck, and returns these points, which follow `density`.
/// After `deadline` every dart sticks.
pub(super) fn throw(
    density: &Density,
    count: usize,
    deadline: Option<Instant>,
    rng: &mut impl RngExt,
) -> Points {
    let mut grid = PointGrid::new(density.mean_spacing(count), count);
    let mut spacing: Vec<f32> = Vec::with_capacity(count);
    let round = ((ROUND * count as f32) as usize).max(LEAST_ROUND);
    let mut shrink = FIRST_SHRINK;
    while grid.len() < count {
        let before = grid.len();
        for dart in 0..round {
            let is_late = || deadline.is_some_and(|at| Instant::now() >= at);
            if dart % DARTS_A_LOOK == 0 && shrink > 0.0 && is_late() {
                tracing::warn!(
                    "{} of {count} splats are placed at random: spacing them takes too much of the time",
                    count - grid.len()
                );
                shrink = 0.0;
            }
            let (point, own) = density.draw(count, rng);
            let radius = shrink * own;
            let crowded = shrink >= LEAST_SHRINK
                && grid.any_within(point, radius, |other, distance| {
                    let radius = shrink * spacing[other];
                    distance < radius * radius
                });
            if !crowded {
                grid.insert(point);
                spacing.push(own);
                if grid.len() == count {
                    break;
                }
            }
        }
        if ((grid.len() - before) as f32) < STICKING * round as f32 {
            shrink *= SHRINK;
        }
    }
    Points { grid, spacing }
}
