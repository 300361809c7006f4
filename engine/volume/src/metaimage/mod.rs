//! MetaImage files (`.mha`, `.mhd`) of ITK: lines of `Key = value`, and the voxels after the line
//! `ElementDataFile`, or in the one file that it names.
//!
//! The world of ITK is LPS. `TransformMatrix` has the direction of the first index axis in its first numbers,
//! then that of the second: the matrix column by column. A file without one does not say how the patient
//! lies; it is placed as ITK does, along the axes of LPS. Keys that mean the same must not contradict each other.
//! Format: <https://itk.org/Wiki/MetaIO/Documentation>.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};

use super::affine::{RAS_FROM_LPS, axis_codes_of, grid};
use super::elements::{self, Element};
use super::fields::FieldRow;
use super::payload::{Layout, Packing, Payload};
use super::source::Source;
use super::text_header::{Lines, check_grid, excerpt, names_several, open_beside, path_beside, reals};
use super::voxel_source::{VoxelSource, opened, without_voxels};
use super::{Grid, ReadOptions, Volume};
use base::input::Input;
use base::unit::Unit;
use base::{Error, Kind, Result};

/// Every type that is one number. In MetaImage a long has 4 bytes.
const TYPES: [(&str, &Element); 12] = [
    ("met_char", &elements::INT8),
    ("met_uchar", &elements::UINT8),
    ("met_short", &elements::INT16),
    ("met_ushort", &elements::UINT16),
    ("met_int", &elements::INT32),
    ("met_uint", &elements::UINT32),
    ("met_long", &elements::INT32),
    ("met_ulong", &elements::UINT32),
    ("met_long_long", &elements::INT64),
    ("met_ulong_long", &elements::UINT64),
    ("met_float", &elements::FLOAT32),
    ("met_double", &elements::FLOAT64),
];

/// What is done with the fields of the format.
pub(super) const FIELDS: &[FieldRow] = &[
    FieldRow::with_default("ObjectType", "Image", "Image", &["Scene", ""]),
    FieldRow::needed("NDims", "number of axes, 3 or 4", &["2", "5", "three"]),
    FieldRow::needed(
        "DimSize",
        "size of each axis, the fastest first",
        &["3 2", "3 0 2", "3 -2 2", "3 two 2"],
    ),
    FieldRow::needed("ElementType", "type of the voxels: a single number", &["MET_UCHAR_ARRAY", "short"]),
    FieldRow::with_default("ElementNumberOfChannels", "numbers of a voxel, 1", "1", &["3", "x", ""]),
    FieldRow::with_default("BinaryData", "True, or False for text", "True, as in ITK", &["maybe", ""]),
    FieldRow::with_default(
        "BinaryDataByteOrderMSB",
        "True for big-endian",
        "False, as in ITK on a PC",
        &["maybe", ""],
    ),
    FieldRow::with_default(
        "ElementByteOrderMSB",
        "as BinaryDataByteOrderMSB",
        "the same",
        &["maybe", "True"],
    ),
    FieldRow::with_default("CompressedData", "True for zlib or gzip", "False", &["maybe", ""]),
    FieldRow::with_default(
        "TransformMatrix",
        "directions of the axes in LPS, one after the other",
        "along the axes of LPS, orientation unknown: a note",
        &["1 0 0 0 1 0 0 0", "1 0 0 0 1 0 0 0 x", "1 0 0 0 1 0 0 0 nan", "1 0 0 1 0 0 0 0 1"],
    ),
    FieldRow::with_default("Rotation", "as TransformMatrix", "the same", &["1 0 0 0 1 0 0 0 1", "x"]),
    FieldRow::with_default("Orientation", "as TransformMatrix", "the same", &["1 0 0 0 1 0 0 0 1", "x"]),
    FieldRow::with_default(
        "Offset",
        "place of the first voxel in LPS",
        "0, 0, 0: a note",
        &["1 2", "1 2 x", "1 2 inf"],
    ),
    FieldRow::with_default("Position", "as Offset", "the same", &["1 2 3", "x"]),
    FieldRow::with_default("Origin", "as Offset", "the same", &["1 2 3", "x"]),
    FieldRow::with_default(
        "ElementSpacing",
        "distance of voxels; below 0 the axis runs the other way, as in ITK",
        "ElementSize, or 1 mm: a note",
        &["1 1", "1 0 1", "1 nan 1", "1 1,5 1"],
    ),
    FieldRow::with_default(
        "ElementSize",
        "size of a voxel, where there is no ElementSpacing",
        "1 mm: a note",
        &["1 1 x"],
    ),
    FieldRow::with_default("DistanceUnits", "um, mm, cm or m, of spacing and offset", "mm", &["inch"]),
    FieldRow::with_default(
        "HeaderSize",
        "bytes before the voxels, from the beginning of their file; -1: the voxels are at its end",
        "0",
        &["7", "-2", "x", "1.5"],
    ),
    FieldRow::needed(
        "ElementDataFile",
        "LOCAL, or the one file of the voxels, in the folder of the header or below",
        &["LIST", "%03d.raw 1 10 1", "../a.raw", ""],
    ),
    FieldRow::with_default(
        "Modality",
        "MET_MOD_CT: values are HU; MET_MOD_MR: they are not",
        "the values tell",
        &[],
    ),
    FieldRow::with_default(
        "AnatomicalOrientation",
        "not used, as in ITK: TransformMatrix counts, and a note tells where they differ",
        "the same",
        &[],
    ),
    FieldRow::unused("ElementToIntensityFunctionSlope", "not applied, as in ITK: a note"),
    FieldRow::unused("ElementToIntensityFunctionOffset", "not applied, as in ITK: a note"),
    FieldRow::unused("CenterOfRotation", "not used, as in ITK"),
    FieldRow::unused("CompressedDataSize", "not used: the stream knows its end"),
    FieldRow::unused("ElementMin", "not used: the voxels say it"),
    FieldRow::unused("ElementMax", "not used: the voxels say it"),
];

/// Keys that mean the same.
const BYTE_ORDER: &[&str] = &["BinaryDataByteOrderMSB", "ElementByteOrderMSB"];
const MATRIX: &[&str] = &["TransformMatrix", "Rotation", "Orientation"];
const OFFSET: &[&str] = &["Offset", "Position", "Origin"];

/// What to do about a field that cannot be read.
const CORRECT: &str = "correct the header, or export the volume again";

/// The values of a header by their keys in lower case.
#[derive(Debug)]
struct Header(BTreeMap<String, String>);

/// Returns true if the decoded beginning of a file is that of a MetaImage: keys with values, among them the
/// number of dimensions or the object type of an image.
pub(super) fn sniff(head: &[u8]) -> bool {
    for line in head.split(|&b| b == b'\n') {
        let line = String::from_utf8_lossy(line);
        match key_and_value(&line) {
            Some((key, value)) if key == "objecttype" => return value.eq_ignore_ascii_case("image"),
            Some((key, _)) if key == "ndims" => return true,
            Some((key, _)) if key.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_') => {}
            _ if line.trim().is_empty() => {}
            _ => return false,
        }
    }
    false
}

/// Returns the file of voxels that a header names; `None` if they are in the same file.
pub(super) fn beside(path: &Path) -> Option<PathBuf> {
    let header = Header::read(&mut Source::open(&path.into(), true).ok()?).ok()?;
    let name = header.field("ElementDataFile").filter(|name| !name.eq_ignore_ascii_case("local"))?;
    path_beside(path, name).ok()
}

/// Opens one volume, as [`Volume::open`] does.
pub(super) fn open(input: &Input, options: &ReadOptions) -> Result<Box<dyn VoxelSource>> {
    let mut source = Source::open(input, options.lenient)?;
    let header = Header::read(&mut source)?;
    let element = header.element()?;
    let sizes = header.sizes()?;
    let big_endian = header.is_true(BYTE_ORDER)?.unwrap_or(false);
    let is_text = !header.is_true(&["BinaryData"])?.unwrap_or(true);
    let mut notes = Vec::new();
    let (affine, oriented) = header.affine(sizes.len(), &mut notes)?;
    notes.extend(check_grid(&affine, "TransformMatrix or ElementSpacing", "Offset")?);
    header.compare_orientation(&affine, oriented, &mut notes);
    let idle = |key: &str, idle: f64| header.field(key).is_none_or(|text| text.parse() == Ok(idle));
    if !idle("ElementToIntensityFunctionSlope", 1.0) || !idle("ElementToIntensityFunctionOffset", 0.0) {
        notes.push("ElementToIntensityFunction is not applied, as in ITK: voxels are read as stored".into());
    }
    for note in notes {
        tracing::warn!("{}: {note}", input.name().display());
    }
    let [x, y, z, volumes] = [0, 1, 2, 3].map(|axis| sizes.get(axis).copied().unwrap_or(1));
    let size = [x, y, z];
    // The volumes of a series follow each other; too large a product is refused by the layout.
    let run = x.saturating_mul(y).saturating_mul(z);
    let layout = Layout::new(element, big_endian, size, (volumes, run), options)?;
    let payload = header.open_payload(source, input, is_text, layout.bytes(), options)?;
    let stated_unit = match header.field("Modality").map(str::to_uppercase).as_deref() {
        Some("MET_MOD_CT") => Some(Unit::Hu),
        Some("MET_MOD_MR" | "MET_MOD_US" | "MET_MOD_NM") => Some(Unit::Arbitrary),
        _ => None,
    };
    let about = Volume { oriented, stated_unit, ..without_voxels() };
    let grid = Grid { size, world_from_voxel: affine };
    opened(input, about, grid, (layout, payload), is_text, options)
}

fn bad(code: &'static str, message: impl Into<String>) -> Error {
    Error::new(Kind::BadData, code, message)
}

/// Returns the key of a line in lower case, and its value.
fn key_and_value(line: &str) -> Option<(String, &str)> {
    let (key, value) = line.split_once('=').or_else(|| line.split_once(':'))?;
    let key = key.trim().to_lowercase();
    (!key.is_empty()).then_some((key, value.trim()))
}

impl Header {
    /// Reads the lines up to that of `ElementDataFile`, which is the last one.
    fn read(source: &mut Source) -> Result<Header> {
        let mut lines = Lines::new(source);
        let mut header = Header(BTreeMap::new());
        while let Some(line) = lines.next()? {
            if line.trim().is_empty() {
                continue;
            }
            let Some((key, value)) = key_and_value(&line) else {
                let message =
                    format!("line {} of the header is no 'Key = value': '{}'", lines.number, excerpt(&line));
                return Err(
                    bad("VGS-MHA-001", message).help("correct the header, or export the volume again")
                );
            };
            let is_last = key == "elementdatafile";
            if header.0.insert(key, value.to_owned()).is_some_and(|old| old != value) {
                let message =
                    format!("line {} of the header gives another value: '{}'", lines.number, excerpt(&line));
                return Err(
                    bad("VGS-MHA-001", message).help("correct the header, or export the volume again")
                );
            }
            if is_last {
                return Ok(header);
            }
        }
        Err(bad("VGS-MHA-002", "the header ends without ElementDataFile, which says where the voxels are")
            .help("the file was cut short; copy it again"))
    }

    /// Returns the value of a key.
    fn field(&self, key: &str) -> Option<&str> {
        self.0.get(&key.to_lowercase()).map(String::as_str)
    }

    /// Returns the value, as `read` understands it, of those of the `keys` that the header has. They mean the same, so it
    /// must be the same.
    fn one_of<T: PartialEq>(
        &self,
        keys: &[&'static str],
        read: impl Fn(&'static str, &str) -> Result<T>,
    ) -> Result<Option<T>> {
        let mut found: Option<(&str, T)> = None;
        for &key in keys {
            let Some(text) = self.field(key) else { continue };
            let value = read(key, text)?;
            match &found {
                Some((first, earlier)) if *earlier != value => {
                    let (one, other) = (excerpt(self.field(first).unwrap_or_default()), excerpt(text));
                    let message = format!(
                        "{first} is '{one}' and {key} is '{other}', which mean the same; one value is needed"
                    );
                    return Err(bad("VGS-MHA-012", message).help("take the wrong one out of the header"));
                }
                Some(_) => {}
                None => found = Some((key, value)),
            }
        }
        Ok(found.map(|(_, value)| value))
    }

    fn is_true(&self, keys: &[&'static str]) -> Result<Option<bool>> {
        self.one_of(keys, |key, text| match text.bytes().next() {
            Some(b'T' | b't' | b'1') => Ok(true),
            Some(b'F' | b'f' | b'0') => Ok(false),
            _ => {
                let message = format!("{key} is '{}'; True or False is needed", excerpt(text));
                Err(bad("VGS-MHA-003", message).help(CORRECT))
            }
        })
    }

    fn element(&self) -> Result<&'static Element> {
        if let Some(other) = self.field("ObjectType").filter(|text| !text.eq_ignore_ascii_case("image")) {
            return Err(bad("VGS-MHA-004", format!("ObjectType is '{}', not Image", excerpt(other)))
                .help("choose the file of the image, not that of a transform or a shape"));
        }
        let channels = self.field("ElementNumberOfChannels").unwrap_or("1");
        if channels.parse() != Ok(1) {
            let message = format!("ElementNumberOfChannels is '{}'; 1 is needed", excerpt(channels));
            return Err(bad("VGS-MHA-005", message)
                .help("colours and vectors have no HU: write one component as a volume of its own"));
        }
        let name = self.field("ElementType").unwrap_or("missing");
        TYPES
            .iter()
            .find(|(known, _)| name.eq_ignore_ascii_case(known))
            .map(|(_, element)| *element)
            .ok_or_else(|| {
                bad("VGS-MHA-006", format!("ElementType is {}, which is not a single number", excerpt(name)))
                    .help("a volume of single integers or real numbers is needed, such as MET_SHORT")
            })
    }

    /// Returns the sizes of the axes, three or four.
    fn sizes(&self) -> Result<Vec<usize>> {
        let found = |key: &str| self.field(key).unwrap_or("missing");
        let (rank, text) = (found("NDims"), found("DimSize"));
        let sizes: Option<Vec<usize>> =
            text.split_whitespace().map(|n| n.parse().ok().filter(|&n| n > 0)).collect();
        match (rank.parse::<usize>(), sizes) {
            (Ok(rank @ 3..=4), Some(sizes)) if sizes.len() == rank => Ok(sizes),
            _ => {
                let (rank, text) = (excerpt(rank), excerpt(text));
                let message =
                    format!("NDims is {rank} and DimSize is {text}; 3 or 4, and as many sizes, are needed");
                Err(bad("VGS-MHA-007", message).help("write one volume as a file of its own"))
            }
        }
    }

    /// Returns the `count` numbers of those of the `keys`, which mean the same, that the header has.
    fn reals(&self, keys: &[&'static str], count: usize) -> Result<Option<Vec<f64>>> {
        self.one_of(keys, |key, text| {
            let found =
                reals(text).filter(|found| found.len() == count && found.iter().all(|v| v.is_finite()));
            found.ok_or_else(|| {
                bad("VGS-MHA-008", format!("{key} is '{}'; {count} finite numbers are needed", excerpt(text)))
                    .help("the header is damaged: export the volume again")
            })
        })
    }

    /// Returns the length of the unit of spacing and offset, mm.
    fn millimetres(&self, notes: &mut Vec<String>) -> Result<f64> {
        let Some(text) = self.field("DistanceUnits") else { return Ok(1.0) };
        let length = match text.to_lowercase().as_str() {
            "mm" | "?" | "" => return Ok(1.0),
            "um" => 1e-3,
            "cm" => 10.0,
            "m" => 1e3,
            _ => {
                let message = format!("DistanceUnits is '{}'; um, mm, cm or m is needed", excerpt(text));
                return Err(bad("VGS-MHA-013", message).help(CORRECT));
            }
        };
        notes.push(format!("lengths are in {text}, as DistanceUnits says; ITK takes them as mm"));
        Ok(length)
    }

    /// Notes an AnatomicalOrientation that the matrix contradicts. Its letters say where an axis comes from.
    fn compare_orientation(&self, affine: &DAffine3, oriented: bool, notes: &mut Vec<String>) {
        let Some(text) = self.field("AnatomicalOrientation").filter(|_| oriented) else { return };
        let opposite =
            |c: char| "RLAPSI".chars().zip("LRPAIS".chars()).find(|(of, _)| *of == c).map(|(_, to)| to);
        let from: String = axis_codes_of(affine).chars().filter_map(opposite).collect();
        let is_code = text.len() == 3 && text.to_uppercase().chars().all(|c| opposite(c).is_some());
        if is_code && !text.eq_ignore_ascii_case(&from) {
            notes.push(format!(
                "AnatomicalOrientation is {text}, and TransformMatrix says {from}: the matrix is used, as in ITK"
            ));
        }
    }

    /// Returns the affine to RAS, mm, and true if the header says how the patient lies.
    fn affine(&self, rank: usize, notes: &mut Vec<String>) -> Result<(DAffine3, bool)> {
        let matrix = self.reals(MATRIX, rank * rank)?;
        let origin = match self.reals(OFFSET, rank)? {
            Some(origin) => origin,
            None => {
                notes.push("there is no Offset: the first voxel is taken to be at 0, 0, 0".into());
                Vec::new()
            }
        };
        let (spacing, name) =
            match (self.reals(&["ElementSpacing"], rank)?, self.reals(&["ElementSize"], rank)?) {
                (Some(spacing), _) => (spacing, "ElementSpacing"),
                (None, Some(size)) => (size, "ElementSize"),
                (None, None) => {
                    notes.push("there is no ElementSpacing: voxels are taken to be 1 mm apart".into());
                    (vec![1.0; rank], "ElementSpacing")
                }
            };
        let millimetres = self.millimetres(notes)?;
        let oriented = matrix.is_some();
        if !oriented {
            notes.push(
                "there is no TransformMatrix: the orientation is unknown, left and right cannot be told"
                    .into(),
            );
        }
        let first =
            |values: &[f64]| DVec3::from_array([0, 1, 2].map(|i| values.get(i).copied().unwrap_or(0.0)));
        let mut columns = DVec3::AXES;
        for (axis, column) in columns.iter_mut().enumerate() {
            if let Some(matrix) = &matrix {
                // With four axes, the first three numbers of a direction are those in space.
                *column = first(matrix.get(axis * rank..).unwrap_or_default());
            }
            let length = spacing.get(axis).copied().unwrap_or(1.0);
            if length == 0.0 {
                let message = format!("{name} of axis {axis} is {length}; a length is needed");
                return Err(
                    bad("VGS-MHA-009", message).help("the header is damaged: export the volume again")
                );
            }
            if length < 0.0 {
                notes.push(format!(
                    "{name} of axis {axis} is {length}: the axis runs the other way, as in ITK"
                ));
            }
            *column *= length * millimetres;
        }
        Ok((grid(columns, first(&origin) * millimetres, RAS_FROM_LPS), oriented))
    }

    /// Opens the voxels and skips the bytes before them.
    fn open_payload(
        &self,
        mut source: Source,
        header: &Input,
        is_text: bool,
        bytes: u64,
        options: &ReadOptions,
    ) -> Result<Payload> {
        let packed = self.is_true(&["CompressedData"])?.unwrap_or(false) && !is_text;
        let mut packing = if packed { Packing::Zlib } else { Packing::Plain };
        let name = self.field("ElementDataFile").unwrap_or_default();
        if !name.eq_ignore_ascii_case("local") {
            if names_several(name) {
                let message =
                    format!("the voxels are in several files (ElementDataFile = {})", excerpt(name));
                return Err(bad("VGS-MHA-010", message).help(
                    "write the volume as one file: open it in 3D Slicer and save it as .nrrd or .mha",
                ));
            }
            source = open_beside(header, name, options.lenient)?;
            // A file that is gzip as a whole is unpacked on the way.
            if source.gzip {
                packing = Packing::Plain;
            }
        }
        let text = self.field("HeaderSize").unwrap_or("0");
        let wrong =
            |why: &str| bad("VGS-MHA-011", format!("HeaderSize is {}; {why}", excerpt(text))).help(CORRECT);
        let forward = match text.parse::<i64>() {
            Ok(0) => 0,
            Ok(-1) if packed || is_text || source.gzip => {
                return Err(wrong("-1, which counts from the end, needs plain voxels that are not packed"));
            }
            Ok(-1) => {
                let start = source.stored.checked_sub(bytes).filter(|&start| start >= source.position);
                start.ok_or_else(|| source.truncated(bytes.saturating_add(source.position), source.stored))?
                    - source.position
            }
            // The offset counts from the beginning of the file, also if the voxels are in the header's own
            // file.
            Ok(size) => u64::try_from(size)
                .ok()
                .and_then(|size| size.checked_sub(source.position))
                .ok_or_else(|| wrong("the bytes before the voxels are needed, or -1"))?,
            Err(_) => return Err(wrong("a whole number is needed")),
        };
        // Skipped before the decoder: these bytes are not part of the compressed voxels.
        if source.skip(forward)? < forward {
            return Err(source.truncated(source.position.saturating_add(bytes), source.position));
        }
        Payload::new(source, packing, options.lenient)
    }
}

#[cfg(test)]
mod tests;
