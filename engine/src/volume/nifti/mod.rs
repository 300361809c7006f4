//! NIfTI-1 and NIfTI-2 files, read strictly and written atomically.
//!
//! Single files and pairs, plain or gzip, either byte order, every scalar datatype. Sizes are compared with the
//! bytes that are there before anything is allocated, and a stream is read to its end so that its checksum counts.
//! The `nifti` crate parses the NIfTI-1 header; its voxel reader is not used, since it begins at the wrong byte
//! where extensions or a gap precede the voxels, applies a NaN slope, and stops before the checksum.

mod datatype;
mod extension;
mod header;
mod write;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::source::Source;
use super::{ReadOptions, Volume, axis_codes_of, reserve_samples, spacing_of};
use crate::{Error, Kind, Result};
use header::{Parsed, SIZE_1, SIZE_2};
pub use write::{check_name, write};

/// The longest run of extensions that is looked at; longer ones are skipped.
const MAX_EXTENSIONS: u64 = 16 << 20;

/// What a NIfTI header says, for people and for scripts.
#[derive(Clone, Debug, Serialize)]
pub struct Header {
    /// "NIfTI-1" or "NIfTI-2".
    pub format: &'static str,
    /// Whether numbers are stored with the most significant byte first.
    pub big_endian: bool,
    /// Whether the file with the header is gzip.
    pub gzip: bool,
    /// The file that holds the voxels, if it is not the same.
    pub voxel_file: Option<PathBuf>,
    /// Dimensions, x first; at least three.
    pub dims: Vec<usize>,
    /// Name of the datatype, such as "int16" or "RGB".
    pub datatype: &'static str,
    /// The standard's code of the datatype.
    pub datatype_code: i16,
    /// Whether the voxels are single real numbers, that is, readable as a [`Volume`].
    pub scalar: bool,
    /// Byte at which the voxels begin in their file.
    pub vox_offset: u64,
    /// Distance between voxel centres along x, y, z, mm.
    pub spacing_mm: [f64; 3],
    /// Rows of the voxel-to-world matrix, mm RAS.
    pub affine: [[f64; 4]; 3],
    /// Where the affine comes from: "sform", "qform" or "pixdim".
    pub affine_source: &'static str,
    /// Direction in which each index grows, as "LAS"; "???" if the orientation is unknown.
    pub axes: String,
    /// Whether the file says how the patient lies.
    pub oriented: bool,
    /// The length unit of the file.
    pub units: &'static str,
    /// Factor from stored to real values; absent if there is no scaling.
    pub slope: Option<f64>,
    /// Added after the factor; absent if there is no scaling.
    pub inter: Option<f64>,
    /// The qform code as stored.
    pub qform_code: i32,
    /// The sform code as stored.
    pub sform_code: i32,
    /// Free text of the header.
    pub description: String,
    /// Names of label values.
    pub labels: BTreeMap<i32, String>,
    /// What is odd but readable, as sentences.
    pub notes: Vec<String>,
}

/// Whether the beginning of a file is a NIfTI (or ANALYZE) header.
pub(super) fn sniff(head: &[u8]) -> bool {
    header::sniff(head)
}

/// A file that was opened up to the voxels.
struct Opened {
    header: Parsed,
    labels: BTreeMap<i32, String>,
    /// Positioned at the first voxel.
    voxels: Source,
    voxel_path: PathBuf,
    gzip: bool,
}

/// Reads one volume. See [`Volume::read`], which recognises the format first.
///
/// # Errors
/// As [`Volume::read`].
pub fn read(path: &Path, options: &ReadOptions) -> Result<Volume> {
    let named = |e: Error| if e.file.is_some() { e } else { e.file(path) };
    let opened = open(path, options).map_err(named)?;
    for note in &opened.header.notes {
        tracing::warn!("{}: {note}", path.display());
    }
    samples(opened, options).map_err(named)
}

/// Reads the header and the label names and checks them, whatever the voxels are: RGB and complex files too.
///
/// # Errors
/// [`Kind::Missing`], [`Kind::BadData`] or [`Kind::Io`].
pub fn describe(path: impl AsRef<Path>) -> Result<Header> {
    let path = path.as_ref();
    // The voxels are not read, so their amount is no reason to refuse.
    let options = ReadOptions { max_bytes: u64::MAX, volume_index: None, lenient: true };
    let opened = open(path, &options).map_err(|e| if e.file.is_some() { e } else { e.file(path) })?;
    let h = opened.header;
    let oriented = h.affine_source != "pixdim";
    let [x, y, z, t] = h.affine.to_cols_array_2d();
    Ok(Header {
        format: if h.version == 1 { "NIfTI-1" } else { "NIfTI-2" },
        big_endian: h.big_endian,
        gzip: opened.gzip,
        voxel_file: (!h.single_file).then_some(opened.voxel_path),
        datatype: h.datatype.name,
        datatype_code: h.datatype.code,
        scalar: h.datatype.decode.is_some(),
        vox_offset: h.vox_offset,
        spacing_mm: spacing_of(&h.affine).to_array(),
        affine: std::array::from_fn(|r| [x[r], y[r], z[r], t[r]]),
        affine_source: h.affine_source,
        axes: if oriented { axis_codes_of(&h.affine) } else { "???".into() },
        oriented,
        units: h.units,
        slope: h.scaling.map(|s| s.0),
        inter: h.scaling.map(|s| s.1),
        qform_code: h.qform_code,
        sform_code: h.sform_code,
        description: h.description,
        labels: opened.labels,
        notes: h.notes,
        dims: h.dims,
    })
}

fn open(path: &Path, options: &ReadOptions) -> Result<Opened> {
    let header_path = if has_ending(path, ".img") { partner(path, ".img", ".hdr")? } else { path.to_owned() };
    let mut source = Source::open(&header_path, options.lenient)?;
    let gzip = source.gzip;
    let mut head = [0; SIZE_2];
    // No more than the smaller header: a NIfTI-1 header may be a whole file.
    let mut n = source.read_some(&mut head[..SIZE_1])?;
    if n == SIZE_1 && !matches!(head[..4], [92, 1, 0, 0] | [0, 0, 1, 92]) {
        n += source.read_some(&mut head[SIZE_1..])?;
    }
    let mut header = header::parse(&head[..n])?;
    if gzip != Source::named_gzip(&header_path) {
        let (is, name) = if gzip { ("gzip", "does not end in .gz") } else { ("not gzip", "ends in .gz") };
        header.notes.push(format!("the content is {is} although the name {name}: it is read as what it is"));
    }
    let extensions_end = if header.single_file { header.vox_offset } else { u64::MAX };
    let labels = read_labels(&mut source, &mut header, extensions_end, options)?;
    if header.single_file {
        let gap = header.vox_offset - source.position;
        if source.skip(gap)? < gap {
            return Err(source.truncated(header.vox_offset, source.position));
        }
        return Ok(Opened { header, labels, voxels: source, voxel_path: header_path, gzip });
    }
    source.finish(options.max_bytes)?;
    let voxel_path = match has_ending(path, ".img") {
        true => path.to_owned(),
        false => partner(path, ".hdr", ".img")?,
    };
    let mut voxels = Source::open(&voxel_path, options.lenient)?;
    if voxels.skip(header.vox_offset)? < header.vox_offset {
        return Err(voxels.truncated(header.vox_offset, voxels.position));
    }
    Ok(Opened { header, labels, voxels, voxel_path, gzip })
}

/// Reads the extensions, if the four bytes after the header announce any.
fn read_labels(
    source: &mut Source,
    header: &mut Parsed,
    end: u64,
    options: &ReadOptions,
) -> Result<BTreeMap<i32, String>> {
    let mut flag = [0; 4];
    // A pair's header file may end without them.
    if source.read_some(&mut flag)? < 4 || flag[0] == 0 || end <= header.header_bytes() {
        return Ok(BTreeMap::new());
    }
    let length = end - header.header_bytes();
    if header.single_file && length > MAX_EXTENSIONS {
        header.notes.push(format!("{length} bytes of header extensions are too many: they are skipped"));
        return Ok(BTreeMap::new());
    }
    let mut bytes = Vec::new();
    std::io::Read::read_to_end(
        &mut std::io::Read::take(&mut *source, length.min(MAX_EXTENSIONS)),
        &mut bytes,
    )
    .map_err(|e| source.failed(&e))?;
    match extension::labels(&bytes, header.big_endian) {
        Err(e) if options.lenient => {
            header.notes.push(format!("{e}; the rest of the extensions is skipped"));
            Ok(BTreeMap::new())
        }
        other => other,
    }
}

fn samples(opened: Opened, options: &ReadOptions) -> Result<Volume> {
    let Opened { header, labels, mut voxels, voxel_path, .. } = opened;
    let Some(decode) = header.datatype.decode else {
        let message = format!("{} ({}) is not a scalar volume", header.datatype.name, header.datatype.code);
        return Err(Error::new(Kind::BadData, "VGS-NII-015", message)
            .help("a volume of single integers or real numbers is needed, such as int16 or float32"));
    };
    let volumes = header.volumes();
    let chosen = match options.volume_index {
        Some(i) if i < volumes => i,
        None if volumes == 1 => 0,
        asked => {
            let message = match asked {
                Some(i) => format!("there is no volume {i}: the file holds {volumes}"),
                None => format!("the file holds {volumes} volumes ({:?})", header.dims),
            };
            return Err(Error::new(Kind::Usage, "VGS-NII-016", message)
                .help(format!("choose --volume-index 0..{}", volumes - 1)));
        }
    };
    let one = header.volume_bytes();
    let end = header.vox_offset.saturating_add(one.saturating_mul(volumes as u64));
    let in_memory = 4 * header.voxels() as u64;
    voxels.expect(end, options.max_bytes)?;
    if in_memory > options.max_bytes {
        let message =
            format!("takes {in_memory} bytes in memory, more than the limit of {}", options.max_bytes);
        return Err(Error::new(Kind::BadData, "VGS-VOL-005", message)
            .help("if the size is right, raise the limit with --max-bytes"));
    }
    let before = one * chosen as u64;
    if voxels.skip(before)? < before {
        return Err(voxels.truncated(end, voxels.position));
    }
    let mut out = reserve_samples(header.voxels())?;
    let mut inexact = 0_usize;
    let mut overflow = None;
    let mut block = vec![0; 65536 * header.datatype.bytes];
    while out.len() < header.voxels() {
        let wanted = (header.voxels() - out.len()).min(65536) * header.datatype.bytes;
        if voxels.read_some(&mut block[..wanted])? < wanted {
            return Err(voxels.truncated(end, voxels.position));
        }
        decode(&block[..wanted], header.big_endian, &mut |stored| {
            let value = header.scaling.map_or(stored, |(slope, inter)| slope * stored + inter);
            let sample = value as f32;
            inexact += usize::from(header.datatype.wide_integer && f64::from(stored as f32) != stored);
            if sample.is_infinite() && stored.is_finite() && overflow.is_none() {
                overflow = Some((out.len(), value));
            }
            out.push(sample);
        });
        if let Some((index, value)) = overflow {
            let message = format!("voxel {index} is {value:e}, beyond the range of 32-bit real numbers");
            return Err(Error::new(Kind::BadData, "VGS-NII-017", message)
                .help("such values are no HU: clip or rescale the volume first"));
        }
    }
    if inexact > 0 {
        let name = header.datatype.name;
        tracing::warn!(
            "{}: {inexact} {name} values lose precision as 32-bit real numbers",
            voxel_path.display()
        );
    }
    let after = one * (volumes - 1 - chosen) as u64;
    if voxels.skip(after)? < after {
        return Err(voxels.truncated(end, voxels.position));
    }
    let extra = voxels.finish(options.max_bytes)?;
    if extra > 0 {
        tracing::warn!("{}: {extra} bytes after the voxels are ignored", voxel_path.display());
    }
    Ok(Volume {
        size: header.size(),
        world_from_voxel: header.affine,
        samples: out,
        oriented: header.affine_source != "pixdim",
        labels,
    })
}

/// Whether the name ends in `ending` or `ending.gz`, in either case.
fn has_ending(path: &Path, ending: &str) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    name.strip_suffix(".gz").unwrap_or(&name).ends_with(ending)
}

/// The other file of a pair: `path` with `from` replaced by `to`, plain or gzip, whichever exists.
fn partner(path: &Path, from: &str, to: &str) -> Result<PathBuf> {
    if !has_ending(path, from) {
        return Err(Error::new(
            Kind::BadData,
            "VGS-NII-018",
            "the header says that its voxels are in a .img file",
        )
        .file(path)
        .help("name the pair .hdr and .img"));
    }
    let gz = Source::named_gzip(path);
    let bare = if gz { path.with_extension("") } else { path.to_owned() };
    let upper = bare.extension().is_some_and(|e| e.to_string_lossy().chars().all(char::is_uppercase));
    let ending = if upper { to[1..].to_uppercase() } else { to[1..].to_owned() };
    let plain = bare.with_extension(ending);
    let mut packed = plain.clone().into_os_string();
    packed.push(".gz");
    let packed = PathBuf::from(packed);
    // The same compression first.
    let candidates = if gz { [&packed, &plain] } else { [&plain, &packed] };
    candidates.into_iter().find(|c| c.exists()).cloned().ok_or_else(|| {
        let message = format!("the other file of the pair, {}, is missing", plain.display());
        Error::new(Kind::Missing, "VGS-NII-019", message)
            .file(path)
            .help("put both files of the pair together")
    })
}

#[cfg(test)]
mod tests;
