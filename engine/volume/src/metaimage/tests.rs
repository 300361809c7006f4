//! Crafted files: what must be read, and what must be refused and how.

use std::fs;
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
    crate::tests::read_both("a.mha", bytes, &options())
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
        let beside =
            HEAD.replace("ElementDataFile = LOCAL", &format!("HeaderSize = {size}\nElementDataFile = b.raw"));
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
        (with("0.5 1 2", "0.5 nan 2"), "VGS-MHA-008"),
        (with("-0.6 0.8 0 ", "0.8 0.6 0 "), "VGS-VOL-025"),
        (with("10 -20 30", "10 inf 30"), "VGS-MHA-008"),
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

/// Returns a header with another value of a key, or with one key more.
fn with_field(key: &str, value: &str) -> String {
    let mut lines: Vec<String> = HEAD.lines().map(str::to_owned).collect();
    let line = format!("{key} = {value}");
    match lines.iter().position(|l| l.starts_with(&format!("{key} ="))) {
        Some(at) => lines[at] = line,
        None => lines.insert(1, line),
    }
    lines.join("\n") + "\n"
}

#[test]
fn no_field_that_cannot_be_read_counts_as_absent() {
    for row in FIELDS {
        for value in row.refused {
            let mut head = with_field(row.name, value);
            if row.name == "ElementSize" {
                head = head.replace("ElementSpacing = 0.5 1 2\n", "");
            }
            let error = read_bytes(&file(&head, &shorts(0..12))).expect_err(row.name);
            assert_eq!(error.kind, Kind::BadData, "{}: {error}", row.name);
            let named = error.message.contains(row.name) || error.code == "VGS-VOL-024";
            assert!(named && !error.help.is_empty(), "{} = {value}: {error}", row.name);
        }
    }
}

#[test]
fn fields_say_what_itk_takes_them_for() {
    let read = |head: &str| read_bytes(&file(head, &shorts(0..12))).unwrap();
    let good = read(HEAD);
    // Of keys that mean the same, both may be there.
    for (key, value) in [
        ("Position", "10.0 -20.0 30.0"),
        ("Rotation", "0.8 0.6 0 -0.6 0.8 0 0 0 1"),
        ("ElementByteOrderMSB", "false"),
        ("ElementSize", "9 9 9"),
        ("DistanceUnits", "mm"),
        ("CenterOfRotation", "1 2 3"),
        ("AnatomicalOrientation", "LPS"),
    ] {
        let v = read(&with_field(key, value));
        assert_eq!((v.world_from_voxel, v.samples), (good.world_from_voxel, good.samples.clone()), "{key}");
    }
    let flipped = read(&with_field("ElementSpacing", "-0.5 1 2"));
    assert_eq!(flipped.world_from_voxel.matrix3.x_axis, -good.world_from_voxel.matrix3.x_axis);
    let small = read(&with_field("DistanceUnits", "um"));
    assert!(small.world_from_voxel.translation.abs_diff_eq(good.world_from_voxel.translation * 1e-3, 1e-12));
    for (modality, unit) in
        [("MET_MOD_CT", Some(Unit::Hu)), ("MET_MOD_MR", Some(Unit::Arbitrary)), ("MET_MOD_OTHER", None)]
    {
        assert_eq!(read(&with_field("Modality", modality)).stated_unit, unit);
    }
    // A file may have a % in its name.
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("100 %.raw"), shorts(0..12)).unwrap();
    let head = with_field("ElementDataFile", "100 %.raw");
    assert_eq!(read_in(folder.path(), head.as_bytes(), &options()).unwrap().samples, good.samples);
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
