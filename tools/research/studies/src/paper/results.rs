//! Collects the results and formats their figures.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::count::Count;
use super::job::Job;
use super::runs::{Point, Record};

/// Finished runs by key.
#[derive(Default)]
pub struct Results {
    records: BTreeMap<String, Record>,
}

impl Results {
    /// Adds a finished run.
    pub fn add(&mut self, record: Record) {
        self.records.insert(record.job.key(), record);
    }

    /// Returns the result of a job, if it is finished.
    pub fn of(&self, job: &Job) -> Option<&Record> {
        self.records.get(&job.key())
    }

    /// Returns every measurement of every run as CSV.
    pub fn csv(&self) -> String {
        let mut out = String::from(
            "run,case,mask,profile,splats_start,iteration,seconds,splats,mmse,psnr_db,device_peak_bytes\n",
        );
        for (key, record) in &self.records {
            let Job { folder, mask, profile, config, .. } = &record.job;
            for p in &record.points {
                // Writing to a string cannot fail.
                let _ = writeln!(
                    out,
                    "{key},{folder},{mask},{profile},{},{},{:.3},{},{:e},{:.4},{}",
                    config.count.splats,
                    p.iteration,
                    p.seconds,
                    p.splats,
                    p.mmse,
                    p.psnr(),
                    record.device_peak_bytes
                );
            }
        }
        out
    }
}

/// Formats a PSNR in dB with two decimals.
pub fn db(psnr: f64) -> String {
    format!("{psnr:.2}")
}

/// Formats an MMSE with three digits.
pub fn mmse(value: f64) -> String {
    if !(1e-4..10.0).contains(&value) {
        return format!("{value:.2e}");
    }
    // One digit more where rounding carries (0.009999 -> 0.0100), as the paper writes it.
    let decimals = (2.0 - value.log10().floor()) as usize;
    format!("{value:.decimals$}")
}

/// Formats the paper's number and ours, as "paper → here".
pub fn count(count: Count) -> String {
    format!("{} → {}", count.paper, count.ours)
}

/// Formats the CPU time of the iterations, in core-minutes.
pub fn core_minutes(record: Option<&Record>) -> String {
    let end = record.and_then(|record| Some(record.end()?.seconds * record.cores()));
    end.map_or_else(|| "—".to_owned(), |seconds| format!("{:.1}", seconds / 60.0))
}

/// Formats the worst and the best measurement, as "worst (worst after the start) / best"; the brackets only
/// if they differ.
pub fn worst_best(record: Option<&Record>, write: impl Fn(&Point) -> String) -> String {
    let Some(record) = record else { return "—".to_owned() };
    let (Some(worst), Some(best)) = (record.worst(), record.best()) else { return "—".to_owned() };
    let after = record.worst_after_start().map(&write).filter(|w| *w != write(worst));
    let brackets = after.map(|w| format!(" ({w})")).unwrap_or_default();
    format!("{}{brackets} / {}{}", write(worst), write(best), diverged(record))
}

/// Returns a note if the fit diverged, and nothing otherwise.
pub fn diverged(record: &Record) -> String {
    record.diverged_at.map(|i| format!(", diverged before {i}")).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::job::tests::job;
    use crate::paper::runs::tests::record;

    #[test]
    fn figures_are_written_as_in_the_paper() {
        let rows = [(0.003_364, "0.00336"), (0.01, "0.0100"), (0.047_45, "0.0474"), (1.234e-5, "1.23e-5")];
        for (value, text) in rows {
            assert_eq!(mmse(value), text);
        }
        assert_eq!(mmse(0.0), "0.00e0");
    }

    #[test]
    fn a_diverged_run_says_so_and_an_unfinished_one_is_a_dash() {
        let mut bad = record(job(5), &[0.1, 0.01]);
        bad.diverged_at = Some(100);
        assert_eq!(worst_best(Some(&bad), |p| db(p.psnr())), "10.00 (20.00) / 20.00, diverged before 100");
        assert_eq!(worst_best(None, |p| db(p.psnr())), "—");
    }

    #[test]
    fn every_measurement_is_in_the_csv() {
        let mut results = Results::default();
        results.add(record(job(5), &[0.1, 0.01]));
        results.add(record(job(6), &[0.1]));
        let csv = results.csv();
        assert_eq!(csv.lines().count(), 4);
        let columns = |line: &str| line.split(',').count();
        assert!(csv.lines().all(|l| columns(l) == columns(csv.lines().next().unwrap_or_default())));
        assert!(csv.contains(",ct-none,mask_none,default,5,50,30.000,15,1e-2,20.0000,5000000"), "{csv}");
    }
}
