//! `emit_pairs`, `brick_ranges`, `pair_masks`, `cell_masks`: which splats reach which samples.
//!
//! A box or an ellipsoid may touch a sample exactly; there a kernel in f32 may decide either way. So these
//! functions take the margin with which they decide, and a kernel must lie between the results without and
//! with a margin.

use glam::{DVec3, UVec3};

use super::{Footprint, Samples};
use splat::Kernel;
use volume::bricks::{NO_SLOT, SAMPLES};

/// Returns the slots, counted from the first of the chunk, of the bricks that hold a sample in a footprint's
/// box widened by `margin` voxels on each side; in brick order, x fastest.
pub fn touched_slots(footprint: &Footprint, samples: &Samples, margin: f64) -> Vec<u32> {
    let bricks = samples.bricks;
    let reaches = |axis: usize, brick: u32| {
        (0..8).any(|i| {
            let x = f64::from(brick * 8 + i) + samples.offset[axis];
            (x - footprint.mean[axis]).abs() <= footprint.extent[axis] + margin
        })
    };
    let mut out = Vec::new();
    for z in 0..bricks.grid.z {
        for y in 0..bricks.grid.y {
            for x in 0..bricks.grid.x {
                let slot = bricks.slots[((z * bricks.grid.y + y) * bricks.grid.x + x) as usize];
                let of_chunk = slot != NO_SLOT && samples.slots.contains(&(slot as usize));
                let brick = UVec3::new(x, y, z);
                if of_chunk && (0..3).all(|axis| reaches(axis, brick[axis])) {
                    out.push(slot - samples.slots.start as u32);
                }
            }
        }
    }
    out
}

/// Returns (slot, splat) for each brick of the chunk that a splat's box touches, splat by splat.
pub fn emit_pairs(footprints: &[Footprint], samples: &Samples, margin: f64) -> Vec<(u32, u32)> {
    let mut out = Vec::new();
    for (splat, footprint) in footprints.iter().enumerate() {
        out.extend(touched_slots(footprint, samples, margin).into_iter().map(|slot| (slot, splat as u32)));
    }
    out
}

/// Returns for each slot, and for one beyond the last, how many of the sorted keys are smaller.
pub fn brick_ranges(sorted_keys: &[u32], slot_count: usize) -> Vec<u32> {
    (0..=slot_count as u32).map(|slot| sorted_keys.iter().filter(|&&key| key < slot).count() as u32).collect()
}

/// Samples that count when a cell is tested for whether a splat reaches it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reach {
    /// Samples that take part: the least that a kernel must list.
    Active,
    /// All samples of a cell of which at least one takes part, each displaced along x by up to so many
    /// voxels: the most that a kernel may list.
    Widened(f64),
}

/// Returns the mask of one pair, as `pair_masks` does: bit m is set if a sample of cell m (2³ samples, Morton
/// order) of a slot lies in the support of a splat, that is q < `support_q`, and within the kernel's reach.
pub fn pair_mask(
    footprint: &Footprint,
    samples: &Samples,
    slot: usize,
    kernel: Kernel,
    support_q: f64,
    reach: Reach,
) -> u64 {
    let mut cells = 0;
    for morton in 0..SAMPLES {
        let cell = morton / 8;
        let d = samples.position(slot, morton) - footprint.mean;
        let inside = match reach {
            Reach::Active => {
                samples.bricks.is_active(slot, morton)
                    && kernel.reaches(d)
                    && (footprint.whitening * d).length_squared() < support_q
            }
            Reach::Widened(by) => {
                let active = (0..8).any(|i| samples.bricks.is_active(slot, cell * 8 + i));
                // A kernel may take a row of cells by its four rows of samples together.
                let near = (d.abs() - by - 1.0).max(DVec3::ZERO);
                active && kernel.reaches(near) && least_q(footprint, d, by) < support_q
            }
        };
        if inside {
            cells |= 1 << cell;
        }
    }
    cells
}

/// Returns the least q over the points d + (t, 0, 0), |t| <= by.
fn least_q(footprint: &Footprint, d: DVec3, by: f64) -> f64 {
    let (u, along) = (footprint.whitening * d, footprint.whitening.x_axis);
    let t = (-u.dot(along) / along.length_squared()).clamp(-by, by);
    (u + along * t).length_squared()
}

/// Returns for each slot, each 32 of its pairs and each cell a word whose bit j is set if pair j of the 32
/// reaches the cell; by slot, then 32 pairs, then cell. `starts` are the ranges of the sorted pairs and
/// `pair_masks` the cells of each.
pub fn cell_masks(starts: &[u32], pair_masks: &[u64]) -> Vec<Vec<[u32; 64]>> {
    let slot = |range: &[u32]| {
        let pairs = &pair_masks[range[0] as usize..range[1] as usize];
        let words = |pairs: &[u64]| {
            std::array::from_fn(|cell| {
                pairs.iter().enumerate().map(|(j, mask)| ((mask >> cell & 1) as u32) << j).sum()
            })
        };
        pairs.chunks(32).map(words).collect()
    };
    starts.windows(2).map(slot).collect()
}
