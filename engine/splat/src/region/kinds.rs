//! Voxels of a grid and the object that each belongs to.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rayon::prelude::*;

use crate::Grid;

/// Most objects of a region.
pub(super) const MOST_KINDS: usize = u8::MAX as usize;
/// Edge of a tile, voxels.
const TILE: usize = 16;
/// Voxels of a tile.
const TILE_VOXELS: usize = TILE * TILE * TILE;

/// An object of a region.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct RegionObject {
    /// The number of the object: the label of its splats, or 0 for splats without labels.
    pub number: u8,
    /// The fit that its splats are from, counted from 0: V of a voxel is that of the splats of one fit, since
    /// splats reach beyond the region that they were fitted to.
    pub fit: u8,
}

/// Voxels of a grid and the object that each belongs to; the others belong to none. Memory goes with the tiles of 16³
/// voxels that hold any, so that parts of a large grid may lie far apart.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Region {
    /// The first voxel of the box around all voxels, and the one behind its last.
    pub(super) bounds: [[u32; 3]; 2],
    /// The kind of each voxel of the tiles that hold any, x fastest: 0 is none, k the object k − 1.
    tiles: Arc<BTreeMap<Place, Box<[u8]>>>,
    /// The objects, ascending.
    pub(super) objects: Vec<RegionObject>,
}

/// Indices of a tile along z, y, x.
type Place = [u32; 3];

impl Region {
    /// Creates the region of the voxels of a grid of `size` voxels for which `number` returns the number of an
    /// object; it is told a voxel's index, x fastest. `None` if there are more than 255 objects.
    pub fn of(size: [usize; 3], number: impl Fn(usize) -> Option<u8> + Sync) -> Option<Region> {
        let voxels = [[0; 3], size.map(|n| n as u32)];
        Region::in_box(voxels, |[x, y, z]| {
            let [x, y, z] = [x, y, z].map(|at| at as usize);
            number((z * size[1] + y) * size[0] + x).map(|number| RegionObject { number, fit: 0 })
        })
    }

    /// Creates the region of the voxels of a box, given by its first voxel and the one behind its last, that belong
    /// to an object; `None` if there are more than 255.
    pub(crate) fn in_box(
        voxels: [[u32; 3]; 2],
        object: impl Fn([u32; 3]) -> Option<RegionObject> + Sync,
    ) -> Option<Region> {
        let [first, end] = voxels;
        let is_in = |voxel: [u32; 3]| (0..3).all(|k| (first[k]..end[k]).contains(&voxel[k]));
        Region::of_tiles(tiles_over(voxels), |place| {
            let object = &object;
            move |i| Some(voxel_of(place, i)).filter(|&voxel| is_in(voxel)).and_then(object)
        })
    }

    /// Creates the region of the voxels of these tiles that belong to an object, by their indices in the tile; `None` if
    /// there are more than 255.
    fn of_tiles<Object: Fn(usize) -> Option<RegionObject>>(
        places: impl IntoIterator<Item = Place>,
        of_tile: impl Fn(Place) -> Object + Sync,
    ) -> Option<Region> {
        let places: Vec<Place> = places.into_iter().collect();
        let found: Option<Vec<_>> = places
            .into_par_iter()
            .map(|place| (place, Tile::of(of_tile(place))))
            .filter(|(_, tile)| tile.as_ref().is_none_or(|tile| !tile.objects.is_empty()))
            .map(|(place, tile)| Some((place, tile?)))
            .collect();
        let mut found = found?;
        let all: BTreeSet<RegionObject> = found.iter().flat_map(|(_, tile)| tile.objects.clone()).collect();
        let objects: Vec<RegionObject> = all.into_iter().collect();
        (objects.len() <= MOST_KINDS).then_some(())?;
        let boxes = found.par_iter_mut().map(|(place, tile)| {
            let kind = |object| objects.binary_search(object).map_or(0, |at| at as u8 + 1);
            let kinds: Vec<u8> = tile.objects.iter().map(kind).collect();
            let mut bounds = NOWHERE;
            for (i, own) in tile.kinds.iter_mut().enumerate().filter(|(_, kind)| **kind > 0) {
                *own = kinds[usize::from(*own) - 1];
                let voxel = voxel_of(*place, i);
                bounds = around(bounds, [voxel, voxel.map(|at| at.saturating_add(1))]);
            }
            bounds
        });
        let bounds = boxes.reduce(|| NOWHERE, around);
        let bounds = if found.is_empty() { [[0; 3]; 2] } else { bounds };
        let tiles = found.into_iter().map(|(place, tile)| (place, tile.kinds)).collect();
        Some(Region { bounds, tiles: Arc::new(tiles), objects })
    }

    /// Returns the first voxel of the box around all voxels, and the one behind its last.
    pub fn bounds(&self) -> [[u32; 3]; 2] {
        self.bounds
    }

    /// Returns the voxels of the box around all voxels along x, y, z.
    pub fn size(&self) -> [usize; 3] {
        let [first, end] = self.bounds;
        [0, 1, 2].map(|k| (end[k] - first[k]) as usize)
    }

    /// Returns the objects, ascending; all have voxels.
    pub fn objects(&self) -> &[RegionObject] {
        &self.objects
    }

    /// Returns the kind of each voxel of [`Self::bounds`], x fastest: 0 is no object, k is [`Self::objects`]`[k − 1]`.
    pub fn kinds(&self) -> Vec<u8> {
        let mut kinds = vec![0; self.size().iter().product()];
        self.copy_kinds((&mut kinds, self.size()), [0; 3]);
        kinds
    }

    /// Copies the kinds of the voxels of [`Self::bounds`] into those of a box of `size` voxels, x fastest, from its voxel
    /// `to` on; what belongs to no object is left.
    ///
    /// # Panics
    /// If they reach beyond it.
    pub fn copy_kinds(&self, (kinds, size): (&mut [u8], [usize; 3]), to: [usize; 3]) {
        let first = self.bounds[0];
        for (&place, tile) in self.tiles.iter() {
            for (i, &kind) in tile.iter().enumerate().filter(|(_, kind)| **kind > 0) {
                let voxel = voxel_of(place, i);
                let [x, y, z] = [0, 1, 2].map(|k| (voxel[k] - first[k]) as usize + to[k]);
                kinds[(z * size[1] + y) * size[0] + x] = kind;
            }
        }
    }

    /// Copies the kinds of the voxels of some slices of [`Self::bounds`], x fastest; what belongs to no object is left.
    pub(super) fn copy_slices(&self, slices: std::ops::Range<usize>, kinds: &mut [u8]) {
        let ([nx, ny, _], [x0, y0, z0]) = (self.size(), self.bounds[0]);
        let z = [slices.start, slices.end].map(|z| z as u32 + z0);
        let tile = |z: u32| [z / TILE as u32, 0, 0];
        for (&place, tile) in self.tiles.range(tile(z[0])..tile(z[1] + TILE as u32 - 1)) {
            for (i, &kind) in tile.iter().enumerate().filter(|(_, kind)| **kind > 0) {
                let [x, y, at] = voxel_of(place, i);
                if (z[0]..z[1]).contains(&at) {
                    kinds[((at - z[0]) as usize * ny + (y - y0) as usize) * nx + (x - x0) as usize] = kind;
                }
            }
        }
    }

    /// Returns the object of a voxel; `None` if it belongs to none.
    pub fn at(&self, voxel: [i64; 3]) -> Option<RegionObject> {
        let [x, y, z] = voxel.map(|at| u32::try_from(at).ok());
        self.object([x?, y?, z?])
    }

    fn object(&self, voxel: [u32; 3]) -> Option<RegionObject> {
        let [x, y, z] = voxel;
        let tile = self.tiles.get(&[z, y, x].map(|at| at / TILE as u32))?;
        let [x, y, z] = [x, y, z].map(|at| at as usize % TILE);
        self.of_kind(tile[(z * TILE + y) * TILE + x])
    }

    fn of_kind(&self, kind: u8) -> Option<RegionObject> {
        self.objects.get(usize::from(kind).wrapping_sub(1)).copied()
    }

    /// Returns the number of voxels of each object.
    pub fn counts(&self) -> Vec<usize> {
        let mut counts = [0; MOST_KINDS + 1];
        for &kind in self.tiles.values().flatten() {
            counts[usize::from(kind)] += 1;
        }
        counts[1..=self.objects.len()].to_vec()
    }

    /// Returns the number of voxels.
    pub fn voxel_count(&self) -> usize {
        self.counts().iter().sum()
    }

    /// Returns the voxels, each with its object: one tile after the other, and x fastest in a tile.
    pub fn voxels(&self) -> impl Iterator<Item = ([u32; 3], RegionObject)> + '_ {
        self.tiles.iter().flat_map(move |(&place, tile)| {
            (0..TILE_VOXELS).filter_map(move |i| Some((voxel_of(place, i), self.of_kind(tile[i])?)))
        })
    }

    /// Returns the region with other objects, `None` for voxels that leave it; `None` if there are more than 255.
    pub fn with_objects(
        &self,
        object: impl Fn([u32; 3], RegionObject) -> Option<RegionObject> + Sync,
    ) -> Option<Region> {
        Region::of_tiles(self.tiles.keys().copied(), |place| {
            let (object, kinds) = (&object, &self.tiles[&place]);
            move |i| object(voxel_of(place, i), self.of_kind(kinds[i])?)
        })
    }

    /// Returns the region on a larger grid, whose voxel `first` is the first of this one.
    pub fn within(self, first: [u32; 3]) -> Region {
        let moved = |at: [u32; 3]| [0, 1, 2].map(|k| at[k].saturating_add(first[k]));
        let there = |voxel: [u32; 3]| {
            let [x, y, z] = [0, 1, 2].map(|k| voxel[k].checked_sub(first[k]));
            self.object([x?, y?, z?])
        };
        self.taken(|voxels| voxels.map(moved), there)
    }

    /// Returns the region on a grid that has every `step`-th voxel along each axis.
    pub fn every(&self, step: u32) -> Region {
        let coarse =
            |[first, end]: [[u32; 3]; 2]| [first.map(|at| at / step), end.map(|at| at.div_ceil(step))];
        let there = |voxel: [u32; 3]| {
            let [x, y, z] = voxel.map(|at| at.checked_mul(step));
            self.object([x?, y?, z?])
        };
        self.taken(coarse, there)
    }

    /// Returns the region of other voxels of the same objects; `of` returns the box in which those of a box of this region
    /// are.
    fn taken(
        &self,
        of: impl Fn([[u32; 3]; 2]) -> [[u32; 3]; 2],
        object: impl Fn([u32; 3]) -> Option<RegionObject> + Sync,
    ) -> Region {
        let voxels = |&place: &Place| {
            [voxel_of(place, 0), voxel_of(place, TILE_VOXELS - 1).map(|at| at.saturating_add(1))]
        };
        let places: BTreeSet<Place> =
            self.tiles.keys().flat_map(|place| tiles_over(of(voxels(place)))).collect();
        let found = Region::of_tiles(places, |place| {
            let object = &object;
            move |i| object(voxel_of(place, i))
        });
        // There are no more objects than before.
        found.unwrap_or_default()
    }

    /// Returns the region with other numbers of objects, which `number` returns for one voxel after the other, in the order
    /// of [`Self::voxels`]; `None` if there are more than 255.
    pub fn renumbered(&self, mut number: impl FnMut(u8) -> u8) -> Option<Region> {
        let mut numbers: BTreeMap<Place, Vec<u8>> = BTreeMap::new();
        for (&place, kinds) in self.tiles.iter() {
            let of = |&kind: &u8| self.of_kind(kind).map_or(0, |object| number(object.number));
            numbers.insert(place, kinds.iter().map(of).collect());
        }
        Region::of_tiles(self.tiles.keys().copied(), |place| {
            let (kinds, numbers) = (&self.tiles[&place], &numbers[&place]);
            move |i| Some(RegionObject { number: numbers[i], ..self.of_kind(kinds[i])? })
        })
    }

    /// Returns the voxels of all `regions`; a voxel of several belongs to the object of fewest voxels, as a part lies in a
    /// whole. `None` if there are more than 255 objects.
    pub fn joined(regions: &[Region]) -> Option<Region> {
        let mut counts: BTreeMap<RegionObject, usize> = BTreeMap::new();
        for region in regions {
            for (object, count) in region.objects.iter().zip(region.counts()) {
                *counts.entry(*object).or_default() += count;
            }
        }
        let mut objects: Vec<RegionObject> = counts.keys().copied().collect();
        objects.sort_by_key(|object| (counts[object], *object));
        let ranks: BTreeMap<RegionObject, usize> =
            objects.iter().enumerate().map(|(rank, object)| (*object, rank)).collect();
        let ranks = |region: &Region| region.objects.iter().map(|object| ranks[object]).collect();
        let ranks: Vec<Vec<usize>> = regions.iter().map(ranks).collect();
        let places: BTreeSet<Place> =
            regions.iter().flat_map(|region| region.tiles.keys().copied()).collect();
        Region::of_tiles(places, |place| {
            let there = regions.iter().zip(&ranks);
            let there = there.filter_map(|(region, ranks)| Some((region.tiles.get(&place)?, ranks)));
            let (there, objects) = (there.collect::<Vec<_>>(), &objects);
            move |i| {
                let found =
                    there.iter().filter_map(|(tile, ranks)| ranks.get(usize::from(tile[i]).wrapping_sub(1)));
                found.min().map(|&rank| objects[rank])
            }
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

/// The objects of the voxels of a tile.
struct Tile {
    /// 0 is none, k the object k − 1.
    kinds: Box<[u8]>,
    /// The objects, as they were found.
    objects: Vec<RegionObject>,
}

impl Tile {
    /// Returns `None` if there are more than 255 objects.
    fn of(object: impl Fn(usize) -> Option<RegionObject>) -> Option<Tile> {
        let mut tile = Tile { kinds: vec![0; TILE_VOXELS].into(), objects: Vec::new() };
        for (i, kind) in tile.kinds.iter_mut().enumerate() {
            let Some(object) = object(i) else { continue };
            let known = tile.objects.iter().position(|own| *own == object);
            *kind = u8::try_from(known.unwrap_or(tile.objects.len()) + 1).ok()?;
            if known.is_none() {
                tile.objects.push(object);
            }
        }
        Some(tile)
    }
}

/// The voxels of a region as they are read.
#[derive(Default)]
pub(super) struct Tiles(BTreeMap<Place, Box<[u8]>>);

impl Tiles {
    /// Returns the bytes of memory that they take.
    pub(super) fn bytes(&self) -> u64 {
        (self.0.len() * TILE_VOXELS) as u64
    }

    /// Puts the kinds of a row of voxels from `first` on.
    pub(super) fn put(&mut self, [x, y, z]: [u32; 3], kinds: &[u8]) {
        let mut rest = kinds;
        let mut x = x as usize;
        while !rest.is_empty() {
            let (run, behind) = rest.split_at(rest.len().min(TILE - x % TILE));
            if run.iter().any(|&kind| kind > 0) {
                let place = [z, y, x as u32].map(|at| at / TILE as u32);
                let tile = self.0.entry(place).or_insert_with(|| vec![0; TILE_VOXELS].into());
                let [y, z] = [y, z].map(|at| at as usize % TILE);
                tile[(z * TILE + y) * TILE + x % TILE..][..run.len()].copy_from_slice(run);
            }
            (rest, x) = (behind, x + run.len());
        }
    }

    /// Returns the region; `None` if not every object and every face of the box has voxels.
    pub(super) fn region(self, bounds: [[u32; 3]; 2], objects: Vec<RegionObject>) -> Option<Region> {
        let read = Region { bounds, tiles: Arc::new(self.0), objects };
        let tight = read.with_objects(|_, object| Some(object))?;
        (tight.bounds == read.bounds && tight.objects == read.objects).then_some(read)
    }
}

/// A box without voxels.
const NOWHERE: [[u32; 3]; 2] = [[u32::MAX; 3], [0; 3]];

/// Returns the box around two.
fn around([a, b]: [[u32; 3]; 2], [c, d]: [[u32; 3]; 2]) -> [[u32; 3]; 2] {
    [[0, 1, 2].map(|k| a[k].min(c[k])), [0, 1, 2].map(|k| b[k].max(d[k]))]
}

/// Returns the tiles that hold voxels of a box, as they are ordered.
fn tiles_over([first, end]: [[u32; 3]; 2]) -> impl Iterator<Item = Place> {
    let [x, y, z] = [0, 1, 2].map(|k| first[k] / TILE as u32..end[k].div_ceil(TILE as u32));
    z.flat_map(move |z| {
        let x = x.clone();
        y.clone().flat_map(move |y| x.clone().map(move |x| [z, y, x]))
    })
}

/// Returns the voxel of a tile with this index.
fn voxel_of([z, y, x]: Place, i: usize) -> [u32; 3] {
    let at = [i % TILE, i / TILE % TILE, i / (TILE * TILE)];
    let first = [x, y, z].map(|tile| tile * TILE as u32);
    [0, 1, 2].map(|k| first[k] + at[k] as u32)
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
