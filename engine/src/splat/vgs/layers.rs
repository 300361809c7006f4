//! Splats as layers of bytes: the most important splats first, in each layer along a Morton curve.

use serde::{Deserialize, Serialize};

use super::coder::{Decoder, Encoder, Tree};
use super::lattice::{CODE_LIMIT, CODES, Lattice};
use crate::splat::Splat;

/// Columns of a row: the codes of the splat, then its label.
pub const COLUMNS: usize = CODES + 1;
/// Bits of a cell's index along each axis.
const CELL_BITS: u32 = 21;
/// Bits of a column that have models; the rest are as likely as not.
const MODELLED_BITS: u32 = 12;
/// Bits of a gap below its highest that have models.
const GAP_BITS: u32 = 2;

/// The cells that means are counted from, in the space of the lattice.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cells {
    /// Indices of the first cell along x, y, z.
    pub first: [i64; 3],
    /// The side of a cell is 2 to this power.
    pub side_log2: i32,
}

impl Cells {
    /// Chooses cells for `means`: as wide as they can be with a cell of its own for nine splats in ten.
    pub fn of(means: &[[f32; 3]]) -> Self {
        let low: [f64; 3] = std::array::from_fn(|k| {
            means.iter().map(|mean| f64::from(mean[k])).fold(f64::INFINITY, f64::min)
        });
        // A cell is never finer than f32 tells places apart.
        let extent = (0..3)
            .map(|k| means.iter().map(|mean| f64::from(mean[k]) - low[k]).fold(low[k].abs() / 2.0, f64::max))
            .fold(1e-30, f64::max);
        // With one bit in reserve every index fits.
        let least = extent.log2().ceil() as i32 - CELL_BITS as i32 + 1;
        let at = |side_log2: i32| {
            let side = side_of(side_log2);
            Cells { first: low.map(|v| (v / side).floor() as i64), side_log2 }
        };
        let most = least + CELL_BITS as i32 - 1;
        let parted = |cells: &Cells| {
            let mut keys: Vec<u64> = means.iter().filter_map(|mean| Some(cells.of_mean(*mean)?.0)).collect();
            keys.sort_unstable();
            keys.dedup();
            keys.len() * 10 >= means.len() * 9
        };
        (least..=most).rev().map(at).find(parted).unwrap_or_else(|| at(least))
    }

    /// Returns the side of a cell.
    pub fn side(&self) -> f64 {
        side_of(self.side_log2)
    }

    /// Returns the Morton code of the cell of `mean`, and the place in the cell, 0 to 1; `None` beyond the
    /// cells.
    fn of_mean(&self, mean: [f32; 3]) -> Option<(u64, [f64; 3])> {
        let (mut cell, mut within) = ([0u64; 3], [0.0; 3]);
        for k in 0..3 {
            let at = f64::from(mean[k]) / self.side();
            let index = at.floor() as i64 - self.first[k];
            cell[k] = u64::try_from(index).ok().filter(|&i| i < 1 << CELL_BITS)?;
            within[k] = at - at.floor();
        }
        let code = (0..CELL_BITS).rev().fold(0u64, |code, bit| {
            cell.iter().fold(code, |code, coordinate| code << 1 | (coordinate >> bit & 1))
        });
        Some((code, within))
    }

    /// Returns the mean at `within` (0 to 1) of the cell with this Morton code.
    fn mean(&self, code: u64, within: [f64; 3]) -> [f32; 3] {
        std::array::from_fn(|k| {
            let index = (0..CELL_BITS).fold(0u64, |i, bit| i | (code >> (3 * bit + 2 - k as u32) & 1) << bit);
            ((self.first[k] as f64 + index as f64 + within[k]) * self.side()) as f32
        })
    }
}

fn side_of(side_log2: i32) -> f64 {
    f64::from(side_log2).exp2()
}

/// Models of what a row has, learned from one layer to the next.
pub struct Models {
    columns: Vec<Column>,
    gap: Tree,
    /// For each number of bits of a gap, the models of its next ones.
    gap_next: Vec<Tree>,
}

struct Column {
    low: i32,
    count: u32,
    shift: u32,
    tree: Tree,
}

impl Models {
    /// Creates models of columns with these least and greatest values; `None` if such columns cannot be.
    pub fn new(ranges: &[[i32; 2]; COLUMNS]) -> Option<Self> {
        let column = |&[low, high]: &[i32; 2]| {
            let possible = low <= high && low >= -CODE_LIMIT && high <= CODE_LIMIT;
            possible.then_some(())?;
            let last = (high - low) as u32;
            let shift = (32 - last.leading_zeros()).saturating_sub(MODELLED_BITS);
            Some(Column { low, count: last + 1, shift, tree: Tree::new(last >> shift) })
        };
        Some(Models {
            columns: ranges.iter().map(column).collect::<Option<_>>()?,
            gap: Tree::new(63),
            gap_next: vec![Tree::new((1 << GAP_BITS) - 1); 65],
        })
    }
}

/// A splat as the file has it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Codes and label.
    pub columns: [i32; COLUMNS],
    /// Morton code of the cell.
    cell: u64,
    /// Step in the cell along each axis.
    step: [u32; 3],
    counts: [u32; 3],
}

impl Row {
    /// Rounds a splat in the space of the lattice; `None` if it lies beyond the cells.
    pub fn of(splat: &Splat, label: u8, lattice: &Lattice, cells: &Cells) -> Option<Self> {
        let codes = lattice.codes(splat);
        let counts = lattice.counts(&codes, cells.side())?;
        let (cell, within) = cells.of_mean(splat.mean)?;
        let step = std::array::from_fn(|k| ((within[k] * f64::from(counts[k])) as u32).min(counts[k] - 1));
        let mut columns = [i32::from(label); COLUMNS];
        columns[..CODES].copy_from_slice(&codes);
        Some(Row { columns, cell, step, counts })
    }

    /// Returns the splat, in the space of the lattice, and its label.
    pub fn splat(&self, lattice: &Lattice, cells: &Cells) -> Option<(Splat, u8)> {
        let codes: &[i32; CODES] = self.columns.first_chunk()?;
        let within = std::array::from_fn(|k| (f64::from(self.step[k]) + 0.5) / f64::from(self.counts[k]));
        let splat = Splat { mean: cells.mean(self.cell, within), ..lattice.splat(codes)? };
        Some((splat, u8::try_from(self.columns[CODES]).ok()?))
    }
}

/// Returns the least and the greatest value of every column.
pub fn ranges(rows: &[Row]) -> [[i32; 2]; COLUMNS] {
    std::array::from_fn(|k| {
        let values = || rows.iter().map(|row| row.columns[k]);
        [values().min().unwrap_or(0), values().max().unwrap_or(0)]
    })
}

/// Returns the bytes of a layer, and puts its rows in their order.
pub fn encode(rows: &mut [Row], models: &mut Models) -> Vec<u8> {
    rows.sort_by_key(|row| row.cell);
    let mut out = Encoder::default();
    let mut last = 0;
    for row in rows {
        let gap = row.cell - last;
        last = row.cell;
        let bits = u64::BITS - gap.leading_zeros();
        out.number(&mut models.gap, bits);
        let mut rest = bits.saturating_sub(1);
        if rest > GAP_BITS {
            rest -= GAP_BITS;
            out.number(&mut models.gap_next[bits as usize], (gap >> rest) as u32 & ((1 << GAP_BITS) - 1));
        }
        while rest > 0 {
            let piece = rest.min(16);
            rest -= piece;
            out.even((gap >> rest) as u32 & ((1 << piece) - 1), 1 << piece);
        }
        for (column, value) in models.columns.iter_mut().zip(row.columns) {
            let value = (value - column.low) as u32;
            out.number(&mut column.tree, value >> column.shift);
            out.even(value & ((1 << column.shift) - 1), 1 << column.shift);
        }
        for k in 0..3 {
            out.even(row.step[k], row.counts[k]);
        }
    }
    out.finish()
}

/// Reads the `count` splats of a layer; `None` if the bytes are none.
pub fn decode(
    bytes: &[u8],
    count: usize,
    models: &mut Models,
    lattice: &Lattice,
    cells: &Cells,
) -> Option<Vec<(Splat, u8)>> {
    let mut input = Decoder::new(bytes);
    let mut found = Vec::new();
    found.try_reserve_exact(count).ok()?;
    let mut cell = 0u64;
    for _ in 0..count {
        let bits = input.number(&mut models.gap);
        let mut gap = u64::from(bits > 0);
        let mut rest = bits.saturating_sub(1);
        if rest > GAP_BITS {
            rest -= GAP_BITS;
            gap = gap << GAP_BITS | u64::from(input.number(&mut models.gap_next[bits as usize]));
        }
        while rest > 0 {
            let piece = rest.min(16);
            rest -= piece;
            gap = gap << piece | u64::from(input.even(1 << piece));
        }
        cell = cell.checked_add(gap).filter(|&cell| cell < 1 << (3 * CELL_BITS))?;
        let mut columns = [0; COLUMNS];
        for (value, column) in columns.iter_mut().zip(&mut models.columns) {
            let high = input.number(&mut column.tree) << column.shift;
            let step = high | input.even(1 << column.shift);
            *value = (step < column.count).then_some(column.low + step as i32)?;
        }
        let codes: &[i32; CODES] = columns.first_chunk()?;
        let counts = lattice.counts(codes, cells.side())?;
        let step = counts.map(|count| input.even(count));
        found.push(Row { columns, cell, step, counts }.splat(lattice, cells)?);
        if input.is_beyond() {
            return None;
        }
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::super::lattice::Steps;
    use super::*;

    const STEPS: Steps = Steps { mean: 0.08, ratio: 1.06, opacity: 0.1, intensity: 4.0 };

    fn splats(count: usize, spread: f32) -> Vec<Splat> {
        let mut rng = Pcg64::seed_from_u64(2);
        let mut between = |low: f32, high: f32| rng.random_range(low..=high);
        (0..count)
            .map(|_| Splat {
                mean: [between(0.0, spread), between(-spread, spread), between(5.0, 5.0 + spread)],
                opacity_logit: between(-3.0, 3.0),
                rotation: [1.0, between(-1.0, 1.0), between(-1.0, 1.0), 0.0],
                log_scale: [between(-0.5, 0.5), between(-0.5, 0.5), between(-0.5, 0.5)],
                intensity: between(0.0, 900.0),
            })
            .collect()
    }

    #[test]
    fn layers_come_back_and_are_small() {
        for (count, spread) in [(1, 3.0), (2, 0.0), (700, 1e-4), (5000, 30.0), (300, 1e6)] {
            let splats = splats(count, spread);
            let lattice = Lattice::new(STEPS).expect("usable steps");
            let cells = Cells::of(&splats.iter().map(|s| s.mean).collect::<Vec<_>>());
            let mut rows: Vec<Row> = splats
                .iter()
                .enumerate()
                .map(|(i, s)| Row::of(s, (i % 3) as u8, &lattice, &cells).expect("within the cells"))
                .collect();
            let ranges = ranges(&rows);
            let mut models = Models::new(&ranges).expect("ranges");
            let (first, second) = rows.split_at_mut(count / 3);
            let layers = [encode(first, &mut models), encode(second, &mut models)];
            let mut models = Models::new(&ranges).expect("ranges");
            for (bytes, rows) in layers.iter().zip([&*first, &*second]) {
                let found = decode(bytes, rows.len(), &mut models, &lattice, &cells).expect("the layer");
                for ((splat, label), row) in found.into_iter().zip(rows) {
                    assert_eq!(Row::of(&splat, label, &lattice, &cells), Some(*row), "{count} {spread}");
                }
            }
            let half = &layers[1][..layers[1].len() / 2];
            let short = decode(half, 2 * count, &mut models, &lattice, &cells);
            assert!(short.is_none(), "{count} {spread}");
            if count == 5000 {
                let bytes = layers.iter().map(Vec::len).sum::<usize>() as f64 / count as f64;
                assert!(bytes < 9.0, "{bytes} bytes a splat");
            }
        }
    }
}
