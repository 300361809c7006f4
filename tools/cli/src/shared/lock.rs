//! One run per output: an advisory lock on a file beside it, which says who holds it and since when. The lock
//! belongs to the process and goes with it, however it ends; a file that is left behind locks nobody out.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{Read, Seek, Write};
use std::path::{Path, PathBuf};

use engine::{Error, Kind, Result};

use super::clock;
use super::signals::Signals;

/// A held lock; dropping it removes the file and with it the lock.
pub struct Lock {
    path: PathBuf,
    // Held for the lock on it.
    _file: File,
    signals: Signals,
}

impl Lock {
    /// Locks `output` for this process.
    ///
    /// # Errors
    /// [`Kind::Temporary`] if another process holds it.
    pub fn take(output: &Path, signals: &Signals) -> Result<Lock> {
        let mut name = output.file_name().unwrap_or_default().to_owned();
        name.push(".lock");
        let path = output.with_file_name(name);
        let failed = |e: &std::io::Error| {
            let message = format!("cannot create the lock file {}: {e}", path.display());
            Error::new(Kind::CannotCreate, "VGS-CLI-010", message).file(output)
        };
        loop {
            let mut options = OpenOptions::new();
            let mut file = options
                .read(true)
                .write(true)
                .create(true)
                .truncate(false)
                .open(&path)
                .map_err(|e| failed(&e))?;
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => return Err(busy(output, file)),
                Err(TryLockError::Error(e)) => return Err(failed(&e)),
            }
            // Between opening and locking, the former holder may have removed the file: then nobody else sees it.
            if !is_still(&file, &path) {
                continue;
            }
            let note = format!("{} {}\n", std::process::id(), clock::now());
            file.set_len(0).and_then(|()| file.write_all(note.as_bytes())).map_err(|e| failed(&e))?;
            signals.remove_on_exit(Some(path.clone()));
            return Ok(Lock { path, _file: file, signals: signals.clone() });
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        self.signals.remove_on_exit(None);
        let _ = fs::remove_file(&self.path);
    }
}

fn is_still(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), fs::metadata(path)) {
        (Ok(a), Ok(b)) => a.ino() == b.ino() && a.dev() == b.dev(),
        _ => false,
    }
}

fn busy(output: &Path, mut file: File) -> Error {
    let mut note = String::new();
    let _ = file.rewind().and_then(|()| file.take(200).read_to_string(&mut note));
    let mut words = note.split_whitespace();
    let message = match (words.next(), words.next()) {
        (Some(pid), Some(since)) => format!("locked by process {pid} since {since}"),
        _ => "locked by another process".to_owned(),
    };
    Error::new(Kind::Temporary, "VGS-CLI-011", message)
        .file(output)
        .help("another run writes this output: wait for it, or choose another name")
}
