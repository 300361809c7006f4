//! Voxels of a grid and the object that each belongs to.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::Grid;

/// Most objects of a region.
pub(super) const MOST_KINDS: usize = u8::MAX as usize;

/// An object of a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RegionObject {
    /// The number of the object: the label of its splats, or 0 for splats without labels.
    pub number: u8,
    /// The fit that its splats are from, counted from 0: V of a voxel is that of the splats of one fit, since
    /// splats reach beyond the region that they were fitted to.
    pub fit: u8,
}

/// Voxels of a grid and the object that each belongs to; the others belong to none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Region {
    /// Indices of the first voxel of the box around all voxels.
    pub(super) first: [u32; 3],
    /// Voxels of the box along x, y, z.
    pub(super) size: [u32; 3],
    /// The kind of each voxel of the box, x fastest: 0 is none, k the object k − 1.
    pub(super) kinds: Arc<[u8]>,
    /// The objects, ascending.
    pub(super) objects: Vec<RegionObject>,
}

impl Region {
    /// Creates the region of the voxels of a grid of `size` voxels for which `number` returns the number of an
    /// object; it is told a voxel's index, x fastest. `None` if there are more than 255 objects.
    pub fn of(size: [usize; 3], number: impl Fn(usize) -> Option<u8>) -> Option<Region> {
        let voxels = [[0; 3], size.map(|n| n as u32)];
        Region::in_box(voxels, |[x, y, z]| {
            let [x, y, z] = [x, y, z].map(|at| at as usize);
            number((z * size[1] + y) * size[0] + x).map(|number| RegionObject { number, fit: 0 })
        })
    }

    /// Creates the region of the voxels of a box, given by its first voxel and the one behind its last, that belong
    /// to an object; `None` if there are more than 255.
    pub(crate) fn in_box(
        [first, end]: [[u32; 3]; 2],
        object: impl Fn([u32; 3]) -> Option<RegionObject>,
    ) -> Option<Region> {
        let (mut low, mut high) = (end, first);
        let mut objects = BTreeMap::new();
        for voxel in voxels_of([first, end]) {
            let Some(object) = object(voxel) else { continue };
            objects.entry(object).or_insert(0u8);
            for (k, at) in voxel.into_iter().enumerate() {
                (low[k], high[k]) = (low[k].min(at), high[k].max(at + 1));
            }
        }
        if objects.is_empty() {
            return Some(Region { first: [0; 3], size: [0; 3], kinds: Arc::new([]), objects: Vec::new() });
        }
        (objects.len() <= MOST_KINDS).then_some(())?;
        for (kind, number) in (1..=u8::MAX).zip(objects.values_mut()) {
            *number = kind;
        }
        let size = [0, 1, 2].map(|k| high[k] - low[k]);
        // Asking twice takes less memory than keeping the answers.
        let kinds: Vec<u8> =
            voxels_of([low, high]).map(|voxel| object(voxel).map_or(0, |of| objects[&of])).collect();
        Some(Region { first: low, size, kinds: kinds.into(), objects: objects.into_keys().collect() })
    }

    /// Returns the first voxel of the box around all voxels, and the one behind its last.
    pub fn bounds(&self) -> [[u32; 3]; 2] {
        [self.first, [0, 1, 2].map(|k| self.first[k] + self.size[k])]
    }

    /// Returns the objects, ascending; all have voxels.
    pub fn objects(&self) -> &[RegionObject] {
        &self.objects
    }

    /// Returns the kind of each voxel of [`Self::bounds`], x fastest: 0 is no object, k is [`Self::objects`]`[k − 1]`.
    pub fn kinds(&self) -> &[u8] {
        &self.kinds
    }

    /// Returns the object of a voxel; `None` if it belongs to none.
    pub fn at(&self, voxel: [i64; 3]) -> Option<RegionObject> {
        let inside = (0..3).all(|k| {
            let at = voxel[k] - i64::from(self.first[k]);
            (0..i64::from(self.size[k])).contains(&at)
        });
        inside.then_some(())?;
        let kind = self.kinds[place(voxel.map(|at| at as u32), self.first, self.size)];
        self.objects.get(usize::from(kind).wrapping_sub(1)).copied()
    }

    /// Returns the number of voxels.
    pub fn voxel_count(&self) -> usize {
        self.kinds.iter().filter(|&&kind| kind > 0).count()
    }

    /// Returns the voxels, x fastest, each with its object.
    pub fn voxels(&self) -> impl Iterator<Item = ([u32; 3], RegionObject)> + '_ {
        let [nx, ny, _] = self.size.map(|n| n as usize);
        let there = self.kinds.iter().enumerate().filter(|(_, kind)| **kind > 0);
        there.map(move |(i, &kind)| {
            let at = [i % nx, i / nx % ny, i / (nx * ny)];
            (std::array::from_fn(|k| self.first[k] + at[k] as u32), self.objects[usize::from(kind) - 1])
        })
    }

    /// Returns the region with other objects, `None` for voxels that leave it; `None` if there are more than 255.
    pub fn with_objects(
        &self,
        object: impl Fn([u32; 3], RegionObject) -> Option<RegionObject>,
    ) -> Option<Region> {
        Region::in_box(self.bounds(), |voxel| object(voxel, self.at(voxel.map(i64::from))?))
    }

    /// Returns the region on a larger grid, whose voxel `first` is the first of this one.
    pub fn within(self, first: [u32; 3]) -> Region {
        let moved = std::array::from_fn(|k| self.first[k] + first[k]);
        if self.kinds.is_empty() { self } else { Region { first: moved, ..self } }
    }

    /// Returns the region on a grid that has every `step`-th voxel along each axis.
    pub fn every(&self, step: u32) -> Region {
        let [first, end] = self.bounds();
        let coarse = [first.map(|at| at / step), end.map(|at| at.div_ceil(step))];
        let at = |voxel: [u32; 3]| self.at(voxel.map(|at| i64::from(at) * i64::from(step)));
        // There are no more objects than before.
        Region::in_box(coarse, at).unwrap_or_else(|| self.clone())
    }

    /// Returns the region with other numbers of objects, which `number` returns for one voxel after the other, x fastest;
    /// `None` if there are more than 255.
    pub fn renumbered(&self, mut number: impl FnMut(u8) -> u8) -> Option<Region> {
        let mut objects = BTreeMap::new();
        let mut of: Vec<RegionObject> = Vec::with_capacity(self.kinds.len());
        for (_, object) in self.voxels() {
            let object = RegionObject { number: number(object.number), ..object };
            objects.insert(object, 0u8);
            of.push(object);
        }
        (objects.len() <= MOST_KINDS).then_some(())?;
        for (kind, place) in (1..=u8::MAX).zip(objects.values_mut()) {
            *place = kind;
        }
        let mut of = of.into_iter();
        let kind = |&kind: &u8| if kind > 0 { of.next().map_or(0, |object| objects[&object]) } else { 0 };
        let kinds = self.kinds.iter().map(kind).collect();
        Some(Region { kinds, objects: objects.into_keys().collect(), ..*self })
    }

    /// Returns the first voxel of the box around `regions`, and the one behind its last.
    fn bounds_of(regions: &[Region]) -> [[u32; 3]; 2] {
        let there = || regions.iter().filter(|region| !region.kinds.is_empty()).map(Region::bounds);
        let first = [0, 1, 2].map(|k| there().map(|[low, _]| low[k]).min().unwrap_or(0));
        let end = [0, 1, 2].map(|k| there().map(|[_, high]| high[k]).max().unwrap_or(0));
        [first, end]
    }

    /// Returns the bytes of memory that [`Self::joined`] takes, with the same region once more of other objects.
    pub(crate) fn joined_bytes(regions: &[Region]) -> u64 {
        let [first, end] = Region::bounds_of(regions);
        4 * (0..3).map(|k| u64::from(end[k] - first[k])).product::<u64>()
    }

    /// Returns the voxels of all `regions`; a voxel of several belongs to the object of fewest voxels, as a part lies in a
    /// whole. `None` if there are more than 255 objects.
    pub fn joined(regions: &[Region]) -> Option<Region> {
        let [first, end] = Region::bounds_of(regions);
        let mut counts: BTreeMap<RegionObject, usize> = BTreeMap::new();
        for (_, object) in regions.iter().flat_map(Region::voxels) {
            *counts.entry(object).or_default() += 1;
        }
        let mut objects: Vec<RegionObject> = counts.keys().copied().collect();
        objects.sort_by_key(|object| (counts[object], *object));
        let places =
            (0u16..).zip(&objects).map(|(place, object)| (*object, place)).collect::<BTreeMap<_, _>>();
        (places.len() < usize::from(u16::MAX)).then_some(())?;
        let size = [0, 1, 2].map(|k| end[k] - first[k]);
        let mut least = vec![u16::MAX; size.map(|n| n as usize).iter().product()];
        for (voxel, object) in regions.iter().flat_map(Region::voxels) {
            let at = &mut least[place(voxel, first, size)];
            *at = (*at).min(places[&object]);
        }
        Region::in_box([first, end], |voxel| {
            objects.get(usize::from(least[place(voxel, first, size)])).copied()
        })
    }

    /// Returns the fit that the splats of an object are from; `None` for an object without voxels, whose splats
    /// count in every fit.
    pub fn fit_of(&self, number: u8) -> Option<u8> {
        self.objects.iter().find(|object| object.number == number).map(|object| object.fit)
    }

    /// Returns why a set with this grid must not have this region, or `None` if it may.
    pub(crate) fn defect(&self, grid: Option<&Grid>) -> Option<&'static str> {
        let Some(grid) = grid else { return Some("it has a region and no grid for it") };
        let [_, end] = self.bounds();
        (0..3).any(|k| end[k] > grid.size[k]).then_some("its region lies beyond its grid")
    }
}

/// Returns the voxels of a box, x fastest.
fn voxels_of([first, end]: [[u32; 3]; 2]) -> impl Iterator<Item = [u32; 3]> {
    let row = move |y, z| (first[0]..end[0]).map(move |x| [x, y, z]);
    (first[2]..end[2]).flat_map(move |z| (first[1]..end[1]).flat_map(move |y| row(y, z)))
}

/// Returns the index of a voxel among those of a box.
pub(crate) fn place(voxel: [u32; 3], first: [u32; 3], size: [u32; 3]) -> usize {
    let [x, y, z] = [0, 1, 2].map(|k| (voxel[k] - first[k]) as usize);
    (z * size[1] as usize + y) * size[0] as usize + x
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Returns the region of these voxels, of objects of these numbers.
    pub(crate) fn region_of(voxels: &[([u32; 3], u8)]) -> Region {
        let end = [0, 1, 2].map(|k| voxels.iter().map(|(voxel, _)| voxel[k] + 1).max().unwrap_or(0));
        let number = |at| voxels.iter().find(|(voxel, _)| *voxel == at).map(|(_, number)| *number);
        Region::in_box([[0; 3], end], |at| Some(RegionObject { number: number(at)?, fit: 0 })).expect("few")
    }

    fn of(voxels: &[([usize; 3], u8)]) -> Region {
        let number = |i: usize| {
            let at = [i % 9, i / 9 % 8, i / 72];
            voxels.iter().find(|(voxel, _)| *voxel == at).map(|(_, number)| *number)
        };
        Region::of([9, 8, 7], number).expect("few objects")
    }

    #[test]
    fn a_region_has_the_box_around_its_voxels() {
        let voxels = [([2, 3, 1], 4), ([5, 3, 1], 0), ([3, 6, 6], 4)];
        let region = of(&voxels);
        assert_eq!(region.bounds(), [[2, 3, 1], [6, 7, 7]]);
        assert_eq!(region.objects().iter().map(|o| o.number).collect::<Vec<_>>(), [0, 4]);
        assert_eq!(region.voxel_count(), 3);
        for (voxel, number) in voxels {
            assert_eq!(region.at(voxel.map(|at| at as i64)).map(|o| o.number), Some(number));
        }
        for voxel in [[2, 3, 2], [-1, 3, 1], [8, 3, 1], [i64::MAX, 0, 0]] {
            assert_eq!(region.at(voxel), None, "{voxel:?}");
        }
        let all: Vec<_> = region.voxels().map(|(voxel, object)| (voxel, object.number)).collect();
        assert_eq!(all, voxels.map(|(voxel, number)| (voxel.map(|at| at as u32), number)));
        let grid = |size| Grid { size, world_from_voxel: glam::DAffine3::IDENTITY };
        assert_eq!(region.defect(Some(&grid([6, 7, 7]))), None);
        assert!(region.defect(Some(&grid([6, 7, 6]))).is_some() && region.defect(None).is_some());
        assert_eq!((of(&[]).voxel_count(), of(&[]).bounds()), (0, [[0; 3]; 2]));
        let many = Region::of([256, 1, 1], |i| Some(i as u8));
        assert!(many.is_none() && Region::of([255, 1, 1], |i| Some(i as u8)).is_some());
    }

    #[test]
    fn a_part_of_a_whole_keeps_its_voxels() {
        let [whole, part] = [[([1, 1, 1], 1), ([2, 1, 1], 1)].as_slice(), &[([2, 1, 1], 2)]].map(of);
        let part = part.with_objects(|_, object| Some(RegionObject { fit: 1, ..object })).expect("one");
        let joined = Region::joined(&[whole.clone(), part]).expect("two");
        assert_eq!(joined.at([1, 1, 1]), Some(RegionObject { number: 1, fit: 0 }));
        assert_eq!(joined.at([2, 1, 1]), Some(RegionObject { number: 2, fit: 1 }));
        assert_eq!((joined.fit_of(1), joined.fit_of(2), joined.fit_of(3)), (Some(0), Some(1), None));
        let left = whole.with_objects(|[x, ..], object| (x < 2).then_some(object)).expect("one");
        assert_eq!(left.bounds(), [[1, 1, 1], [2, 2, 2]]);
        let every_second: Vec<_> =
            of(&[([2, 4, 6], 3), ([3, 4, 6], 3), ([4, 2, 0], 5)]).every(2).voxels().collect();
        let object = |number| RegionObject { number, fit: 0 };
        assert_eq!(every_second, [([2, 1, 0], object(5)), ([1, 2, 3], object(3))]);
        assert_eq!(Region::joined(&[]).expect("none").voxel_count(), 0);
    }
}
