//! Measures what a frame costs, and summarises many frames.

use std::collections::BTreeMap;
use std::time::Instant;

use engine::Result;
use engine::gpu::Gpu;
use serde::{Deserialize, Serialize};

/// Cost of one frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// CPU time of the whole process (user and system, all threads), ms; `None` if the system does not tell.
    pub core_ms: Option<f64>,
    /// Wall-clock time until the picture was finished, ms.
    pub wall_ms: f64,
    /// Sum of the device's timestamps, ms.
    pub device_ms: f64,
}

impl Cost {
    /// Returns the cost by which frames are compared, ms: CPU time on a CPU driver, device time on a GPU.
    pub fn of_device(&self, is_cpu: bool) -> f64 {
        if is_cpu { self.core_ms.unwrap_or(self.wall_ms) } else { self.device_ms }
    }
}

/// Device time of each pass, ms, summed over one or more frames.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Passes(BTreeMap<String, f64>);

impl Passes {
    /// Adds the times of other frames.
    pub fn add(&mut self, other: Passes) {
        for (name, ms) in other.0 {
            *self.0.entry(name).or_default() += ms;
        }
    }

    /// Returns name and device time per frame (ms) of each pass, the slowest first.
    pub fn a_frame(&self, frames: usize) -> Vec<(&str, f64)> {
        let mut rows: Vec<_> =
            self.0.iter().map(|(name, ms)| (name.as_str(), ms / frames.max(1) as f64)).collect();
        rows.sort_by(|a, b| b.1.total_cmp(&a.1));
        rows
    }
}

/// Runs `frame`, which waits for what it records on `gpu`, and returns its cost and passes.
pub fn measure(gpu: &Gpu, frame: impl FnOnce() -> Result<()>) -> Result<(Cost, Passes)> {
    gpu.take_profile();
    let (core, wall) = (cpu_ms(), Instant::now());
    frame()?;
    let wall_ms = wall.elapsed().as_secs_f64() * 1e3;
    let core_ms = core.zip(cpu_ms()).map(|(from, to)| to - from);
    let passes = Passes(gpu.take_profile().into_iter().map(|(name, time)| (name, time.total_ms)).collect());
    Ok((Cost { core_ms, wall_ms, device_ms: passes.0.values().sum() }, passes))
}

/// Returns the CPU time of this process so far, ms.
#[cfg(unix)]
pub fn cpu_ms() -> Option<f64> {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(time.tv_sec as f64 * 1e3 + time.tv_nsec as f64 * 1e-6)
}

/// Returns `None`, since this system does not tell.
#[cfg(not(unix))]
pub fn cpu_ms() -> Option<f64> {
    None
}

/// Returns the smallest value that at least the share `p` of all values does not exceed (nearest rank);
/// `None` if there are no values.
pub fn percentile(values: &[f64], p: f64) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (p * sorted.len() as f64).ceil().max(1.0) as usize;
    sorted.get(rank - 1).copied()
}

/// Returns the middle value, or the mean of the two middle ones; `None` if there are no values.
pub fn median(values: &[f64]) -> Option<f64> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let upper = sorted.get(sorted.len() / 2)?;
    let lower = sorted.get((sorted.len() - 1) / 2)?;
    Some(0.5 * (lower + upper))
}

/// Returns the mean; `None` if there are no values.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn statistics_of_few_values() {
        assert_eq!((median(&[]), mean(&[]), percentile(&[], 0.95)), (None, None, None));
        for (values, middle, average, high) in [
            (&[4.0][..], 4.0, 4.0, 4.0),
            (&[3.0, 1.0], 2.0, 2.0, 3.0),
            (&[9.0, 1.0, 2.0], 2.0, 4.0, 9.0),
            (&[f64::INFINITY, 1.0, 2.0], 2.0, f64::INFINITY, f64::INFINITY),
        ] {
            assert_eq!(median(values), Some(middle), "{values:?}");
            assert_eq!(mean(values), Some(average), "{values:?}");
            assert_eq!(percentile(values, 0.95), Some(high), "{values:?}");
        }
        let hundred: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!((percentile(&hundred, 0.95), percentile(&hundred, 0.0)), (Some(95.0), Some(1.0)));
    }

    #[test]
    fn passes_of_frames_add_up() {
        let frame = |a: f64, b: f64| Passes([("a".to_owned(), a), ("b".to_owned(), b)].into());
        let mut passes = frame(1.0, 5.0);
        passes.add(frame(3.0, 7.0));
        assert_eq!(passes.a_frame(2), [("b", 6.0), ("a", 2.0)]);
        let cost = Cost { core_ms: Some(8.0), wall_ms: 4.0, device_ms: 3.0 };
        assert_eq!((cost.of_device(true), cost.of_device(false)), (8.0, 3.0));
        assert_eq!(Cost { core_ms: None, ..cost }.of_device(true), 4.0);
    }

    #[cfg(unix)]
    #[test]
    fn the_cpu_time_of_all_threads_counts() {
        let spin = || {
            let begin = Instant::now();
            while begin.elapsed().as_millis() < 30 {
                std::hint::spin_loop();
            }
        };
        let before = cpu_ms().expect("a clock");
        std::thread::scope(|scope| {
            scope.spawn(spin);
            scope.spawn(spin);
        });
        // Two threads are busy for a while; how much of it they get depends on what else the machine does.
        assert!(cpu_ms().expect("a clock") - before > 5.0);
    }
}
