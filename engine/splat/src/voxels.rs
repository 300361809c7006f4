//! Intensities of voxels, of a set that has these in place of splats.

use std::sync::Arc;

use super::Region;
use super::region::place;

/// Greatest size of a code.
pub const LARGEST_CODE: i32 = 1 << 26;
/// Largest bound: in the rim, and of a code of half the size, it stays within a code.
pub(crate) const LARGEST_BOUND: u32 = LARGEST_CODE as u32 / (2 * RIM_BOUNDS);
/// Stands where nothing is known.
const NONE: i32 = i32::MIN;
/// The bound of the rim around a region, in that of the region: the rim is only there for interpolation.
pub const RIM_BOUNDS: u32 = 2;
/// Cells of a bound in which intensities are rounded that are no whole numbers: the bound is 8½ of them.
const CELLS_A_BOUND: u32 = 8;

/// Where a voxel is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Site {
    /// Neither in the region nor beside it.
    Outside = 0,
    /// One of the 26 neighbours of a voxel of the region.
    Rim = 1,
    /// In the region.
    Inside = 2,
}

/// What an intensity is rounded to, and by how much it may be off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Precision {
    /// The intensity that a code of 1 stands for.
    pub step: f64,
    /// Greatest error of a code in the region.
    pub codes: u32,
    /// True if the intensities were whole numbers, so that nothing was rounded before it became a code.
    pub whole: bool,
}

impl Precision {
    /// Returns how intensities are rounded of which none may be off by more than `bound`; whole numbers, if `whole`,
    /// are not rounded beside. `None` if there is no such: a bound below 0 or not finite, or of 0 for others.
    pub fn within(bound: f64, whole: bool) -> Option<Self> {
        if !(bound >= 0.0 && bound < f64::from(LARGEST_BOUND)) {
            return None;
        }
        match whole {
            true => Some(Precision { step: 1.0, codes: bound as u32, whole }),
            false => (bound > 0.0).then_some(Precision {
                step: bound / (f64::from(CELLS_A_BOUND) + 0.5),
                codes: CELLS_A_BOUND,
                whole,
            }),
        }
    }

    /// Returns the greatest error of an intensity in the region.
    pub fn bound(&self) -> f64 {
        let rounded = if self.whole { 0.0 } else { 0.5 };
        self.step * (f64::from(self.codes) + rounded)
    }
}

/// V of the voxels of a region and of its rim, for a set that has them in place of splats.
#[derive(Clone, Debug, PartialEq)]
pub struct Voxels {
    /// The fit of the [region](Region)'s objects that these are for.
    pub fit: u8,
    /// How the intensities are rounded.
    pub precision: Precision,
    /// First voxel of the box.
    pub(crate) first: [u32; 3],
    /// Voxels of the box along x, y, z.
    pub(crate) size: [u32; 3],
    /// The code of each voxel of the box, x fastest.
    pub(crate) codes: Arc<[i32]>,
}

impl Voxels {
    /// Creates those of the fit 0 of a region of a grid of `size` voxels; `value` returns the intensity of each voxel of
    /// the region and its rim. An intensity that is not finite counts as 0.
    pub fn of(
        region: &Region,
        size: [u32; 3],
        precision: Precision,
        value: impl Fn([u32; 3]) -> f64,
    ) -> Self {
        let sites = Sites::of(region, 0, size);
        let code = |(i, &site): (usize, &u8)| {
            if site == Site::Outside as u8 {
                return NONE;
            }
            let code = (value(sites.voxel(i)) / precision.step).round();
            let most = f64::from(LARGEST_CODE / 2);
            if code.is_finite() { code.clamp(-most, most) as i32 } else { 0 }
        };
        let codes = sites.sites.iter().enumerate().map(code).collect();
        Voxels { fit: 0, precision, first: sites.first, size: sites.size, codes }
    }

    /// Returns V of a voxel; `None` where it is not known.
    pub fn at(&self, voxel: [i64; 3]) -> Option<f64> {
        self.code(voxel).map(|code| f64::from(code) * self.precision.step)
    }

    /// Returns the least and the greatest V, that of the rim included; `None` without any.
    pub fn range(&self) -> Option<[f64; 2]> {
        let known = || self.codes.iter().copied().filter(|&code| code != NONE);
        let range = known().min().zip(known().max());
        range.map(|(low, high)| [low, high].map(|code| f64::from(code) * self.precision.step))
    }

    pub(crate) fn code(&self, voxel: [i64; 3]) -> Option<i32> {
        let inside =
            (0..3).all(|k| (0..i64::from(self.size[k])).contains(&(voxel[k] - i64::from(self.first[k]))));
        inside.then_some(())?;
        let code = self.codes[place(voxel.map(|at| at as u32), self.first, self.size)];
        (code != NONE).then_some(code)
    }

    /// Creates those of these codes, one for each site that is not outside.
    pub(crate) fn of_codes(fit: u8, precision: Precision, sites: Sites, codes: &[i32]) -> Self {
        let mut rest = codes.iter().copied();
        let code = |&site: &u8| if site == Site::Outside as u8 { NONE } else { rest.next().unwrap_or(NONE) };
        let codes = sites.sites.iter().map(code).collect();
        Voxels { fit, precision, first: sites.first, size: sites.size, codes }
    }
}

/// Where the voxels of a box are: that around the region of a fit and its rim.
pub(crate) struct Sites {
    pub(crate) first: [u32; 3],
    pub(crate) size: [u32; 3],
    /// [`Site`] of each voxel, x fastest.
    pub(crate) sites: Vec<u8>,
}

impl Sites {
    /// Returns those of the region's objects of a fit, in a grid of `size` voxels.
    pub(crate) fn of(region: &Region, fit: u8, size: [u32; 3]) -> Self {
        let [first, end] = region.bounds();
        let low = first.map(|at| at.saturating_sub(1));
        let high: [u32; 3] = std::array::from_fn(|k| (end[k] + 1).min(size[k]).max(low[k]));
        let own: Vec<bool> = region.objects().iter().map(|object| object.fit == fit).collect();
        let is_empty = region.objects().is_empty();
        let extent: [u32; 3] = if is_empty { [0; 3] } else { std::array::from_fn(|k| high[k] - low[k]) };
        let size @ [nx, ny, nz] = extent.map(|n| n as usize);
        let mut sites = vec![0; nx * ny * nz];
        region.copy_kinds((&mut sites, size), [0, 1, 2].map(|k| (first[k] - low[k]) as usize));
        for site in &mut sites {
            let is_inside = *site > 0 && own[usize::from(*site) - 1];
            *site = if is_inside { Site::Inside } else { Site::Outside } as u8;
        }
        // One axis after the other, so that corners are reached.
        for (step, n) in [(1, nx), (nx, ny), (nx * ny, nz)] {
            let before = sites.clone();
            for (i, site) in sites.iter_mut().enumerate().filter(|(_, site)| **site == Site::Outside as u8) {
                let at = i / step % n;
                let is_near = at > 0 && before[i - step] > 0 || at + 1 < n && before[i + step] > 0;
                *site = if is_near { Site::Rim as u8 } else { *site };
            }
        }
        Sites { first: low, size: extent, sites }
    }

    /// Returns the voxel of an index.
    pub(crate) fn voxel(&self, i: usize) -> [u32; 3] {
        let [nx, ny, _] = self.size.map(|n| n as usize);
        let at = [i % nx, i / nx % ny, i / (nx * ny)];
        std::array::from_fn(|k| self.first[k] + at[k] as u32)
    }

    /// Returns the voxels that are not outside, x fastest.
    pub(crate) fn voxels(&self) -> impl Iterator<Item = [u32; 3]> + '_ {
        let there = self.sites.iter().enumerate().filter(|(_, site)| **site != Site::Outside as u8);
        there.map(|(i, _)| self.voxel(i))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::RegionObject;
    use crate::region::tests::region_of;

    #[test]
    fn the_rim_is_around_corners_and_ends_at_faces() {
        let region = region_of(&[([0, 2, 3], 1)]);
        let sites = Sites::of(&region, 0, [9, 4, 4]);
        assert_eq!((sites.first, sites.size), ([0, 1, 2], [2, 3, 2]));
        let count = |site: Site| sites.sites.iter().filter(|&&of| of == site as u8).count();
        assert_eq!((count(Site::Inside), count(Site::Rim)), (1, 11));
        let apart = region_of(&[([1, 1, 1], 1), ([4, 1, 1], 2)]);
        let fits = apart.with_objects(|_, o| Some(RegionObject { fit: o.number - 1, ..o })).expect("two");
        for (fit, x) in [(0, 1), (1, 4)] {
            let inside: Vec<_> = Sites::of(&fits, fit, [9; 3]).voxels().collect();
            assert_eq!(inside.len(), 27);
            assert!(inside.iter().all(|voxel| voxel[0].abs_diff(x) <= 1));
        }
        let none = Sites::of(&region_of(&[]), 0, [4; 3]);
        assert_eq!((none.size, none.voxels().count()), ([0; 3], 0));
    }

    #[test]
    fn values_are_rounded_within_the_bound() {
        let region = region_of(&[([1, 1, 1], 1), ([2, 1, 1], 1)]);
        let value = |[x, y, z]: [u32; 3]| f64::from(x) * 10.3 - f64::from(y * z);
        let cases = [(30.0, true, 1.0, 30), (2.6, true, 1.0, 2), (0.0, true, 1.0, 0), (8.5, false, 1.0, 8)];
        for (bound, whole, step, codes) in cases {
            let precision = Precision::within(bound, whole).expect("a bound");
            assert_eq!(precision, Precision { step, codes, whole });
            assert!(precision.bound() <= bound);
        }
        let precision = Precision::within(0.17, false).expect("a bound");
        assert!((precision.bound() - 0.17).abs() < 1e-12);
        let voxels = Voxels::of(&region, [4; 3], precision, value);
        for (voxel, _) in region.voxels() {
            let found = voxels.at(voxel.map(i64::from)).expect("in the region");
            assert!((found - value(voxel)).abs() <= precision.step / 2.0 + 1e-9);
        }
        assert_eq!((voxels.at([-1, 0, 0]), voxels.at([3, 3, 1])), (None, None));
        let bad = [(f64::NAN, true), (-1.0, true), (1e9, true), (0.0, false)];
        assert!(bad.iter().all(|&(bound, whole)| Precision::within(bound, whole).is_none()));
    }
}
