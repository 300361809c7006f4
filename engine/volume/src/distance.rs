//! Exact Euclidean distances on a grid: Felzenszwalb and Huttenlocher, "Distance transforms of sampled
//! functions" (2012), the lower envelope of parabolas along one axis after the other.

use glam::DVec3;
use rayon::prelude::*;

/// Returns the distance of each voxel of a grid of `size` to the nearest voxel that is a `site` (by index, x
/// fastest), from centre to centre, in mm for voxel edges of `spacing_mm` that are at right angles. Distances
/// are infinite if there is no site.
pub fn distances_mm(size: [usize; 3], spacing_mm: DVec3, site: impl Fn(usize) -> bool + Sync) -> Vec<f32> {
    let count = size.iter().product();
    let mut squared: Vec<f32> =
        (0..count).into_par_iter().map(|i| if site(i) { 0.0 } else { f32::INFINITY }).collect();
    // Each round takes the fastest axis and makes it the slowest: after three the order is restored.
    let mut size = size;
    for spacing in spacing_mm.to_array() {
        let [nx, ny, nz] = size;
        if count == 0 {
            break;
        }
        squared
            .par_chunks_mut(nx)
            .for_each_init(Vec::new, |envelope, row| lower_envelope(row, spacing, envelope));
        let mut turned = vec![0.0; count];
        turned.par_chunks_mut(ny * nz).enumerate().for_each(|(x, plane)| {
            plane.iter_mut().enumerate().for_each(|(row, out)| *out = squared[row * nx + x]);
        });
        (squared, size) = (turned, [ny, nz, nx]);
    }
    squared.par_iter_mut().for_each(|v| *v = v.sqrt());
    squared
}

/// A parabola of an envelope: the place of its vertex (mm), the value there (mm²), and the place from which
/// on it is the lowest (mm).
pub(super) type Parabola = (f64, f64, f64);

/// Replaces row[i] (mm²) by the minimum over j of row[j] + (spacing (i − j))², for each i. `parabolas` is a
/// work buffer; its content does not matter.
pub(super) fn lower_envelope(row: &mut [f32], spacing: f64, parabolas: &mut Vec<Parabola>) {
    // Parabolas of the envelope from left to right.
    parabolas.clear();
    for (j, &height) in row.iter().enumerate().filter(|(_, height)| height.is_finite()) {
        // A site that lies between two sites is the nearest one of no voxel but itself.
        if height == 0.0 && j > 0 && row[j - 1] == 0.0 && row.get(j + 1) == Some(&0.0) {
            continue;
        }
        let (at, height) = (spacing * j as f64, f64::from(height));
        let mut from = f64::NEG_INFINITY;
        while let Some(&(other, low, begin)) = parabolas.last() {
            from = ((height + at * at) - (low + other * other)) / (2.0 * (at - other));
            if from > begin {
                break;
            }
            parabolas.pop();
            from = f64::NEG_INFINITY;
        }
        parabolas.push((at, height, from));
    }
    if parabolas.is_empty() {
        return;
    }
    let mut lowest = 0;
    for (i, out) in row.iter_mut().enumerate().filter(|(_, value)| **value != 0.0) {
        let x = spacing * i as f64;
        while parabolas.get(lowest + 1).is_some_and(|next| next.2 <= x) {
            lowest += 1;
        }
        let (at, height, _) = parabolas[lowest];
        *out = (height + (x - at) * (x - at)) as f32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_are_those_of_a_search() {
        let (size, spacing) = ([9, 7, 5], DVec3::new(0.5, 1.0, 2.5));
        let at = |i: usize| DVec3::new((i % 9) as f64, (i / 9 % 7) as f64, (i / 63) as f64) * spacing;
        for sites in [vec![0], vec![314], vec![4, 99, 100, 200, 301], (0..315).step_by(7).collect()] {
            let found = distances_mm(size, spacing, |i| sites.contains(&i));
            for (i, &distance) in found.iter().enumerate() {
                let wanted = sites.iter().map(|&s| at(i).distance(at(s))).fold(f64::INFINITY, f64::min);
                assert!((f64::from(distance) - wanted).abs() < 1e-5, "{i}: {distance} for {wanted}");
            }
        }
    }

    #[test]
    fn without_a_site_all_is_infinitely_far() {
        assert_eq!(distances_mm([2, 3, 1], DVec3::ONE, |_| false), [f32::INFINITY; 6]);
        assert!(distances_mm([0, 3, 1], DVec3::ONE, |_| true).is_empty());
    }
}
