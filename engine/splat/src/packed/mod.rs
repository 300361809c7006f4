//! Packed splats of 16 bytes: what a renderer keeps of a set if memory and bandwidth matter.
//!
//! The splats are put in Morton order of their means and cut into chunks of [`CHUNK`]; a chunk has the box of
//! its means and the range of its log scales (32 bytes, ⅛ byte a splat), the set has the ranges of logit and
//! intensity. Numbers are steps between the ends of their range, so both ends are exact. A row is four words,
//! bits counted from the lowest:
//!
//! | word | bits |
//! |---|---|
//! | 0 | mean x 12, y 12, z 8 of 12, in the box of the chunk |
//! | 1 | quaternion: three components of 10 bits in ±1/√2, then 2: index of the largest, which is omitted |
//! | 2 | log scales 3 × 9, in the range of the chunk; opacity logit 5 of 9 |
//! | 3 | intensity 16, label 8, the upper 4 of z, the upper 4 of the logit |
//!
//! Against 11-10-11 bits for the mean, 8 for scales and opacity and 8 left over, this division of the same
//! bits brings 7 dB on default fits, the most of those tried (V̂ of the packed against that of the full set:
//! 74 to 89 dB over the range of the volume). A uniform logit is better than a uniform α or ln α, of which
//! the weak or the strong splats are lost. Where intensities run far out of the volume's range, the kernel is
//! cut off sharply and ε is small, as in the paper's profile, single samples at the rim of a splat flip:
//! there 48 to 63 dB are left.
//!
//! `include/packed.glsl` reads the same rows in f32.

use std::f64::consts::FRAC_1_SQRT_2;

use rayon::prelude::*;
pub use shader_interface::types::{PackedChunk, PackedRange};

use super::Splat;
use super::activation::{LOG_SCALE_LIMIT, unit_quaternion};

/// Number of splats of a chunk; only the last chunk may have fewer.
pub const CHUNK: usize = shader_interface::packed::PACKED_CHUNK as usize;

/// Greatest code of a coordinate of the mean.
const MEAN_CODES: u32 = (1 << 12) - 1;
/// Greatest code of a log scale and of the logit.
const NINE_BITS: u32 = (1 << 9) - 1;
/// Greatest code of the intensity.
const INTENSITY_CODES: u32 = (1 << 16) - 1;
/// Code of a quaternion component of 0, which is exact; -1/√2 is 0, 1/√2 is twice this.
const ROTATION_ZERO: u32 = (1 << 9) - 1;
/// Bits of a coordinate in the Morton code.
const MORTON_BITS: u32 = 21;
/// Logits are clamped to ±this: beyond, α is 0 or 1 to 4·10⁻⁸.
pub const LOGIT_LIMIT: f32 = 17.0;

/// A set of splats in 16 bytes each, in an order of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Packed {
    /// The rows.
    pub splats: Vec<[u32; 4]>,
    /// The chunks, one for every [`CHUNK`] rows.
    pub chunks: Vec<PackedChunk>,
    /// Ranges of logit and intensity over the whole set.
    pub range: PackedRange,
    /// For each row, the index of its splat in the set.
    pub order: Vec<u32>,
}

impl Packed {
    /// Packs `splats` and their labels (0 without labels). Values that are not finite are replaced: NaN by 0,
    /// infinities by the greatest f32. Log scales and logits are clamped to ±[`LOG_SCALE_LIMIT`] and
    /// ±[`LOGIT_LIMIT`].
    ///
    /// # Panics
    /// If there are labels, but not one for every splat.
    pub fn new(splats: &[Splat], labels: Option<&[u8]>) -> Packed {
        assert!(labels.is_none_or(|labels| labels.len() == splats.len()), "one label for every splat");
        let order = morton_order(splats);
        let tamed: Vec<Splat> = order.par_iter().map(|&i| tame(&splats[i as usize])).collect();
        let [logit_low, logit_high] = bounds(tamed.iter().map(|s| s.opacity_logit));
        let [intensity_low, intensity_high] = bounds(tamed.iter().map(|s| s.intensity));
        let range = PackedRange { logit_low, logit_high, intensity_low, intensity_high };
        let chunks: Vec<PackedChunk> = tamed.par_chunks(CHUNK).map(chunk_of).collect();
        let splats = tamed
            .par_iter()
            .zip(&order)
            .enumerate()
            .map(|(row, (splat, &i))| {
                pack(splat, labels.map_or(0, |labels| labels[i as usize]), &chunks[row / CHUNK], &range)
            })
            .collect();
        Packed { splats, chunks, range, order }
    }

    /// Returns the number of splats.
    pub fn len(&self) -> usize {
        self.splats.len()
    }

    /// Returns true if there are no splats.
    pub fn is_empty(&self) -> bool {
        self.splats.is_empty()
    }

    /// Returns the size of rows and chunks in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.splats) + size_of_val(&*self.chunks)
    }

    /// Returns the splat of row `row`, with a unit quaternion.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn unpack(&self, row: usize) -> Splat {
        let ([w0, w1, w2, w3], chunk, range) = (self.splats[row], &self.chunks[row / CHUNK], &self.range);
        let z = w0 >> 24 | (w3 >> 24 & 0xf) << 8;
        let means = [w0 & 0xfff, w0 >> 12 & 0xfff, z];
        let logit = w2 >> 27 | (w3 >> 28) << 5;
        let log_scale = |axis: usize| w2 >> (9 * axis) & NINE_BITS;
        Splat {
            mean: std::array::from_fn(|axis| {
                between(chunk.low[axis], chunk.high[axis], means[axis], MEAN_CODES)
            }),
            opacity_logit: between(range.logit_low, range.logit_high, logit, NINE_BITS),
            rotation: unpack_rotation(w1).map(|v| v as f32),
            log_scale: std::array::from_fn(|axis| {
                between(chunk.log_scale_low, chunk.log_scale_high, log_scale(axis), NINE_BITS)
            }),
            intensity: between(range.intensity_low, range.intensity_high, w3 & 0xffff, INTENSITY_CODES),
        }
    }

    /// Returns all splats in the order of the rows.
    pub fn unpack_all(&self) -> Vec<Splat> {
        (0..self.len()).into_par_iter().map(|row| self.unpack(row)).collect()
    }

    /// Returns the label of row `row`; 0 stands for no label.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn label(&self, row: usize) -> u8 {
        (self.splats[row][3] >> 16) as u8
    }
}

/// Returns `splat` with finite parameters within their limits.
fn tame(splat: &Splat) -> Splat {
    let finite = |v: f32| if v.is_nan() { 0.0 } else { v.clamp(f32::MIN, f32::MAX) };
    Splat {
        mean: splat.mean.map(finite),
        opacity_logit: finite(splat.opacity_logit).clamp(-LOGIT_LIMIT, LOGIT_LIMIT),
        log_scale: splat.log_scale.map(|v| finite(v).clamp(-LOG_SCALE_LIMIT, LOG_SCALE_LIMIT)),
        intensity: finite(splat.intensity),
        rotation: splat.rotation,
    }
}

/// Returns the least and the greatest value; zeros if there is none.
fn bounds(values: impl Iterator<Item = f32>) -> [f32; 2] {
    values
        .map(|v| [v; 2])
        .reduce(|[low, high], [v, _]| [low.min(v), high.max(v)])
        // Of -0 and 0 either may come first; adding 0 makes them one.
        .map_or([0.0; 2], |range| range.map(|v| 0.0 + v))
}

/// Returns the indices of `splats` along a Morton curve through the cube around their means; splats of equal
/// code keep their order.
fn morton_order(splats: &[Splat]) -> Vec<u32> {
    let boxes: [[f64; 2]; 3] =
        std::array::from_fn(|axis| bounds(splats.iter().map(|s| tame(s).mean[axis])).map(f64::from));
    let extent = boxes.iter().map(|[low, high]| high - low).fold(0.0, f64::max);
    let cells = if extent > 0.0 { f64::from((1u32 << MORTON_BITS) - 1) / extent } else { 0.0 };
    let code = |splat: &Splat| {
        let mean = tame(splat).mean;
        let cell: [u64; 3] =
            std::array::from_fn(|axis| ((f64::from(mean[axis]) - boxes[axis][0]) * cells) as u64);
        (0..MORTON_BITS).rev().fold(0u64, |code, bit| {
            cell.iter().fold(code, |code, coordinate| code << 1 | (coordinate >> bit & 1))
        })
    };
    let mut keys: Vec<(u64, u32)> =
        splats.par_iter().zip(0..splats.len() as u32).map(|(s, i)| (code(s), i)).collect();
    keys.par_sort_unstable();
    keys.into_iter().map(|(_, index)| index).collect()
}

fn chunk_of(splats: &[Splat]) -> PackedChunk {
    let axes: [[f32; 2]; 3] = std::array::from_fn(|axis| bounds(splats.iter().map(|s| s.mean[axis])));
    let [log_scale_low, log_scale_high] = bounds(splats.iter().flat_map(|s| s.log_scale));
    PackedChunk {
        low: axes.map(|[low, _]| low),
        log_scale_low,
        high: axes.map(|[_, high]| high),
        log_scale_high,
    }
}

fn pack(splat: &Splat, label: u8, chunk: &PackedChunk, range: &PackedRange) -> [u32; 4] {
    let [x, y, z] =
        std::array::from_fn(|axis| code(chunk.low[axis], chunk.high[axis], splat.mean[axis], MEAN_CODES));
    let [s0, s1, s2] = splat.log_scale.map(|v| code(chunk.log_scale_low, chunk.log_scale_high, v, NINE_BITS));
    let logit = code(range.logit_low, range.logit_high, splat.opacity_logit, NINE_BITS);
    let intensity = code(range.intensity_low, range.intensity_high, splat.intensity, INTENSITY_CODES);
    [
        x | y << 12 | (z & 0xff) << 24,
        pack_rotation(splat.rotation),
        s0 | s1 << 9 | s2 << 18 | (logit & 0x1f) << 27,
        intensity | u32::from(label) << 16 | (z >> 8) << 24 | (logit >> 5) << 28,
    ]
}

/// Returns the code of `value`: the number of the nearest of `last` + 1 even steps from `low` to `high`.
fn code(low: f32, high: f32, value: f32, last: u32) -> u32 {
    let [low, high, value] = [low, high, value].map(f64::from);
    if high > low { ((value - low) / (high - low) * f64::from(last)).round() as u32 } else { 0 }
}

/// Returns the value of step `code` of `last` from `low` to `high`. Both ends are weighted, so that no
/// difference can leave f32.
fn between(low: f32, high: f32, code: u32, last: u32) -> f32 {
    let t = f64::from(code) / f64::from(last);
    (f64::from(low) * (1.0 - t) + f64::from(high) * t) as f32
}

fn pack_rotation(rotation: [f32; 4]) -> u32 {
    let q = unit_quaternion(rotation);
    let parts = [q.w, q.x, q.y, q.z];
    let largest = (1..4).fold(0, |best, k| if parts[k].abs() > parts[best].abs() { k } else { best });
    let sign = 1f64.copysign(parts[largest]);
    let zero = f64::from(ROTATION_ZERO);
    let three = (0..4).filter(|&k| k != largest).map(|k| {
        let step = (sign * parts[k] / FRAC_1_SQRT_2 * zero).round().clamp(-zero, zero);
        (step + zero) as u32
    });
    three.zip([0, 10, 20]).fold((largest as u32) << 30, |word, (code, shift)| word | code << shift)
}

fn unpack_rotation(word: u32) -> [f64; 4] {
    let largest = (word >> 30) as usize;
    let zero = f64::from(ROTATION_ZERO);
    let mut rotation = [0.0; 4];
    for (k, shift) in (0..4).filter(|&k| k != largest).zip([0, 10, 20]) {
        rotation[k] = (f64::from(word >> shift & 0x3ff) - zero) / zero * FRAC_1_SQRT_2;
    }
    let rest: f64 = rotation.iter().map(|v| v * v).sum();
    rotation[largest] = (1.0 - rest).max(0.0).sqrt();
    rotation
}

#[cfg(test)]
mod tests;
