//! Targets of a fit: volume and mask, sampled trilinearly at each sub-voxel offset, because that is what
//! every volume renderer shows.

use glam::IVec3;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use shaders_glsl::types::Target;

use super::{Background, FitConfig, IntensityRange};
use volume::{Bricks, Roi, Volume};

/// Limit of intensities that are not clamped, so that they stay finite: this many spans beyond the range.
const FAR: f32 = 1000.0;

/// The map between HU and the numbers of a fit: value = (HU - background) / unit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scaling {
    /// Range that intensities are clipped to, HU.
    pub range: (f32, f32),
    /// Intensity where no splat reaches, HU: the mean over the ROI or the lower end of the range.
    pub background: f32,
    /// HU per unit of the fit: the span of the range.
    pub unit: f32,
    /// Range that the intensities of splats stay in, HU: least and greatest in the ROI after clipping, or
    /// next to no limit.
    pub intensity_range: (f32, f32),
}

impl Scaling {
    /// Creates the scaling of a volume in its ROI, with the range that the configuration names or the data
    /// suggest.
    pub fn new(volume: &Volume, roi: &Roi, config: &FitConfig) -> Self {
        let range = match config.region.hu_range {
            [0.0, 0.0] if config.region.range == IntensityRange::Roi => {
                roi.range(volume).unwrap_or_default().into()
            }

            [0.0, 0.0] if volume.is_ct() => (-1024.0, 3071.0),
            [0.0, 0.0] => volume.min_max().unwrap_or_default(),
            [low, high] => (low, high),
        };
        let (mut sum, mut weight) = (0.0, 0.0);
        let mut roi_range = (f32::INFINITY, f32::NEG_INFINITY);
        for (&v, &w) in volume.samples.iter().zip(&roi.weight) {
            if w > 0.0 && v.is_finite() {
                let v = v.clamp(range.0, range.1);
                sum += f64::from(v) * f64::from(w);
                weight += f64::from(w);
                roi_range = (roi_range.0.min(v), roi_range.1.max(v));
            }
        }
        if config.has_rim(roi) {
            // Splats at the edge reach into the rim and must be able to hold what is there.
            for v in rim_samples(volume, roi) {
                let v = v.clamp(range.0, range.1);
                roi_range = (roi_range.0.min(v), roi_range.1.max(v));
            }
        }
        // A constant volume has no span; any positive unit does.
        let unit = if range.1 > range.0 { range.1 - range.0 } else { 1.0 };
        let background = match config.region.background {
            // The mean lies in the range up to rounding; a constant ROI has it exactly.
            Background::Mean => ((sum / weight) as f32).clamp(roi_range.0, roi_range.1),
            Background::Low => range.0,
        };
        let intensity_range = match config.rates.clamp_intensity {
            true => roi_range,
            false => (range.0 - FAR * unit, range.1 + FAR * unit),
        };
        Scaling { range, background, unit, intensity_range }
    }

    /// Converts HU to the fit's number.
    pub fn value(&self, hu: f32) -> f32 {
        (hu - self.background) / self.unit
    }

    /// Converts the fit's number to HU.
    pub fn hu(&self, value: f32) -> f32 {
        value * self.unit + self.background
    }
}

/// Returns the zero offset (the grid itself), then `count` - 1 random offsets in ±½ voxel.
pub fn offsets(count: usize, seed: u64) -> Vec<[f32; 3]> {
    let mut random = Pcg64::seed_from_u64(seed ^ 0x6f66_6673_6574_7321);
    let mut list = vec![[0.0; 3]];
    list.extend((1..count).map(|_| std::array::from_fn(|_| random.random_range(-0.5f32..0.5))));
    list
}

/// Mask that marks a sample in the rim of a binary region: the least that a target can hold, negligible to a
/// term of the mask.
const RIM: f32 = 1.0 / 32767.0;

/// Returns the targets of the slots `range` at one offset, in memory order. If `rim` is true, voxels beside
/// the region (among the 26 around a voxel of it) are marked as its rim.
pub fn sample(
    bricks: &Bricks,
    range: std::ops::Range<usize>,
    volume: &Volume,
    roi: &Roi,
    scaling: &Scaling,
    offset: [f32; 3],
    rim: bool,
) -> Vec<Target> {
    let offset = glam::Vec3::from_array(offset).as_dvec3();
    bricks.map_samples(range, Target::IDLE, |voxel| {
        let x = voxel.as_dvec3() + offset;
        let hu = volume.sample_clipped(x, scaling.range, scaling.background);
        let value = (hu - f64::from(scaling.background)) / f64::from(scaling.unit);
        let mask = roi.trilinear(x) as f32;
        Target::new(value as f32, if rim && mask == 0.0 && is_beside(roi, voxel) { RIM } else { mask })
    })
}

/// Returns the finite samples of the rim, some of them several times.
fn rim_samples<'a>(volume: &'a Volume, roi: &'a Roi) -> impl Iterator<Item = f32> + 'a {
    let [nx, ny, _] = volume.size;
    let size = IVec3::from_array(volume.size.map(|n| n as i32));
    let inside = (0..roi.weight.len()).filter(|&i| roi.weight[i] > 0.0);
    let around = move |i: usize| {
        let voxel = IVec3::new((i % nx) as i32, (i / nx % ny) as i32, (i / (nx * ny)) as i32);
        (0..27).map(move |k| voxel + IVec3::new(k % 3, k / 3 % 3, k / 9) - 1)
    };
    let is_rim = move |v: &IVec3| v.cmpge(IVec3::ZERO).all() && v.cmplt(size).all() && roi.at(*v) == 0.0;
    let sample = |v: IVec3| volume.samples[volume.index(v.x as usize, v.y as usize, v.z as usize)];
    inside.flat_map(around).filter(is_rim).map(sample).filter(|v| v.is_finite())
}

/// Returns true if one of the 26 voxels around a voxel of the volume is in the region; false beyond the
/// volume, where there is no intensity.
fn is_beside(roi: &Roi, voxel: IVec3) -> bool {
    let size = IVec3::from_array(roi.size.map(|n| n as i32));
    let is_in_volume = voxel.cmpge(IVec3::ZERO).all() && voxel.cmplt(size).all();
    is_in_volume && (0..27).any(|i| roi.at(voxel + IVec3::new(i % 3, i / 3 % 3, i / 9) - 1) > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_background_is_the_mean_or_the_lower_end() {
        let samples = vec![-1000.0, -50.0, 100.0, 5000.0, f32::NAN, 30.0];
        let volume = Volume::new([6, 1, 1], glam::DAffine3::IDENTITY, samples);
        let roi = Roi::new(vec![0.0, 0.5, 1.0, 0.5, 0.0, 0.0], &volume).expect("a region");
        let mean = (0.5 * -50.0 + 100.0 + 0.5 * 3071.0) / 2.0;
        let rows = [
            (Background::Mean, [0.0, 0.0], mean),
            (Background::Low, [0.0, 0.0], -1024.0),
            (Background::Low, [-200.0, 300.0], -200.0),
        ];
        for (background, hu_range, hu) in rows {
            let config = FitConfig::default().with(|c| {
                c.region.background = background;
                c.region.hu_range = hu_range;
            });
            let scaling = Scaling::new(&volume, &roi, &config);
            assert_eq!(scaling.background, hu, "{background:?} of {hu_range:?}");
            assert_eq!(
                (scaling.value(hu), scaling.hu(0.0)),
                (0.0, hu),
                "an uncovered sample is 0 inside a fit"
            );
            // Equation (2) to the letter: intensities from 0 to 1.
            let (low, high) = (scaling.value(scaling.range.0), scaling.value(scaling.range.1));
            assert!((high - low - 1.0).abs() < 1e-6 && (background == Background::Mean || low == 0.0));
        }
    }
}
