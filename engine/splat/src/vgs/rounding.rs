//! The rounding of a set: the sizes of the steps, and the cells that means are counted from.

use serde::{Deserialize, Serialize};

use super::morton::{self, AXIS_BITS};

/// The lattice that splats are rounded to, in the space of the grid that they were fitted on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rounding {
    pub(super) steps: Steps,
    pub(super) cells: Cells,
}

/// Sizes of the steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Steps {
    /// Step of a coordinate of the mean, in widths of the splat along that axis.
    pub mean: f64,
    /// Ratio of neighbouring widths.
    pub ratio: f64,
    /// Step of ln α.
    pub opacity: f64,
    /// Step of the intensity (HU if it is physical).
    pub intensity: f64,
}

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
        if means.is_empty() {
            return Cells { first: [0; 3], side_log2: 0 };
        }
        let low: [f64; 3] = std::array::from_fn(|k| {
            means.iter().map(|mean| f64::from(mean[k])).fold(f64::INFINITY, f64::min)
        });
        // A cell is never finer than f32 tells places apart.
        let extent = (0..3)
            .map(|k| means.iter().map(|mean| f64::from(mean[k]) - low[k]).fold(low[k].abs() / 2.0, f64::max))
            .fold(1e-30, f64::max);
        // With one bit in reserve every index fits.
        let least = extent.log2().ceil() as i32 - AXIS_BITS as i32 + 1;
        let at = |side_log2: i32| {
            let side = side_of(side_log2);
            Cells { first: low.map(|v| (v / side).floor() as i64), side_log2 }
        };
        let most = least + AXIS_BITS as i32 - 1;
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
    pub fn of_mean(&self, mean: [f32; 3]) -> Option<(u64, [f64; 3])> {
        let (mut cell, mut within) = ([0u64; 3], [0.0; 3]);
        for k in 0..3 {
            let at = f64::from(mean[k]) / self.side();
            let index = at.floor() as i64 - self.first[k];
            cell[k] = u64::try_from(index).ok().filter(|&i| i < 1 << AXIS_BITS)?;
            within[k] = at - at.floor();
        }
        Some((morton::code(cell), within))
    }

    /// Returns the mean at `within` (0 to 1) of the cell with this Morton code.
    pub fn mean(&self, code: u64, within: [f64; 3]) -> [f32; 3] {
        let cell = morton::place(code);
        std::array::from_fn(|k| ((self.first[k] as f64 + cell[k] as f64 + within[k]) * self.side()) as f32)
    }
}

fn side_of(side_log2: i32) -> f64 {
    f64::from(side_log2).exp2()
}
