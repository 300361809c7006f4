//! Says what the program is doing when that takes long and nothing else says so.

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::Duration;

use super::terminal::{clean, suspend_bars};

/// Time that people wait without wondering.
const PATIENCE: Duration = Duration::from_secs(2);

/// True if nothing is said, as with `--quiet` and `--json`.
static SILENT: AtomicBool = AtomicBool::new(false);

/// Says nothing of any wait from now on.
pub fn be_silent() {
    SILENT.store(true, Ordering::Relaxed);
}

/// Work in progress. If it lasts longer than two seconds, a line on stderr says what it is; dropped, it is over.
pub struct Waiting {
    over: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Waiting {
    /// Begins work that `what` describes, as "reading ct.nii.gz".
    pub fn on(what: impl Into<String>) -> Self {
        Waiting::after(PATIENCE, what.into(), |line| {
            suspend_bars(|| {
                let _ = writeln!(std::io::stderr(), "{line}");
            });
        })
    }

    fn after(patience: Duration, what: String, say: impl FnOnce(String) + Send + 'static) -> Self {
        if SILENT.load(Ordering::Relaxed) {
            return Waiting { over: None, thread: None };
        }
        let (over, is_over) = channel::<()>();
        let told = move || {
            if is_over.recv_timeout(patience) == Err(RecvTimeoutError::Timeout) {
                say(clean(&format!("{what} ...")));
            }
        };
        // Without a thread nothing is said, which is no reason to fail.
        let thread = std::thread::Builder::new().spawn(told).ok();
        Waiting { over: Some(over), thread }
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

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;

    use super::*;

    #[test]
    fn only_long_work_is_told() {
        let told = |patience: Duration, work: Duration| {
            let (sender, lines) = channel();
            let waiting = Waiting::after(patience, "reading a\u{7}".to_owned(), move |line| {
                let _ = sender.send(line);
            });
            std::thread::sleep(work);
            drop(waiting);
            lines.try_iter().collect::<Vec<_>>()
        };
        assert_eq!(told(Duration::from_millis(5), Duration::from_millis(400)), ["reading a\\u{7} ..."]);
        assert!(told(Duration::from_secs(60), Duration::ZERO).is_empty());
    }
}
