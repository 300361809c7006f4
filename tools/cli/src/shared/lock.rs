//! Lock that admits one run per output: an advisory lock on a file beside the output, which says who holds it
//! and since when. The lock belongs to the process and ends with it in any case; a file that is left behind
//! locks nobody out. Anything in the lock's place that is no lock of ours (a link, a file with other content)
//! is never touched.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};

use engine::{Error, Kind, Result};

use super::clock;
use super::signals::Signals;

/// Held lock; dropping it removes the file and with it the lock.
pub struct Lock {
    path: PathBuf,
    // Held for the lock on it.
    file: File,
    signals: Signals,
}

impl Lock {
    /// Locks `output` for this process.
    ///
    /// # Errors
    /// Returns [`Kind::Temporary`] if another process holds the lock, [`Kind::CannotCreate`] if something
    /// else has its name.
    pub fn take(output: &Path, signals: &Signals) -> Result<Lock> {
        let mut name = output.file_name().unwrap_or_default().to_owned();
        name.push(".lock");
        let path = output.with_file_name(name);
        let failed = |e: &std::io::Error| {
            let message = format!("cannot create the lock file {}: {e}", path.display());
            Error::new(Kind::CannotCreate, "VGS-CLI-010", message).file(output)
        };
        loop {
            let Some(mut file) = open(&path).map_err(|e| failed(&e))? else { return Err(foreign(&path)) };
            match file.try_lock() {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => return Err(busy(output, file)),
                Err(TryLockError::Error(e)) => return Err(failed(&e)),
            }
            // Between opening and locking, the former holder may have removed the file; then nobody else sees
            // it.
            if !is_still(&file, &path) {
                continue;
            }
            if !is_ours(&mut file).map_err(|e| failed(&e))? {
                return Err(foreign(&path));
            }
            signals.remove_on_exit(Some(path.clone()));
            // From here on `Drop` removes the file, also if the disk has no room for the note.
            let mut lock = Lock { path: path.clone(), file, signals: signals.clone() };
            lock.note().map_err(|e| failed(&e))?;
            return Ok(lock);
        }
    }

    /// Writes whose lock it is, since when.
    fn note(&mut self) -> std::io::Result<()> {
        self.file.set_len(0)?;
        self.file.rewind()?;
        writeln!(self.file, "{} {}", std::process::id(), clock::now())
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        self.signals.remove_on_exit(None);
        let _ = fs::remove_file(&self.path);
    }
}

/// Opens the file at `path`, or creates it; returns `None` if what is there is no regular file. A link is not
/// followed: if one takes the place of a file between the two looks, [`is_still`] finds another file there.
fn open(path: &Path) -> std::io::Result<Option<File>> {
    loop {
        let mut options = OpenOptions::new();
        options.read(true).write(true);
        match options.clone().create_new(true).open(path) {
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
            made => return made.map(Some),
        }
        match fs::symlink_metadata(path) {
            Ok(there) if !there.is_file() => return Ok(None),
            Ok(_) => match options.open(path) {
                Err(e) if e.kind() == ErrorKind::NotFound => {}
                opened => return opened.map(Some),
            },
            Err(e) if e.kind() == ErrorKind::NotFound => {}
            Err(e) => return Err(e),
        }
    }
}

/// Greatest length of a lock's note, bytes: a process and a date.
const LONGEST_NOTE: u64 = 64;

/// Returns true if the file is empty or holds the note of a lock.
fn is_ours(file: &mut File) -> std::io::Result<bool> {
    let mut bytes = Vec::new();
    file.rewind()?;
    file.take(LONGEST_NOTE + 1).read_to_end(&mut bytes)?;
    let Ok(note) = std::str::from_utf8(&bytes) else { return Ok(false) };
    let words: Vec<&str> = note.split_whitespace().collect();
    let is_note = |process: &str, since: &str| {
        process.parse::<u32>().is_ok()
            && since.starts_with(|c: char| c.is_ascii_digit())
            && since.ends_with('Z')
    };
    Ok(match words[..] {
        [] => bytes.is_empty(),
        [process, since] => bytes.len() as u64 <= LONGEST_NOTE && is_note(process, since),
        _ => false,
    })
}

fn foreign(path: &Path) -> Error {
    let message = "this is not a lock file of vgs, and it is in the way: nothing was changed";
    Error::new(Kind::CannotCreate, "VGS-CLI-097", message)
        .file(path)
        .help("move it away, or choose another name for the output")
}

fn is_still(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), fs::symlink_metadata(path)) {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_lock_is_left_alone() {
        let folder = tempfile::tempdir().expect("a folder");
        let (output, lock) = (folder.path().join("a.ply"), folder.path().join("a.ply.lock"));
        let take = || Lock::take(&output, &Signals::default());
        let precious = folder.path().join("precious");
        fs::write(&precious, "precious").expect("a file");

        std::os::unix::fs::symlink(&precious, &lock).expect("a link");
        assert_eq!(take().err().map(|e| e.code), Some("VGS-CLI-097"));
        fs::remove_file(&lock).expect("the link");
        std::os::unix::fs::symlink(folder.path().join("nowhere"), &lock).expect("a link to nothing");
        assert_eq!(take().err().map(|e| e.code), Some("VGS-CLI-097"));
        assert!(!folder.path().join("nowhere").exists());
        fs::remove_file(&lock).expect("the link");
        for content in ["my notes", "12 monkeys", "\n", "1 2Z 3", &"9".repeat(100)] {
            fs::write(&lock, content).expect("a file");
            assert_eq!(take().err().map(|e| e.code), Some("VGS-CLI-097"), "{content}");
            assert_eq!(fs::read_to_string(&lock).expect("the file"), content);
        }
        assert_eq!(fs::read_to_string(&precious).expect("the file"), "precious");

        // A file that a killed run left behind locks nobody out, and neither does an empty file.
        for content in ["4711 2026-01-31T12:00:00Z\n", ""] {
            fs::write(&lock, content).expect("a file");
            let held = take().expect("a lock");
            let note = fs::read_to_string(&lock).expect("a note");
            assert!(note.starts_with(&format!("{} ", std::process::id())), "{note}");
            assert_eq!(take().err().map(|e| e.code), Some("VGS-CLI-011"), "held by this process");
            drop(held);
            assert!(!lock.exists());
        }
    }
}
