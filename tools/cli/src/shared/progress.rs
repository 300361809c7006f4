//! Shows the progress of long work: a bar on a terminal, plain lines elsewhere.

use std::io::Write;
use std::time::{Duration, Instant};

use engine::fit::Progress;
use indicatif::ProgressBar;

use super::console::Console;
use super::figures::seconds;
use super::terminal::{LINE_EVERY, STEPS, bar, stderr_has_colour};

/// Time over which the rate is measured.
const RATE_EVERY: Duration = Duration::from_secs(1);

/// Display of one fit.
pub struct Display {
    bar: Option<ProgressBar>,
    lines: bool,
    /// Time and share when progress was first shown: a fit that goes on begins in the middle.
    first: Option<(Instant, f64)>,
    last_line: Instant,
    last_line_share: f64,
    /// Time and iteration when the rate was last measured.
    last: Option<(Instant, u32)>,
    rate: Option<f64>,
    figures: String,
}

impl Display {
    /// Starts the display.
    pub fn new(console: &Console) -> Self {
        let now = Instant::now();
        let shown = !console.json && !console.quiet;
        let bar = (shown && stderr_has_colour()).then(bar);
        Display {
            lines: shown && bar.is_none(),
            bar,
            first: None,
            last_line: now,
            last_line_share: 0.0,
            last: None,
            rate: None,
            figures: String::new(),
        }
    }

    /// Stores new figures, which a fit reports now and then; its PSNR is over `span` of a `unit`.
    pub fn figures(&mut self, progress: &Progress, span: f64, unit: &str) {
        let error = progress.mse.sqrt() * span;
        self.figures = format!(", error {error:.1}{unit} ({:.1} dB)", progress.psnr_db);
    }

    /// Shows the progress of the fit; `share` is the part of the schedule that is done, 0 to 1.
    pub fn show(&mut self, iteration: u32, share: f64) {
        let (begun, from) = *self.first.get_or_insert_with(|| (Instant::now(), share));
        let left = seconds_left(begun.elapsed().as_secs_f64(), from, share).map_or("?".to_owned(), seconds);
        let (time, from) = *self.last.get_or_insert_with(|| (Instant::now(), iteration));
        if time.elapsed() >= RATE_EVERY && iteration > from {
            self.rate = Some(f64::from(iteration - from) / time.elapsed().as_secs_f64());
            self.last = Some((Instant::now(), iteration));
        }
        let rate = self.rate.map(|r| format!(", {r:.1} it/s")).unwrap_or_default();
        let text = || format!("{iteration} iterations{}{rate}, {left} left", self.figures);
        if let Some(bar) = &self.bar {
            bar.set_position((share * STEPS as f64) as u64);
            bar.set_message(text());
        } else if self.lines
            && self.last_line.elapsed() >= LINE_EVERY
            && (share >= self.last_line_share + 0.1 || self.last_line.elapsed() >= 4 * LINE_EVERY)
        {
            let _ = writeln!(std::io::stderr(), "{:>3.0} %: {}", 100.0 * share, text());
            self.last_line = Instant::now();
            self.last_line_share = share;
        }
    }
}

/// Returns the time that work still takes which in `spent` seconds went from one share of all of it to another;
/// `None` if that tells nothing.
fn seconds_left(spent: f64, from: f64, share: f64) -> Option<f64> {
    (share > from).then(|| spent * (1.0 - share) / (share - from))
}

/// Display of work that consists of equal steps.
pub struct Steps {
    bar: Option<ProgressBar>,
    lines: bool,
    what: &'static str,
    count: u64,
    start: Instant,
    last_line: Instant,
}

impl Steps {
    /// Starts the display of `count` steps called `what`; a single step is not shown.
    pub fn new(console: &Console, what: &'static str, count: u64) -> Self {
        let now = Instant::now();
        let shown = !console.json && !console.quiet && count > 1;
        let bar = (shown && stderr_has_colour()).then(bar);
        if let Some(bar) = &bar {
            bar.set_length(count);
        }
        Steps { lines: shown && bar.is_none(), bar, what, count, start: now, last_line: now }
    }

    /// Shows that `done` steps are done.
    pub fn done(&mut self, done: u64) {
        let left = self.start.elapsed().as_secs_f64() * (self.count - done) as f64 / done.max(1) as f64;
        let text = || format!("{} {done} of {}, {} left", self.what, self.count, seconds(left));
        if let Some(bar) = &self.bar {
            bar.set_position(done);
            bar.set_message(text());
        } else if self.lines && self.last_line.elapsed() >= LINE_EVERY {
            let _ =
                writeln!(std::io::stderr(), "{:>3.0} %: {}", 100.0 * done as f64 / self.count as f64, text());
            self.last_line = Instant::now();
        }
    }
}

impl Drop for Steps {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_left_counts_from_where_the_work_went_on() {
        assert_eq!(seconds_left(10.0, 0.0, 0.25), Some(30.0));
        assert_eq!(seconds_left(10.0, 0.5, 0.75), Some(10.0), "half of it was done before");
        assert_eq!(seconds_left(10.0, 0.5, 0.5), None);
    }
}
