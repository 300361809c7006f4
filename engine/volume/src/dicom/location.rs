//! Where a DICOM file is: on disk, or in a zip.

use std::fmt;
use std::io::{self, BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use dicom_object::{DefaultDicomObject, OpenFileOptions, Tag};
use flate2::read::DeflateDecoder;
use zip::ZipArchive;
use zip::result::ZipError;

use super::elements::{Oddity, by_dictionary};
use super::lengths::{PACKED, too_long};
use super::{MAGIC_AT, has_magic, missing_start, sniff};
use crate::ReadOptions;
use crate::source::SNIFF_BYTES;
use base::input::{Input, Stream};
use base::{Error, Kind, Result};

/// The most bytes before the pixels of a file in a zip; the header of an enhanced file of ten thousand frames
/// has some twenty million.
const MOST_HEADER_BYTES: u64 = 1 << 28;
/// Tag, type and length of the first element, which says how long its group is.
const GROUP_LENGTH: &[u8] = b"\x02\0\0\0UL\x04\0";
/// The longest first group that is searched; those of real files have some hundred bytes.
const MOST_META_BYTES: u64 = 1 << 16;
/// Beginning of a zip.
const ZIP_MAGIC: &[u8] = b"PK\x03\x04";

/// Returns true if this is the beginning of a zip.
pub(crate) fn is_zip(head: &[u8]) -> bool {
    head.starts_with(ZIP_MAGIC)
}

/// A file that was read, or its beginning.
pub(super) struct Opened {
    /// Its elements, by the representation of the dictionary.
    pub object: DefaultDicomObject,
    /// What was read although it is not as it should be.
    pub oddities: Vec<Oddity>,
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

    /// Refuses a file whose elements are packed as a whole (deflated) and unpack to more than `max_bytes`. They
    /// are unpacked here once, into nothing, since nothing else bounds what a reader of them takes.
    ///
    /// # Errors
    /// [`Kind::BadData`] if it is too large; [`Kind::Io`].
    pub fn check_packed(&self, max_bytes: u64) -> Result<()> {
        let failed = |e: io::Error| Error::io(&self.path, "reading", &e);
        let unpacked = match &self.member {
            None => unpacked_size(base::input::open(&self.path).map_err(failed)?, max_bytes),
            Some((archive, index)) => {
                let mut zip = archive.lock();
                unpacked_size(zip.by_index(*index).map_err(|e| archive.failed(&self.path, e))?, max_bytes)
            }
        };
        // Damage is told by the reader.
        if unpacked.unwrap_or(0) <= max_bytes {
            return Ok(());
        }
        let message = format!("unpacks to more than the limit of {max_bytes} bytes");
        Err(Error::new(Kind::BadData, "VGS-VOL-005", message)
            .file(&self.path)
            .help("if the size is right, raise the limit with --max-bytes"))
    }

    /// Reads the file, or its elements before `until`. Of a file in a zip no more is unpacked than the zip
    /// declares.
    ///
    /// # Errors
    /// [`Kind::BadData`] for a damaged file, [`Kind::HostMemory`].
    pub fn open(&self, until: Option<Tag>) -> Result<Opened> {
        let mut object = self.read(until)?;
        let oddities = by_dictionary(&mut object);
        Ok(Opened { object, oddities })
    }

    fn read(&self, until: Option<Tag>) -> Result<DefaultDicomObject> {
        let options = OpenFileOptions::new();
        let options = match until {
            Some(tag) => options.read_until(tag),
            None => options,
        };
        let Some((archive, index)) = &self.member else {
            let failed = |e: io::Error| Error::io(&self.path, "reading", &e);
            let mut file = base::input::open(&self.path).map_err(failed)?;
            let size = file.metadata().map_err(failed)?.len();
            let mut head = Vec::new();
            (&mut file).take(SNIFF_BYTES as u64).read_to_end(&mut head).map_err(failed)?;
            if !has_magic(&head) {
                let mut bytes = self.reserve(size)?;
                bytes.extend(head);
                file.take(size).read_to_end(&mut bytes).map_err(failed)?;
                let size = bytes.len() as u64;
                return self.read_bytes(bytes, size, options, until.is_some());
            }
            file.rewind().map_err(failed)?;
            self.check_lengths(BufReader::new(file), size, until.is_some())?;
            return options.open_file(&self.path).map_err(|e| damaged(&self.path, &e));
        };
        let mut zip = archive.lock();
        let mut member = zip.by_index(*index).map_err(|e| archive.failed(&self.path, e))?;
        let size = member.size();
        let most = if until.is_some() { size.min(MOST_HEADER_BYTES) } else { size };
        let mut bytes = self.reserve(if until.is_some() { 0 } else { size })?;
        member.by_ref().take(most).read_to_end(&mut bytes).map_err(|e| damaged(&self.path, &e))?;
        // Decoding takes longer than unpacking, and other threads may unpack meanwhile.
        drop(member);
        drop(zip);
        // What ends sooner than it should has no more than there is.
        let there = bytes.len() as u64;
        let size = if there < most || until.is_none() { there } else { size };
        self.read_bytes(bytes, size, options, until.is_some())
    }

    /// Reads the file from its bytes, or from the first ones of `size`.
    fn read_bytes(
        &self,
        mut bytes: Vec<u8>,
        mut size: u64,
        options: OpenFileOptions,
        before_pixels: bool,
    ) -> Result<DefaultDicomObject> {
        if let Some(start) = missing_start(&bytes) {
            size += start.len() as u64;
            bytes.splice(..0, start);
        }
        self.check_lengths(Cursor::new(&bytes), size, before_pixels)?;
        options.from_reader(bytes.as_slice()).map_err(|e| damaged(&self.path, &e))
    }

    fn reserve(&self, size: u64) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let enough = usize::try_from(size).is_ok_and(|size| bytes.try_reserve_exact(size).is_ok());
        if !enough {
            let message = format!("no memory for a file of {size} bytes");
            return Err(Error::new(Kind::HostMemory, "VGS-VOL-010", message).file(&self.path));
        }
        Ok(bytes)
    }

    /// Checks that no element of the file claims more than there is.
    fn check_lengths(&self, mut source: impl Read + Seek, size: u64, before_pixels: bool) -> Result<()> {
        let mut head = [0; MAGIC_AT + 4];
        let is_dicom = source.read_exact(&mut head).is_ok() && has_magic(&head);
        // Files without the magic are the library's to refuse.
        let found = match is_dicom {
            true => too_long(&mut source, head.len() as u64, size, before_pixels),
            false => Ok(None),
        };
        match found {
            Ok(None) => Ok(()),
            Ok(Some(element)) => Err(damaged(&self.path, &element)),
            Err(e) => Err(damaged(&self.path, &e)),
        }
    }
}

/// Returns how many bytes the elements of a deflated file unpack to, up to `most` and one more; 0 for any other
/// file.
fn unpacked_size(mut file: impl Read, most: u64) -> io::Result<u64> {
    // What is missing at the beginning is put there, as the reader does.
    let mut start = Vec::new();
    file.by_ref().take(SNIFF_BYTES as u64).read_to_end(&mut start)?;
    if let Some(missing) = missing_start(&start) {
        start.splice(..0, missing);
    }
    let mut file = Cursor::new(start).chain(file);
    // Magic, then the length of the first group of elements, which is never packed.
    let mut head = [0; MAGIC_AT + 4 + 12];
    file.read_exact(&mut head)?;
    let (tag, length) = head[MAGIC_AT + 4..].split_at(8);
    let length = u64::from(u32::from_le_bytes([length[0], length[1], length[2], length[3]]));
    if !has_magic(&head) || tag != GROUP_LENGTH || length > MOST_META_BYTES {
        return Ok(0);
    }
    let mut meta = Vec::new();
    file.by_ref().take(length).read_to_end(&mut meta)?;
    let is_packed = |name: &str| meta.windows(name.len()).any(|window| window == name.as_bytes());
    if !PACKED.into_iter().any(is_packed) {
        return Ok(0);
    }
    io::copy(&mut DeflateDecoder::new(file).take(most.saturating_add(1)), &mut io::sink())
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
    zip: Mutex<ZipArchive<BufReader<Stream>>>,
}

impl Archive {
    fn lock(&self) -> MutexGuard<'_, ZipArchive<BufReader<Stream>>> {
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
pub(super) fn members(input: &Input, most: usize, options: &ReadOptions) -> Result<(usize, Vec<Location>)> {
    let path = input.name();
    let file = input.open().map_err(|e| Error::io(path, "opening", &e))?;
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
        let read = member.by_ref().take(SNIFF_BYTES as u64).read_to_end(&mut head);
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
