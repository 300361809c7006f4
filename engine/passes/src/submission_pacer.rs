//! The amount of work of one submission. A submission that runs for long freezes a desktop and ends in a lost
//! device (Windows allows two seconds); one that is short wastes the device. So long passes are cut into
//! submissions by the rate that was measured so far.

use base::error::Result;
use gpu::{Gpu, Recorder};

/// Desired duration of a submission, ms. The limit that must hold is 500.
const TARGET_MS: f64 = 120.0;
/// Units of the first submission, before anything was measured: few enough for the slowest device.
const FIRST_UNITS: usize = 1024;

/// Cuts the units of one kernel (workgroups) into slices.
pub struct SubmissionPacer {
    kernel: &'static str,
    /// Units and device time, ms, of the slices that were measured.
    measured: (f64, f64),
}

impl SubmissionPacer {
    /// Creates the pacer of the kernel with that name.
    pub fn new(kernel: &'static str) -> Self {
        SubmissionPacer { kernel, measured: (0.0, 0.0) }
    }

    /// Returns the units of the next submission, at least 1.
    pub fn slice(&self) -> usize {
        let (units, ms) = self.measured;
        if ms > 0.0 { ((TARGET_MS * units / ms) as usize).clamp(64, 1 << 24) } else { FIRST_UNITS }
    }

    /// Records `units` of work through `record(recorder, first, count)`, submitting whenever a slice is full.
    /// The last slice stays in the recorder.
    pub fn run(
        &mut self,
        gpu: &Gpu,
        recorder: &mut Recorder,
        units: usize,
        limit: usize,
        mut record: impl FnMut(&mut Recorder, usize, usize),
    ) -> Result<()> {
        let mut first = 0;
        while first < units {
            let count = self.slice().min(limit).min(units - first);
            record(recorder, first, count);
            first += count;
            if first < units || self.measured.1 == 0.0 {
                let before_ms = gpu.pass_time(self.kernel).total_ms;
                // One slice in flight at a time: cut passes are long, the gap between two slices is not.
                let ticket = recorder.split()?;
                gpu.wait(ticket)?;
                let ms = gpu.pass_time(self.kernel).total_ms - before_ms;
                // Without timestamps nothing is measured, and the first slice size stays.
                if ms > 0.0 {
                    self.measured = (self.measured.0 + count as f64, self.measured.1 + ms);
                }
            }
        }
        Ok(())
    }
}
