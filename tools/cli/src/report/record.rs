//! Run record (OUT.run.json): everything that is needed to tell how a set of splats was made, and to make it
//! again.

use std::collections::BTreeMap;

use engine::fit::FitConfig;
use engine::gpu::{DeviceDescription, PassTime};
use engine::volume::{Roi, Volume};
use serde::Serialize;

use super::estimate::CheckedEstimate;
use super::results::FitResults;
use crate::shared::inputs::InputRecord;

/// Run record. Field names are part of the interface.
#[derive(Serialize)]
pub struct RunRecord<'a> {
    /// Version of this format.
    pub format: &'static str,
    /// Date and time when the run ended, UTC.
    pub date: String,
    /// Version and commit of the program.
    pub version: &'static str,
    pub commit: &'static str,
    /// The command line.
    pub command: Vec<String>,
    /// How the fit ended: "finished", "stopped" or "failed".
    pub end: &'a str,
    /// The error, if the fit failed.
    pub error: Option<String>,
    /// Hash of the inputs' content, the settings and the version, of a fit in a batch: what has it is not fitted again.
    pub made_of: Option<&'a str>,
    pub inputs: BTreeMap<&'static str, InputRecord>,
    pub volume: VolumeRecord,
    pub roi: RoiRecord,
    /// Grid that was fitted where that is not the native one: coarser, if `working_grid` asks for that, or with more
    /// slices. The results at the voxels are those of the native one.
    pub working_grid: Option<WorkingRecord>,
    pub profile: &'a str,
    /// Chosen quality, if there is one.
    pub quality: Option<&'a str>,
    /// Keys that were set by a file, a variable or a flag.
    pub explicit: &'a [String],
    pub config: &'a FitConfig,
    /// Time limit of the iterations, seconds, if there was one.
    pub time_budget_seconds: Option<f64>,
    pub device: &'a DeviceDescription,
    pub timings: Timings,
    pub memory: MemoryRecord,
    /// Estimate of `--explain`, compared with the outcome.
    pub estimate: Option<CheckedEstimate>,
    pub results: &'a FitResults,
}

/// Volume as it was read.
#[derive(Serialize)]
pub struct VolumeRecord {
    size: [usize; 3],
    spacing_mm: [f64; 3],
    axes: String,
    oriented: bool,
    /// Rows of the voxel-to-world matrix, mm RAS.
    affine: [[f64; 4]; 3],
    min: f32,
    max: f32,
    mean: f64,
    std_dev: f64,
    non_finite: usize,
}

impl VolumeRecord {
    /// Returns the record of a volume.
    pub fn of(volume: &Volume) -> Self {
        let stats = volume.gather_stats();
        let [x, y, z, t] = volume.world_from_voxel.to_cols_array_2d();
        VolumeRecord {
            size: volume.size,
            spacing_mm: volume.spacing_mm().to_array(),
            axes: volume.axis_codes(),
            oriented: volume.oriented,
            affine: std::array::from_fn(|r| [x[r], y[r], z[r], t[r]]),
            min: stats.min,
            max: stats.max,
            mean: stats.mean,
            std_dev: stats.std_dev,
            non_finite: stats.non_finite,
        }
    }
}

/// Region of interest and the intensities there.
#[derive(Serialize)]
pub struct RoiRecord {
    voxels: usize,
    weight: f64,
    soft: bool,
    min: f32,
    max: f32,
    mean: f64,
}

impl RoiRecord {
    /// Returns the record of a region in its volume.
    pub fn of(roi: &Roi, volume: &Volume) -> Self {
        let weighted = || roi.weight.iter().zip(&volume.samples).filter(|(w, v)| **w > 0.0 && v.is_finite());
        let weight = roi.weight_sum();
        let sum: f64 = weighted().map(|(&w, &v)| f64::from(w) * f64::from(v)).sum();
        let values = || weighted().map(|(_, &v)| v);
        RoiRecord {
            voxels: roi.voxel_count(),
            weight,
            soft: roi.soft,
            min: values().reduce(f32::min).unwrap_or_default(),
            max: values().reduce(f32::max).unwrap_or_default(),
            mean: if weight > 0.0 { sum / weight } else { 0.0 },
        }
    }
}

/// Volume and region of a working grid.
#[derive(Serialize)]
pub struct WorkingRecord {
    pub volume: VolumeRecord,
    pub roi: RoiRecord,
}

/// Times of the stages, seconds.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Timings {
    pub read: f64,
    /// Seconds of finding the number of splats and placing the first ones ...
    pub initialise: f64,
    /// ... and those of them in which trials found the number.
    pub trials: f64,
    /// Seconds of the estimate of `--explain`, which count only in the total.
    pub calibrate: f64,
    pub fit: f64,
    pub evaluate: f64,
    pub total: f64,
    /// Device time of the fit by pass, slowest first.
    pub passes: Vec<PassRecord>,
}

/// Device time of one pass.
#[derive(Clone, Debug, Serialize)]
pub struct PassRecord {
    pub name: String,
    pub calls: u64,
    pub total_ms: f64,
    pub longest_ms: f64,
}

impl PassRecord {
    /// Returns a record of each pass in the device's profile.
    pub fn list(profile: Vec<(String, PassTime)>) -> Vec<Self> {
        let row = |(name, t): (String, PassTime)| PassRecord {
            name,
            calls: t.calls,
            total_ms: t.total_ms,
            longest_ms: t.longest_ms,
        };
        profile.into_iter().map(row).collect()
    }
}

/// Memory, bytes.
#[derive(Clone, Debug, Serialize)]
pub struct MemoryRecord {
    /// Device memory at the end of the fit, by purpose.
    pub device_by_purpose: BTreeMap<&'static str, u64>,
    pub device_peak_bytes: u64,
    pub host_peak_bytes: Option<u64>,
}
