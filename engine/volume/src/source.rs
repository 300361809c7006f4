//! Bytes of an input file, decompressed while reading: gzip is recognised by its magic, whatever the name
//! says.
//!
//! Consecutive members are one stream (as `bgzip` and `pigz` write them). Every checksum is verified by
//! reading to the end, and the bytes after the last member are judged: zeros are padding, anything else is
//! damage.

use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::GzDecoder;

use base::input::{Input, Stream};
use base::{Error, Kind, Result};

/// Number of bytes of a file that are examined to recognise it.
pub const SNIFF_BYTES: usize = 1024;

const GZIP_MAGIC: [u8; 2] = [0x1f, 0x8b];

/// Largest ratio of compression. DEFLATE cannot exceed it, so a larger claim is known to be false before
/// anything is decoded.
pub(super) const MAX_RATIO: u64 = 1032;

/// An open input file, decompressed if it is gzip.
pub(super) struct Source {
    /// Path or name of the file.
    pub path: PathBuf,
    reader: Box<dyn Read>,
    /// True if the file is gzip.
    pub gzip: bool,
    /// Size of the file, bytes.
    pub stored: u64,
    /// Number of decoded bytes read so far.
    pub position: u64,
}

impl Source {
    /// Opens a file; refuses one that is missing, empty, not regular, or gzip inside gzip.
    pub fn open(input: &Input, lenient: bool) -> Result<Self> {
        let path = input.name();
        let file = input.open().map_err(|e| match e.kind() {
            io::ErrorKind::NotFound => Error::new(Kind::Missing, "VGS-VOL-001", "no such file").file(path),
            _ => Error::io(path, "opening", &e),
        })?;
        let stored = file.length;
        let mut file = BufReader::with_capacity(1 << 18, file);
        let head = file.fill_buf().map_err(|e| Error::io(path, "reading", &e))?;
        if head.is_empty() {
            return Err(Error::new(Kind::BadData, "VGS-VOL-003", "the file is empty").file(path));
        }
        let gzip = head.starts_with(&GZIP_MAGIC);
        let mut source =
            Source { path: path.to_owned(), reader: Box::new(io::empty()), gzip, stored, position: 0 };
        if !gzip {
            source.reader = Box::new(file);
            return Ok(source);
        }
        let mut members = Members { decoder: Some(GzDecoder::new(file)), path: path.to_owned(), lenient };
        let mut head = [0; 2];
        let n = read_full(&mut members, &mut head).map_err(|e| source.failed(&e))?;
        if n == 0 {
            let message = "the file is empty (gzip around nothing)";
            return Err(Error::new(Kind::BadData, "VGS-VOL-003", message).file(path));
        }
        if head == GZIP_MAGIC {
            let message = "gzip inside gzip";
            return Err(Error::new(Kind::BadData, "VGS-VOL-004", message)
                .file(path)
                .help("unpack it once (gunzip) and try again"));
        }
        source.reader = Box::new(io::Cursor::new(head[..n].to_vec()).chain(members));
        Ok(source)
    }

    /// Returns true if the name of a file promises gzip.
    pub fn named_gzip(path: &Path) -> bool {
        path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gz"))
    }

    /// Reads as many bytes as there are, at most `buffer.len()`, and returns their number.
    pub fn read_some(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let n = read_full(&mut self.reader, buffer).map_err(|e| self.failed(&e))?;
        self.position += n as u64;
        Ok(n)
    }

    /// Skips up to `count` bytes and returns how many there were.
    pub fn skip(&mut self, count: u64) -> Result<u64> {
        let n =
            io::copy(&mut self.reader.by_ref().take(count), &mut io::sink()).map_err(|e| self.failed(&e))?;
        self.position += n;
        Ok(n)
    }

    /// Refuses, before anything is allocated, `bytes` of decoded content that this file cannot hold or that
    /// exceed `max_bytes`.
    pub fn expect(&self, bytes: u64, max_bytes: u64) -> Result<()> {
        if bytes > max_bytes {
            let message = format!("declares {bytes} bytes, more than the limit of {max_bytes}");
            return Err(Error::new(Kind::BadData, "VGS-VOL-005", message)
                .file(&self.path)
                .help("if the size is right, raise the limit with --max-bytes"));
        }
        if !self.gzip && bytes > self.stored {
            return Err(self.truncated(bytes, self.stored));
        }
        let most = self.stored.saturating_mul(MAX_RATIO);
        if self.gzip && bytes > most {
            let message =
                format!("declares {bytes} bytes, but {} bytes of gzip hold at most {most}", self.stored);
            return Err(Error::new(Kind::BadData, "VGS-VOL-006", message)
                .file(&self.path)
                .help("the header is wrong or the file was cut short"));
        }
        Ok(())
    }

    /// Returns the error for a file that ends after `found` of `expected` bytes.
    pub fn truncated(&self, expected: u64, found: u64) -> Error {
        Error::new(Kind::BadData, "VGS-VOL-006", format!("expected {expected} bytes, got {found}"))
            .file(&self.path)
            .help("the file was cut short; copy it again")
    }

    /// Reads to the end, which verifies the checksums, and returns the number of bytes that were left. Fails
    /// if there are more than `max_bytes` of them.
    pub fn finish(mut self, max_bytes: u64) -> Result<u64> {
        let rest = self.skip(max_bytes.saturating_add(1))?;
        if rest > max_bytes {
            let message = format!("more than {max_bytes} bytes follow the content");
            return Err(Error::new(Kind::BadData, "VGS-VOL-005", message).file(&self.path));
        }
        Ok(rest)
    }

    /// Returns the error of a failed read: damage of the stream is the file's fault (65), anything else the
    /// machine's (74).
    pub fn failed(&self, e: &io::Error) -> Error {
        if e.kind() == io::ErrorKind::UnexpectedEof {
            let message = "damaged gzip data: the file ends inside the compressed data";
            return Error::new(Kind::BadData, "VGS-VOL-008", message)
                .file(&self.path)
                .help("the file was cut short; copy it again");
        }
        if is_damage(e) {
            return Error::new(Kind::BadData, "VGS-VOL-007", format!("damaged gzip data: {e}"))
                .file(&self.path)
                .help("copy the file again, or accept it with --lenient if all of its voxels are there");
        }
        Error::io(&self.path, "reading", e)
    }
}

impl Read for Source {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.reader.read(buffer)?;
        self.position += n as u64;
        Ok(n)
    }
}

/// Returns true if the compressed data are damaged, rather than the machine at fault.
fn is_damage(e: &io::Error) -> bool {
    use io::ErrorKind as E;
    matches!(e.kind(), E::InvalidInput | E::InvalidData | E::UnexpectedEof)
}

/// Fills `buffer` from `reader` as far as the data reach, and returns the number of bytes.
fn read_full(reader: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut n = 0;
    while n < buffer.len() {
        match reader.read(&mut buffer[n..]) {
            Ok(0) => break,
            Ok(k) => n += k,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(n)
}

/// A decoder of consecutive gzip members. flate2's own decoder of several members takes whatever follows for
/// a member and cannot distinguish padding from damage.
struct Members {
    decoder: Option<GzDecoder<BufReader<Stream>>>,
    path: PathBuf,
    lenient: bool,
}

impl Members {
    /// Begins the next member and returns true if there is one. Otherwise returns false and judges the bytes
    /// that follow: zeros are ignored, others are an error unless `lenient`.
    fn next_member(&mut self, mut file: BufReader<Stream>) -> io::Result<bool> {
        // The first byte decides: the second may lie beyond the buffer.
        if file.fill_buf()?.first() == GZIP_MAGIC.first() {
            self.decoder = Some(GzDecoder::new(file));
            return Ok(true);
        }
        let (mut count, mut zeros) = (0, true);
        loop {
            let rest = file.fill_buf()?;
            if rest.is_empty() {
                break;
            }
            zeros &= rest.iter().all(|&b| b == 0);
            let n = rest.len();
            count += n as u64;
            file.consume(n);
        }
        if count > 0 {
            let what = if zeros { "zero bytes" } else { "bytes" };
            if !zeros && !self.lenient {
                let message = format!("{count} {what} follow the gzip data");
                return Err(io::Error::new(io::ErrorKind::InvalidData, message));
            }
            tracing::warn!("{}: {count} {what} after the gzip data are ignored", self.path.display());
        }
        Ok(false)
    }
}

impl Read for Members {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while let Some(decoder) = &mut self.decoder {
            let n = match decoder.read(buffer) {
                Ok(n) => n,
                // Decoded bytes are kept; if voxels are missing, the reader will say so.
                Err(e) if self.lenient && is_damage(&e) => {
                    tracing::warn!("{}: damaged gzip data, accepted: {e}", self.path.display());
                    self.decoder = None;
                    break;
                }
                Err(e) => return Err(e),
            };
            if n > 0 || buffer.is_empty() {
                return Ok(n);
            }
            let file = self.decoder.take().expect("the loop holds a decoder").into_inner();
            if !self.next_member(file)? {
                break;
            }
        }
        Ok(0)
    }
}

/// Returns an empty vector with room for `count` samples.
///
/// # Errors
/// [`Kind::BadData`] if they take more than `max_bytes`, [`Kind::HostMemory`] if there is no memory for them.
pub(super) fn reserve_samples(count: usize, max_bytes: u64) -> Result<Vec<f32>> {
    let bytes = 4 * count as u64;
    if bytes > max_bytes {
        let message = format!("takes {bytes} bytes in memory, more than the limit of {max_bytes}");
        return Err(Error::new(Kind::BadData, "VGS-VOL-005", message)
            .help("if the size is right, raise the limit with --max-bytes, or read a part with --voxels"));
    }
    let mut samples = Vec::new();
    samples.try_reserve_exact(count).map_err(|_| {
        Error::new(Kind::HostMemory, "VGS-VOL-010", format!("no memory for a volume of {bytes} bytes"))
    })?;
    Ok(samples)
}
