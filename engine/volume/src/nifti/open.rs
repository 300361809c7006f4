//! The header, the extensions and the place of the voxels of a file or of a pair of files.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::header::{Parsed, SIZE_1, SIZE_2};
use super::{extension, header};
use crate::ReadOptions;
use crate::source::Source;
use base::input::Input;
use base::{Error, Kind, Result};

/// The longest run of extensions that is read; longer ones are skipped.
const MAX_EXTENSIONS: u64 = 16 << 20;

/// A file that has been opened up to its voxels.
pub(super) struct Opened {
    pub(super) header: Parsed,
    pub(super) labels: BTreeMap<i32, String>,
    /// Source at the first voxel.
    pub(super) voxels: Source,
    pub(super) gzip: bool,
}

/// What half of a pair is that was given without a path.
const HALF: &str = "one of the two files, .hdr and .img, of a NIfTI pair";

/// Opens a file up to its voxels, and reads its header and its label names.
pub(super) fn open(input: &Input, options: &ReadOptions) -> Result<Opened> {
    let is_voxels = has_ending(input.name(), ".img");
    let of_header =
        if is_voxels { partner(input.needed_path(HALF)?, ".img", ".hdr")?.into() } else { input.clone() };
    let mut source = Source::open(&of_header, options.lenient)?;
    let gzip = source.gzip;
    let mut head = [0; SIZE_2];
    // No more than the smaller header: a NIfTI-1 header may be a whole file.
    let mut n = source.read_some(&mut head[..SIZE_1])?;
    if n == SIZE_1 && !matches!(head[..4], [92, 1, 0, 0] | [0, 0, 1, 92]) {
        n += source.read_some(&mut head[SIZE_1..])?;
    }
    let mut header = header::parse(&head[..n])?;
    if gzip != Source::named_gzip(&source.path) {
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
        return Ok(Opened { header, labels, voxels: source, gzip });
    }
    source.finish(options.max_bytes)?;
    let path = input.needed_path(HALF)?;
    let voxel_path = if is_voxels { path.to_owned() } else { partner(path, ".hdr", ".img")? };
    let mut voxels = Source::open(&voxel_path.into(), options.lenient)?;
    if voxels.skip(header.vox_offset)? < header.vox_offset {
        return Err(voxels.truncated(header.vox_offset, voxels.position));
    }
    Ok(Opened { header, labels, voxels, gzip })
}

/// Returns the other file of a pair; `None` if `path` is a whole file.
pub(crate) fn beside(path: &Path) -> Option<PathBuf> {
    let [from, to] =
        [[".img", ".hdr"], [".hdr", ".img"]].into_iter().find(|[from, _]| has_ending(path, from))?;
    partner(path, from, to).ok()
}

/// Reads the extensions, if the four bytes after the header announce any.
fn read_labels(
    source: &mut Source,
    header: &mut Parsed,
    end: u64,
    options: &ReadOptions,
) -> Result<BTreeMap<i32, String>> {
    let mut flag = [0; 4];
    // The header file of a pair may end without these bytes.
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

/// Returns true if the name ends in `ending` or `ending.gz`, in either case.
fn has_ending(path: &Path, ending: &str) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    name.strip_suffix(".gz").unwrap_or(&name).ends_with(ending)
}

/// Returns the other file of a pair: `path` with `from` replaced by `to`, plain or gzip, whichever exists.
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
    // The file with the same compression is tried first.
    let candidates = if gz { [&packed, &plain] } else { [&plain, &packed] };
    candidates.into_iter().find(|c| c.exists()).cloned().ok_or_else(|| {
        let message = format!("the other file of the pair, {}, is missing", plain.display());
        Error::new(Kind::Missing, "VGS-NII-019", message)
            .file(path)
            .help("put both files of the pair together")
    })
}
