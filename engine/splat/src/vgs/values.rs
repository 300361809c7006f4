//! The intensities of a region's voxels as bytes: none is off by more than a bound, and in the rim around the region
//! none by more than twice that.
//!
//! A voxel is predicted from those before it, as `voxel` describes, and the difference is coded as `decisions`.
//! What the decoder has read is what the encoder predicts from, so errors do not add up. All arithmetic is of
//! integers: every machine reads the same numbers.
//!
//! Slabs of [`SLAB`] slices are coded alone: one is read without the others, all are read side by side.

use rayon::prelude::*;

use super::coder::{Channel, Decoder, Encoder};
use super::voxel::Coder;
use crate::voxels::{LARGEST_CODE, RIM_BOUNDS, Sites};

/// Slices of a slab. With 16, files are 1.0 % larger, with 64 0.7 % smaller.
pub const SLAB: usize = 32;
/// Largest size of a code, and of a bound.
pub const LIMIT: i32 = LARGEST_CODE;

/// Voxels of a box, x fastest.
#[derive(Clone, Copy, Debug)]
pub struct Shape<'a> {
    /// Voxels along x, y, z.
    pub size: [usize; 3],
    /// The [`Site`](crate::voxels::Site) of each.
    pub sites: &'a [u8],
}

impl<'a> Shape<'a> {
    /// Returns the shape of a region and its rim.
    pub(crate) fn of(sites: &'a Sites) -> Self {
        Shape { size: sites.size.map(|n| n as usize), sites: &sites.sites }
    }

    /// Returns the slabs, each with the slice before it and the one behind it, where there are such.
    fn slabs(self) -> Vec<Slab<'a>> {
        let [x, y, depth] = self.size;
        let slices: Vec<_> = (0..depth).map(|z| &self.sites[z * x * y..][..x * y]).collect();
        let slab = |start: usize| {
            let end = (start + SLAB).min(depth);
            let before = start.checked_sub(1).map(|z| slices[z]);
            Slab {
                size: [x, y],
                before,
                slices: slices[start..end].to_vec(),
                behind: slices.get(end).copied(),
            }
        };
        (0..depth).step_by(SLAB).map(slab).collect()
    }
}

/// Returns the bytes of each slab, the lowest first; none for a slab without voxels.
///
/// `codes` are those of the voxels that are not outside, x fastest. A decoded code is off by at most `bound`, in the rim
/// by [`RIM_BOUNDS`] times that; coded again it stays what it is.
///
/// # Panics
///
/// If there are more or fewer codes or sites than voxels, or a code or the bound is beyond [`LIMIT`].
pub fn encode(codes: &[i32], shape: Shape<'_>, bound: u32) -> Vec<Vec<u8>> {
    assert_eq!(shape.size.iter().product::<usize>(), shape.sites.len(), "sites");
    assert!(bound <= LIMIT as u32, "bound {bound}");
    assert!(codes.iter().all(|code| (-LIMIT..=LIMIT).contains(code)), "codes");
    let slabs = shape.slabs();
    let mut rest = codes;
    let parts: Vec<_> =
        slabs.iter().map(|slab| rest.split_off(..slab.count()).expect("a code a voxel")).collect();
    assert!(rest.is_empty(), "{} codes too many", rest.len());
    slabs.par_iter().zip(parts).map(|(slab, codes)| slab.encode(codes, bound)).collect()
}

/// Reads what [`encode`] wrote with this shape and bound; `None` if the bytes are none.
pub fn decode<B: AsRef<[u8]> + Sync>(bytes: &[B], shape: Shape<'_>, bound: u32) -> Option<Vec<i32>> {
    let slabs = shape.slabs();
    if bytes.len() != slabs.len() || bound > LIMIT as u32 {
        return None;
    }
    let parts: Option<Vec<_>> =
        slabs.par_iter().zip(bytes).map(|(slab, bytes)| slab.decode(bytes.as_ref(), bound)).collect();
    Some(parts?.concat())
}

/// Returns the number of voxels of a slab, the `slab`-th from the lowest.
pub(crate) fn count(shape: Shape<'_>, slab: usize) -> usize {
    shape.slabs().get(slab).map_or(0, Slab::count)
}

/// Reads one slab of what [`encode`] wrote, the `slab`-th from the lowest.
pub fn decode_slab(bytes: &[u8], slab: usize, shape: Shape<'_>, bound: u32) -> Option<Vec<i32>> {
    let slabs = shape.slabs();
    slabs.get(slab).filter(|_| bound <= LIMIT as u32)?.decode(bytes, bound)
}

/// Some slices.
struct Slab<'a> {
    size: [usize; 2],
    slices: Vec<&'a [u8]>,
    before: Option<&'a [u8]>,
    behind: Option<&'a [u8]>,
}

impl Slab<'_> {
    fn count(&self) -> usize {
        self.slices.iter().map(|slice| slice.iter().filter(|&&site| site > 0).count()).sum()
    }

    fn encode(&self, codes: &[i32], bound: u32) -> Vec<u8> {
        if codes.is_empty() {
            return Vec::new();
        }
        let mut out = Encoder::default();
        self.walk(&mut out, bound, Some(codes)).expect("codes within the limit");
        out.finish()
    }

    fn decode(&self, bytes: &[u8], bound: u32) -> Option<Vec<i32>> {
        if self.count() == 0 {
            return bytes.is_empty().then(Vec::new);
        }
        let mut input = Decoder::new(bytes);
        let codes = self.walk(&mut input, bound, None)?;
        (!input.is_beyond()).then_some(codes)
    }

    /// Writes `codes`, or reads them, and returns what is read.
    fn walk<C: Channel>(&self, c: &mut C, bound: u32, codes: Option<&[i32]>) -> Option<Vec<i32>> {
        let rim = (bound * RIM_BOUNDS).min(LIMIT as u32);
        let mut coder = Coder::new(self.size, [rim, bound]);
        let mut out: Vec<i32> = Vec::new();
        coder.load(self.before);
        coder.load(self.slices.first().copied());
        for (z, slice) in self.slices.iter().enumerate() {
            coder.next(self.slices.get(z + 1).copied().or(self.behind));
            for at in (0..slice.len()).filter(|&at| slice[at] > 0) {
                let wanted = codes.map_or(0, |codes| codes[out.len()]);
                out.push(coder.voxel(c, [at % self.size[0], at / self.size[0]], wanted)?);
            }
        }
        Some(out)
    }
}

#[cfg(test)]
mod tests {
    use flate2::Crc;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;
    use crate::vgs::decisions::LARGEST;

    /// Returns sites of a box, of which about `part` is inside or, in stripes, rim, in lumps, and codes of that many
    /// voxels: waves of 300 and noise.
    fn case(size: [usize; 3], part: f64, noise: i32) -> (Vec<u8>, Vec<i32>) {
        let mut rng = Pcg64::seed_from_u64(11);
        let wave = |x: usize, y: usize, z: usize| {
            [x, y, z].map(|index| ((index * 41 % 640) as i32 - 320).abs() - 160).iter().sum::<i32>()
        };
        let (mut sites, mut codes) = (Vec::new(), Vec::new());
        for z in 0..size[2] {
            for y in 0..size[1] {
                for x in 0..size[0] {
                    let inside = f64::from(wave(y, z, x) + 480) <= 960.0 * part;
                    sites.push(if inside { 1 + u8::from(x / 9 % 3 > 0) } else { 0 });
                    if inside {
                        codes.push(wave(x, y, z) + rng.random_range(-noise..=noise));
                    }
                }
            }
        }
        (sites, codes)
    }

    fn bytes(slabs: &[Vec<u8>]) -> usize {
        slabs.iter().map(Vec::len).sum()
    }

    /// Checks that codes come back within the bound.
    fn check(size: [usize; 3], sites: &[u8], codes: &[i32], bound: u32) -> Vec<Vec<u8>> {
        let shape = Shape { size, sites };
        let coded = encode(codes, shape, bound);
        let back = decode(&coded, shape, bound).expect("what was encoded");
        assert_eq!(back.len(), codes.len());
        let there = sites.iter().filter(|&&site| site > 0);
        for ((a, b), &site) in back.iter().zip(codes).zip(there) {
            let most = if site == 1 { RIM_BOUNDS * bound } else { bound };
            assert!(a.abs_diff(*b) <= most, "{a} for {b} at {site} with {bound} in {size:?}");
        }
        coded
    }

    #[test]
    fn no_code_is_off_by_more_than_the_bound() {
        let sizes = [[1, 1, 1], [40, 30, 70], [90, 1, 40], [1, 60, 33], [200, 50, 1], [1, 1, 100], [7, 0, 3]];
        for size in sizes {
            for part in [0.0, 0.4, 1.0] {
                let (sites, codes) = case(size, part, 20);
                for bound in [0, 1, 30, 700, LIMIT as u32] {
                    let coded = check(size, &sites, &codes, bound);
                    assert_eq!(coded.len(), size[2].div_ceil(SLAB));
                }
            }
        }
    }

    #[test]
    fn codes_of_any_size_come_back() {
        let mut rng = Pcg64::seed_from_u64(13);
        for largest in [1, 100_000, LIMIT] {
            for rare in [0.01, 1.0] {
                let sites = vec![2; 20 * 20 * 20];
                let code = |_| match rng.random_bool(rare) {
                    true => [-largest, largest, rng.random_range(-largest..=largest)][rng.random_range(0..3)],
                    false => 5,
                };
                let codes: Vec<_> = (0..sites.len()).map(code).collect();
                for bound in [0, 9, 1 << 20, LIMIT as u32] {
                    check([20; 3], &sites, &codes, bound);
                }
            }
        }
    }

    #[test]
    fn bytes_are_few() {
        let (sites, codes) = case([60, 60, 40], 0.6, 20);
        let per_voxel =
            |bound| 8.0 * bytes(&check([60, 60, 40], &sites, &codes, bound)) as f64 / codes.len() as f64;
        // The noise is of 41 values: 5.36 bits.
        let (lossless, near) = (per_voxel(0), per_voxel(4));
        assert!((5.3..6.2).contains(&lossless), "{lossless} bits");
        assert!((1.9..3.1).contains(&near), "{near} bits");
        let flat = bytes(&check([60, 60, 40], &sites, &vec![-1000; codes.len()], 0));
        assert!(flat < 200, "{flat} bytes");
    }

    #[test]
    fn a_slab_is_read_alone() {
        let size = [30, 20, 100];
        let (sites, codes) = case(size, 0.5, 9);
        let shape = Shape { size, sites: &sites };
        let coded = encode(&codes, shape, 2);
        let all = decode(&coded, shape, 2).expect("what was encoded");
        let parts: Vec<_> = (0..4).map(|k| decode_slab(&coded[k], k, shape, 2).expect("a slab")).collect();
        assert_eq!(parts.concat(), all);
        assert_eq!(decode_slab(&coded[0], 4, shape, 2), None, "no such slab");
        assert_eq!(decode_slab(&coded[0][..coded[0].len() / 2], 0, shape, 2), None, "half of the bytes");
        assert_eq!(decode(&coded[..3], shape, 2), None, "a slab is missing");
    }

    /// Files are read for ever: other bytes here are another format.
    #[test]
    fn bytes_are_the_same_on_every_machine() {
        let (sites, codes) = case([50, 40, 40], 0.5, 30);
        let sums = [0, 3, 60].map(|bound| {
            let mut sum = Crc::new();
            check([50, 40, 40], &sites, &codes, bound).iter().for_each(|slab| sum.update(slab));
            sum.sum()
        });
        assert_eq!(sums, [656_684_080, 3_395_664_462, 4_017_939_687]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200))]

        #[test]
        fn any_bytes_are_safe(
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..6),
            length in any::<prop::sample::Index>(),
            cut in any::<bool>(),
            random in prop::collection::vec(any::<u8>(), 0..400),
            bound in prop::sample::select(vec![0, 5, 1000, LIMIT as u32, u32::MAX]),
        ) {
            let size = [12, 9, 20];
            let (sites, codes) = case(size, 0.7, 40);
            let shape = Shape { size, sites: &sites };
            let mut slab = encode(&codes, shape, 5).remove(0);
            for (at, byte) in changes {
                let at = at.index(slab.len());
                slab[at] = byte;
            }
            if cut {
                slab.truncate(length.index(slab.len()));
            }
            for bytes in [slab, random] {
                if let Some(read) = decode(&[bytes], shape, bound) {
                    prop_assert_eq!(read.len(), codes.len());
                    prop_assert!(read.iter().all(|code| i64::from(*code).abs() <= LARGEST));
                }
            }
        }
    }
}
