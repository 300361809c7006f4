//! Selection of samples that keep apart from each other.

use glam::{IVec3, UVec3};

use volume::Bricks;
use volume::bricks::{NO_SLOT, SAMPLES, brick_morton};

/// Returns the first `most` of `candidates` (indices of samples, best first) of which no two are nearer than
/// `distance` voxels: a candidate nearer than that to one already taken is left out.
pub(super) fn spread(
    bricks: &Bricks,
    candidates: impl IntoIterator<Item = usize>,
    distance: f64,
    most: usize,
) -> Vec<usize> {
    let near = offsets_within(distance);
    let mut taken = vec![false; bricks.len() * SAMPLES];
    let mut chosen = Vec::new();
    for index in candidates {
        if chosen.len() == most {
            break;
        }
        if taken[index] {
            continue;
        }
        chosen.push(index);
        let here = bricks.voxel(index / SAMPLES, index % SAMPLES) - bricks.origin;
        for &offset in &near {
            if let Some(other) = index_of(bricks, here + offset) {
                taken[other] = true;
            }
        }
    }
    chosen
}

/// Returns all steps from a voxel to those nearer than `distance`; the step to itself is always among them.
fn offsets_within(distance: f64) -> Vec<IVec3> {
    let reach = (distance.ceil() as i32).max(0);
    let mut offsets = Vec::new();
    for z in -reach..=reach {
        for y in -reach..=reach {
            for x in -reach..=reach {
                let offset = IVec3::new(x, y, z);
                if offset == IVec3::ZERO || offset.as_dvec3().length() < distance {
                    offsets.push(offset);
                }
            }
        }
    }
    offsets
}

/// Returns the index of the sample at a voxel that counts from the first of the grid; nothing if there is no
/// brick.
fn index_of(bricks: &Bricks, local: IVec3) -> Option<usize> {
    let slot = slot_at(bricks, local.div_euclid(IVec3::splat(8)))?;
    Some(slot * SAMPLES + brick_morton(local.rem_euclid(IVec3::splat(8)).as_uvec3()))
}

/// Returns the slot of a brick of the grid; nothing if there is none.
pub(super) fn slot_at(bricks: &Bricks, brick: IVec3) -> Option<usize> {
    let grid = bricks.grid;
    if brick.cmplt(IVec3::ZERO).any() || brick.cmpge(grid.as_ivec3()).any() {
        return None;
    }
    let UVec3 { x, y, z } = brick.as_uvec3();
    let slot = bricks.slots[((z * grid.y + y) * grid.x + x) as usize];
    (slot != NO_SLOT).then_some(slot as usize)
}
