//! A file, read and judged.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::panic::{self, AssertUnwindSafe};
use std::path::{Path, PathBuf};
use std::sync::Once;
use std::time::{Duration, Instant};

use engine::{Error, Kind, Result};
use peak_alloc::PeakAlloc;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use crate::mutate::mutated;
use crate::targets::Target;

/// Counts the bytes of the heap.
#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

/// Bytes of the heap that reading a file may take: 300 MB and twice what the largest volume may declare.
pub const MOST_BYTES: usize = 300_000_000 + 2 * (32 << 20);
/// Time that reading a file may take.
pub const LONGEST: Duration = Duration::from_secs(1);

/// What reading a file must not do.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// It panicked, here with its message.
    Panic(String),
    /// It said that the fault is the program's.
    Internal(String),
    /// It took so many bytes.
    Memory(usize),
    /// It took so long.
    Slow(Duration),
}

/// How a series of trials ended.
#[derive(Debug, Default)]
pub struct Outcome {
    /// Files read.
    pub executions: u64,
    /// Files that were accepted.
    pub accepted: u64,
    /// Faults, each with the file that led to it, the first of each kind and message.
    pub faults: Vec<(Fault, Vec<u8>)>,
}

/// The reader under trial, with its file.
pub struct Trial<'a> {
    target: &'a Target,
    file: PathBuf,
    _folder: tempfile::TempDir,
}

thread_local! {
    /// Whether a reader is at work, whose panics are kept.
    static READING: Cell<bool> = const { Cell::new(false) };
    static MESSAGE: RefCell<Option<String>> = const { RefCell::new(None) };
}

impl<'a> Trial<'a> {
    /// Prepares trials of a reader. Panics of readers are then told by [`Fault::Panic`], no longer on stderr.
    ///
    /// # Errors
    /// If there is no place for a file.
    pub fn new(target: &'a Target) -> Result<Self> {
        let memory = Path::new("/dev/shm");
        let made = if memory.is_dir() { tempfile::tempdir_in(memory) } else { tempfile::tempdir() };
        let folder = made.map_err(|e| Error::io(memory, "making a folder", &e))?;
        let file = folder.path().join("file").with_extension(target.extension);
        static HOOK: Once = Once::new();
        HOOK.call_once(|| {
            let usual = panic::take_hook();
            panic::set_hook(Box::new(move |info| match READING.get() {
                true => MESSAGE.with_borrow_mut(|said| *said = Some(info.to_string())),
                false => usual(info),
            }));
        });
        Ok(Trial { target, file, _folder: folder })
    }

    /// Reads a file with these bytes. Returns whether it was accepted, or the fault.
    pub fn read(&self, bytes: &[u8]) -> std::result::Result<bool, Fault> {
        std::fs::write(&self.file, bytes).expect("a small file fits");
        HEAP.reset_peak_usage();
        let (before, begin) = (HEAP.current_usage(), Instant::now());
        READING.set(true);
        let read = panic::catch_unwind(AssertUnwindSafe(|| (self.target.read)(&self.file)));
        READING.set(false);
        let (taken, time) = (HEAP.peak_usage().saturating_sub(before), begin.elapsed());
        match read {
            Err(payload) => Err(Fault::Panic(said(&*payload))),
            Ok(Err(e)) if e.kind == Kind::Internal => Err(Fault::Internal(format!("{}: {e}", e.code))),
            _ if taken > MOST_BYTES => Err(Fault::Memory(taken)),
            _ if time > LONGEST => Err(Fault::Slow(time)),
            Ok(read) => Ok(read.is_ok()),
        }
    }

    /// Reads mutated files until there were so many, or so long. `tell` is called about once a second.
    pub fn series(
        &self,
        seed: u64,
        most: u64,
        longest: Duration,
        mut tell: impl FnMut(&Outcome, Duration),
    ) -> Outcome {
        let seeds = (self.target.seeds)();
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut outcome = Outcome::default();
        let (begin, mut told) = (Instant::now(), Instant::now());
        while outcome.executions < most && begin.elapsed() < longest {
            let bytes = (self.target.mend)(&mutated(&mut rng, &seeds));
            match self.read(&bytes) {
                Ok(accepted) => outcome.accepted += u64::from(accepted),
                Err(fault) => {
                    if !outcome.faults.iter().any(|(known, _)| is_alike(known, &fault)) {
                        let shorter = self.minimized(bytes, &fault);
                        outcome.faults.push((fault, shorter));
                    }
                }
            }
            outcome.executions += 1;
            if told.elapsed() >= Duration::from_secs(1) {
                told = Instant::now();
                tell(&outcome, begin.elapsed());
            }
        }
        outcome
    }

    /// Leaves out parts of a file as long as the fault stays the same.
    fn minimized(&self, mut bytes: Vec<u8>, fault: &Fault) -> Vec<u8> {
        let mut length = bytes.len() / 2;
        while length > 0 {
            let mut at = 0;
            while at < bytes.len() {
                let mut shorter = bytes.clone();
                shorter.drain(at..(at + length).min(bytes.len()));
                match self.read(&shorter) {
                    Err(found) if is_alike(&found, fault) => bytes = shorter,
                    _ => at += length,
                }
            }
            length /= 2;
        }
        bytes
    }
}

/// Returns true if two faults are of one kind, and panics of one place.
fn is_alike(a: &Fault, b: &Fault) -> bool {
    let place = |said: &str| said.split(" at ").nth(1).and_then(|s| s.lines().next()).map(str::to_owned);
    match (a, b) {
        (Fault::Panic(a), Fault::Panic(b)) => place(a) == place(b),
        (Fault::Internal(a), Fault::Internal(b)) => a.split(':').next() == b.split(':').next(),
        (Fault::Memory(_), Fault::Memory(_)) | (Fault::Slow(_), Fault::Slow(_)) => true,
        _ => false,
    }
}

/// Returns what a panic said, with its place.
fn said(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(|s| (*s).to_owned());
    let text = text.or_else(|| payload.downcast_ref::<String>().cloned());
    MESSAGE.with_borrow_mut(Option::take).or(text).unwrap_or_default()
}
