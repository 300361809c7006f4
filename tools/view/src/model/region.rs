//! The region of a volume that is shown and fitted: a mask, or a threshold whose voxels are cleaned.

use std::path::PathBuf;

use engine::Result;
use engine::volume::{Cleaning, Roi, Volume};
use serde::{Deserialize, Serialize};

/// The voxels within two intensities, cleaned in the order of the fields.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Threshold {
    /// Least intensity, HU for CT.
    pub low: f64,
    /// Greatest intensity, HU for CT.
    pub high: f64,
    /// Least volume of a connected piece, ml; smaller pieces are left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_ml: Option<f64>,
    /// Number of connected pieces to keep, the largest ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub largest: Option<u32>,
    /// Radius of the ball that closes gaps, mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub close_mm: Option<f64>,
    /// True if holes that are enclosed on all sides are filled.
    #[serde(default)]
    pub fill_holes: bool,
}

/// What makes up a region.
#[derive(Clone, Debug, PartialEq)]
pub enum Region {
    /// A mask file.
    Mask {
        /// Path of the file.
        path: PathBuf,
        /// Labels of a label map, by number or name, with commas between them; `None` for a mask as it is.
        labels: Option<String>,
    },
    /// A threshold.
    Threshold(Threshold),
}

/// Size of a region.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionSize {
    /// Number of voxels with any weight.
    pub voxels: usize,
    /// Sum of the weights: voxels, each by its membership.
    pub weight: f64,
    /// Volume, ml.
    pub ml: f64,
}

impl Threshold {
    /// Creates a threshold without cleaning.
    pub fn new(low: f64, high: f64) -> Self {
        Threshold { low, high, min_ml: None, largest: None, close_mm: None, fill_holes: false }
    }

    /// Returns the bones of a CT, with the threshold that is usual for them, and the upper half of the range
    /// of anything else.
    pub fn first(range: [f64; 2], is_ct: bool) -> Self {
        if is_ct {
            Threshold::new(226.0, 3071.0)
        } else {
            Threshold::new((range[0] + range[1]) * 0.5, range[1])
        }
    }

    /// Finds the voxels of a volume.
    ///
    /// # Errors
    /// Returns the errors of [`Cleaning::region`].
    pub fn find(&self, volume: &Volume) -> Result<Roi> {
        let largest = self.largest.map(|n| n as usize);
        let Threshold { min_ml, close_mm, fill_holes, .. } = *self;
        let cleaning = Cleaning { min_ml, largest, close_mm, fill_holes };
        cleaning.region(volume, self.low as f32, self.high as f32)
    }
}

impl RegionSize {
    /// Measures a region on the grid of `volume`.
    pub fn of(roi: &Roi, volume: &Volume) -> Self {
        RegionSize { voxels: roi.voxel_count(), weight: roi.weight_sum(), ml: roi.ml(volume) }
    }
}

#[cfg(test)]
mod tests {
    use glam::{DAffine3, DVec3};

    use super::*;

    #[test]
    fn a_threshold_is_found_cleaned_and_measured() {
        let mut samples = vec![0.0; 6 * 5 * 4];
        // A block of 2 x 2 x 2 voxels, and a speckle.
        for i in [0, 1, 6, 7, 30, 31, 36, 37, 119] {
            samples[i] = 500.0;
        }
        let volume = Volume::new([6, 5, 4], DAffine3::from_scale(DVec3::new(2.0, 3.0, 5.0)), samples);
        let plain = Threshold::new(226.0, 3071.0);
        let size = |t: &Threshold| RegionSize::of(&t.find(&volume).expect("a region"), &volume);
        assert_eq!(size(&plain), RegionSize { voxels: 9, weight: 9.0, ml: 0.27 });
        assert_eq!(size(&Threshold { largest: Some(1), ..plain.clone() }).voxels, 8);
        assert_eq!(Threshold::new(600.0, 700.0).find(&volume).expect_err("nothing").code, "VGS-ROI-003");
        assert_eq!(Threshold::new(f64::NAN, 700.0).find(&volume).expect_err("no bound").code, "VGS-ROI-005");
        assert_eq!(Threshold::first([-1024.0, 2000.0], true), plain);
        assert_eq!(Threshold::first([0.0, 100.0], false), Threshold::new(50.0, 100.0));
    }
}
