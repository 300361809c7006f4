//! A voxel's intensity from those before it: the mean of three regressions, weighted by how well each did
//! nearby.
//!
//! One learns from the voxels of late, the others from those of late in tiles of the slice, and so from the same
//! place of the slices before. Their terms are the neighbours, and which faces of the voxel are not inside: what is
//! inside is known of all voxels from the beginning. Voxels of the rim have regressions and contexts of their own.

use super::coder::Channel;
use super::decisions::{Decisions, Expected, LARGEST as LARGEST_NUMBER, POINT};
use super::regression::{LARGEST as LARGEST_TERM, Regression, TERMS, WEIGHT_BITS};
use crate::voxels::Site;

/// Neighbours before a voxel, x first, and their weights in means.
const NEIGHBOURS: [([i64; 3], i64); 18] = [
    ([-1, 0, 0], 16),
    ([0, -1, 0], 16),
    ([0, 0, -1], 16),
    ([-1, -1, 0], 6),
    ([1, -1, 0], 6),
    ([-1, 0, -1], 6),
    ([1, 0, -1], 6),
    ([0, -1, -1], 6),
    ([0, 1, -1], 6),
    ([-2, 0, 0], 2),
    ([0, -2, 0], 2),
    ([0, 0, -2], 2),
    ([-1, -1, -1], 2),
    ([1, -1, -1], 2),
    ([-1, 1, -1], 2),
    ([1, 1, -1], 2),
    ([2, -1, 0], 1),
    ([-2, -1, 0], 1),
];
/// Width of the rim around a slice: as far as neighbours reach.
const RIM: usize = 2;
/// The sides of the tiles that a regression learns in; 0: of the whole slice.
const TILES: [usize; 3] = [0, 24, 10];
/// Weights before anything is learned: a quarter of each of the three nearest neighbours.
const FIRST: [i32; TERMS] = {
    let mut weights = [0; TERMS];
    (weights[0], weights[1], weights[2]) =
        (1 << (WEIGHT_BITS - 2), 1 << (WEIGHT_BITS - 2), 1 << (WEIGHT_BITS - 2));
    weights
};
/// Size of errors where no neighbour is known, in 1/2^[`POINT`].
const UNKNOWN: i64 = 40 << POINT;
/// A difference of the expected size, as a term.
const UNIT: i64 = 256;

/// The latest three slices of something, with a rim.
struct Ring<T> {
    size: [usize; 2],
    empty: T,
    planes: [Vec<T>; 3],
}

impl<T: Copy> Ring<T> {
    fn new(size: [usize; 2], empty: T) -> Self {
        let plane = vec![empty; (size[0] + 2 * RIM) * (size[1] + 2 * RIM)];
        Ring { size, empty, planes: [plane.clone(), plane.clone(), plane] }
    }

    /// Begins a slice. The latest is plane 0.
    fn push(&mut self) {
        self.planes.rotate_right(1);
        self.planes[0].fill(self.empty);
    }

    /// Returns how far away in a slice an offset leads.
    fn offset(&self, [x, y]: [i64; 2]) -> isize {
        (y * (self.size[0] + 2 * RIM) as i64 + x) as isize
    }
}

impl Ring<u8> {
    /// Begins a slice with these sites.
    fn load(&mut self, slice: Option<&[u8]>) {
        self.push();
        let (width, row) = (self.size[0], self.size[0] + 2 * RIM);
        for (y, sites) in slice.unwrap_or_default().chunks_exact(width.max(1)).enumerate() {
            self.planes[0][(y + RIM) * row + RIM..][..width].copy_from_slice(sites);
        }
    }
}

/// What is known of a voxel that was coded.
#[derive(Clone, Copy)]
struct Past {
    value: i32,
    /// Size of the error of the prediction, and of that of each regression, in 1/2^[`POINT`].
    error: i32,
    errors: [i32; TILES.len()],
    known: bool,
}

/// Everything that is learned while a slab is walked over.
pub struct Coder {
    /// Of the rim, and inside; so are the regressions.
    steps: [i64; 2],
    last: i64,
    past: Ring<Past>,
    sites: Ring<u8>,
    neighbours: Vec<(usize, isize, i64)>,
    faces: [(usize, isize); 6],
    regressions: [[Vec<Option<Box<Regression>>>; TILES.len()]; 2],
    decisions: Decisions,
}

/// What the neighbours of a voxel tell.
struct Seen {
    /// Their mean, and the mean size of their differences from it and of their errors in 1/2^[`POINT`].
    mean: i64,
    difference: i64,
    error: i64,
    /// Their differences from the mean, in units of their usual size, and what is inside around the voxel.
    terms: [i16; TERMS],
    scale: i64,
    /// Sums of the errors of each regression.
    errors: [i64; TILES.len()],
    /// Number of faces that are not inside.
    faces: usize,
    /// Whether the voxel itself is.
    is_inside: bool,
}

impl Coder {
    /// Creates a coder of slices of a size. The bounds are those of the rim and of what is inside.
    pub fn new(size: [usize; 2], bounds: [u32; 2]) -> Self {
        let past = Ring::new(size, Past { value: 0, error: 0, errors: [0; TILES.len()], known: false });
        let sites = Ring::new(size, Site::Outside as u8);
        let neighbours =
            NEIGHBOURS.map(|([x, y, z], weight)| (-z as usize, past.offset([x, y]), weight)).to_vec();
        // Here plane 0 is the slice behind.
        let faces = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]];
        let place = |[x, y, z]: [i64; 3]| ((1 - z) as usize, sites.offset([x, y]));
        Coder {
            steps: bounds.map(|bound| 2 * i64::from(bound) + 1),
            last: 0,
            neighbours,
            faces: faces.map(place),
            past,
            sites,
            regressions: std::array::from_fn(|_| std::array::from_fn(|_| Vec::new())),
            decisions: Decisions::default(),
        }
    }

    /// Tells the sites of the next slice, which is one ahead of the slice that is coded.
    pub fn load(&mut self, slice: Option<&[u8]>) {
        self.sites.load(slice);
    }

    /// Begins a slice; `behind` is the one after it.
    pub fn next(&mut self, behind: Option<&[u8]>) {
        self.past.push();
        self.load(behind);
    }

    /// Writes a voxel's code, or reads it, and returns what is read.
    pub fn voxel<C: Channel>(&mut self, c: &mut C, [x, y]: [usize; 2], wanted: i32) -> Option<i32> {
        let at = (y + RIM) * (self.past.size[0] + 2 * RIM) + x + RIM;
        let seen = self.look(at);
        let tiles = TILES.map(|side| match side {
            0 => 0,
            side => y / side * self.past.size[0].div_ceil(side) + x / side,
        });
        let predictions: [i64; TILES.len()] = std::array::from_fn(|k| self.predict(k, tiles[k], &seen));
        let prediction = seen.blend(predictions);
        let expected = seen.expect(prediction);
        let number = self.decisions.number(
            c,
            &expected,
            self.steps[usize::from(seen.is_inside)],
            i64::from(wanted),
        )?;
        let error = |prediction: i64| ((number << POINT) - prediction).abs().min(i64::from(i32::MAX)) as i32;
        let value = number as i32;
        self.past.planes[0][at] =
            Past { value, error: error(prediction), errors: predictions.map(error), known: true };
        self.last = number;
        self.learn(tiles, &seen, number);
        Some(value)
    }

    /// Returns what the neighbours tell.
    fn look(&self, at: usize) -> Seen {
        let past = |&(plane, offset, _): &(usize, isize, i64)| {
            &self.past.planes[plane][at.wrapping_add_signed(offset)]
        };
        let (mut weights, mut values, mut error, mut errors) = (0, 0, 0, [0; TILES.len()]);
        for (past, weight) in self.neighbours.iter().map(|n| (past(n), n.2)).filter(|(past, _)| past.known) {
            weights += weight;
            values += weight * i64::from(past.value);
            error += weight * i64::from(past.error);
            (0..TILES.len()).for_each(|k| errors[k] += weight * i64::from(past.errors[k]));
        }
        let mut seen = Seen {
            mean: self.last,
            difference: UNKNOWN / 2,
            error: UNKNOWN,
            scale: 0,
            terms: [0; TERMS],
            errors,
            faces: 0,
            is_inside: self.sites.planes[1][at] == Site::Inside as u8,
        };
        if weights > 0 {
            seen.mean = (values + weights / 2).div_euclid(weights);
            let size = |n| if past(n).known { n.2 * (i64::from(past(n).value) - seen.mean).abs() } else { 0 };
            seen.difference = (self.neighbours.iter().map(size).sum::<i64>() << POINT) / weights;
            seen.error = error / weights;
        }
        seen.scale =
            seen.error / 2 + seen.difference / 4 + (self.steps[usize::from(seen.is_inside)] << POINT);
        for (k, neighbour) in self.neighbours.iter().enumerate() {
            if past(neighbour).known {
                seen.terms[k] = seen.term(i64::from(past(neighbour).value));
            }
        }
        self.surround(at, &mut seen);
        seen
    }

    /// Adds what is inside around the voxel.
    fn surround(&self, at: usize, seen: &mut Seen) {
        let outside = |&(plane, offset): &(usize, isize)| {
            self.sites.planes[plane][at.wrapping_add_signed(offset)] != Site::Inside as u8
        };
        let terms = &mut seen.terms[NEIGHBOURS.len()..];
        for (k, _) in self.faces.iter().enumerate().filter(|(_, face)| outside(face)) {
            seen.faces += 1;
            terms[k] = UNIT as i16;
        }
    }

    /// Predicts by the `k`-th regression, which begins with the weights of the first.
    fn predict(&mut self, k: usize, tile: usize, seen: &Seen) -> i64 {
        let regressions = &mut self.regressions[usize::from(seen.is_inside)];
        let home = regressions[0].first().and_then(Option::as_ref).map_or(FIRST, |first| first.weights);
        let regressions = &mut regressions[k];
        if regressions.len() <= tile {
            regressions.resize_with(tile + 1, || None);
        }
        let regression = regressions[tile].get_or_insert_with(|| Box::new(Regression::new(home)));
        let by = regression.predict(&seen.terms) * seen.scale / UNIT;
        ((seen.mean << POINT) + by).clamp(-LARGEST_NUMBER << (POINT - 1), LARGEST_NUMBER << (POINT - 1))
    }

    /// Learns the voxel that was coded.
    fn learn(&mut self, tiles: [usize; TILES.len()], seen: &Seen, number: i64) {
        let sum = seen.term(number);
        let mut home = FIRST;
        for (k, (regressions, tile)) in
            self.regressions[usize::from(seen.is_inside)].iter_mut().zip(tiles).enumerate()
        {
            let regression = regressions[tile].as_mut().expect("it has predicted");
            regression.learn(&seen.terms, sum, &home);
            if k == 0 {
                home = regression.weights;
            }
        }
    }
}

impl Seen {
    /// Returns a value as a term: its difference from the mean in units of the scale.
    fn term(&self, value: i64) -> i16 {
        ((value - self.mean) * (UNIT << POINT) / self.scale).clamp(-LARGEST_TERM, LARGEST_TERM) as i16
    }

    fn expect(&self, prediction: i64) -> Expected {
        Expected {
            prediction,
            size: self.error,
            context: (self.faces + 7 * usize::from(!self.is_inside)) * 32 + level(self.error),
        }
    }

    /// Returns the mean of predictions, weighted by the cubes of the inverses of their errors nearby.
    fn blend(&self, predictions: [i64; TILES.len()]) -> i64 {
        let least = self.errors.iter().min().expect("there are some") + 100;
        let weights = self.errors.map(|error| {
            let ratio = (least << 10) / (error + 100);
            ((ratio * ratio * ratio) >> 20) + 1
        });
        let sum: i64 = weights.iter().zip(predictions).map(|(w, p)| w * (p - predictions[0])).sum();
        predictions[0] + sum / weights.iter().sum::<i64>()
    }
}

/// Returns the level of a size, two for each doubling, at most 31.
fn level(size: i64) -> usize {
    let size = size.max(1);
    let bits = size.ilog2();
    let half = bits > 0 && size >> (bits - 1) & 1 == 1;
    (2 * bits as usize + usize::from(half)).min(31)
}
