//! The density of the first splats: a weight per voxel of the region of interest.

use glam::{DMat3, DVec3};
use rand::RngExt;
use rayon::prelude::*;

use crate::config::Init;
use volume::{Roi, Volume};

/// Spacings follow the density only down to this share of its mean, so that a nearly excluded voxel does not
/// claim a wide empty ball.
const LEAST_DENSITY: f64 = 1e-3;

/// The mean spacing is taken over about this many voxels.
const SPACING_SAMPLES: usize = 100_000;

/// Mean number of voxels between two entries of the search guide.
const VOXELS_PER_GUIDE: usize = 8;

/// Samples are clamped to this, so that a squared difference is finite in f32.
const SAMPLE_LIMIT: f32 = 1e15;

/// Weighted voxels of a region of interest, and the smoothed volume around them.
pub(super) struct Density {
    /// First voxel and voxel counts of the region's bounding box with a margin.
    low: [usize; 3],
    size: [usize; 3],
    /// Taps of the Gaussian G.
    taps: Vec<f32>,
    /// G∗V in the box.
    smooth: Vec<f32>,
    /// Box indices of the voxels with a weight above 0.
    voxels: Vec<usize>,
    /// Running sum of their weights.
    cumulative: Vec<f64>,
    /// First voxel beyond each of some equal steps of the total weight: where to search in `cumulative`.
    guide: Vec<usize>,
    /// Mean of G∗|∇(G∗V)| over the region, per voxel.
    pub mean_gradient: f64,
}

/// Weight of a voxel by the gradient of the intensity: (G∗|∇(G∗V)| / mean + floor)^exponent.
#[derive(Clone, Copy, Debug)]
pub(super) struct GradientWeights {
    /// Standard deviation of G, voxels.
    pub smoothing_sigma: f32,
    /// Exponent of the gradient; with 0 the weight of a voxel is the mask.
    pub exponent: f32,
    /// Constant added to the gradient, in units of the mean gradient.
    pub floor: f32,
}

impl GradientWeights {
    /// Returns the weight that the first splats have.
    pub fn of(init: &Init) -> GradientWeights {
        GradientWeights {
            smoothing_sigma: init.smoothing_sigma,
            exponent: init.gradient_exponent,
            floor: init.gradient_floor,
        }
    }
}

impl Density {
    /// Weighs the voxels of `roi`; returns nothing if none has a weight above 0.
    pub fn of(volume: &Volume, roi: &Roi, weights: GradientWeights) -> Option<Density> {
        let taps = gaussian_taps(weights.smoothing_sigma);
        // Two smoothings, one difference, and half a voxel that a point may lie beyond its voxel's centre:
        // nothing beyond the margin reaches the region.
        let margin = 2 * (taps.len() / 2) + 2;
        let (low, size) = bounding_box(roi, margin)?;
        let finite = |v: f32| if v.is_finite() { v.clamp(-SAMPLE_LIMIT, SAMPLE_LIMIT) } else { 0.0 };
        let smooth = smoothed(&crop(&volume.samples, volume.size, low, size, finite), size, &taps);
        let gradient = smoothed(&gradients(&smooth, size, length), size, &taps);
        let weight = crop(&roi.weight, roi.size, low, size, |w| if w > 0.0 { w.min(1.0) } else { 0.0 });

        let voxels: Vec<usize> = (0..weight.len()).filter(|&i| weight[i] > 0.0).collect();
        let (mut sum, mut total_weight) = (0.0, 0.0);
        for &i in &voxels {
            sum += f64::from(weight[i]) * f64::from(gradient[i]);
            total_weight += f64::from(weight[i]);
        }
        let mean_gradient = sum / total_weight;
        let scale = if mean_gradient > 0.0 { mean_gradient.recip() } else { 0.0 };
        let (floor, exponent) = (f64::from(weights.floor), f64::from(weights.exponent));
        let edge = |i: usize| (f64::from(gradient[i]) * scale + floor).powf(exponent);
        let mut cumulative = running_sum(&voxels, |i| f64::from(weight[i]) * edge(i));
        if !cumulative.last().is_some_and(|sum| sum.is_normal()) {
            // No edge anywhere and a floor of 0.
            cumulative = running_sum(&voxels, |i| f64::from(weight[i]));
        }
        let guide = guide(&cumulative);
        Some(Density { low, size, taps, smooth, voxels, cumulative, guide, mean_gradient })
    }

    fn total(&self) -> f64 {
        self.cumulative.last().copied().unwrap_or(0.0)
    }

    fn weight(&self, slot: usize) -> f64 {
        self.cumulative[slot] - if slot > 0 { self.cumulative[slot - 1] } else { 0.0 }
    }

    /// Returns the distance between neighbours at the voxel of a slot, in voxels, if `count` points fill the
    /// region by density: ρ⁻¹ᐟ³.
    fn spacing(&self, slot: usize, count: usize) -> f32 {
        let least = LEAST_DENSITY * self.total() / self.voxels.len() as f64;
        (self.total() / (count as f64 * self.weight(slot).max(least))).cbrt() as f32
    }

    /// Estimates the mean spacing of `count` points drawn by density, in voxels.
    pub fn mean_spacing(&self, count: usize) -> f32 {
        let some = (0..self.voxels.len()).step_by(self.voxels.len() / SPACING_SAMPLES + 1);
        let (sum, total) = some.fold((0.0, 0.0), |(sum, total), slot| {
            let weight = self.weight(slot);
            (sum + weight * f64::from(self.spacing(slot, count)), total + weight)
        });
        (sum / total) as f32
    }

    /// Returns the slot of the voxel at the share `at` of the total weight, a number from 0 to below 1.
    fn find(&self, at: f64) -> usize {
        let step = ((at * (self.guide.len() - 1) as f64) as usize).min(self.guide.len() - 2);
        let (first, last) = (self.guide[step], (self.guide[step + 1] + 1).min(self.voxels.len()));
        let sum = at * self.total();
        (first + self.cumulative[first..last].partition_point(|&s| s <= sum)).min(self.voxels.len() - 1)
    }

    /// Draws a point in voxel space, by density and evenly within its voxel, and returns it with the spacing
    /// that `count` points have there.
    pub fn draw(&self, count: usize, rng: &mut impl RngExt) -> ([f32; 3], f32) {
        let slot = self.find(rng.random());
        (self.within(slot, rng), self.spacing(slot, count))
    }

    /// Draws `count` points in voxel space, by density and evenly within their voxels. They come in the order
    /// of the voxels in memory, so that what looks at the volume around each of them finds it in the cache.
    pub fn draw_points(&self, count: usize, rng: &mut impl RngExt) -> Vec<[f32; 3]> {
        let mut places: Vec<f64> = (0..count).map(|_| rng.random()).collect();
        places.par_sort_unstable_by(f64::total_cmp);
        places.into_iter().map(|place| self.within(self.find(place), rng)).collect()
    }

    /// Draws a point in voxel space, evenly within the voxel of a slot.
    fn within(&self, slot: usize, rng: &mut impl RngExt) -> [f32; 3] {
        let [sx, sy, _] = self.size;
        let i = self.voxels[slot];
        let voxel = [i % sx, i / sx % sy, i / (sx * sy)];
        std::array::from_fn(|k| (self.low[k] + voxel[k]) as f32 + (rng.random::<f32>() - 0.5))
    }

    /// Returns G∗V at `point` of voxel space.
    pub fn smoothed(&self, point: [f32; 3]) -> f32 {
        trilinear(&self.smooth, self.size, std::array::from_fn(|k| point[k] - self.low[k] as f32))
    }

    /// Returns ∇(G∗V) at `point` of voxel space, per voxel, from differences over two voxels, or over fewer
    /// at the border.
    pub fn gradient(&self, point: [f32; 3]) -> DVec3 {
        let difference = |axis: usize| {
            let first = self.low[axis] as f32;
            let last = first + (self.size[axis] - 1) as f32;
            let sample = |at: f32| {
                let mut point = point;
                point[axis] = at;
                f64::from(self.smoothed(point))
            };
            let (low, high) = ((point[axis] - 1.0).max(first), (point[axis] + 1.0).min(last));
            if high > low { (sample(high) - sample(low)) / f64::from(high - low) } else { 0.0 }
        };
        DVec3::new(difference(0), difference(1), difference(2))
    }

    /// Returns the second derivatives of G∗V at `point` of voxel space, per voxel², from differences over one
    /// voxel on either side; outside, the outermost samples are repeated.
    pub fn hessian(&self, point: [f32; 3]) -> DMat3 {
        let at = |axis: usize, step: f32, other: usize, other_step: f32| {
            let mut point = point;
            point[axis] += step;
            point[other] += other_step;
            f64::from(self.smoothed(point))
        };
        let here = f64::from(self.smoothed(point));
        let straight = |axis: usize| at(axis, 1.0, axis, 0.0) - 2.0 * here + at(axis, -1.0, axis, 0.0);
        let mixed = |a: usize, b: usize| {
            (at(a, 1.0, b, 1.0) - at(a, 1.0, b, -1.0) - at(a, -1.0, b, 1.0) + at(a, -1.0, b, -1.0)) / 4.0
        };
        symmetric([straight(0), straight(1), straight(2), mixed(0, 1), mixed(0, 2), mixed(1, 2)])
    }

    /// Returns the structure tensors G∗(∇∇ᵀ) of G∗V at `points` of voxel space, per voxel². Their six entries
    /// are computed one after the other, so that no more than two boxes of samples are held besides G∗V.
    pub fn structure_tensors(&self, points: &[[f32; 3]]) -> Vec<DMat3> {
        let mut entries = vec![[0.0; 6]; points.len()];
        for (entry, (a, b)) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)].into_iter().enumerate() {
            let products = gradients(&self.smooth, self.size, |g| g[a] * g[b]);
            let field = smoothed(&products, self.size, &self.taps);
            drop(products);
            entries.par_iter_mut().zip(points).for_each(|(entries, point)| {
                let local = std::array::from_fn(|k| point[k] - self.low[k] as f32);
                entries[entry] = f64::from(trilinear(&field, self.size, local));
            });
        }
        entries.into_iter().map(symmetric).collect()
    }
}

/// Returns the symmetric matrix with the entries xx, yy, zz, xy, xz, yz.
fn symmetric([xx, yy, zz, xy, xz, yz]: [f64; 6]) -> DMat3 {
    DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz])
}

fn running_sum(voxels: &[usize], term: impl Fn(usize) -> f64) -> Vec<f64> {
    let add = |sum: &mut f64, &i: &usize| {
        *sum += term(i);
        Some(*sum)
    };
    voxels.iter().scan(0.0, add).collect()
}

/// Returns, for each of some equal steps from 0 to the total, the first slot whose running sum lies beyond.
fn guide(cumulative: &[f64]) -> Vec<usize> {
    let total = cumulative.last().copied().unwrap_or(0.0);
    let steps = cumulative.len() / VOXELS_PER_GUIDE + 1;
    let mut slot = 0;
    (0..=steps)
        .map(|step| {
            let at = total * step as f64 / steps as f64;
            while slot + 1 < cumulative.len() && cumulative[slot] <= at {
                slot += 1;
            }
            slot
        })
        .collect()
}

/// Interpolates the samples trilinearly at `point`, in voxels; outside, the outermost samples are repeated.
/// No entry of `size` may be 0.
pub(super) fn trilinear(samples: &[f32], size: [usize; 3], point: [f32; 3]) -> f32 {
    let mut low = [0; 3];
    let mut high = [0; 3];
    let mut t = [0.0; 3];
    for k in 0..3 {
        let last = size[k] - 1;
        let x = point[k].clamp(0.0, last as f32);
        low[k] = (x as usize).min(last);
        high[k] = (low[k] + 1).min(last);
        t[k] = x - low[k] as f32;
    }
    let at = |x: usize, y: usize, z: usize| samples[x + size[0] * (y + size[1] * z)];
    let lerp = |a: f32, b: f32, t: f32| a + t * (b - a);
    let along_x = |y, z| lerp(at(low[0], y, z), at(high[0], y, z), t[0]);
    let along_y = |z| lerp(along_x(low[1], z), along_x(high[1], z), t[1]);
    lerp(along_y(low[2]), along_y(high[2]), t[2])
}

/// Returns the taps of a Gaussian sampled to four standard deviations, with sum 1; a single tap without
/// smoothing (`sigma` of 0).
fn gaussian_taps(sigma: f32) -> Vec<f32> {
    if sigma <= 0.0 {
        return vec![1.0];
    }
    let radius = (4.0 * sigma + 0.5) as i32;
    let taps: Vec<f64> =
        (-radius..=radius).map(|i| (-0.5 * (f64::from(i) / f64::from(sigma)).powi(2)).exp()).collect();
    let sum: f64 = taps.iter().sum();
    taps.iter().map(|t| (t / sum) as f32).collect()
}

/// Returns the first voxel and the voxel counts of the box of all weights above 0, wider by `margin` as far
/// as the volume goes; nothing if there is no such weight.
fn bounding_box(roi: &Roi, margin: usize) -> Option<([usize; 3], [usize; 3])> {
    let [sx, sy, _] = roi.size;
    if roi.size.contains(&0) {
        return None;
    }
    let join = |a: Option<([usize; 3], [usize; 3])>, b: Option<([usize; 3], [usize; 3])>| match (a, b) {
        (Some((a_low, a_high)), Some((b_low, b_high))) => Some((
            std::array::from_fn(|k| a_low[k].min(b_low[k])),
            std::array::from_fn(|k| a_high[k].max(b_high[k])),
        )),
        (one, other) => one.or(other),
    };
    let (low, high) = roi
        .weight
        .par_chunks(sx)
        .enumerate()
        .map(|(row, weights)| {
            let first = weights.iter().position(|&w| w > 0.0)?;
            let last = weights.iter().rposition(|&w| w > 0.0)?;
            Some(([first, row % sy, row / sy], [last, row % sy, row / sy]))
        })
        .reduce(|| None, join)?;
    let low = low.map(|v| v.saturating_sub(margin));
    let high: [usize; 3] = std::array::from_fn(|k| (high[k] + margin).min(roi.size[k] - 1));
    Some((low, std::array::from_fn(|k| high[k] - low[k] + 1)))
}

/// Returns the box at `low` of the given `size`, out of samples on a grid of `whole`, each through `map`.
fn crop(
    samples: &[f32],
    whole: [usize; 3],
    low: [usize; 3],
    size: [usize; 3],
    map: impl Fn(f32) -> f32 + Sync,
) -> Vec<f32> {
    let mut out = vec![0.0; size.iter().product()];
    out.par_chunks_mut(size[0]).enumerate().for_each(|(row, out)| {
        let (y, z) = (low[1] + row % size[1], low[2] + row / size[1]);
        let start = low[0] + whole[0] * (y + whole[1] * z);
        for (out, &sample) in out.iter_mut().zip(&samples[start..start + size[0]]) {
            *out = map(sample);
        }
    });
    out
}

/// Convolves the samples with `taps` along each axis; outside, the outermost samples are repeated. Each slice
/// is computed on its own (along z into a plane, then along y, then along x), so that the planes stay in the
/// cache.
fn smoothed(samples: &[f32], size: [usize; 3], taps: &[f32]) -> Vec<f32> {
    let [sx, sy, sz] = size;
    let radius = taps.len() / 2;
    // Index of the sample that tap `j` reads for sample `i` of `n`.
    let met = |i: usize, j: usize, n: usize| (i + j).saturating_sub(radius).min(n - 1);
    let add = |out: &mut [f32], tap: f32, row: &[f32]| {
        for (out, &v) in out.iter_mut().zip(row) {
            *out += tap * v;
        }
    };
    let mut out = vec![0.0; samples.len()];
    let scratch = || (vec![0.0; sx * sy], vec![0.0; sx + 2 * radius]);
    out.par_chunks_mut(sx * sy).enumerate().for_each_init(scratch, |(plane, padded), (z, out)| {
        plane.fill(0.0);
        for (j, &tap) in taps.iter().enumerate() {
            let slice = met(z, j, sz) * sx * sy;
            add(plane, tap, &samples[slice..slice + sx * sy]);
        }
        for (y, out) in out.chunks_exact_mut(sx).enumerate() {
            padded.fill(0.0);
            for (j, &tap) in taps.iter().enumerate() {
                let row = met(y, j, sy) * sx;
                add(&mut padded[radius..radius + sx], tap, &plane[row..row + sx]);
            }
            let (first, last) = (padded[radius], padded[radius + sx - 1]);
            padded[..radius].fill(first);
            padded[radius + sx..].fill(last);
            for (j, &tap) in taps.iter().enumerate() {
                add(out, tap, &padded[j..j + sx]);
            }
        }
    });
    out
}

/// Returns |g|.
fn length(g: [f32; 3]) -> f32 {
    (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]).sqrt()
}

/// Returns `map` of the gradient at each sample, per voxel, by central differences, one-sided at the border.
fn gradients(samples: &[f32], size: [usize; 3], map: impl Fn([f32; 3]) -> f32 + Sync) -> Vec<f32> {
    let [sx, sy, sz] = size;
    let mut out = vec![0.0; samples.len()];
    out.par_chunks_mut(sx).enumerate().for_each(|(row, out)| {
        let (y, z) = (row % sy, row / sy);
        let line = |y: usize, z: usize| &samples[sx * (y + sy * z)..][..sx];
        // The neighbours on both sides and one over their distance.
        let around = |i: usize, n: usize| {
            let (low, high) = (i.saturating_sub(1), (i + 1).min(n - 1));
            (low, high, 1.0 / (high - low).max(1) as f32)
        };
        let (y0, y1, per_y) = around(y, sy);
        let (z0, z1, per_z) = around(z, sz);
        let (here, back, front, below, above) =
            (line(y, z), line(y0, z), line(y1, z), line(y, z0), line(y, z1));
        for (x, out) in out.iter_mut().enumerate() {
            let (x0, x1, per_x) = around(x, sx);
            let g =
                [(here[x1] - here[x0]) * per_x, (front[x] - back[x]) * per_y, (above[x] - below[x]) * per_z];
            *out = map(g);
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voxels_are_found_by_weight() {
        for count in [1, 2, 7, 100, 5000] {
            let size = [count, 1, 1];
            let samples = vec![0.0; count];
            let weight: Vec<f32> = (0..count).map(|i| ((i * 37) % 11) as f32 / 10.0 + 1e-6).collect();
            let volume = Volume::new(size, glam::DAffine3::IDENTITY, samples);
            let roi = Roi { size, weight, soft: true };
            let density =
                Density::of(&volume, &roi, GradientWeights::of(&Init::default())).expect("weights above 0");
            for i in 0..10_000 {
                let at = f64::from(i) / 10_000.0;
                let expected = density.cumulative.partition_point(|&sum| sum <= at * density.total());
                assert_eq!(density.find(at), expected, "{at} of {count} voxels");
            }
            assert_eq!(density.find(1.0 - f64::EPSILON / 2.0), count - 1);
        }
    }

    #[test]
    fn smoothing_keeps_constants_and_agrees_with_the_sum() {
        let taps = gaussian_taps(0.8);
        assert_eq!(taps.len(), 7);
        let size = [5, 4, 6];
        let flat = smoothed(&vec![1000.0; 120], size, &taps);
        assert!(flat.iter().all(|v| *v == flat[0] && (v - 1000.0).abs() < 1e-3));

        let samples: Vec<f32> = (0..120).map(|i| ((i * 7919) % 101) as f32).collect();
        let fast = smoothed(&samples, size, &taps);
        let clamped = |i: usize, j: usize, n: usize| (i + j).saturating_sub(3).min(n - 1);
        for (i, fast) in fast.iter().enumerate() {
            let (x, y, z) = (i % 5, i / 5 % 4, i / 20);
            let mut sum = 0.0;
            for (a, ta) in taps.iter().enumerate() {
                for (b, tb) in taps.iter().enumerate() {
                    for (c, tc) in taps.iter().enumerate() {
                        let at = clamped(x, a, 5) + 5 * (clamped(y, b, 4) + 4 * clamped(z, c, 6));
                        sum += f64::from(ta * tb * tc) * f64::from(samples[at]);
                    }
                }
            }
            assert!((f64::from(*fast) - sum).abs() < 1e-3, "voxel {i}");
        }
        assert_eq!(gaussian_taps(0.0), [1.0]);
    }

    #[test]
    fn the_gradient_of_a_ramp_is_its_slope() {
        let size = [4, 3, 5];
        let at = |i: usize| [(i % 4) as f32, (i / 4 % 3) as f32, (i / 12) as f32];
        let samples: Vec<f32> = (0..60).map(|i| at(i)[0] + 2.0 * at(i)[1] - 2.0 * at(i)[2]).collect();
        assert!(gradients(&samples, size, length).iter().all(|g| (g - 3.0).abs() < 1e-5));
        assert_eq!(gradients(&[7.0], [1, 1, 1], length), [0.0]);
        assert!((trilinear(&samples, size, [1.25, 0.5, 3.75]) + 5.25).abs() < 1e-5);
        assert_eq!(trilinear(&samples, size, [-0.5, 9.0, 4.4]), 4.0 - 8.0);
    }
}
