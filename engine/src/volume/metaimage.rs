//! MetaImage files (`.mha`, `.mhd`) of ITK: lines of `Key = value`, and the voxels after the line
//! `ElementDataFile`, or in the one file that it names.
//!
//! The world of ITK is LPS. `TransformMatrix` has the direction of the first index axis in its first numbers,
//! then that of the second: the matrix column by column. A file without one does not say how the patient
//! lies; it is placed as ITK does, along the axes of LPS.
//! Format: <https://itk.org/Wiki/MetaIO/Documentation>.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};

use super::affine::{RAS_FROM_LPS, grid};
use super::elements::{self, Element};
use super::payload::{Layout, Packing, Payload};
use super::source::Source;
use super::text_header::{Lines, check_grid, excerpt, open_beside, path_beside, reals};
use super::{ReadOptions, Volume};
use crate::{Error, Kind, Result};

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

/// Reads one volume. See [`Volume::read`], which recognises the format first.
///
/// # Errors
/// As [`Volume::read`].
pub fn read(path: &Path, options: &ReadOptions) -> Result<Volume> {
    read_volume(path, options).map_err(|e| if e.file.is_some() { e } else { e.file(path) })
}

/// Returns the file of voxels that a header names; `None` if they are in the same file.
pub(super) fn beside(path: &Path) -> Option<PathBuf> {
    let header = Header::read(&mut Source::open(path, true).ok()?).ok()?;
    let name = header.field(&["elementdatafile"]).filter(|name| !name.eq_ignore_ascii_case("local"))?;
    path_beside(path, name).ok()
}

fn read_volume(path: &Path, options: &ReadOptions) -> Result<Volume> {
    let mut source = Source::open(path, options.lenient)?;
    let header = Header::read(&mut source)?;
    let element = header.element()?;
    let sizes = header.sizes()?;
    let big_endian = header.is_true(&["elementbyteordermsb", "binarydatabyteordermsb"])?.unwrap_or(false);
    let is_text = !header.is_true(&["binarydata"])?.unwrap_or(true);
    let mut notes = Vec::new();
    let (affine, oriented) = header.affine(sizes.len(), &mut notes)?;
    notes.extend(check_grid(&affine)?);
    let unit = |keys: &[&str], idle: f64| header.field(keys).is_none_or(|text| text.parse() == Ok(idle));
    if !unit(&["elementtointensityfunctionslope"], 1.0) || !unit(&["elementtointensityfunctionoffset"], 0.0) {
        notes.push("ElementToIntensityFunction is not applied, as in ITK: voxels are read as stored".into());
    }
    for note in notes {
        tracing::warn!("{}: {note}", path.display());
    }
    let [x, y, z, volumes] = [0, 1, 2, 3].map(|axis| sizes.get(axis).copied().unwrap_or(1));
    let size = [x, y, z];
    // The volumes of a series follow each other; too large a product is refused by the layout.
    let run = x.saturating_mul(y).saturating_mul(z);
    let layout = Layout::new(element, big_endian, size, (volumes, run), options)?;
    let payload = header.open_payload(source, path, is_text, layout.bytes(), options)?;
    let samples = payload.samples(&layout, is_text, options)?;
    Ok(Volume {
        size,
        world_from_voxel: affine,
        samples,
        oriented,
        labels: BTreeMap::new(),
        frame_of_reference: None,
    })
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

    /// Returns the value of the first of the `keys` that the header has.
    fn field(&self, keys: &[&str]) -> Option<&str> {
        keys.iter().find_map(|key| self.0.get(*key)).map(String::as_str)
    }

    fn is_true(&self, keys: &[&str]) -> Result<Option<bool>> {
        let Some(text) = self.field(keys) else { return Ok(None) };
        match text.bytes().next() {
            Some(b'T' | b't' | b'1') => Ok(Some(true)),
            Some(b'F' | b'f' | b'0') => Ok(Some(false)),
            _ => {
                let (key, found) = (keys.first().copied().unwrap_or_default(), excerpt(text));
                Err(bad("VGS-MHA-003", format!("{key} is '{found}'; True or False is needed"))
                    .help("correct the header, or export the volume again"))
            }
        }
    }

    fn element(&self) -> Result<&'static Element> {
        if let Some(other) = self.field(&["objecttype"]).filter(|text| !text.eq_ignore_ascii_case("image")) {
            return Err(bad("VGS-MHA-004", format!("ObjectType is '{}', not Image", excerpt(other)))
                .help("choose the file of the image, not that of a transform or a shape"));
        }
        let channels = self.field(&["elementnumberofchannels"]).unwrap_or("1");
        if channels.parse() != Ok(1) {
            let message = format!("ElementNumberOfChannels is {}; one is needed", excerpt(channels));
            return Err(bad("VGS-MHA-005", message)
                .help("colours and vectors have no HU: write one component as a volume of its own"));
        }
        let name = self.field(&["elementtype"]).unwrap_or("missing");
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
        let found = |key: &str| self.field(&[key]).unwrap_or("missing");
        let (rank, text) = (found("ndims"), found("dimsize"));
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

    /// Returns `count` numbers from the value of the first of the `keys` that the header has.
    fn reals(&self, keys: &[&str], count: usize) -> Result<Option<Vec<f64>>> {
        let Some(text) = self.field(keys) else { return Ok(None) };
        match reals(text).filter(|found| found.len() == count) {
            Some(found) => Ok(Some(found)),
            None => {
                let (key, text) = (keys.first().copied().unwrap_or_default(), excerpt(text));
                Err(bad("VGS-MHA-008", format!("{key} is '{text}'; {count} numbers are needed"))
                    .help("the header is damaged: export the volume again"))
            }
        }
    }

    /// Returns the affine to RAS, mm, and true if the header says how the patient lies.
    fn affine(&self, rank: usize, notes: &mut Vec<String>) -> Result<(DAffine3, bool)> {
        let matrix = self.reals(&["transformmatrix", "rotation", "orientation"], rank * rank)?;
        let origin = self.reals(&["offset", "position", "origin"], rank)?.unwrap_or_default();
        let spacing = match self.reals(&["elementspacing", "elementsize"], rank)? {
            Some(spacing) => spacing,
            None => {
                notes.push("there is no ElementSpacing: voxels are taken to be 1 mm apart".into());
                vec![1.0; rank]
            }
        };
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
            if length == 0.0 || !length.is_finite() {
                let message = format!("ElementSpacing of axis {axis} is {length}; a length is needed");
                return Err(
                    bad("VGS-MHA-009", message).help("the header is damaged: export the volume again")
                );
            }
            if length < 0.0 {
                notes.push(format!("ElementSpacing of axis {axis} is {length}: its sign is ignored"));
            }
            *column *= length.abs();
        }
        Ok((grid(columns, first(&origin), RAS_FROM_LPS), oriented))
    }

    /// Opens the voxels and skips the bytes before them.
    fn open_payload(
        &self,
        mut source: Source,
        header: &Path,
        is_text: bool,
        bytes: u64,
        options: &ReadOptions,
    ) -> Result<Payload> {
        let packed = self.is_true(&["compresseddata"])?.unwrap_or(false) && !is_text;
        let mut packing = if packed { Packing::Zlib } else { Packing::Plain };
        let mut path = header.to_owned();
        let name = self.field(&["elementdatafile"]).unwrap_or_default();
        if !name.eq_ignore_ascii_case("local") {
            let is_list =
                name.split_whitespace().next().is_some_and(|word| word.eq_ignore_ascii_case("list"));
            if is_list || name.contains('%') && name.split_whitespace().count() > 1 {
                let message =
                    format!("the voxels are in several files (ElementDataFile = {})", excerpt(name));
                return Err(bad("VGS-MHA-010", message).help(
                    "write the volume as one file: open it in 3D Slicer and save it as .nrrd or .mha",
                ));
            }
            (source, path) = open_beside(header, name, options.lenient)?;
            // A file that is gzip as a whole is unpacked on the way.
            if source.gzip {
                packing = Packing::Plain;
            }
        }
        let text = self.field(&["headersize"]).unwrap_or("0");
        let wrong = |why: &str| {
            bad("VGS-MHA-011", format!("HeaderSize is {}; {why}", excerpt(text)))
                .help("correct the header, or export the volume again")
        };
        let forward = match text.parse::<i64>() {
            Ok(0) => 0,
            Ok(-1) if packed || is_text || source.gzip => {
                return Err(wrong("-1, which counts from the end, needs plain voxels that are not packed"));
            }
            Ok(-1) => {
                let length = fs::metadata(&path).map_err(|e| Error::io(&path, "reading", &e))?.len();
                let start = length.checked_sub(bytes).filter(|&start| start >= source.position);
                start.ok_or_else(|| source.truncated(bytes.saturating_add(source.position), length))?
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
        Payload::new(source, &path, packing, options.lenient)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::Compression;
    use flate2::write::{GzEncoder, ZlibEncoder};

    use super::*;

    /// 3 × 2 × 2 int16, oblique.
    const HEAD: &str = "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n\
                        CompressedData = False\nTransformMatrix = 0.8 0.6 0 -0.6 0.8 0 0 0 1\nOffset = 10 -20 30\n\
                        CenterOfRotation = 0 0 0\nAnatomicalOrientation = RAI\nElementSpacing = 0.5 1 2\n\
                        DimSize = 3 2 2\nElementType = MET_SHORT\nElementDataFile = LOCAL\n";

    fn count(n: usize) -> Vec<f32> {
        (0..n).map(|v| v as f32).collect()
    }

    fn shorts(values: std::ops::Range<i16>) -> Vec<u8> {
        values.flat_map(i16::to_le_bytes).collect()
    }

    fn zlib(data: &[u8]) -> Vec<u8> {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(data).unwrap();
        encoder.finish().unwrap()
    }

    fn gzip(data: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(data).unwrap();
        encoder.finish().unwrap()
    }

    fn file(head: &str, voxels: &[u8]) -> Vec<u8> {
        [head.as_bytes(), voxels].concat()
    }

    /// Small, so that a test that passes the limit is quick.
    fn options() -> ReadOptions {
        ReadOptions { max_bytes: 1 << 16, ..ReadOptions::default() }
    }

    fn read_in(folder: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Volume> {
        let path = folder.join("a.mha");
        fs::write(&path, bytes).unwrap();
        Volume::read(&path, options)
    }

    fn read_bytes(bytes: &[u8]) -> Result<Volume> {
        read_in(tempfile::tempdir().unwrap().path(), bytes, &options())
    }

    #[test]
    fn the_matrix_is_read_column_by_column_and_taken_to_ras() {
        let v = read_bytes(&file(HEAD, &shorts(0..12))).unwrap();
        assert_eq!((v.size, v.oriented, v.samples.clone()), ([3, 2, 2], true, count(12)));
        let m = v.world_from_voxel.matrix3;
        assert_eq!(m.x_axis, DVec3::new(-0.4, -0.3, 0.0));
        assert_eq!(m.y_axis, DVec3::new(0.6, -0.8, 0.0));
        assert_eq!(m.z_axis, DVec3::new(0.0, 0.0, 2.0));
        assert_eq!(v.world_from_voxel.translation, DVec3::new(-10.0, 20.0, 30.0));
        let other_names = HEAD
            .replace("TransformMatrix", "orientation")
            .replace("Offset", "Position")
            .replace("ElementSpacing", "ElementSize")
            .replace(" = ", ":")
            .replace('\n', "\r\n");
        let other = read_bytes(&file(&other_names, &shorts(0..12))).unwrap();
        assert_eq!((other.world_from_voxel, other.samples), (v.world_from_voxel, v.samples));
        let without = HEAD.replace("TransformMatrix", "Remark").replace("ElementSpacing", "Spacing");
        let v = read_bytes(&file(&without, &shorts(0..12))).unwrap();
        assert_eq!((v.oriented, v.spacing_mm()), (false, DVec3::ONE));
        assert_eq!(v.world_from_voxel.matrix3.x_axis, -DVec3::X);
    }

    #[test]
    fn every_type_in_both_byte_orders() {
        for (name, element) in TYPES {
            let bytes = |v: u8| -> Vec<u8> {
                match element.name {
                    "float32" => f32::from(v).to_le_bytes().to_vec(),
                    "float64" => f64::from(v).to_le_bytes().to_vec(),
                    _ => u64::from(v).to_le_bytes()[..element.bytes].to_vec(),
                }
            };
            for big in [false, true] {
                let mut head = HEAD.replace("MET_SHORT", &name.to_uppercase());
                if big {
                    head = head.replace("BinaryDataByteOrderMSB = False", "ElementByteOrderMSB = True");
                }
                let one = |v| if big { bytes(v).into_iter().rev().collect() } else { bytes(v) };
                let voxels: Vec<u8> = (0..12).flat_map(one).collect();
                assert_eq!(read_bytes(&file(&head, &voxels)).unwrap().samples, count(12), "{name} {big}");
            }
        }
    }

    #[test]
    fn plain_packed_and_text_attached_and_beside() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let voxels = shorts(0..12);
        let packed = HEAD.replace("CompressedData = False", "CompressedData = True\nCompressedDataSize = 99");
        let text = HEAD.replace("BinaryData = True", "BinaryData = False");
        let cases: [(&str, Vec<u8>); 5] = [
            (HEAD, voxels.clone()),
            (&packed, zlib(&voxels)),
            (&packed, gzip(&voxels)),
            (&packed, [zlib(&voxels), vec![0; 5]].concat()),
            (&text, b"0 1 2 3 4 5 6\n7 8 9 10 11\n".to_vec()),
        ];
        for (head, content) in cases {
            assert_eq!(read_in(folder, &file(head, &content), &options()).unwrap().samples, count(12));
            for name in ["b.raw", "b c.zraw"] {
                fs::write(folder.join(name), &content).unwrap();
                let head = head.replace("LOCAL", name);
                assert_eq!(read_in(folder, head.as_bytes(), &options()).unwrap().samples, count(12));
            }
        }
        // Bytes before the voxels, by their number and from the end.
        let before = [&b"12345"[..], &voxels].concat();
        fs::write(folder.join("b.raw"), &before).unwrap();
        for size in ["5", "-1"] {
            let beside = HEAD
                .replace("ElementDataFile = LOCAL", &format!("HeaderSize = {size}\nElementDataFile = b.raw"));
            assert_eq!(read_in(folder, beside.as_bytes(), &options()).unwrap().samples, count(12), "{size}");
        }
        let own = |size: &str| HEAD.replace("NDims", &format!("HeaderSize = {size}\nNDims"));
        let length = own("999").len() + 5;
        for size in [length.to_string(), "-1".into()] {
            assert_eq!(
                read_in(folder, &file(&own(&size), &before), &options()).unwrap().samples,
                count(12),
                "{size}"
            );
        }
    }

    #[test]
    fn one_volume_of_a_series_is_chosen() {
        let head = HEAD
            .replace("NDims = 3", "NDims = 4")
            .replace("0.8 0.6 0 -0.6 0.8 0 0 0 1", "0.8 0.6 0 0 -0.6 0.8 0 0 0 0 1 0 0 0 0 1")
            .replace("10 -20 30", "10 -20 30 0")
            .replace("0.5 1 2", "0.5 1 2 3")
            .replace("3 2 2", "3 2 2 2");
        let bytes = file(&head, &shorts(0..24));
        let folder = tempfile::tempdir().unwrap();
        let second = ReadOptions { volume_index: Some(1), ..options() };
        let v = read_in(folder.path(), &bytes, &second).unwrap();
        assert_eq!(v.samples, count(24)[12..]);
        assert_eq!(v.world_from_voxel.matrix3.y_axis, DVec3::new(0.6, -0.8, 0.0));
        let error = read_bytes(&bytes).unwrap_err();
        assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-VOL-020"));
    }

    #[test]
    fn the_content_is_recognised() {
        for yes in ["NDims = 3", "Comment = x = y\n\nobjecttype=image", "A_1 : b\r\nndims : 3"] {
            assert!(sniff(yes.as_bytes()), "{yes}");
        }
        for no in [
            "",
            "x",
            "ObjectType = Scene\nNDims = 3",
            "# a\nNDims = 3",
            "[volume]\nNDims = 3",
            "a b = 1\nNDims = 3",
        ] {
            assert!(!sniff(no.as_bytes()), "{no}");
        }
    }

    #[test]
    fn malformed_files_are_refused() {
        let voxels = shorts(0..12);
        let with = |from: &str, to: &str| {
            assert!(HEAD.contains(from), "{from}");
            file(&HEAD.replace(from, to), &voxels)
        };
        let header_size = |n: &str| with("NDims", &format!("HeaderSize = {n}\nNDims"));
        let packed = HEAD.replace("CompressedData = False", "CompressedData = True");
        let stream = zlib(&voxels);
        let mut flipped = stream.clone();
        *flipped.last_mut().unwrap() ^= 1;
        let cases: Vec<(Vec<u8>, &str)> = vec![
            (with("CenterOfRotation = 0 0 0", "no key"), "VGS-MHA-001"),
            (with("CenterOfRotation = 0 0 0", "DimSize = 3 2 1"), "VGS-MHA-001"),
            (with("CenterOfRotation = 0 0 0", &format!("Comment = {}", "x".repeat(2 << 20))), "VGS-VOL-023"),
            (HEAD.replace("ElementDataFile = LOCAL\n", "").into_bytes(), "VGS-MHA-002"),
            (with("BinaryData = True", "BinaryData = maybe"), "VGS-MHA-003"),
            (with("CompressedData = False", "CompressedData ="), "VGS-MHA-003"),
            (with("ElementType", "ElementNumberOfChannels = 3\nElementType"), "VGS-MHA-005"),
            (with("MET_SHORT", "MET_UCHAR_ARRAY"), "VGS-MHA-006"),
            (with("ElementType = MET_SHORT\n", ""), "VGS-MHA-006"),
            (with("NDims = 3", "NDims = 2"), "VGS-MHA-007"),
            (with("NDims = 3", "NDims = 5"), "VGS-MHA-007"),
            (with("DimSize = 3 2 2", "DimSize = 3 2"), "VGS-MHA-007"),
            (with("DimSize = 3 2 2", "DimSize = 3 0 2"), "VGS-MHA-007"),
            (with("DimSize = 3 2 2\n", ""), "VGS-MHA-007"),
            (with("0.8 0.6 0 ", "0.8 0.6 "), "VGS-MHA-008"),
            (with("10 -20 30", "10 -20 x"), "VGS-MHA-008"),
            (with("0.5 1 2", "0.5 1"), "VGS-MHA-008"),
            (with("0.5 1 2", "0.5 0 2"), "VGS-MHA-009"),
            (with("0.5 1 2", "0.5 nan 2"), "VGS-MHA-009"),
            (with("-0.6 0.8 0 ", "0.8 0.6 0 "), "VGS-VOL-025"),
            (with("10 -20 30", "10 inf 30"), "VGS-VOL-025"),
            (with("LOCAL", "LIST"), "VGS-MHA-010"),
            (with("LOCAL", "a%03d.raw 1 10 1"), "VGS-MHA-010"),
            (with("LOCAL", "/etc/passwd"), "VGS-VOL-024"),
            (with("LOCAL", "../a.raw"), "VGS-VOL-024"),
            (with("LOCAL", "none.raw"), "VGS-VOL-001"),
            (header_size("7"), "VGS-MHA-011"),
            (header_size("-2"), "VGS-MHA-011"),
            (header_size("x"), "VGS-MHA-011"),
            (header_size("99999999999"), "VGS-VOL-006"),
            (file(&packed.replace("NDims", "HeaderSize = -1\nNDims"), &stream), "VGS-MHA-011"),
            (file(HEAD, &voxels[..23]), "VGS-VOL-006"),
            (with("DimSize = 3 2 2", "DimSize = 512 512 512"), "VGS-VOL-005"),
            (with("DimSize = 3 2 2", "DimSize = 4294967296 4294967296 4294967296"), "VGS-VOL-005"),
            (file(&packed, &stream[..stream.len() - 1]), "VGS-VOL-008"),
            (file(&packed, &stream[..8]), "VGS-VOL-008"),
            (file(&packed, &[]), "VGS-VOL-006"),
            (file(&packed, &flipped), "VGS-VOL-007"),
            (file(&packed, &voxels), "VGS-VOL-007"),
            (file(&packed, &[&stream[..], b"more"].concat()), "VGS-VOL-007"),
            (file(&packed, &zlib(&voxels[..20])), "VGS-VOL-006"),
            (file(&packed.replace("3 2 2", "4000 2 2"), &stream), "VGS-VOL-006"),
        ];
        for (i, (bytes, expected)) in cases.into_iter().enumerate() {
            let error = read_bytes(&bytes).unwrap_err();
            assert_eq!(error.code, expected, "case {i}: {error}");
            assert!(error.file.is_some() && !error.help.is_empty(), "case {i}: {error:?}");
        }
        let transform = HEAD.replace("ObjectType = Image", "ObjectType = Scene");
        assert_eq!(read_bytes(&file(&transform, &voxels)).unwrap_err().code, "VGS-MHA-004");
    }

    #[test]
    fn damaged_bytes_never_panic() {
        let packed = HEAD.replace("CompressedData = False", "CompressedData = True\nHeaderSize = 0");
        let folder = tempfile::tempdir().unwrap();
        for good in [file(HEAD, &shorts(0..12)), file(&packed, &zlib(&shorts(0..12)))] {
            assert!(read_in(folder.path(), &good, &options()).is_ok());
            for end in 0..good.len() {
                assert!(read_in(folder.path(), &good[..end], &options()).is_err(), "cut at {end}");
            }
            for (at, value) in (0..good.len()).flat_map(|at| [b'9', b'\n', 0xff].map(|v| (at, v))) {
                let mut bytes = good.clone();
                bytes[at] = value;
                if let Ok(v) = read_in(folder.path(), &bytes, &options()) {
                    assert_eq!(v.samples.len(), v.size.iter().product::<usize>());
                    assert!(v.world_from_voxel.is_finite());
                }
            }
        }
    }
}
