//! The splats that are decoded, where they are sampled, and their field on voxels.

use std::ops::Range;

use glam::{DAffine3, DVec3, IVec3, UVec3, Vec3};
use rayon::prelude::*;

use super::voxels::{Decoded, bricks_sample, place_of};
use crate::extents::{middle_sigma, reaches};
use crate::least_squares::{Neighbours, Points, least_squares};
use crate::scale::{Scale, to_fraction};
use base::error::Result;
use gpu::Gpu;
use passes::Sampler;
use splat::{Field, Form, Grid, Region, Splat, SplatSet, Voxels};
use volume::bricks::{BRICK, NO_SLOT, SAMPLES, brick_voxel};
use volume::{Bricks, spacing_of};

/// Greatest number of bricks that are sampled: 67 million voxels, some 400 MB in the atlas.
pub(super) const MOST_BRICKS: usize = 1 << 17;
/// Greatest number of bricks of 4³ voxels in the whole box, by which empty space is skipped: all devices have
/// room for them.
pub(super) const MOST_LEAPS: f64 = 4e6;
/// Number of bricks that are sampled at once: with their results they take some 30 MB, and a decoding that is
/// no longer wanted ends after them.
const SLAB_BRICKS: usize = 1 << 11;
/// Input of the decoding: splats with their field and grid, mm in the space of a scene.
pub(crate) struct Source {
    pub(crate) splats: Vec<Splat>,
    /// The number of each splat's object.
    pub(crate) objects: Vec<u8>,
    pub(crate) field: Field,
    /// The grid in the space of the scene.
    pub(crate) grid: Option<Grid>,
    pub(crate) form: Form,
    pub(crate) region: Option<Region>,
    pub(crate) voxels: Vec<Voxels>,
    /// Edge of the voxels if there is no grid.
    pub(crate) sigma_mm: f64,
}

/// First and last voxel of the box around what a splat reaches; `None` if that is nothing of the grid.
pub(super) type VoxelBox = Option<(IVec3, IVec3)>;

/// The voxels that splats reach, and the bricks in which they lie.
pub(super) struct Extent {
    /// Voxels of the file's grid from one voxel of the lattice to the next.
    pub(super) pitch: f64,
    pub(super) scene_from_lattice: DAffine3,
    /// First and last voxel of the grid; without a grid there are no faces.
    pub(super) faces: [IVec3; 2],
    /// First and last voxel of the box, with its border.
    pub(super) low: IVec3,
    pub(super) high: IVec3,
    pub(super) bricks: UVec3,
    /// True if a splat reaches a voxel of the brick, or one beside it.
    pub(super) reached: Vec<bool>,
}

impl Source {
    /// Returns the splats of a set in its own space, mm less its origin.
    pub(super) fn of(set: &SplatSet) -> Self {
        let here = DAffine3::from_translation(-set.origin_mm);
        Source {
            splats: set.splats.clone(),
            objects: set.labels.clone().unwrap_or_else(|| vec![0; set.splats.len()]),
            field: set.field,
            grid: set.grid.map(|grid| Grid { world_from_voxel: here * grid.world_from_voxel, ..grid }),
            form: set.form,
            region: set.region.clone(),
            voxels: set.voxels.clone(),
            sigma_mm: middle_sigma(&set.splats),
        }
    }

    /// Decodes the splats of a set without a region, as [`Source::decode`] says.
    pub(crate) fn decode_field(
        &self,
        gpu: &Gpu,
        pitch: f64,
        going: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Option<Decoded>> {
        // What is between the voxels of a grid fit means nothing, so a coarser field is made of that of its grid.
        let (pitch, coarser) = match self.form {
            Form::Field => (pitch, 1.0),
            Form::Grid => (1.0, pitch),
        };
        let (extent, splats, boxes) = self.extent(pitch);
        let bricks = extent.sampled(|brick| extent.reached[brick]);
        let background = self.field.background;
        let scene_from_voxel = extent.scene_from_lattice * DAffine3::from_translation(extent.low.as_dvec3());
        let mut decoded = Decoded {
            size: (extent.high - extent.low + 1).as_uvec3().to_array(),
            scene_from_voxel,
            edge_mm: spacing_of(&self.lattice().world_from_voxel).element_sum() / 3.0,
            scale: Scale::of([f64::from(background); 2], None),
            empty: [0; 2],
            bricks: extent.bricks,
            slots: bricks.slots.clone(),
            samples: Vec::new(),
            labels: None,
            label: self.objects.first().copied().unwrap_or(0),
        };
        if bricks.is_empty() {
            return Ok(Some(decoded));
        }
        let [first, last] = extent.faces;
        let inside = |voxel: IVec3| voxel.cmpge(first).all() && voxel.cmple(last).all();
        // Each sample has V, O and Σ w; V and O are kept.
        let mut found = Vec::with_capacity(bricks.len() * SAMPLES);
        let offsets = if self.form == Form::Field { &BETWEEN[..] } else { &[] };
        let mut points: Vec<Points> =
            offsets.iter().map(|&offset| Points { offset, samples: Vec::new() }).collect();
        let whole = in_slabs(gpu, (&splats, &boxes), &self.field, &bricks, going, &mut |slots, sampler| {
            found.extend(sampler.sample([0.0; 3])?);
            for set in &mut points {
                set.samples.extend(between(sampler, &bricks, slots.start, set.offset, &inside)?);
            }
            Ok(())
        })?;
        if !whole {
            return Ok(None);
        }
        let mut values: Vec<f32> = (0..found.len())
            .into_par_iter()
            .map(|i| match found[i].weight > 0.0 {
                true => found[i].hu,
                false => {
                    let at = extent.bricks_voxel(bricks.coordinates[i / SAMPLES], i % SAMPLES);
                    beside(at, &|voxel| {
                        let sample = found[bricks_sample(extent.bricks, &bricks.slots, voxel)?];
                        (sample.weight > 0.0).then_some(sample.hu)
                    })
                    .unwrap_or(background)
                }
            })
            .collect();
        if self.form == Form::Field {
            let neighbours = Neighbours::new(bricks.grid, &bricks.slots, &bricks.coordinates);
            let (low, high) = range_of(&values);
            values = least_squares(&neighbours, &values, &points);
            // Values are clamped to the range that the voxels held before.
            values.par_iter_mut().for_each(|v| *v = v.clamp(low, high));
        }
        // Beyond the faces of the grid V is that at the faces, as in a CT.
        let held: Vec<f32> = (0..values.len())
            .into_par_iter()
            .map(|i| {
                let voxel = bricks.voxel(i / SAMPLES, i % SAMPLES);
                let at_face = voxel.clamp(first, last);
                let sample = match at_face == voxel {
                    true => None,
                    false => bricks_sample(extent.bricks, &bricks.slots, at_face - extent.low),
                };
                values[sample.unwrap_or(i)]
            })
            .collect();
        values = held;
        let (least, greatest) = range_of(&values);
        let (least, greatest) = (least.min(background), greatest.max(background));
        let scale = Scale::of([least, greatest].map(f64::from), None);
        decoded.scale = scale;
        decoded.empty = [scale.fraction(background), 0];
        decoded.samples = (0..found.len())
            .into_par_iter()
            .map(|i| {
                let o = match found[i].occupancy {
                    _ if !inside(bricks.voxel(i / SAMPLES, i % SAMPLES)) => 0.0,
                    o => o,
                };
                [scale.fraction(values[i]), to_fraction(o)]
            })
            .collect();
        decoded.labels = self.labels(gpu, &extent, &bricks, (&splats, &boxes))?;
        Ok(Some(decoded.at_pitch(extent.pitch / pitch, coarser)))
    }

    /// Returns true if the voxels that splats reach at this pitch are few enough.
    pub(super) fn fits_at(&self, pitch: f64) -> bool {
        self.extent_at(pitch).is_some()
    }

    /// Returns the voxels that splats reach, at the pitch or at the first coarser one at which they are few
    /// enough, the splats in the space of the lattice, and what each of them reaches.
    fn extent(&self, mut pitch: f64) -> (Extent, Vec<Splat>, Vec<VoxelBox>) {
        loop {
            if let Some(found) = self.extent_at(pitch) {
                return found;
            }
            pitch *= 2.0;
            tracing::warn!("the field reaches too far to be decoded finer than to every {pitch} voxels");
        }
    }

    /// Returns the same at this pitch; `None` if there are too many voxels.
    fn extent_at(&self, pitch: f64) -> Option<(Extent, Vec<Splat>, Vec<VoxelBox>)> {
        let set = SplatSet { splats: self.splats.clone(), ..SplatSet::default() };
        let grid = self.lattice().at_pitch(pitch);
        let splats = set.to_voxel(&grid.world_from_voxel);
        let faces = match self.grid {
            Some(_) => [IVec3::ZERO, UVec3::from_array(grid.size).as_ivec3() - 1],
            None => [IVec3::MIN / 4, IVec3::MAX / 4],
        };
        let boxes = boxes(&splats, &self.field, faces);
        let extent = Extent::around(&boxes, grid.world_from_voxel, faces, pitch)?;
        Some((extent, splats, boxes))
    }

    /// Returns the grid of the file, or a grid of cubes if it has none.
    pub(super) fn lattice(&self) -> Grid {
        self.grid.unwrap_or_else(|| {
            let means = self.splats.iter().map(|s| Vec3::from_array(s.mean)).filter(|m| m.is_finite());
            let low = means.fold(Vec3::INFINITY, Vec3::min);
            let first = if low.is_finite() { low.as_dvec3() } else { DVec3::ZERO };
            let edge = DVec3::splat(self.sigma_mm.max(1e-6));
            let affine = DAffine3::from_scale_rotation_translation(edge, glam::DQuat::IDENTITY, first);
            Grid { size: [1; 3], world_from_voxel: affine }
        })
    }

    /// Returns the object that has most of Σ w at each sample; `None` if there is only one.
    fn labels(
        &self,
        gpu: &Gpu,
        extent: &Extent,
        bricks: &Bricks,
        (splats, boxes): (&[Splat], &[VoxelBox]),
    ) -> Result<Option<Vec<u8>>> {
        let mut numbers = self.objects.clone();
        numbers.sort_unstable();
        numbers.dedup();
        if numbers.len() < 2 {
            return Ok(None);
        }
        let count = bricks.len() * SAMPLES;
        let (mut labels, mut most) = (vec![numbers[0]; count], vec![0.0f32; count]);
        for &number in &numbers {
            let (own, own_boxes): (Vec<Splat>, Vec<VoxelBox>) = (splats.iter().zip(boxes).zip(&self.objects))
                .filter(|(_, object)| **object == number)
                .map(|((splat, reach), _)| (*splat, *reach))
                .unzip();
            let mut reached = vec![false; extent.reached.len()];
            for &(low, high) in own_boxes.iter().flatten() {
                extent.mark(&mut reached, low, high);
            }
            let there = extent.sampled(|brick| reached[brick] && extent.reached[brick]);
            let own = (&own[..], &own_boxes[..]);
            in_slabs(gpu, own, &self.field, &there, &mut |_| true, &mut |slots, sampler| {
                let found = sampler.sample([0.0; 3])?;
                for (brick, samples) in there.coordinates[slots].iter().zip(found.chunks(SAMPLES)) {
                    let slot = bricks.slots[place_of(extent.bricks, *brick)] as usize;
                    for (m, sample) in samples.iter().enumerate() {
                        let i = slot * SAMPLES + m;
                        if sample.weight > most[i] {
                            (labels[i], most[i]) = (number, sample.weight);
                        }
                    }
                }
                Ok(())
            })?;
        }
        Ok(Some(labels))
    }
}

/// Offsets of points between voxels; along each axis there is one in every quarter.
const BETWEEN: [[f32; 3]; 4] =
    [[0.125, 0.375, 0.625], [0.375, 0.875, 0.125], [0.625, 0.125, 0.875], [0.875, 0.625, 0.375]];
/// Weight of a point besides its occupancy: it alone holds V where the occupancy is faint.
const LEAST_WEIGHT: f32 = 1e-3;

/// Evaluates the field at the points at one offset from the voxels of the slots from `first` on: their
/// weights and V. A point has no weight if a voxel beyond the faces takes part in it or if no splat reaches it.
fn between(
    sampler: &mut Sampler,
    bricks: &Bricks,
    first: usize,
    offset: [f32; 3],
    inside: &(dyn Fn(IVec3) -> bool + Sync),
) -> Result<Vec<[f32; 2]>> {
    let found = sampler.sample(offset)?;
    let each = |i: usize| {
        let voxel = bricks.voxel(first + i / SAMPLES, i % SAMPLES);
        let there = found[i].weight > 0.0 && inside(voxel) && inside(voxel + 1);
        [if there { found[i].occupancy + LEAST_WEIGHT } else { 0.0 }, found[i].hu]
    };
    Ok((0..found.len()).into_par_iter().map(each).collect())
}

/// Calls `take` with the slots of each slab of some bricks, and with a sampler of its samples. Before each
/// slab `going` is told the part that is done; returns false, without the rest, if it does.
pub(super) fn in_slabs(
    gpu: &Gpu,
    (splats, boxes): (&[Splat], &[VoxelBox]),
    field: &Field,
    bricks: &Bricks,
    going: &mut dyn FnMut(f64) -> bool,
    take: &mut dyn FnMut(Range<usize>, &mut Sampler) -> Result<()>,
) -> Result<bool> {
    for start in (0..bricks.len()).step_by(SLAB_BRICKS) {
        if !going(start as f64 / bricks.len() as f64) {
            return Ok(false);
        }
        let slots = start..(start + SLAB_BRICKS).min(bricks.len());
        // Slots ascend along z. A voxel more holds the points between the last ones.
        let z = [slots.start, slots.end - 1].map(|slot| bricks.voxel(slot, 0).z);
        let near: Vec<Splat> = (splats.iter().zip(boxes))
            .filter(|(_, reach)| reach.is_some_and(|(low, high)| low.z <= z[1] + 8 && z[0] <= high.z))
            .map(|(splat, _)| *splat)
            .collect();
        let part = bricks.part(slots.clone());
        take(slots, &mut Sampler::new(gpu, &near, field, &part)?)?;
    }
    Ok(true)
}

/// Returns the least and greatest of some values.
pub(super) fn range_of(values: &[f32]) -> (f32, f32) {
    let none = || (f32::INFINITY, f32::NEG_INFINITY);
    let joined = |a: (f32, f32), b: (f32, f32)| (a.0.min(b.0), a.1.max(b.1));
    values.par_iter().fold(none, |range, &v| joined(range, (v, v))).reduce(none, joined)
}

/// Returns the box around the voxels that each splat reaches and those beside them, within the grid and a
/// border of one voxel.
pub(super) fn boxes(splats: &[Splat], field: &Field, faces: [IVec3; 2]) -> Vec<VoxelBox> {
    let reaches = reaches(splats, field.kernel.support_q());
    let boxes = splats.par_iter().zip(reaches).map(|(splat, reach)| {
        let mean = Vec3::from_array(splat.mean);
        // Positions are clamped as floats, so that huge ones do not overflow.
        let far = Vec3::splat(1e9);
        let low = (mean - reach).clamp(-far, far).floor().as_ivec3() - 1;
        let high = (mean + reach).clamp(-far, far).ceil().as_ivec3() + 1;
        let (low, high) = (low.max(faces[0] - 1), high.min(faces[1] + 1));
        (mean.is_finite() && low.cmple(high).all()).then_some((low, high))
    });
    boxes.collect()
}

/// Returns how many bricks of 8³ voxels hold the places of a box of so many voxels, from one before the first to one
/// behind the last: as `atlas_place` of medium.glsl counts them.
pub fn bricks_over(size: UVec3) -> UVec3 {
    (size + 8) / 8
}

impl Extent {
    /// Creates the extent around some boxes; returns `None` if there would be too many bricks.
    fn around(
        boxes: &[VoxelBox],
        scene_from_lattice: DAffine3,
        faces: [IVec3; 2],
        pitch: f64,
    ) -> Option<Self> {
        let there = boxes.iter().flatten();
        let (low, high) =
            there.fold((IVec3::MAX, IVec3::MIN), |(low, high), (from, to)| (low.min(*from), high.max(*to)));
        let (low, high) = if low.x > high.x { (IVec3::ZERO, IVec3::splat(2)) } else { (low, high) };
        // The size is computed in f64, because a box may be as wide as the range of an integer.
        let size = high.as_dvec3() - low.as_dvec3() + 1.0;
        if ((size + 4.0) / 4.0).element_product() > MOST_LEAPS {
            return None;
        }
        let bricks = bricks_over(size.as_uvec3());
        let mut extent = Extent { pitch, scene_from_lattice, faces, low, high, bricks, reached: Vec::new() };
        let mut reached = vec![false; bricks.element_product() as usize];
        for &(from, to) in boxes.iter().flatten() {
            extent.mark(&mut reached, from, to);
        }
        let count = reached.iter().filter(|there| **there).count();
        extent.reached = reached;
        (count <= MOST_BRICKS).then_some(extent)
    }

    /// Marks the bricks that hold voxels of a box.
    pub(super) fn mark(&self, reached: &mut [bool], low: IVec3, high: IVec3) {
        // Brick 0 begins a voxel before the box.
        let brick = |voxel: IVec3| ((voxel - self.low + 1) / BRICK as i32).as_uvec3();
        let (from, to) = (brick(low), brick(high));
        for z in from.z..=to.z {
            for y in from.y..=to.y {
                let row = place_of(self.bricks, UVec3::new(0, y, z));
                reached[row + from.x as usize..=row + to.x as usize].fill(true);
            }
        }
    }

    /// Returns the sample grid of the bricks for which `wanted` returns true.
    pub(super) fn sampled(&self, wanted: impl Fn(usize) -> bool) -> Bricks {
        let count = self.bricks.element_product();
        let mut slots = vec![NO_SLOT; count as usize];
        let mut coordinates = Vec::new();
        for i in (0..count).filter(|&i| wanted(i as usize)) {
            slots[i as usize] = coordinates.len() as u32;
            let n = self.bricks;
            coordinates.push(UVec3::new(i % n.x, i / n.x % n.y, i / (n.x * n.y)));
        }
        let active = vec![[u64::MAX; SAMPLES / 64]; coordinates.len()];
        Bricks { origin: self.low - 1, grid: self.bricks, slots, coordinates, active }
    }

    /// Returns the voxel of the box at a Morton place of a brick.
    fn bricks_voxel(&self, brick: UVec3, morton: usize) -> IVec3 {
        (brick * BRICK as u32 + brick_voxel(morton)).as_ivec3() - 1
    }
}

/// Returns the mean of the values that exist at the 26 voxels around one; `None` if there are none.
fn beside(voxel: IVec3, at: &dyn Fn(IVec3) -> Option<f32>) -> Option<f32> {
    let (mut sum, mut count) = (0.0f64, 0);
    for z in -1..=1 {
        for y in -1..=1 {
            for x in -1..=1 {
                if let Some(v) = at(voxel + IVec3::new(x, y, z)) {
                    sum += f64::from(v);
                    count += 1;
                }
            }
        }
    }
    (count > 0).then(|| (sum / f64::from(count)) as f32)
}
