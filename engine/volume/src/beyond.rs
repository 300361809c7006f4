//! Values beyond a region, continued from inside it.
//!
//! The [occupancy](super::edges) of a smooth edge reaches beyond the voxels of its region, and
//! interpolation one voxel further. What a scan has there is partly the object's own edge, blurred by the
//! scanner, and partly something else: a rib beside the liver. [`extend`] puts there what the object has
//! nearby, by normalised convolution (Knutsson and Westin, "Normalized and differential convolution", 1993)
//! with the binomial filter ¼ ½ ¼ along each axis, one layer of voxels after the other, but leaves the scan
//! where it goes the way in which the object ends: down for objects that are brighter than most of what is
//! around them, up for others. So an edge stays as sharp as the scan has it, and nothing brighter shines
//! through.
//!
//! Of several objects that are near, the one with the most weight gets the voxel, and only its own values
//! count. Where objects touch nothing changes: each voxel keeps its number, so that the shares of the
//! objects, interpolated, add up to one without a gap or an overlap.

use rayon::prelude::*;

/// A voxel of a new layer.
struct Found {
    at: usize,
    number: u8,
    /// The value that is continued to it; after that, the one of the scan.
    value: f32,
}

/// Sums of the voxels of one object around a voxel.
#[derive(Clone, Copy, Default)]
struct Sum {
    number: u8,
    weight: f32,
    value: f32,
}

/// Gives the voxels up to `layers` voxels from the objects (along each axis, corners included) the number
/// of the object that is nearest, by weight, and a value: of the one continued from it and of their own the
/// lower one if the object is brighter than what is around it, and the higher one if it is darker.
/// `numbers` are those of the objects, 0 outside, x fastest, as are `values`; values of voxels of an object
/// are finite, and stay what they are.
///
/// # Panics
/// If there is not one value and one number for every voxel.
pub fn extend(values: &mut [f32], numbers: &mut [u8], size: [usize; 3], layers: usize) {
    assert_eq!(numbers.len(), size.iter().product::<usize>(), "one number for every voxel");
    assert_eq!(values.len(), numbers.len(), "one value for every voxel");
    let mut beyond: Vec<Found> = Vec::new();
    for _ in 0..layers {
        let mut layer: Vec<Found> = (0..size[1] * size[2])
            .into_par_iter()
            .map_init(Vec::new, |near, row| of_row(values, numbers, size, row, near))
            .flatten_iter()
            .collect();
        for found in &mut layer {
            std::mem::swap(&mut values[found.at], &mut found.value);
            numbers[found.at] = found.number;
        }
        beyond.extend(layer);
    }
    // How many voxels around each object are darker than what is continued from it, less those that are
    // brighter.
    let mut darker = [0_i64; 256];
    for found in &beyond {
        let continued = values[found.at];
        darker[usize::from(found.number)] += i64::from(found.value < continued);
        darker[usize::from(found.number)] -= i64::from(found.value > continued);
    }
    for found in beyond {
        let value = &mut values[found.at];
        // A value that is not a number gives way to the other one.
        let is_bright = darker[usize::from(found.number)] >= 0;
        *value = if is_bright { value.min(found.value) } else { value.max(found.value) };
    }
}

/// Returns the voxels of a row that have no number but a neighbour with one. `near` is a work buffer; its
/// content does not matter.
fn of_row(values: &[f32], numbers: &[u8], size: [usize; 3], row: usize, near: &mut Vec<u8>) -> Vec<Found> {
    let [nx, ny, nz] = size;
    let rows: Vec<(usize, f32)> = (-1_isize..=1)
        .flat_map(|dz| (-1_isize..=1).map(move |dy| (dy, dz)))
        .filter_map(|(dy, dz)| {
            let y = (row % ny).checked_add_signed(dy).filter(|&y| y < ny)?;
            let z = (row / ny).checked_add_signed(dz).filter(|&z| z < nz)?;
            Some((nx * (y + ny * z), binomial(dy) * binomial(dz)))
        })
        .collect();
    near.clear();
    near.resize(nx, 0);
    for &(start, _) in &rows {
        near.iter_mut().zip(&numbers[start..start + nx]).for_each(|(near, number)| *near |= number);
    }
    if near.iter().all(|&near| near == 0) {
        return Vec::new();
    }
    let own = &numbers[nx * row..][..nx];
    let at = (0..nx).filter(|&x| own[x] == 0 && near[x.max(1) - 1..(x + 2).min(nx)].iter().any(|&n| n != 0));
    at.map(|x| {
        let sum = heaviest(values, numbers, nx, &rows, x);
        Found { at: nx * row + x, number: sum.number, value: sum.value / sum.weight }
    })
    .collect()
}

/// Returns the sums of the object with the most weight around the voxel `x` of the middle one of `rows`,
/// which have their first voxels and weights; of objects with the same weight, that of the lowest number.
fn heaviest(values: &[f32], numbers: &[u8], nx: usize, rows: &[(usize, f32)], x: usize) -> Sum {
    // A voxel has 26 neighbours, so that there are no more objects.
    let (mut sums, mut count) = ([Sum::default(); 26], 0);
    for &(start, of_row) in rows {
        for other in x.max(1) - 1..(x + 2).min(nx) {
            let (number, value) = (numbers[start + other], values[start + other]);
            if number == 0 {
                continue;
            }
            let known = sums[..count].iter().position(|sum| sum.number == number);
            let place = known.unwrap_or(count);
            count = count.max(place + 1);
            let weight = of_row * binomial(other as isize - x as isize);
            let sum = &mut sums[place];
            *sum = Sum { number, weight: sum.weight + weight, value: sum.value + weight * value };
        }
    }
    let heavier = |a: Sum, b: Sum| {
        let first = a.weight > b.weight || a.weight == b.weight && a.number < b.number;
        if first { a } else { b }
    };
    sums[..count].iter().copied().reduce(heavier).unwrap_or_default()
}

/// Returns the weight of a neighbour that is `offset` voxels away along an axis.
fn binomial(offset: isize) -> f32 {
    if offset == 0 { 0.5 } else { 0.25 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edges_of_the_scan_stay_and_foreign_values_go() {
        // A wall of 60 with a blurred edge, next to which, in some rows, lies bone, or no value at all.
        let size = [9, 9, 9];
        let scan = |i: usize| match (i % 9, i / 9 % 9) {
            (0..=3, _) => 60.0,
            (4.., 2) => 700.0,
            (4.., 6) => f32::NAN,
            (4, _) => 0.0,
            _ => -100.0,
        };
        for (sign, number) in [(1.0, 7), (-1.0, 255)] {
            let mut values: Vec<f32> = (0..729).map(|i| sign * scan(i)).collect();
            let mut numbers: Vec<u8> = (0..729).map(|i| number * u8::from(i % 9 < 4)).collect();
            extend(&mut values, &mut numbers, size, 2);
            for i in 0..729 {
                let foreign = matches!(i / 9 % 9, 2 | 6);
                let reached = i % 9 < 6;
                assert_eq!(numbers[i], number * u8::from(reached), "voxel {i}");
                let wanted = if foreign && reached { 60.0 } else { scan(i) };
                assert!(values[i] == sign * wanted || !reached, "voxel {i}: {}", values[i]);
            }
        }
    }

    #[test]
    fn layers_reach_around_corners_and_stop_at_faces() {
        let size = [5, 5, 5];
        let (mut values, mut numbers) = (vec![f32::NAN; 125], vec![0; 125]);
        (values[31], numbers[31]) = (3.0, 1);
        extend(&mut values, &mut numbers, size, 1);
        assert_eq!(numbers.iter().filter(|&&n| n == 1).count(), 27);
        extend(&mut values, &mut numbers, size, 1);
        assert_eq!(numbers.iter().filter(|&&n| n == 1).count(), 64);
        assert!(values.iter().zip(&numbers).all(|(&v, &n)| if n == 1 { v == 3.0 } else { v.is_nan() }));
    }

    #[test]
    fn each_voxel_beyond_is_of_the_object_with_the_most_weight() {
        // Two objects that touch, under a layer that is of none.
        let size = [8, 3, 3];
        let of = |i: usize| if i / 24 == 2 { 0 } else { 1 + (i % 8 / 4) as u8 };
        let mut numbers: Vec<u8> = (0..72).map(of).collect();
        let value = |n: u8| if n == 0 { f32::NAN } else { 100.0 * f32::from(n) };
        let mut values: Vec<f32> = numbers.iter().map(|&n| value(n)).collect();
        extend(&mut values, &mut numbers, size, 1);
        for i in 0..72 {
            assert_eq!(numbers[i], 1 + (i % 8 / 4) as u8, "voxel {i}");
            assert_eq!(values[i], 100.0 * f32::from(numbers[i]), "no object has values of the other");
        }
    }

    #[test]
    fn objects_of_the_same_weight_are_told_apart_by_their_numbers() {
        let (mut values, mut numbers) = (vec![9.0, f32::NAN, 5.0], vec![4, 0, 3]);
        extend(&mut values, &mut numbers, [3, 1, 1], 1);
        assert_eq!((values, numbers), (vec![9.0, 5.0, 5.0], vec![4, 3, 3]));
    }

    #[test]
    fn nothing_goes_on_from_nothing() {
        let (mut values, mut numbers) = (vec![1.0; 27], vec![0; 27]);
        extend(&mut values, &mut numbers, [3, 3, 3], 3);
        assert_eq!((values, numbers), (vec![1.0; 27], vec![0; 27]));
        extend(&mut [], &mut [], [0, 0, 0], 3);
    }
}
