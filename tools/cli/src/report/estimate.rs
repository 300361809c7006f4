//! What a fit will cost, as it is told before it begins, and how right that was, as the record keeps it.

use serde::Serialize;

use super::results::Results;
use crate::shared::figures::{bytes, seconds};

/// Errors at the voxels, HU.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// Root mean square at the voxels.
    pub rmse_hu: f64,
    /// 99 % of the voxels are within this.
    pub p99_hu: f64,
}

/// What a fit will cost. The names are part of the interface.
#[derive(Clone, Debug, Serialize)]
pub struct Estimate {
    pub device: String,
    pub splats: usize,
    /// Whether the number of splats may grow on the way; the figures are of those that it starts with.
    pub may_grow: bool,
    pub roi_voxels: usize,
    pub iterations: u32,
    /// From the start of the command to its end.
    pub seconds: f64,
    pub fit_seconds: f64,
    pub seconds_per_iteration: f64,
    pub device_peak_bytes: u64,
    pub file_bytes: u64,
    /// What was measured after [`engine::fit::EARLY`] iterations.
    pub early: Errors,
    /// Of a quality as it is, which was measured; nothing otherwise.
    #[serde(flatten)]
    pub expected: Option<Errors>,
    /// What it took to find out.
    pub calibration_seconds: f64,
}

/// In plain words.
pub fn text(estimate: &Estimate) -> String {
    let e = estimate;
    let grows = if e.may_grow { "; more may come on the way, and all of it grows with them" } else { "" };
    let mut out = format!(
        "this fit of {} splats to {} voxels on {} will cost{grows}:\n  time: about {}, of which {} are {} iterations of {}\n  \
         memory: about {} of the device\n  file: {}\n",
        e.splats,
        e.roi_voxels,
        e.device,
        seconds(e.seconds),
        seconds(e.fit_seconds),
        e.iterations,
        seconds(e.seconds_per_iteration),
        bytes(e.device_peak_bytes),
        bytes(e.file_bytes)
    );
    match e.expected {
        Some(Errors { rmse_hu, p99_hu }) => out.push_str(&format!(
            "  error at the voxels: about {rmse_hu:.0} HU (root mean square), 99 % within {p99_hu:.0} HU\n"
        )),
        None => out.push_str("  error: not known of settings other than a --quality as it is\n"),
    }
    out.push_str(&format!("(found out in {})", seconds(e.calibration_seconds)));
    out
}

/// An estimate beside what then happened, for the record.
#[derive(Clone, Debug, Serialize)]
pub struct Checked {
    pub estimate: Estimate,
    /// Estimate over outcome: 1 is right.
    pub ratio: Ratio,
}

/// See [`Checked`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Ratio {
    pub seconds: f64,
    pub fit_seconds: f64,
    pub device_peak_bytes: f64,
    pub file_bytes: f64,
    /// Where both are known.
    pub rmse_hu: Option<f64>,
    pub p99_hu: Option<f64>,
}

impl Checked {
    /// `file_bytes`: of the file that was written. The time of the calibration is no part of the fit's.
    pub fn new(estimate: Estimate, results: &Results, file_bytes: u64) -> Self {
        let e = &estimate;
        let over = |a: f64, b: f64| if b > 0.0 { a / b } else { f64::NAN };
        let errors = e.expected.zip(results.quality.as_ref());
        let ratio = Ratio {
            seconds: over(e.seconds, results.seconds - e.calibration_seconds),
            fit_seconds: over(e.fit_seconds, results.fit_seconds),
            device_peak_bytes: over(e.device_peak_bytes as f64, results.device_peak_bytes as f64),
            file_bytes: over(e.file_bytes as f64, file_bytes as f64),
            rmse_hu: errors.map(|(e, q)| over(e.rmse_hu, q.rmse_hu)),
            p99_hu: errors.map(|(e, q)| over(e.p99_hu, q.p99_hu)),
        };
        Checked { estimate, ratio }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_says_what_is_not_known() {
        let mut estimate = Estimate {
            device: "a device".into(),
            splats: 10,
            may_grow: false,
            roi_voxels: 100,
            iterations: 400,
            seconds: 90.0,
            fit_seconds: 80.0,
            seconds_per_iteration: 0.2,
            device_peak_bytes: 2_500_000,
            file_bytes: 1234,
            early: Errors { rmse_hu: 60.0, p99_hu: 240.0 },
            expected: None,
            calibration_seconds: 3.0,
        };
        let plain = text(&estimate);
        for says in ["90 s", "80 s are 400 iterations of 0.2 s", "2.5 MB", "1.2 kB", "not known"] {
            assert!(plain.contains(says), "{says} in {plain}");
        }
        estimate.expected = Some(Errors { rmse_hu: 31.4, p99_hu: 120.0 });
        estimate.may_grow = true;
        let told = text(&estimate);
        assert!(
            told.contains("31 HU") && told.contains("120 HU") && told.contains("more may come"),
            "{told}"
        );
    }
}
