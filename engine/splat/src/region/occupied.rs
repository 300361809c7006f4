//! Regions from the weights of splats: of files that were written before files had a region, and of some splats of a
//! set.

use rayon::prelude::*;

use super::kinds::{Region, RegionObject, place};
use crate::{Activations, Field, Grid, Splat, SplatSet};
use base::error::Result;
use base::memory;

/// Slices that are summed at a time.
const SLAB: u32 = 8;
/// Most voxels in the boxes around all splats together: for more, summing takes minutes.
const MOST_VISITS: f64 = 2e10;

/// A voxel of a grid where the occupancy of the splats is on the wrong side of ½.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Exception {
    /// The voxel's indices along x, y, z.
    pub(crate) voxel: [u32; 3],
    /// True if the voxel is in the mask. It holds only where a splat reaches the voxel.
    pub(crate) inside: bool,
}

impl Exception {
    /// Creates the exception of the voxel with this index, x fastest; `None` if the grid has no such voxel.
    pub(crate) fn at(index: u64, inside: bool, grid: &Grid) -> Option<Self> {
        let [nx, ny, nz] = grid.size.map(u64::from);
        let [x, y, z] = [index % nx, index / nx % ny, index / nx / ny];
        (z < nz).then_some(Exception { voxel: [x as u32, y as u32, z as u32], inside })
    }
}

/// What the splats of the objects weigh at a voxel; objects come one after the other.
#[derive(Clone, Copy, Default)]
struct Weighed {
    total: f32,
    /// The present object and its weight.
    own: (u8, f32),
    /// The object of most weight before it.
    most: (u8, f32),
}

impl Weighed {
    fn add(&mut self, number: u8, weight: f32) {
        if self.own.0 != number {
            self.most = self.heaviest();
            self.own = (number, 0.0);
        }
        self.own.1 += weight;
        self.total += weight;
    }

    fn heaviest(&self) -> (u8, f32) {
        if self.own.1 > self.most.1 { self.own } else { self.most }
    }
}

impl Region {
    /// Returns the region that a set for a binary mask shows: the voxels where O > ½, or where an exception says so;
    /// each belongs to the object of most weight. `None` if the splats are too many and too large to be summed.
    ///
    /// # Errors
    /// [`Kind::HostMemory`](base::Kind) for a grid that memory does not hold.
    pub(crate) fn occupied(set: &SplatSet, grid: &Grid, exceptions: &[Exception]) -> Result<Option<Region>> {
        let mut all = set.weights(grid, |i| set.labels.as_ref().map_or(0, |labels| labels[i]));
        all.sort_by_key(|weight| weight.tag);
        let Some((bounds, sums)) =
            summed(&all, &set.field, |sum: &mut Weighed, number, w| sum.add(number, w))?
        else {
            return Ok(None);
        };
        let size = [0, 1, 2].map(|k| bounds[1][k] - bounds[0][k]);
        let mut inside: Vec<bool> = sums.iter().map(|sum| sum.total > set.field.occupancy_w0).collect();
        for exception in exceptions {
            let within = (0..3).all(|k| (bounds[0][k]..bounds[1][k]).contains(&exception.voxel[k]));
            if let Some(at) = within.then(|| place(exception.voxel, bounds[0], size)) {
                inside[at] = exception.inside && sums[at].total > 0.0;
            }
        }
        Ok(Region::in_box(bounds, |voxel| {
            let at = place(voxel, bounds[0], size);
            inside[at].then(|| RegionObject { number: sums[at].heaviest().0, fit: 0 })
        }))
    }

    /// Returns the part of the region of `whole` that belongs to some of its splats: all voxels of objects whose splats
    /// are all `kept`, and of others the voxels in which those kept have at least half of the weight. Where memory does
    /// not hold the weights these objects keep all their voxels.
    pub(crate) fn part(&self, whole: &SplatSet, grid: &Grid, kept: &[bool]) -> Region {
        let number = |i: usize| whole.labels.as_ref().map_or(0, |labels| labels[i]);
        let mut splats = [[0usize; 256]; 2];
        for (i, &kept) in kept.iter().enumerate() {
            splats[usize::from(kept)][usize::from(number(i))] += 1;
        }
        let has = |number: u8| splats.map(|counts| counts[usize::from(number)] > 0);
        let is_coded = |number: u8| self.fit_of(number).is_some_and(|fit| whole.voxels_of(fit).is_some());
        // An object without splats is where others are.
        let is_cut = |number: u8| {
            if is_coded(number) {
                return false;
            }
            let [left, kept] = has(number);
            left == kept
        };
        let goes = |number: u8| has(number) == [true, false];
        let mut sums = None;
        if self.objects.iter().any(|object| is_cut(object.number)) {
            let all = whole.weights(grid, |i| u8::from(kept[i]));
            let add = |sum: &mut [f32; 2], kept: u8, w: f32| sum[usize::from(kept)] += w;
            sums = summed(&all, &whole.field, add).ok().flatten();
        }
        let weighs = |[bounds, end]: [[u32; 3]; 2], sums: &[[f32; 2]], voxel: [u32; 3]| {
            let within = (0..3).all(|k| (bounds[k]..end[k]).contains(&voxel[k]));
            let size = [0, 1, 2].map(|k| end[k] - bounds[k]);
            within.then(|| sums[place(voxel, bounds, size)]).is_some_and(|[left, kept]| kept >= left)
        };
        let part = self.with_objects(|voxel, object| {
            let stays = match &sums {
                _ if goes(object.number) => false,
                Some((bounds, sums)) if is_cut(object.number) => weighs(*bounds, sums, voxel),
                _ => true,
            };
            stays.then_some(object)
        });
        part.unwrap_or_else(|| self.clone())
    }
}

impl SplatSet {
    /// Gives each voxel of the region the label of most weight there; for a set whose labels are not those of its fit.
    pub fn label_region(&mut self) {
        let (Some(region), Some(grid)) = (&self.region, &self.grid) else { return };
        let mut all = self.weights(grid, |i| self.labels.as_ref().map_or(0, |labels| labels[i]));
        all.sort_by_key(|weight| weight.tag);
        let sums = summed(&all, &self.field, |sum: &mut Weighed, number, w| sum.add(number, w));
        let Ok(Some(([first, end], sums))) = sums else { return };
        let size = [0, 1, 2].map(|k| end[k] - first[k]);
        let labelled = region.with_objects(|voxel, object| {
            let within = (0..3).all(|k| (first[k]..end[k]).contains(&voxel[k]));
            let number = within.then(|| sums[place(voxel, first, size)].heaviest().0);
            Some(RegionObject { number: number.unwrap_or(object.number), ..object })
        });
        self.region = labelled.or_else(|| self.region.take());
    }

    /// Returns the splats as their weights are summed in the voxels of a grid, with these tags.
    fn weights(&self, grid: &Grid, tag: impl Fn(usize) -> u8) -> Vec<Weight> {
        let splats = self.to_voxel(&grid.world_from_voxel);
        let weight = |i: usize| Weight::of(&splats[i], tag(i), &self.field, grid);
        (0..splats.len()).filter_map(weight).collect()
    }
}

/// A splat as its weight is summed.
struct Weight {
    splat: Splat,
    tag: u8,
    /// The first voxel of the box around its support, and the one behind its last.
    bounds: [[u32; 3]; 2],
}

impl Weight {
    /// Returns `None` for a splat, in voxels, that reaches no voxel of the grid.
    fn of(splat: &Splat, tag: u8, field: &Field, grid: &Grid) -> Option<Self> {
        let row = field.kernel.row();
        let reach = splat.reach(row.support_q).min(glam::DVec3::splat(row.reach + 1e-3));
        let bound = |k: usize, sign: f64| f64::from(splat.mean[k]) + sign * reach[k];
        // A float that is none becomes 0.
        let low = [0, 1, 2].map(|k| bound(k, -1.0).ceil().clamp(0.0, f64::from(grid.size[k])) as u32);
        let high =
            [0, 1, 2].map(|k| (bound(k, 1.0).floor() + 1.0).clamp(0.0, f64::from(grid.size[k])) as u32);
        (0..3).all(|k| low[k] < high[k]).then_some(Weight { splat: *splat, tag, bounds: [low, high] })
    }

    fn visits(&self) -> f64 {
        (0..3).map(|k| f64::from(self.bounds[1][k] - self.bounds[0][k])).product()
    }
}

/// The box around some voxels, given by its first voxel and the one behind its last, and what they have.
type Summed<T> = ([[u32; 3]; 2], Vec<T>);

/// Returns the box around what splats reach, and what `add` makes of their tags and weights at its voxels; `None` if
/// there is too much to sum.
fn summed<T: Copy + Default + Send + Sync>(
    all: &[Weight],
    field: &Field,
    add: impl Fn(&mut T, u8, f32) + Sync,
) -> Result<Option<Summed<T>>> {
    if all.iter().map(Weight::visits).sum::<f64>() > MOST_VISITS {
        return Ok(None);
    }
    let low = [0, 1, 2].map(|k| all.iter().map(|w| w.bounds[0][k]).min().unwrap_or(0));
    let high = [0, 1, 2].map(|k| all.iter().map(|w| w.bounds[1][k]).max().unwrap_or(0));
    let size = [0, 1, 2].map(|k| high[k] - low[k]);
    let voxels = size.iter().fold(1u64, |voxels, &n| voxels.saturating_mul(n.into()));
    memory::require(voxels.saturating_mul(size_of::<T>() as u64 + 2), "the voxels of the splats' grid")?;
    let mut sums = vec![T::default(); voxels as usize];
    let slice = (size[0] * size[1]).max(1) as usize;
    sums.par_chunks_mut(slice * SLAB as usize).enumerate().for_each(|(slab, sums)| {
        let first = low[2] + slab as u32 * SLAB;
        let end = first + SLAB;
        for weight in all.iter().filter(|w| w.bounds[0][2] < end && first < w.bounds[1][2]) {
            let [from, to] = weight.bounds;
            let z = from[2].max(first)..to[2].min(end);
            weight.visit(field, [from[0]..to[0], from[1]..to[1], z], |[x, y, z], w| {
                let [x, y, z] = [x - low[0], y - low[1], z - first].map(|at| at as usize);
                add(&mut sums[z * slice + y * size[0] as usize + x], weight.tag, w);
            });
        }
    });
    Ok(Some(([low, high], sums)))
}

impl Weight {
    /// Tells `each` the weight at the voxels of these ranges where there is any.
    fn visit(&self, field: &Field, ranges: [std::ops::Range<u32>; 3], mut each: impl FnMut([u32; 3], f32)) {
        let (axes, scale) = (self.splat.axes(), self.splat.scale().map(f64::from));
        let mean = glam::DVec3::from_array(self.splat.mean.map(f64::from));
        let log_scale = self.splat.log_scale.map(f64::from);
        let amplitude = f64::from(self.splat.opacity()) * field.kernel.peak(log_scale);
        let rows = [0, 1, 2].map(|k| axes.col(k) / scale[k]);
        let [xs, ys, zs] = ranges;
        for z in zs {
            for y in ys.clone() {
                for x in xs.clone() {
                    let d = glam::DVec3::new(f64::from(x), f64::from(y), f64::from(z)) - mean;
                    let q: f64 = rows.iter().map(|row| row.dot(d).powi(2)).sum();
                    let weight = amplitude * field.kernel.cut_value(d, q);
                    if weight > 0.0 {
                        each([x, y, z], weight as f32);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::*;
    use crate::Form;

    fn set(places: &[(f32, u8)]) -> (SplatSet, Grid) {
        let splat = |&(x, _): &(f32, u8)| Splat {
            mean: [x, 6.0, 5.0],
            rotation: [1.0, 0.0, 0.0, 0.0],
            log_scale: [0.2; 3],
            opacity_logit: 1.0,
            intensity: 7.0,
        };
        let grid = Grid { size: [30, 12, 11], world_from_voxel: DAffine3::from_scale(DVec3::splat(2.0)) };
        let splats: Vec<Splat> = places.iter().map(splat).collect();
        let mut set = SplatSet::from_voxel(&splats, &grid.world_from_voxel, Field::default());
        set.labels = Some(places.iter().map(|(_, label)| *label).collect());
        (set.grid, set.form) = (Some(grid), Form::Grid);
        (set, grid)
    }

    #[test]
    fn voxels_of_most_weight_are_occupied_but_for_the_exceptions() {
        let (set, grid) = set(&[(5.0, 2), (15.0, 1), (18.0, 2)]);
        let region = Region::occupied(&set, &grid, &[]).expect("memory").expect("few splats");
        assert_eq!(region.at([5, 6, 5]).map(|o| o.number), Some(2));
        assert_eq!(region.at([15, 6, 5]).map(|o| o.number), Some(1));
        assert_eq!(region.at([16, 6, 5]).map(|o| o.number), Some(1), "nearer to the first");
        assert_eq!(region.at([17, 6, 5]).map(|o| o.number), Some(2));
        assert_eq!((region.at([5, 9, 5]), region.at([25, 6, 5])), (None, None));
        let voxels = [([5, 6, 5], false), ([5, 8, 5], true), ([25, 6, 5], true)];
        let exceptions = voxels.map(|(voxel, inside)| Exception { voxel, inside });
        let other = Region::occupied(&set, &grid, &exceptions).expect("memory").expect("few splats");
        assert_eq!(other.at([5, 6, 5]), None);
        assert!(other.at([5, 8, 5]).is_some(), "a splat reaches it");
        assert_eq!(other.at([25, 6, 5]), None, "no splat reaches it");
        // O = W/(W + w₀) > ½ where W > w₀.
        for (voxel, _) in region.voxels() {
            let weight: f64 = set
                .to_voxel(&grid.world_from_voxel)
                .iter()
                .map(|splat| {
                    let d = DVec3::from_array(voxel.map(f64::from))
                        - DVec3::from_array(splat.mean.map(f64::from));
                    f64::from(splat.opacity())
                        * set.field.kernel.value((d / f64::from(splat.scale()[0])).length_squared())
                })
                .sum();
            assert!(weight > 0.05, "{voxel:?}: {weight}");
        }
    }

    #[test]
    fn a_part_has_the_voxels_in_which_it_weighs_most() {
        let (set, grid) = set(&[(5.0, 2), (9.5, 2), (15.0, 1)]);
        let region = Region::occupied(&set, &grid, &[]).expect("memory").expect("few splats");
        let part = |kept: [bool; 3]| region.part(&set, &grid, &kept);
        let [left, right] = [part([true, false, false]), part([false, true, true])];
        assert_eq!(left.voxel_count() + right.voxel_count(), region.voxel_count());
        assert!(left.at([5, 6, 5]).is_some() && left.at([9, 6, 5]).is_none());
        assert!(right.at([9, 6, 5]).is_some() && right.at([15, 6, 5]).is_some());
        assert_eq!(part([true; 3]), region);
        let of_label = region.voxels().filter(|(_, object)| object.number == 1).count();
        assert_eq!(part([false, false, true]).voxel_count(), of_label);
        assert_eq!(part([false; 3]).voxel_count(), 0);
    }

    #[test]
    fn absurd_splats_are_not_summed_for_hours() {
        let (mut set, mut grid) = set(&[(5.0, 1)]);
        grid.size = [4000; 3];
        set.splats[0].log_scale = [20.0; 3];
        assert_eq!(Region::occupied(&set, &grid, &[]).expect("no memory taken"), None);
    }
}
