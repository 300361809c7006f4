//! Morphology of binary masks: connected pieces, closing by a ball, holes.
//!
//! A mask has one `bool` for every voxel, x fastest, and its `size` says how many voxels there are along x,
//! y, z. Voxels are neighbours that share a face. Beyond the faces of the volume there is no mask.
//!
//! Pieces are found by the runs of voxels along x, which a union-find joins: memory goes with the number of
//! runs, and would be 6 bytes a voxel where every other voxel is set. The closing takes two exact distance
//! transforms on the box around the mask, widened by the radius: 5 bytes for each voxel of that.

use glam::DVec3;
use rayon::prelude::*;

use super::distance::{Parabola, lower_envelope};
use base::memory;
use base::{Error, Kind, Result};

/// Part of the radius by which the centre of a voxel of a ball may be farther away: spacings are rounded in
/// files, and a radius of 1.4 mm is meant to reach two voxels of 0.7 mm.
const ROUNDING: f64 = 1e-5;

/// Result of [`keep_pieces`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PieceCount {
    /// Number of connected pieces of the original mask.
    pub found: usize,
    /// Number of pieces that are kept.
    pub kept: usize,
    /// Number of voxels of the largest piece of the original mask.
    pub largest: usize,
}

/// Clears the connected pieces of `mask` that have fewer than `least` voxels, and of the others all but the
/// `most` largest. Of pieces of the same size, those with the lower first voxel are kept.
///
/// # Errors
/// [`Kind::Usage`] for a mask of more than 2³² − 1 voxels, [`Kind::HostMemory`] if there is no memory for it.
///
/// # Panics
/// If there is not one `bool` for every voxel.
pub fn keep_pieces(mask: &mut [bool], size: [usize; 3], least: u64, most: usize) -> Result<PieceCount> {
    let pieces = Pieces::of(mask, size, true)?;
    let largest = pieces.voxels.iter().copied().max().unwrap_or_default();
    let enough = |voxels: u32| u64::from(voxels) >= least;
    let mut sizes = pieces.voxels.clone();
    sizes.retain(|&n| enough(n));
    // Size of the smallest piece that is kept, and number of pieces of exactly this size that are.
    let (smallest, mut ties) = if most == 0 {
        (u32::MAX, 0)
    } else if sizes.len() <= most {
        (0, usize::MAX)
    } else {
        let (larger, &mut nth, _) = sizes.select_nth_unstable_by(most - 1, |a, b| b.cmp(a));
        (nth, most - larger.iter().filter(|&&n| n > nth).count())
    };
    drop(sizes);
    let kept: Vec<bool> = pieces
        .voxels
        .iter()
        .map(|&n| {
            let tie = n == smallest && ties > 0;
            ties -= usize::from(tie);
            enough(n) && (n > smallest || tie)
        })
        .collect();
    pieces.flip(mask, |piece| !kept[piece]);
    let count = kept.iter().filter(|&&kept| kept).count();
    Ok(PieceCount { found: kept.len(), kept: count, largest: largest as usize })
}

/// Fills the holes of `mask`: the connected pieces of voxels outside it that touch no face of the volume.
/// Returns the number of voxels filled. A hole that is open only across an edge or a corner of voxels counts
/// as closed.
///
/// # Errors
/// [`Kind::Usage`] for a mask of more than 2³² − 1 voxels, [`Kind::HostMemory`] if there is no memory for it.
///
/// # Panics
/// If there is not one `bool` for every voxel.
pub fn fill_holes(mask: &mut [bool], size: [usize; 3]) -> Result<usize> {
    let outside = Pieces::of(mask, size, false)?;
    let [nx, ny, nz] = size;
    let mut open = vec![false; outside.voxels.len()];
    for_each_run(mask, size, false, |run, at| {
        let at_face = at.start == 0
            || at.end as usize == nx
            || at.y == 0
            || at.y + 1 == ny
            || at.z == 0
            || at.z + 1 == nz;
        open[outside.of_run[run] as usize] |= at_face;
    });
    let filled = outside.voxels.iter().zip(&open).filter(|(_, open)| !**open).map(|(&n, _)| n as usize).sum();
    outside.flip(mask, |piece| !open[piece]);
    Ok(filled)
}

/// Closes `mask` by a ball of `radius_mm`, for voxel edges of `spacing_mm` (x, y, z) at right angles: a voxel
/// is set if every ball of this radius that holds it holds a voxel of the mask, too. Gaps and clefts narrower
/// than twice the radius close, no voxel of the mask is lost, and nothing outside the box around the mask is
/// set.
///
/// Distances are from centre to centre. The ball may lie across the faces of the volume, so that the result
/// near them is that of the same mask in a larger volume.
///
/// # Errors
/// [`Kind::HostMemory`] if there is no memory for the box around the mask and a margin of the radius.
///
/// # Panics
/// If there is not one `bool` for every voxel.
pub fn close(mask: &mut [bool], size: [usize; 3], spacing_mm: DVec3, radius_mm: f64) -> Result<()> {
    let Some((low, extent)) = bounds(mask, size) else { return Ok(()) };
    let spacing = spacing_mm.to_array();
    let reach = radius_mm * (1.0 + ROUNDING);
    // The conversion saturates, and so do the sums: what does not fit into memory is refused below.
    let margin = spacing.map(|spacing| (reach / spacing) as usize);
    if margin == [0; 3] {
        return Ok(());
    }
    let wide: [usize; 3] = std::array::from_fn(|a| extent[a].saturating_add(margin[a].saturating_mul(2)));
    let count = wide.iter().fold(1_usize, |product, &n| product.saturating_mul(n));
    // One byte for each voxel of the widened mask, four for its distance.
    memory::require((count as u64).saturating_mul(5), "the mask to close and the margin around it")?;
    let limit = (reach * reach) as f32;

    let mut larger = room(count, false)?;
    let source: &[bool] = mask;
    let squared = plane_distances(wide, spacing, limit, |z, plane| {
        let Some(z) = z.checked_sub(margin[2]).filter(|&z| z < extent[2]) else { return };
        for y in 0..extent[1] {
            let from = low[0] + size[0] * (low[1] + y + size[1] * (low[2] + z));
            let to = margin[0] + wide[0] * (margin[1] + y);
            for (out, &set) in plane[to..][..extent[0]].iter_mut().zip(&source[from..][..extent[0]]) {
                *out = if set { 0.0 } else { f32::INFINITY };
            }
        }
    })?;
    let plane_size = wide[1] * wide[2];
    larger.par_chunks_mut(plane_size).enumerate().for_each_init(Work::default, |work, (x, plane)| {
        let rows = work.last_axis(&squared, wide, spacing[2], limit, x);
        plane.iter_mut().zip(rows).for_each(|(out, &distance)| *out = distance <= limit);
    });
    drop(squared);

    // The widened mask has its axes in the opposite order, and the second transform turns them back.
    let (turned, spacing) = ([wide[2], wide[1], wide[0]], [spacing[2], spacing[1], spacing[0]]);
    let squared = plane_distances(turned, spacing, limit, |x, plane| {
        let larger = &larger[x * plane_size..][..plane_size];
        plane.iter_mut().zip(larger).for_each(|(out, &set)| *out = if set { f32::INFINITY } else { 0.0 });
    })?;
    drop(larger);
    let planes = mask.par_chunks_mut(size[0] * size[1]).enumerate().skip(low[2]).take(extent[2]);
    planes.for_each_init(Work::default, |work, (z, plane)| {
        let rows = work.last_axis(&squared, turned, spacing[2], limit, z - low[2] + margin[2]);
        for y in 0..extent[1] {
            let from = margin[0] + wide[0] * (margin[1] + y);
            let to = low[0] + size[0] * (low[1] + y);
            for (out, &distance) in plane[to..][..extent[0]].iter_mut().zip(&rows[from..][..extent[0]]) {
                *out |= distance > limit;
            }
        }
    });
    Ok(())
}

/// Returns the first voxel and the extent of the box around a mask; `None` if no voxel is set.
fn bounds(mask: &[bool], size: [usize; 3]) -> Option<([usize; 3], [usize; 3])> {
    let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
    for_each_run(mask, size, true, |_, at| {
        let (first, end) = ([at.start as usize, at.y, at.z], [at.end as usize, at.y + 1, at.z + 1]);
        for axis in 0..3 {
            low[axis] = low[axis].min(first[axis]);
            high[axis] = high[axis].max(end[axis]);
        }
    });
    (low[0] < high[0]).then(|| (low, std::array::from_fn(|axis| high[axis] - low[axis])))
}

/// Returns a vector of `count` copies of `value`, or an error if there is no memory for it.
fn room<T: Clone>(count: usize, value: T) -> Result<Vec<T>> {
    // The memory is checked first, since a vector that is too large would end the program. A vector of zeros
    // costs nothing until its pages are written, which the threads do together.
    Vec::<T>::new().try_reserve_exact(count).map_err(|_| {
        let message = format!("no memory for {count} values of {} bytes to clean up a mask", size_of::<T>());
        Error::new(Kind::HostMemory, "VGS-ROI-017", message)
            .help("crop the volume, or choose a smaller radius")
    })?;
    Ok(vec![value; count])
}

/// Returns the squared distances (mm²) to the nearest site in the same plane of z. `sites` receives z and a
/// plane of infinities, x fastest, and writes zeros at the sites. In the result each plane has y fastest.
fn plane_distances(
    [nx, ny, nz]: [usize; 3],
    spacing: [f64; 3],
    limit: f32,
    sites: impl Fn(usize, &mut [f32]) + Sync,
) -> Result<Vec<f32>> {
    let mut squared = room(nx * ny * nz, 0.0)?;
    squared.par_chunks_mut(nx * ny).enumerate().for_each_init(Work::default, |work, (z, out)| {
        work.rows.clear();
        work.rows.resize(nx * ny, f32::INFINITY);
        sites(z, &mut work.rows);
        work.rows.chunks_mut(nx).for_each(|row| lower_envelope(row, spacing[0], &mut work.envelope));
        for (x, column) in out.chunks_mut(ny).enumerate() {
            let values = work.rows[x..].iter().step_by(nx);
            column.iter_mut().zip(values).for_each(|(out, &value)| *out = up_to(value, limit));
            lower_envelope(column, spacing[1], &mut work.envelope);
        }
    });
    Ok(squared)
}

/// Returns a squared distance, or infinity beyond the limit, where the parabola of a voxel reaches nothing.
fn up_to(squared: f32, limit: f32) -> f32 {
    if squared <= limit { squared } else { f32::INFINITY }
}

/// Work buffers of one thread.
#[derive(Default)]
struct Work {
    rows: Vec<f32>,
    envelope: Vec<Parabola>,
}

impl Work {
    /// Returns the squared distances (mm²) of all voxels at `x` to the nearest site, z fastest, from the
    /// [distances in planes](plane_distances).
    fn last_axis(
        &mut self,
        squared: &[f32],
        [nx, ny, nz]: [usize; 3],
        spacing_z: f64,
        limit: f32,
        x: usize,
    ) -> &[f32] {
        self.rows.resize(ny * nz, 0.0);
        for z in 0..nz {
            let column = &squared[(z * nx + x) * ny..][..ny];
            let outs = self.rows[z..].iter_mut().step_by(nz);
            outs.zip(column).for_each(|(out, &value)| *out = up_to(value, limit));
        }
        self.rows.chunks_mut(nz).for_each(|row| lower_envelope(row, spacing_z, &mut self.envelope));
        &self.rows
    }
}

/// A run of voxels along x.
#[derive(Clone, Copy)]
struct Run {
    /// First voxel of the run; `end` is the voxel after its last one.
    start: u32,
    end: u32,
    y: usize,
    z: usize,
}

/// Calls `f` with the number and the place of each run of voxels of this `value`, in memory order.
fn for_each_run(mask: &[bool], [nx, ny, _]: [usize; 3], value: bool, mut f: impl FnMut(usize, Run)) {
    let mut run = 0;
    for (row, voxels) in mask.chunks(nx.max(1)).enumerate() {
        let (y, z) = (row % ny, row / ny);
        let mut at = 0;
        while let Some(skipped) = voxels[at..].iter().position(|&v| v == value) {
            let start = at + skipped;
            let end = voxels[start..].iter().position(|&v| v != value).map_or(nx, |n| start + n);
            f(run, Run { start: start as u32, end: end as u32, y, z });
            (run, at) = (run + 1, end);
        }
    }
}

/// The connected pieces of the voxels of one value.
struct Pieces {
    size: [usize; 3],
    value: bool,
    /// The piece that each run belongs to, in the order of [`for_each_run`].
    of_run: Vec<u32>,
    /// Number of voxels of each piece; pieces are in the order of their first voxels.
    voxels: Vec<u32>,
}

impl Pieces {
    /// Finds the connected pieces of the voxels of `mask` that are `value`.
    fn of(mask: &[bool], size: [usize; 3], value: bool) -> Result<Pieces> {
        assert_eq!(mask.len(), size.iter().product::<usize>(), "one value for every voxel");
        check_count(mask.len())?;
        let [nx, ny, _] = size;
        let runs: usize = mask
            .par_chunks(nx.max(1))
            .map(|row| {
                let first = usize::from(row[0] == value);
                first + row.windows(2).filter(|pair| pair[0] != value && pair[1] == value).count()
            })
            .sum();
        // One number for each run, two numbers and a mark for each piece, of which there are at most as many,
        // and the runs of two planes.
        memory::require(13 * runs as u64 + 16 * (nx * ny) as u64, "the pieces of a mask")?;

        let mut of_run = room(runs, 0_u32)?;
        // Runs of the previous plane and of this one, and the place where a row begins.
        let (mut before, mut here) = (Plane::default(), Plane::default());
        let mut row_here = (usize::MAX, 0);
        for_each_run(mask, size, value, |run, at| {
            if row_here != (at.y, at.z) {
                if row_here.1 != at.z {
                    std::mem::swap(&mut before, &mut here);
                    if row_here.1 + 1 != at.z {
                        before.clear();
                    }
                    here.clear();
                }
                row_here = (at.y, at.z);
                here.begin(at.y);
                here.look_at(at.y.checked_sub(1));
                before.look_at(Some(at.y));
            }
            of_run[run] = run as u32;
            for plane in [&mut here, &mut before] {
                plane.for_each_touching(at, |other| join(&mut of_run, run as u32, other));
            }
            here.runs.push([at.start, at.end, run as u32]);
        });

        // From the root of each run, which is never after it, to the number of its piece.
        let mut count = 0;
        for run in 0..of_run.len() {
            let parent = of_run[run] as usize;
            of_run[run] = if parent == run { count } else { of_run[parent] };
            count += u32::from(parent == run);
        }
        let mut voxels = room(count as usize, 0_u32)?;
        for_each_run(mask, size, value, |run, at| voxels[of_run[run] as usize] += at.end - at.start);
        Ok(Pieces { size, value, of_run, voxels })
    }

    /// Gives the voxels of the chosen pieces the other value. The mask must be the one in which the pieces
    /// were found.
    fn flip(&self, mask: &mut [bool], chosen: impl Fn(usize) -> bool) {
        let mut run = 0;
        for row in mask.chunks_mut(self.size[0].max(1)) {
            let mut at = 0;
            while let Some(skipped) = row[at..].iter().position(|&v| v == self.value) {
                let start = at + skipped;
                let length = row[start..].iter().position(|&v| v != self.value).unwrap_or(row.len() - start);
                if chosen(self.of_run[run] as usize) {
                    row[start..start + length].fill(!self.value);
                }
                (run, at) = (run + 1, start + length);
            }
        }
    }
}

/// Refuses masks whose voxels cannot be counted in 32 bits.
fn check_count(voxels: usize) -> Result<()> {
    if u32::try_from(voxels).is_ok() {
        return Ok(());
    }
    let message = format!("a mask of {voxels} voxels cannot be cleaned up: {} are the most", u32::MAX);
    Err(Error::new(Kind::Usage, "VGS-ROI-016", message).help("crop the volume"))
}

/// The runs of one plane, and a cursor among them that moves along with the runs of the next row or plane.
#[derive(Default)]
struct Plane {
    /// Start, end and number of each run.
    runs: Vec<[u32; 3]>,
    /// Index of the first run of each row so far.
    rows: Vec<usize>,
    /// Cursor: the first run of the current row that has not been passed. `end` is the end of that row.
    place: usize,
    end: usize,
}

impl Plane {
    fn clear(&mut self) {
        self.runs.clear();
        self.rows.clear();
    }

    /// Begins row `y`.
    fn begin(&mut self, y: usize) {
        // Rows without a run begin where the next one does.
        self.rows.resize(y + 1, self.runs.len());
    }

    /// Moves the cursor to the beginning of row `y`; `None` is an empty row.
    fn look_at(&mut self, y: Option<usize>) {
        let begin = |y: usize| self.rows.get(y).copied().unwrap_or(self.runs.len());
        (self.place, self.end) = y.map_or((0, 0), |y| (begin(y), begin(y + 1)));
    }

    /// Calls `f` with the runs of the current row that share a face with the run `at`, which must come after
    /// those of the calls before.
    fn for_each_touching(&mut self, at: Run, mut f: impl FnMut(u32)) {
        while self.place < self.end && self.runs[self.place][1] <= at.start {
            self.place += 1;
        }
        let ahead = &self.runs[self.place..self.end];
        ahead.iter().take_while(|run| run[0] < at.end).for_each(|run| f(run[2]));
    }
}

/// Joins the sets of two runs. The root of a set is its lowest run.
fn join(parents: &mut [u32], a: u32, b: u32) {
    let (a, b) = (root(parents, a), root(parents, b));
    parents[a.max(b) as usize] = a.min(b);
}

/// Returns the root of the set of a run and halves the path to it.
fn root(parents: &mut [u32], mut run: u32) -> u32 {
    while parents[run as usize] != run {
        let above = parents[parents[run as usize] as usize];
        parents[run as usize] = above;
        run = above;
    }
    run
}

#[cfg(test)]
mod tests {
    use super::*;

    fn voxels(size: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
        (0..size.iter().product()).map(move |i| [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])])
    }

    fn mask(size: [usize; 3], set: impl FnMut([usize; 3]) -> bool) -> Vec<bool> {
        voxels(size).map(set).collect()
    }

    fn count(mask: &[bool]) -> usize {
        mask.iter().filter(|&&set| set).count()
    }

    /// Masks of every kind: all and nothing, each corner, the edges, the faces, a checkerboard, and noise of
    /// several densities.
    fn masks(size: [usize; 3]) -> Vec<Vec<bool>> {
        let at_end = |p: [usize; 3], a: usize| p[a] == 0 || p[a] + 1 == size[a];
        let ends = |p: [usize; 3]| (0..3).filter(|&a| at_end(p, a)).count();
        let mut all = vec![
            mask(size, |_| false),
            mask(size, |_| true),
            mask(size, |p| ends(p) == 3),
            mask(size, |p| ends(p) >= 2),
            mask(size, |p| ends(p) >= 1),
            mask(size, |p| ends(p) == 0),
            mask(size, |p| p.iter().sum::<usize>() % 2 == 0),
            mask(size, |p| at_end(p, 0)),
            mask(size, |p| p[2] == 0),
        ];
        let mut state = 1_u64;
        for percent in [3, 15, 40, 60, 85, 97] {
            for _ in 0..3 {
                all.push(mask(size, |_| {
                    // Knuth's generator; its upper bits are good enough.
                    state =
                        state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    (state >> 33) % 100 < percent
                }));
            }
        }
        all
    }

    const SIZES: [[usize; 3]; 8] =
        [[1, 1, 1], [7, 1, 1], [1, 6, 1], [1, 1, 5], [5, 4, 1], [1, 4, 5], [6, 5, 4], [7, 7, 7]];

    /// Pieces by flooding: for each voxel of `value` the number of its piece.
    fn flooded(mask: &[bool], size: [usize; 3], value: bool) -> (Vec<Option<usize>>, usize) {
        let index = |p: [usize; 3]| p[0] + size[0] * (p[1] + size[1] * p[2]);
        let mut piece = vec![None; mask.len()];
        let mut pieces = 0;
        for start in voxels(size) {
            if mask[index(start)] != value || piece[index(start)].is_some() {
                continue;
            }
            let mut open = vec![start];
            while let Some(p) = open.pop() {
                if mask[index(p)] != value || piece[index(p)].replace(pieces).is_some() {
                    continue;
                }
                for axis in 0..3 {
                    for to in [p[axis].wrapping_sub(1), p[axis] + 1] {
                        if to < size[axis] {
                            let mut next = p;
                            next[axis] = to;
                            open.push(next);
                        }
                    }
                }
            }
            pieces += 1;
        }
        (piece, pieces)
    }

    fn kept_by_flooding(
        mask: &[bool],
        size: [usize; 3],
        least: usize,
        most: usize,
    ) -> (Vec<bool>, PieceCount) {
        let (piece, pieces) = flooded(mask, size, true);
        let mut sizes: Vec<(usize, usize)> =
            (0..pieces).map(|n| (piece.iter().filter(|&&p| p == Some(n)).count(), n)).collect();
        let largest = sizes.iter().map(|s| s.0).max().unwrap_or_default();
        sizes.retain(|s| s.0 >= least);
        sizes.sort_by_key(|&(voxels, n)| (std::cmp::Reverse(voxels), n));
        sizes.truncate(most);
        let kept = piece.iter().map(|p| sizes.iter().any(|s| Some(s.1) == *p)).collect();
        (kept, PieceCount { found: pieces, kept: sizes.len(), largest })
    }

    fn filled_by_flooding(mask: &[bool], size: [usize; 3]) -> Vec<bool> {
        let (piece, pieces) = flooded(mask, size, false);
        let mut open = vec![false; pieces];
        for (p, n) in voxels(size).zip(&piece) {
            if let Some(n) = n {
                open[*n] |= (0..3).any(|a| p[a] == 0 || p[a] + 1 == size[a]);
            }
        }
        piece.iter().map(|n| n.is_none_or(|n| !open[n])).collect()
    }

    /// The closing as it is defined, with a margin around the mask.
    fn closed_by_search(mask: &[bool], size: [usize; 3], spacing: DVec3, radius: f64) -> Vec<bool> {
        let reach = spacing.to_array().map(|s| (radius * (1.0 + ROUNDING) / s) as i64);
        let in_ball: Vec<[i64; 3]> = (-reach[0]..=reach[0])
            .flat_map(|x| {
                (-reach[1]..=reach[1]).flat_map(move |y| (-reach[2]..=reach[2]).map(move |z| [x, y, z]))
            })
            .filter(|d| {
                (DVec3::from_array(d.map(|d| d as f64)) * spacing).length() <= radius * (1.0 + ROUNDING)
            })
            .collect();
        let is_set = |p: [i64; 3]| {
            (0..3).all(|a| p[a] >= 0 && p[a] < size[a] as i64)
                && mask[p[0] as usize + size[0] * (p[1] as usize + size[1] * p[2] as usize)]
        };
        let plus = |p: [i64; 3], d: &[i64; 3]| [p[0] + d[0], p[1] + d[1], p[2] + d[2]];
        let dilated = |p: [i64; 3]| in_ball.iter().any(|d| is_set(plus(p, d)));
        let wide: Vec<i64> = (0..3).map(|a| size[a] as i64 + 2 * reach[a]).collect();
        let larger: Vec<bool> = voxels([wide[0] as usize, wide[1] as usize, wide[2] as usize])
            .map(|p| dilated(std::array::from_fn(|a| p[a] as i64 - reach[a])))
            .collect();
        let in_larger = |p: [i64; 3]| {
            let [x, y, z] = plus(p, &reach);
            larger[(x + wide[0] * (y + wide[1] * z)) as usize]
        };
        voxels(size)
            .map(|p| p.map(|c| c as i64))
            .map(|p| in_ball.iter().all(|d| in_larger(plus(p, d))))
            .collect()
    }

    #[test]
    fn pieces_are_those_of_a_flood() {
        for size in SIZES {
            for mask in masks(size) {
                for (least, most) in
                    [(0, usize::MAX), (0, 1), (0, 2), (0, 5), (2, usize::MAX), (3, 2), (9, 1), (0, 0)]
                {
                    let mut found = mask.clone();
                    let count = keep_pieces(&mut found, size, least as u64, most).unwrap();
                    let wanted = kept_by_flooding(&mask, size, least, most);
                    assert_eq!(
                        (found, count),
                        wanted,
                        "{size:?}, at least {least}, at most {most}: {mask:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn holes_are_what_a_flood_from_the_faces_does_not_reach() {
        for size in SIZES {
            for mask in masks(size) {
                let mut found = mask.clone();
                let filled = fill_holes(&mut found, size).unwrap();
                assert_eq!(found, filled_by_flooding(&mask, size), "{size:?}: {mask:?}");
                assert_eq!(filled, count(&found) - count(&mask));
                // Once filled there is nothing left to fill.
                let before = found.clone();
                assert_eq!(fill_holes(&mut found, size).unwrap(), 0);
                assert_eq!(found, before);
            }
        }
    }

    #[test]
    fn a_closing_is_that_of_a_search() {
        let spacings = [DVec3::ONE, DVec3::new(0.7, 0.7, 2.5), DVec3::new(1.0, 0.4, 0.8)];
        for size in SIZES {
            for spacing in spacings {
                for (i, mask) in masks(size).into_iter().enumerate() {
                    for radius in [0.0, 0.7, 1.0, 1.4, 2.1, 2.6] {
                        // The search is slow: of the larger masks each is closed by some of the balls.
                        if size == [7, 7, 7] && !(i + (radius * 10.0) as usize).is_multiple_of(4) {
                            continue;
                        }
                        let mut found = mask.clone();
                        close(&mut found, size, spacing, radius).unwrap();
                        let wanted = closed_by_search(&mask, size, spacing, radius);
                        assert_eq!(found, wanted, "{size:?} of {spacing} mm by {radius} mm: {mask:?}");
                        assert!(mask.iter().zip(&found).all(|(was, is)| is >= was), "no voxel is lost");
                        let before = found.clone();
                        close(&mut found, size, spacing, radius).unwrap();
                        assert_eq!(found, before, "closed twice is closed once");
                    }
                }
            }
        }
    }

    #[test]
    fn a_closing_does_not_depend_on_the_faces() {
        let (inner, outer) = ([6, 5, 4], [16, 15, 14]);
        for small in masks(inner) {
            let at = |p: [usize; 3]| -> Option<usize> {
                let [x, y, z] = p.map(|c| c.wrapping_sub(5));
                (x < 6 && y < 5 && z < 4).then(|| x + 6 * (y + 5 * z))
            };
            let mut large = mask(outer, |p| at(p).is_some_and(|i| small[i]));
            close(&mut large, outer, DVec3::new(1.0, 1.0, 1.5), 2.5).unwrap();
            let mut found = small.clone();
            close(&mut found, inner, DVec3::new(1.0, 1.0, 1.5), 2.5).unwrap();
            for (p, set) in voxels(outer).zip(large) {
                assert_eq!(set, at(p).is_some_and(|i| found[i]), "{p:?} of {small:?}");
            }
        }
    }

    #[test]
    fn gaps_close_as_far_as_the_ball_reaches() {
        // Two plates of 9 × 9 voxels that are 4 voxels of 0.5 mm apart: 2.5 mm from centre to centre.
        let (size, spacing) = ([9, 9, 12], DVec3::new(1.0, 1.0, 0.5));
        let plates = mask(size, |p| [2, 7].contains(&p[2]));
        for (radius, middle) in [(0.9, false), (1.5, true)] {
            let mut found = plates.clone();
            close(&mut found, size, spacing, radius).unwrap();
            for z in 3..7 {
                assert_eq!(found[4 + 9 * (4 + 9 * z)], middle, "slice {z}, {radius} mm");
            }
            assert!(!found[4 + 9 * (4 + 9)] && !found[4 + 9 * (4 + 9 * 8)], "nothing beyond the plates");
        }
    }

    #[test]
    fn what_is_too_large_is_refused() {
        let error = check_count(1 << 32).unwrap_err();
        assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-ROI-016"));
        assert!(check_count(u32::MAX as usize).is_ok());
        assert_eq!(room(usize::MAX, 0.0_f32).unwrap_err().kind, Kind::HostMemory);
        let mut one = [true];
        let error = close(&mut one, [1; 3], DVec3::splat(1e-9), 50.0).unwrap_err();
        assert_eq!((error.kind, one), (Kind::HostMemory, [true]));
    }
}
