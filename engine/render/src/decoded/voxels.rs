//! A decoded field: V and O of voxels, in bricks.

use glam::{DAffine3, DVec3, IVec3, UVec3};
use rayon::prelude::*;
use shaders_glsl::types::BrickGrid;

use crate::scale::Scale;
use base::error::Result;
use volume::bricks::{BRICK, NO_SLOT, SAMPLES, brick_morton, brick_voxel};
use volume::{Roi, Volume};

/// Distance from the centre of a voxel, voxels, within which a place is that centre: two affines of one grid differ by
/// rounding, and no voxel may have a share of its neighbour for that.
const SAME_VOXEL: f64 = 1e-4;
/// A field on voxels, stored as far as splats reach.
#[derive(Clone, Debug)]
pub struct Decoded {
    /// Voxels of the box around everything, with an empty border of one voxel.
    pub size: [u32; 3],
    /// Affine from voxels of the box to mm in the space of the scene.
    pub scene_from_voxel: DAffine3,
    /// Mean edge of a voxel of the CT's grid, mm, whatever the pitch.
    pub edge_mm: f64,
    pub(crate) scale: Scale,
    /// V and O, as fractions, of voxels that no splat reaches.
    pub(crate) empty: [u16; 2],
    /// Bricks along x, y, z; brick b holds the voxels 8 b − 1 to 8 b + 6 of the box.
    pub(crate) bricks: UVec3,
    /// Slot of each brick, x fastest.
    pub(crate) slots: Vec<u32>,
    /// V and O as fractions, [slot][Morton place].
    pub(crate) samples: Vec<[u16; 2]>,
    /// Objects that the voxels belong to, [slot][Morton place]; `None` if all belong to `label`.
    pub(crate) labels: Option<Vec<u8>>,
    pub(crate) label: u8,
}

/// Returns the index of a brick among `bricks`, x fastest.
pub(crate) fn place_of(bricks: UVec3, brick: UVec3) -> usize {
    ((brick.z * bricks.y + brick.y) * bricks.x + brick.x) as usize
}

/// Returns the index of the sample of a voxel of the box; `None` if its brick is not sampled.
pub(super) fn bricks_sample(bricks: UVec3, slots: &[u32], voxel: IVec3) -> Option<usize> {
    let from_first = voxel + 1;
    if from_first.cmplt(IVec3::ZERO).any() {
        return None;
    }
    let from_first = from_first.as_uvec3();
    let brick = from_first / BRICK as u32;
    if brick.cmpge(bricks).any() {
        return None;
    }
    let slot = slots[place_of(bricks, brick)];
    (slot != NO_SLOT).then(|| slot as usize * SAMPLES + brick_morton(from_first % BRICK as u32))
}

impl Decoded {
    /// Returns the field at the pitch `wanted` or the next coarser one, if it has another that is finer: with means of
    /// its voxels.
    pub(super) fn at_pitch(mut self, pitch: f64, wanted: f64) -> Self {
        let mut reached = pitch;
        while reached < wanted {
            self = self.halved();
            reached *= 2.0;
        }
        self
    }

    /// Returns V and O as fractions at a voxel of the box; beyond its faces those at the faces.
    pub(crate) fn at(&self, voxel: IVec3) -> [u16; 2] {
        self.sample(voxel).map_or(self.empty, |i| self.samples[i])
    }

    /// Returns the index of the sample of a voxel of the box; beyond its faces of that at the faces.
    pub(crate) fn sample(&self, voxel: IVec3) -> Option<usize> {
        let last = UVec3::from_array(self.size).as_ivec3() - 1;
        bricks_sample(self.bricks, &self.slots, voxel.clamp(IVec3::ZERO, last))
    }

    /// Returns the same field with other objects: `number` gives that of each voxel by its place in the space of the
    /// scene, mm.
    pub(crate) fn with_objects(mut self, number: &(dyn Fn(DVec3) -> u8 + Sync)) -> Self {
        let mut labels = vec![0; self.samples.len()];
        let n = self.bricks;
        let mut held: Vec<(u32, UVec3)> = (0..n.element_product())
            .map(|i| (self.slots[i as usize], UVec3::new(i % n.x, i / n.x % n.y, i / (n.x * n.y))))
            .filter(|(slot, _)| *slot != NO_SLOT)
            .collect();
        held.sort_unstable_by_key(|(slot, _)| *slot);
        labels.par_chunks_mut(SAMPLES).zip(&held).for_each(|(labels, (_, brick))| {
            for (morton, label) in labels.iter_mut().enumerate() {
                let voxel = (brick * BRICK as u32 + brick_voxel(morton)).as_dvec3() - 1.0;
                *label = number(self.scene_from_voxel.transform_point3(voxel));
            }
        });
        (self.labels, self.label) = (Some(labels), 0);
        self
    }

    /// Returns V and O at a voxel of the box.
    pub fn value(&self, voxel: [u32; 3]) -> (f64, f64) {
        let [v, o] = self.at(UVec3::from_array(voxel).as_ivec3());
        (self.scale.value(v), f64::from(o) / f64::from(u16::MAX))
    }

    /// Returns V and O at a place of the box, voxels, interpolated as in a picture; beyond the box those at
    /// its faces, where it is empty.
    pub fn trilinear(&self, at: DVec3) -> (f64, f64) {
        let at = at.clamp(DVec3::ZERO, UVec3::from_array(self.size).as_dvec3() - 1.0);
        let low = at.floor();
        let part = at - low;
        let (mut v, mut o) = (0.0, 0.0);
        for corner in 0..8 {
            let far = IVec3::new(corner & 1, corner >> 1 & 1, corner >> 2);
            let share = DVec3::select(far.cmpgt(IVec3::ZERO), part, 1.0 - part).element_product();
            let [v_there, o_there] = self.at(low.as_ivec3() + far);
            v += share * self.scale.value(v_there);
            o += share * f64::from(o_there) / f64::from(u16::MAX);
        }
        (v, o)
    }

    /// Returns a function that gives V and O at places in voxels of `volume`. `origin` is the scene's origin
    /// in the world, mm RAS.
    pub fn in_voxels_of(&self, volume: &Volume, origin: DVec3) -> impl Fn(DVec3) -> (f64, f64) + Sync + '_ {
        let world_from_box = DAffine3::from_translation(origin) * self.scene_from_voxel;
        let box_from_voxel = world_from_box.inverse() * volume.world_from_voxel;
        move |voxel| {
            let at = box_from_voxel.transform_point3(voxel);
            let whole = at.round();
            let is_whole = (at - whole).abs().cmplt(DVec3::splat(SAME_VOXEL));
            self.trilinear(DVec3::select(is_whole, whole, at))
        }
    }

    /// Returns the whole box as a volume and a region; `origin` is the scene's origin in the world, mm RAS.
    /// Mode volume shows of them what mode decoded shows of this. Takes four bytes a voxel and as many for
    /// the region.
    pub fn volume(&self, origin: DVec3) -> Result<(Volume, Roi)> {
        let size = self.size.map(|n| n as usize);
        let count = size.iter().product();
        let all: Vec<(f64, f64)> = (0..count)
            .into_par_iter()
            .map(|i| {
                self.value([i % size[0], i / size[0] % size[1], i / (size[0] * size[1])].map(|v| v as u32))
            })
            .collect();
        let affine = DAffine3::from_translation(origin) * self.scene_from_voxel;
        let volume = Volume::new(size, affine, all.iter().map(|v| v.0 as f32).collect());
        let roi = Roi::new(all.iter().map(|v| v.1 as f32).collect(), &volume)?;
        Ok((volume, roi))
    }

    /// Returns the least and the greatest V that there can be: the range of the fractions.
    pub fn range(&self) -> [f64; 2] {
        [self.scale.first, self.scale.first + self.scale.span]
    }

    /// Returns the number of the object that each voxel of the box belongs to, x fastest; `None` if all belong to one.
    pub fn objects(&self) -> Option<Vec<u8>> {
        let labels = self.labels.as_ref()?;
        let [nx, ny, nz] = self.size.map(|n| n as usize);
        let at = |i: usize| UVec3::new((i % nx) as u32, (i / nx % ny) as u32, (i / (nx * ny)) as u32);
        let number = |i: usize| self.sample(at(i).as_ivec3()).map_or(0, |sample| labels[sample]);
        Some((0..nx * ny * nz).into_par_iter().map(number).collect())
    }

    /// Returns the greatest level of the bricks that hold a place, voxels from the first of the first brick on, and around it.
    fn level_around(&self, levels: &[u8], place: UVec3) -> u8 {
        let brick = (place / BRICK as u32).min(self.bricks - 1);
        let (low, high) = (brick.saturating_sub(UVec3::ONE), (brick + 1).min(self.bricks - 1));
        let rows = (low.z..=high.z).flat_map(|z| (low.y..=high.y).map(move |y| (y, z)));
        let all = rows.flat_map(|(y, z)| (low.x..=high.x).map(move |x| UVec3::new(x, y, z)));
        all.map(|brick| levels[place_of(self.bricks, brick)]).max().unwrap_or_default()
    }

    /// Returns the number of bricks with samples. The atlas has those that hold anything, and their
    /// neighbours before them.
    pub fn brick_count(&self) -> usize {
        self.samples.len() / SAMPLES
    }

    /// Returns the intervals of intensity of the bricks by which empty space is skipped. An interval covers
    /// all voxels that are read for places in the brick and up to a voxel away, as for a volume. `levels` are those of the
    /// bricks in the atlas.
    pub(crate) fn intervals(&self, grid: &BrickGrid, levels: Option<&[u8]>) -> Vec<[f32; 2]> {
        let n = UVec3::from_array(grid.bricks);
        let last = UVec3::from_array(self.size).as_ivec3() - 1;
        (0..n.element_product())
            .into_par_iter()
            .map(|i| {
                let brick = UVec3::new(i % n.x, i / n.x % n.y, i / (n.x * n.y));
                let edge = UVec3::from_array(grid.shift.map(|s| 1 << s)).as_ivec3();
                // A texel of a coarser brick has means of its cells, and a place is between two of them.
                let reach = match levels.map(|levels| self.level_around(levels, brick * edge.as_uvec3())) {
                    None | Some(0) => 1,
                    Some(level) => 2 << level,
                };
                let first = brick.as_ivec3() * edge - 1;
                let (from, to) = (first - reach, first + edge + reach);
                let (from, to) = (from.clamp(IVec3::ZERO, last), to.clamp(IVec3::ZERO, last));
                let nothing = [f32::INFINITY, f32::NEG_INFINITY];
                let (first, end) = (from + 1, to + 1);
                let sampled =
                    |z, y, x| self.slots[place_of(self.bricks, IVec3::new(x, y, z).as_uvec3())] != NO_SLOT;
                let any = (first.z / 8..=end.z / 8).any(|z| {
                    (first.y / 8..=end.y / 8).any(|y| (first.x / 8..=end.x / 8).any(|x| sampled(z, y, x)))
                });
                if !any {
                    return nothing;
                }
                let (mut least, mut greatest, mut there) = (u16::MAX, 0, false);
                for z in from.z..=to.z {
                    for y in from.y..=to.y {
                        for x in from.x..=to.x {
                            let [v, o] = self.at(IVec3::new(x, y, z));
                            (least, greatest, there) = (least.min(v), greatest.max(v), there || o > 0);
                        }
                    }
                }
                if there { [least, greatest].map(|v| self.scale.value(v) as f32) } else { nothing }
            })
            .collect()
    }
}
