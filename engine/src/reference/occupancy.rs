//! `occupancy_mark` and `occupancy_spread`: which bricks can be seen, and how far the others are from them.

use crate::transfer::Table;

/// Returns 0 for each brick whose interval of intensity meets a visible entry of the table, `most` for
/// others. One more entry on each side counts too. An interval that ends before it begins meets none.
pub fn occupancy_mark(intervals: &[[f32; 2]], table: &Table, most: u32) -> Vec<u32> {
    let last = table.len() as f64 - 1.0;
    let entry = |v: f32| (f64::from(v) - table.first) / table.step;
    intervals
        .iter()
        .map(|&[low, high]| {
            if low > high {
                return most;
            }
            let from = entry(low).floor().clamp(0.0, last) as usize;
            let to = entry(high).ceil().clamp(0.0, last) as usize;
            if table.points[from..=to].iter().any(|p| p[3] > 0.0) { 0 } else { most }
        })
        .collect()
}

/// Spreads a Chebyshev distance along one axis of a grid of bricks: the result is the least max(|d|, `before`
/// d further along the axis).
pub fn occupancy_spread(before: &[u32], bricks: [usize; 3], axis: usize) -> Vec<u32> {
    let stride = [1, bricks[0], bricks[0] * bricks[1]][axis];
    (0..before.len())
        .map(|i| {
            let place = i / stride % bricks[axis];
            let first = i - place * stride;
            let each = (0..bricks[axis])
                .map(|other| before[first + other * stride].max(place.abs_diff(other) as u32));
            each.min().unwrap_or(before[i])
        })
        .collect()
}
