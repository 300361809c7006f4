//! The schedule of a fit: its limits in iterations and in time.

use std::time::Duration;

/// Limits of a fit, in iterations and in time.
#[derive(Clone, Copy, Debug)]
pub struct Schedule {
    /// Maximum number of iterations.
    pub iterations: u32,
    /// Time for all iterations; none for no limit.
    pub time: Option<Duration>,
}

impl Schedule {
    /// Returns the part of the schedule that is done, 0 to 1, by whichever limit is nearer.
    pub fn share(&self, iteration: u32, elapsed: Duration) -> f64 {
        let of_iterations = f64::from(iteration) / f64::from(self.iterations.max(1));
        let of_time = self.time.map_or(0.0, |t| elapsed.as_secs_f64() / t.as_secs_f64().max(1e-9));
        of_iterations.max(of_time).min(1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearer_limit_sets_the_schedule() {
        let schedule = Schedule { iterations: 100, time: Some(Duration::from_secs(10)) };
        for (iteration, seconds, share) in
            [(0, 0, 0.0), (50, 1, 0.5), (10, 5, 0.5), (200, 1, 1.0), (1, 20, 1.0)]
        {
            assert_eq!(schedule.share(iteration, Duration::from_secs(seconds)), share);
        }
    }
}
