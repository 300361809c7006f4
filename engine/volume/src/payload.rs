//! The voxels that follow a header, in the same file or in one beside it: unpacked, bounded and converted to
//! f32.
//!
//! [`Source`] unpacks a file that is gzip as a whole; here a compressed stream begins after a header. The
//! rules are the same: a claimed size is compared with the bytes that are there before memory is allocated, a
//! stream is read to its end so that its checksum is checked, and the bytes after it are judged.

use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use flate2::bufread::GzDecoder;
use flate2::{Decompress, FlushDecompress, Status};

use super::elements::Element;
use super::read_options::ReadOptions;
use super::source::{MAX_RATIO, Source, reserve_samples};
use base::{Error, Kind, Result};

/// Number of voxels that are decoded at a time.
const BLOCK: usize = 65536;
/// The most characters of a number in text.
const MAX_DIGITS: usize = 64;

/// Compression of the voxels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    /// No compression.
    Plain,
    /// Gzip members.
    Gzip,
    /// A zlib stream; gzip is recognised too, since ITK reads both.
    Zlib,
}

/// The positions in a file of the volume that is read.
#[derive(Debug)]
pub(super) struct Layout {
    pub element: &'static Element,
    pub big_endian: bool,
    /// Number of voxels of one volume.
    pub voxels: usize,
    /// Number of volumes in the file.
    pub volumes: usize,
    /// Index of the volume that is read.
    pub chosen: usize,
    /// Number of consecutive values of one volume before those of the next volume.
    run: usize,
    /// Factor of the stored values, and the number that is added after it.
    pub scaling: Option<(f64, f64)>,
}

impl Layout {
    /// Checks sizes and the choice of a volume. `run` is the number of
    /// consecutive values of one volume; it does not matter if there is only one volume.
    pub fn new(
        element: &'static Element,
        big_endian: bool,
        size: [usize; 3],
        (volumes, run): (usize, usize),
        options: &ReadOptions,
    ) -> Result<Layout> {
        let voxels = size.iter().try_fold(1_usize, |n, &d| n.checked_mul(d));
        let all = voxels.and_then(|n| n.checked_mul(volumes)).and_then(|n| n.checked_mul(8));
        let (Some(voxels), Some(_)) = (voxels, all) else {
            let message = format!("{volumes} volumes of {size:?} voxels are more than any memory holds");
            return Err(Error::new(Kind::BadData, "VGS-VOL-005", message)
                .help("the header is damaged: copy the file again"));
        };
        let chosen = match options.volume_index {
            Some(i) if i < volumes => i,
            None if volumes == 1 => 0,
            asked => {
                let message = match asked {
                    Some(i) => format!("there is no volume {i}: the file holds {volumes}"),
                    None => format!("the file holds {volumes} volumes of {size:?} voxels"),
                };
                return Err(Error::new(Kind::Usage, "VGS-VOL-020", message)
                    .help(format!("choose --volume-index 0..{}", volumes.saturating_sub(1))));
            }
        };
        Ok(Layout { element, big_endian, voxels, volumes, chosen, run: run.max(1), scaling: None })
    }

    /// Returns the number of values of all volumes.
    fn numbers(&self) -> u64 {
        (self.voxels * self.volumes) as u64
    }

    /// Returns the size of all volumes in bytes.
    pub fn bytes(&self) -> u64 {
        self.numbers() * self.element.bytes as u64
    }

    /// Returns the place, among all values of the file, of voxel `index` of the volume that is read; `None` if `row`
    /// voxels from there on are not one after the other.
    pub fn place(&self, index: usize, row: usize) -> Option<u64> {
        let (block, at) = (index / self.run, index % self.run);
        (self.volumes == 1 || at + row <= self.run)
            .then(|| ((block * self.volumes + self.chosen) * self.run + at) as u64)
    }

    /// Returns true if value `at` of the file belongs to the volume that is read.
    fn is_wanted(&self, at: u64) -> bool {
        self.volumes == 1 || at / self.run as u64 % self.volumes as u64 == self.chosen as u64
    }

    /// Returns true if none of the `count` values from `at` on belongs to the volume that is read.
    fn is_skipped(&self, at: u64, count: usize) -> bool {
        let last = at + count.saturating_sub(1) as u64;
        at / self.run as u64 == last / self.run as u64 && !self.is_wanted(at)
    }
}

/// A decoder of a zlib stream. Unlike flate2's decoder it distinguishes a stream that ends early from a
/// complete one.
struct Zlib {
    reader: BufReader<Source>,
    state: Decompress,
    ended: bool,
}

impl Read for Zlib {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while !self.ended && !buffer.is_empty() {
            let input = self.reader.fill_buf()?;
            let at_end = input.is_empty();
            let (read, written) = (self.state.total_in(), self.state.total_out());
            let status = self
                .state
                .decompress(input, buffer, FlushDecompress::None)
                .map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))?;
            let read = (self.state.total_in() - read) as usize;
            let written = (self.state.total_out() - written) as usize;
            self.reader.consume(read);
            self.ended = status == Status::StreamEnd;
            if written > 0 {
                return Ok(written);
            }
            if at_end && !self.ended {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            if read == 0 && !self.ended {
                return Err(io::Error::new(io::ErrorKind::InvalidData, "the stream does not go on"));
            }
        }
        Ok(0)
    }
}

enum Bytes {
    Plain(Source),
    Gzip(GzDecoder<BufReader<Source>>),
    Zlib(Zlib),
    /// The compressed data have ended; the reader is at the bytes that follow them.
    Ended(BufReader<Source>),
}

/// The voxels of a file, unpacked.
pub(super) struct Payload {
    path: PathBuf,
    /// The decoder; `None` while it is replaced by that of the next gzip member, and after damage that was
    /// accepted.
    bytes: Option<Bytes>,
    /// Bytes on disk that can hold packed voxels.
    stored: u64,
    lenient: bool,
}

impl Payload {
    /// Creates the payload that begins at the position of `source`.
    pub fn new(source: Source, packing: Packing, lenient: bool) -> Result<Payload> {
        let stored = match source.gzip {
            true => source.stored.saturating_mul(MAX_RATIO),
            false => source.stored.saturating_sub(source.position),
        };
        let mut payload = Payload { path: source.path.clone(), bytes: None, stored, lenient };
        if packing == Packing::Plain {
            payload.bytes = Some(Bytes::Plain(source));
            return Ok(payload);
        }
        let mut reader = BufReader::new(source);
        let first = match reader.fill_buf() {
            Ok(start) => start.first().copied(),
            Err(e) => return Err(reader.get_ref().failed(&e)),
        };
        // The first byte of a zlib stream cannot be that of gzip.
        payload.bytes = Some(match packing {
            Packing::Zlib if first != Some(0x1f) => {
                Bytes::Zlib(Zlib { reader, state: Decompress::new(true), ended: false })
            }
            _ => Bytes::Gzip(GzDecoder::new(reader)),
        });
        Ok(payload)
    }

    /// Returns the path and the byte at which the voxels begin, if they are not compressed.
    pub fn plain(&self) -> Option<(&Path, u64)> {
        match &self.bytes {
            Some(Bytes::Plain(source)) if !source.gzip => Some((&self.path, source.position)),
            _ => None,
        }
    }

    /// Refuses, before anything is allocated, a size of `bytes` that this file cannot hold or that exceeds
    /// `max_bytes`.
    pub fn expect(&self, bytes: u64, max_bytes: u64) -> Result<()> {
        if let Some(Bytes::Plain(source)) = &self.bytes {
            return source.expect(source.position.saturating_add(bytes), max_bytes);
        }
        if bytes > max_bytes {
            let message = format!("declares {bytes} bytes, more than the limit of {max_bytes}");
            return Err(Error::new(Kind::BadData, "VGS-VOL-005", message)
                .file(&self.path)
                .help("if the size is right, raise the limit with --max-bytes"));
        }
        let most = self.stored.saturating_mul(MAX_RATIO);
        if bytes > most {
            let message =
                format!("declares {bytes} bytes, but {} compressed bytes hold at most {most}", self.stored);
            return Err(Error::new(Kind::BadData, "VGS-VOL-006", message)
                .file(&self.path)
                .help("the header is wrong or the file was cut short"));
        }
        Ok(())
    }

    /// Reads as many bytes as there are, at most `buffer.len()`, and returns their number.
    fn read_some(&mut self, buffer: &mut [u8]) -> Result<usize> {
        let mut n = 0;
        while let Some(rest) = buffer.get_mut(n..).filter(|rest| !rest.is_empty()) {
            match self.read_once(rest) {
                Ok(Some(0)) => break,
                Ok(Some(read)) => n += read,
                // The decoder of a member was replaced by that of the next.
                Ok(None) => {}
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                // Decoded bytes are kept; if voxels are missing, the reader will say so.
                Err(e) if self.lenient && is_damage(&e) && !matches!(self.bytes, Some(Bytes::Plain(_))) => {
                    tracing::warn!("{}: damaged compressed voxels, accepted: {e}", self.path.display());
                    self.bytes = None;
                    break;
                }
                Err(e) => return Err(self.failed(&e)),
            }
        }
        Ok(n)
    }

    /// Reads some bytes and returns their number; `None` if another gzip member follows.
    fn read_once(&mut self, buffer: &mut [u8]) -> io::Result<Option<usize>> {
        let n = match &mut self.bytes {
            Some(Bytes::Plain(source)) => source.read(buffer)?,
            Some(Bytes::Gzip(decoder)) => decoder.read(buffer)?,
            Some(Bytes::Zlib(decoder)) => decoder.read(buffer)?,
            Some(Bytes::Ended(_)) | None => 0,
        };
        if n > 0 {
            return Ok(Some(n));
        }
        match self.bytes.take() {
            Some(Bytes::Gzip(decoder)) => {
                let mut reader = decoder.into_inner();
                if reader.fill_buf()?.first() == Some(&0x1f) {
                    self.bytes = Some(Bytes::Gzip(GzDecoder::new(reader)));
                    return Ok(None);
                }
                self.bytes = Some(Bytes::Ended(reader));
            }
            Some(Bytes::Zlib(decoder)) => self.bytes = Some(Bytes::Ended(decoder.reader)),
            other => self.bytes = other,
        }
        Ok(Some(0))
    }

    /// Skips `count` bytes; fails as for a truncated file if there are fewer.
    pub fn skip(&mut self, count: u64) -> Result<()> {
        let mut block = vec![0; BLOCK];
        let mut left = count;
        while left > 0 {
            let wanted = left.min(BLOCK as u64);
            let n = self.read_some(&mut block[..wanted as usize])?;
            left -= n as u64;
            if n == 0 {
                return Err(self.truncated(count, count - left, "bytes before the voxels"));
            }
        }
        Ok(())
    }

    /// Returns the error for voxels that end after `found` of `expected`.
    fn truncated(&self, expected: u64, found: u64, what: &str) -> Error {
        Error::new(Kind::BadData, "VGS-VOL-006", format!("expected {expected} {what}, got {found}"))
            .file(&self.path)
            .help("the header is wrong, or the file was cut short: copy it again")
    }

    /// Returns the error of a failed read: damage of the stream is the file's fault (65), anything else the
    /// machine's (74).
    fn failed(&self, e: &io::Error) -> Error {
        if let Some(Bytes::Plain(source)) = &self.bytes {
            return source.failed(e);
        }
        if e.kind() == io::ErrorKind::UnexpectedEof {
            let message = "damaged compressed voxels: the file ends inside of them";
            return Error::new(Kind::BadData, "VGS-VOL-008", message)
                .file(&self.path)
                .help("the file was cut short; copy it again");
        }
        if is_damage(e) {
            let message = format!("damaged compressed voxels: {e}");
            return Error::new(Kind::BadData, "VGS-VOL-007", message)
                .file(&self.path)
                .help("copy the file again, or accept it with --lenient if all of its voxels are there");
        }
        Error::io(&self.path, "reading", e)
    }

    /// Reads to the end, which verifies the checksums, and judges the bytes after the voxels.
    fn finish(mut self, max_bytes: u64) -> Result<()> {
        let mut extra = 0_u64;
        if !matches!(self.bytes, Some(Bytes::Plain(_))) {
            let mut block = vec![0; BLOCK];
            loop {
                let n = self.read_some(&mut block)?;
                extra += n as u64;
                if n == 0 {
                    break;
                }
                if extra > max_bytes {
                    let message = format!("more than {max_bytes} bytes follow the voxels");
                    return Err(Error::new(Kind::BadData, "VGS-VOL-005", message).file(&self.path));
                }
            }
        }
        match self.bytes.take() {
            Some(Bytes::Plain(source)) => extra = source.finish(max_bytes)?,
            Some(Bytes::Ended(reader)) => self.judge_rest(reader)?,
            _ => {}
        }
        if extra > 0 {
            tracing::warn!("{}: {extra} bytes after the voxels are ignored", self.path.display());
        }
        Ok(())
    }

    /// Ignores zeros after the compressed data as padding and treats anything else as damage.
    fn judge_rest(&self, mut reader: BufReader<Source>) -> Result<()> {
        let (mut count, mut zeros) = (0_u64, true);
        loop {
            let rest = reader.fill_buf().map_err(|e| self.failed(&e))?;
            if rest.is_empty() {
                break;
            }
            zeros &= rest.iter().all(|&b| b == 0);
            let n = rest.len();
            count += n as u64;
            reader.consume(n);
        }
        let what = if zeros { "zero bytes" } else { "bytes" };
        if !zeros && !self.lenient {
            let message = format!("{count} {what} follow the compressed voxels");
            return Err(Error::new(Kind::BadData, "VGS-VOL-007", message)
                .file(&self.path)
                .help("copy the file again, or accept it with --lenient"));
        }
        if count > 0 {
            let path = self.path.display();
            tracing::warn!("{path}: {count} {what} after the compressed voxels are ignored");
        }
        Ok(())
    }

    /// Reads the samples of one volume, x fastest.
    pub fn samples(self, layout: &Layout, is_text: bool, options: &ReadOptions) -> Result<Vec<f32>> {
        self.expect_numbers(layout, is_text, options)?;
        let mut samples = reserve_samples(layout.voxels, options.max_bytes)?;
        self.each(layout, is_text, options, |sample| samples.push(sample))?;
        Ok(samples)
    }

    fn expect_numbers(&self, layout: &Layout, is_text: bool, options: &ReadOptions) -> Result<()> {
        // In text a number needs a digit, and a space before the next one.
        let least = if is_text { (2 * layout.numbers()).saturating_sub(1) } else { layout.bytes() };
        self.expect(least, options.max_bytes)
    }

    /// Passes the samples of one volume to `each`, in the order of the file.
    pub fn each(
        mut self,
        layout: &Layout,
        is_text: bool,
        options: &ReadOptions,
        each: impl FnMut(f32),
    ) -> Result<()> {
        self.expect_numbers(layout, is_text, options)?;
        let mut sieve = Sieve { layout, at: 0, taken: Taken::new(layout, each) };
        let read = match is_text {
            true => self.read_text(&mut sieve),
            false => self.read_binary(&mut sieve),
        };
        read?;
        sieve.taken.warn_of_precision(&self.path);
        self.finish(options.max_bytes)
    }

    fn read_binary(&mut self, sieve: &mut Sieve<impl FnMut(f32)>) -> Result<()> {
        let layout = sieve.layout;
        let width = layout.element.bytes;
        let mut block = vec![0; layout.numbers().min(BLOCK as u64) as usize * width];
        while sieve.at < layout.numbers() {
            let count = (layout.numbers() - sieve.at).min(BLOCK as u64) as usize;
            let wanted = &mut block[..count * width];
            let n = self.read_some(wanted)?;
            if n < wanted.len() {
                let found = sieve.at * width as u64 + n as u64;
                return Err(self.truncated(layout.bytes(), found, "bytes of voxels"));
            }
            if layout.is_skipped(sieve.at, count) {
                sieve.at += count as u64;
                continue;
            }
            (layout.element.decode)(wanted, layout.big_endian, &mut |stored| sieve.take(stored));
            sieve.taken.check().map_err(|e| e.file(&self.path))?;
        }
        Ok(())
    }

    /// Reads numbers as text, with white space or commas between them.
    fn read_text(&mut self, sieve: &mut Sieve<impl FnMut(f32)>) -> Result<()> {
        let layout = sieve.layout;
        let mut block = vec![0; BLOCK];
        let mut word = Vec::new();
        let mut extra = 0_u64;
        loop {
            let n = self.read_some(&mut block)?;
            // One separator after the last byte, so that the last number is complete.
            let bytes = block.iter().take(n).copied().chain((n == 0).then_some(b' '));
            for byte in bytes {
                if !(byte.is_ascii_whitespace() || byte == b',') {
                    if word.len() < MAX_DIGITS {
                        word.push(byte);
                    }
                    continue;
                }
                if word.is_empty() {
                    continue;
                }
                if sieve.at == layout.numbers() {
                    extra += 1;
                } else {
                    let text = String::from_utf8_lossy(&word);
                    let Some(number) = text.parse().ok().filter(|_| word.len() < MAX_DIGITS) else {
                        let message = format!("number {} is '{}'", sieve.at, text.escape_default());
                        return Err(Error::new(Kind::BadData, "VGS-VOL-021", message)
                            .file(&self.path)
                            .help("numbers with spaces between them are needed, such as -1024 or 0.5"));
                    };
                    sieve.take(number);
                }
                word.clear();
            }
            sieve.taken.check().map_err(|e| e.file(&self.path))?;
            if n == 0 {
                break;
            }
        }
        if sieve.at < layout.numbers() {
            return Err(self.truncated(layout.numbers(), sieve.at, "numbers"));
        }
        if extra > 0 {
            tracing::warn!("{}: {extra} numbers after the voxels are ignored", self.path.display());
        }
        Ok(())
    }
}

/// Takes the values of a file one by one and keeps those of the volume that is read.
struct Sieve<'a, F> {
    layout: &'a Layout,
    /// Number of values taken.
    at: u64,
    taken: Taken<'a, F>,
}

impl<F: FnMut(f32)> Sieve<'_, F> {
    fn take(&mut self, stored: f64) {
        if self.layout.is_wanted(self.at) {
            self.taken.take(stored);
        }
        self.at += 1;
    }
}

/// Makes samples of stored values and passes them to `each`.
pub(super) struct Taken<'a, F> {
    layout: &'a Layout,
    each: F,
    /// Number of values.
    count: usize,
    inexact: usize,
    /// The first voxel that is too large, and its value.
    overflow: Option<(usize, f64)>,
}

impl<'a, F: FnMut(f32)> Taken<'a, F> {
    pub fn new(layout: &'a Layout, each: F) -> Self {
        Taken { layout, each, count: 0, inexact: 0, overflow: None }
    }

    pub fn take(&mut self, stored: f64) {
        let value = self.layout.scaling.map_or(stored, |(slope, inter)| slope * stored + inter);
        let sample = value as f32;
        self.inexact += usize::from(self.layout.element.wide_integer && f64::from(stored as f32) != stored);
        if sample.is_infinite() && stored.is_finite() && self.overflow.is_none() {
            self.overflow = Some((self.count, value));
        }
        self.count += 1;
        (self.each)(sample);
    }

    /// Refuses values that no sample holds.
    pub fn check(&self) -> Result<()> {
        let Some((index, value)) = self.overflow else { return Ok(()) };
        let message = format!("voxel {index} is {value:e}, beyond the range of 32-bit real numbers");
        Err(Error::new(Kind::BadData, "VGS-VOL-022", message)
            .help("such values are no HU: clip or rescale the volume first"))
    }

    pub fn warn_of_precision(&self, path: &Path) {
        if self.inexact > 0 {
            let (path, inexact, name) = (path.display(), self.inexact, self.layout.element.name);
            tracing::warn!("{path}: {inexact} {name} values lose precision as 32-bit real numbers");
        }
    }
}

/// Returns true if the compressed data are damaged, rather than the machine at fault.
fn is_damage(e: &io::Error) -> bool {
    use io::ErrorKind as E;
    matches!(e.kind(), E::InvalidInput | E::InvalidData | E::UnexpectedEof)
}
