//! NRRD files (`.nrrd`, `.nhdr`), and the label maps that 3D Slicer writes as such (`.seg.nrrd`).
//!
//! The header is text: fields, keys with values, comments, and an empty line. The voxels follow it, or are in
//! the one file beside it that `data file` names. Three axes are in space; one more, anywhere among them, may
//! be a series of volumes. A header without a patient's space (`scanner-xyz`, `3D-right-handed`, or none) is
//! read as it stands, with the orientation unknown.
//! Format: <https://teem.sourceforge.net/nrrd/format.html>.
//!
//! | file | what is there |
//! |---|---|
//! | `header` | the lines, and the fields that say how the voxels are stored |
//! | `geometry` | the axes, and the affine of those in space |

mod geometry;
mod header;

use std::path::{Path, PathBuf};

pub(super) use self::header::FIELDS;
use self::header::{Encoding, Header, bad, several_files};
use super::payload::{Layout, Packing, Payload};
use super::source::Source;
use super::text_header::{check_grid, excerpt, names_several, open_beside, path_beside, skip_lines};
use super::voxel_source::{VoxelSource, opened, without_voxels};
use super::{Grid, ReadOptions, Volume};
use base::input::Input;
use base::unit::Unit;
use base::{Error, Result};

/// Returns true if the decoded beginning of a file is that of NRRD.
pub(super) fn sniff(head: &[u8]) -> bool {
    head.starts_with(b"NRRD000")
}

/// Returns the file of voxels that a header names; `None` if they are in the same file.
pub(super) fn beside(path: &Path) -> Option<PathBuf> {
    let header = Header::read(&mut Source::open(&path.into(), true).ok()?).ok()?;
    path_beside(path, header.field("data file")?).ok()
}

/// Opens one volume, as [`Volume::open`] does.
pub(super) fn open(input: &Input, options: &ReadOptions) -> Result<Box<dyn VoxelSource>> {
    let mut source = Source::open(input, options.lenient)?;
    let header = Header::read(&mut source)?;
    let mut notes = Vec::new();
    header.check_names(&mut notes)?;
    let element = header.element()?;
    let encoding = header.encoding()?;
    let big_endian = header.is_big_endian(element, encoding)?;
    let sizes = header.sizes()?;
    let directions = header.directions(sizes.len())?;
    let axes = header.axes(&sizes, directions.as_deref())?;
    let labels = header.labels(axes.volumes)?;
    let (affine, oriented) = header.affine(&axes, sizes.len(), directions.as_deref(), &mut notes)?;
    notes.extend(check_grid(&affine, "'space directions'", "'space origin'")?);
    let layout = Layout::new(element, big_endian, axes.size, (axes.volumes, axes.run), options)?;
    if header.field("old min").or(header.field("old max")).is_some() {
        notes.push("'old min' and 'old max' are not applied: voxels are read as they are stored".into());
    }
    for note in notes {
        tracing::warn!("{}: {note}", input.name().display());
    }
    let payload = open_payload(&header, source, input, encoding, layout.bytes(), options)?;
    let stated_unit = header.field("sample units").and_then(|text| {
        let name = text.trim_matches('"').to_lowercase();
        (name == "hu" || name.starts_with("hounsfield")).then_some(Unit::Hu)
    });
    let about = Volume { oriented, labels, stated_unit, ..without_voxels() };
    let grid = Grid { size: axes.size, world_from_voxel: affine };
    opened(input, about, grid, (layout, payload), encoding == Encoding::Text, options)
}

/// Opens the voxels and skips the bytes before them.
fn open_payload(
    fields: &Header,
    mut source: Source,
    header: &Input,
    encoding: Encoding,
    bytes: u64,
    options: &ReadOptions,
) -> Result<Payload> {
    let number = |name: &str| match fields.field(name).map(|text| (text, text.parse::<i64>())) {
        None => Ok(0),
        Some((_, Ok(n))) => Ok(n),
        Some((text, Err(_))) => Err(wrong_skip(name, excerpt(text))),
    };
    let (lines, skip) = (number("line skip")?, number("byte skip")?);
    let lines = u64::try_from(lines).map_err(|_| wrong_skip("line skip", lines.to_string()))?;
    let mut packing = if encoding == Encoding::Gzip { Packing::Gzip } else { Packing::Plain };
    if let Some(name) = fields.field("data file") {
        if names_several(name) {
            return Err(several_files(name));
        }
        source = open_beside(header, name, options.lenient)?;
        // A file that is gzip as a whole is unpacked on the way.
        if source.gzip {
            packing = Packing::Plain;
        }
    }
    skip_lines(&mut source, lines)?;
    let forward = match u64::try_from(skip) {
        Ok(forward) => forward,
        Err(_) if encoding != Encoding::Raw || source.gzip => {
            return Err(wrong_skip("byte skip", format!("{skip}, which counts from the end")));
        }
        // -1 stands for the end of the file, -2 for one byte before it.
        Err(_) => {
            let used = skip.unsigned_abs().saturating_sub(1).saturating_add(bytes);
            let start = source.stored.checked_sub(used).filter(|&start| start >= source.position);
            start.ok_or_else(|| source.truncated(used.saturating_add(source.position), source.stored))?
                - source.position
        }
    };
    let mut payload = Payload::new(source, packing, options.lenient)?;
    payload.expect(forward, u64::MAX)?;
    payload.skip(forward)?;
    Ok(payload)
}

fn wrong_skip(field: &str, found: String) -> Error {
    bad(
        "VGS-NRD-018",
        format!("'{field}' is {found}; a number is needed, below 0 only with plain raw voxels"),
    )
    .help("unpack the file of voxels, or correct the header")
}

#[cfg(test)]
mod tests;
