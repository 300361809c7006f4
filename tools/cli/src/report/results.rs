//! Results of a fit.

use serde::Serialize;

use super::quality::Quality;

/// Results of a fit: the object that `vgs fit --json` prints. It is flat, so that plain tools can pick
/// fields.
#[derive(Clone, Debug, Serialize)]
pub struct FitResults {
    pub splats: usize,
    #[serde(flatten)]
    pub quality: Option<Quality>,
    /// Whether the target is reached; `None` without a target or an evaluation.
    pub target_reached: Option<bool>,
    /// Seconds from the start of the command to its end.
    pub seconds: f64,
    pub fit_seconds: f64,
    pub seconds_per_iteration: f64,
    pub iterations: u32,
    pub frozen_updates: u32,
    pub device_peak_bytes: u64,
    pub host_peak_bytes: Option<u64>,
    pub device: String,
    pub driver: String,
    pub roi_voxels: usize,
    pub outputs: Vec<String>,
}
