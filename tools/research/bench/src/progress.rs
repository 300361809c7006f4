//! Progress of a series of runs, and an estimate of the time left. The times of the finished runs correct the
//! estimates of those that are left, so that estimates need only be right relative to each other.

use std::time::{Duration, Instant};

use engine::{Error, Result};

/// Estimated and actual times of a series.
pub struct Series {
    begin: Instant,
    /// Sum of the estimates of the finished runs, and the time that they took, seconds.
    estimated: f64,
    taken: f64,
    /// Sum of the estimates of the runs that are left, seconds.
    left: f64,
}

impl Series {
    /// Starts a series; `total` is the sum of all estimates, seconds.
    pub fn new(total: f64) -> Self {
        Series { begin: Instant::now(), estimated: 0.0, taken: 0.0, left: total }
    }

    /// Counts a finished run with its estimate (seconds) and the time that it took.
    pub fn finished(&mut self, estimated: f64, taken: Duration) {
        self.estimated += estimated;
        self.taken += taken.as_secs_f64();
        self.left = (self.left - estimated).max(0.0);
    }

    /// Returns the seconds that are probably left.
    pub fn left(&self) -> f64 {
        let correction = if self.estimated > 0.0 { self.taken / self.estimated } else { 1.0 };
        self.left * correction
    }

    /// Describes the progress, as in "0:01:05 so far, about 0:10:00 left".
    pub fn tell(&self) -> String {
        format!("{} so far, about {} left", clock(self.begin.elapsed().as_secs_f64()), clock(self.left()))
    }
}

/// Carries out jobs with their estimates (seconds), the short ones first, so that a series that is stopped
/// has the most results. A job that fails is reported on stderr and does not end the others. Returns the
/// errors.
pub fn carry_out<J>(
    mut queue: Vec<(f64, J)>,
    title: impl Fn(&J) -> String,
    mut run: impl FnMut(&J) -> Result<()>,
) -> Vec<Error> {
    queue.sort_by(|(a, _), (b, _)| a.total_cmp(b));
    let mut series = Series::new(queue.iter().map(|(estimated, _)| estimated).sum());
    let mut failed = Vec::new();
    let count = queue.len();
    for (i, (estimated, job)) in queue.into_iter().enumerate() {
        eprintln!("[{}/{count}] {}; {}", i + 1, title(&job), series.tell());
        let begin = Instant::now();
        if let Err(e) = run(&job) {
            eprintln!("    failed: {e}");
            failed.push(e);
        }
        series.finished(estimated, begin.elapsed());
    }
    failed
}

/// Returns an error if any of `count` jobs failed; it is the first one, and its message says how many `what`
/// failed.
pub fn all_done(failed: &[Error], count: usize, what: &str) -> Result<()> {
    match failed.first() {
        None => Ok(()),
        Some(first) => {
            let message = format!("{} of {count} {what} failed, the first: {first}", failed.len());
            Err(Error { message, file: None, ..first.clone() })
        }
    }
}

/// Formats seconds as hours, minutes and seconds.
pub fn clock(seconds: f64) -> String {
    let s = seconds.round().max(0.0) as u64;
    format!("{}:{:02}:{:02}", s / 3600, s / 60 % 60, s % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_slow_makes_the_rest_slow() {
        let mut series = Series::new(100.0);
        assert_eq!(series.left(), 100.0);
        series.finished(20.0, Duration::from_secs(60));
        assert_eq!(series.left(), 240.0);
        series.finished(80.0, Duration::from_secs(40));
        assert_eq!(series.left(), 0.0);
        assert_eq!(clock(3725.4), "1:02:05");
    }

    #[test]
    fn short_jobs_come_first_and_one_that_fails_ends_no_other() {
        let mut order = Vec::new();
        let failed = carry_out(
            vec![(3.0, "c"), (1.0, "a"), (2.0, "b")],
            |j| (*j).to_owned(),
            |&j| {
                order.push(j);
                let error = Error::new(engine::Kind::Internal, "VGS-BEN-000", "no");
                if j == "a" { Err(error) } else { Ok(()) }
            },
        );
        assert_eq!((order, failed.len()), (vec!["a", "b", "c"], 1));
        assert!(all_done(&failed, 3, "jobs").is_err_and(|e| e.message.starts_with("1 of 3 jobs failed")));
        assert!(all_done(&[], 3, "jobs").is_ok());
    }
}
