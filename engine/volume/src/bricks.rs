//! Bricks: the sparse sample grid of a fit. Only bricks of 8³ voxels that hold a voxel which takes part have
//! a slot, so cost and memory follow the region of interest and not the volume.
//!
//! Coordinates: a *brick grid* starts at voxel `origin` of the volume; local coordinates count voxels from
//! there. Inside a brick samples lie in Morton order (`shaders-glsl/include/brick.glsl`), so that 8
//! neighbours in memory are a cell of 2³ voxels.

use std::ops::Range;

use glam::{IVec3, UVec3};
use rayon::prelude::*;

use super::Roi;

/// Voxels along an edge of a brick.
pub const BRICK: usize = 8;
/// Samples in a brick.
pub const SAMPLES: usize = BRICK * BRICK * BRICK;
/// Table entry of a brick without a slot.
pub const NO_SLOT: u32 = shader_interface::splat::NO_SLOT;

/// A sparse grid of bricks: only some of them have a slot.
#[derive(Clone, Debug)]
pub struct Bricks {
    /// Voxel of the volume at local coordinate (0, 0, 0).
    pub origin: IVec3,
    /// Bricks along x, y, z.
    pub grid: UVec3,
    /// Slot of each brick of the grid, x fastest; [`NO_SLOT`] where there is none.
    pub slots: Vec<u32>,
    /// Brick coordinate of each slot.
    pub coordinates: Vec<UVec3>,
    /// Mask of the samples of each slot that take part: bit `m` is Morton place `m`.
    pub active: Vec<[u64; SAMPLES / 64]>,
}

/// Returns the local voxel, in 0..8 along each axis, at a Morton place in a brick.
pub fn brick_voxel(morton: usize) -> UVec3 {
    let gather = |v: usize| ((v & 1) | (v >> 2 & 2) | (v >> 4 & 4)) as u32;
    UVec3::new(gather(morton), gather(morton >> 1), gather(morton >> 2))
}

/// Returns the Morton place in a brick of a local voxel, in 0..8 along each axis.
pub fn brick_morton(voxel: UVec3) -> usize {
    let spread = |v: u32| ((v & 1) | (v & 2) << 2 | (v & 4) << 4) as usize;
    spread(voxel.x) | spread(voxel.y) << 1 | spread(voxel.z) << 2
}

impl Bricks {
    /// Creates bricks over every voxel of the volume that lies within `shell` voxels of a voxel of the ROI
    /// along each axis (a cube around each voxel, not a ball).
    pub fn around(roi: &Roi, shell: u32) -> Self {
        let size = IVec3::from_array(roi.size.map(|n| n as i32));
        Self::near(roi, shell, IVec3::ZERO, size - 1)
    }

    /// Creates bricks as [`Bricks::around`] does, but also beyond the faces of the volume. A fit has to know
    /// that nothing is there: otherwise splats would bulge out of a region that the end of the scan cuts off.
    pub fn around_and_beyond(roi: &Roi, shell: u32) -> Self {
        Self::near(roi, shell, IVec3::MIN, IVec3::MAX)
    }

    /// Creates bricks over the voxels within `shell` of the region that lie between voxel `first` and voxel
    /// `last`.
    fn near(roi: &Roi, shell: u32, first: IVec3, last: IVec3) -> Self {
        let reach = shell as i32;
        let (low, high) = bounding_box(roi);
        let low = (low - reach).max(first);
        let high = (high + reach).min(last);
        let near = within(roi, low, high, shell as usize);
        let extent = (high - low + 1).max(IVec3::ZERO).as_uvec3();
        Self::of_box(low, extent, |v| near[((v.z * extent.y + v.y) * extent.x + v.x) as usize])
    }

    /// Creates bricks over every voxel of the box from `low` to `low + extent` for which `wanted` returns
    /// true; `wanted` is given coordinates relative to `low`.
    pub fn of_box(low: IVec3, extent: UVec3, wanted: impl Fn(UVec3) -> bool + Sync) -> Self {
        let grid = (extent + 7) / 8;
        let count = (grid.x * grid.y * grid.z) as usize;
        let found: Vec<_> = (0..count as u32)
            .into_par_iter()
            .filter_map(|i| {
                let brick = UVec3::new(i % grid.x, i / grid.x % grid.y, i / (grid.x * grid.y));
                let mut active = [0u64; SAMPLES / 64];
                for morton in 0..SAMPLES {
                    let v = brick * 8 + brick_voxel(morton);
                    if v.cmplt(extent).all() && wanted(v) {
                        active[morton / 64] |= 1 << (morton % 64);
                    }
                }
                (active != [0; SAMPLES / 64]).then_some((i, brick, active))
            })
            .collect();
        let mut slots = vec![NO_SLOT; count];
        for (slot, (i, ..)) in found.iter().enumerate() {
            slots[*i as usize] = slot as u32;
        }
        Bricks {
            origin: low,
            grid,
            slots,
            coordinates: found.iter().map(|f| f.1).collect(),
            active: found.into_iter().map(|f| f.2).collect(),
        }
    }

    /// Returns bricks of which only those of some slots have one, in the same order.
    pub fn part(&self, slots: Range<usize>) -> Self {
        let mut part = Bricks {
            origin: self.origin,
            grid: self.grid,
            slots: vec![NO_SLOT; self.slots.len()],
            coordinates: self.coordinates[slots.clone()].to_vec(),
            active: self.active[slots].to_vec(),
        };
        for (slot, brick) in (0..).zip(&part.coordinates) {
            let place = (brick.z * self.grid.y + brick.y) * self.grid.x + brick.x;
            part.slots[place as usize] = slot;
        }
        part
    }

    /// Returns the number of bricks with a slot.
    pub fn len(&self) -> usize {
        self.coordinates.len()
    }

    /// Returns true if no brick has a slot.
    pub fn is_empty(&self) -> bool {
        self.coordinates.is_empty()
    }

    /// Returns the number of samples that take part.
    pub fn active_count(&self) -> usize {
        self.active.iter().flatten().map(|w| w.count_ones() as usize).sum()
    }

    /// Returns true if the sample at a Morton place of a slot takes part.
    pub fn is_active(&self, slot: usize, morton: usize) -> bool {
        self.active[slot][morton / 64] >> (morton % 64) & 1 == 1
    }

    /// Returns two words for each slot, whose bits are the cells that hold a sample which takes part (cells
    /// 0..32, 32..64).
    pub fn active_cells(&self) -> Vec<[u32; 2]> {
        self.active
            .iter()
            .map(|words| {
                let mut cells = 0u64;
                for cell in 0..64 {
                    if words[cell / 8] >> (cell % 8 * 8) & 0xFF != 0 {
                        cells |= 1 << cell;
                    }
                }
                [cells as u32, (cells >> 32) as u32]
            })
            .collect()
    }

    /// Returns the voxel of the volume at a Morton place of a slot; it may lie beyond the faces of the volume
    /// ([`Bricks::around_and_beyond`]).
    pub fn voxel(&self, slot: usize, morton: usize) -> IVec3 {
        self.origin + (self.coordinates[slot] * 8 + brick_voxel(morton)).as_ivec3()
    }

    /// Returns `f(voxel)` for every sample of the slots `range`, in memory order; `idle` for samples that
    /// take no part.
    pub fn map_samples<T: Copy + Send + Sync>(
        &self,
        range: std::ops::Range<usize>,
        idle: T,
        f: impl Fn(IVec3) -> T + Sync,
    ) -> Vec<T> {
        range
            .into_par_iter()
            .flat_map_iter(|slot| {
                let f = &f;
                (0..SAMPLES).map(move |m| if self.is_active(slot, m) { f(self.voxel(slot, m)) } else { idle })
            })
            .collect()
    }
}

/// Returns the first and the last voxel of the ROI on each axis; an empty box at 0 if it has none.
fn bounding_box(roi: &Roi) -> (IVec3, IVec3) {
    let [nx, ny, _] = roi.size;
    let empty = (IVec3::MAX, IVec3::MIN);
    let (low, high) = roi
        .weight
        .par_chunks(nx)
        .enumerate()
        .filter_map(|(row, w)| {
            let first = w.iter().position(|&w| w > 0.0)? as i32;
            let last = w.iter().rposition(|&w| w > 0.0)? as i32;
            let (y, z) = ((row % ny) as i32, (row / ny) as i32);
            Some((IVec3::new(first, y, z), IVec3::new(last, y, z)))
        })
        .reduce(|| empty, |a, b| (a.0.min(b.0), a.1.max(b.1)));
    if low.cmple(high).all() { (low, high) } else { (IVec3::ZERO, IVec3::NEG_ONE) }
}

/// Returns for each voxel of the box `low..=high` whether a voxel of the ROI is within `reach` along each
/// axis: a dilation by a cube, one axis after the other, each with the distance to the last voxel that was
/// set.
fn within(roi: &Roi, low: IVec3, high: IVec3, reach: usize) -> Vec<bool> {
    let extent = (high - low + 1).max(IVec3::ZERO).as_uvec3();
    let (ex, ey, ez) = (extent.x as usize, extent.y as usize, extent.z as usize);
    if ex * ey * ez == 0 {
        return Vec::new();
    }
    let mut near = vec![false; ex * ey * ez];
    near.par_chunks_mut(ex).enumerate().for_each(|(row, out)| {
        // Rows beyond the volume hold nothing of the region, nor do the ends of other rows beyond it.
        let [nx, ny, nz] = roi.size;
        let (y, z) = ((row % ey) as i32 + low.y, (row / ey) as i32 + low.z);
        if y < 0 || z < 0 || y >= ny as i32 || z >= nz as i32 {
            return;
        }
        let start = (z as usize * ny + y as usize) * nx;
        let weights = &roi.weight[start..start + nx];
        let is_set = |x: usize| {
            usize::try_from(x as i32 + low.x).is_ok_and(|x| weights.get(x).is_some_and(|&w| w > 0.0))
        };
        spread(&is_set, ex, reach, |x| out[x] = true);
    });
    near.par_chunks_mut(ex * ey).for_each(|slice| {
        let from = slice.to_vec();
        for x in 0..ex {
            spread(&|y| from[y * ex + x], ey, reach, |y| slice[y * ex + x] = true);
        }
    });
    // Along z, one row of x at a time, so that neighbours in memory are visited together.
    let from = near.clone();
    near.par_chunks_mut(ex * ey).enumerate().for_each(|(z, slice)| {
        for other in z.saturating_sub(reach)..=(z + reach).min(ez - 1) {
            let there = &from[other * ex * ey..(other + 1) * ex * ey];
            slice.iter_mut().zip(there).for_each(|(a, &b)| *a |= b);
        }
    });
    near
}

/// Calls `set` for each index below `len` that has a set index within `reach`.
fn spread(is_set: &impl Fn(usize) -> bool, len: usize, reach: usize, mut set: impl FnMut(usize)) {
    let mut done = 0;
    for i in (0..len).filter(|&i| is_set(i)) {
        (done.max(i.saturating_sub(reach))..(i + reach + 1).min(len)).for_each(&mut set);
        done = i + reach + 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn morton_places_are_a_permutation_in_cells_of_eight() {
        for m in 0..SAMPLES {
            assert_eq!(brick_morton(brick_voxel(m)), m);
            assert_eq!(brick_voxel(m) / 2, brick_voxel(m & !7) / 2, "place {m} leaves its cell");
        }
    }

    #[test]
    fn the_shell_is_a_cube_around_each_voxel() {
        let size = [30, 20, 25];
        let mut roi = Roi { size, weight: vec![0.0; 30 * 20 * 25], soft: false };
        let seeds = [IVec3::new(3, 4, 5), IVec3::new(20, 18, 24), IVec3::new(29, 0, 0)];
        for s in seeds {
            roi.weight[(s.z as usize * 20 + s.y as usize) * 30 + s.x as usize] = 1.0;
        }
        for (bricks, beyond) in [(Bricks::around(&roi, 4), 0), (Bricks::around_and_beyond(&roi, 4), 6)] {
            let mut expected = 0;
            for z in -beyond..25 + beyond {
                for y in -beyond..20 + beyond {
                    for x in -beyond..30 + beyond {
                        let v = IVec3::new(x, y, z);
                        let near = seeds.iter().any(|&s| (v - s).abs().max_element() <= 4);
                        expected += usize::from(near);
                        let local = (v - bricks.origin).as_uvec3();
                        let inside = v.cmpge(bricks.origin).all() && (local / 8).cmplt(bricks.grid).all();
                        let found = inside && {
                            let b = local / 8;
                            let slot =
                                bricks.slots[((b.z * bricks.grid.y + b.y) * bricks.grid.x + b.x) as usize];
                            slot != NO_SLOT && bricks.is_active(slot as usize, brick_morton(local % 8))
                        };
                        assert_eq!(found, near, "{v}");
                    }
                }
            }
            assert_eq!(bricks.active_count(), expected);
        }
    }
}
