//! Splats as layers of bytes: the most important splats first, in each layer along a Morton curve.

use super::coder::{Decoder, Encoder, Tree};
use super::lattice::{CODE_LIMIT, CODES, Lattice};
use super::morton::Gaps;
use super::rounding::Cells;
use crate::Splat;

/// Columns of a row: the codes of the splat, then its label.
pub const COLUMNS: usize = CODES + 1;
/// Bits of a column that have models; the rest are as likely as not.
const MODELLED_BITS: u32 = 12;

/// Models of what a row has, learned from one layer to the next.
pub struct Models {
    columns: Vec<Column>,
    gaps: Gaps,
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
        Some(Models { columns: ranges.iter().map(column).collect::<Option<_>>()?, gaps: Gaps::default() })
    }
}

/// A splat as the file has it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
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
        models.gaps.write(row.cell - last, &mut out);
        last = row.cell;
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
        cell = models.gaps.read(cell, &mut input)?;
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

    use super::super::rounding::Steps;
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
