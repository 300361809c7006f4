//! How far structures move within the plane from one slice to the next: a rib or an oblique surface lies elsewhere in
//! each slice, and interpolating straight from slice to slice makes steps of it.
//!
//! Registration-based interpolation (Penney, Schnabel, Rueckert, Viergever and Niessen 2004) with block matching on
//! slices of half the resolution. The displacement of a pixel is the one with the least mean |difference| of both
//! slices around it, each moved by half, plus a price for its length; the field of them is then smoothed. Where
//! nothing tells them apart, as in noise, the price decides, and structures stay in place.

use rayon::prelude::*;

use super::grid::FinerSlices;
use crate::Volume;

/// Greatest displacement from one slice to the next, in distances of slices: surfaces that lie flatter have steps.
const MOST: f64 = 1.2;
/// Price of a displacement by a pixel of half the resolution, in mean |differences| of neighbouring slices.
const PRICE: f32 = 0.3;
/// The mean around a pixel is that of two boxes of twice this and one pixels of half the resolution, one after the other ...
const AROUND: usize = 3;
/// ... and so is the smoothing of displacements.
const SMOOTHING: usize = 2;
/// Displacements below this are none, pixels.
const LEAST: f32 = 0.01;

/// Displacements from each slice of a grid to the next, along the two axes of a slice.
#[derive(Clone, Debug)]
pub struct Displacements {
    /// Pixels of half the resolution along the two axes.
    size: [usize; 2],
    /// Displacements in pixels of the full resolution, by slice; empty where nothing moves.
    fields: Vec<Vec<[f32; 2]>>,
    /// Bound of them, pixels of the full resolution along the two axes.
    pub(super) most: [usize; 2],
}

impl Displacements {
    /// Returns no displacement at all.
    pub fn none() -> Self {
        Displacements { size: [0; 2], fields: Vec::new(), most: [0; 2] }
    }

    /// Returns the displacements from each slice of `volume` to the next. What is not finite counts as its least
    /// sample.
    ///
    /// # Panics
    /// If the volume is not on the grid.
    pub fn of(grid: &FinerSlices, volume: &Volume) -> Self {
        assert_eq!(volume.size, grid.coarse_size, "a volume of the grid");
        let low = volume.min_max().map_or(0.0, |(low, _)| low);
        let [width, height] = grid.slice_size();
        let size = [width.div_ceil(2), height.div_ceil(2)];
        let count = grid.coarse_size[grid.axis];
        let halved = |slice: usize| {
            let at = |x: usize, y: usize| {
                let value = volume.samples[grid.index(slice, [x.min(width - 1), y.min(height - 1)])];
                if value.is_finite() { value } else { low }
            };
            let mean = |i: usize| {
                let [x, y] = [2 * (i % size[0]), 2 * (i / size[0])];
                0.25 * (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1))
            };
            (0..size[0] * size[1]).map(mean).collect::<Vec<f32>>()
        };
        let slices: Vec<Vec<f32>> = (0..count).into_par_iter().map(halved).collect();
        let difference = |pair: &[Vec<f32>]| {
            pair[0].iter().zip(&pair[1]).map(|(a, b)| f64::from((a - b).abs())).sum::<f64>()
        };
        let differences: Vec<f64> = slices.par_windows(2).map(difference).collect();
        let mean = differences.iter().sum::<f64>() / (differences.len() * size[0] * size[1]).max(1) as f64;
        let spacing = grid.spacing_mm();
        let reach =
            grid.across().map(|axis| (MOST * spacing[grid.axis] / (2.0 * spacing[axis])).round() as isize);
        let moves = moves(reach);
        let fields = slices
            .par_windows(2)
            .map(|pair| matched(&pair[0], &pair[1], size[0], &moves, PRICE * mean as f32));
        Displacements { size, fields: fields.collect(), most: reach.map(|n| 2 * n as usize) }
    }

    /// Returns the displacement from a slice to the next at a pixel half-way, pixels along the two axes.
    pub(super) fn at(&self, slice: usize, [x, y]: [usize; 2]) -> [f32; 2] {
        let Some(field) = self.fields.get(slice) else { return [0.0; 2] };
        let place = |at: usize, size: usize| {
            let at = (0.5 * at as f32 - 0.25).clamp(0.0, (size - 1) as f32);
            (at as usize, (at as usize + 1).min(size - 1), at.fract())
        };
        let [(x0, x1, fx), (y0, y1, fy)] = [place(x, self.size[0]), place(y, self.size[1])];
        let row = |y: usize| (field[y * self.size[0] + x0], field[y * self.size[0] + x1]);
        let (near, far) = (row(y0), row(y1));
        let found: [f32; 2] = std::array::from_fn(|k| {
            let lerp = |(a, b): ([f32; 2], [f32; 2])| a[k] + (b[k] - a[k]) * fx;
            lerp(near) + (lerp(far) - lerp(near)) * fy
        });
        if found.iter().all(|by| by.abs() < LEAST) { [0.0; 2] } else { found }
    }
}

/// Returns all displacements within an ellipse, the shortest first.
fn moves([most_x, most_y]: [isize; 2]) -> Vec<[isize; 2]> {
    let part = |by: isize, most: isize| if by == 0 { 0.0 } else { (by as f64 / most as f64).powi(2) };
    let mut moves: Vec<[isize; 2]> = (-most_y..=most_y)
        .flat_map(|y| (-most_x..=most_x).map(move |x| [x, y]))
        .filter(|&[x, y]| part(x, most_x) + part(y, most_y) <= 1.0)
        .collect();
    moves.sort_by_key(|[x, y]| x * x + y * y);
    moves
}

/// Returns the displacement of each pixel between two slices with rows of `width` pixels, in pixels of the full
/// resolution, where one by a pixel costs `price`.
fn matched(from: &[f32], to: &[f32], width: usize, moves: &[[isize; 2]], price: f32) -> Vec<[f32; 2]> {
    let best = best_moves(from, to, width, moves, price);
    let mut sums = Vec::new();
    let mut smoothed = |k: usize| {
        let mut along: Vec<f32> = best.iter().map(|moved| 2.0 * moved[k] as f32).collect();
        smooth(&mut along, width, SMOOTHING, &mut sums);
        along
    };
    let along = [smoothed(0), smoothed(1)];
    (0..from.len()).map(|i| [along[0][i], along[1][i]]).collect()
}

/// Returns which of `moves` each pixel makes from a slice to the next, in its pixels.
fn best_moves(from: &[f32], to: &[f32], width: usize, moves: &[[isize; 2]], price: f32) -> Vec<[isize; 2]> {
    let height = from.len() / width;
    let place = |at: usize, by: isize, most: usize| (at as isize + by).clamp(0, most as isize - 1) as usize;
    let mut best = vec![(f32::INFINITY, [0; 2]); from.len()];
    let (mut cost, mut sums) = (vec![0.0f32; from.len()], Vec::new());
    for by in moves {
        // Each slice moves by half, the one that comes after by what is left.
        let back = by.map(|by| -by.div_euclid(2));
        let forth = [by[0] + back[0], by[1] + back[1]];
        for (y, row) in cost.chunks_mut(width).enumerate() {
            let a = &from[place(y, back[1], height) * width..][..width];
            let b = &to[place(y, forth[1], height) * width..][..width];
            for (x, out) in row.iter_mut().enumerate() {
                *out = (a[place(x, back[0], width)] - b[place(x, forth[0], width)]).abs();
            }
        }
        smooth(&mut cost, width, AROUND, &mut sums);
        let length = ((by[0] * by[0] + by[1] * by[1]) as f32).sqrt();
        for (best, cost) in best.iter_mut().zip(&cost) {
            let cost = cost + price * length;
            if cost < best.0 {
                *best = (cost, *by);
            }
        }
    }
    best.into_iter().map(|(_, by)| by).collect()
}

/// Replaces each value by its mean over a box of 2 `radius` + 1 values a side, within the slice, twice. `sums` is a work
/// buffer.
fn smooth(values: &mut [f32], width: usize, radius: usize, sums: &mut Vec<f32>) {
    let height = values.len() / width;
    for _ in 0..2 {
        // Along rows, by the sums from the beginning of each ...
        for row in values.chunks_mut(width) {
            sums.clear();
            sums.push(0.0);
            let mut sum = 0.0;
            sums.extend(row.iter().map(|v| {
                sum += v;
                sum
            }));
            for (x, out) in row.iter_mut().enumerate() {
                let (low, high) = (x.saturating_sub(radius), (x + radius + 1).min(width));
                *out = (sums[high] - sums[low]) / (high - low) as f32;
            }
        }
        // ... and along columns, by sums that move down.
        sums.clear();
        sums.extend_from_slice(values);
        let rows = &*sums;
        let row = |y: usize| &rows[y * width..(y + 1) * width];
        let mut sum = vec![0.0f32; width];
        let add = |sum: &mut [f32], y: usize, sign: f32| {
            sum.iter_mut().zip(row(y)).for_each(|(sum, v)| *sum += sign * v);
        };
        (0..radius.min(height)).for_each(|y| add(&mut sum, y, 1.0));
        for (y, out) in values.chunks_mut(width).enumerate() {
            if y + radius < height {
                add(&mut sum, y + radius, 1.0);
            }
            if y > radius {
                add(&mut sum, y - radius - 1, -1.0);
            }
            let count = (y + radius + 1).min(height) - y.saturating_sub(radius);
            out.iter_mut().zip(&sum).for_each(|(out, sum)| *out = sum / count as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;

    /// Returns a volume of slices four times as far apart as their pixels.
    fn thick(size: [usize; 3], value: impl FnMut([usize; 3]) -> f32) -> (Volume, FinerSlices) {
        let voxel = |i: usize| [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])];
        let samples = (0..size.iter().product()).map(voxel).map(value).collect();
        let volume = Volume::new(size, DAffine3::from_scale(DVec3::new(1.0, 1.0, 4.0)), samples);
        let finer = FinerSlices::of(size, &volume.world_from_voxel).expect("thick slices");
        (volume, finer)
    }

    /// The mean over a box twice, by its words.
    fn smoothed(values: &[f64], width: usize, radius: usize) -> Vec<f64> {
        let height = values.len() / width;
        let mean = |values: &[f64], i: usize| {
            let near = |at: usize, size: usize| at.saturating_sub(radius)..(at + radius + 1).min(size);
            let (xs, ys) = (near(i % width, width), near(i / width, height));
            let all: Vec<f64> = ys.flat_map(|y| xs.clone().map(move |x| values[y * width + x])).collect();
            all.iter().sum::<f64>() / all.len() as f64
        };
        let once: Vec<f64> = (0..values.len()).map(|i| mean(values, i)).collect();
        (0..values.len()).map(|i| mean(&once, i)).collect()
    }

    #[test]
    fn moves_are_the_best_of_all() {
        let (width, height, price) = (19, 13, 11.0);
        let mut random = Pcg64::seed_from_u64(3);
        let mut rough =
            || (0..width * height).map(|_| random.random_range(0.0..100.0f32)).collect::<Vec<f32>>();
        let (from, to) = (rough(), rough());
        let moves = moves([3, 2]);
        assert_eq!((moves[0], moves.len()), ([0, 0], 19));
        let place =
            |at: usize, by: isize, most: usize| (at as isize + by).clamp(0, most as isize - 1) as usize;
        let costs: Vec<Vec<f64>> = moves
            .iter()
            .map(|by| {
                let half = by.map(|by| by.div_euclid(2));
                let difference = |i: usize| {
                    let (x, y) = (i % width, i / width);
                    let a = from[place(x, -half[0], width) + width * place(y, -half[1], height)];
                    let b = to[place(x, by[0] - half[0], width) + width * place(y, by[1] - half[1], height)];
                    f64::from((a - b).abs())
                };
                let all: Vec<f64> = (0..width * height).map(difference).collect();
                let length = ((by[0].pow(2) + by[1].pow(2)) as f64).sqrt();
                smoothed(&all, width, AROUND).into_iter().map(|cost| cost + price * length).collect()
            })
            .collect();
        for (i, by) in best_moves(&from, &to, width, &moves, price as f32).into_iter().enumerate() {
            let own = moves.iter().position(|other| *other == by).expect("one of them");
            let least = costs.iter().map(|cost| cost[i]).fold(f64::INFINITY, f64::min);
            assert!(costs[own][i] <= least + 1e-3, "{i}: {by:?} costs {}, not {least}", costs[own][i]);
        }
    }

    #[test]
    fn what_moves_is_followed() {
        // Waves of some 12 pixels that move by 2 and -2 pixels from slice to slice.
        let wave = |x: f64, y: f64| 300.0 * ((0.5 * x).sin() * (0.4 * y + 0.2 * x).cos()) as f32;
        let at = |[x, y, z]: [f64; 3]| wave(x - 2.0 * z, y + 2.0 * z);
        let size = [60, 50, 5];
        let (volume, finer) = thick(size, |voxel| at(voxel.map(|v| v as f64)));
        let along = Displacements::of(&finer, &volume);
        let error = |along: &Displacements| {
            let fine = finer.volume(&volume, None, along);
            let mut squares = 0.0;
            for z in 4..13 {
                for (x, y) in (12..40).flat_map(|y| (12..48).map(move |x| (x, y))) {
                    let wanted = at([x as f64, y as f64, z as f64 / 4.0]);
                    squares += f64::from(fine.samples[fine.index(x, y, z)] - wanted).powi(2);
                }
            }
            (squares / (9.0 * 28.0 * 36.0)).sqrt()
        };
        for (x, y) in [(20, 20), (30, 25), (40, 30)] {
            let [by_x, by_y] = along.at(2, [x, y]);
            assert!((by_x - 2.0).abs() < 1.0 && (by_y + 2.0).abs() < 1.0, "{by_x}, {by_y}");
        }
        let (followed, straight) = (error(&along), error(&Displacements::none()));
        assert!(followed < 0.6 * straight, "{followed} HU, and {straight} straight");
    }

    #[test]
    fn what_does_not_move_stays() {
        let mut random = Pcg64::seed_from_u64(4);
        let size = [41, 30, 6];
        let (constant, finer) = thick(size, |_| 7.0);
        let (same, _) = thick(size, |[x, y, _]| (x * x + 3 * y) as f32);
        let (noise, _) = thick(size, |_| random.random_range(-50.0..50.0));
        let longest = |volume: &Volume| {
            let along = Displacements::of(&finer, volume);
            let pixels = (0..41 * 30 * 5).map(|i| along.at(i / (41 * 30), [i % 41, i / 41 % 30]));
            pixels.map(|[x, y]| x.hypot(y)).fold(0.0, f32::max)
        };
        assert_eq!((longest(&constant), longest(&same)), (0.0, 0.0));
        assert!(longest(&noise) < 0.5, "{}", longest(&noise));
        assert_eq!(Displacements::none().at(3, [1, 2]), [0.0; 2]);
    }
}
