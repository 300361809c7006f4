//! The decoded field: V and O of the splats, evaluated once on the voxels of the grid that they were fitted
//! on, and kept in bricks of 8³ as far as splats reach.
//!
//! A fit aims at the CT's voxels and at trilinear interpolation between them, so samples at the voxels,
//! interpolated, reproduce it. A frame then costs as much as one of the CT, however many splats there are,
//! and a transfer function may change at any time: V and O do not depend on it.
//!
//! V is the value of the field, in 16-bit fractions of its range. For splats that were fitted for voxels
//! alone it is taken at the voxel; otherwise it is what comes nearest to the field between the voxels, by
//! [least squares](super::least_squares). Where no splat reaches, V is the mean of the neighbours that one
//! does reach, so that interpolation at the rim is not drawn towards the background. Beyond the faces of the
//! grid V is that at the faces. O is Σ w / (Σ w + w₀); of a fit for a binary mask it is 1 above ½ and 0
//! elsewhere, but for the exceptions that the file lists. Beyond the faces of the grid O is 0, as it is
//! in the CT. A voxel belongs to the object that has most of Σ w there.
//!
//! If a file does not say what its grid was, voxels are cubes with an edge of
//! [`GpuSplats::sigma_mm`](super::GpuSplats::sigma_mm), from the least coordinates of all means on; splats
//! are fitted to be about as wide as voxels. The pitch doubles until the bricks fit into the limits below,
//! with a warning: a coarser picture is better than none.

use std::ops::Range;
use std::sync::Arc;

use glam::{DAffine3, DVec3, IVec3, U16Vec3, UVec3, Vec3};
use rayon::prelude::*;
use shaders_glsl::types::BrickGrid;

use super::extents::{middle_sigma, reaches};
use super::least_squares::{Neighbours, Points, least_squares};
use super::scale::{Scale, to_fraction};
use base::error::{Error, Kind, Result};
use gpu::Gpu;
use passes::Sampler;
use splat::{Exception, Field, Form, Grid, Splat, SplatSet};
use volume::bricks::{BRICK, NO_SLOT, SAMPLES, brick_morton, brick_voxel};
use volume::{Bricks, Roi, Volume, spacing_of};

/// Distance from the centre of a voxel, voxels, within which a place is that centre: two affines of one grid differ by
/// rounding, and no voxel may have a share of its neighbour for that.
const SAME_VOXEL: f64 = 1e-4;
/// Greatest number of bricks that are sampled: 67 million voxels, some 400 MB in the atlas.
const MOST_BRICKS: usize = 1 << 17;
/// Greatest number of bricks of 4³ voxels in the whole box, by which empty space is skipped: all devices have
/// room for them.
const MOST_LEAPS: f64 = 4e6;
/// Number of bricks that are sampled at once: with their results they take some 30 MB, and a decoding that is
/// no longer wanted ends after them.
const SLAB_BRICKS: usize = 1 << 11;
/// The finest and the coarsest pitch that may be asked for, voxels.
const PITCHES: [f64; 2] = [0.25, 16.0];

/// Input of the decoding: splats with their field and grid, mm in the space of a scene.
pub(super) struct Source {
    pub(super) splats: Vec<Splat>,
    /// The number of each splat's object.
    pub(super) objects: Vec<u8>,
    pub(super) field: Field,
    /// The grid in the space of the scene.
    pub(super) grid: Option<Grid>,
    pub(super) form: Form,
    pub(super) exceptions: Arc<[Exception]>,
    /// Edge of the voxels if there is no grid.
    pub(super) sigma_mm: f64,
}

/// A field on voxels, stored as far as splats reach.
#[derive(Clone, Debug)]
pub struct Decoded {
    /// Voxels of the box around everything, with an empty border of one voxel.
    pub size: [u32; 3],
    /// Affine from voxels of the box to mm in the space of the scene.
    pub scene_from_voxel: DAffine3,
    /// Mean edge of a voxel of the CT's grid, mm, whatever the pitch.
    pub edge_mm: f64,
    pub(super) scale: Scale,
    /// V and O, as fractions, of voxels that no splat reaches.
    pub(super) empty: [u16; 2],
    /// Bricks along x, y, z; brick b holds the voxels 8 b − 1 to 8 b + 6 of the box.
    pub(super) bricks: UVec3,
    /// Slot of each brick, x fastest.
    pub(super) slots: Vec<u32>,
    /// V and O as fractions, [slot][Morton place].
    pub(super) samples: Vec<[u16; 2]>,
    /// Objects that the voxels belong to, [slot][Morton place]; `None` if all belong to `label`.
    pub(super) labels: Option<Vec<u8>>,
    pub(super) label: u8,
}

/// Decodes a set, in its own space (mm less its origin), to voxels `pitch` voxels of its grid apart. A set that
/// was fitted for the voxels alone is wrong between them: its pitch is 1 or the next power of two, and coarser
/// voxels have the means of those of the grid.
///
/// # Errors
/// If the pitch is below ¼ or above 16.
pub fn decode(gpu: &Gpu, set: &SplatSet, pitch: f64) -> Result<Decoded> {
    Source::of(set)
        .decode(gpu, pitch, &mut |_| true)?
        .ok_or_else(|| Error::new(Kind::Internal, "VGS-RENDER-026", "a decoded field is lost"))
}

/// Returns true if [`decode`] has every voxel of a set's grid; false if there would be too many, so that it takes every
/// second one, or fewer.
pub fn decodes_every_voxel(set: &SplatSet) -> bool {
    Source::of(set).extent_at(1.0).is_some()
}

/// Fails if splats cannot be decoded to voxels of this pitch.
pub(super) fn check(pitch: f64) -> Result<()> {
    let [finest, coarsest] = PITCHES;
    if (finest..=coarsest).contains(&pitch) {
        return Ok(());
    }
    Err(Error::new(Kind::Usage, "VGS-RENDER-024", format!("a pitch of {pitch} voxels"))
        .help(format!("choose one from {finest} to {coarsest}; 1 is the grid of the CT itself")))
}

/// First and last voxel of the box around what a splat reaches; `None` if that is nothing of the grid.
type VoxelBox = Option<(IVec3, IVec3)>;

/// The voxels that splats reach, and the bricks in which they lie.
struct Extent {
    /// Voxels of the file's grid from one voxel of the lattice to the next.
    pitch: f64,
    scene_from_lattice: DAffine3,
    /// First and last voxel of the grid; without a grid there are no faces.
    faces: [IVec3; 2],
    /// First and last voxel of the box, with its border.
    low: IVec3,
    high: IVec3,
    bricks: UVec3,
    /// True if a splat reaches a voxel of the brick, or one beside it.
    reached: Vec<bool>,
}

impl Source {
    /// Returns the splats of a set in its own space, mm less its origin.
    fn of(set: &SplatSet) -> Self {
        let here = DAffine3::from_translation(-set.origin_mm);
        Source {
            splats: set.splats.clone(),
            objects: set.labels.clone().unwrap_or_else(|| vec![0; set.splats.len()]),
            field: set.field,
            grid: set.grid.map(|grid| Grid { world_from_voxel: here * grid.world_from_voxel, ..grid }),
            form: set.form,
            exceptions: set.exceptions.as_slice().into(),
            sigma_mm: middle_sigma(&set.splats),
        }
    }

    /// Decodes the splats. `going` is told the part that is done, 0 to 1, again and again; the result is
    /// `None` if it returns false.
    pub(super) fn decode(
        &self,
        gpu: &Gpu,
        pitch: f64,
        going: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Option<Decoded>> {
        check(pitch)?;
        // What is between the voxels of a grid fit means nothing, so a coarser field is made of that of its grid.
        let (pitch, coarser) = match self.form {
            Form::Field => (pitch, 1.0),
            Form::Grid { .. } => (1.0, pitch),
        };
        let (extent, splats, boxes) = self.extent(pitch);
        let bricks = extent.sampled(|brick| extent.reached[brick]);
        let background = self.field.background;
        let scene_from_voxel = extent.scene_from_lattice * DAffine3::from_translation(extent.low.as_dvec3());
        let mut decoded = Decoded {
            size: (extent.high - extent.low + 1).as_uvec3().to_array(),
            scene_from_voxel,
            edge_mm: spacing_of(&self.lattice().world_from_voxel).element_sum() / 3.0,
            scale: Scale::of([f64::from(background); 2], false),
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
        let binary = self.form == Form::Grid { binary: true };
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
        let scale = Scale::of([least, greatest].map(f64::from), false);
        decoded.scale = scale;
        decoded.empty = [scale.fraction(background), 0];
        decoded.samples = (0..found.len())
            .into_par_iter()
            .map(|i| {
                let o = match found[i].occupancy {
                    _ if !inside(bricks.voxel(i / SAMPLES, i % SAMPLES)) => 0.0,
                    o if binary => f32::from(u8::from(o > 0.5)),
                    o => o,
                };
                [scale.fraction(values[i]), to_fraction(o)]
            })
            .collect();
        if binary {
            for Exception { voxel, inside } in &*self.exceptions {
                let sample = extent.sample_of(U16Vec3::from_array(*voxel).as_dvec3(), &bricks.slots);
                if let Some(i) = sample.filter(|&i| found[i].weight > 0.0) {
                    decoded.samples[i][1] = to_fraction(f32::from(u8::from(*inside)));
                }
            }
        }
        decoded.labels = self.labels(gpu, &extent, &bricks, (&splats, &boxes))?;
        let mut reached = extent.pitch / pitch;
        while reached < coarser {
            decoded = decoded.halved();
            reached *= 2.0;
        }
        Ok(Some(decoded))
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
    fn lattice(&self) -> Grid {
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
fn in_slabs(
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
fn range_of(values: &[f32]) -> (f32, f32) {
    let none = || (f32::INFINITY, f32::NEG_INFINITY);
    let joined = |a: (f32, f32), b: (f32, f32)| (a.0.min(b.0), a.1.max(b.1));
    values.par_iter().fold(none, |range, &v| joined(range, (v, v))).reduce(none, joined)
}

/// Returns the box around the voxels that each splat reaches and those beside them, within the grid and a
/// border of one voxel.
fn boxes(splats: &[Splat], field: &Field, faces: [IVec3; 2]) -> Vec<VoxelBox> {
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
        // Places go from one voxel before the first to one behind the last.
        let bricks = (size.as_uvec3() + 8) / 8;
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
    fn mark(&self, reached: &mut [bool], low: IVec3, high: IVec3) {
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
    fn sampled(&self, wanted: impl Fn(usize) -> bool) -> Bricks {
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

    /// Returns the index of the sample at a voxel of the file's grid; `None` if there is none.
    fn sample_of(&self, voxel: DVec3, slots: &[u32]) -> Option<usize> {
        let at = voxel / self.pitch;
        let there = at.distance_squared(at.round()) < 1e-12;
        there.then(|| bricks_sample(self.bricks, slots, at.round().as_ivec3() - self.low)).flatten()
    }

    /// Returns the voxel of the box at a Morton place of a brick.
    fn bricks_voxel(&self, brick: UVec3, morton: usize) -> IVec3 {
        (brick * BRICK as u32 + brick_voxel(morton)).as_ivec3() - 1
    }
}

/// Returns the index of a brick among `bricks`, x fastest.
pub(super) fn place_of(bricks: UVec3, brick: UVec3) -> usize {
    ((brick.z * bricks.y + brick.y) * bricks.x + brick.x) as usize
}

/// Returns the index of the sample of a voxel of the box; `None` if its brick is not sampled.
fn bricks_sample(bricks: UVec3, slots: &[u32], voxel: IVec3) -> Option<usize> {
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

impl Decoded {
    /// Returns V and O as fractions at a voxel of the box; beyond its faces those at the faces.
    pub(super) fn at(&self, voxel: IVec3) -> [u16; 2] {
        self.sample(voxel).map_or(self.empty, |i| self.samples[i])
    }

    /// Returns the index of the sample of a voxel of the box; beyond its faces of that at the faces.
    pub(super) fn sample(&self, voxel: IVec3) -> Option<usize> {
        let last = UVec3::from_array(self.size).as_ivec3() - 1;
        bricks_sample(self.bricks, &self.slots, voxel.clamp(IVec3::ZERO, last))
    }

    /// Returns the same field with other objects: `number` gives that of each voxel by its place in the space of the
    /// scene, mm.
    pub(super) fn with_objects(mut self, number: &(dyn Fn(DVec3) -> u8 + Sync)) -> Self {
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

    /// Returns the number of bricks with samples. The atlas has those that hold anything, and their
    /// neighbours before them.
    pub fn brick_count(&self) -> usize {
        self.samples.len() / SAMPLES
    }

    /// Returns the intervals of intensity of the bricks by which empty space is skipped. An interval covers
    /// all voxels that are read for places in the brick and up to a voxel away, as for a volume.
    pub(super) fn intervals(&self, grid: &BrickGrid) -> Vec<[f32; 2]> {
        let n = UVec3::from_array(grid.bricks);
        let last = UVec3::from_array(self.size).as_ivec3() - 1;
        (0..n.element_product())
            .into_par_iter()
            .map(|i| {
                let brick = UVec3::new(i % n.x, i / n.x % n.y, i / (n.x * n.y));
                let edge = UVec3::from_array(grid.shift.map(|s| 1 << s)).as_ivec3();
                let from = brick.as_ivec3() * edge - 2;
                let (from, to) = (from.clamp(IVec3::ZERO, last), (from + edge + 2).clamp(IVec3::ZERO, last));
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
