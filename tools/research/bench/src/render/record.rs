//! Records of measurements.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::cost::{Cost, Passes, mean, median};
use crate::store::Keep;

/// Role of the pictures of a row in a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// The reference itself.
    Reference,
    /// A rendering of the splats, against the reference.
    Mode,
    /// The downsampled volume, against the reference.
    Downsampled,
    /// Two eyes with one sort, against a sort for each eye.
    TwoEyes,
    /// Packed splats, against the same splats unpacked.
    Packed,
}

/// Difference of a picture from its reference, and its cost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sight {
    /// Index of the view in the orbit.
    pub view: usize,
    /// Mean squared difference of red, green and blue. It is not in dB, since JSON has no infinity.
    pub mse: f64,
    /// Structural similarity.
    pub ssim: f64,
    /// Mean FLIP error.
    pub flip: f64,
    /// Cost of this one frame.
    pub cost: Cost,
}

impl Sight {
    /// Returns the PSNR, dB; infinite for equal pictures.
    pub fn psnr(&self) -> f64 {
        -10.0 * self.mse.log10()
    }
}

/// Pictures of one rendering from all views.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Name of the transfer function.
    pub transfer: String,
    /// Name of the rendering.
    pub rendering: String,
    /// Role in the comparison.
    pub role: Role,
    /// Mode of the engine.
    pub mode: String,
    /// Sample distance of the rendering.
    pub step: f64,
    /// True if the transfer function is integrated between samples; `None` if the rendering leaves it to the
    /// look.
    pub integrated: Option<bool>,
    /// Bytes of the volume; `None` if splats are rendered.
    pub volume_bytes: Option<u64>,
    /// Bytes of the packed splats, with all that belongs to them.
    pub packed_bytes: Option<u64>,
    /// Comparisons, one for each view.
    pub sights: Vec<Sight>,
}

impl Comparison {
    /// Returns the mean PSNR over the views, dB.
    pub fn psnr(&self) -> f64 {
        mean(&self.sights.iter().map(Sight::psnr).collect::<Vec<_>>()).unwrap_or(f64::NAN)
    }

    /// Returns the PSNR of the worst view, dB.
    pub fn worst_psnr(&self) -> f64 {
        self.sights.iter().map(Sight::psnr).fold(f64::INFINITY, f64::min)
    }

    /// Returns the mean SSIM over the views.
    pub fn ssim(&self) -> f64 {
        mean(&self.sights.iter().map(|s| s.ssim).collect::<Vec<_>>()).unwrap_or(f64::NAN)
    }

    /// Returns the mean FLIP error over the views.
    pub fn flip(&self) -> f64 {
        mean(&self.sights.iter().map(|s| s.flip).collect::<Vec<_>>()).unwrap_or(f64::NAN)
    }

    /// Returns the median cost of a frame, ms.
    pub fn cost(&self, is_cpu: bool) -> f64 {
        median(&self.sights.iter().map(|s| s.cost.of_device(is_cpu)).collect::<Vec<_>>()).unwrap_or(f64::NAN)
    }
}

/// Times of the frames of one rendering.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Name of the transfer function.
    pub transfer: String,
    /// Name of the rendering.
    pub rendering: String,
    /// Mode of the engine.
    pub mode: String,
    /// True if the volume is rendered without its mask.
    pub whole: bool,
    /// Mean squared difference of the first picture from the most accurate rendering of the same scene;
    /// `None` for splats with colours, which only one mode renders.
    pub mse: Option<f64>,
    /// Index of the view and cost of each frame, in order.
    pub frames: Vec<(usize, Cost)>,
    /// Cost of giving the scene a look and of the frame after it, once from each view.
    #[serde(default)]
    pub changes: Vec<Cost>,
    /// Passes, summed over all frames.
    pub passes: Passes,
    /// Bytes of device memory by purpose, after all frames.
    pub memory: BTreeMap<String, u64>,
}

impl Timing {
    /// Returns the PSNR of the first picture, dB.
    pub fn psnr(&self) -> Option<f64> {
        self.mse.map(|mse| -10.0 * mse.log10())
    }

    /// Returns what a change of the look costs beside the frame that shows it, ms: the difference of the medians;
    /// `None` if none was measured.
    pub fn change(&self, is_cpu: bool) -> Option<f64> {
        let of = |cost: &Cost| cost.of_device(is_cpu);
        let changes: Vec<f64> = self.changes.iter().map(of).collect();
        Some((median(&changes)? - median(&self.each(of))?).max(0.0))
    }

    /// Returns one figure of each frame.
    pub fn each(&self, figure: impl Fn(&Cost) -> f64) -> Vec<f64> {
        self.frames.iter().map(|(_, cost)| figure(cost)).collect()
    }
}

/// Result of a unit.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Key of the unit.
    pub key: String,
    /// Number of splats rendered.
    pub splats: usize,
    /// True if the splats are those of standard 3D Gaussian splatting, with colours.
    pub of_colours: bool,
    /// Sum of the mask.
    pub roi_voxels: f64,
    /// Comparisons of pictures.
    pub comparisons: Vec<Comparison>,
    /// Times of frames.
    pub timings: Vec<Timing>,
    /// Lines that say what could not be measured and why.
    pub left_out: Vec<String>,
}

impl Keep for Record {
    fn key(&self) -> String {
        self.key.clone()
    }
}

/// Records by key.
pub type Records = BTreeMap<String, Record>;
