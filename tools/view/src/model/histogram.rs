//! Histograms of the intensities of a scene.

use engine::splat::{Activations, SplatSet};
use engine::volume::{Roi, Volume};

/// Number of bins of a histogram, over its whole range.
const BINS: usize = 512;
/// Parts in which a coded voxel counts within its bound.
const SPREAD: usize = 8;

/// Amount of a scene by intensity, in bins of equal width.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    /// Lower end of the first bin and upper end of the last one, HU for CT.
    pub range: [f64; 2],
    /// Content of each bin, mm³ or voxels; only the proportions have a meaning.
    pub bins: Vec<f64>,
}

impl Histogram {
    /// Counts splats and coded voxels. A splat counts by its weight a integrated over space, which is in proportion to
    /// opacity ×
    /// volume. Returns `None` for splats without an intensity.
    pub fn of_splats(set: &SplatSet) -> Option<Self> {
        let voxel = set.grid.map_or(0.0, |grid| grid.world_from_voxel.matrix3.determinant().abs());
        let coded = || set.coded().map(|(_, v)| v);
        let values = || set.splats.iter().map(|s| f64::from(s.intensity)).chain(coded());
        let rows = set.splats.iter().map(|splat| {
            let log_scale = splat.log_scale.map(f64::from);
            let volume = log_scale.iter().sum::<f64>().exp();
            let weight = f64::from(splat.opacity()) * set.field.kernel.peak(log_scale) * volume;
            (f64::from(splat.intensity), weight)
        });
        // What is coded within a bound is anywhere within it.
        let bound = set.voxels.iter().map(|voxels| voxels.precision.bound()).fold(0.0, f64::max);
        let of_part = |k: usize| (2.0 * k as f64 + 1.0) / SPREAD as f64 - 1.0;
        let spread = |v: f64| (0..SPREAD).map(move |k| (v + bound * of_part(k), voxel));
        let rows = rows.chain(coded().flat_map(spread));
        if set.unit.is_physical() { Histogram::of(range_of(values())?, rows) } else { None }
    }

    /// Counts the voxels of a volume, each by its weight in the region, or all alike without a region.
    /// Samples that are not finite do not count.
    pub fn of_volume(volume: &Volume, roi: Option<&Roi>) -> Option<Self> {
        let weight = |i: usize| roi.map_or(1.0, |roi| f64::from(roi.weight[i]));
        let samples = || volume.samples.iter().map(|&v| f64::from(v)).enumerate();
        let inside = samples().filter(|&(i, _)| weight(i) > 0.0).map(|(_, v)| v);
        Histogram::of(range_of(inside)?, samples().map(|(i, v)| (v, weight(i))))
    }

    /// Counts (intensity, weight) pairs. Pairs beyond the range, or with a weight that is not finite, are
    /// left out.
    fn of(range: [f64; 2], rows: impl Iterator<Item = (f64, f64)>) -> Option<Self> {
        let [low, high] = range;
        let mut bins = vec![0.0; BINS];
        for (v, weight) in rows {
            if (low..=high).contains(&v) && weight.is_finite() {
                let at = (v - low) / (high - low) * BINS as f64;
                bins[(at as usize).min(BINS - 1)] += weight;
            }
        }
        Some(Histogram { range, bins })
    }

    /// Returns heights from 0 to 1 for the screen, logarithmic over four decades below the highest bin: a
    /// tumour is 10⁻³ of a body.
    pub fn heights(&self) -> Vec<f32> {
        let most = self.bins.iter().copied().fold(0.0, f64::max);
        let height = |&n: &f64| if n > 0.0 { (1.0 + (n / most).log10() / 4.0).max(0.0) } else { 0.0 };
        self.bins.iter().map(|n| height(n) as f32).collect()
    }
}

/// Returns the least and greatest finite value, at least 1 apart.
fn range_of(values: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
    let ends = |[low, high]: [f64; 2], v: f64| [low.min(v), high.max(v)];
    let [low, high] = values.filter(|v| v.is_finite()).fold([f64::INFINITY, f64::NEG_INFINITY], ends);
    (low <= high).then(|| [low, high.max(low + 1.0)])
}

#[cfg(test)]
mod tests {
    use engine::splat::Splat;
    use engine::unit::Unit;
    use glam::DAffine3;

    use super::*;

    fn splat(intensity: f32, opacity: f32, scale: [f32; 3]) -> Splat {
        let mut splat = Splat { intensity, ..Splat::default() };
        splat.set_opacity(opacity);
        splat.set_scale(scale);
        splat
    }

    #[test]
    fn splats_count_by_opacity_and_volume() {
        let mut set = SplatSet {
            splats: vec![splat(0.0, 0.5, [1.0; 3]), splat(512.0, 0.25, [2.0, 4.0, 1.0])],
            ..SplatSet::default()
        };
        let histogram = Histogram::of_splats(&set).expect("two splats");
        assert_eq!(histogram.range, [0.0, 512.0]);
        let [first, last] = [histogram.bins[0], histogram.bins[BINS - 1]];
        assert!((first - 0.5).abs() < 1e-6 && (last - 2.0).abs() < 1e-5, "{first} {last}");
        assert!((histogram.bins.iter().sum::<f64>() - first - last).abs() < 1e-12);
        set.unit = Unit::Luminance;
        assert_eq!(Histogram::of_splats(&set), None);
        assert_eq!(Histogram::of_splats(&SplatSet::default()), None);
    }

    #[test]
    fn only_voxels_of_the_region_count() {
        let samples = vec![0.0, 100.0, 100.0, f32::NAN, 200.0, 1e4];
        let volume = Volume::new([6, 1, 1], DAffine3::IDENTITY, samples);
        let roi = Roi::new(vec![1.0, 1.0, 0.5, 1.0, 1.0, 0.0], &volume).expect("a region");
        let histogram = Histogram::of_volume(&volume, Some(&roi)).expect("voxels");
        assert_eq!(histogram.range, [0.0, 200.0]);
        assert_eq!(histogram.bins[BINS / 2], 1.5);
        assert_eq!(histogram.bins.iter().sum::<f64>(), 3.5);
        let all = Histogram::of_volume(&volume, None).expect("voxels");
        assert_eq!((all.range, all.bins.iter().sum::<f64>()), ([0.0, 1e4], 5.0));
    }

    #[test]
    fn heights_are_logarithmic() {
        let histogram = Histogram { range: [0.0, 4.0], bins: vec![1e6, 1e4, 1.0, 0.0] };
        assert_eq!(histogram.heights(), [1.0, 0.5, 0.0, 0.0]);
        let empty = Histogram { range: [0.0, 1.0], bins: vec![0.0; 4] };
        assert_eq!(empty.heights(), [0.0; 4]);
    }

    #[test]
    fn a_constant_scene_has_a_range() {
        let volume = Volume::new([2, 1, 1], DAffine3::IDENTITY, vec![7.0; 2]);
        let histogram = Histogram::of_volume(&volume, None).expect("voxels");
        assert_eq!((histogram.range, histogram.bins[0]), ([7.0, 8.0], 2.0));
        let nothing = Volume::new([1, 1, 1], DAffine3::IDENTITY, vec![f32::NAN]);
        assert_eq!(Histogram::of_volume(&nothing, None), None);
    }
}
