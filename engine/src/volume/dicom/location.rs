//! Where a DICOM file is: on disk, or in a zip.

use std::fmt;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use dicom_object::{DefaultDicomObject, OpenFileOptions, Tag};
use zip::ZipArchive;
use zip::result::ZipError;

use super::{MAGIC, MAGIC_AT, sniff};
use crate::volume::ReadOptions;
use crate::{Error, Kind, Result};

/// The most bytes before the pixels of a file in a zip; the header of an enhanced file of ten thousand frames
/// has some twenty million.
const MOST_HEADER_BYTES: u64 = 1 << 28;
/// Beginning of a zip.
const ZIP_MAGIC: &[u8] = b"PK\x03\x04";

/// Returns true if this is the beginning of a zip.
pub(in crate::volume) fn is_zip(head: &[u8]) -> bool {
    head.starts_with(ZIP_MAGIC)
}

/// A DICOM file on disk or in a zip. Nothing of a zip is written to disk.
#[derive(Clone, Default)]
pub(super) struct Location {
    /// Path of the file; for a file in a zip the path of the zip, and the name in it as it stands there. The
    /// latter is only for messages.
    pub path: PathBuf,
    member: Option<(Arc<Archive>, usize)>,
}

impl fmt::Debug for Location {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.path.fmt(f)
    }
}

impl Location {
    /// Creates the location of a file on disk.
    pub fn on_disk(path: impl Into<PathBuf>) -> Self {
        Location { path: path.into(), member: None }
    }

    /// Reads the file, or its elements before `until`. Of a file in a zip no more is unpacked than the zip
    /// declares.
    ///
    /// # Errors
    /// [`Kind::BadData`] for a damaged file, [`Kind::HostMemory`].
    pub fn open(&self, until: Option<Tag>) -> Result<DefaultDicomObject> {
        let options = OpenFileOptions::new();
        let options = match until {
            Some(tag) => options.read_until(tag),
            None => options,
        };
        let Some((archive, index)) = &self.member else {
            return options.open_file(&self.path).map_err(|e| damaged(&self.path, &e));
        };
        let mut zip = archive.lock();
        let mut member = zip.by_index(*index).map_err(|e| archive.failed(&self.path, e))?;
        let size = member.size();
        if until.is_some() {
            let start = BufReader::new(member.take(size.min(MOST_HEADER_BYTES)));
            return options.from_reader(start).map_err(|e| damaged(&self.path, &e));
        }
        let mut bytes = Vec::new();
        bytes.try_reserve_exact(size as usize).map_err(|_| {
            let message = format!("no memory for a file of {size} bytes");
            Error::new(Kind::HostMemory, "VGS-VOL-010", message).file(&self.path)
        })?;
        member.by_ref().take(size).read_to_end(&mut bytes).map_err(|e| damaged(&self.path, &e))?;
        // Decoding takes longer than unpacking, and other threads may unpack meanwhile.
        drop(member);
        drop(zip);
        options.from_reader(bytes.as_slice()).map_err(|e| damaged(&self.path, &e))
    }
}

/// Returns the error of a file that the library cannot read.
pub(super) fn damaged(path: &Path, error: &dyn std::error::Error) -> Error {
    // Only the first line: the library's texts may continue with a backtrace.
    let text = error.to_string();
    let text = text.lines().next().unwrap_or_default().to_owned();
    Error::new(Kind::BadData, "VGS-DCM-005", format!("not readable as DICOM: {text}")).file(path).help(
        "the file is damaged or cut short: copy it again, or leave such files of a folder out with --lenient",
    )
}

/// An open zip.
struct Archive {
    path: PathBuf,
    zip: Mutex<ZipArchive<BufReader<File>>>,
}

impl Archive {
    fn lock(&self) -> MutexGuard<'_, ZipArchive<BufReader<File>>> {
        // Each member is sought anew, so a thread that has panicked leaves nothing half done.
        self.zip.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn failed(&self, member: &Path, e: ZipError) -> Error {
        match e {
            ZipError::Io(e) => Error::io(&self.path, "reading", &e),
            e => Error::new(Kind::BadData, "VGS-DCM-015", format!("not readable as a zip: {e}"))
                .file(member)
                .help("unpack it with another program and give the folder"),
        }
    }
}

/// Returns the number of entries of a zip and the DICOM files among them, in the order of their names.
/// Everything that a damaged or malicious zip may claim is bounded: a file is refused if it claims more than
/// [`ReadOptions::max_bytes`], and so are members that share their bytes.
///
/// # Errors
/// [`Kind::BadData`] if the zip is damaged, encrypted or too large, or has more than `most` entries;
/// [`Kind::Io`].
pub(super) fn members(path: &Path, most: usize, options: &ReadOptions) -> Result<(usize, Vec<Location>)> {
    let file = File::open(path).map_err(|e| Error::io(path, "opening", &e))?;
    let unreadable = |e: ZipError| match e {
        ZipError::Io(e) if e.kind() != io::ErrorKind::UnexpectedEof => Error::io(path, "reading", &e),
        e => Error::new(Kind::BadData, "VGS-DCM-015", format!("not readable as a zip: {e}"))
            .file(path)
            .help("copy the file again, or unpack it with another program and give the folder"),
    };
    let mut zip = ZipArchive::new(BufReader::new(file)).map_err(unreadable)?;
    let count = zip.len();
    if count > most {
        return Err(Error::new(
            Kind::BadData,
            "VGS-DCM-002",
            format!("the zip holds more than {most} files"),
        )
        .file(path)
        .help("give a zip of one study or series"));
    }
    if zip.has_overlapping_entries().map_err(unreadable)? {
        let message = "not readable as a zip: its files overlap";
        return Err(Error::new(Kind::BadData, "VGS-DCM-015", message)
            .file(path)
            .help("no program writes such zips; make the zip again"));
    }
    let archive = Arc::new(Archive { path: path.to_owned(), zip: Mutex::new(zip) });
    let mut found = Vec::new();
    for index in 0..count {
        let mut zip = archive.lock();
        let name = zip.name_for_index(index).and_then(|name| name.ok()).unwrap_or_default();
        let mut of_zip = path.as_os_str().to_owned();
        of_zip.push(format!("/{name}"));
        let own = PathBuf::from(of_zip);
        let mut member = zip.by_index(index).map_err(|e| archive.failed(&own, e))?;
        if member.is_dir() {
            continue;
        }
        let mut head = Vec::new();
        let length = (MAGIC_AT + MAGIC.len()) as u64;
        let read = member.by_ref().take(length).read_to_end(&mut head);
        if read.is_err() || !sniff(&head) {
            continue;
        }
        if member.size() > options.max_bytes {
            let message =
                format!("declares {} bytes, more than the limit of {}", member.size(), options.max_bytes);
            return Err(Error::new(Kind::BadData, "VGS-VOL-005", message)
                .file(own)
                .help("if the size is right, raise the limit with --max-bytes"));
        }
        drop(member);
        drop(zip);
        found.push(Location { path: own, member: Some((Arc::clone(&archive), index)) });
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    Ok((count, found))
}
