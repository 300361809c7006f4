//! The SPZ reader.

use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::vec;

use flate2::bufread::GzDecoder;
use glam::{DMat3, DVec3};
use half::f16;
use ruzstd::decoding::StreamingDecoder;

use super::{AXES, COLOUR_STEPS, FIT, HAS_EXTENSIONS, MARK, ZSTD_HEADER};
use crate::activation::Activations;
use crate::harmonics::{MAX_DEGREE, basis_count};
use crate::mend::{Mended, reserve, zeros};
use crate::ordinary;
use crate::{Harmonics, ReadOptions, Splat, SplatSet, Summary, Unplaced, ply, vgs};
use base::error::{Error, Kind, Result};
use base::input::Input;
use base::memory;

/// Versions that are read: of one gzip stream, and of zstd streams.
const GZIP_VERSIONS: std::ops::RangeInclusive<u32> = 1..=3;
const ZSTD_VERSION: u32 = 4;
/// The first version whose rotations have their three smallest numbers.
const SMALLEST_THREE: u32 = 3;
/// Greatest degree of the harmonics of a file; those beyond [`MAX_DEGREE`] are left out.
const FILE_DEGREE: u8 = 4;
/// Extensions by their numbers: the axes of the file, and how near a camera may come, which changes no splat.
const COORDINATE_SYSTEM: u32 = 0xADBE_0003;
const SAFE_ORBIT_CAMERA: u32 = 0xADBE_0002;
/// The axes that a file may name by number, from 1 on: the directions of its x, y and z, as right, up, back.
const SYSTEMS: [&[u8; 3]; 16] = [
    b"LDB", b"RDB", b"LUB", b"RUB", b"LDF", b"RDF", b"LUF", b"RUF", b"LFD", b"RFD", b"LFU", b"RFU", b"LBD",
    b"RBD", b"LBU", b"RBU",
];
/// Bytes that are unpacked at a time.
const BLOCK: usize = 64 * 1024;
/// Splats for which there is room at first; more room is made as splats are found.
const FIRST_ROOM: usize = 64 * 1024;

/// Returns true if a file begins so: with the mark, or with a gzip stream that does.
pub fn sniff(start: &[u8]) -> bool {
    let mut first = [0; MARK.len()];
    start.starts_with(MARK) || GzDecoder::new(start).read_exact(&mut first).is_ok() && first == *MARK
}

/// Reads the fit where the file has one, and else a set with colours.
pub fn read(input: &Input, options: &ReadOptions) -> Result<Unplaced> {
    match load(input, options)?.content {
        Content::Colours(set, _) => Ok(Unplaced { path: input.name().to_owned(), set: *set, rows: None }),
        Content::Fit(fit) => vgs::read(&fit, options).map_err(of_fit),
    }
}

/// Reads as [`read`] does and describes what the file holds.
pub fn describe(input: &Input, options: &ReadOptions) -> Result<Summary> {
    let Loaded { content, header, bytes } = load(input, options)?;
    let packing = if header.version == ZSTD_VERSION { "zstd" } else { "gzip" };
    let encoding = format!("version {}, {packing}", header.version);
    let count = header.count as u64;
    match content {
        Content::Colours(set, mended) => Ok(Summary {
            encoding,
            dropped: mended.dropped,
            widened: mended.widened,
            elements: vec![("splat".to_owned(), count)],
            properties: ["position", "alpha", "color", "scale", "rotation", "sh"].map(str::to_owned).to_vec(),
            ..Summary::of_set(&set, "spz", ply::ORDINARY, bytes)
        }),
        Content::Fit(fit) => {
            let mut of = vgs::describe(&fit, options).map_err(of_fit)?;
            of.elements.push(("splat with colours".to_owned(), count));
            let encoding = format!("{encoding}, beside colours a .vgs of {}", of.encoding);
            Ok(Summary { format: "spz", encoding, file_bytes: bytes, ..of })
        }
    }
}

struct Loaded {
    content: Content,
    header: Header,
    /// Size of the file.
    bytes: u64,
}

enum Content {
    Colours(Box<SplatSet>, Mended),
    /// The `.vgs` of the fit, under the name of the file.
    Fit(Input),
}

fn load(input: &Input, options: &ReadOptions) -> Result<Loaded> {
    let path = input.name();
    let failed = |error| Error::io(path, "reading a splat file", &error);
    let file = input.open().map_err(failed)?;
    let bytes = file.length;
    let mut source = BufReader::new(file);
    let zstd = source.fill_buf().map_err(failed)?.starts_with(MARK);
    let loaded = if zstd { of_zstd(source, options) } else { of_gzip(source, options) };
    let (mut set, header, Records { axes, fit }) = loaded.map_err(|error| error.file(path))?;
    if let Some(fit) = fit {
        let content = Content::Fit(Input::of(Cursor::new(fit), path));
        return Ok(Loaded { content, header, bytes });
    }
    ordinary::into_world(&mut set, &axes.transpose());
    let mended = ordinary::finished(&mut set, options.strict).map_err(|error| error.file(path))?;
    mended.tell(path, &set);
    Ok(Loaded { content: Content::Colours(Box::new(set), mended), header, bytes })
}

/// Says of an error of the fit that it is one.
fn of_fit(error: Error) -> Error {
    if error.kind != Kind::BadData {
        return error;
    }
    let message = format!("the fit beside the colours: {}", error.message);
    let told = Error::new(Kind::BadData, "VGS-SPZ-006", message).help(error.help);
    Error { file: error.file, ..told }
}

fn damaged(what: impl Into<String>) -> Error {
    Error::new(Kind::BadData, "VGS-SPZ-001", what)
        .help("the file is damaged or cut off: get it again from where it was made")
}

/// Turns an error of a decoder or of the end of a file into one of the file.
fn broken(error: &io::Error) -> Error {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => damaged("the file ended before its last splat"),
        _ => damaged(format!("the splats cannot be unpacked: {error}")),
    }
}

/// The header of a file.
struct Header {
    version: u32,
    count: usize,
    degree: u8,
    fraction_bits: u8,
    flags: u8,
}

impl Header {
    /// Reads the 16 bytes that all versions have, and returns the last of them besides.
    fn read(source: &mut impl Read, options: &ReadOptions) -> Result<(Self, u8)> {
        let mut bytes = [0; 16];
        source.read_exact(&mut bytes).map_err(|error| broken(&error))?;
        let [m0, m1, m2, m3, v0, v1, v2, v3, c0, c1, c2, c3, degree, fraction_bits, flags, last] = bytes;
        if [m0, m1, m2, m3] != *MARK {
            return Err(damaged("what is packed does not begin with NGSP"));
        }
        let (version, count) = (u32::from_le_bytes([v0, v1, v2, v3]), u32::from_le_bytes([c0, c1, c2, c3]));
        if u64::from(count) > options.max_splats {
            let message = format!("{count} splats, at most {} are allowed", options.max_splats);
            return Err(
                Error::new(Kind::BadData, "VGS-SPZ-003", message).help("divide the file into smaller ones")
            );
        }
        let header = Header { version, count: count as usize, degree, fraction_bits, flags };
        // What a later version has there is not known.
        if !(1..=ZSTD_VERSION).contains(&version) {
            return Err(header.refuse_version());
        }
        if degree > FILE_DEGREE {
            return Err(damaged(format!("harmonics of degree {degree}, {FILE_DEGREE} is the highest")));
        }
        if version > 1 && fraction_bits > 24 {
            return Err(damaged(format!("{fraction_bits} bits behind the point of a coordinate of 24 bits")));
        }
        // Colours are there twice while they are turned.
        let floats = 2 * 3 * basis_count(degree.min(MAX_DEGREE)) as u64;
        memory::require(
            u64::from(count) * (size_of::<Splat>() as u64 + 4 * floats),
            &format!("{count} splats"),
        )?;
        Ok((header, last))
    }

    fn refuse_version(&self) -> Error {
        let message = format!("version {} of SPZ, and versions 1 to {ZSTD_VERSION} are read", self.version);
        Error::new(Kind::BadData, "VGS-SPZ-002", message).help(ply::convert_help("spz"))
    }
}

/// What a file holds: splats in metres along its axes, its header, and its records. Of version 4, the splats beside a fit
/// are not unpacked, and the set is empty.
type Found = (SplatSet, Header, Records);

fn of_gzip(source: impl BufRead, options: &ReadOptions) -> Result<Found> {
    let mut stream = GzDecoder::new(source);
    let (header, _) = Header::read(&mut stream, options)?;
    if !GZIP_VERSIONS.contains(&header.version) {
        return Err(header.refuse_version());
    }
    let mut sections = Sections::Gzip(Box::new(stream));
    let set = splats(&mut sections, &header)?;
    let Sections::Gzip(mut stream) = sections else { return Err(damaged("no gzip stream")) };
    let records = Records::read(&mut stream, &header)?;
    let extra = io::copy(&mut stream, &mut io::sink()).map_err(|error| broken(&error))?;
    if extra > 0 && options.strict {
        return Err(damaged(format!("{extra} bytes follow the last splat")));
    }
    Ok((set, header, records))
}

fn of_zstd(mut source: impl BufRead, options: &ReadOptions) -> Result<Found> {
    let (header, streams) = Header::read(&mut source, options)?;
    if header.version != ZSTD_VERSION {
        return Err(header.refuse_version());
    }
    let mut rest = [0; ZSTD_HEADER as usize - 16];
    source.read_exact(&mut rest).map_err(|error| broken(&error))?;
    let [o0, o1, o2, o3, ..] = rest;
    let Some(records) = u32::from_le_bytes([o0, o1, o2, o3]).checked_sub(ZSTD_HEADER) else {
        return Err(damaged("the table of sizes begins within the header"));
    };
    let mut zone = source.by_ref().take(u64::from(records));
    let records = Records::read(&mut zone, &header)?;
    io::copy(&mut zone, &mut io::sink()).map_err(|error| broken(&error))?;
    if zone.limit() > 0 {
        return Err(damaged("the file ended before its table of sizes"));
    }
    let mut sizes = Vec::new();
    for _ in 0..streams {
        let mut row = [0; 16];
        source.read_exact(&mut row).map_err(|error| broken(&error))?;
        let (packed, whole) = row.split_at(8);
        let size = |bytes: &[u8]| bytes.iter().rev().fold(0u64, |size, &b| size << 8 | u64::from(b));
        sizes.push([size(packed), size(whole)]);
    }
    if records.fit.is_some() {
        let packed = sizes.iter().fold(0u64, |sum, [packed, _]| sum.saturating_add(*packed));
        let found = io::copy(&mut source.take(packed), &mut io::sink()).map_err(|error| broken(&error))?;
        if found < packed {
            return Err(damaged("the file ended within its colours"));
        }
        return Ok((SplatSet::default(), header, records));
    }
    let mut sections = Sections::Zstd { source, sizes: sizes.into_iter() };
    let set = splats(&mut sections, &header)?;
    match sections {
        Sections::Zstd { sizes, .. } if sizes.len() > 0 => {
            Err(damaged("the file has more streams than known"))
        }
        _ => Ok((set, header, records)),
    }
}

/// The records of extensions of a file, as far as they are known.
struct Records {
    /// The rotation from RAS to the axes of the file.
    axes: DMat3,
    /// The bytes of a `.vgs`.
    fit: Option<Vec<u8>>,
}

impl Records {
    /// Reads the records to the end of `zone`, if the header says that there are any.
    fn read(zone: &mut impl Read, header: &Header) -> Result<Self> {
        let mut records = Records { axes: AXES, fit: None };
        if header.flags & HAS_EXTENSIONS == 0 {
            return Ok(records);
        }
        loop {
            let mut head = [0; 8];
            if zone.read(&mut head[..1]).map_err(|error| broken(&error))? == 0 {
                return Ok(records);
            }
            zone.read_exact(&mut head[1..]).map_err(|error| broken(&error))?;
            let [t0, t1, t2, t3, l0, l1, l2, l3] = head;
            let (kind, length) = (u32::from_le_bytes([t0, t1, t2, t3]), u32::from_le_bytes([l0, l1, l2, l3]));
            let mut content = zone.by_ref().take(u64::from(length));
            match kind {
                COORDINATE_SYSTEM => {
                    let mut number = [0; 4];
                    content.read_exact(&mut number).map_err(|error| broken(&error))?;
                    records.axes = axes_of(u32::from_le_bytes(number))?;
                }
                SAFE_ORBIT_CAMERA => {}
                FIT => {
                    memory::require(u64::from(length), "the fit beside the colours")?;
                    let mut fit = Vec::new();
                    content.read_to_end(&mut fit).map_err(|error| broken(&error))?;
                    if records.fit.replace(fit).is_some() {
                        return Err(damaged("two fits beside the colours, and one is written"));
                    }
                }
                _ => tracing::warn!("an extension of an SPZ file was skipped: {kind:#010x}, {length} bytes"),
            }
            io::copy(&mut content, &mut io::sink()).map_err(|error| broken(&error))?;
            if content.limit() > 0 {
                return Err(damaged("the file ended within the record of an extension"));
            }
        }
    }
}

/// Returns the rotation from RAS to the axes that a file names by a number; 0 stands for those of the format.
fn axes_of(number: u32) -> Result<DMat3> {
    let Some(index) = number.checked_sub(1) else { return Ok(AXES) };
    let Some(&letters) = SYSTEMS.get(index as usize) else {
        return Err(damaged(format!("axes of the number {number}, and there are {}", SYSTEMS.len())));
    };
    let direction = |letter: u8| match letter {
        b'R' => DVec3::X,
        b'L' => DVec3::NEG_X,
        b'F' => DVec3::Y,
        b'B' => DVec3::NEG_Y,
        b'U' => DVec3::Z,
        _ => DVec3::NEG_Z,
    };
    let [x, y, z] = letters.map(direction);
    Ok(DMat3::from_cols(x, y, z).transpose())
}

/// The sections of a file, one after the other.
enum Sections<R: BufRead> {
    /// All in one stream.
    Gzip(Box<GzDecoder<R>>),
    /// A stream for each, with the bytes that it takes packed and unpacked.
    Zstd { source: R, sizes: vec::IntoIter<[u64; 2]> },
}

impl<R: BufRead> Sections<R> {
    /// Passes the next section to `each`, `count` rows of `width` bytes; there is no section without bytes.
    fn rows(
        &mut self,
        count: usize,
        width: usize,
        each: impl FnMut(usize, &[u8]) -> Result<()>,
    ) -> Result<()> {
        let bytes = count as u64 * width as u64;
        if bytes == 0 {
            return Ok(());
        }
        match self {
            Sections::Gzip(stream) => rows_of(stream, count, width, each),
            Sections::Zstd { source, sizes } => {
                let [packed, whole] = sizes.next().ok_or_else(|| damaged("a stream of splats is missing"))?;
                if whole != bytes {
                    let what = format!("a stream of {whole} bytes for {count} splats of {width} bytes");
                    return Err(damaged(what));
                }
                let mut part = source.take(packed);
                let mut stream = StreamingDecoder::new(&mut part)
                    .map_err(|error| damaged(format!("the splats cannot be unpacked: {error}")))?;
                rows_of(&mut stream, count, width, each)?;
                if stream.read(&mut [0]).map_err(|error| broken(&error))? > 0 {
                    return Err(damaged("a stream is longer than its splats"));
                }
                drop(stream);
                io::copy(&mut part, &mut io::sink()).map_err(|error| broken(&error))?;
                if part.limit() > 0 { Err(damaged("the file ended within a stream")) } else { Ok(()) }
            }
        }
    }
}

fn rows_of(
    stream: &mut impl Read,
    count: usize,
    width: usize,
    mut each: impl FnMut(usize, &[u8]) -> Result<()>,
) -> Result<()> {
    let rows = (BLOCK / width).clamp(1, count);
    let mut block = vec![0; rows * width];
    for first in (0..count).step_by(rows) {
        let block = &mut block[..rows.min(count - first) * width];
        stream.read_exact(block).map_err(|error| broken(&error))?;
        for (i, row) in block.chunks_exact(width).enumerate() {
            each(first + i, row)?;
        }
    }
    Ok(())
}

/// Reads all sections.
fn splats<R: BufRead>(sections: &mut Sections<R>, header: &Header) -> Result<SplatSet> {
    let &Header { version, count, degree, fraction_bits, .. } = header;
    let step = (-f64::from(fraction_bits)).exp2();
    let mut splats: Vec<Splat> = Vec::new();
    let mut place = |place: [f64; 3]| {
        if splats.len() == splats.capacity() {
            // A header may claim more than there is.
            let more = splats.len().max(FIRST_ROOM).min(count - splats.len());
            reserve(&mut splats, more)?;
        }
        splats.push(Splat { mean: place.map(|v| v as f32), ..Splat::default() });
        Ok(())
    };
    if version == 1 {
        sections.rows(count, 6, |_, row| {
            place([0, 2, 4].map(|at| f64::from(f16::from_le_bytes([row[at], row[at + 1]]))))
        })?;
    } else {
        let number = |b: &[u8]| f64::from(i32::from_le_bytes([0, b[0], b[1], b[2]]) >> 8) * step;
        sections.rows(count, 9, |_, row| place([0, 3, 6].map(|at| number(&row[at..]))))?;
    }
    sections.rows(count, 1, |i, row| {
        splats[i].set_opacity(f32::from(row[0]) / 255.0);
        Ok(())
    })?;
    let kept = degree.min(MAX_DEGREE);
    let stride = 3 * basis_count(kept);
    let mut coefficients = zeros::<f32>(count.saturating_mul(stride))?;
    sections.rows(count, 3, |i, row| {
        for (to, &byte) in coefficients[i * stride..].iter_mut().zip(row) {
            *to = (f32::from(byte) - 127.5) / COLOUR_STEPS;
        }
        Ok(())
    })?;
    sections.rows(count, 3, |i, row| {
        splats[i].log_scale = [0, 1, 2].map(|k| f32::from(row[k]) / 16.0 - 10.0);
        Ok(())
    })?;
    if version < SMALLEST_THREE {
        sections.rows(count, 3, |i, row| {
            let [x, y, z] = [0, 1, 2].map(|k| f32::from(row[k]) / 127.5 - 1.0);
            splats[i].rotation = [(1.0 - x * x - y * y - z * z).max(0.0).sqrt(), x, y, z];
            Ok(())
        })?;
    } else {
        sections.rows(count, 4, |i, row| {
            splats[i].rotation = unpacked_rotation(u32::from_le_bytes([row[0], row[1], row[2], row[3]]));
            Ok(())
        })?;
    }
    if degree > kept {
        tracing::warn!("harmonics of degree {degree}: those beyond degree {kept} were left out");
    }
    sections.rows(count, 3 * (basis_count(degree) - 1), |i, row| {
        for (to, &byte) in coefficients[i * stride..][3..stride].iter_mut().zip(row) {
            *to = (f32::from(byte) - 128.0) / 128.0;
        }
        Ok(())
    })?;
    let colours = Some(Harmonics { degree: kept, coefficients });
    Ok(SplatSet { splats, colours, ..SplatSet::default() })
}

/// Returns w, x, y, z of a rotation as the writer packs it.
fn unpacked_rotation(packed: u32) -> [f32; 4] {
    let greatest = (packed >> 30) as usize;
    let mut q = [0.0f32; 4];
    let mut rest = packed;
    for at in (0..4).rev().filter(|&at| at != greatest) {
        let size = (rest & 511) as f32 / 511.0 * std::f32::consts::FRAC_1_SQRT_2;
        q[at] = if rest & 512 != 0 { -size } else { size };
        rest >>= 10;
    }
    q[greatest] = (1.0 - q.iter().map(|v| v * v).sum::<f32>()).max(0.0).sqrt();
    let [x, y, z, w] = q;
    [w, x, y, z]
}

#[cfg(test)]
mod tests;
