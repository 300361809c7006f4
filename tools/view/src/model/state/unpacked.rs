//! Packed sessions: a zip with a session file and all that it names, opened from a folder that goes with it.

use std::fs::{self, File};
use std::io::{self, BufReader, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use engine::error::{Error, Kind, Result};
use tempfile::TempDir;
use zip::ZipArchive;
use zip::result::ZipError;

/// Most files of a packed session: a DICOM series has some thousand.
const MOST_FILES: usize = 100_000;
/// Most bytes that the files of a packed session may unpack to.
const MOST_BYTES: u64 = 1 << 37;

/// Beginning of the names of folders that sessions are unpacked into.
const PREFIX: &str = "vgs-session-";
/// File in such a folder that is locked for as long as its program lives.
const ALIVE: &str = ".alive";

type Archive = ZipArchive<BufReader<File>>;

/// A packed session whose files are in a folder of their own, which is deleted with the last copy of this value.
#[derive(Clone, Debug)]
pub struct Unpacked {
    zip: PathBuf,
    session: PathBuf,
    /// The file comes first, since a folder with an open file cannot be deleted everywhere.
    folder: Arc<(File, TempDir)>,
}

impl PartialEq for Unpacked {
    fn eq(&self, other: &Self) -> bool {
        self.zip == other.zip
    }
}

/// Returns true if a file is a zip with exactly one session in it, at its root or in a folder there.
pub fn is_packed(path: &Path) -> bool {
    let is_zip = path.extension().is_some_and(|end| end.eq_ignore_ascii_case("zip"));
    is_zip && path.is_file() && open(path).is_ok_and(|archive| session_in(&archive).is_some())
}

fn open(path: &Path) -> Result<Archive> {
    let file = engine::input::open(path).map_err(|e| Error::io(path, "opening", &e))?;
    ZipArchive::new(BufReader::new(file)).map_err(|e| damaged(path, e))
}

fn damaged(path: &Path, error: ZipError) -> Error {
    // The reader of zips tells damage by these.
    let damage = [
        io::ErrorKind::UnexpectedEof,
        io::ErrorKind::InvalidData,
        io::ErrorKind::InvalidInput,
        io::ErrorKind::Other,
    ];
    match error {
        ZipError::Io(e) if !damage.contains(&e.kind()) => Error::io(path, "reading", &e),
        e => Error::new(Kind::BadData, "VGS-VIEW-050", format!("not readable as a packed session: {e}"))
            .file(path)
            .help("the file was cut short or altered: copy it again, or unpack it with another program"),
    }
}

fn session_in(archive: &Archive) -> Option<String> {
    let is_session = |name: &String| name.to_lowercase().ends_with(".toml") && name.matches('/').count() <= 1;
    let names = archive.file_names().flatten().map(|name| name.into_owned());
    let mut names = names.filter(is_session);
    let first = names.next()?;
    names.next().is_none().then_some(first)
}

impl Unpacked {
    /// Unpacks a session.
    ///
    /// # Errors
    /// Returns [`Kind::BadData`] if the zip is damaged, claims too much, or has files that would lie outside of its
    /// folder, and [`Kind::Io`].
    pub fn of(path: &Path) -> Result<Self> {
        let mut archive = open(path)?;
        let wrong = |message: String| {
            Error::new(Kind::BadData, "VGS-VIEW-050", message).file(path).help("pack the session again")
        };
        let Some(session) = session_in(&archive) else {
            return Err(wrong("not a packed session: there is no single .toml at its root".to_owned()));
        };
        if archive.len() > MOST_FILES {
            return Err(wrong(format!("it holds more than {MOST_FILES} files")));
        }
        if archive.has_overlapping_entries().map_err(|e| damaged(path, e))? {
            return Err(wrong("its files overlap, which no program writes".to_owned()));
        }
        let mut builder = tempfile::Builder::new();
        builder.prefix(PREFIX);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // What is in it may be a patient's.
            builder.permissions(fs::Permissions::from_mode(0o700));
        }
        let temporary = std::env::temp_dir();
        let failed = |e: io::Error| Error::io(&temporary, "unpacking a session", &e);
        remove_abandoned(&temporary);
        let folder = builder.tempdir().map_err(failed)?;
        let alive = File::create_new(folder.path().join(ALIVE)).map_err(failed)?;
        alive.lock().map_err(failed)?;
        let mut left = MOST_BYTES;
        for index in 0..archive.len() {
            let mut entry = archive.by_index(index).map_err(|e| damaged(path, e))?;
            let Some(name) = entry.enclosed_name() else {
                return Err(wrong(format!("{:?} would end up outside its folder", entry.name())));
            };
            if entry.is_dir() {
                continue;
            }
            let size = entry.size();
            left = left.checked_sub(size).ok_or_else(|| wrong("its files are too large".to_owned()))?;
            let place = folder.path().join(name);
            fs::create_dir_all(place.parent().unwrap_or(folder.path())).map_err(failed)?;
            let mut file = File::create_new(&place).map_err(failed)?;
            let written = copy(&mut entry.by_ref().take(size), &mut file).map_err(|e| match e {
                Copy::Read(e) => damaged(path, ZipError::Io(e)),
                Copy::Write(e) => failed(e),
            })?;
            // The checksum is judged where an entry ends.
            let rest = io::copy(&mut entry.take(1), &mut io::sink()).map_err(|e| damaged(path, e.into()))?;
            if written != size || rest != 0 {
                return Err(wrong("a file in it does not have the size it claims".to_owned()));
            }
        }
        let zip = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let session = folder.path().join(session);
        Ok(Unpacked { zip, session, folder: Arc::new((alive, folder)) })
    }

    /// Returns the zip.
    pub fn zip(&self) -> &Path {
        &self.zip
    }

    /// Returns the folder with its content.
    pub fn folder(&self) -> &Path {
        self.folder.1.path()
    }

    /// Returns the session file in the folder.
    pub fn session(&self) -> PathBuf {
        self.session.clone()
    }
}

/// Deletes the folders of programs that were killed: their locks went with them.
fn remove_abandoned(temporary: &Path) {
    for entry in fs::read_dir(temporary).into_iter().flatten().flatten() {
        let is_ours = entry.file_name().to_string_lossy().starts_with(PREFIX);
        // Between its creation and its lock a file is some microseconds old.
        let is_old = |alive: &File| {
            let age = alive.metadata().and_then(|meta| meta.modified()).map(|made| made.elapsed());
            age.is_ok_and(|age| age.is_ok_and(|age| age > Duration::from_secs(60)))
        };
        let is_abandoned = || {
            File::open(entry.path().join(ALIVE)).is_ok_and(|alive| is_old(&alive) && alive.try_lock().is_ok())
        };
        if is_ours && is_abandoned() {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

/// Which end of a copy failed.
pub(crate) enum Copy {
    Read(io::Error),
    Write(io::Error),
}

/// Copies all bytes, and returns their number.
pub(crate) fn copy(from: &mut impl Read, to: &mut impl Write) -> std::result::Result<u64, Copy> {
    let mut buffer = vec![0; 1 << 18];
    let mut written = 0;
    loop {
        let count = match from.read(&mut buffer) {
            Ok(0) => return Ok(written),
            Ok(count) => count,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => continue,
            Err(e) => return Err(Copy::Read(e)),
        };
        to.write_all(&buffer[..count]).map_err(Copy::Write)?;
        written += count as u64;
    }
}
