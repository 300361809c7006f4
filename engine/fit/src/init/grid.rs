//! A hashed grid of points for neighbour searches: its cost follows the number of points, not the space
//! between them.

/// A search for neighbours goes no further than this many cells.
const SEARCH_CELLS: i32 = 12;

/// Least edge of a cell in voxels, so that cell numbers of any volume fit into i32.
const LEAST_CELL: f32 = 1e-4;

/// Marks the end of a chain.
const END: u32 = u32::MAX;

/// Points in cubic cells; a cell's points form a chain, and cells share buckets by hash.
pub(crate) struct PointGrid {
    cell: f32,
    /// Each point, and the next one in its chain: together, for one access to memory.
    points: Vec<([f32; 3], u32)>,
    /// First point of each bucket's chain; a power of two of them.
    heads: Vec<u32>,
}

impl PointGrid {
    /// Creates an empty grid for up to `capacity` points (fewer than 2³²) with cells of edge `cell`.
    pub fn new(cell: f32, capacity: usize) -> PointGrid {
        PointGrid {
            cell: cell.max(LEAST_CELL),
            points: Vec::with_capacity(capacity),
            heads: vec![END; (2 * capacity).next_power_of_two()],
        }
    }

    pub fn len(&self) -> usize {
        self.points.len()
    }

    pub fn point(&self, index: usize) -> [f32; 3] {
        self.points[index].0
    }

    pub fn insert(&mut self, point: [f32; 3]) {
        let bucket = self.bucket(self.cell_of(point));
        let next = std::mem::replace(&mut self.heads[bucket], self.points.len() as u32);
        self.points.push((point, next));
    }

    /// Returns true if some point within `radius` satisfies `test`, which is given the point's index and
    /// squared distance.
    pub fn any_within(&self, at: [f32; 3], radius: f32, test: impl Fn(usize, f32) -> bool) -> bool {
        let low = self.cell_of(at.map(|v| v - radius));
        let high = self.cell_of(at.map(|v| v + radius));
        for z in low[2]..=high[2] {
            for y in low[1]..=high[1] {
                for x in low[0]..=high[0] {
                    let mut index = self.heads[self.bucket([x, y, z])];
                    while index != END {
                        let (point, next) = self.points[index as usize];
                        let distance = squared_distance(at, point);
                        if distance < radius * radius && test(index as usize, distance) {
                            return true;
                        }
                        index = next;
                    }
                }
            }
        }
        false
    }

    /// Returns the squared distances from point `index` to its `K` nearest neighbours, ascending; infinite
    /// where there is none within about `reach` and [`SEARCH_CELLS`]. Shells of cells are searched outwards.
    pub fn nearest_squared<const K: usize>(&self, index: usize, reach: f32) -> [f32; K] {
        let at = self.point(index);
        let centre = self.cell_of(at);
        // Distance to the nearest wall of the point's own cell: everything nearer than this plus the searched
        // shells has been seen.
        let inside = (0..3)
            .map(|k| {
                let offset = at[k] - centre[k] as f32 * self.cell;
                offset.min(self.cell - offset)
            })
            .fold(self.cell, f32::min)
            .max(0.0);
        let mut best = [f32::INFINITY; K];
        for shell in 0..=SEARCH_CELLS {
            for z in -shell..=shell {
                for y in -shell..=shell {
                    let on_face = z.abs() == shell || y.abs() == shell;
                    let step = if on_face || shell == 0 { 1 } else { 2 * shell };
                    for x in (-shell..=shell).step_by(step as usize) {
                        let cell = [centre[0] + x, centre[1] + y, centre[2] + z];
                        self.nearest_in_cell(cell, index, at, &mut best);
                    }
                }
            }
            let seen = shell as f32 * self.cell + inside;
            if best[K - 1] <= seen * seen || seen >= reach {
                break;
            }
        }
        best
    }

    fn nearest_in_cell(&self, cell: [i32; 3], except: usize, at: [f32; 3], best: &mut [f32]) {
        let mut index = self.heads[self.bucket(cell)];
        while index != END {
            let (point, next) = self.points[index as usize];
            let mut distance = squared_distance(at, point);
            let other = index as usize != except;
            index = next;
            // Points of other cells share the bucket; they have or get their own turn.
            if other && distance < best[best.len() - 1] && self.cell_of(point) == cell {
                for slot in best.iter_mut() {
                    if distance < *slot {
                        std::mem::swap(slot, &mut distance);
                    }
                }
            }
        }
    }

    fn cell_of(&self, point: [f32; 3]) -> [i32; 3] {
        point.map(|v| (v / self.cell).floor() as i32)
    }

    /// Returns the bucket of a cell. Rows of cells are scattered, but the cells of a row stay neighbours, so
    /// that a search finds them in one cache line.
    fn bucket(&self, [x, y, z]: [i32; 3]) -> usize {
        let row = (y as u32).wrapping_mul(0xd816_3841) ^ (z as u32).wrapping_mul(0xcb1a_b31f);
        let row = (row ^ (row >> 15)).wrapping_mul(0x2c1b_3c6d);
        (x as u32).wrapping_add(row ^ (row >> 13)) as usize & (self.heads.len() - 1)
    }
}

fn squared_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    (0..3).map(|k| (a[k] - b[k]) * (a[k] - b[k])).sum()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    #[test]
    fn neighbours_are_those_of_the_full_search() {
        for (count, extent, cell) in [(400, 10.0, 1.3), (400, 2.0, 0.05), (50, 10.0, 30.0), (3, 1.0, 1.0)] {
            let mut rng = Pcg64::seed_from_u64(9);
            let mut grid = PointGrid::new(cell, count);
            for _ in 0..count {
                grid.insert(std::array::from_fn(|_| extent * (rng.random::<f32>() - 0.5)));
            }
            for i in 0..count {
                let mut all: Vec<f32> = (0..count)
                    .filter(|&j| j != i)
                    .map(|j| squared_distance(grid.point(i), grid.point(j)))
                    .chain([f32::INFINITY; 4])
                    .collect();
                all.sort_by(f32::total_cmp);
                let found: [f32; 4] = grid.nearest_squared(i, 1e9);
                let limit = (SEARCH_CELLS as f32 * cell).powi(2);
                for (found, expected) in found.iter().zip(all) {
                    assert!(*found == expected || expected > limit, "point {i}: {found}, not {expected}");
                }
                let near = grid.any_within(grid.point(i), extent / 8.0, |j, _| j != i);
                assert_eq!(near, found[0] < (extent / 8.0).powi(2));
            }
        }
    }
}
