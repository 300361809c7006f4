//! Decoding of splats that have a region: what is shown is its voxels, with smooth [edges](volume::edges); the splats
//! say what V is in them.
//!
//! V of a voxel, and of those of the rim around the region, is that of the splats of one fit, since splats reach beyond
//! the region that they were fitted to, or of its [coded voxels](splat::Voxels). Voxels that none reaches, and those
//! farther out that interpolation needs, have V and object of the region's voxels [nearby](volume::beyond).

use glam::{DAffine3, IVec3, UVec3};
use rayon::prelude::*;

use super::source::{Extent, MOST_BRICKS, MOST_LEAPS, Source, boxes, bricks_over, in_slabs, range_of};
use super::voxels::Decoded;
use crate::scale::{Scale, to_fraction};
use base::error::Result;
use base::memory;
use gpu::Gpu;
use splat::{Grid, Region, Splat, SplatSet};
use volume::bricks::SAMPLES;
use volume::edges::{Edges, Occupancy, occupancy};
use volume::{beyond, spacing_of};

/// Host bytes of a voxel of the box while it is decoded.
const HOST_BYTES_A_VOXEL: u64 = 8;

/// The voxels of a box around a region, x fastest.
struct Dense {
    /// Voxel of the lattice that is the first of the box.
    low: IVec3,
    size: [usize; 3],
    /// Kind of the region that each voxel has, or takes V from; 0 is none.
    kinds: Vec<u8>,
    values: Vec<f32>,
    /// O, 255 being 1.
    occupancy: Vec<u8>,
}

impl Dense {
    /// Returns the index of a voxel of the lattice; `None` beyond the box.
    fn at(&self, voxel: IVec3) -> Option<usize> {
        let place = (voxel - self.low).to_array();
        let inside = (0..3).all(|k| (0..self.size[k] as i32).contains(&place[k]));
        let [x, y, z] = place.map(|at| at as usize);
        inside.then(|| (z * self.size[1] + y) * self.size[0] + x)
    }

    fn voxel(&self, index: usize) -> IVec3 {
        let [nx, ny, _] = self.size;
        self.low
            + UVec3::new((index % nx) as u32, (index / nx % ny) as u32, (index / (nx * ny)) as u32).as_ivec3()
    }
}

impl Source {
    /// Decodes the splats of a set with a region; see [`Source::decode`]. Returns the pitch as well: where the region has too many voxels every
    /// second one is taken along each axis, or fewer.
    pub(super) fn decode_region(
        &self,
        gpu: &Gpu,
        region: &Region,
        grid: &Grid,
        edges: Edges,
        going: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Option<(Decoded, f64)>> {
        let mut step = 1u32;
        loop {
            let there = if step == 1 { region.clone() } else { region.every(step) };
            let pitch = f64::from(step);
            if let Some(found) = self.decode_at(gpu, &there, (&grid.at_pitch(pitch), step), edges, going)? {
                return Ok(found.map(|decoded| (decoded, pitch)));
            }
            step *= 2;
            tracing::warn!("the region is too large to be decoded finer than to every {step} voxels");
        }
    }

    /// Returns what [`Self::decode_region`] does, on a lattice of every so many voxels of the grid; `None` if there are too
    /// many.
    fn decode_at(
        &self,
        gpu: &Gpu,
        region: &Region,
        (lattice, step): (&Grid, u32),
        edges: Edges,
        going: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Option<Option<Decoded>>> {
        if !is_within_limits(region) {
            return Ok(None);
        }
        let spacing = spacing_of(&lattice.world_from_voxel).to_array();
        let shown = occupancy(&region.kinds(), region.size(), spacing, edges)?;
        let mut dense = dense(region, shown)?;
        let extent = shown_extent(&dense, lattice);
        let bricks = extent.sampled(|brick| extent.reached[brick]);
        if bricks.len() > MOST_BRICKS {
            return Ok(None);
        }
        let layers = edges.layers(spacing);
        if !self.sample_region(gpu, region, (lattice, step), &extent, (&mut dense, layers), going)? {
            return Ok(Some(None));
        }
        let background = self.field.background;
        let all = |i: usize| {
            let voxel = bricks.voxel(i / SAMPLES, i % SAMPLES);
            match dense.at(voxel) {
                Some(at) if dense.kinds[at] > 0 => (dense.values[at], dense.occupancy[at], dense.kinds[at]),
                _ => (background, 0, 0),
            }
        };
        let found: Vec<(f32, u8, u8)> = (0..bricks.len() * SAMPLES).into_par_iter().map(all).collect();
        let values: Vec<f32> = found.iter().map(|(value, ..)| *value).collect();
        let (least, greatest) = range_of(&values);
        let range = [least.min(background), greatest.max(background)].map(f64::from);
        let step = if let [voxels] = &self.voxels[..] { Some(voxels.precision.step) } else { None };
        let scale = Scale::of(range, step);
        let numbers: Vec<u8> = region.objects().iter().map(|object| object.number).collect();
        let fallback = numbers.first().copied().unwrap_or(0);
        let number = |kind: u8| numbers.get(usize::from(kind).wrapping_sub(1)).copied().unwrap_or(fallback);
        Ok(Some(Some(Decoded {
            size: (extent.high - extent.low + 1).as_uvec3().to_array(),
            scene_from_voxel: extent.scene_from_lattice * DAffine3::from_translation(extent.low.as_dvec3()),
            edge_mm: spacing_of(&self.lattice().world_from_voxel).element_sum() / 3.0,
            scale,
            empty: [scale.fraction(background), 0],
            bricks: extent.bricks,
            slots: bricks.slots.clone(),
            samples: found
                .par_iter()
                .map(|&(value, o, _)| [scale.fraction(value), to_fraction(f32::from(o) / 255.0)])
                .collect(),
            labels: (numbers.len() > 1).then(|| found.par_iter().map(|&(.., kind)| number(kind)).collect()),
            label: fallback,
        })))
    }

    /// Finds V at the voxels of the region and its rim, and continues it beyond for this many layers. Returns false, without the rest, if `going` does.
    fn sample_region(
        &self,
        gpu: &Gpu,
        region: &Region,
        (lattice, step): (&Grid, u32),
        extent: &Extent,
        (dense, layers): (&mut Dense, usize),
        going: &mut dyn FnMut(f64) -> bool,
    ) -> Result<bool> {
        let set = SplatSet { splats: self.splats.clone(), ..SplatSet::default() };
        let splats = set.to_voxel(&lattice.world_from_voxel);
        let boxes = boxes(&splats, &self.field, extent.faces);
        let mut fits: Vec<u8> = region.objects().iter().map(|object| object.fit).collect();
        fits.sort_unstable();
        fits.dedup();
        let mut known = vec![0u8; dense.kinds.len()];
        for (turn, &fit) in fits.iter().enumerate() {
            let own = |kind: u8| kind > 0 && region.objects()[usize::from(kind) - 1].fit == fit;
            let of_fit = |i: &usize| region.fit_of(self.objects[*i]).is_none_or(|of| of == fit);
            let (splats, boxes): (Vec<Splat>, Vec<_>) =
                (0..splats.len()).filter(of_fit).map(|i| (splats[i], boxes[i])).unzip();
            let mut wanted = vec![false; extent.reached.len()];
            let inside: Vec<bool> = dense.kinds.par_iter().map(|&kind| own(kind)).collect();
            for (i, _) in inside.iter().enumerate().filter(|(_, inside)| **inside) {
                let voxel = dense.voxel(i);
                extent.mark(&mut wanted, (voxel - 1).max(extent.low), (voxel + 1).min(extent.high));
            }
            let near = with_neighbours(inside, dense.size);
            if let Some(voxels) = self.voxels.iter().find(|voxels| voxels.fit == fit) {
                for at in (0..near.len()).filter(|&at| near[at]) {
                    let kind = dense.kinds[at];
                    let is_taken = own(kind) || kind == 0 && dense.values[at].is_nan();
                    let voxel = dense.voxel(at).to_array().map(|v| i64::from(v) * i64::from(step));
                    if let Some(value) = voxels.at(voxel).filter(|_| is_taken) {
                        (dense.values[at], known[at]) = (value as f32, kind);
                    }
                }
                continue;
            }
            let bricks = extent.sampled(|brick| wanted[brick]);
            let part = |done: f64| (turn as f64 + done) / fits.len() as f64;
            let mut going = |done: f64| going(part(done));
            let whole =
                in_slabs(gpu, (&splats, &boxes), &self.field, &bricks, &mut going, &mut |slots, sampler| {
                    let samples = sampler.sample([0.0; 3])?;
                    for (i, sample) in samples.iter().enumerate().filter(|(_, sample)| sample.weight > 0.0) {
                        let voxel = bricks.voxel(slots.start + i / SAMPLES, i % SAMPLES);
                        let Some(at) = dense.at(voxel) else { continue };
                        let kind = dense.kinds[at];
                        if own(kind) || kind == 0 && near[at] && dense.values[at].is_nan() {
                            (dense.values[at], known[at]) = (sample.hu, kind);
                        }
                    }
                    Ok(())
                })?;
            if !whole {
                return Ok(false);
            }
        }
        // Splats say what V is in the rim, so what is farther out continues it.
        for layers in [1, layers - 1] {
            beyond::extend(&mut dense.values, &mut known, dense.size, layers);
        }
        let background = self.field.background;
        dense.values.par_iter_mut().filter(|value| value.is_nan()).for_each(|value| *value = background);
        // A voxel that no splat reaches stays its object's.
        known
            .par_iter_mut()
            .zip(&dense.kinds)
            .for_each(|(known, &kind)| *known = if kind > 0 { kind } else { *known });
        dense.kinds = known;
        Ok(true)
    }
}

/// Returns true if the box around a region may be decoded: there is room for the bricks by which empty space is skipped.
pub(super) fn is_within_limits(region: &Region) -> bool {
    let [first, end] = region.bounds();
    let leaps: f64 = (0..3).map(|k| f64::from(end[k] - first[k] + 8) / 4.0).product();
    leaps <= MOST_LEAPS && region.voxel_count() <= MOST_BRICKS * SAMPLES
}

/// Returns the box of a region and its occupancy, in which no V is known.
fn dense(region: &Region, shown: Occupancy) -> Result<Dense> {
    let [first, _] = region.bounds();
    let count = shown.values.len();
    memory::require(count as u64 * HOST_BYTES_A_VOXEL, "the voxels of a region")?;
    let low = UVec3::from_array(first).as_ivec3() + shown.origin;
    let mut kinds = vec![0; count];
    region.copy_kinds((&mut kinds, shown.size), (-shown.origin).to_array().map(|at| at as usize));
    Ok(Dense { low, size: shown.size, kinds, values: vec![f32::NAN; count], occupancy: shown.values })
}

/// Returns which voxels of a box are set or among the 26 neighbours of one that is.
fn with_neighbours(set: Vec<bool>, [nx, ny, nz]: [usize; 3]) -> Vec<bool> {
    let along = |set: Vec<bool>, step: usize, n: usize| -> Vec<bool> {
        let near = |i: usize| {
            let at = i / step % n;
            set[i] || at > 0 && set[i - step] || at + 1 < n && set[i + step]
        };
        (0..set.len()).into_par_iter().map(near).collect()
    };
    along(along(along(set, 1, nx), nx, ny), nx * ny, nz)
}

/// Returns the bricks that hold voxels of which O is above 0, and those beside such voxels.
fn shown_extent(dense: &Dense, lattice: &Grid) -> Extent {
    let size = UVec3::from_array(dense.size.map(|n| n as u32)).max(UVec3::splat(3)).as_ivec3();
    let (low, high) = (dense.low, dense.low + size - 1);
    let bricks = bricks_over(size.as_uvec3());
    let last = UVec3::from_array(lattice.size).as_ivec3() - 1;
    let mut extent = Extent {
        pitch: 1.0,
        scene_from_lattice: lattice.world_from_voxel,
        faces: [IVec3::ZERO, last],
        low,
        high,
        bricks,
        reached: Vec::new(),
    };
    let mut reached = vec![false; bricks.element_product() as usize];
    for (i, _) in dense.occupancy.iter().enumerate().filter(|(_, o)| **o > 0) {
        let voxel = dense.voxel(i);
        extent.mark(&mut reached, (voxel - 1).max(low), (voxel + 1).min(high));
    }
    extent.reached = reached;
    extent
}
