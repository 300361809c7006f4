//! Measurements of the frames: how regular they were, what they cost, their quality levels, and the age of
//! their poses.

use std::collections::{BTreeMap, VecDeque};

use engine::gpu::{Gpu, Hitches};
use engine::render::{Finished, Fov, QualityLevel};
use serde::Serialize;

use crate::headset::{Description, Eye, Eyes, Timing};
use crate::placement::Placement;

/// Number of frames that are kept: twelve minutes at 90 Hz.
const KEPT: usize = 1 << 16;

/// Narrowest bins for motion to photon, ms.
const LATENCY_BIN_MS: f64 = 0.1;

/// A frame that has finished.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Sample {
    /// Quality level of the frame.
    pub level: usize,
    /// Device time, ms.
    pub gpu_ms: f64,
    /// Budget of the frame, ms.
    pub budget_ms: f64,
}

/// Percentiles of some numbers, in their unit.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Distribution {
    /// The number that 5 % do not exceed.
    pub p5: f64,
    /// The median.
    pub median: f64,
    /// The number that 95 % do not exceed.
    pub p95: f64,
    /// The number that 99 % do not exceed.
    pub p99: f64,
    /// The greatest number.
    pub most: f64,
}

impl Distribution {
    /// Computes the percentiles of the finite ones of some numbers; `None` if there are none.
    pub fn of(numbers: impl Iterator<Item = f64>) -> Option<Self> {
        let mut sorted: Vec<f64> = numbers.filter(|v| v.is_finite()).collect();
        sorted.sort_by(f64::total_cmp);
        let last = sorted.len().checked_sub(1)?;
        // The least number that so many of 100 do not exceed.
        let at = |part: f64| sorted[((sorted.len() as f64 * part).ceil() as usize).clamp(1, last + 1) - 1];
        Some(Distribution { p5: at(0.05), median: at(0.5), p95: at(0.95), p99: at(0.99), most: sorted[last] })
    }
}

/// Greatest number of bins of a [`Histogram`].
const BINS: f64 = 40.0;

/// A histogram with bins of equal width.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Histogram {
    /// Lower end of the first bin, in the unit of the numbers; a multiple of the width.
    pub from: f64,
    /// Width of a bin, in the same unit: 1, 2 or 5 times a power of ten.
    pub width: f64,
    /// Counts of the bins; a number on the border of two bins is in the upper one.
    pub counts: Vec<u64>,
}

impl Histogram {
    /// Computes the histogram of the finite ones of some numbers, in at most 40 bins no narrower than
    /// `least`; `None` if there are none.
    pub fn of(numbers: impl Iterator<Item = f64>, least: f64) -> Option<Self> {
        let numbers: Vec<f64> = numbers.filter(|v| v.is_finite()).collect();
        let low = numbers.iter().copied().reduce(f64::min)?;
        let high = numbers.iter().copied().reduce(f64::max)?;
        let bin = |v: f64, width: f64| (v / width).floor();
        let widths = (0..).flat_map(|decade| [1.0, 2.0, 5.0].map(|n| n * least * 10f64.powi(decade)));
        let width = widths.into_iter().find(|&w| bin(high, w) - bin(low, w) < BINS)?;
        let first = bin(low, width);
        let mut counts = vec![0; (bin(high, width) - first) as usize + 1];
        numbers.iter().for_each(|&v| counts[(bin(v, width) - first) as usize] += 1);
        Some(Histogram { from: first * width, width, counts })
    }
}

/// Collects the measurements.
#[derive(Default)]
pub struct Statistics {
    frames: u64,
    invisible: u64,
    untracked: u64,
    missed: u64,
    last: Option<Timing>,
    intervals_ms: VecDeque<f64>,
    latencies_ms: VecDeque<f64>,
    late: u64,
    samples: VecDeque<Sample>,
    eyes: Option<[Eye; 2]>,
}

impl Statistics {
    /// Returns the number of frames that the headset asked for.
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Notes a frame that is about to be rendered, or that is not rendered because nobody sees it.
    pub fn note_frame(&mut self, timing: &Timing) {
        self.frames += 1;
        self.invisible += u64::from(!timing.visible);
        if let Some(last) = self.last.replace(*timing) {
            let interval = timing.display_ns - last.display_ns;
            keep(&mut self.intervals_ms, interval as f64 * 1e-6);
            // Periods that went by without a new frame.
            let periods = (interval as f64 / timing.period_ns.max(1) as f64).round() as u64;
            self.missed += periods.saturating_sub(1);
        }
    }

    /// Notes the poses of the eyes that a frame was rendered for.
    pub fn note_eyes(&mut self, timing: &Timing, eyes: &Eyes) {
        self.untracked += u64::from(!eyes.tracked);
        self.eyes = Some(eyes.eyes);
        match eyes.asked_ns.map(|asked| timing.display_ns - asked) {
            Some(latency) if latency > 0 => keep(&mut self.latencies_ms, latency as f64 * 1e-6),
            // It is seen at some later time, which the headset does not tell.
            Some(_) => self.late += 1,
            None => {}
        }
    }

    /// Notes a frame that has finished.
    pub fn note_finished(&mut self, frame: &Finished, budget_ms: f64) {
        keep(&mut self.samples, Sample { level: frame.level, gpu_ms: frame.gpu_ms, budget_ms });
    }

    /// Returns the report of the session so far.
    pub fn report(
        &self,
        gpu: &Gpu,
        headset: &Description,
        levels: &[QualityLevel],
        (placement, hidden): (&Placement, [f64; 2]),
        hitches: Hitches,
    ) -> SessionReport {
        let samples = || self.samples.iter();
        let mut frames_on = vec![0; levels.len()];
        samples().for_each(|s| frames_on[s.level] += 1);
        let pairs = samples().zip(samples().skip(1));
        SessionReport {
            runtime: headset.runtime.clone(),
            headset: headset.system.clone(),
            device: gpu.description().name.clone(),
            driver: gpu.description().driver.clone(),
            eye_size: headset.eye_size,
            extensions: headset.extensions.clone(),
            period_ms: self.last.map_or(0.0, |t| t.period_ns as f64 * 1e-6),
            frames: self.frames,
            rendered: self.frames - self.invisible,
            untracked: self.untracked,
            missed: self.missed,
            interval_ms: Distribution::of(self.intervals_ms.iter().copied()),
            gpu_ms: Distribution::of(samples().map(|s| s.gpu_ms)),
            budget_use: Distribution::of(samples().map(|s| s.gpu_ms / s.budget_ms)),
            over_budget: samples().filter(|s| s.gpu_ms > s.budget_ms).count() as u64,
            level_changes: pairs.filter(|(a, b)| a.level != b.level).count() as u64,
            frames_on,
            late: self.late,
            latency_ms: Distribution::of(self.latencies_ms.iter().copied()),
            latency_histogram_ms: Histogram::of(self.latencies_ms.iter().copied(), LATENCY_BIN_MS),
            allocations: hitches.allocations,
            pipelines: hitches.pipelines,
            waits: hitches.waits,
            device_bytes: gpu.memory_by_purpose(),
            hidden,
            eyes: self.eyes.map(|eyes| eyes.map(|eye| SeenBy::from(&eye))),
            patient: placement.position.to_array(),
            scale: placement.scale,
            samples: samples().copied().collect(),
        }
    }
}

fn keep<T>(all: &mut VecDeque<T>, one: T) {
    if all.len() == KEPT {
        all.pop_front();
    }
    all.push_back(one);
}

/// Report of a session.
#[derive(Clone, Debug, Serialize)]
pub struct SessionReport {
    /// Name and version of the runtime.
    pub runtime: String,
    /// Name of the headset.
    pub headset: String,
    /// Name of the Vulkan device.
    pub device: String,
    /// Its driver.
    pub driver: String,
    /// Width and height of the pictures of an eye, pixels.
    pub eye_size: [u32; 2],
    /// Extensions in use.
    pub extensions: Vec<&'static str>,
    /// Last period of the display from frame to frame, ms.
    pub period_ms: f64,
    /// Frames that the headset asked for.
    pub frames: u64,
    /// Frames that somebody saw.
    pub rendered: u64,
    /// Frames without known poses, for which the last ones were used.
    pub untracked: u64,
    /// Periods of the display without a new frame.
    pub missed: u64,
    /// Times between two frames as they are seen, ms.
    pub interval_ms: Option<Distribution>,
    /// Device times, ms.
    pub gpu_ms: Option<Distribution>,
    /// Device time as a part of the budget.
    pub budget_use: Option<Distribution>,
    /// Frames that took more than the budget.
    pub over_budget: u64,
    /// Number of changes of the level.
    pub level_changes: u64,
    /// Number of frames on each level.
    pub frames_on: Vec<u64>,
    /// Frames whose poses were asked for after the time at which the headset wanted to show them, since the host was late:
    /// when they were seen is not known.
    pub late: u64,
    /// Times from the request for poses to the light of the frame (motion to photon), ms, by the time for
    /// which the headset wanted the frame; of frames that were not [late](Self::late).
    pub latency_ms: Option<Distribution>,
    /// Histogram of the same times, ms.
    pub latency_histogram_ms: Option<Histogram>,
    /// Number of allocations of device memory within the loop.
    pub allocations: u64,
    /// Number of pipelines that were created within the loop.
    pub pipelines: u64,
    /// Number of waits of the host for the device within the loop.
    pub waits: u64,
    /// Device memory by purpose, bytes.
    pub device_bytes: BTreeMap<&'static str, u64>,
    /// Part of each eye's picture that lenses hide, by patches that are hidden completely.
    pub hidden: [f64; 2],
    /// The eyes of the last frame.
    pub eyes: Option<[SeenBy; 2]>,
    /// Last place of the patient's middle in the room, metres.
    pub patient: [f64; 3],
    /// Last magnification of the patient; 1 is real size.
    pub scale: f64,
    /// Frames in their order.
    pub samples: Vec<Sample>,
}

/// An eye in the report.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct SeenBy {
    /// Position in the room, metres.
    pub position: [f64; 3],
    /// Viewing direction.
    pub forward: [f64; 3],
    /// Tangent of the angle to the left edge of its field of view.
    pub left: f64,
    /// Tangent of the angle to the right edge.
    pub right: f64,
    /// Tangent of the angle to the upper edge.
    pub up: f64,
    /// Tangent of the angle to the lower edge.
    pub down: f64,
}

impl From<&Eye> for SeenBy {
    fn from(eye: &Eye) -> Self {
        let Fov { left, right, up, down } = eye.fov;
        let (position, forward) = (eye.pose.position.to_array(), eye.pose.forward().to_array());
        SeenBy { position, forward, left, right, up, down }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_those_of_the_numbers() {
        let d = Distribution::of((1..=100).map(f64::from)).expect("numbers");
        assert_eq!((d.p5, d.median, d.p95, d.p99, d.most), (5.0, 50.0, 95.0, 99.0, 100.0));
        assert_eq!(Distribution::of([7.0].into_iter()).map(|d| d.p99), Some(7.0));
        assert_eq!(Distribution::of(std::iter::empty()), None);
    }

    #[test]
    fn bins_hold_all_numbers_and_are_wide_enough_to_be_few() {
        let of = |numbers: &[f64]| Histogram::of(numbers.iter().copied(), 0.1);
        assert_eq!(of(&[]), None);
        assert_eq!(of(&[f64::NAN, 7.0]), Some(Histogram { from: 7.0, width: 0.1, counts: vec![1] }));
        let far = of(&[12.0, 18.0, 20.0, 131.0, 139.9]).expect("numbers");
        assert_eq!((far.from, far.width), (10.0, 5.0), "128 ms in 26 bins of 5; of 2 they were 64");
        assert_eq!((far.counts.len(), far.counts[0], far.counts[1], far.counts[2]), (26, 1, 1, 1));
        assert_eq!((far.counts[24], far.counts[25]), (1, 1));
        assert_eq!(far.counts.iter().sum::<u64>(), 5);
    }

    /// Latency lasts from the request for the poses to the light, whatever the frames in between.
    #[test]
    fn latency_is_a_distribution() {
        let mut statistics = Statistics::default();
        let eye = Eye { pose: crate::headset::Pose::IDENTITY, fov: Fov::symmetric(90.0, 1.0) };
        for n in 0..100 {
            let display_ns = (n + 1) * 10_000_000;
            let timing = Timing { display_ns, period_ns: 10_000_000, visible: true };
            let asked_ns = (n % 10 != 0).then_some(display_ns - (20 + n / 50) * 1_000_000);
            statistics.note_eyes(&timing, &Eyes { eyes: [eye; 2], tracked: true, asked_ns });
        }
        // A host that asks after the frame was due does not know when it is seen.
        for late_ns in [0, 1_000_000, 700_000_000] {
            let timing = Timing { display_ns: 1_000_000_000, period_ns: 10_000_000, visible: true };
            let asked_ns = Some(timing.display_ns + late_ns);
            statistics.note_eyes(&timing, &Eyes { eyes: [eye; 2], tracked: true, asked_ns });
        }
        assert_eq!(statistics.late, 3);
        let latencies = || statistics.latencies_ms.iter().copied();
        let d = Distribution::of(latencies()).expect("frames");
        assert_eq!((d.p5, d.median, d.p99), (20.0, 20.0, 21.0), "a clock that cannot be read says nothing");
        let bins = Histogram::of(latencies(), LATENCY_BIN_MS).expect("frames").counts;
        assert_eq!((bins[0], bins[bins.len() - 1], bins.iter().sum()), (45, 45, 90));
    }

    #[test]
    fn periods_without_a_frame_are_missed() {
        let mut statistics = Statistics::default();
        for display_ms in [0, 10, 20, 50, 60] {
            let display_ns = display_ms * 1_000_000;
            statistics.note_frame(&Timing { display_ns, period_ns: 10_000_000, visible: true });
        }
        assert_eq!(statistics.missed, 2);
    }
}
