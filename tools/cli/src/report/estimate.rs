//! Estimate of the cost of a fit, as it is printed before the fit begins, and its comparison with the outcome
//! for the record.

use serde::Serialize;

use super::results::FitResults;
use crate::shared::figures::{bytes, seconds};

/// Errors at the voxels, HU.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct VoxelErrors {
    /// Root mean square error at the voxels.
    pub rmse_hu: f64,
    /// Error that 99 % of the voxels do not exceed.
    pub p99_hu: f64,
}

/// Estimated cost of a fit. The names are part of the interface.
#[derive(Clone, Debug, Serialize)]
pub struct Estimate {
    pub device: String,
    pub splats: usize,
    /// True if the number of splats may grow on the way; the figures are for the number at the start.
    pub may_grow: bool,
    pub roi_voxels: usize,
    pub iterations: u32,
    /// Seconds from the start of the command to its end; the parts are those before the iterations, the iterations and
    /// those after them.
    pub seconds: f64,
    /// Seconds before the iterations, which have passed: reading, finding the number of splats, placing them.
    pub before_seconds: f64,
    /// Those of them in which the number of splats was found by trials.
    pub trial_seconds: f64,
    pub fit_seconds: f64,
    /// Seconds of preparing the device, rounding and measuring.
    pub finish_seconds: f64,
    pub seconds_per_iteration: f64,
    pub device_peak_bytes: u64,
    pub file_bytes: u64,
    /// Errors measured after [`engine::fit::EARLY`] iterations.
    pub early: VoxelErrors,
    /// Expected errors: those of the target, or what an unchanged quality was measured to leave; else not known.
    #[serde(flatten)]
    pub expected: Option<VoxelErrors>,
    /// What the region takes that is coded in place of splats, with the expected root mean square error.
    pub coded: Option<CodedEstimate>,
    /// Error that the fit is to reach, in words, if there is one.
    pub target: Option<String>,
    /// Time that the estimate took, seconds.
    pub calibration_seconds: f64,
    /// Time from the start of the command until the estimate was there, seconds.
    pub found_seconds: f64,
}

/// What a region takes that is coded in place of splats (`vgs convert`).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CodedEstimate {
    /// Greatest error of a voxel.
    pub bound: f64,
    pub file_bytes: u64,
}

/// How far the predictions of fits were off in docs/results/tradeoffs.md, as people are told.
const TRUST: &str = "the file size is within 5 % of that, the time within a third if nothing else runs";

/// Describes an estimate in plain words; `unit` is the text behind an intensity.
pub fn text(estimate: &Estimate, unit: &str) -> String {
    let e = estimate;
    let grows = if e.may_grow { "; more may come on the way, and all of it grows with them" } else { "" };
    let trials = match e.trial_seconds {
        0.0 => String::new(),
        trials => format!(", {} of them for the number of splats", seconds(trials)),
    };
    let mut out = format!(
        "this fit of {} splats to {} voxels on {} will cost about{grows}:\n  time: {}: {} that have passed{trials}; {} for \
         {} iterations of {}; {} to prepare, finish and measure\n  memory: at most {} of the device\n  file: {}\n",
        e.splats,
        e.roi_voxels,
        e.device,
        seconds(e.seconds),
        seconds(e.before_seconds),
        seconds(e.fit_seconds),
        e.iterations,
        seconds(e.seconds_per_iteration),
        seconds(e.finish_seconds),
        bytes(e.device_peak_bytes),
        bytes(e.file_bytes)
    );
    match (e.expected, &e.target) {
        (_, Some(target)) => out.push_str(&format!("  error: {target}, if that many splats are allowed\n")),
        (Some(VoxelErrors { rmse_hu, p99_hu }), None) => out.push_str(&format!(
            "  error: 99 % of the voxels within {}{unit} of the scan, {}{unit} root mean square\n",
            two_digits(p99_hu),
            two_digits(rmse_hu)
        )),
        (None, None) => out.push_str("  error: known only for an unchanged --quality\n"),
    }
    if let Some(CodedEstimate { bound, file_bytes }) = e.coded {
        out.push_str(&format!(
            "  without splats: {}, no voxel off by more than {}{unit} and no more than that root mean square (vgs convert \
             --bound)\n",
            bytes(file_bytes),
            two_digits(bound)
        ));
    }
    out.push_str(&format!("(estimated in {}; {TRUST})", seconds(e.found_seconds)));
    out
}

/// Returns a number with a decimal where it is small.
fn two_digits(value: f64) -> String {
    if value < 10.0 { format!("{value:.1}") } else { format!("{value:.0}") }
}

/// Estimate beside the outcome, for the record.
#[derive(Clone, Debug, Serialize)]
pub struct CheckedEstimate {
    pub estimate: Estimate,
    /// Estimate divided by outcome; 1 is right.
    pub ratio: EstimateRatio,
}

/// Parts of an estimate divided by their outcome.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct EstimateRatio {
    pub seconds: f64,
    pub fit_seconds: f64,
    pub device_peak_bytes: f64,
    pub file_bytes: f64,
    /// Ratio of the errors; `None` if one of them is not known.
    pub rmse_hu: Option<f64>,
    pub p99_hu: Option<f64>,
}

impl CheckedEstimate {
    /// Compares an estimate with the results. `file_bytes` is the size of the file that was written. The time
    /// of the estimate itself does not count as the fit's.
    pub fn new(estimate: Estimate, results: &FitResults, file_bytes: u64) -> Self {
        let e = &estimate;
        let over = |a: f64, b: f64| if b > 0.0 { a / b } else { f64::NAN };
        let errors = e.expected.zip(results.quality.as_ref());
        let ratio = EstimateRatio {
            seconds: over(e.seconds, results.seconds - e.calibration_seconds),
            fit_seconds: over(e.fit_seconds, results.fit_seconds),
            device_peak_bytes: over(e.device_peak_bytes as f64, results.device_peak_bytes as f64),
            file_bytes: over(e.file_bytes as f64, file_bytes as f64),
            rmse_hu: errors.map(|(e, q)| over(e.rmse_hu, q.rmse_hu)),
            p99_hu: errors.map(|(e, q)| over(e.p99_hu, q.p99_hu)),
        };
        CheckedEstimate { estimate, ratio }
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
            before_seconds: 7.0,
            trial_seconds: 0.0,
            fit_seconds: 80.0,
            finish_seconds: 3.0,
            seconds_per_iteration: 0.2,
            device_peak_bytes: 2_500_000,
            file_bytes: 1234,
            early: VoxelErrors { rmse_hu: 60.0, p99_hu: 240.0 },
            expected: None,
            coded: None,
            target: None,
            calibration_seconds: 3.0,
            found_seconds: 10.0,
        };
        let plain = text(&estimate, " HU");
        for says in [
            "90 s: 7.0 s that have",
            "80 s for 400 iterations of 0.2 s",
            "2.5 MB",
            "1.2 kB",
            "known only for an unchanged",
            "estimated in 10 s",
        ] {
            assert!(plain.contains(says), "{says} in {plain}");
        }
        estimate.expected = Some(VoxelErrors { rmse_hu: 31.4, p99_hu: 120.0 });
        estimate.may_grow = true;
        let told = text(&estimate, " HU");
        let small = Some(VoxelErrors { rmse_hu: 0.31, p99_hu: 1.04 });
        let of_mr = text(&Estimate { expected: small, ..estimate.clone() }, "");
        assert!(of_mr.contains("within 1.0 of the scan, 0.3 root"), "{of_mr}");
        let aimed = text(&Estimate { target: Some("a PSNR of 45 dB".into()), ..estimate }, " HU");
        assert!(aimed.contains("a PSNR of 45 dB") && !aimed.contains("not known"), "{aimed}");
        assert!(
            told.contains("31 HU") && told.contains("120 HU") && told.contains("more may come"),
            "{told}"
        );
    }
}
