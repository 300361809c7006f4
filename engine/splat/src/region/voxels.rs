//! The bytes of a region.
//!
//! Numbers of seven bits a byte, the least first (LEB128): the first voxel of the box and its size, along x, y, z
//! each, the number of objects and for each its number and its fit. Then one stream of the range coder:
//!
//! - for each brick of 8³ voxels whether all its voxels are of one kind, and of which;
//! - for each voxel of the other bricks, x fastest, whether it is of the kind of the voxel before it in its row; if
//!   it is not, whether it is of the kind of the next neighbour that has another, and so on; at last its kind.
//!
//! The first of these bits has a model for each pattern of fourteen neighbours that come before the voxel: three in
//! its row, six in the rows before, five in the slice before (after JBIG2).

use super::kinds::{MOST_KINDS, Region, RegionObject, Tiles};
use crate::vgs::coder::{Bit, Decoder, Encoder, Tree};
use base::error::Result;

/// Edge of a brick, voxels.
const BRICK: usize = 8;
/// Most voxels of a byte: a claim of more is none of a file that was written.
const MOST_A_BYTE: u64 = 1 << 16;
/// Bytes of memory that are asked for at a time while voxels are read.
const ROOM: u64 = 1 << 26;
/// Fewest bytes that may stand for a box of any size.
const LEAST_BYTES: u64 = 1 << 10;
/// The neighbours of a voxel that come before it: steps along x, y, z.
const NEIGHBOURS: [[isize; 3]; 14] = [
    [-1, 0, 0],
    [0, -1, 0],
    [0, 0, -1],
    [-2, 0, 0],
    [-3, 0, 0],
    [-1, -1, 0],
    [1, -1, 0],
    [-2, -1, 0],
    [2, -1, 0],
    [0, -2, 0],
    [1, 0, -1],
    [-1, 0, -1],
    [0, 1, -1],
    [0, -1, -1],
];
/// Neighbours whose kinds are tried before a kind is spelt out.
const TRIED: usize = 3;
/// Voxels of no kind around the box, along x, y, z, where neighbours are read.
const BEFORE: [usize; 3] = [3, 2, 1];
const BEHIND: [usize; 3] = [2, 1, 0];

impl Region {
    /// Returns the bytes of the region.
    pub fn encode(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        let objects = self.objects.iter().flat_map(|object| [object.number, object.fit]).map(u32::from);
        let count = [self.objects.len() as u32];
        let size = self.size().map(|n| n as u32);
        for number in self.bounds[0].into_iter().chain(size).chain(count).chain(objects) {
            push_number(number, &mut bytes);
        }
        let mut writer = Writing { region: self, layer: None, kinds: Vec::new(), out: Encoder::default() };
        if let Some(bricks) = Coder::new(self.size(), self.objects.len(), &mut writer) {
            bricks.code(&mut writer, &mut |_, _, _| true);
        }
        bytes.extend(writer.out.finish());
        bytes
    }

    /// Reads a region of a grid of `size` voxels; `None` if the bytes are none.
    ///
    /// # Errors
    /// [`Kind::HostMemory`](base::Kind) for a box that memory does not hold.
    pub fn decode(bytes: &[u8], size: [u32; 3]) -> Result<Option<Region>> {
        let Some((claimed, coded)) = claimed(bytes, size) else { return Ok(None) };
        let Claimed { first, size, objects } = claimed;
        let [nx, ny, nz] = size.map(|n| n as usize);
        base::memory::require(slices_bytes([nx, ny, nz]), "the slices of a region")?;
        let mut reader = Reading { input: Decoder::new(coded) };
        let Some(coder) = Coder::new([nx, ny, nz], objects.len(), &mut reader) else { return Ok(None) };
        let (mut tiles, mut room, mut granted) = (Tiles::default(), 0, Ok(()));
        let mut row = |y: usize, z: usize, kinds: &[u8]| {
            tiles.put([first[0], first[1] + y as u32, first[2] + z as u32], kinds);
            if tiles.bytes() > room {
                granted = base::memory::require(ROOM, "the voxels of a region");
                room = tiles.bytes() + ROOM;
            }
            granted.is_ok()
        };
        let is_whole = coder.code(&mut reader, &mut row);
        granted?;
        let end = [0, 1, 2].map(|k| first[k] + size[k]);
        Ok(is_whole.then(|| tiles.region([first, end], objects)).flatten())
    }
}

/// Returns the bytes of memory that two slices of a box, with their borders, and the kinds of its bricks take.
fn slices_bytes([nx, ny, nz]: [usize; 3]) -> u64 {
    let slice = (nx as u64 + 5).saturating_mul(ny as u64 + 3);
    let bricks = [nx, ny, nz].iter().fold(1u64, |count, n| count.saturating_mul(n.div_ceil(BRICK) as u64));
    bricks.saturating_add(slice).saturating_mul(2)
}

/// What the bytes of a region claim before its voxels.
struct Claimed {
    first: [u32; 3],
    size: [u32; 3],
    objects: Vec<RegionObject>,
}

impl Claimed {
    fn voxels(&self) -> u64 {
        self.size.iter().fold(1u64, |voxels, &n| voxels.saturating_mul(n.into()))
    }
}

/// Returns what the bytes of a region of a grid of `size` voxels claim, and the bytes of its voxels; `None` if that
/// cannot be.
fn claimed(bytes: &[u8], size: [u32; 3]) -> Option<(Claimed, &[u8])> {
    let mut rest = bytes;
    let mut number = || take_number(&mut rest);
    let first = [number()?, number()?, number()?];
    let extent = [number()?, number()?, number()?];
    let within = |k: usize| first[k].checked_add(extent[k]).is_some_and(|end| end <= size[k]);
    (0..3).all(within).then_some(())?;
    let count = number()? as usize;
    (count <= MOST_KINDS).then_some(())?;
    let mut objects = Vec::new();
    for _ in 0..count {
        let [number, fit] = [number()?, number()?].map(|n| u8::try_from(n).ok());
        objects.push(RegionObject { number: number?, fit: fit? });
    }
    objects.is_sorted_by(|a, b| a.number < b.number).then_some(())?;
    let claimed = Claimed { first, size: extent, objects };
    let voxels = claimed.voxels();
    let possible = voxels <= LEAST_BYTES.max(rest.len() as u64).saturating_mul(MOST_A_BYTE);
    let empty = claimed.objects.is_empty();
    ((voxels == 0) == empty && possible).then_some((claimed, rest))
}

/// One direction of the coding: a bit, or the kind at a place of the box, is written or read.
trait Coding {
    /// Writes `bit`, if it is known, or reads one.
    fn bit(&mut self, model: &mut Bit, bit: bool) -> bool;
    /// The same for a number.
    fn number(&mut self, tree: &mut Tree, number: u32) -> u32;
    /// Turns to a layer of bricks.
    fn turn_to(&mut self, layer: usize);
    /// Returns the kind of the voxel at this place in the layer; whatever, if it is not known.
    fn kind(&self, place: usize) -> u8;
    /// Returns true if reading came to an end.
    fn is_over(&self) -> bool;
}

struct Writing<'a> {
    region: &'a Region,
    /// The layer of bricks whose kinds are there, x fastest.
    layer: Option<usize>,
    kinds: Vec<u8>,
    out: Encoder,
}

impl Coding for Writing<'_> {
    fn bit(&mut self, model: &mut Bit, bit: bool) -> bool {
        self.out.modelled(model, bit);
        bit
    }

    fn number(&mut self, tree: &mut Tree, number: u32) -> u32 {
        self.out.number(tree, number);
        number
    }

    fn turn_to(&mut self, layer: usize) {
        if self.layer.replace(layer) != Some(layer) {
            let [nx, ny, nz] = self.region.size();
            let slices = layer * BRICK..nz.min((layer + 1) * BRICK);
            self.kinds.clear();
            self.kinds.resize(nx * ny * slices.len(), 0);
            self.region.copy_slices(slices, &mut self.kinds);
        }
    }

    fn kind(&self, place: usize) -> u8 {
        self.kinds[place]
    }

    fn is_over(&self) -> bool {
        false
    }
}

struct Reading<'a> {
    input: Decoder<'a>,
}

impl Coding for Reading<'_> {
    fn bit(&mut self, model: &mut Bit, _: bool) -> bool {
        self.input.modelled(model)
    }

    fn number(&mut self, tree: &mut Tree, _: u32) -> u32 {
        self.input.number(tree)
    }

    fn turn_to(&mut self, _: usize) {}

    fn kind(&self, _: usize) -> u8 {
        0
    }

    fn is_over(&self) -> bool {
        self.input.is_beyond()
    }
}

/// Models of the bits of a region of `count` objects.
struct Models {
    count: usize,
    even: [Bit; 8],
    first: Vec<Bit>,
    next: [[Bit; 4]; TRIED],
    kind: Tree,
}

impl Models {
    /// Codes whether a kind is one of `likely`, in turn, and at last the kind; returns it, `None` if there is no such.
    fn kind(
        &mut self,
        pattern: Option<usize>,
        likely: &[u8],
        kind: u8,
        coding: &mut impl Coding,
    ) -> Option<u8> {
        let mut tried = [0u8; TRIED];
        let mut count = 0;
        for &candidate in likely {
            if tried[..count].contains(&candidate) {
                continue;
            }
            // Where only one kind is left it needs no bit.
            if count == self.count {
                return Some(candidate);
            }
            let model = match pattern.filter(|_| count == 0) {
                Some(pattern) => &mut self.first[pattern],
                None => {
                    &mut self.next[count][usize::from(candidate == 0) + 2 * usize::from(pattern.is_some())]
                }
            };
            if coding.bit(model, kind == candidate) {
                return Some(candidate);
            }
            tried[count] = candidate;
            count += 1;
        }
        let mut left = (0..=self.count as u8).filter(|kind| !tried[..count].contains(kind));
        if let (Some(only), None) = (left.next(), left.next()) {
            return Some(only);
        }
        let kind = coding.number(&mut self.kind, u32::from(kind));
        (kind as usize <= self.count).then_some(kind as u8)
    }
}

/// The voxels of a box, whose bricks are coded.
struct Coder {
    size: [usize; 3],
    models: Models,
    /// The kind of each brick whose voxels are all of one.
    bricks: Vec<Option<u8>>,
}

impl Coder {
    /// Codes the bricks of a box with so many objects; `None` if they could not be read.
    fn new(size: [usize; 3], count: usize, coding: &mut impl Coding) -> Option<Coder> {
        let mut models = Models {
            count,
            even: [Bit::EVEN; 8],
            first: vec![Bit::EVEN; 1 << NEIGHBOURS.len()],
            next: [[Bit::EVEN; 4]; TRIED],
            kind: Tree::new(count as u32),
        };
        let bricks = code_bricks(size, &mut models, coding)?;
        Some(Coder { size, models, bricks })
    }

    /// Codes the kinds of the voxels, and calls `take` with y, z and kinds of each row in which some belong to an object.
    /// Returns false if they could not be read, or if `take` does.
    fn code(mut self, coding: &mut impl Coding, take: &mut impl FnMut(usize, usize, &[u8]) -> bool) -> bool {
        // With a border no neighbour needs to be looked for; two slices are kept.
        let [nx, ny, nz] = self.size;
        let padded: [usize; 2] = std::array::from_fn(|k| BEFORE[k] + self.size[k] + BEHIND[k]);
        let slice = padded[0] * padded[1];
        let steps = NEIGHBOURS.map(|[x, y, z]| x + padded[0] as isize * y + slice as isize * z);
        let mut found = vec![0u8; 2 * slice];
        let across = self.size.map(|n| n.div_ceil(BRICK));
        for z in 0..nz {
            found.copy_within(slice.., 0);
            coding.turn_to(z / BRICK);
            for y in 0..ny {
                let row = slice + (y + BEFORE[1]) * padded[0] + BEFORE[0];
                let bricks = &self.bricks[(z / BRICK * across[1] + y / BRICK) * across[0]..][..across[0]];
                if bricks.iter().all(|&brick| brick == Some(0)) {
                    found[row..row + nx].fill(0);
                    continue;
                }
                for x in 0..nx {
                    let at = row + x;
                    found[at] = match bricks[x / BRICK] {
                        Some(kind) => kind,
                        None => {
                            let around = steps.map(|step| found[at.wrapping_add_signed(step)]);
                            let before = around[0];
                            let same = |pattern, &kind: &u8| pattern << 1 | usize::from(kind == before);
                            let pattern = around[1..].iter().fold(usize::from(before == 0), same);
                            let kind = coding.kind((z % BRICK * ny + y) * nx + x);
                            match self.models.kind(Some(pattern), &around[..TRIED], kind, coding) {
                                Some(kind) => kind,
                                None => return false,
                            }
                        }
                    };
                }
                if !take(y, z, &found[row..row + nx]) || coding.is_over() {
                    return false;
                }
            }
        }
        true
    }
}

/// Codes the bricks, and returns the kind of each whose voxels are all of one.
fn code_bricks(size: [usize; 3], models: &mut Models, coding: &mut impl Coding) -> Option<Vec<Option<u8>>> {
    let across = size.map(|n| n.div_ceil(BRICK));
    let mut bricks: Vec<Option<u8>> = Vec::with_capacity(across.iter().product());
    for z in 0..across[2] {
        coding.turn_to(z);
        for y in 0..across[1] {
            for x in 0..across[0] {
                let here = bricks.len();
                let steps = [(x, 1), (y, across[0]), (z, across[0] * across[1])];
                let around = steps.map(|(at, step)| if at > 0 { bricks[here - step] } else { Some(0) });
                let pattern = around.iter().fold(0, |bits, brick| bits << 1 | usize::from(brick.is_some()));
                let of = |k: usize| [x, y][k] * BRICK;
                let end = |k: usize| (of(k) + BRICK).min(size[k]);
                let slices = BRICK.min(size[2] - z * BRICK);
                let place = |x: usize, y: usize, z: usize| (z * size[1] + y) * size[0] + x;
                let kind = coding.kind(place(of(0), of(1), 0));
                let even = (0..slices).all(|z| {
                    (of(1)..end(1)).all(|y| (of(0)..end(0)).all(|x| coding.kind(place(x, y, z)) == kind))
                });
                let likely = around.map(|brick| brick.unwrap_or(0));
                let even = coding.bit(&mut models.even[pattern], even);
                bricks.push(if even { Some(models.kind(None, &likely, kind, coding)?) } else { None });
            }
            if coding.is_over() {
                return None;
            }
        }
    }
    Some(bricks)
}

fn push_number(mut number: u32, bytes: &mut Vec<u8>) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

fn take_number(bytes: &mut &[u8]) -> Option<u32> {
    let mut number = 0u64;
    for shift in (0..35).step_by(7) {
        let (&byte, rest) = bytes.split_first()?;
        *bytes = rest;
        number |= u64::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return u32::try_from(number).ok();
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    const SIZE: [usize; 3] = [41, 30, 19];

    /// Returns balls of some objects in a box, each beside or in the others, and a few single voxels.
    fn balls(objects: u8) -> Region {
        let mut rng = Pcg64::seed_from_u64(u64::from(objects));
        let mut numbers = vec![None; SIZE.iter().product()];
        for ball in 0..3 * objects {
            let centre: [f32; 3] = SIZE.map(|n| rng.random_range(0.0..n as f32));
            let radius: f32 = rng.random_range(0.5..9.0);
            for (i, number) in numbers.iter_mut().enumerate() {
                let at = [i % SIZE[0], i / SIZE[0] % SIZE[1], i / (SIZE[0] * SIZE[1])];
                let away: f32 = (0..3).map(|k| (at[k] as f32 - centre[k]).powi(2)).sum();
                if away < radius * radius {
                    *number = Some(ball % objects * 3);
                }
            }
        }
        Region::of(SIZE, |i| numbers[i]).expect("few objects")
    }

    fn read(bytes: &[u8]) -> Option<Region> {
        Region::decode(bytes, SIZE.map(|n| n as u32)).expect("little memory")
    }

    #[test]
    fn regions_come_back_and_are_small() {
        for objects in [1, 2, 5, 80] {
            let region = balls(objects);
            let bytes = region.encode();
            assert_eq!(read(&bytes).as_ref(), Some(&region), "{objects} objects");
            let most = if objects < 3 { 1.0 } else { 1.5 };
            let bits = 8.0 * bytes.len() as f64 / region.voxel_count() as f64;
            assert!(bits < most, "{objects} objects: {bits} bits a voxel");
        }
        let number = |i: usize| (i % 7 == 3).then_some((i % 200) as u8);
        let scattered = Region::of(SIZE, number).expect("few objects");
        assert_eq!(read(&scattered.encode()), Some(scattered));
        for whole in [
            Region::of(SIZE, |_| Some(9)),
            Region::of(SIZE, |i| (i == 70).then_some(0)),
            Region::of(SIZE, |_| None),
        ] {
            let whole = whole.expect("few objects");
            let bytes = whole.encode();
            assert!(bytes.len() < 40, "{} bytes", bytes.len());
            assert_eq!(read(&bytes), Some(whole));
        }
    }

    #[test]
    fn parts_that_lie_far_apart_take_little() {
        let far = [300, 200, 400];
        let parts = [[0; 3], [3, 7, 200], far].map(|at| balls(2).within(at));
        let region = Region::joined(&parts).expect("few objects");
        let end = [0, 1, 2].map(|k| far[k] + balls(2).bounds()[1][k]);
        assert_eq!(region.voxel_count(), 3 * balls(2).voxel_count());
        assert_eq!(region.bounds(), [balls(2).bounds()[0], end]);
        let bytes = region.encode();
        assert!(bytes.len() < 4 * balls(2).encode().len(), "{} bytes", bytes.len());
        assert_eq!(Region::decode(&bytes, end).expect("little memory"), Some(region));
    }

    #[test]
    fn bytes_that_are_none_are_refused() {
        let region = balls(3);
        let bytes = region.encode();
        for length in 0..bytes.len() - 5 {
            assert_eq!(read(&bytes[..length]), None, "{length} of {} bytes", bytes.len());
        }
        let mut rng = Pcg64::seed_from_u64(1);
        for _ in 0..2000 {
            let mut changed = bytes.clone();
            for _ in 0..rng.random_range(1..4) {
                let at = rng.random_range(0..changed.len());
                changed[at] = rng.random_range(0..=255);
            }
            if let Some(other) = read(&changed) {
                assert!(other.bounds()[1].iter().zip(SIZE).all(|(&end, n)| end as usize <= n));
                assert!(other.voxels().count() == other.voxel_count());
            }
        }
        // A box of 2⁹⁶ voxels, and one that does not lie in the grid.
        for size in [[u32::MAX; 3], [5, 5, 200]] {
            let mut claim = Vec::new();
            [0, 0, 0]
                .into_iter()
                .chain(size)
                .chain([1, 7, 0])
                .for_each(|number| push_number(number, &mut claim));
            claim.extend([0; 64]);
            let grid = if size[0] > 5 { size } else { [5, 5, 199] };
            assert_eq!(Region::decode(&claim, grid).expect("nothing is taken"), None);
        }
    }
}
