//! What was measured.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::cost::{Cost, Passes, mean, median};
use crate::store::Keep;

/// What a row of pictures shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// What the others are compared with.
    Reference,
    /// A rendering of the splats.
    Mode,
    /// The volume, downsampled.
    Downsampled,
    /// Two eyes with one order, against an order for each.
    TwoEyes,
    /// Packed splats, against the same in full.
    Packed,
}

/// How far a picture is from the one that it is compared with, and what it took.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Sight {
    /// Place of the view in the orbit.
    pub view: usize,
    /// Mean squared difference of red, green and blue; not in dB, since files cannot say infinity.
    pub mse: f64,
    /// Structural similarity.
    pub ssim: f64,
    /// Mean of FLIP.
    pub flip: f64,
    /// Of this one frame.
    pub cost: Cost,
}

impl Sight {
    /// dB; infinite for equal pictures.
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
    /// What it is.
    pub role: Role,
    /// Mode of the engine.
    pub mode: String,
    /// Its step.
    pub step: f64,
    /// Its classification, where it is set.
    pub integrated: Option<bool>,
    /// Bytes of a volume; nothing where splats are rendered.
    pub volume_bytes: Option<u64>,
    /// Bytes of splats as they were packed, with all that belongs to them.
    pub packed_bytes: Option<u64>,
    /// One for each view.
    pub sights: Vec<Sight>,
}

impl Comparison {
    /// Mean over the views, dB.
    pub fn psnr(&self) -> f64 {
        mean(&self.sights.iter().map(Sight::psnr).collect::<Vec<_>>()).unwrap_or(f64::NAN)
    }

    /// Of the worst view, dB.
    pub fn worst_psnr(&self) -> f64 {
        self.sights.iter().map(Sight::psnr).fold(f64::INFINITY, f64::min)
    }

    /// Mean over the views.
    pub fn ssim(&self) -> f64 {
        mean(&self.sights.iter().map(|s| s.ssim).collect::<Vec<_>>()).unwrap_or(f64::NAN)
    }

    /// Mean over the views.
    pub fn flip(&self) -> f64 {
        mean(&self.sights.iter().map(|s| s.flip).collect::<Vec<_>>()).unwrap_or(f64::NAN)
    }

    /// Median of what a frame cost, ms.
    pub fn cost(&self, is_cpu: bool) -> f64 {
        median(&self.sights.iter().map(|s| s.cost.of_device(is_cpu)).collect::<Vec<_>>()).unwrap_or(f64::NAN)
    }
}

/// Frames of one rendering.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Timing {
    /// Name of the transfer function.
    pub transfer: String,
    /// Name of the rendering.
    pub rendering: String,
    /// Mode of the engine.
    pub mode: String,
    /// Whether it is the volume without its mask.
    pub whole: bool,
    /// Mean squared difference of its first picture from the most accurate rendering of the same; nothing of colours that
    /// are not classified, which only one mode renders.
    pub mse: Option<f64>,
    /// Place of the view of each frame, and what it took, in order.
    pub frames: Vec<(usize, Cost)>,
    /// Passes of all frames.
    pub passes: Passes,
    /// Bytes of device memory by purpose, with all frames done.
    pub memory: BTreeMap<String, u64>,
}

impl Timing {
    /// Of the first picture, dB.
    pub fn psnr(&self) -> Option<f64> {
        self.mse.map(|mse| -10.0 * mse.log10())
    }

    /// One figure of each frame.
    pub fn each(&self, figure: impl Fn(&Cost) -> f64) -> Vec<f64> {
        self.frames.iter().map(|(_, cost)| figure(cost)).collect()
    }
}

/// What a unit gave.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// Key of the unit.
    pub key: String,
    /// Splats that were rendered.
    pub splats: usize,
    /// Whether they are of ordinary 3D Gaussian splatting.
    pub of_colours: bool,
    /// Sum of the mask.
    pub roi_voxels: f64,
    /// Pictures.
    pub comparisons: Vec<Comparison>,
    /// Frames.
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
