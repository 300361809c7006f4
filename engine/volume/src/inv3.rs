//! InVesalius projects (`.inv3`): a tar archive, usually gzip, of property lists and raw arrays.
//!
//! The volume is `matrix.dat`: int16 HU, little-endian, [z, y, x] with x fastest; `main.plist` gives shape
//! and spacing. The project stores no orientation. InVesalius shows x to the patient's left, y to the front
//! and z to the head, which is what is assumed here, with the origin in the middle of the lowest slice. Masks
//! and surfaces of the project are not read.

use std::io::Read;
use std::path::PathBuf;

use glam::{DAffine3, DMat3, DVec3};
use plist::Value;

use super::fields::FieldRow;
use super::source::{Source, reserve_samples};
use super::{ReadOptions, Volume};
use base::input::Input;
use base::unit::Unit;
use base::{Error, Kind, Result};

/// Name of the format.
pub const NAME: &str = "InVesalius project";
/// A main.plist is about 1.5 kB.
const MAX_PLIST: u64 = 1 << 20;
/// Greatest length of a member's name: more than the longest path of any system.
const MAX_NAME: u64 = 1 << 16;

/// What is done with the keys of `main.plist`; the others are those of masks, surfaces and views.
pub(super) const FIELDS: &[FieldRow] = &[
    FieldRow::needed(
        "dtype",
        "type of the voxels, of matrix: int16",
        &["<string>float32</string>", "<integer>2</integer>"],
    ),
    FieldRow::needed("filename", "file of the voxels, of matrix", &["<integer>2</integer>"]),
    FieldRow::needed(
        "shape",
        "size of each axis, z first, of matrix",
        &[
            "<string>2 3 4</string>",
            "<array><integer>2</integer><integer>-3</integer><integer>4</integer></array>",
        ],
    ),
    FieldRow::needed(
        "spacing",
        "distance of voxels, mm, x first",
        &["<real>1</real>", "<array><real>1</real><real>0</real><real>1</real></array>"],
    ),
    FieldRow::with_default("modality", "CT: values are HU; MRI: they are not", "the values tell", &[]),
];

/// Description of the volume in `main.plist`.
#[derive(Debug)]
struct Project {
    file_name: String,
    size: [usize; 3],
    spacing: DVec3,
    unit: Option<Unit>,
}

/// Returns true if the decoded beginning of a file is a tar header.
pub(super) fn sniff(head: &[u8]) -> bool {
    head.get(257..262) == Some(b"ustar")
}

/// Reads the volume of a project, as [`Volume::read`] does.
pub(super) fn read(input: &Input, options: &ReadOptions) -> Result<Volume> {
    if options.volume_index.is_some_and(|i| i > 0) {
        let message = "an InVesalius project holds one volume";
        return Err(Error::new(Kind::Usage, "VGS-INV-006", message).help("leave out --volume-index"));
    }
    // The order of the archive's members is not fixed, hence two passes.
    let plist = find(input, options, "main.plist", |entry, size| {
        if size > MAX_PLIST {
            return Err(bad(
                "VGS-INV-002",
                format!("main.plist has {size} bytes, more than any project needs"),
            ));
        }
        let mut text = Vec::new();
        entry.read_to_end(&mut text).map_err(damaged)?;
        Ok(text)
    })?;
    let project = project(&plist)?;
    let voxels: usize = project.size.iter().product();
    let bytes = 2 * voxels as u64;
    if bytes.max(4 * voxels as u64) > options.max_bytes {
        let message =
            format!("declares {bytes} bytes of voxels, more than the limit of {}", options.max_bytes);
        return Err(Error::new(Kind::BadData, "VGS-VOL-005", message)
            .help("if the size is right, raise the limit with --max-bytes"));
    }
    let samples = find(input, options, &project.file_name, |entry, size| {
        if size != bytes {
            let message = format!("{}: expected {bytes} bytes, got {size}", project.file_name);
            return Err(bad("VGS-INV-004", message));
        }
        let mut samples = reserve_samples(voxels, options.max_bytes)?;
        let mut block = vec![0; 1 << 16];
        let mut left = bytes as usize;
        while left > 0 {
            let n = left.min(block.len());
            entry.read_exact(&mut block[..n]).map_err(damaged)?;
            samples.extend(block[..n].as_chunks().0.iter().map(|&b| f32::from(i16::from_le_bytes(b))));
            left -= n;
        }
        Ok(samples)
    })?;
    tracing::warn!(
        "{}: InVesalius projects store no orientation: x is taken to the patient's left, y to the front, z to the \
         head",
        input.name().display()
    );
    let affine = assumed_affine(project.size, project.spacing);
    Ok(Volume { stated_unit: project.unit, ..Volume::new(project.size, affine, samples) })
}

fn bad(code: &'static str, message: impl Into<String>) -> Error {
    Error::new(Kind::BadData, code, message)
}

/// Returns the error of a damaged archive, or an I/O error if reading itself failed.
fn damaged(e: std::io::Error) -> Error {
    use std::io::ErrorKind as E;
    match e.kind() {
        E::InvalidInput | E::InvalidData | E::UnexpectedEof | E::Other => {
            bad("VGS-INV-001", format!("the archive is damaged: {e}")).help("copy the file again")
        }
        _ => Error::new(Kind::Io, "VGS-IO-001", format!("reading: {e}")),
    }
}

/// Finds the member called `name`, in any folder of the archive, and passes it with its size to `use_entry`.
fn find<T>(
    input: &Input,
    options: &ReadOptions,
    name: &str,
    use_entry: impl FnOnce(&mut dyn Read, u64) -> Result<T>,
) -> Result<T> {
    let mut archive = tar::Archive::new(Source::open(input, options.lenient)?);
    let mut use_entry = Some(use_entry);
    let mut found = None;
    // A name too long for its header comes before its member. The tar crate would read it whole, whatever its
    // size; hence raw entries.
    let mut long_name = None;
    for entry in archive.entries().map_err(damaged)?.raw(true) {
        let mut entry = entry.map_err(damaged)?;
        let kind = entry.header().entry_type();
        if kind.is_gnu_longname() || kind.is_pax_local_extensions() {
            long_name = read_name(&mut entry)?.or(long_name);
            continue;
        }
        let path = match long_name.take() {
            Some(path) => path,
            None => entry.path().map(PathBuf::from).unwrap_or_default(),
        };
        let is_it = path.file_name().is_some_and(|f| f == name);
        if is_it && entry.header().entry_type().is_file() {
            let size = entry.size();
            let take = use_entry.take().expect("only the first member of the name is used");
            found = Some(take(&mut entry, size)?);
            break;
        }
    }
    // Read to the end, so that the checksum of the whole file is checked.
    archive.into_inner().finish(options.max_bytes.saturating_mul(4))?;
    found.ok_or_else(|| {
        bad("VGS-INV-003", format!("an archive without {name}: not an InVesalius project"))
            .help("choose a .inv3 file, or a NIfTI volume")
    })
}

/// Reads the name of a file from the member before it: all of it (GNU), or the line `path` of a list (PAX).
fn read_name(entry: &mut tar::Entry<impl Read>) -> Result<Option<PathBuf>> {
    let size = entry.size();
    if size > MAX_NAME {
        let message = format!("a member of the archive has a name or a list of {size} bytes");
        return Err(bad("VGS-INV-007", message).help("save the project again with InVesalius"));
    }
    let mut bytes = Vec::new();
    entry.read_to_end(&mut bytes).map_err(damaged)?;
    let text = |bytes: &[u8]| PathBuf::from(String::from_utf8_lossy(bytes).trim_end_matches('\0'));
    if entry.header().entry_type().is_gnu_longname() {
        return Ok(Some(text(&bytes)));
    }
    let mut lines = tar::PaxExtensions::new(&bytes).flatten();
    Ok(lines.find(|line| line.key_bytes() == b"path").map(|line| text(line.value_bytes())))
}

fn project(plist: &[u8]) -> Result<Project> {
    let wrong = |what: &str| {
        bad("VGS-INV-005", format!("main.plist: {what}")).help("save the project again with InVesalius")
    };
    let root = Value::from_reader_xml(plist).map_err(|e| wrong(&format!("not a property list: {e}")))?;
    let root = root.as_dictionary().ok_or_else(|| wrong("not a dictionary"))?;
    let matrix = root
        .get("matrix")
        .and_then(Value::as_dictionary)
        .ok_or_else(|| wrong("no dictionary 'matrix', which describes the volume"))?;
    let text = |key| matrix.get(key).and_then(Value::as_string);
    match text("dtype") {
        Some("int16") => {}
        other => {
            let found = other.unwrap_or(if matrix.contains_key("dtype") { "no text" } else { "missing" });
            return Err(wrong(&format!("matrix dtype is {found}, int16 is needed")));
        }
    }
    let file_name =
        text("filename").ok_or_else(|| wrong("matrix filename is missing or no text"))?.to_owned();
    let shape: Option<Vec<usize>> = matrix.get("shape").and_then(Value::as_array).and_then(|a| {
        a.iter().map(|v| usize::try_from(v.as_unsigned_integer()?).ok().filter(|&n| n > 0)).collect()
    });
    let Some([z, y, x]) = shape.and_then(|s| <[usize; 3]>::try_from(s).ok()) else {
        return Err(wrong("matrix shape is not three positive integers"));
    };
    if x.checked_mul(y).and_then(|n| n.checked_mul(z)).and_then(|n| n.checked_mul(4)).is_none() {
        return Err(wrong("matrix shape is more than any memory holds"));
    }
    let real = |v: &Value| v.as_real().or_else(|| v.as_signed_integer().map(|i| i as f64));
    let spacing: Option<Vec<f64>> = root
        .get("spacing")
        .and_then(Value::as_array)
        .and_then(|a| a.iter().map(|v| real(v).filter(|s| (1e-6..1e6).contains(s))).collect());
    let Some(spacing) = spacing.and_then(|s| <[f64; 3]>::try_from(s).ok()) else {
        return Err(wrong("spacing is not three positive lengths in mm"));
    };
    let unit = match root.get("modality").and_then(Value::as_string) {
        Some("CT") => Some(Unit::Hu),
        Some("MRI" | "MR") => Some(Unit::Arbitrary),
        _ => None,
    };
    Ok(Project { file_name, size: [x, y, z], spacing: DVec3::from_array(spacing), unit })
}

/// Returns the affine that is assumed: x to the left, y to the front, z up; the middle of the first slice at
/// the origin.
fn assumed_affine(size: [usize; 3], spacing: DVec3) -> DAffine3 {
    let half = |axis: usize| spacing[axis] * (size[axis] as f64 - 1.0) / 2.0;
    DAffine3 {
        matrix3: DMat3::from_diagonal(DVec3::new(-spacing.x, spacing.y, spacing.z)),
        translation: DVec3::new(half(0), -half(1), 0.0),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use flate2::{Compression, write::GzEncoder};
    use proptest::prelude::*;

    use super::*;

    fn main_plist(dtype: &str, shape: &str, spacing: &str) -> String {
        let list = |tag: &str, text: &str| -> String {
            text.split_whitespace().map(|v| format!("<{tag}>{v}</{tag}>")).collect()
        };
        format!(
            "<?xml version=\"1.0\"?><plist version=\"1.0\"><dict><key>matrix</key><dict>\
             <key>dtype</key><string>{dtype}</string><key>filename</key><string>matrix.dat</string>\
             <key>shape</key><array>{}</array></dict><key>spacing</key><array>{}</array></dict></plist>",
            list("integer", shape),
            list("real", spacing)
        )
    }

    fn archive(members: &[(&str, &[u8])]) -> Vec<u8> {
        let mut builder = tar::Builder::new(Vec::new());
        for (name, data) in members {
            let mut header = tar::Header::new_ustar();
            header.set_size(data.len() as u64);
            header.set_mode(0o644);
            builder.append_data(&mut header, format!("folder/{name}"), *data).unwrap();
        }
        builder.into_inner().unwrap()
    }

    fn gzip(data: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(data).unwrap();
        encoder.finish().unwrap()
    }

    fn read_bytes(bytes: &[u8]) -> Result<Volume> {
        let options = ReadOptions { max_bytes: 1 << 20, ..ReadOptions::default() };
        crate::tests::read_both("a.inv3", bytes, &options)
    }

    #[test]
    fn reads_plain_and_gzip_archives_in_either_order() {
        let plist = main_plist("int16", "2 3 4", "0.5 0.75 2");
        let matrix: Vec<u8> = (0..24_i16).flat_map(|v| (v - 1000).to_le_bytes()).collect();
        let members = [("main.plist", plist.as_bytes()), ("matrix.dat", &matrix)];
        let swapped = [members[1], members[0]];
        for bytes in [archive(&members), gzip(&archive(&members)), gzip(&archive(&swapped))] {
            let v = read_bytes(&bytes).unwrap();
            assert_eq!(v.size, [4, 3, 2]);
            assert_eq!(v.samples[v.index(1, 2, 1)], 21.0 - 1000.0);
            assert_eq!(v.axis_codes(), "LAS");
            assert_eq!(v.spacing_mm(), DVec3::new(0.5, 0.75, 2.0));
            assert_eq!(v.world_from_voxel.translation, DVec3::new(0.75, -0.75, 0.0));
        }
    }

    /// What comes before a member to say more of it than its header holds.
    fn extension(kind: tar::EntryType, data: &[u8]) -> Vec<u8> {
        let mut header = tar::Header::new_ustar();
        header.set_entry_type(kind);
        header.set_size(data.len() as u64);
        header.set_path("more").unwrap();
        header.set_cksum();
        let mut bytes = [header.as_bytes(), data].concat();
        bytes.resize(bytes.len().next_multiple_of(512), 0);
        bytes
    }

    #[test]
    fn names_that_come_before_their_members_are_read_and_bounded() {
        let plist = main_plist("int16", "2 3 4", "1 1 1");
        let rest = archive(&[("matrix.dat", &[0; 48])]);
        let named = |name: Vec<u8>| {
            let mut plist = archive(&[("cut-o", plist.as_bytes())]);
            plist.truncate(plist.len() - 1024);
            [name, plist, rest.clone()].concat()
        };
        let gnu = extension(tar::EntryType::GNULongName, b"a/very/long/way/main.plist\0");
        let pax = extension(tar::EntryType::XHeader, b"17 path=a/main.plist\n".as_slice());
        let pax_with_time = extension(tar::EntryType::XHeader, b"14 mtime=1.25\n21 path=a/main.plist\n");
        assert_eq!(read_bytes(&named(gnu)).unwrap().size, [4, 3, 2]);
        assert_eq!(read_bytes(&named(pax_with_time)).unwrap().size, [4, 3, 2]);
        assert!(read_bytes(&named(pax)).is_err(), "a line of another length than it says is none");
        for kind in [tar::EntryType::GNULongName, tar::EntryType::XHeader] {
            let huge = gzip(&named(extension(kind, &vec![b'x'; 8 << 20])));
            assert_eq!(read_bytes(&huge).unwrap_err().code, "VGS-INV-007");
        }
    }

    #[test]
    fn no_field_that_cannot_be_read_counts_as_absent() {
        let good = main_plist("int16", "2 3 4", "1 1 1");
        for row in FIELDS {
            for value in row.refused {
                let (before, after) = good.split_once(&format!("<key>{}</key>", row.name)).expect("a key");
                // The value ends where the next key or the dictionary does.
                let end = after.find("<key>").into_iter().chain(after.find("</dict>")).min().expect("an end");
                let plist = format!("{before}<key>{}</key>{value}{}", row.name, &after[end..]);
                let error =
                    read_bytes(&archive(&[("main.plist", plist.as_bytes()), ("matrix.dat", &[0; 48])]))
                        .expect_err(row.name);
                assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-INV-005"), "{error}");
                assert!(error.message.contains(row.name), "{value}: {error}");
            }
        }
        for (modality, unit) in [("CT", Some(Unit::Hu)), ("MRI", Some(Unit::Arbitrary)), ("UNKNOWN", None)] {
            let plist = good.replace(
                "<key>spacing",
                &format!("<key>modality</key><string>{modality}</string><key>spacing"),
            );
            let bytes = archive(&[("main.plist", plist.as_bytes()), ("matrix.dat", &[0; 48])]);
            assert_eq!(read_bytes(&bytes).unwrap().stated_unit, unit, "{modality}");
        }
    }

    #[test]
    fn malformed_projects_are_refused() {
        let matrix = [0_u8; 48];
        let good = main_plist("int16", "2 3 4", "1 1 1");
        let with = |plist: &str| archive(&[("main.plist", plist.as_bytes()), ("matrix.dat", &matrix)]);
        let mut cut = gzip(&with(&good));
        cut.truncate(cut.len() / 2);
        let mut flipped = gzip(&with(&good));
        let crc = flipped.len() - 8;
        flipped[crc] ^= 1;
        let cases = [
            (with(&main_plist("float32", "2 3 4", "1 1 1")), "VGS-INV-005"),
            (with(&main_plist("int16", "2 3", "1 1 1")), "VGS-INV-005"),
            (with(&main_plist("int16", "2 3 -4", "1 1 1")), "VGS-INV-005"),
            (with(&main_plist("int16", "4294967296 4294967296 4294967296", "1 1 1")), "VGS-INV-005"),
            (with(&main_plist("int16", "2 3 4", "1 nan 1")), "VGS-INV-005"),
            (with(&main_plist("int16", "2 3 4", "1 0 1")), "VGS-INV-005"),
            (with(&main_plist("int16", "2 3 4", "1 1 1e300")), "VGS-INV-005"),
            (with("<plist"), "VGS-INV-005"),
            (with(&main_plist("int16", "2 3 5", "1 1 1")), "VGS-INV-004"),
            (with(&main_plist("int16", "2000 3000 4000", "1 1 1")), "VGS-VOL-005"),
            (archive(&[("main.plist", good.as_bytes())]), "VGS-INV-003"),
            (archive(&[("other.txt", b"x")]), "VGS-INV-003"),
            (archive(&[("main.plist", &vec![b' '; 2 << 20])]), "VGS-INV-002"),
            (cut, "VGS-VOL-008"),
            (flipped, "VGS-VOL-007"),
        ];
        for (i, (bytes, code)) in cases.into_iter().enumerate() {
            let error = read_bytes(&bytes).unwrap_err();
            assert_eq!((error.kind, error.code), (Kind::BadData, code), "case {i}: {error}");
            assert!(error.file.is_some());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn damaged_bytes_never_panic(
            damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
            gz in any::<bool>(),
        ) {
            let plist = main_plist("int16", "2 3 4", "1 1 1");
            let mut bytes = archive(&[("main.plist", plist.as_bytes()), ("matrix.dat", &[0; 48])]);
            if gz {
                bytes = gzip(&bytes);
            }
            // The zeros at the end of an archive hold nothing worth damaging.
            let reach = bytes.len().min(2048);
            for (place, value) in damage {
                bytes[place.index(reach)] = value;
            }
            if let Ok(v) = read_bytes(&bytes) {
                prop_assert_eq!(v.samples.len(), v.size.iter().product::<usize>());
            }
        }
    }
}
