//! V of a decoded field by least squares: the values at the voxels whose trilinear interpolation comes
//! nearest to the field between them, weighted by the occupancy there.
//!
//! Let V(x_p) be the field at points p of weight w_p, t_i the trilinear function of voxel i, and V⁰ the
//! initial values. Then
//!
//! ```text
//! Σ_p w_p (Σ_i t_i(x_p) V_i − V(x_p))² + λ Σ_i (V_i − V⁰_i)²
//! ```
//!
//! is minimised by conjugate gradients from V⁰, preconditioned by the diagonal (Shewchuk 1994). A set of
//! points has one at the same place in each cell of eight voxels, so the t_i are three numbers for all of it,
//! and nothing is stored but w and V. Sums go over bricks in a fixed order: the same input gives the same
//! bits.

use glam::UVec3;
use rayon::prelude::*;

use volume::bricks::{BRICK, NO_SLOT, SAMPLES, brick_morton};

/// λ, which holds voxels near which few points lie.
const HOLD: f32 = 1e-3;
/// Greatest number of steps, and the part of the first residual at which they end.
const MOST_STEPS: usize = 20;
const ENOUGH: f64 = 1e-3;
/// Edge of a brick with one more voxel on each side, and edge of the block of points between them.
const HALO: usize = BRICK + 2;
const BETWEEN: usize = BRICK + 1;

/// Points at the same place in each cell: the point of sample i lies `offset` beyond its voxel, towards
/// greater coordinates.
pub(super) struct Points {
    /// Offset along each axis, 0 to 1.
    pub(super) offset: [f32; 3],
    /// w and V, [slot][Morton place].
    pub(super) samples: Vec<[f32; 2]>,
}

/// The slots of the 27 bricks around each brick, itself included.
pub(super) struct Neighbours(Vec<[u32; 27]>);

impl Neighbours {
    /// Finds the neighbours of the bricks with a slot in a grid of `bricks`, x fastest.
    pub(super) fn new(bricks: UVec3, slots: &[u32], coordinates: &[UVec3]) -> Self {
        let around = |&brick: &UVec3| {
            std::array::from_fn(|i| {
                let i = i as u32;
                // A coordinate below 0 wraps to one that is beyond the grid.
                let other = UVec3::new(
                    brick.x.wrapping_add(i % 3).wrapping_sub(1),
                    brick.y.wrapping_add(i / 3 % 3).wrapping_sub(1),
                    brick.z.wrapping_add(i / 9).wrapping_sub(1),
                );
                match other.cmplt(bricks).all() {
                    true => slots[((other.z * bricks.y + other.y) * bricks.x + other.x) as usize],
                    false => NO_SLOT,
                }
            })
        };
        Neighbours(coordinates.par_iter().map(around).collect())
    }
}

/// Returns the fitted values at the voxels, [slot][Morton place], starting from `first`.
pub(super) fn least_squares(neighbours: &Neighbours, first: &[f32], points: &[Points]) -> Vec<f32> {
    let mut v = rows(first, |v| *v);
    let system = System {
        neighbours,
        sets: points
            .iter()
            .map(|set| Set {
                offset: set.offset,
                weight: rows(&set.samples, |s| s[0]),
                value: rows(&set.samples, |s| s[1]),
            })
            .collect(),
    };
    let inverse = system.inverse_diagonal();
    let mut residual = system.right_side(&v);
    let mut direction: Vec<f32> = product(&inverse, &residual);
    let mut before = dot(&residual, &direction);
    let enough = before * ENOUGH * ENOUGH;
    for _ in 0..MOST_STEPS {
        if before <= enough {
            break;
        }
        let image = system.apply(&direction);
        let length = (before / dot(&direction, &image)) as f32;
        add(&mut v, length, &direction);
        add(&mut residual, -length, &image);
        let next = product(&inverse, &residual);
        let now = dot(&residual, &next);
        let share = (now / before) as f32;
        direction.par_iter_mut().zip(&next).for_each(|(d, n)| *d = n + share * *d);
        before = now;
    }
    let mut out = vec![0.0; v.len()];
    out.par_chunks_mut(SAMPLES).zip(v.par_chunks(SAMPLES)).for_each(|(out, v)| {
        v.iter().enumerate().for_each(|(i, v)| out[morton(i)] = *v);
    });
    out
}

/// Returns the Morton place of a brick's voxel with index `i`, x fastest.
fn morton(i: usize) -> usize {
    let [x, y, z] = [i % BRICK, i / BRICK % BRICK, i / (BRICK * BRICK)].map(|v| v as u32);
    brick_morton(UVec3::new(x, y, z))
}

/// Returns one number of each sample, x fastest within each brick.
fn rows<T: Sync>(samples: &[T], of: impl Fn(&T) -> f32 + Sync) -> Vec<f32> {
    (0..samples.len())
        .into_par_iter()
        .map(|i| of(&samples[i / SAMPLES * SAMPLES + morton(i % SAMPLES)]))
        .collect()
}

/// A set of points, x fastest within each brick.
struct Set {
    offset: [f32; 3],
    weight: Vec<f32>,
    value: Vec<f32>,
}

struct System<'a> {
    neighbours: &'a Neighbours,
    sets: Vec<Set>,
}

impl System<'_> {
    /// Computes `of(slot, its neighbours)` for each brick and joins the results.
    fn each_brick(&self, of: impl Fn(usize, &[u32; 27]) -> [f32; SAMPLES] + Sync) -> Vec<f32> {
        let mut out = vec![0.0; self.neighbours.0.len() * SAMPLES];
        out.par_chunks_mut(SAMPLES)
            .zip(&self.neighbours.0)
            .enumerate()
            .for_each(|(slot, (out, neighbours))| out.copy_from_slice(&of(slot, neighbours)));
        out
    }

    /// Returns (Σ w t tᵀ + λ) x.
    fn apply(&self, x: &[f32]) -> Vec<f32> {
        self.each_brick(|slot, neighbours| {
            let mut out: [f32; SAMPLES] = std::array::from_fn(|i| HOLD * x[slot * SAMPLES + i]);
            let x = halo(x, neighbours);
            for set in &self.sets {
                let mut at = interpolated(&x, set.offset);
                let weight = cells(&halo(&set.weight, neighbours));
                at.iter_mut().zip(&weight).for_each(|(at, w)| *at *= w);
                gather(&at, set.offset.map(|f| [1.0 - f, f]), &mut out);
            }
            out
        })
    }

    /// Returns Σ w t (V − tᵀ v).
    fn right_side(&self, v: &[f32]) -> Vec<f32> {
        self.each_brick(|_, neighbours| {
            let mut out = [0.0; SAMPLES];
            let v = halo(v, neighbours);
            for set in &self.sets {
                let mut at = interpolated(&v, set.offset);
                let weight = cells(&halo(&set.weight, neighbours));
                let value = cells(&halo(&set.value, neighbours));
                for ((at, w), value) in at.iter_mut().zip(&weight).zip(&value) {
                    *at = w * (value - *at);
                }
                gather(&at, set.offset.map(|f| [1.0 - f, f]), &mut out);
            }
            out
        })
    }

    /// Returns 1 / (Σ w t² + λ).
    fn inverse_diagonal(&self) -> Vec<f32> {
        self.each_brick(|_, neighbours| {
            let mut out = [HOLD; SAMPLES];
            for set in &self.sets {
                let weight = cells(&halo(&set.weight, neighbours));
                gather(&weight, set.offset.map(|f| [(1.0 - f) * (1.0 - f), f * f]), &mut out);
            }
            out.map(|d| 1.0 / d)
        })
    }
}

/// Returns a brick's voxels with those beside them; 0 where there is no brick.
fn halo(field: &[f32], neighbours: &[u32; 27]) -> [f32; HALO * HALO * HALO] {
    let mut out = [0.0; HALO * HALO * HALO];
    // Returns the one of three bricks along an axis in which a voxel lies, and its place there.
    let along = |i: usize| match i {
        0 => (0, BRICK - 1),
        i if i <= BRICK => (1, i - 1),
        _ => (2, 0),
    };
    for z in 0..HALO {
        let (bz, lz) = along(z);
        for y in 0..HALO {
            let (by, ly) = along(y);
            let row = &mut out[(z * HALO + y) * HALO..][..HALO];
            let brick = |bx: usize| neighbours[(bz * 3 + by) * 3 + bx];
            let from = |slot: u32| &field[slot as usize * SAMPLES + (lz * BRICK + ly) * BRICK..][..BRICK];
            if brick(0) != NO_SLOT {
                row[0] = from(brick(0))[BRICK - 1];
            }
            if brick(1) != NO_SLOT {
                row[1..=BRICK].copy_from_slice(from(brick(1)));
            }
            if brick(2) != NO_SLOT {
                row[BRICK + 1] = from(brick(2))[0];
            }
        }
    }
    out
}

/// Returns the part of a halo that belongs to points which see a voxel of the brick: the points of its own
/// voxels and of those one before them.
fn cells(halo: &[f32; HALO * HALO * HALO]) -> [f32; BETWEEN * BETWEEN * BETWEEN] {
    let mut out = [0.0; BETWEEN * BETWEEN * BETWEEN];
    for (row, out) in out.chunks_exact_mut(BETWEEN).enumerate() {
        let (y, z) = (row % BETWEEN, row / BETWEEN);
        out.copy_from_slice(&halo[(z * HALO + y) * HALO..][..BETWEEN]);
    }
    out
}

/// Returns the values at points between the voxels of a halo, one axis after the other.
fn interpolated(halo: &[f32; HALO * HALO * HALO], offset: [f32; 3]) -> [f32; BETWEEN * BETWEEN * BETWEEN] {
    let mut x = [0.0; BETWEEN * HALO * HALO];
    for (from, to) in halo.chunks_exact(HALO).zip(x.chunks_exact_mut(BETWEEN)) {
        for i in 0..BETWEEN {
            to[i] = (1.0 - offset[0]) * from[i] + offset[0] * from[i + 1];
        }
    }
    let mut y = [0.0; BETWEEN * BETWEEN * HALO];
    for (from, to) in x.chunks_exact(BETWEEN * HALO).zip(y.chunks_exact_mut(BETWEEN * BETWEEN)) {
        for i in 0..BETWEEN * BETWEEN {
            to[i] = (1.0 - offset[1]) * from[i] + offset[1] * from[i + BETWEEN];
        }
    }
    let mut out = [0.0; BETWEEN * BETWEEN * BETWEEN];
    for (i, out) in out.iter_mut().enumerate() {
        *out = (1.0 - offset[2]) * y[i] + offset[2] * y[i + BETWEEN * BETWEEN];
    }
    out
}

/// Adds to each voxel the values of the points around it. `shares` holds, for each axis, the factors of a
/// point behind the voxel and of one before it.
fn gather(points: &[f32; BETWEEN * BETWEEN * BETWEEN], shares: [[f32; 2]; 3], out: &mut [f32; SAMPLES]) {
    let [[x0, x1], [y0, y1], [z0, z1]] = shares;
    let mut x = [0.0; BRICK * BETWEEN * BETWEEN];
    for (from, to) in points.chunks_exact(BETWEEN).zip(x.chunks_exact_mut(BRICK)) {
        for i in 0..BRICK {
            to[i] = x1 * from[i] + x0 * from[i + 1];
        }
    }
    let mut y = [0.0; BRICK * BRICK * BETWEEN];
    for (from, to) in x.chunks_exact(BRICK * BETWEEN).zip(y.chunks_exact_mut(BRICK * BRICK)) {
        for i in 0..BRICK * BRICK {
            to[i] = y1 * from[i] + y0 * from[i + BRICK];
        }
    }
    for (i, out) in out.iter_mut().enumerate() {
        *out += z1 * y[i] + z0 * y[i + BRICK * BRICK];
    }
}

fn product(a: &[f32], b: &[f32]) -> Vec<f32> {
    a.par_iter().zip(b).map(|(a, b)| a * b).collect()
}

fn add(to: &mut [f32], factor: f32, what: &[f32]) {
    to.par_iter_mut().zip(what).for_each(|(to, what)| *to += factor * what);
}

/// Returns the inner product, summed in f64, brick by brick.
fn dot(a: &[f32], b: &[f32]) -> f64 {
    let sums: Vec<f64> = a
        .par_chunks(SAMPLES)
        .zip(b.par_chunks(SAMPLES))
        .map(|(a, b)| a.iter().zip(b).map(|(a, b)| f64::from(*a) * f64::from(*b)).sum())
        .collect();
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use volume::bricks::brick_voxel;

    /// Returns a number from 0 to 1 that looks random.
    fn random(i: usize) -> f32 {
        let h = (i as u32).wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let h = ((h >> ((h >> 28) + 4)) ^ h).wrapping_mul(277_803_737);
        (h >> 8) as f32 / 16_777_216.0
    }

    /// Checks that the gradient of the sum of squares, summed up plainly, vanishes at the solution, and that
    /// the solution is far from the start.
    #[test]
    fn the_sum_of_squares_is_least() {
        let bricks = UVec3::new(3, 2, 1);
        let slots = [0, 1, NO_SLOT, 2, NO_SLOT, NO_SLOT];
        let coordinates = [UVec3::ZERO, UVec3::X, UVec3::Y];
        let neighbours = Neighbours::new(bricks, &slots, &coordinates);
        let index = |voxel: UVec3| {
            let brick = voxel / 8;
            let inside = brick.cmplt(bricks).all();
            let slot = if inside { slots[(brick.y * 3 + brick.x) as usize] } else { NO_SLOT };
            (slot != NO_SLOT).then(|| slot as usize * SAMPLES + brick_morton(voxel % 8))
        };
        let voxel = |i: usize| coordinates[i / SAMPLES] * 8 + brick_voxel(i % SAMPLES);
        let count = 3 * SAMPLES;
        let corners = |i: usize| (0..8).map(move |c| voxel(i) + UVec3::new(c & 1, c >> 1 & 1, c >> 2));
        let points: Vec<Points> = [[0.5, 0.25, 0.75], [0.0, 0.9, 0.3], [0.7, 0.6, 0.1]]
            .into_iter()
            .enumerate()
            .map(|(n, offset)| Points {
                offset,
                samples: (0..count)
                    .map(|i| {
                        // A point that sees a voxel without a brick has no weight.
                        let known = corners(i).all(|v| index(v).is_some());
                        let w = if known { random(7 * i + n) } else { 0.0 };
                        [w, 1000.0 * random(13 * i + 5 * n)]
                    })
                    .collect(),
            })
            .collect();
        let first: Vec<f32> = (0..count).map(|i| 500.0 + 100.0 * random(3 * i)).collect();
        let found = least_squares(&neighbours, &first, &points);
        let slope = |v: &[f32]| {
            let mut slope: Vec<f64> =
                (0..count).map(|i| f64::from(HOLD) * f64::from(v[i] - first[i])).collect();
            for set in &points {
                for i in (0..count).filter(|&i| set.samples[i][0] > 0.0) {
                    let shares: Vec<(usize, f64)> = corners(i)
                        .enumerate()
                        .map(|(c, voxel)| {
                            let along = |k: usize| match c >> k & 1 {
                                1 => f64::from(set.offset[k]),
                                _ => 1.0 - f64::from(set.offset[k]),
                            };
                            (index(voxel).expect("a brick"), along(0) * along(1) * along(2))
                        })
                        .collect();
                    let at: f64 = shares.iter().map(|(j, t)| t * f64::from(v[*j])).sum();
                    let [w, value] = set.samples[i].map(f64::from);
                    shares.iter().for_each(|(j, t)| slope[*j] += w * t * (at - value));
                }
            }
            slope.iter().map(|s| s * s).sum::<f64>().sqrt()
        };
        let (before, after) = (slope(&first), slope(&found));
        println!("{before} to {after}");
        // Random weights are harder than occupancies, and the number of steps is limited.
        assert!(after < 2e-2 * before, "{before} to {after}");
    }
}
