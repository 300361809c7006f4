//! Edges without stairs: the occupancy with which a binary region is shown.
//!
//! The half level of a mask of 0 and 1, between voxels, is a building of blocks. [`occupancy`] replaces it
//! by the smoothest surface that the mask allows. At each voxel the depth φ below that surface (in voxels,
//! negative outside) lies between two bounds: a voxel at D voxels from the nearest one of the other side,
//! from centre to centre, is D − 1 to D deep, as it would be below any plane that was digitised. Between
//! the bounds, which a number may widen, φ is smoothed by 2B − B², where B is the binomial filter ¼ ½ ¼
//! along each axis: constraints as in Whitaker, "Reducing aliasing artifacts in iso-surfaces of binary
//! volumes" (2000), and a filter that leaves curvature alone, as in Taubin, "A signal processing approach
//! to fair surface design" (1995), so that round things do not shrink. Neighbours along an axis count as
//! one voxel apart whatever the spacing, since stairs are one voxel high.
//!
//! Depths are whole numbers of 1/512 voxel: results do not depend on the number of threads. Work goes with
//! the surface, by runs of 16 voxels along x; memory is up to 6 bytes for each voxel of the box around the
//! region, of which pages far from the region are not touched.

use std::fmt;
use std::str::FromStr;

use base::{Result, memory};
use glam::IVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// Greatest number, mm.
const MOST_MM: f64 = 100.0;
/// How many parts of a voxel a depth is counted in.
const UNIT: i16 = 512;
/// Depth (voxels) at which depths are clipped.
const CLIP: i16 = 2;
/// Distance (voxels) outside the surface at which occupancy is 0, and depth at which it is 1: a long ramp outside
/// shows no stairs, and a short one inside leaves it to the intensities where the surface of a bright object is.
pub const RAMPS: [f64; 2] = [1.0, 0.5];
/// Distance (voxels) from the surface to the centre of a voxel that keeps its side.
const KEPT: f64 = 0.02;
/// Greatest number by which bounds are widened (voxels).
const MOST: f64 = 4.0;
/// Rounds of smoothing with each stride.
const ROUNDS: usize = 4;
/// Greatest stride of the filter, voxels.
const WIDEST: usize = 4;
/// Voxels in a run along x that is smoothed or left out.
const RUN: usize = 16;
/// Voxels in a run and the margins that its filter reaches into.
const WIDE: usize = RUN + 2 * WIDEST;
/// Bit of a voxel of the region.
const INSIDE: u8 = 0x80;
/// Bit of a voxel that keeps its side whatever the number: none of its neighbours is deeper.
const RIDGE: u8 = 0x40;

/// How far the surface of a binary region may move when it is shown.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub enum Edges {
    /// Not at all: occupancy is 1 at the voxels of the region and 0 at others.
    Voxel,
    /// At most so many mm beyond the centres of the voxels on either side of it. At 0 each voxel keeps its
    /// side of one half. Voxels of which no neighbour is deeper keep it at any number, so that nothing thin
    /// vanishes, neither sheets nor gaps.
    Within(f64),
}

impl fmt::Display for Edges {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Edges::Voxel => f.write_str("voxel"),
            Edges::Within(mm) => write!(f, "{mm}"),
        }
    }
}

impl FromStr for Edges {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        match text.parse() {
            _ if text == "voxel" => Ok(Edges::Voxel),
            Ok(mm) if (0.0..=MOST_MM).contains(&mm) => Ok(Edges::Within(mm)),
            _ => Err(format!("\"voxel\", or a number from 0 to {MOST_MM} mm")),
        }
    }
}

impl From<Edges> for String {
    fn from(edges: Edges) -> String {
        edges.to_string()
    }
}

impl TryFrom<String> for Edges {
    type Error = String;

    fn try_from(text: String) -> std::result::Result<Self, String> {
        text.parse()
    }
}

impl Default for Edges {
    fn default() -> Self {
        Edges::Within(0.0)
    }
}

impl Edges {
    /// Returns by how many layers of voxels (corners included) values are needed beyond the region, where its
    /// occupancy, interpolated on a grid of `spacing_mm`, is not 0. Gradients need one more.
    pub fn layers(self, spacing_mm: [f64; 3]) -> usize {
        match self {
            Edges::Voxel => 1,
            Edges::Within(_) => 2 + self.slack(spacing_mm).ceil() as usize,
        }
    }

    /// Returns by how many voxels of `spacing_mm` the surface may move, along the axis of the greatest
    /// spacing.
    fn slack(self, spacing_mm: [f64; 3]) -> f64 {
        let Edges::Within(mm) = self else { return 0.0 };
        let slack = mm / spacing_mm.into_iter().fold(f64::MIN_POSITIVE, f64::max);
        if slack > 0.0 { slack.min(MOST) } else { 0.0 }
    }
}

/// Occupancy of a region at the voxels of a box.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Occupancy {
    /// Voxel of the volume that is the first of the box; it may lie beyond the faces of the volume.
    pub origin: IVec3,
    /// Voxels of the box along x, y, z. All at its faces have the occupancy 0.
    pub size: [usize; 3],
    /// Occupancy of each voxel, x fastest: 0 is 0, 255 is 1, and those from 128 on lie inside the surface.
    pub values: Vec<u8>,
}

impl Occupancy {
    /// Returns the occupancy at a voxel of the volume, 0 to 255; 0 where the box does not reach.
    pub fn at(&self, voxel: IVec3) -> u8 {
        let place = voxel - self.origin;
        let size = IVec3::from_array(self.size.map(|n| n as i32));
        if place.cmplt(IVec3::ZERO).any() || place.cmpge(size).any() {
            return 0;
        }
        let [x, y, z] = place.to_array().map(|c| c as usize);
        self.values[x + self.size[0] * (y + self.size[1] * z)]
    }
}

/// Returns the occupancy of the region of all voxels whose number is not 0, on a grid of `size` voxels of
/// `spacing_mm` (x, y, z). Beyond the faces of the grid nothing belongs to the region.
///
/// # Errors
/// [`base::Kind::HostMemory`] if there is no memory for the box around the region.
///
/// # Panics
/// If there is not one number for every voxel.
pub fn occupancy(numbers: &[u8], size: [usize; 3], spacing_mm: [f64; 3], edges: Edges) -> Result<Occupancy> {
    assert_eq!(numbers.len(), size.iter().product::<usize>(), "one number for every voxel");
    let Some((low, high)) = bounds(numbers, size) else {
        return Ok(Occupancy { origin: IVec3::ZERO, size: [0; 3], values: Vec::new() });
    };
    let slack = edges.slack(spacing_mm);
    let limits = Limits::new(slack);
    // Runs begin and end `WIDEST` voxels from the faces, where nothing is near the surface.
    let margin = match edges {
        Edges::Voxel => [1; 3],
        Edges::Within(_) => [limits.reach + WIDEST, limits.reach, limits.reach],
    };
    let mut wide = Grid(std::array::from_fn(|a| high[a] + 1 - low[a] + 2 * margin[a]));
    if edges != Edges::Voxel {
        wide.0[0] = (wide.0[0] - 2 * WIDEST).next_multiple_of(RUN) + 2 * WIDEST;
    }
    memory::require(6 * wide.len() as u64, "the smooth edges of a region")?;

    let mut codes = vec![0_u8; wide.len()];
    let [nx, ny, _] = size;
    codes.par_chunks_mut(wide.0[0]).enumerate().for_each(|(row, out)| {
        let (y, z) = ((row % wide.0[1]).wrapping_sub(margin[1]), (row / wide.0[1]).wrapping_sub(margin[2]));
        if y <= high[1] - low[1] && z <= high[2] - low[2] {
            let from = low[0] + nx * (low[1] + y + ny * (low[2] + z));
            let row = &numbers[from..=from + high[0] - low[0]];
            for (out, _) in out[margin[0]..].iter_mut().zip(row).filter(|(_, number)| **number != 0) {
                *out = INSIDE;
            }
        }
    });
    let origin = IVec3::from_array(std::array::from_fn(|a| low[a] as i32 - margin[a] as i32));
    let values = if edges == Edges::Voxel {
        codes.par_iter_mut().filter(|code| **code != 0).for_each(|code| *code = u8::MAX);
        codes
    } else {
        limits.mark_distances(&mut codes, wide);
        if slack > 0.0 {
            mark_ridges(&mut codes, wide, &limits);
        }
        let depths = smoothed(&codes, wide, &limits, slack);
        codes.par_iter_mut().zip(&depths).for_each(|(out, &depth)| {
            let depth_inside = f64::from(depth - CLIP * UNIT) / f64::from(UNIT);
            let level = 127.5 * depth_inside / if depth_inside > 0.0 { RAMPS[1] } else { RAMPS[0] };
            // Where nothing was written nothing is, so that pages far outside are not touched.
            if depth != 0 || *out != 0 {
                *out = (127.5 + level).round() as u8;
            }
        });
        codes
    };
    Ok(Occupancy { origin, size: wide.0, values })
}

/// Returns the first and the last voxel of the box around a region, along each axis.
fn bounds(numbers: &[u8], [nx, ny, _]: [usize; 3]) -> Option<([usize; 3], [usize; 3])> {
    numbers
        .par_chunks(nx.max(1))
        .enumerate()
        .filter_map(|(row, numbers)| {
            let first = numbers.iter().position(|&n| n != 0)?;
            let last = numbers.iter().rposition(|&n| n != 0)?;
            Some(([first, row % ny, row / ny], [last, row % ny, row / ny]))
        })
        .reduce_with(|a, b| {
            (std::array::from_fn(|k| a.0[k].min(b.0[k])), std::array::from_fn(|k| a.1[k].max(b.1[k])))
        })
}

/// Voxels along x, y, z.
#[derive(Clone, Copy)]
struct Grid([usize; 3]);

impl Grid {
    fn len(self) -> usize {
        self.0.iter().product()
    }

    /// Returns the voxels of a row along x.
    fn row(self, y: usize, z: usize) -> std::ops::Range<usize> {
        let start = (z * self.0[1] + y) * self.0[0];
        start..start + self.0[0]
    }

    /// Returns the runs of a row: all of it but `WIDEST` voxels at either end.
    fn runs(self) -> usize {
        (self.0[0] - 2 * WIDEST) / RUN
    }
}

/// What codes of voxels stand for. A code has [`INSIDE`], [`RIDGE`], and the part by which the square of D,
/// the distance to the nearest voxel of the other side, falls short of `squared`; 0 if it does not.
struct Limits {
    /// Squared distance (voxels²) from which on the depth of a voxel is clipped.
    squared: u8,
    /// Voxels along an axis within that distance.
    reach: usize,
    /// For each code the least depth, the greatest depth, and the one to begin with: `UNIT` per voxel, and 0
    /// is `CLIP` voxels outside.
    of_code: [[i16; 3]; 256],
}

impl Limits {
    fn new(slack: f64) -> Limits {
        let reach = f64::from(CLIP) + 1.0 + slack;
        let squared = (reach * reach).ceil();
        let of_code = std::array::from_fn(|code| {
            let code = code as u8;
            let (inside, short) = (code & INSIDE != 0, code & !(INSIDE | RIDGE));
            let distance =
                if short == 0 { 2.0 * reach } else { (squared - f64::from(short)).max(0.0).sqrt() };
            let kept = slack == 0.0 || code & RIDGE != 0;
            let least = (distance - 1.0 - slack).max(if kept { KEPT } else { f64::MIN });
            let side = [least, distance + slack, distance - 0.5];
            let [least, most, begin] = if inside { side } else { [-side[1], -side[0], -side[2]] };
            let clip = f64::from(CLIP);
            [least, most, begin].map(|d| ((d.clamp(-clip, clip) + clip) * f64::from(UNIT)).round() as i16)
        });
        Limits { squared: squared as u8, reach: reach.ceil() as usize, of_code }
    }

    /// Adds to each code the distance to the nearest voxel of the other side.
    fn mark_distances(&self, codes: &mut [u8], grid: Grid) {
        let border: Vec<Vec<Border>> =
            (0..grid.0[2]).into_par_iter().map(|z| border(codes, grid, z)).collect();
        let reach = self.reach;
        codes.par_chunks_mut(grid.0[0] * grid.0[1]).enumerate().for_each(|(z, plane)| {
            for (other, border) in border.iter().enumerate().take(z + reach + 1).skip(z.saturating_sub(reach))
            {
                let along_z = other.abs_diff(z).pow(2);
                border.iter().for_each(|voxel| self.mark_near(plane, grid, voxel, along_z));
            }
        });
    }

    /// Marks in a plane the voxels near one of the other side, whose squared distance from the plane is
    /// `along_z`.
    fn mark_near(&self, plane: &mut [u8], grid: Grid, voxel: &Border, along_z: usize) {
        let squared = usize::from(self.squared);
        for y in voxel.y.saturating_sub(self.reach)..(voxel.y + self.reach + 1).min(grid.0[1]) {
            let Some(left @ 1..) = squared.checked_sub(along_z + y.abs_diff(voxel.y).pow(2)) else {
                continue;
            };
            let half = (left - 1).isqrt();
            let first = voxel.x.saturating_sub(half);
            let row = &mut plane[grid.0[0] * y..][..grid.0[0]];
            for (x, code) in (first..).zip(&mut row[first..(voxel.x + half + 1).min(grid.0[0])]) {
                let short = (left - x.abs_diff(voxel.x).pow(2)) as u8;
                if *code & INSIDE != voxel.side && *code & !INSIDE < short {
                    *code = *code & INSIDE | short;
                }
            }
        }
    }
}

/// A voxel with a neighbour on the other side.
struct Border {
    x: usize,
    y: usize,
    /// [`INSIDE`] or 0.
    side: u8,
}

/// Returns the voxels of a plane of z that share a face with a voxel of the other side. Beyond the faces of
/// the grid is what is at them.
fn border(codes: &[u8], grid: Grid, z: usize) -> Vec<Border> {
    let [nx, ny, nz] = grid.0;
    let mut found = Vec::new();
    let mut differs = vec![0_u8; nx];
    for y in 0..ny {
        let row = &codes[grid.row(y, z)];
        differs.fill(0);
        let others =
            [(y.max(1) - 1, z), ((y + 1).min(ny - 1), z), (y, z.max(1) - 1), (y, (z + 1).min(nz - 1))];
        for (y, z) in others {
            let other = &codes[grid.row(y, z)];
            differs.iter_mut().zip(row).zip(other).for_each(|((out, a), b)| *out |= a ^ b);
        }
        differs[1..].iter_mut().zip(row).zip(&row[1..]).for_each(|((out, a), b)| *out |= a ^ b);
        differs.iter_mut().zip(row).zip(&row[1..]).for_each(|((out, a), b)| *out |= a ^ b);
        let at = differs.iter().enumerate().filter(|(_, differs)| **differs & INSIDE != 0);
        found.extend(at.map(|(x, _)| Border { x, y, side: row[x] & INSIDE }));
    }
    found
}

/// Marks the voxels that the number would let change sides and that have no deeper one of their side beside
/// them, corners included.
fn mark_ridges(codes: &mut [u8], grid: Grid, limits: &Limits) {
    let [nx, ny, nz] = grid.0;
    let middle = CLIP * UNIT;
    let may_change = |code: u8| {
        let [least, most, _] = limits.of_code[usize::from(code)];
        least <= middle && middle <= most
    };
    // The deeper a voxel, the less its distance falls short.
    let is_ridge = |at: usize, [x, y, z]: [usize; 3]| {
        let around = (z.max(1) - 1..(z + 2).min(nz))
            .flat_map(|z| (y.max(1) - 1..(y + 2).min(ny)).map(move |y| (y, z)))
            .flat_map(|(y, z)| &codes[grid.row(y, z)][x.max(1) - 1..(x + 2).min(nx)]);
        { around }.all(|&code| (code ^ codes[at]) & INSIDE != 0 || code >= codes[at])
    };
    let ridges: Vec<usize> = (0..ny * nz)
        .into_par_iter()
        .flat_map_iter(|row| {
            let (y, z, is_ridge, codes) = (row % ny, row / ny, &is_ridge, &*codes);
            let may = (0..nx).filter(move |x| {
                let code = codes[row * nx + x];
                code & !INSIDE != 0 && may_change(code)
            });
            may.filter(move |&x| is_ridge(row * nx + x, [x, y, z])).map(move |x| row * nx + x)
        })
        .collect();
    ridges.into_iter().for_each(|at| codes[at] |= RIDGE);
}

/// Returns the smooth depths (`UNIT` per voxel, 0 is `CLIP` voxels outside) between the bounds of the codes.
fn smoothed(codes: &[u8], grid: Grid, limits: &Limits, slack: f64) -> Vec<i16> {
    let limit = |code: u8| limits.of_code[usize::from(code)];
    let mut depths = vec![0_i16; grid.len()];
    depths.par_iter_mut().zip(codes).filter(|(_, code)| **code != 0).for_each(|(out, &code)| {
        *out = limit(code)[2];
    });
    // Wide strides carry far, narrow ones take away what wide ones do not see.
    let widest = (2 + slack as usize).min(WIDEST);
    let near = near_surface(codes, grid, 0);
    let around = dilated(&near_surface(codes, grid, widest), grid, widest);
    let mut sharpened = vec![0_i16; grid.len()];
    for stride in (0..ROUNDS).flat_map(|_| (1..=widest).rev()) {
        filter(&depths, &mut sharpened, grid, &around, stride, |at, b| 2 * depths[at] - b);
        filter(&sharpened, &mut depths, grid, &near, stride, |at, b| {
            let [least, most, _] = limit(codes[at]);
            b.clamp(least, most)
        });
    }
    depths
}

/// Returns for each run of voxels, x fastest, whether a voxel in it, or within `reach` of it along x, is
/// near the surface.
fn near_surface(codes: &[u8], grid: Grid, reach: usize) -> Vec<bool> {
    let near = |codes: &[u8]| codes.iter().any(|code| code & !INSIDE != 0);
    let runs = (0..grid.runs()).map(|run| WIDEST + run * RUN - reach..WIDEST + (run + 1) * RUN + reach);
    codes.par_chunks(grid.0[0]).flat_map_iter(|row| runs.clone().map(|run| near(&row[run]))).collect()
}

/// Returns for each run whether one that is set lies within `reach` rows along y and z.
fn dilated(set: &[bool], grid: Grid, reach: usize) -> Vec<bool> {
    let ([_, ny, nz], runs) = (grid.0, grid.runs());
    let along = |set: &[bool], step: usize, n: usize| -> Vec<bool> {
        let around = |i: usize| {
            let c = i / step % n;
            (c.saturating_sub(reach)..(c + reach + 1).min(n)).any(|other| set[i + step * other - step * c])
        };
        (0..set.len()).into_par_iter().map(around).collect()
    };
    along(&along(set, runs, ny), runs * ny, nz)
}

/// Writes `write(voxel, filtered)` to each voxel of the runs that are set: the binomial filter ¼ ½ ¼ along
/// each axis, of voxels that are `stride` apart. Beyond the faces of the grid is what is at them.
fn filter(
    from: &[i16],
    to: &mut [i16],
    grid: Grid,
    set: &[bool],
    stride: usize,
    write: impl Fn(usize, i16) -> i16 + Sync,
) {
    let ([nx, ny, nz], runs) = (grid.0, grid.runs());
    let beside = |c: usize, n: usize| [c.saturating_sub(stride), c, (c + stride).min(n - 1)];
    to.par_chunks_mut(nx).enumerate().for_each(|(row, to)| {
        let set = &set[row * runs..][..runs];
        if !set.contains(&true) {
            return;
        }
        let rows = beside(row / ny, nz).map(|z| beside(row % ny, ny).map(|y| &from[grid.row(y, z)]));
        let (mut planes, mut wide, mut filtered) = ([[0; WIDE]; 3], [0; WIDE], [0; RUN]);
        for run in (0..runs).filter(|&run| set[run]) {
            // With lengths that are known the compiler makes vectors of these loops.
            for (out, rows) in planes.iter_mut().zip(&rows) {
                binomial(out, rows.map(|row| &row[run * RUN..]));
            }
            binomial(&mut wide, planes.each_ref().map(|plane| &plane[..]));
            binomial(&mut filtered, [WIDEST - stride, WIDEST, WIDEST + stride].map(|first| &wide[first..]));
            let first = WIDEST + run * RUN;
            for (i, (out, filtered)) in to[first..].iter_mut().zip(&filtered).enumerate() {
                *out = write(row * nx + first + i, *filtered);
            }
        }
    });
}

/// Writes the means of three rows with weights ¼ ½ ¼. Depths and twice their range, times four, fit into the
/// type.
fn binomial<const N: usize>(out: &mut [i16; N], rows: [&[i16]; 3]) {
    let [a, b, c] = rows.map(|row| &row[..N]);
    for i in 0..N {
        out[i] = (a[i] + 2 * b[i] + c[i] + 2) >> 2;
    }
}

#[cfg(test)]
mod tests;
