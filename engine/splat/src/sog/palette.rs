//! The palette of harmonics beyond degree 0.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::PI;

use super::MOST_ROWS;

/// Groups are halved until no colour is off by more, the root of the mean square over channels and directions.
pub const TOLERANCE: f64 = 1.0 / 255.0;
/// Rounds of k-means in which a group is halved.
const ROUNDS: usize = 3;
/// Most visits of a splat, over all halvings: even halves take 16 for the largest palette.
const MOST_VISITS: usize = 64;

/// Rows of harmonics that splats share.
pub struct Palette {
    /// Coefficients of one row after the other.
    pub rows: Vec<f32>,
    /// The row of each splat.
    pub labels: Vec<u16>,
}

impl Palette {
    /// Returns a palette of `count` splats whose coefficients `of` returns, all as many and at least one: by k-means with
    /// k = 2, again and again for the group of splats with the greatest sum of squared errors, until all are within
    /// [`TOLERANCE`] or the palette is full. Neighbours in the palette are alike.
    pub fn of<'a>(count: usize, of: impl Fn(u32) -> &'a [f32]) -> Self {
        let mut members: Vec<u32> = (0..count as u32).collect();
        let mut groups = vec![Group::of(&members, 0, &of)];
        let mut halved = BinaryHeap::new();
        halved.extend(groups[0].is_wide().then(|| (groups[0].rank(), Reverse(0))));
        let mut visits = count.saturating_mul(MOST_VISITS);
        while groups.len() < MOST_ROWS
            && let Some((_, Reverse(index))) = halved.pop()
        {
            let group = &groups[index];
            let own = &mut members[group.first..][..group.count];
            let Some(left) = visits.checked_sub(own.len()) else { break };
            visits = left;
            let below = group.halve(own, &of);
            if below == 0 || below == own.len() {
                continue;
            }
            let (first, halves) = (group.first, own.split_at(below));
            let next = groups.len();
            groups[index] = Group::of(halves.0, first, &of);
            groups.push(Group::of(halves.1, first + below, &of));
            for index in [index, next].into_iter().filter(|&i| groups[i].is_wide()) {
                halved.push((groups[index].rank(), Reverse(index)));
            }
        }
        groups.sort_unstable_by_key(|group| group.first);
        let mut labels = vec![0; count];
        for (label, group) in (0..=u16::MAX).zip(&groups) {
            members[group.first..][..group.count].iter().for_each(|&i| labels[i as usize] = label);
        }
        let rows = groups.iter().flat_map(|group| group.mean.iter().map(|&v| v as f32)).collect();
        Palette { rows, labels }
    }
}

/// Splats that share a row.
struct Group {
    /// Where they begin among all members.
    first: usize,
    count: usize,
    mean: Vec<f64>,
    /// The coefficient that varies most.
    axis: usize,
    /// Squared distances from the mean: their sum, and the greatest.
    sum: f64,
    greatest: f64,
}

impl Group {
    fn of<'a>(members: &[u32], first: usize, of: impl Fn(u32) -> &'a [f32]) -> Self {
        let count = members.len();
        let width = members.first().map_or(1, |&i| of(i).len());
        let mut mean = vec![0.0; width];
        for &i in members {
            mean.iter_mut().zip(of(i)).for_each(|(sum, &v)| *sum += f64::from(v));
        }
        mean.iter_mut().for_each(|sum| *sum /= count.max(1) as f64);
        let mut sums = vec![0.0; width];
        let mut greatest = 0f64;
        for &i in members {
            let mut own = 0.0;
            for ((sum, &v), mean) in sums.iter_mut().zip(of(i)).zip(&mean) {
                let square = (f64::from(v) - mean).powi(2);
                *sum += square;
                own += square;
            }
            greatest = greatest.max(own);
        }
        let axis = (0..width).max_by(|&a, &b| sums[a].total_cmp(&sums[b])).unwrap_or_default();
        Group { first, count, mean, axis, sum: sums.iter().sum(), greatest }
    }

    /// Returns true if a colour is off by more than [`TOLERANCE`]: the functions are orthonormal, so the mean over the sphere of
    /// a squared error is a 4π-th of the sum of those of the coefficients.
    fn is_wide(&self) -> bool {
        self.greatest > TOLERANCE.powi(2) * 3.0 * 4.0 * PI
    }

    /// Numbers of no sign are in the order of their bits.
    fn rank(&self) -> u64 {
        self.sum.to_bits()
    }

    /// Puts the members of one half before those of the other, and returns how many the first are.
    fn halve<'a>(&self, members: &mut [u32], of: impl Fn(u32) -> &'a [f32]) -> usize {
        // A member belongs to the first half if its product with `normal` is below `limit`.
        let mut normal = vec![0.0; self.mean.len()];
        normal[self.axis] = 1.0;
        let mut limit = self.mean[self.axis];
        let product =
            |normal: &[f64], i: u32| normal.iter().zip(of(i)).map(|(n, &v)| n * f64::from(v)).sum::<f64>();
        for _ in 0..ROUNDS {
            let mut sums = [vec![0.0; normal.len()], vec![0.0; normal.len()]];
            let mut counts = [0.0; 2];
            for &i in members.iter() {
                let half = usize::from(product(&normal, i) >= limit);
                counts[half] += 1.0;
                sums[half].iter_mut().zip(of(i)).for_each(|(sum, &v)| *sum += f64::from(v));
            }
            if counts.contains(&0.0) {
                break;
            }
            let [below, above] = sums;
            limit = 0.0;
            for ((n, a), b) in normal.iter_mut().zip(below).zip(above) {
                let (a, b) = (a / counts[0], b / counts[1]);
                *n = b - a;
                limit += 0.5 * (b * b - a * a);
            }
        }
        let (below, above): (Vec<u32>, Vec<u32>) =
            members.iter().partition(|&&i| product(&normal, i) < limit);
        members[..below.len()].copy_from_slice(&below);
        members[below.len()..].copy_from_slice(&above);
        below.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_palette_is_as_long_as_the_colours_need() {
        // 500 splats in five heaps, each narrower than the tolerance, in turn.
        let jitter = |i: usize, k: usize| ((i * 37 + k * 101) % 89) as f32 * 1e-5;
        let value = |i: usize, k: usize| ((i % 5 * (k + 3)) % 7) as f32 * 0.5 + jitter(i, k);
        let rows: Vec<f32> = (0..500).flat_map(|i| (0..9).map(move |k| value(i, k))).collect();
        let of = |i: u32| &rows[9 * i as usize..][..9];
        let palette = Palette::of(500, of);
        assert_eq!((palette.rows.len(), palette.labels.len()), (5 * 9, 500));
        for i in 0..500 {
            let row = &palette.rows[9 * usize::from(palette.labels[i])..][..9];
            assert!(row.iter().zip(of(i as u32)).all(|(a, b)| (a - b).abs() < 1e-3), "splat {i}");
            assert_eq!(palette.labels[i], palette.labels[i % 5]);
        }
        // The same splats with the same colours need one row, and none of them is lost.
        let one = Palette::of(500, |_| &rows[..9]);
        assert_eq!((one.rows, one.labels), (rows[..9].to_vec(), vec![0; 500]));
    }

    #[test]
    fn a_full_palette_takes_bounded_time() {
        // Each splat is far from all others, and each halving takes one away.
        let rows: Vec<f32> = (0..4000).map(|i| 1.5f32.powi(i % 200) + i as f32).collect();
        let palette = Palette::of(4000, |i| &rows[i as usize..][..1]);
        assert!(palette.rows.len() <= 4000);
        let most: usize = palette.labels.iter().map(|&label| usize::from(label)).max().expect("labels");
        assert_eq!(most + 1, palette.rows.len());
    }
}
