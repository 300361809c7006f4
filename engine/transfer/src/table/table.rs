//! A transfer function as a table, for a renderer to upload.
//!
//! Entry `i` stands at the intensity `first + i · step`; `step` is a power of two and every entry is a number
//! of `f32`. There are two rows of them, and `gradient_factors` over the magnitude of the gradient. `points` has
//! rgb and τ (1/mm) at the entries. `integrals` has ∫τ·rgb and ∫τ from the first entry on, for pre-integrated
//! classification (Engel, Kraus, Ertl 2001): along a segment on which the intensity goes evenly from v_a to v_b
//! the mean extinction is (K(v_b) − K(v_a)) / (v_b − v_a).
//!
//! Differences of prefix sums cancel: in `f32` the rounding of a large K would drown what little a
//! translucent tissue adds. So the sums are whole numbers, in units of `integral_unit`: their differences are
//! exact in 32 bits whatever stands before, and the error of a mean extinction is 2⁻³² of the whole integral
//! per entry that the segment spans. A segment shorter than an entry uses the point in its middle instead
//! ([`Table::segment`]).

use glam::DVec3;
use shader_interface::look_row::GRADIENT_ENTRIES;

use crate::function::{From, MAX_OPACITY, extinction_of, interpolate};
use crate::{MAX_INTENSITY, TransferFunction};

/// Fewest entries of a table.
const MIN_LEN: usize = 4096;
/// Most entries of a table; for functions over more intensities than that the step is above 1.
const MAX_LEN: usize = 65536;
/// Least step below 1 as a share of the greatest intensity: `f32` could not tell the intensities of finer
/// entries apart. Steps of 1 or more may be half as large.
const FINEST: f64 = 1.0 / (1 << 22) as f64;
/// Exponent of the finest step.
const MIN_EXPONENT: i32 = -40;

/// A transfer function, sampled and integrated.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Intensity of entry 0; a whole multiple of `step`.
    pub first: f64,
    /// Distance between entries, in intensity: a power of two, at most 1 unless that takes more than 65536
    /// entries.
    pub step: f64,
    /// Red, green, blue (not premultiplied) and τ in 1/mm at each entry.
    pub points: Vec<[f32; 4]>,
    /// ∫τ·red, ∫τ·green, ∫τ·blue and ∫τ from entry 0 to each entry, in units of `integral_unit`.
    pub integrals: Vec<[u32; 4]>,
    /// Unit of `integrals`, in 1/mm times entries: a power of two.
    pub integral_unit: f64,
    /// Factors of the opacity, entry `i` for a gradient magnitude of `i · gradient_step`; straight between entries, so
    /// that a step of the function is as wide as one of them.
    pub gradient_factors: Vec<f32>,
    /// Distance between entries of `gradient_factors`: intensity over a mean edge of the CT's voxels.
    pub gradient_step: f64,
}

impl Table {
    /// Creates the table of a transfer function for intensities from `range[0]` to `range[1]`; intensities
    /// outside of it are shown as its ends. The table is shorter if the function is transparent or constant
    /// at the ends of the range. A bound that is not finite is ignored.
    pub fn new(tf: &TransferFunction, range: [f64; 2]) -> Self {
        let [low, high] = span(tf, range);
        let (first, step, len) = grid(low, high);
        let at = |i: usize| first + i as f64 * step;
        let points = (0..len).map(|i| {
            let (colour, opacity) = tf.at(at(i));
            let [r, g, b] = colour.as_vec3().to_array();
            [r, g, b, extinction_of(opacity) as f32]
        });
        let points = points.collect();
        // Places of the control points, so that cells are cut there.
        let mut knots: Vec<f64> = tf.colours().iter().map(|p| p.intensity).collect();
        knots.extend(tf.opacities().iter().map(|p| p.intensity));
        knots.sort_by(f64::total_cmp);
        let mut sums = vec![[0.0; 4]; len];
        for i in 1..len {
            let cell = cell_integral(tf, &knots, at(i - 1), at(i));
            sums[i] = std::array::from_fn(|c| sums[i - 1][c] + cell[c] / step);
        }
        let integral_unit = unit_of(sums[len - 1][3]);
        let integrals = sums.iter().map(|s| s.map(|x| (x / integral_unit).round() as u32)).collect();
        let (gradient_factors, gradient_step) = gradient_table(tf);
        Table { first, step, points, integrals, integral_unit, gradient_factors, gradient_step }
    }

    /// Returns the most entries of a table of any function for intensities in `range`.
    pub fn most_entries(range: [f64; 2]) -> usize {
        // In steps of 1 the range and its ends; in finer steps less than twice the fewest.
        let in_steps = (range[1] - range[0]).ceil() + 5.0;
        if in_steps < MAX_LEN as f64 { (in_steps as usize).max(2 * MIN_LEN) } else { MAX_LEN }
    }

    /// Returns the number of entries.
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// Returns true if there are no entries, which is never the case.
    pub fn is_empty(&self) -> bool {
        self.points.is_empty()
    }

    /// Returns the place of an intensity, in entries from the first one.
    fn entry(&self, v: f64) -> f64 {
        (v - self.first) / self.step
    }

    /// Returns the colour and extinction (1/mm) of the entry that is nearest to intensity `v`.
    pub fn point(&self, v: f64) -> (DVec3, f64) {
        let last = self.len() as f64 - 1.0;
        let nearest = (self.entry(v) + 0.5).floor().clamp(0.0, last);
        let [r, g, b, extinction] = self.points[nearest as usize].map(f64::from);
        (DVec3::new(r, g, b), extinction)
    }

    /// Returns the mean colour and mean extinction (1/mm) along a segment on which the intensity changes
    /// evenly from `va` to `vb`, in either direction; the colour is weighted with the extinction. The
    /// segment's opacity is 1 − exp(−extinction · length).
    pub fn segment(&self, va: f64, vb: f64) -> (DVec3, f64) {
        let (a, b) = (self.entry(va.min(vb)), self.entry(va.max(vb)));
        let width = b - a;
        if width < 1.0 {
            return self.point(0.5 * (va + vb));
        }
        let last = self.len() as f64 - 1.0;
        let (ia, fa) = self.cell(a);
        let (ib, fb) = self.cell(b);
        // The stretches beyond the ends, where the function is constant.
        let below = b.min(0.0) - a.min(0.0);
        let above = b.max(last) - a.max(last);
        let (start, end) = (self.points[0].map(f64::from), self.points[self.len() - 1].map(f64::from));
        let sum: [f64; 4] = std::array::from_fn(|c| {
            let inside = |i: usize| f64::from(self.integrals[i + 1][c] - self.integrals[i][c]);
            let whole = f64::from(self.integrals[ib][c] - self.integrals[ia][c]);
            let emission = |e: [f64; 4]| if c < 3 { e[c] * e[3] } else { e[3] };
            ((whole + fb * inside(ib) - fa * inside(ia)) * self.integral_unit).max(0.0)
                + below * emission(start)
                + above * emission(end)
        });
        if sum[3] <= 0.0 {
            return (DVec3::ZERO, 0.0);
        }
        (DVec3::new(sum[0], sum[1], sum[2]).min(DVec3::splat(sum[3])) / sum[3], sum[3] / width)
    }

    /// Returns the factor of the opacity for a gradient of this magnitude.
    pub fn gradient_factor(&self, magnitude: f64) -> f64 {
        let last = self.gradient_factors.len() - 1;
        let at = (magnitude / self.gradient_step).min(last as f64);
        let low = (at as usize).min(last - 1);
        let [a, b] = [low, low + 1].map(|i| f64::from(self.gradient_factors[i]));
        a + (b - a) * (at - low as f64)
    }

    /// Returns the cell between two entries in which a place lies, and how far in it is, 0 to 1.
    fn cell(&self, entry: f64) -> (usize, f64) {
        let inside = entry.clamp(0.0, self.len() as f64 - 1.0);
        let cell = inside.floor().min(self.len() as f64 - 2.0);
        (cell as usize, inside - cell)
    }
}

/// Returns the factors of the opacity from no gradient to the one from which on they stay the same, and the distance
/// of entries.
fn gradient_table(tf: &TransferFunction) -> (Vec<f32>, f64) {
    let points = tf.gradient_opacities();
    let Some(end) = points.last() else { return (vec![1.0; GRADIENT_ENTRIES as usize], 1.0) };
    let changes = points.iter().rposition(|point| point.opacity != end.opacity);
    let last = changes.map_or(0.0, |i| points[i + 1].intensity);
    let steps = f64::from(GRADIENT_ENTRIES - 1);
    let step = if last > 0.0 { (last / steps).max(f64::from(f32::MIN_POSITIVE)) } else { 1.0 };
    let factor = |i: u32| interpolate(points, f64::from(i) * step, From::Above) as f32;
    ((0..GRADIENT_ENTRIES).map(factor).collect(), step)
}

/// Returns the range of intensities over which the function changes and is visible.
fn span(tf: &TransferFunction, range: [f64; 2]) -> [f64; 2] {
    let [first, last] = tf.extent();
    let visible = tf.visible().unwrap_or([first, first]);
    let low = if visible[0].is_finite() { visible[0] } else { first };
    let high = if visible[1].is_finite() { visible[1] } else { last };
    // max and min ignore NaN.
    let bounds = [range[0].max(-MAX_INTENSITY), range[1].min(MAX_INTENSITY)];
    [low, high].map(|v| v.max(bounds[0]).min(bounds[1]).max(-MAX_INTENSITY))
}

/// Returns the intensity of the first entry, the step and the number of entries for a table from `low` to
/// `high`.
fn grid(low: f64, high: f64) -> (f64, f64, usize) {
    // One entry more on each side, so that a step of the function at an end has both its sides.
    let first = |step: f64| (low / step).floor() - 1.0;
    let count = |step: f64| (high / step).ceil() + 2.0 - first(step);
    let magnitude = low.abs().max(high.abs());
    let mut exponent = 0;
    let step = |exponent: i32| 2f64.powi(exponent);
    while count(step(exponent)) > MAX_LEN as f64 || magnitude * FINEST > 2.0 * step(exponent) {
        exponent += 1;
    }
    while count(step(exponent)) < MIN_LEN as f64
        && exponent > MIN_EXPONENT
        && magnitude * FINEST <= step(exponent - 1)
    {
        exponent -= 1;
    }
    let step = step(exponent);
    (first(step) * step, step, (count(step) as usize).max(MIN_LEN))
}

/// Returns the smallest power of two in units of which `total` is a number of 32 bits.
fn unit_of(total: f64) -> f64 {
    if total <= 0.0 {
        return 1.0;
    }
    let mut unit = 2f64.powi((total.log2().floor() as i32) - 32);
    while total / unit > f64::from(u32::MAX) - 0.5 {
        unit *= 2.0;
    }
    unit
}

/// Returns ∫τ·rgb and ∫τ over the intensities from `low` to `high`; `knots` are the control points'
/// intensities.
fn cell_integral(tf: &TransferFunction, knots: &[f64], low: f64, high: f64) -> [f64; 4] {
    let mut sum = [0.0; 4];
    let mut from = low;
    let inside = knots.partition_point(|&k| k <= low)..knots.partition_point(|&k| k < high);
    for &to in knots[inside].iter().chain([&high]) {
        if to > from {
            let piece =
                Piece { width: to - from, from: tf.side(from, From::Above), to: tf.side(to, From::Below) };
            piece.add_to(&mut sum);
            from = to;
        }
    }
    sum
}

/// A stretch of intensities on which colour and opacity are linear.
#[derive(Clone, Copy)]
struct Piece {
    width: f64,
    from: (DVec3, f64),
    to: (DVec3, f64),
}

impl Piece {
    fn at(&self, share: f64) -> (DVec3, f64) {
        let mix = |a: f64, b: f64| a + (b - a) * share;
        (self.from.0.lerp(self.to.0, share), mix(self.from.1, self.to.1))
    }

    /// Adds the integrals over the piece by Gauss-Legendre quadrature with three nodes. The piece is halved
    /// first if the logarithm of 1 − α bends too much for that.
    fn add_to(&self, sum: &mut [f64; 4]) {
        let passing = |opacity: f64| 1.0 - opacity.min(MAX_OPACITY);
        let (a, b) = (passing(self.from.1), passing(self.to.1));
        if a.max(b) > 1.25 * a.min(b) {
            let middle = self.at(0.5);
            let width = self.width / 2.0;
            Piece { width, from: self.from, to: middle }.add_to(sum);
            Piece { width, from: middle, to: self.to }.add_to(sum);
            return;
        }
        let reach = 0.5 * 0.6f64.sqrt();
        for (share, weight) in [(0.5 - reach, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + reach, 5.0 / 18.0)] {
            let (colour, opacity) = self.at(share);
            let extinction = extinction_of(opacity) * weight * self.width;
            let [r, g, b] = (colour * extinction).to_array();
            for (sum, value) in sum.iter_mut().zip([r, g, b, extinction]) {
                *sum += value;
            }
        }
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
