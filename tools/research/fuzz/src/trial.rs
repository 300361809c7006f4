//! A file, read and judged.

use std::any::Any;
use std::cell::{Cell, RefCell};
use std::fs::File;
use std::io::{Cursor, Seek, Write};
use std::panic::{self, AssertUnwindSafe};
use std::path::PathBuf;
use std::sync::Once;
use std::time::{Duration, Instant};

use cpu_time::ProcessTime;
use engine::input::Input;
use engine::{Error, Kind, Result};
use peak_alloc::PeakAlloc;

use crate::seeds;
use crate::targets::{Target, VOLUME_BYTES};

/// Counts the bytes of the heap.
#[global_allocator]
static HEAP: PeakAlloc = PeakAlloc;

/// Bytes of the heap that reading a file may take: 300 MB and twice what the largest volume may declare.
pub const MOST_BYTES: usize = 300_000_000 + 2 * VOLUME_BYTES as usize;
/// Time of the processor that reading a file may take; it does not grow where others use the machine.
pub const LONGEST: Duration = Duration::from_secs(1);
/// Time by the clock that it may take, as where it waits for something that does not come.
pub const LONGEST_BY_THE_CLOCK: Duration = Duration::from_secs(60);

/// Returns what `work` returns, and the most bytes of the heap that it took.
pub fn heap_of<T>(work: impl FnOnce() -> T) -> (T, usize) {
    HEAP.reset_peak_usage();
    let before = HEAP.current_usage();
    let out = work();
    (out, HEAP.peak_usage().saturating_sub(before))
}

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

/// The reader under trial, with its file.
pub struct Trial {
    /// The reader.
    pub target: &'static Target,
    path: PathBuf,
    file: File,
    _folder: tempfile::TempDir,
}

thread_local! {
    /// Whether a reader is at work, whose panics are kept.
    static READING: Cell<bool> = const { Cell::new(false) };
    static MESSAGE: RefCell<Option<String>> = const { RefCell::new(None) };
}

impl Trial {
    /// Prepares trials of a reader. Panics of readers are then told by [`Fault::Panic`], no longer on stderr.
    ///
    /// # Errors
    /// If there is no place for a file.
    pub fn new(target: &'static Target) -> Result<Self> {
        let failed = |e: std::io::Error| Error::io(std::env::temp_dir(), "making a file", &e);
        let folder = tempfile::tempdir().map_err(failed)?;
        let path = folder.path().join("file").with_extension(target.extension);
        let file = File::create(&path).map_err(failed)?;
        if let Some(beside) = target.beside {
            std::fs::write(folder.path().join(beside), seeds::voxels()).map_err(failed)?;
        }
        // Handing so little work to another thread takes longer than the work. There may be a pool already.
        let _ = rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global();
        static HOOK: Once = Once::new();
        HOOK.call_once(|| {
            let usual = panic::take_hook();
            panic::set_hook(Box::new(move |info| match READING.get() {
                true => MESSAGE.with_borrow_mut(|said| *said = Some(info.to_string())),
                false => usual(info),
            }));
        });
        Ok(Trial { target, path, file, _folder: folder })
    }

    /// Makes a file of these bytes.
    fn file_of(&self, bytes: &[u8]) -> Input {
        if self.target.in_memory {
            return Input::of(Cursor::new(bytes.to_vec()), &self.path);
        }
        let mut file = &self.file;
        let written = file.rewind().and_then(|()| file.write_all(bytes));
        written.and_then(|()| file.set_len(bytes.len() as u64)).expect("a small file fits");
        Input::from(&self.path)
    }

    /// Reads a file with these bytes. Returns whether it was accepted, or the fault.
    pub fn read(&self, bytes: &[u8]) -> std::result::Result<bool, Fault> {
        let input = self.file_of(bytes);
        let (begin, cpu) = (Instant::now(), ProcessTime::now());
        READING.set(true);
        let (read, taken) = heap_of(|| panic::catch_unwind(AssertUnwindSafe(|| (self.target.read)(&input))));
        READING.set(false);
        let clock = begin.elapsed();
        let time = if clock > LONGEST { cpu.elapsed() } else { clock };
        match read {
            Err(payload) => Err(Fault::Panic(said(&*payload))),
            Ok(Err(e)) if e.kind == Kind::Internal => Err(Fault::Internal(format!("{}: {e}", e.code))),
            _ if taken > MOST_BYTES => Err(Fault::Memory(taken)),
            _ if time > LONGEST || clock > LONGEST_BY_THE_CLOCK => Err(Fault::Slow(time.max(clock))),
            Ok(read) => Ok(read.is_ok()),
        }
    }

    /// Leaves out parts of a file as long as the fault stays the same.
    pub fn minimized(&self, mut bytes: Vec<u8>, fault: &Fault) -> Vec<u8> {
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
pub fn is_alike(a: &Fault, b: &Fault) -> bool {
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
