//! Averages the cost and the error of a choice over all cases.

use serde::Serialize;

use super::plan::Choice;

/// Averages of a choice over all cases, transfer functions and views.
#[derive(Clone, Debug, Serialize)]
pub struct Averages {
    #[serde(flatten)]
    pub choice: Choice,
    /// Cost of a frame relative to that of the usual slabs: geometric mean over cases and transfer functions.
    pub cost: f64,
    /// Cost of a frame, ms: CPU time on a CPU driver, device time on a GPU; the median of the views, averaged
    /// over cases and transfer functions.
    pub ms: f64,
    /// Sum of the device's timestamps, ms, averaged likewise.
    pub device_ms: f64,
    /// Mean PSNR against the CT, dB.
    pub psnr: f64,
    /// PSNR of the worst picture, dB.
    pub worst_psnr: f64,
    pub ssim: f64,
    pub flip: f64,
}
