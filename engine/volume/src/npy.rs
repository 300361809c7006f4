//! NumPy arrays (`.npy`): a header that is a Python dictionary, and the numbers.
//!
//! The indices of an array are [z, y, x], or [volume, z, y, x], whatever their order in memory: the last axis
//! is x. That is what SimpleITK gives; an array of nibabel, [x, y, z], must be transposed before it is saved.
//! The file knows no lengths and no patient: voxels are [`ReadOptions::spacing_mm`] apart, or taken to be 1 mm
//! apart, with the orientation unknown.
//! Format: <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>.

use glam::{DAffine3, DVec3};

use super::elements::{self, Element};
use super::fields::FieldRow;
use super::payload::{Layout, Packing, Payload};
use super::source::{Source, reserve_samples};
use super::text_header::excerpt;
use super::voxel_source::{VoxelSource, opened, with_samples, without_voxels};
use super::{Grid, ReadOptions, Volume};
use base::input::Input;
use base::{Error, Kind, Result};

/// Name of the format.
pub const NAME: &str = "NumPy array";
const MAGIC: &[u8] = b"\x93NUMPY";
/// The longest header that is read; the header of an array of numbers has about 120 bytes.
const MAX_HEADER: usize = 1 << 20;

/// All types that are one real number, by their codes without the byte order.
const TYPES: [(&str, &Element); 12] = [
    ("b1", &elements::UINT8),
    ("i1", &elements::INT8),
    ("u1", &elements::UINT8),
    ("i2", &elements::INT16),
    ("u2", &elements::UINT16),
    ("i4", &elements::INT32),
    ("u4", &elements::UINT32),
    ("i8", &elements::INT64),
    ("u8", &elements::UINT64),
    ("f2", &elements::FLOAT16),
    ("f4", &elements::FLOAT32),
    ("f8", &elements::FLOAT64),
];

/// What is done with the keys of the dictionary.
pub(super) const FIELDS: &[FieldRow] = &[
    FieldRow::needed(
        "descr",
        "type of the voxels: one real number, or a truth value",
        &["'<c8'", "'<U3'", "'<i3'", "[('a', '<i2')]", "7"],
    ),
    FieldRow::needed("fortran_order", "True if the first index is the fastest", &["1", "Maybe", "'False'"]),
    FieldRow::needed(
        "shape",
        "[z, y, x], or [volume, z, y, x]",
        &["(2, 2)", "(2, 0, 3)", "(2, -2, 3)", "(2, two, 3)", "12"],
    ),
];

/// Content of the dictionary.
#[derive(Debug, PartialEq)]
struct Header {
    descr: String,
    fortran_order: bool,
    shape: Vec<usize>,
}

/// Returns true if the decoded beginning of a file is that of a NumPy array.
pub(super) fn sniff(head: &[u8]) -> bool {
    head.starts_with(MAGIC)
}

/// Opens one volume, as [`Volume::open`] does.
pub(super) fn open(input: &Input, options: &ReadOptions) -> Result<Box<dyn VoxelSource>> {
    let mut source = Source::open(input, options.lenient)?;
    let header = read_header(&mut source)?;
    let (element, big_endian) = element(&header.descr)?;
    let (volumes, [z, y, x]) = match header.shape.as_slice() {
        &[z, y, x] => (1, [z, y, x]),
        &[volumes, z, y, x] => (volumes, [z, y, x]),
        other => {
            let message =
                format!("the array has the shape {other:?}; [z, y, x] or [volume, z, y, x] is needed");
            return Err(bad("VGS-NPY-005", message).help("save one volume: numpy.save(name, array)"));
        }
    };
    let size = [x, y, z];
    if volumes == 0 || size.contains(&0) {
        let message = format!("the array has the shape {:?}; no axis may be empty", header.shape);
        return Err(bad("VGS-NPY-005", message).help("save one volume: numpy.save(name, array)"));
    }
    // In Fortran order the first index, that of the volume, is the fastest. Too large a product is refused
    // by the layout.
    let run = if header.fortran_order { 1 } else { x.saturating_mul(y).saturating_mul(z) };
    let layout = Layout::new(element, big_endian, size, (volumes, run), options)?;
    let payload = Payload::new(source, Packing::Plain, options.lenient)?;
    let apart = match options.spacing_mm {
        Some(mm) => format!("{} x {} x {} mm apart as was given", mm.x, mm.y, mm.z),
        None => "1 mm apart".to_owned(),
    };
    tracing::warn!(
        "{}: a NumPy array has neither voxel size nor orientation: its axes are taken as [z, y, x], {apart}, left \
         and right cannot be told",
        input.name().display()
    );
    let world_from_voxel = DAffine3::from_scale(options.spacing_mm.unwrap_or(DVec3::ONE));
    let about = Volume { oriented: false, ..without_voxels() };
    let grid = Grid { size, world_from_voxel };
    if header.fortran_order {
        let samples = transposed(payload, &layout, size, options)?;
        return Ok(Box::new(with_samples(about, grid, samples)));
    }
    opened(input, about, grid, (layout, payload), false, options)
}

fn bad(code: &'static str, message: impl Into<String>) -> Error {
    Error::new(Kind::BadData, code, message)
}

/// Reads an array whose first index, z, is the fastest.
fn transposed(
    payload: Payload,
    layout: &Layout,
    [x_size, y_size, z_size]: [usize; 3],
    options: &ReadOptions,
) -> Result<Vec<f32>> {
    // The memory is checked first, since it is written here and not only reserved.
    payload.expect(layout.bytes(), options.max_bytes)?;
    let mut samples = reserve_samples(layout.voxels, options.max_bytes)?;
    samples.resize(layout.voxels, 0.0);
    let [mut x, mut y, mut z] = [0, 0, 0];
    payload.each(layout, false, options, |sample| {
        if let Some(place) = samples.get_mut(x + x_size * (y + y_size * z)) {
            *place = sample;
        }
        z += 1;
        if z == z_size {
            (z, y) = (0, y + 1);
        }
        if y == y_size {
            (y, x) = (0, x + 1);
        }
    })?;
    Ok(samples)
}

fn read_header(source: &mut Source) -> Result<Header> {
    let mut start = [0; 12];
    let short = |n: usize| {
        bad("VGS-NPY-001", format!("the file ends after {n} bytes, inside the header"))
            .help("the file was cut short; copy it again")
    };
    let n = source.read_some(&mut start[..10])?;
    if !start[..n].starts_with(MAGIC) {
        return Err(bad("VGS-NPY-002", "does not begin as a NumPy array does")
            .help("save it with numpy.save; an archive (.npz) must be unpacked first"));
    }
    if n < 10 {
        return Err(short(n));
    }
    let length = match start[6] {
        1 => usize::from(u16::from_le_bytes([start[8], start[9]])),
        2 | 3 => {
            let n = source.read_some(&mut start[10..])?;
            if n < 2 {
                return Err(short(10 + n));
            }
            u32::from_le_bytes([start[8], start[9], start[10], start[11]]) as usize
        }
        other => {
            let message = format!("version {other} of the format; 1, 2 or 3 is needed");
            return Err(bad("VGS-NPY-003", message).help("save it with numpy.save"));
        }
    };
    if length > MAX_HEADER {
        let message = format!("the header has {length} bytes, more than {MAX_HEADER}");
        return Err(bad("VGS-NPY-003", message).help("the file is damaged: save the array again"));
    }
    let mut text = vec![0; length];
    let n = source.read_some(&mut text)?;
    if n < length {
        return Err(short(source.position as usize));
    }
    let text = String::from_utf8_lossy(&text);
    parse(&text).map_err(|key| {
        let message = match key {
            Some(key) => format!("{key} cannot be read in the header '{}'", excerpt(&text)),
            None => format!("the header is '{}'; descr, fortran_order and shape are needed", excerpt(&text)),
        };
        bad("VGS-NPY-004", message).help("the file is damaged: save the array again")
    })
}

/// Parses a dictionary such as `{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3, 4), }`. The error is the key
/// whose value cannot be read, if it is one of them.
fn parse(text: &str) -> std::result::Result<Header, Option<&'static str>> {
    let inside = text.trim().strip_prefix('{').and_then(|text| text.strip_suffix('}'));
    let mut rest = inside.ok_or(None)?.trim();
    let (mut descr, mut fortran_order, mut shape) = (None, None, None);
    while !rest.is_empty() {
        let (key, after) = quoted(rest).ok_or(None)?;
        let row = FIELDS.iter().find(|row| row.name == key).ok_or(None)?;
        let wrong = Some(row.name);
        let value = after.trim_start().strip_prefix(':').ok_or(wrong)?.trim_start();
        let after = match key {
            "descr" if value.starts_with('[') => {
                // A record of several fields, which is refused as a type; nothing after it matters then.
                return Ok(Header { descr: value.to_owned(), fortran_order: false, shape: Vec::new() });
            }
            "descr" => {
                let (text, after) = quoted(value).ok_or(wrong)?;
                descr = Some(text.to_owned());
                after
            }
            "fortran_order" => {
                let (word, is_true) =
                    if value.starts_with("True") { ("True", true) } else { ("False", false) };
                fortran_order = Some(is_true);
                value.strip_prefix(word).ok_or(wrong)?
            }
            _ => {
                let (inside, after) =
                    value.strip_prefix('(').and_then(|value| value.split_once(')')).ok_or(wrong)?;
                // Python 2 wrote some numbers as 3L.
                let words =
                    inside.split(',').map(|n| n.trim().trim_end_matches('L')).filter(|n| !n.is_empty());
                shape = Some(words.map(|n| n.parse().ok()).collect::<Option<Vec<usize>>>().ok_or(wrong)?);
                after
            }
        };
        rest = match after.trim_start() {
            "" => "",
            after => after.strip_prefix(',').ok_or(wrong)?.trim_start(),
        };
    }
    Ok(Header {
        descr: descr.ok_or(None)?,
        fortran_order: fortran_order.ok_or(None)?,
        shape: shape.ok_or(None)?,
    })
}

/// Returns the text between the quotes that `text` begins with, and what follows.
fn quoted(text: &str) -> Option<(&str, &str)> {
    let quote = text.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
    text.get(1..)?.split_once(quote)
}

/// Returns the type of a code such as `<f4`, and true if it is big-endian.
fn element(descr: &str) -> Result<(&'static Element, bool)> {
    let code = descr.trim_start_matches(['<', '>', '|', '=']);
    let order = &descr[..descr.len() - code.len()];
    let found = TYPES.iter().find(|(known, _)| *known == code).map(|(_, element)| *element);
    match (found, order) {
        (Some(element), "<" | ">") => Ok((element, order == ">")),
        (Some(element), "|" | "=" | "") if element.bytes == 1 => Ok((element, false)),
        // This is the byte order of the machine that wrote the file, which is taken to be a PC.
        (Some(element), "=") => Ok((element, false)),
        _ => Err(bad(
            "VGS-NPY-006",
            format!("the type (descr) is {}, not a single real number", excerpt(descr)),
        )
        .help("save it as such: numpy.save(name, array.astype('float32'))")),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use half::f16;

    use super::*;

    fn file(version: u8, dictionary: &str, data: &[u8]) -> Vec<u8> {
        let text = format!("{dictionary}\n");
        let mut bytes = [MAGIC, &[version, 0]].concat();
        match version {
            1 => bytes.extend((text.len() as u16).to_le_bytes()),
            _ => bytes.extend((text.len() as u32).to_le_bytes()),
        }
        [&bytes, text.as_bytes(), data].concat()
    }

    fn head(descr: &str, fortran: bool, shape: &str) -> String {
        let order = if fortran { "True" } else { "False" };
        format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}")
    }

    fn shorts(values: impl IntoIterator<Item = i16>) -> Vec<u8> {
        values.into_iter().flat_map(i16::to_le_bytes).collect()
    }

    fn count(n: usize) -> Vec<f32> {
        (0..n).map(|v| v as f32).collect()
    }

    /// Small, so that a test that passes the limit is quick.
    fn options() -> ReadOptions {
        ReadOptions { max_bytes: 1 << 16, ..ReadOptions::default() }
    }

    fn read_in(folder: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Volume> {
        let path = folder.join("a.npy");
        fs::write(&path, bytes).unwrap();
        Volume::read(&path, options)
    }

    fn read_bytes(bytes: &[u8]) -> Result<Volume> {
        crate::tests::read_both("a.npy", bytes, &options())
    }

    #[test]
    fn distances_are_those_that_are_given() {
        let given = ReadOptions { spacing_mm: Some(DVec3::new(0.5, 0.7, 3.0)), ..options() };
        let folder = tempfile::tempdir().unwrap();
        let v = read_in(folder.path(), &file(1, &head("<i2", false, "(2, 3, 4)"), &shorts(0..24)), &given);
        let v = v.unwrap();
        assert_eq!((v.spacing_mm(), v.oriented), (DVec3::new(0.5, 0.7, 3.0), false));
    }

    #[test]
    fn the_last_axis_is_x_in_either_order_of_memory() {
        let v = read_bytes(&file(1, &head("<i2", false, "(2, 3, 4)"), &shorts(0..24))).unwrap();
        assert_eq!((v.size, v.oriented, v.samples.clone()), ([4, 3, 2], false, count(24)));
        assert_eq!((v.spacing_mm(), v.world_from_voxel), (DVec3::ONE, DAffine3::IDENTITY));
        // The same array, z fastest.
        let at = |i: i16| 12 * (i % 2) + 4 * (i / 2 % 3) + i / 6;
        let f = read_bytes(&file(1, &head("<i2", true, "(2, 3, 4)"), &shorts((0..24).map(at)))).unwrap();
        assert_eq!((f.size, f.samples), (v.size, v.samples));
    }

    #[test]
    fn every_type_in_both_byte_orders_and_every_version() {
        for (name, element) in TYPES {
            let bytes = |v: u8| -> Vec<u8> {
                match name {
                    "f2" => f16::from_f32(f32::from(v)).to_le_bytes().to_vec(),
                    "f4" => f32::from(v).to_le_bytes().to_vec(),
                    "f8" => f64::from(v).to_le_bytes().to_vec(),
                    _ => u64::from(v).to_le_bytes()[..element.bytes].to_vec(),
                }
            };
            for (order, version) in [("<", 1), (">", 2), ("|", 3), ("=", 1)] {
                let one = |v| if order == ">" { bytes(v).into_iter().rev().collect() } else { bytes(v) };
                let data: Vec<u8> = (0..12).flat_map(one).collect();
                let read =
                    read_bytes(&file(version, &head(&format!("{order}{name}"), false, "(2, 2, 3)"), &data));
                match read {
                    Ok(v) => assert_eq!(v.samples, count(12), "{order}{name}"),
                    Err(e) => assert!(
                        order == "|" && element.bytes > 1 && e.code == "VGS-NPY-006",
                        "{order}{name}: {e}"
                    ),
                }
            }
        }
    }

    #[test]
    fn odd_dictionaries_are_read() {
        for text in [
            "{\"shape\":(2L,2L,3L),\"fortran_order\":False,\"descr\":\"<i2\"}",
            "  { 'fortran_order' : False , 'shape' : ( 2,2 , 3 ,) ,'descr':'<i2' ,}   ",
        ] {
            assert_eq!(read_bytes(&file(1, text, &shorts(0..12))).unwrap().samples, count(12), "{text}");
        }
    }

    #[test]
    fn one_volume_of_a_series_is_chosen() {
        let folder = tempfile::tempdir().unwrap();
        let second = ReadOptions { volume_index: Some(1), ..options() };
        let c = file(1, &head("<i2", false, "(2, 2, 2, 3)"), &shorts(0..24));
        assert_eq!(read_in(folder.path(), &c, &second).unwrap().samples, count(24)[12..]);
        let at = |i: i16| 12 * (i % 2) + 6 * (i / 2 % 2) + 3 * (i / 4 % 2) + i / 8;
        let f = file(1, &head("<i2", true, "(2, 2, 2, 3)"), &shorts((0..24).map(at)));
        assert_eq!(read_in(folder.path(), &f, &second).unwrap().samples, count(24)[12..]);
        let error = read_bytes(&c).unwrap_err();
        assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-VOL-020"));
    }

    #[test]
    fn no_field_that_cannot_be_read_counts_as_absent() {
        let good = [("descr", "'<i2'"), ("fortran_order", "False"), ("shape", "(2, 2, 3)")];
        for row in FIELDS {
            for value in row.refused {
                let entry = |(key, text): (&str, &str)| {
                    format!("'{key}': {}, ", if key == row.name { *value } else { text })
                };
                let dictionary = format!("{{{}}}", good.map(entry).concat());
                let error = read_bytes(&file(1, &dictionary, &shorts(0..12))).expect_err(row.name);
                assert_eq!(error.kind, Kind::BadData, "{error}");
                assert!(error.message.contains(row.name) && !error.help.is_empty(), "{dictionary}: {error}");
            }
        }
    }

    #[test]
    fn malformed_files_are_refused() {
        let good = head("<i2", false, "(2, 2, 3)");
        let data = shorts(0..12);
        let with = |from: &str, to: &str| file(1, &good.replace(from, to), &data);
        let mut long = file(2, &good, &data);
        long[8..12].copy_from_slice(&u32::MAX.to_le_bytes());
        let mut version = file(1, &good, &data);
        version[6] = 9;
        let wide = file(1, &head("<f8", false, "(1, 1, 1)"), &1e300_f64.to_le_bytes());
        let cases: Vec<(Vec<u8>, &str)> = vec![
            (file(1, &good, &data)[..9].to_vec(), "VGS-NPY-001"),
            (file(2, &good, &data)[..11].to_vec(), "VGS-NPY-001"),
            (file(1, &good, &data)[..40].to_vec(), "VGS-NPY-001"),
            (b"text".to_vec(), "VGS-NPY-002"),
            (version, "VGS-NPY-003"),
            (long, "VGS-NPY-003"),
            (with("{", ""), "VGS-NPY-004"),
            (with("'descr'", "'other'"), "VGS-NPY-004"),
            (with("'descr': '<i2', ", ""), "VGS-NPY-004"),
            (with("False", "No"), "VGS-NPY-004"),
            (with("(2, 2, 3)", "(2, -2, 3)"), "VGS-NPY-004"),
            (with("(2, 2, 3)", "(2, 2, 3"), "VGS-NPY-004"),
            (with("(2, 2, 3)", "(2, 6)"), "VGS-NPY-005"),
            (with("(2, 2, 3)", "()"), "VGS-NPY-005"),
            (with("(2, 2, 3)", "(1, 1, 2, 2, 3)"), "VGS-NPY-005"),
            (with("(2, 2, 3)", "(2, 0, 3)"), "VGS-NPY-005"),
            (with("(2, 2, 3)", "(0, 2, 2, 3)"), "VGS-NPY-005"),
            (with("<i2", "<c8"), "VGS-NPY-006"),
            (with("<i2", "|O"), "VGS-NPY-006"),
            (with("<i2", "<U3"), "VGS-NPY-006"),
            (with("<i2", "|i2"), "VGS-NPY-006"),
            (with("'<i2'", "[('r', '|u1'), ('g', '|u1')]"), "VGS-NPY-006"),
            (with("(2, 2, 3)", "(2, 2, 4)"), "VGS-VOL-006"),
            (with("(2, 2, 3)", "(512, 512, 512)"), "VGS-VOL-005"),
            (with("(2, 2, 3)", "(4294967296, 4294967296, 4294967296)"), "VGS-VOL-005"),
            (with("(2, 2, 3)", "(18446744073709551615, 1, 1, 2)"), "VGS-VOL-005"),
            (file(1, &head("<i2", true, "(20, 20, 30)"), &data), "VGS-VOL-006"),
            (wide, "VGS-VOL-022"),
        ];
        for (i, (bytes, expected)) in cases.into_iter().enumerate() {
            let error = read_bytes(&bytes).unwrap_err();
            assert_eq!((error.kind, error.code), (Kind::BadData, expected), "case {i}: {error}");
            assert!(error.file.is_some() && !error.help.is_empty(), "case {i}: {error:?}");
        }
    }

    #[test]
    fn damaged_bytes_never_panic() {
        let folder = tempfile::tempdir().unwrap();
        for fortran in [false, true] {
            let good = file(2, &head("<i2", fortran, "(2, 2, 3)"), &shorts(0..12));
            assert!(read_in(folder.path(), &good, &options()).is_ok());
            for end in 0..good.len() {
                assert!(read_in(folder.path(), &good[..end], &options()).is_err(), "cut at {end}");
            }
            for (at, value) in (0..good.len()).flat_map(|at| [0, b'9', b'\'', 0xff].map(|v| (at, v))) {
                let mut bytes = good.clone();
                bytes[at] = value;
                if let Ok(v) = read_in(folder.path(), &bytes, &options()) {
                    assert_eq!(v.samples.len(), v.size.iter().product::<usize>());
                }
            }
        }
    }
}
