//! What a choice costs and how right it is, averaged over all cases.

use serde::Serialize;

use super::plan::Choice;

/// A choice over all cases, transfer functions and views.
#[derive(Clone, Debug, Serialize)]
pub struct Averages {
    #[serde(flatten)]
    pub choice: Choice,
    /// Of a frame relative to that of the usual slabs: geometric mean over cases and transfer functions.
    pub cost: f64,
    /// Of a frame, ms: CPU time of a CPU driver, device time of a GPU; mean over cases and functions of the median of the views.
    pub ms: f64,
    /// Sum of the device's timestamps, likewise.
    pub device_ms: f64,
    /// Against the CT, dB: mean.
    pub psnr: f64,
    /// Of the worst picture.
    pub worst_psnr: f64,
    pub ssim: f64,
    pub flip: f64,
}
