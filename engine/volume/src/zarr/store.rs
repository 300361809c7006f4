//! The files of a store: a folder, or the members of a zip.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use zarrs::storage::byte_range::ByteRangeIterator;
use zarrs::storage::{
    Bytes, MaybeBytesIterator, OffsetBytesIterator, ReadableStorageTraits, StorageError, StoreKey,
    StorePrefix, WritableStorageTraits,
};
use zip::ZipArchive;

use crate::ReadOptions;
use base::input::{Input, Stream, open};
use base::{Error, Kind, Result};

/// Names of the files that say what a node of a store is.
const NODES: [&str; 4] = ["zarr.json", ".zattrs", ".zgroup", ".zarray"];
/// The largest file of attributes that is read.
const MAX_ATTRIBUTES: u64 = 16 << 20;
/// Bytes that a damaged claim of a stream may exceed those of its chunk by: of an empty one, and of blocks half full.
const CLAIM: u64 = 1 << 20;

/// Returns the error for what is wrong with a store.
pub(super) fn bad(code: &'static str, message: impl Into<String>) -> Error {
    Error::new(Kind::BadData, code, message)
}

/// Returns true if a folder is a node of a store.
pub(crate) fn is_store(folder: &Path) -> bool {
    NODES.iter().any(|name| folder.join(name).is_file())
}

/// Returns true if a file is a zip whose first member is of a store.
pub(crate) fn sniff(head: &[u8]) -> bool {
    let Some([low, high]) = head.get(26..28).filter(|_| head.starts_with(b"PK\x03\x04")) else {
        return false;
    };
    let length = usize::from(u16::from_le_bytes([*low, *high]));
    let name = String::from_utf8_lossy(head.get(30..30 + length).unwrap_or_default()).into_owned();
    let mut parts = name.split('/');
    parts.any(|part| NODES.contains(&part) || part.ends_with(".zarr"))
}

enum Place {
    Folder(PathBuf),
    /// With what stands before the names of the members.
    Zip(Box<Mutex<ZipArchive<Stream>>>, String),
}

/// An open store.
pub(super) struct Store {
    place: Place,
    /// The most bytes of a chunk that is not compressed.
    chunk_bytes: AtomicU64,
}

impl Store {
    pub fn open(input: &Input, options: &ReadOptions) -> Result<Store> {
        let chunk_bytes = AtomicU64::new(options.max_bytes);
        if let Some(folder) = input.path().filter(|path| path.is_dir()) {
            return Ok(Store { place: Place::Folder(folder.to_owned()), chunk_bytes });
        }
        let stream = input.open().map_err(|e| match e.kind() {
            io::ErrorKind::NotFound => {
                Error::new(Kind::Missing, "VGS-VOL-001", "no such file").file(input.name())
            }
            _ => Error::io(input.name(), "opening", &e),
        })?;
        let damaged = |e| bad("VGS-ZAR-002", format!("a damaged zip: {e}")).help("copy the file again");
        let archive = ZipArchive::new(stream).map_err(damaged)?;
        // The image is at the top, or in the folder that was packed.
        let of_nodes =
            archive.file_names().flatten().filter(|name| NODES.iter().any(|node| name.ends_with(node)));
        let top = of_nodes.min_by_key(|name| (name.matches('/').count(), name.len())).unwrap_or_default();
        let prefix = top.rsplit_once('/').map(|(folder, _)| format!("{folder}/")).unwrap_or_default();
        Ok(Store { place: Place::Zip(Box::new(Mutex::new(archive)), prefix), chunk_bytes })
    }

    /// Creates a store that is written to a folder.
    pub fn in_folder(folder: &Path) -> Store {
        Store { place: Place::Folder(folder.to_owned()), chunk_bytes: AtomicU64::new(u64::MAX) }
    }

    /// Returns true if nothing has this key; false if that cannot be told.
    pub fn is_missing(&self, key: &StoreKey) -> bool {
        match &self.place {
            Place::Folder(folder) => {
                let found = fs::metadata(folder.join(key.as_str()));
                found.is_err_and(|e| e.kind() == std::io::ErrorKind::NotFound)
            }
            Place::Zip(archive, prefix) => {
                let mut archive = archive.lock().unwrap_or_else(PoisonError::into_inner);
                let found = archive.by_name(&format!("{prefix}{key}"));
                matches!(found, Err(zip::result::ZipError::FileNotFound))
            }
        }
    }

    /// Sets the most bytes of a chunk.
    pub fn expect_chunks_of(&self, bytes: u64) {
        self.chunk_bytes.store(bytes, Ordering::Relaxed);
    }

    /// Returns the paths of the nodes below the top.
    pub fn groups(&self) -> Vec<String> {
        match &self.place {
            Place::Folder(folder) => {
                let mut found = Vec::new();
                let folders = |path: &Path| {
                    let entries = fs::read_dir(path).into_iter().flatten().flatten().map(|e| e.path());
                    entries.filter(|path| is_store(path)).collect::<Vec<_>>()
                };
                for path in folders(folder) {
                    found.extend(folders(&path).into_iter().chain([path]));
                }
                let names = found.iter().filter_map(|path| path.strip_prefix(folder).ok());
                names
                    .map(|name| name.to_string_lossy().into_owned())
                    .collect::<BTreeSet<_>>()
                    .into_iter()
                    .collect()
            }
            Place::Zip(..) => Vec::new(),
        }
    }

    /// Returns the parts of a value that are asked for, by their first byte and their number; `None` if there is none.
    fn read(&self, key: &StoreKey, parts: ByteRangeIterator<'_>) -> io::Result<Option<Vec<Vec<u8>>>> {
        let is_node = NODES.iter().any(|name| key.as_str().ends_with(name));
        let chunk_bytes = self.chunk_bytes.load(Ordering::Relaxed);
        // What cannot be compressed becomes a little larger.
        let most = if is_node { MAX_ATTRIBUTES } else { chunk_bytes.saturating_mul(2).saturating_add(CLAIM) };
        let too_large = |bytes: u64| {
            io::Error::other(format!("{key} has {bytes} bytes; no more than {most} can be of use"))
        };
        let damaged = |e: zip::result::ZipError| io::Error::new(io::ErrorKind::InvalidData, e);
        let mut values = Vec::new();
        match &self.place {
            Place::Folder(folder) => {
                let mut file = match open(folder.join(key.as_str())) {
                    Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
                    file => file?,
                };
                let length = file.metadata()?.len();
                for part in parts {
                    let range = part.start(length)..part.end(length);
                    let bytes = range.end.checked_sub(range.start).filter(|_| range.end <= length);
                    let bytes = bytes.ok_or(io::ErrorKind::UnexpectedEof)?;
                    if bytes > most {
                        return Err(too_large(bytes));
                    }
                    let mut value = vec![0; bytes as usize];
                    file.seek(SeekFrom::Start(range.start))?;
                    file.read_exact(&mut value)?;
                    values.push(value);
                }
            }
            Place::Zip(archive, prefix) => {
                let mut archive = archive.lock().unwrap_or_else(PoisonError::into_inner);
                let member = match archive.by_name(&format!("{prefix}{key}")) {
                    Err(zip::result::ZipError::FileNotFound) => return Ok(None),
                    member => member.map_err(damaged)?,
                };
                let mut value = Vec::new();
                member.take(most.saturating_add(1)).read_to_end(&mut value)?;
                let length = value.len() as u64;
                if length > most {
                    return Err(too_large(length));
                }
                for part in parts {
                    let range = part.start(length) as usize..part.end(length) as usize;
                    values.push(value.get(range).ok_or(io::ErrorKind::UnexpectedEof)?.to_vec());
                }
            }
        }
        for value in values.iter().filter(|_| !is_node) {
            let claim = zstd::bulk::Decompressor::upper_bound(value).unwrap_or(0) as u64;
            let most = chunk_bytes.saturating_mul(64).saturating_add(CLAIM);
            if value.starts_with(&[0x28, 0xb5, 0x2f, 0xfd]) && claim > most {
                let message = format!("{key} claims {claim} bytes; its chunk has {chunk_bytes}");
                return Err(io::Error::other(message));
            }
        }
        Ok(Some(values))
    }

    fn path(&self, key: &str) -> std::result::Result<PathBuf, StorageError> {
        match &self.place {
            Place::Folder(folder) => Ok(folder.join(key)),
            Place::Zip(..) => Err(StorageError::ReadOnly),
        }
    }
}

impl ReadableStorageTraits for Store {
    fn get_partial_many<'a>(
        &'a self,
        key: &StoreKey,
        byte_ranges: ByteRangeIterator<'a>,
    ) -> std::result::Result<MaybeBytesIterator<'a>, StorageError> {
        let values = self.read(key, byte_ranges).map_err(|e| StorageError::IOError(Arc::new(e)))?;
        Ok(values.map(|values| -> Box<dyn Iterator<Item = _>> {
            Box::new(values.into_iter().map(|value| Ok(Bytes::from(value))))
        }))
    }

    fn size_key(&self, key: &StoreKey) -> std::result::Result<Option<u64>, StorageError> {
        match &self.place {
            Place::Folder(folder) => {
                Ok(fs::metadata(folder.join(key.as_str())).ok().map(|found| found.len()))
            }
            Place::Zip(archive, prefix) => {
                let mut archive = archive.lock().unwrap_or_else(PoisonError::into_inner);
                Ok(archive.by_name(&format!("{prefix}{key}")).ok().map(|member| member.size()))
            }
        }
    }

    fn supports_get_partial(&self) -> bool {
        matches!(self.place, Place::Folder(_))
    }
}

impl WritableStorageTraits for Store {
    fn set(&self, key: &StoreKey, value: Bytes) -> std::result::Result<(), StorageError> {
        let path = self.path(key.as_str())?;
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder)?;
        }
        Ok(fs::write(path, value)?)
    }

    fn set_partial_many(
        &self,
        _: &StoreKey,
        _: OffsetBytesIterator,
    ) -> std::result::Result<(), StorageError> {
        Err(StorageError::Unsupported("chunks are written whole".into()))
    }

    fn erase(&self, key: &StoreKey) -> std::result::Result<(), StorageError> {
        match fs::remove_file(self.path(key.as_str())?) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => Err(e.into()),
            _ => Ok(()),
        }
    }

    fn erase_prefix(&self, _: &StorePrefix) -> std::result::Result<(), StorageError> {
        Err(StorageError::Unsupported("nodes are written once".into()))
    }

    fn supports_set_partial(&self) -> bool {
        false
    }
}
