//! Handles Ctrl-C and similar signals: the first one asks the running fit to stop and save, the second one
//! ends the program at once. Before and after the fit there is nothing to save, and the first one ends the
//! program, too.

use std::fs;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicI32, Ordering::SeqCst};
use std::sync::{Arc, Mutex, PoisonError};

use engine::{Error, Kind, Result};
use signal_hook::consts::{SIGABRT, SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
use signal_hook::iterator;

/// State that the signal thread and the command share.
#[derive(Default)]
struct SharedState {
    /// Number of the first signal, or 0.
    received: AtomicI32,
    /// True while a fit is running that checks `received`.
    deferring: AtomicBool,
    /// File to remove when a signal ends the program.
    remove_on_exit: Mutex<Option<PathBuf>>,
}

fn failed(e: std::io::Error) -> Error {
    Error::new(Kind::Internal, "VGS-CLI-004", format!("signals cannot be watched: {e}"))
}

/// Makes a write beyond the limit of a file's size (ulimit -f) fail like any other, instead of ending the program
/// in the middle of its work.
pub fn survive_file_limits() -> Result<()> {
    signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false))).map_err(failed)?;
    Ok(())
}

/// Makes an allocation of memory that fails end the program with the exit code for it. Rust has told by then how
/// many bytes were wanted, and aborts.
pub fn end_without_memory() -> Result<()> {
    let always = Arc::new(AtomicBool::new(true));
    let code = i32::from(Kind::HostMemory.exit_code());
    signal_hook::flag::register_conditional_shutdown(SIGABRT, code, always).map_err(failed)?;
    Ok(())
}

/// Signals of this process; by default none are handled.
#[derive(Clone, Default)]
pub struct Signals(Arc<SharedState>);

impl Signals {
    /// Handles SIGINT, SIGTERM and SIGHUP from now on.
    pub fn install() -> Result<Self> {
        let mut incoming = iterator::Signals::new([SIGINT, SIGTERM, SIGHUP]).map_err(failed)?;
        let signals = Signals(Arc::default());
        let shared = signals.clone().0;
        std::thread::Builder::new()
            .name("signals".into())
            .spawn(move || {
                for signal in incoming.forever() {
                    let first = shared.received.compare_exchange(0, signal, SeqCst, SeqCst).is_ok();
                    if !(first && shared.deferring.load(SeqCst)) {
                        if let Some(path) =
                            shared.remove_on_exit.lock().unwrap_or_else(PoisonError::into_inner).take()
                        {
                            let _ = fs::remove_file(path);
                        }
                        // Destructors are not run: other threads may be anywhere, in a driver for instance.
                        signal_hook::low_level::exit(128 + signal);
                    }
                }
            })
            .map_err(failed)?;
        Ok(signals)
    }

    /// Makes the first signal from now on only set a flag, so that the fit can stop and save.
    pub fn defer_first_signal(&self) {
        self.0.deferring.store(true, SeqCst);
    }

    /// Returns the exit code of the received signal, if there was one.
    pub fn exit_code(&self) -> Option<u8> {
        match self.0.received.load(SeqCst) {
            0 => None,
            signal => Some(u8::try_from(128 + signal).unwrap_or(130)),
        }
    }

    /// Sets the file to remove if a signal ends the program.
    pub fn remove_on_exit(&self, path: Option<PathBuf>) {
        *self.0.remove_on_exit.lock().unwrap_or_else(PoisonError::into_inner) = path;
    }
}
