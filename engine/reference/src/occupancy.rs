//! `occupancy_mark` and `occupancy_spread`: which bricks can be seen, and how far the others are from them;
//! `list_faces`: the faces around cubes of them.

use shader_interface::faces::CUBE;

use transfer::Table;

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

/// Returns the faces of cubes of bricks, x fastest, that hold a brick of distance 0 and behind which no such cube
/// lies, in ascending order: 6 times the cube, plus 2 for each axis before the face's, plus 1 for its upper end.
pub fn list_faces(distances: &[u32], bricks: [usize; 3]) -> Vec<u32> {
    let edge = CUBE as usize;
    let cubes = bricks.map(|n| n.div_ceil(edge));
    let mut shown = vec![false; cubes.iter().product()];
    for (i, _) in distances.iter().enumerate().filter(|(_, d)| **d == 0) {
        let [x, y, z] =
            [i % bricks[0], i / bricks[0] % bricks[1], i / (bricks[0] * bricks[1])].map(|at| at / edge);
        shown[(z * cubes[1] + y) * cubes[0] + x] = true;
    }
    let strides = [1, cubes[0], cubes[0] * cubes[1]];
    let listed = |cube: usize, face: usize| {
        let (axis, upper) = (face / 2, face % 2 == 1);
        let place = cube / strides[axis] % cubes[axis];
        let behind = match upper {
            true => (place + 1 < cubes[axis]).then(|| cube + strides[axis]),
            false => (place > 0).then(|| cube - strides[axis]),
        };
        behind.is_none_or(|behind| !shown[behind])
    };
    (0..shown.len())
        .filter(|&cube| shown[cube])
        .flat_map(|cube| (0..6).map(move |face| (cube, face)))
        .filter(|&(cube, face)| listed(cube, face))
        .map(|(cube, face)| (6 * cube + face) as u32)
        .collect()
}
