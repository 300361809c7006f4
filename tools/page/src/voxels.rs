//! A decoded field as bytes, for splats that a page does not decode itself: the other payload of a page beside
//! `.vgs`.
//!
//! | bytes | what they are |
//! |---|---|
//! | 8 | the mark `\x89VGF\r\n\x1a\n` |
//! | 4, 4 | version 1, CRC-32 of all that follows; little endian, as all numbers |
//! | 3 · 4, 12 · 8 | voxels along x, y, z; rows of the affine from voxels to mm RAS |
//! | 8, 2 · 4 | mean edge of a voxel of the CT, mm; range of V |
//! | 8, 4 | step of V, counted from the least V; V where nothing is |
//! | 1, 1, n + 1 | 1 if O is soft; n; the labels |
//! | the rest | bricks with anything in them; O and labels; V: written by one range coder |
//!
//! V is there where a sample can need it: at voxels with O and the 26 around each of them. It is predicted from
//! the voxels before it: by seven predictors, weighted by how wrong each was nearby. What is left is coded by how
//! wrong all were together. That takes a fifth less than deflated bytes. The range coder is that of `.vgs`
//! files. All is computed in integers, and in +, −, × and ÷ of f64, so that
//! `web/field/voxels.ts` finds the same numbers.

use engine::splat::vgs::coder::{Encoder, Tree};

/// The first bytes.
const MARK: [u8; 8] = *b"\x89VGF\r\n\x1a\n";
const VERSION: u32 = 1;
/// Greatest number of steps of V.
const MOST_STEPS: f64 = (1 << 24) as f64;
/// Predictors of V.
const PREDICTORS: usize = 7;
/// Errors count at most this.
const MOST_ERROR: i64 = 1 << 20;
/// What stands for the error nearby where nothing is.
const UNKNOWN_ERROR: i64 = 100;
/// Contexts of what is left of V, and of O.
const V_CONTEXTS: usize = 48;
const O_CONTEXTS: usize = 10;
/// O in a file.
const WHOLE: f32 = 255.0;
/// Voxels around a slice, so that those beside its faces need no question.
const PAD: usize = 2;

/// A field on the voxels of a box, x fastest.
pub struct VoxelField {
    /// Voxels along x, y, z. Those at the faces should be empty.
    pub size: [u32; 3],
    /// Rows of the affine from voxels to mm RAS.
    pub world_from_voxel: [f64; 12],
    /// Mean edge of a voxel of the CT's grid, mm.
    pub edge_mm: f64,
    /// Least and greatest V over the voxels that splats reach.
    pub range: [f32; 2],
    /// Greatest error that V may have.
    pub tolerance: f64,
    /// V.
    pub values: Vec<f32>,
    /// O, 0 to 1.
    pub occupancies: Vec<f32>,
    /// Labels of the voxels.
    pub labels: Option<Vec<u8>>,
}

/// Returns the bytes of a field.
pub fn encode(field: &VoxelField) -> Vec<u8> {
    let extent = Extent::of(field.size);
    let occupancies: Vec<u8> = field.occupancies.iter().map(|&o| (o * WHOLE).round() as u8).collect();
    let soft = field.occupancies.iter().any(|&o| o > 0.0 && o < 1.0);
    let there = |i: usize| occupancies[i] > 0;
    let first = f64::from(field.range[0]);
    let step = (2.0 * field.tolerance).max((f64::from(field.range[1]) - first) / MOST_STEPS).max(1e-30);
    let labels = used_labels(field, &occupancies);
    let mut head = Vec::new();
    field.size.iter().for_each(|n| head.extend(n.to_le_bytes()));
    field.world_from_voxel.iter().chain([&field.edge_mm]).for_each(|v| head.extend(v.to_le_bytes()));
    field.range.iter().for_each(|v| head.extend(v.to_le_bytes()));
    head.extend(step.to_le_bytes());
    head.extend(
        mean(field.values.iter().enumerate().filter(|(i, _)| there(*i)).map(|(_, &v)| v)).to_le_bytes(),
    );
    head.extend([u8::from(soft), (labels.len() - 1) as u8]);
    head.extend(&labels);
    let mut out = Encoder::default();
    let flagged = write_bricks(&extent, &occupancies, &mut out);
    write_occupancies(&extent, &flagged, &occupancies, soft, field.labels.as_deref(), &labels, &mut out);
    let steps: Vec<i32> = field
        .values
        .iter()
        .map(|&v| ((f64::from(v) - first) / step).round().clamp(-MOST_STEPS, MOST_STEPS) as i32)
        .collect();
    write_values(&extent, &near(&extent, &occupancies), &steps, &mut out);
    head.extend(out.finish());
    let mut bytes = MARK.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend(crc32(&head).to_le_bytes());
    bytes.extend(head);
    bytes
}

/// Returns the labels of the voxels where anything is, ascending; 0 if there are none.
fn used_labels(field: &VoxelField, occupancies: &[u8]) -> Vec<u8> {
    let mut used = [false; 256];
    for (&label, _) in field.labels.iter().flatten().zip(occupancies).filter(|(_, o)| **o > 0) {
        used[usize::from(label)] = true;
    }
    let labels: Vec<u8> = (0..=u8::MAX).filter(|&label| used[usize::from(label)]).collect();
    if labels.is_empty() { vec![0] } else { labels }
}

fn mean(values: impl Iterator<Item = f32>) -> f32 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + f64::from(v), count + 1.0));
    if count > 0.0 { (sum / count) as f32 } else { 0.0 }
}

/// Returns true if these bytes are a field as it was written.
pub fn is_whole(bytes: &[u8]) -> bool {
    let Some((head, rest)) = bytes.split_at_checked(16) else { return false };
    let word = |at: usize| head[at..].first_chunk().copied().map(u32::from_le_bytes);
    head.starts_with(&MARK) && word(8) == Some(VERSION) && word(12) == Some(crc32(rest))
}

fn crc32(bytes: &[u8]) -> u32 {
    let bit = |crc: u32, _| if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
    !bytes.iter().fold(u32::MAX, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), bit))
}

/// The number of bits of a number.
fn bits_of(n: i64) -> u32 {
    i64::BITS - n.leading_zeros()
}

// ---- The box ----------------------------------------------------------------------------------------------

/// The voxels of a box, and the bricks of 8³ that they lie in: brick b has the voxels 8 b − 1 to 8 b + 6.
struct Extent {
    size: [usize; 3],
    bricks: [usize; 3],
    /// Places of a row, and of a slice, with the voxels around them.
    row: usize,
    slice: usize,
}

impl Extent {
    fn of(size: [u32; 3]) -> Self {
        let size = size.map(|n| n as usize);
        let row = size[0] + 2 * PAD;
        Extent { size, bricks: size.map(|n| (n + 8) / 8), row, slice: row * (size[1] + 2 * PAD) }
    }

    fn index(&self, x: usize, y: usize, z: usize) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    fn brick(&self, x: usize, y: usize, z: usize) -> usize {
        (z * self.bricks[1] + y) * self.bricks[0] + x
    }

    /// Place of a voxel in a slice.
    fn place(&self, x: usize, y: usize) -> usize {
        (y + PAD) * self.row + x + PAD
    }
}

/// Writes which bricks have anything in them, and returns that.
fn write_bricks(b: &Extent, occupancies: &[u8], out: &mut Encoder) -> Vec<bool> {
    let mut flagged = vec![false; b.bricks.iter().product()];
    for z in 0..b.size[2] {
        for y in 0..b.size[1] {
            for x in (0..b.size[0]).filter(|&x| occupancies[b.index(x, y, z)] > 0) {
                flagged[b.brick((x + 1) / 8, (y + 1) / 8, (z + 1) / 8)] = true;
            }
        }
    }
    let mut models = vec![Tree::new(1); 8];
    for z in 0..b.bricks[2] {
        for y in 0..b.bricks[1] {
            for x in 0..b.bricks[0] {
                let before = [
                    x > 0 && flagged[b.brick(x.wrapping_sub(1), y, z)],
                    y > 0 && flagged[b.brick(x, y.wrapping_sub(1), z)],
                    z > 0 && flagged[b.brick(x, y, z.wrapping_sub(1))],
                ];
                let context = before.iter().fold(0, |context, &flag| context << 1 | usize::from(flag));
                out.number(&mut models[context], u32::from(flagged[b.brick(x, y, z)]));
            }
        }
    }
    flagged
}

/// Writes O, and the label where anything is.
fn write_occupancies(
    b: &Extent,
    flagged: &[bool],
    occupancies: &[u8],
    soft: bool,
    of_voxels: Option<&[u8]>,
    labels: &[u8],
    out: &mut Encoder,
) {
    let mut models = vec![Tree::new(1); 1 << 10];
    let mut left = Residuals::new(O_CONTEXTS);
    let mut same = vec![Tree::new(1); 4];
    let mut other = Tree::new(labels.len() as u32 - 1);
    let number = |label: u8| labels.iter().position(|&known| known == label).unwrap_or(0);
    let mut last = 0;
    // O, and 1 + the number of the label.
    let (mut here, mut before) = (vec![[0u16; 2]; b.slice], vec![[0u16; 2]; b.slice]);
    for z in 0..b.size[2] {
        for y in 0..b.size[1] {
            for x in (0..b.size[0]).filter(|x| flagged[b.brick((x + 1) / 8, (y + 1) / 8, (z + 1) / 8)]) {
                let (at, row) = (b.place(x, y), b.row);
                let around = [
                    here[at - 1],
                    here[at - 2],
                    here[at - row - 1],
                    here[at - row],
                    here[at - row + 1],
                    before[at],
                    before[at - 1],
                    before[at + 1],
                    before[at - row],
                    before[at + row],
                ];
                let context = around.iter().fold(0, |context, o| context << 1 | usize::from(o[0] > 0));
                let o = occupancies[b.index(x, y, z)];
                out.number(&mut models[context], u32::from(o > 0));
                if o == 0 {
                    continue;
                }
                let beside: Vec<[u16; 2]> =
                    [around[0], around[3], around[5]].into_iter().filter(|o| o[0] > 0).collect();
                if soft {
                    let known = || beside.iter().map(|o| i64::from(o[0]));
                    let count = beside.len() as i64;
                    let (predicted, context) = match known().max().zip(known().min()) {
                        Some((most, least)) => {
                            ((2 * known().sum::<i64>() + count) / (2 * count), 1 + bits_of(most - least))
                        }
                        None => (128, 0),
                    };
                    left.write(context as usize, i64::from(o) - predicted, out);
                }
                let mut label = 0;
                if let Some(of_voxels) = of_voxels.filter(|_| labels.len() > 1) {
                    label = number(of_voxels[b.index(x, y, z)]);
                    let predicted = beside.first().map_or(last, |o| usize::from(o[1]) - 1);
                    let agreeing = beside.iter().filter(|o| usize::from(o[1]) - 1 == predicted).count();
                    out.number(&mut same[agreeing], u32::from(label == predicted));
                    if label != predicted {
                        out.number(&mut other, label as u32);
                    }
                    last = label;
                }
                here[at] = [u16::from(o), 1 + label as u16];
            }
        }
        std::mem::swap(&mut here, &mut before);
        here.fill([0; 2]);
    }
}

/// Returns the voxels with O and those around them.
fn near(b: &Extent, occupancies: &[u8]) -> Vec<bool> {
    let mut near: Vec<bool> = occupancies.iter().map(|&o| o > 0).collect();
    let strides = [1, b.size[0], b.size[0] * b.size[1]];
    for (axis, stride) in strides.into_iter().enumerate() {
        let from = near.clone();
        for (i, near) in near.iter_mut().enumerate() {
            let along = i / stride % b.size[axis];
            *near = from[i] || along > 0 && from[i - stride] || along + 1 < b.size[axis] && from[i + stride];
        }
    }
    near
}

// ---- V ----------------------------------------------------------------------------------------------------

/// What is known of the voxels of a slice.
#[derive(Clone)]
struct Slice {
    /// V in steps.
    steps: Vec<Option<i32>>,
    /// How wrong each predictor was, and all together.
    errors: Vec<[i64; PREDICTORS]>,
    error: Vec<i64>,
}

/// Writes V where it is near.
fn write_values(b: &Extent, near: &[bool], steps: &[i32], out: &mut Encoder) {
    let empty =
        Slice { steps: vec![None; b.slice], errors: vec![[0; PREDICTORS]; b.slice], error: vec![0; b.slice] };
    let mut left = Residuals::new(V_CONTEXTS);
    let mut last = 0;
    // This slice, the one before it, and the one before that.
    let mut slices = [empty.clone(), empty.clone(), empty.clone()];
    for z in 0..b.size[2] {
        for y in 0..b.size[1] {
            for x in (0..b.size[0]).filter(|&x| near[b.index(x, y, z)]) {
                let at = b.place(x, y);
                let Guess { guesses, weighted, context } = guess(&slices, at, b.row, last);
                let step = steps[b.index(x, y, z)];
                left.write(context, i64::from(step) - weighted, out);
                let wrong = |guess: i64| (i64::from(step) - guess).abs().min(MOST_ERROR);
                slices[0].steps[at] = Some(step);
                slices[0].errors[at] = guesses.map(wrong);
                slices[0].error[at] = wrong(weighted);
                last = i64::from(step);
            }
        }
        slices.rotate_right(1);
        slices[0].clone_from(&empty);
    }
}

/// A prediction.
struct Guess {
    guesses: [i64; PREDICTORS],
    weighted: i64,
    context: usize,
}

/// Predicts V at a place from the voxels before it.
fn guess(slices: &[Slice; 3], at: usize, row: usize, last: i64) -> Guess {
    let known = |slice: usize, at: usize| slices[slice].steps[at].map(i64::from);
    let beside = [known(0, at - 1), known(0, at - row), known(1, at)];
    let beyond = [known(0, at - 2), known(0, at - 2 * row), known(2, at)];
    let count = beside.iter().flatten().count() as i64;
    let mean = match count {
        0 => last,
        n => (2 * beside.iter().flatten().sum::<i64>() + n).div_euclid(2 * n),
    };
    let mut guesses = [mean; PREDICTORS];
    for k in 0..3 {
        if let Some(one) = beside[k] {
            guesses[k] = one;
            guesses[k + 3] = beyond[k].map_or(one, |two| 2 * one - two);
        }
    }
    let edges = [known(0, at - row - 1), known(1, at - 1), known(1, at - row)];
    if let ([Some(w), Some(n), Some(b)], [Some(wn), Some(wb), Some(nb)], Some(wnb)) =
        (beside, edges, known(1, at - row - 1))
    {
        guesses[6] = w + n + b - wn - wb - nb + wnb;
    }
    let places =
        [(0, at - 1), (0, at - row), (1, at), (0, at - row - 1), (0, at - row + 1), (1, at - 1), (1, at + 1)];
    let (mut sum, mut weights) = (0.0, 0.0);
    for (k, guess) in guesses.iter().enumerate() {
        let errors: i64 = places.iter().map(|&(slice, at)| slices[slice].errors[at][k]).sum();
        let wrong = (1 + 2 * errors) as f64;
        let weight = 1.0 / (wrong * wrong);
        sum += weight * *guess as f64;
        weights += weight;
    }
    let there = places.iter().filter(|&&(slice, at)| slices[slice].steps[at].is_some()).count() as i64;
    let errors: i64 = places.iter().map(|&(slice, at)| slices[slice].error[at]).sum();
    let error = if there > 0 { 2 * errors / there } else { UNKNOWN_ERROR };
    let bits = bits_of(error) as usize;
    let context = match bits {
        0 | 1 => bits,
        _ => 2 * bits - 1 + (error >> (bits - 2) & 1) as usize,
    };
    Guess { guesses, weighted: (sum / weights + 0.5).floor() as i64, context }
}

// ---- The coder --------------------------------------------------------------------------------------------

/// Bits of a number below its highest that have models.
const MODELLED_BITS: u32 = 2;

/// Models of what predictions leave.
struct Residuals {
    /// For each context, the models of the number of bits.
    bits: Vec<Tree>,
    signs: Vec<Tree>,
    /// For each number of bits, the models of those below the highest.
    next: Vec<Tree>,
}

impl Residuals {
    fn new(contexts: usize) -> Self {
        let all = |last, count| vec![Tree::new(last); count];
        Residuals {
            bits: all(31, contexts),
            signs: all(1, contexts),
            next: all((1 << MODELLED_BITS) - 1, 32),
        }
    }

    fn write(&mut self, context: usize, number: i64, out: &mut Encoder) {
        let size = number.unsigned_abs() as u32;
        let bits = u32::BITS - size.leading_zeros();
        out.number(&mut self.bits[context], bits);
        if size == 0 {
            return;
        }
        out.number(&mut self.signs[context], u32::from(number < 0));
        let mut rest = bits - 1;
        if rest > MODELLED_BITS {
            rest -= MODELLED_BITS;
            out.number(&mut self.next[bits as usize], size >> rest & ((1 << MODELLED_BITS) - 1));
        } else {
            // Small numbers have models for all of their bits.
            out.number(&mut self.next[bits as usize], size & ((1 << rest) - 1));
            rest = 0;
        }
        while rest > 0 {
            let piece = rest.min(16);
            rest -= piece;
            out.even(size >> rest & ((1 << piece) - 1), 1 << piece);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `web/tests/field.test.ts` reads the same bytes.
    #[test]
    fn a_field_has_the_bytes_that_pages_are_tested_with() {
        let size = [21, 18, 15];
        let voxels = (0..size.iter().product::<u32>())
            .map(|i| [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])]);
        let value = |[x, y, z]: [u32; 3]| ((x * x * 5 + y * 40 + z * z * y) % 700) as f32 * 1.5 - 300.0;
        let occupancy = |[x, y, z]: [u32; 3]| {
            let inside = x > 0 && y > 0 && z > 0 && x < 20 && y < 17 && z < 14;
            let there = inside && (x + 2 * y) % 9 < 6;
            if there { (((x + y + 2 * z) % 12) as f32 / 6.0).min(1.0) } else { 0.0 }
        };
        let field = VoxelField {
            size,
            world_from_voxel: [1.0, 0.0, 0.0, -4.0, 0.0, 1.5, 0.0, 5.5, 0.0, 0.0, 2.0, 6.0],
            edge_mm: 1.5,
            range: [-300.0, 748.5],
            tolerance: 0.25,
            values: voxels.clone().map(value).collect(),
            occupancies: voxels.clone().map(occupancy).collect(),
            labels: Some(voxels.map(|voxel| (voxel[0] / 8) as u8).collect()),
        };
        let bytes = encode(&field);
        assert!(bytes == include_bytes!("../web/tests/fixtures/field.voxels"), "{} bytes", bytes.len());
    }

    #[test]
    fn nothing_is_a_few_bytes() {
        let field = VoxelField {
            size: [30; 3],
            world_from_voxel: [0.0; 12],
            edge_mm: 1.0,
            range: [5.0, 5.0],
            tolerance: 0.5,
            values: vec![5.0; 27_000],
            occupancies: vec![0.0; 27_000],
            labels: None,
        };
        assert!(encode(&field).len() < 180);
    }
}
