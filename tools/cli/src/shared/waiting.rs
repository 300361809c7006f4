//! Says what the program is doing when that takes long, and how far it is where that is known.

use std::io::Write;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;

use super::terminal::{LINE_EVERY, STEPS, bar, clean, stderr_has_colour, suspend_bars};

/// Time that people wait without wondering.
const PATIENCE: Duration = Duration::from_secs(1);
/// Time between two looks at how far the work is.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Bits of a share that is not known: NaN.
const UNKNOWN: u64 = 0x7ff8_0000_0000_0000;

/// True if nothing is said, as with `--quiet` and `--json`.
static SILENT: AtomicBool = AtomicBool::new(false);

/// Says nothing of any wait from now on.
pub fn be_silent() {
    SILENT.store(true, Ordering::Relaxed);
}

/// Work in progress. If it lasts longer than a second, stderr says what it is and, where that is told, how far: a bar
/// on a terminal, now and then a line elsewhere. Dropped, it is over.
pub struct Waiting {
    /// Bits of the share of the work that is done.
    share: Arc<AtomicU64>,
    over: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Waiting {
    /// Begins work that `what` describes, as "reading ct.nii.gz".
    pub fn on(what: impl Into<String>) -> Self {
        let mut teller = Teller::of(clean(&what.into()));
        Waiting::after(PATIENCE, move |share| teller.tell(share))
    }

    /// Tells that a share of the work is done, 0 to 1.
    pub fn at(&self, share: f64) {
        self.share.store(share.to_bits(), Ordering::Relaxed);
    }

    fn after(patience: Duration, mut tell: impl FnMut(Option<f64>) + Send + 'static) -> Self {
        let share = Arc::new(AtomicU64::new(UNKNOWN));
        if SILENT.load(Ordering::Relaxed) {
            return Waiting { share, over: None, thread: None };
        }
        let (over, is_over) = channel::<()>();
        let seen = Arc::clone(&share);
        let telling = move || {
            let mut wait = patience;
            while is_over.recv_timeout(wait) == Err(RecvTimeoutError::Timeout) {
                let share = f64::from_bits(seen.load(Ordering::Relaxed));
                tell(Some(share).filter(|share| !share.is_nan()));
                wait = LOOK_EVERY;
            }
        };
        // Without a thread nothing is said, which is no reason to fail.
        let thread = std::thread::Builder::new().spawn(telling).ok();
        Waiting { share, over: Some(over), thread }
    }
}

impl Drop for Waiting {
    fn drop(&mut self) {
        self.over = None;
        // Nothing is said once the work is over.
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

/// What tells people of the work.
struct Teller {
    what: String,
    bar: Option<ProgressBar>,
    /// Time and share of the last line.
    line: Option<(Instant, f64)>,
}

impl Teller {
    fn of(what: String) -> Self {
        Teller { what, bar: None, line: None }
    }

    fn tell(&mut self, share: Option<f64>) {
        match share {
            Some(share) if stderr_has_colour() => {
                let bar = self.bar.get_or_insert_with(bar);
                bar.set_message(self.what.clone());
                bar.set_position((share * STEPS as f64) as u64);
            }
            _ => {
                if let Some(line) = self.line(share) {
                    suspend_bars(|| _ = writeln!(std::io::stderr(), "{line}"));
                }
            }
        }
    }

    /// Returns the next line, if it is time for one: the first at once, others where they tell of more that is done.
    fn line(&mut self, share: Option<f64>) -> Option<String> {
        let due = |(at, before): (Instant, f64)| {
            at.elapsed() >= LINE_EVERY && share.is_some_and(|share| share > before)
        };
        if !self.line.is_none_or(due) {
            return None;
        }
        self.line = Some((Instant::now(), share.unwrap_or(0.0)));
        let what = &self.what;
        Some(share.map_or(format!("{what} ..."), |share| format!("{:>3.0} %: {what}", 100.0 * share)))
    }
}

impl Drop for Teller {
    fn drop(&mut self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    #[test]
    fn only_long_work_is_told() {
        let told = |patience: Duration, work: Duration| {
            let (sender, shares) = channel();
            let waiting = Waiting::after(patience, move |share| _ = sender.send(share));
            std::thread::sleep(work);
            waiting.at(0.25);
            std::thread::sleep(work);
            drop(waiting);
            shares.try_iter().collect::<Vec<_>>()
        };
        let long = told(Duration::from_millis(5), Duration::from_millis(500));
        assert_eq!((long[0], long.last().copied()), (None, Some(Some(0.25))), "{long:?}");
        assert!(told(Duration::from_secs(60), Duration::ZERO).is_empty());
    }

    #[test]
    fn lines_say_what_it_is_and_how_far() {
        let mut plain = Teller::of("reading a".to_owned());
        assert_eq!((plain.line(None), plain.line(None)), (Some("reading a ...".to_owned()), None));
        let mut told = Teller::of("trying".to_owned());
        assert_eq!(told.line(Some(0.25)).as_deref(), Some(" 25 %: trying"));
        assert_eq!(told.line(Some(0.5)), None, "not so soon");
        told.line = Some((Instant::now() - LINE_EVERY, 0.25));
        assert_eq!(told.line(Some(0.25)), None, "no more is done");
        assert_eq!(told.line(Some(0.5)).as_deref(), Some(" 50 %: trying"));
    }
}
