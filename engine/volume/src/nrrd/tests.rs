//! Crafted files: what must be read, and what must be refused and how.

use std::fs;
use std::io::Write;
use std::path::Path;

use flate2::{Compression, write::GzEncoder};
use glam::DVec3;

use super::*;
use base::Kind;

/// 3 × 2 × 2 int16, oblique, in LPS.
const HEAD: &str = "NRRD0004\n# a comment\ntype: short\ndimension: 3\nspace: left-posterior-superior\n\
                    sizes: 3 2 2\nspace directions: (0.4,0.3,0) (-0.6,0.8,0) (0,0,2)\nkinds: domain domain domain\n\
                    endian: little\nencoding: raw\nspace origin: (10,-20,30)\n";

fn count(n: usize) -> Vec<f32> {
    (0..n).map(|v| v as f32).collect()
}

fn shorts(values: std::ops::Range<i16>) -> Vec<u8> {
    values.flat_map(i16::to_le_bytes).collect()
}

fn gzip(data: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(data).unwrap();
    encoder.finish().unwrap()
}

/// Returns a file of a header, the empty line, and the bytes that follow.
fn file(head: &str, voxels: &[u8]) -> Vec<u8> {
    [head.as_bytes(), b"\n", voxels].concat()
}

/// Small, so that a test that passes the limit is quick.
fn options() -> ReadOptions {
    ReadOptions { max_bytes: 1 << 16, ..ReadOptions::default() }
}

fn read_in(folder: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Volume> {
    let path = folder.join("a.nrrd");
    fs::write(&path, bytes).unwrap();
    Volume::read(&path, options)
}

fn read_bytes(bytes: &[u8]) -> Result<Volume> {
    crate::tests::read_both("a.nrrd", bytes, &options())
}

fn code(bytes: &[u8]) -> &'static str {
    let error = read_bytes(bytes).unwrap_err();
    assert!(error.file.is_some() && error.kind != Kind::Internal, "{error}");
    error.code
}

#[test]
fn the_affine_is_taken_from_lps_to_ras() {
    let v = read_bytes(&file(HEAD, &shorts(0..12))).unwrap();
    assert_eq!((v.size, v.oriented, v.samples.clone()), ([3, 2, 2], true, count(12)));
    let m = v.world_from_voxel.matrix3;
    assert_eq!(m.x_axis, DVec3::new(-0.4, -0.3, 0.0));
    assert_eq!(m.y_axis, DVec3::new(0.6, -0.8, 0.0));
    assert_eq!(m.z_axis, DVec3::new(0.0, 0.0, 2.0));
    assert_eq!(v.world_from_voxel.translation, DVec3::new(-10.0, 20.0, 30.0));
    assert_eq!(v.axis_codes(), "LPS");
    for (space, oriented, axes) in [
        ("left-posterior-superior-time", true, "LPS"),
        ("LPS", true, "LPS"),
        ("RAS", true, "RAS"),
        ("right-anterior-superior", true, "RAS"),
        ("las", true, "LAS"),
        ("Left-Anterior-Superior", true, "LAS"),
        ("scanner-xyz", false, "???"),
        ("3D-right-handed", false, "???"),
    ] {
        let head = HEAD.replace("left-posterior-superior", space);
        let v = read_bytes(&file(&head, &shorts(0..12))).unwrap();
        assert_eq!((v.oriented, v.axis_codes().as_str()), (oriented, axes), "{space}");
    }
    let units = format!("{HEAD}space units: \"m\" \"cm\" \"mm\"\n");
    let v = read_bytes(&file(&units, &shorts(0..12))).unwrap();
    assert_eq!(v.world_from_voxel.translation, DVec3::new(-10_000.0, 200.0, 30.0));
}

#[test]
fn every_type_by_every_name_in_both_byte_orders() {
    let bytes = |name: &str, v: u8| -> Vec<u8> {
        match name {
            "int8" | "uint8" => vec![v],
            "int16" | "uint16" => u16::from(v).to_le_bytes().to_vec(),
            "int32" | "uint32" => u32::from(v).to_le_bytes().to_vec(),
            "int64" | "uint64" => u64::from(v).to_le_bytes().to_vec(),
            "float32" => f32::from(v).to_le_bytes().to_vec(),
            _ => f64::from(v).to_le_bytes().to_vec(),
        }
    };
    for (element, names) in header::TYPES {
        for (name, big) in names.iter().flat_map(|name| [(name, false), (name, true)]) {
            let mut head = HEAD.replace("type: short", &format!("type: {}", name.to_uppercase()));
            if big {
                head = head.replace("little", "big");
            }
            let one = |v: u8| -> Vec<u8> {
                let bytes = bytes(element.name, v);
                if big { bytes.into_iter().rev().collect() } else { bytes }
            };
            let voxels: Vec<u8> = (0..12).flat_map(one).collect();
            assert_eq!(read_bytes(&file(&head, &voxels)).unwrap().samples, count(12), "{name} {big}");
        }
    }
    let signed = HEAD.replace("type: short", "type: signed  char").replace("endian: little\n", "");
    let v = read_bytes(&file(&signed, &[0xff; 12])).unwrap();
    assert_eq!(v.samples, vec![-1.0; 12]);
}

#[test]
fn every_encoding_attached_and_detached() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let voxels = shorts(0..12);
    let text = "0 1\t2,3\n4 5 6 7\r\n8 9 1e1 11.0\n".to_owned();
    let two = [gzip(&voxels[..10]), gzip(&voxels[10..])].concat();
    let padded = [gzip(&voxels), vec![0; 3]].concat();
    let cases: [(&str, &[u8]); 9] = [
        ("raw", &voxels),
        ("RAW", &voxels),
        ("gzip", &gzip(&voxels)),
        ("gz", &two),
        ("gzip", &padded),
        ("ascii", text.as_bytes()),
        ("text", text.as_bytes()),
        ("txt", text.trim_end().as_bytes()),
        ("ascii", b"0 1 2 3 4 5 6 7 8 9 10 11 and more"),
    ];
    for (encoding, content) in cases {
        let head = HEAD.replace("encoding: raw", &format!("encoding: {encoding}"));
        for end in ["\n", "\r\n"] {
            let head = head.replace('\n', end);
            let attached = [head.as_bytes(), end.as_bytes(), content].concat();
            assert_eq!(read_in(folder, &attached, &options()).unwrap().samples, count(12), "{encoding}");
            // The file as a whole may be gzip, too.
            assert_eq!(
                read_in(folder, &gzip(&attached), &options()).unwrap().samples,
                count(12),
                "{encoding}"
            );
        }
        for name in ["voxels of a.bin", "./b.bin", "below\\c.bin"] {
            fs::create_dir_all(folder.join("below")).unwrap();
            fs::write(folder.join(name.replace('\\', "/")), content).unwrap();
            // With the empty line and without.
            for end in ["", "\n"] {
                let head = format!("{head}Data File: {name}\n{end}");
                assert_eq!(
                    read_in(folder, head.as_bytes(), &options()).unwrap().samples,
                    count(12),
                    "{name}"
                );
            }
        }
    }
}

#[test]
fn lines_and_bytes_are_skipped() {
    let voxels = shorts(0..12);
    let gz = HEAD.replace("encoding: raw", "encoding: gzip");
    let cases: [(String, Vec<u8>); 7] = [
        (format!("{HEAD}line skip: 2\nbyteskip: 3\n"), [b"P5\n255\nabc", voxels.as_slice()].concat()),
        (format!("{HEAD}byte skip: -1\n"), [b"of any length", voxels.as_slice()].concat()),
        (format!("{HEAD}byte skip: -1\nline skip: 1\n"), [b"a\nbc", voxels.as_slice()].concat()),
        (format!("{HEAD}byte skip: -3\n"), [b"before", voxels.as_slice(), b"xy"].concat()),
        (format!("{HEAD}byte skip: 0\n"), voxels.clone()),
        // Lines are skipped before the bytes are unpacked, and bytes after it.
        (
            format!("{gz}line skip: 1\nbyte skip: 4\n"),
            [b"x\n", gzip(&[&[9; 4], &voxels[..]].concat()).as_slice()].concat(),
        ),
        (format!("{HEAD}byte skip: 5\n"), [b"abcde", voxels.as_slice(), b"more"].concat()),
    ];
    for (head, content) in cases {
        let v = read_bytes(&file(&head, &content)).unwrap_or_else(|e| panic!("{head}: {e}"));
        assert_eq!(v.samples, count(12), "{head}");
    }
    for (skip, expected) in [
        ("byte skip: 40\n", "VGS-VOL-006"),
        ("byte skip: 9223372036854775807\n", "VGS-VOL-006"),
        ("byte skip: -9223372036854775808\n", "VGS-VOL-006"),
        ("byte skip: -2\n", "VGS-VOL-006"),
        ("line skip: 99999999999\n", "VGS-VOL-006"),
        ("line skip: -1\n", "VGS-NRD-018"),
        ("byte skip: x\n", "VGS-NRD-018"),
    ] {
        assert_eq!(code(&file(&format!("{HEAD}{skip}"), &shorts(0..12))), expected, "{skip}");
    }
    assert_eq!(code(&file(&format!("{gz}byte skip: -1\n"), &gzip(&voxels))), "VGS-NRD-018");
    assert_eq!(code(&file(&format!("{gz}byte skip: 1000000\n"), &gzip(&voxels))), "VGS-VOL-006");
}

#[test]
fn a_series_may_be_any_axis() {
    // Number v of volume t is 100 t + v; 12 voxels, 3 volumes.
    let number = |t: usize, v: usize| (100 * t + v) as i16;
    let last: Vec<i16> = (0..36).map(|i| number(i / 12, i % 12)).collect();
    let first: Vec<i16> = (0..36).map(|i| number(i % 3, i / 3)).collect();
    let middle: Vec<i16> = (0..36).map(|i| number(i / 3 % 3, i % 3 + 3 * (i / 9))).collect();
    let [a, b, c] = ["(0.4,0.3,0)", "(-0.6,0.8,0)", "(0,0,2)"];
    let cases = [
        (format!("3 2 2 3|{a} {b} {c} none|domain domain domain list"), &last),
        (format!("3 2 2 3|{a} {b} {c} (nan,nan,nan)|domain domain domain time"), &last),
        (format!("3 3 2 2|none {a} {b} {c}|list domain domain domain"), &first),
        (format!("3 3 2 2|none {a} {b} {c}|??? space space space"), &first),
        (format!("3 3 2 2|{a} none {b} {c}|space none space space"), &middle),
        ("3 2 2 3|(1,0,0,0) (0,1,0,0) (0,0,1,0) (0,0,0,1)|domain domain domain domain".to_owned(), &last),
    ];
    for (case, numbers) in cases {
        let [sizes, directions, kinds] = case.split('|').collect::<Vec<_>>().try_into().unwrap();
        let head = format!(
            "NRRD0005\ntype: int16\ndimension: 4\nspace: RAS\nsizes: {sizes}\nspace directions: {directions}\n\
             kinds: {kinds}\nendian: little\nencoding: raw\nspace origin: (0,0,0)\n"
        );
        let voxels: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
        let bytes = file(&head, &voxels);
        let folder = tempfile::tempdir().unwrap();
        for t in 0..3 {
            let chosen = ReadOptions { volume_index: Some(t), ..options() };
            let v = read_in(folder.path(), &bytes, &chosen).unwrap_or_else(|e| panic!("{case}: {e}"));
            let expected: Vec<f32> = (0..12).map(|v| f32::from(number(t, v))).collect();
            assert_eq!((v.size, v.samples), ([3, 2, 2], expected), "{case}");
        }
        for asked in [None, Some(3)] {
            let options = ReadOptions { volume_index: asked, ..options() };
            let error = read_in(folder.path(), &bytes, &options).unwrap_err();
            assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-VOL-020"), "{error}");
            assert!(error.help.contains("0..2"), "{}", error.help);
        }
        assert_eq!(code(&file(&head, &voxels[..voxels.len() - 1])), "VGS-VOL-020");
    }
}

#[test]
fn without_directions_the_orientation_is_unknown() {
    let head = "NRRD0001\ntype: uchar\ndimension: 3\nsizes: 3 2 2\nencoding: raw\n";
    let cases = [
        ("", DVec3::ONE, DVec3::ZERO),
        ("spacings: 0.5 2 3\n", DVec3::new(0.5, 2.0, 3.0), DVec3::ZERO),
        ("spacings: 0.5 -2 nan\naxis mins: 1 2 NaN\n", DVec3::new(0.5, 2.0, 1.0), DVec3::new(1.0, 2.0, 0.0)),
        // The numbers of the ends and of the voxels: 3 2 2.
        (
            "axis mins: 0 0 1\naxis maxs: 6 4 4\ncenterings: cell cell node\n",
            DVec3::new(2.0, 2.0, 3.0),
            DVec3::new(1.0, 1.0, 1.0),
        ),
        (
            "spacings: 0.5 2 3\naxismins: 1 2 3\ncenterings: cell node ???\n",
            DVec3::new(0.5, 2.0, 3.0),
            DVec3::new(1.25, 2.0, 3.0),
        ),
        ("spacings: 500 500 500\nunits: \"um\" \"um\" \"um\"\nspace: RAS\n", DVec3::splat(0.5), DVec3::ZERO),
    ];
    for (fields, spacing, origin) in cases {
        let v = read_bytes(&file(&format!("{head}{fields}"), &[7; 12])).unwrap();
        assert_eq!((v.oriented, v.axis_codes().as_str()), (false, "???"), "{fields}");
        assert!(v.spacing_mm().abs_diff_eq(spacing, 1e-12), "{fields}: {:?}", v.spacing_mm());
        assert_eq!(v.world_from_voxel.translation, origin, "{fields}");
    }
    for (fields, expected) in [
        ("spacings: 1 2\n", "VGS-NRD-015"),
        ("spacings: 1 2 x\n", "VGS-NRD-015"),
        ("spacings: 1 0 1\n", "VGS-NRD-016"),
        ("spacings: 1 inf 1\n", "VGS-NRD-015"),
        ("axis mins: 0 0 0\naxis maxs: 6 4 4\n", "VGS-NRD-024"),
    ] {
        assert_eq!(code(&file(&format!("{head}{fields}"), &[7; 12])), expected, "{fields}");
    }
}

#[test]
fn segmentations_carry_the_names_of_their_labels() {
    let keys = "Segment0_ID:=Segment_1\nSegment0_LabelValue:=3\nSegment0_Layer:=0\nSegment0_Name:=left kidney\n\
                Segment10_LabelValue:=7\nSegment10_Layer:=0\nSegment10_Name:=a\\nb: c\nSegment1_Extent:=0 1\n\
                SegmentX_Name:=no\nSegmentation_ContainedRepresentationNames:=Binary labelmap|\n";
    let expected = [(3, "left kidney".to_owned()), (7, "a b: c".to_owned())].into();
    let v = read_bytes(&file(&format!("{HEAD}{keys}"), &shorts(0..12))).unwrap();
    assert_eq!(v.labels, expected);
    let layers = |n: usize| {
        let head = HEAD
            .replace("dimension: 3", "dimension: 4")
            .replace("sizes: 3", &format!("sizes: {n} 3"))
            .replace("directions: ", "directions: none ")
            .replace("kinds: ", "kinds: list ");
        file(&format!("{head}{keys}"), &shorts(0..12 * n as i16))
    };
    assert_eq!(read_bytes(&layers(1)).unwrap().labels, expected);
    let folder = tempfile::tempdir().unwrap();
    for volume_index in [None, Some(1)] {
        let error =
            read_in(folder.path(), &layers(2), &ReadOptions { volume_index, ..options() }).unwrap_err();
        assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-NRD-013"));
        assert!(error.help.contains("export it as a label map"), "{}", error.help);
    }
    let wrong = keys.replace(":=7", ":=7.5");
    assert_eq!(code(&file(&format!("{HEAD}{wrong}"), &shorts(0..12))), "VGS-NRD-012");
    let old = format!("{HEAD}Segment0_Name:=old\n");
    assert_eq!(read_bytes(&file(&old, &shorts(0..12))).unwrap().labels, [(1, "old".to_owned())].into());
}

/// Returns a file with another value in one field, where that field is used.
fn with_field(name: &str, value: &str) -> Vec<u8> {
    let mut lines: Vec<String> = HEAD.lines().map(str::to_owned).collect();
    if ["spacings", "units", "axis mins", "axis maxs", "centerings"].contains(&name) {
        lines.retain(|line| !line.starts_with("space"));
    }
    let line = format!("{name}: {value}");
    match lines.iter().position(|l| l.starts_with(&format!("{name}:"))) {
        Some(at) => lines[at] = line,
        None => lines.push(line),
    }
    file(&(lines.join("\n") + "\n"), &shorts(0..12))
}

#[test]
fn no_field_that_cannot_be_read_counts_as_absent() {
    for row in FIELDS {
        for value in row.refused {
            let error = read_bytes(&with_field(row.name, value)).expect_err(row.name);
            assert_eq!(error.kind, Kind::BadData, "{}: {value}: {error}", row.name);
            let named = error.message.contains(&format!("'{}", row.name)) || error.code == "VGS-VOL-024";
            assert!(named && !error.help.is_empty(), "{}: {value}: {error}", row.name);
        }
    }
}

#[test]
fn names_of_fields_are_those_of_the_format() {
    for (name, meant) in
        [("spacing", "spacings"), ("space direction", "space directions"), ("endain", "endian")]
    {
        let error = read_bytes(&with_field(name, "1 1 2"));
        // Two letters that are exchanged are one mistake.
        let error = error.expect_err(name);
        assert_eq!(error.code, "VGS-NRD-019");
        assert!(error.message.contains(&format!("'{meant}'")), "{error}");
    }
    // Others are none of the format's, and no voxel depends on them.
    assert_eq!(read_bytes(&with_field("my remark", "x")).unwrap().samples, count(12));
}

#[test]
fn lengths_have_the_unit_of_the_file_quoted_or_not() {
    for (value, length) in [
        (r#""mm" "mm" "mm""#, 2.0),
        (r#""m" "m" "m""#, 2000.0),
        ("m m m", 2000.0),
        (r#""um" "" "cm""#, 20.0),
        (r#""mm" "mm" "mm" "s""#, 2.0),
    ] {
        let v = read_bytes(&with_field("space units", value)).unwrap();
        assert!((v.spacing_mm().z - length).abs() < 1e-9, "{value}: {}", v.spacing_mm());
    }
}

#[test]
fn spacings_beside_directions_must_agree_with_them() {
    let good = read_bytes(&file(HEAD, &shorts(0..12))).unwrap();
    let with = |value: &str| read_bytes(&file(&format!("{HEAD}spacings: {value}\n"), &shorts(0..12)));
    for value in ["0.5 1 2", "nan nan nan", "0.5 nan -2.0001"] {
        assert_eq!(with(value).unwrap().world_from_voxel, good.world_from_voxel, "{value}");
    }
    let error = with("1 1 2").unwrap_err();
    assert_eq!(error.code, "VGS-NRD-023");
    assert!(
        error.message.contains("'spacings' of axis 0 is 1") && error.message.contains("0.5 long"),
        "{error}"
    );
}

#[test]
fn a_file_of_voxels_may_have_a_percent_sign_in_its_name() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["100%.raw", "100 %.raw", "50% of a 3.raw"] {
        fs::write(folder.path().join(name), shorts(0..12)).unwrap();
        let head = format!("{HEAD}data file: {name}\n");
        assert_eq!(read_in(folder.path(), head.as_bytes(), &options()).unwrap().samples, count(12), "{name}");
    }
}

#[test]
fn malformed_files_are_refused() {
    let voxels = shorts(0..12);
    let with = |from: &str, to: &str| {
        assert!(HEAD.contains(from), "{from}");
        file(&HEAD.replace(from, to), &voxels)
    };
    let gz = HEAD.replace("encoding: raw", "encoding: gzip");
    let packed = gzip(&voxels);
    let mut flipped = packed.clone();
    let checksum = flipped.len() - 8;
    flipped[checksum] ^= 1;
    let head_4d = |kind: &str| {
        HEAD.replace("dimension: 3", "dimension: 4")
            .replace("sizes: 3", "sizes: 3 3")
            .replace("directions: ", "directions: none ")
            .replace("kinds: ", &format!("kinds: {kind} "))
    };
    let huge = "sizes: 4294967296 4294967296 4294967296";
    let cases: Vec<(Vec<u8>, &str)> = vec![
        (with("NRRD0004", "NRRD0009"), "VGS-NRD-001"),
        (with("NRRD0004", "NRRD00041"), "VGS-NRD-001"),
        (b"NRRD0004".to_vec(), "VGS-NRD-003"),
        (HEAD.as_bytes().to_vec(), "VGS-NRD-003"),
        (with("# a comment", "a comment"), "VGS-NRD-002"),
        (with("# a comment", "type: short"), "VGS-NRD-002"),
        (with("# a comment", &"x".repeat(2 << 20)), "VGS-VOL-023"),
        (with("type: short\n", ""), "VGS-NRD-004"),
        (with("dimension: 3\n", ""), "VGS-NRD-004"),
        (with("sizes: 3 2 2\n", ""), "VGS-NRD-004"),
        (with("encoding: raw\n", ""), "VGS-NRD-004"),
        (with("type: short", "type: block"), "VGS-NRD-005"),
        (with("type: short", "type: char"), "VGS-NRD-005"),
        (with("encoding: raw", "encoding: bzip2"), "VGS-NRD-006"),
        (with("encoding: raw", "encoding: hex"), "VGS-NRD-006"),
        (with("endian: little\n", ""), "VGS-NRD-007"),
        (with("endian: little", "endian: middle"), "VGS-NRD-007"),
        (with("dimension: 3", "dimension: 0"), "VGS-NRD-008"),
        (with("dimension: 3", "dimension: 17"), "VGS-NRD-008"),
        (with("dimension: 3", "dimension: 4"), "VGS-NRD-008"),
        (with("dimension: 3", "dimension: -3"), "VGS-NRD-008"),
        (with("sizes: 3", "sizes: 0"), "VGS-NRD-008"),
        (with("sizes: 3", "sizes: -3"), "VGS-NRD-008"),
        (with("sizes: 3", "sizes: 99999999999999999999"), "VGS-NRD-008"),
        (with("(0,0,2)", "(0,0)"), "VGS-NRD-009"),
        (with("(0,0,2)", ""), "VGS-NRD-009"),
        (with("(0,0,2)", "nothing"), "VGS-NRD-009"),
        (with("(0,0,2)", "(0,0,2"), "VGS-NRD-009"),
        (with("(0,0,2)", "(0,0,two)"), "VGS-NRD-009"),
        (with("(10,-20,30)", "10 20 30"), "VGS-NRD-009"),
        (with("(10,-20,30)", "(10,-20,30) (1,2,3)"), "VGS-NRD-009"),
        (with("(0,0,2)", "none"), "VGS-NRD-011"),
        (with("(0,0,2)", "(0,0,0)"), "VGS-VOL-025"),
        (with("(0,0,2)", "(-0.2,1.1,0)"), "VGS-VOL-025"),
        (with("(0,0,2)", "(inf,0,0)"), "VGS-VOL-025"),
        (with("(10,-20,30)", "(nan,0,0)"), "VGS-VOL-025"),
        (with("left-posterior-superior", "left-posterior"), "VGS-NRD-014"),
        (with("sizes: 3 2 2", "sizes: 3 2 3"), "VGS-VOL-006"),
        (with("sizes: 3 2 2", "sizes: 64 64 4"), "VGS-VOL-006"),
        (with("sizes: 3 2 2", "sizes: 512 512 512"), "VGS-VOL-005"),
        (with("sizes: 3 2 2", huge), "VGS-VOL-005"),
        (
            file(&head_4d("list").replace("sizes: 3 3", "sizes: 18446744073709551615 3"), &voxels),
            "VGS-VOL-005",
        ),
        (file(&head_4d("RGB-color"), &voxels), "VGS-NRD-010"),
        (file(&head_4d("vector"), &voxels), "VGS-NRD-010"),
        (file(&head_4d("3D-symmetric-matrix"), &voxels), "VGS-NRD-010"),
        (file(&gz, &packed[..packed.len() - 9]), "VGS-VOL-008"),
        (file(&gz, &packed[..4]), "VGS-VOL-008"),
        (file(&gz, &flipped), "VGS-VOL-007"),
        (file(&gz, &[&packed[..], b"more"].concat()), "VGS-VOL-007"),
        (file(&gz, &voxels), "VGS-VOL-007"),
        (file(&gz, &gzip(&voxels[..20])), "VGS-VOL-006"),
        (file(&gz.replace("sizes: 3", "sizes: 4000"), &packed), "VGS-VOL-006"),
        (file(&HEAD.replace("raw", "ascii"), b"1 2 3"), "VGS-VOL-006"),
        (file(&HEAD.replace("raw", "ascii"), b"0 1 2 3 4 5 6 7 8 9 10 x 12 13"), "VGS-VOL-021"),
        (file(&HEAD.replace("raw", "ascii"), &[b'1'; 99]), "VGS-VOL-021"),
        (file(&HEAD.replace("raw", "ascii"), b"0 1 2 3 4 5 6 7 8 9 10 1e99 "), "VGS-VOL-022"),
        (with("# a comment", "data file: LIST"), "VGS-NRD-017"),
        (with("# a comment", "data file: %03d.raw 1 10 1"), "VGS-NRD-017"),
        (with("# a comment", "data file: /etc/passwd"), "VGS-VOL-024"),
        (with("# a comment", "data file: ../a.raw"), "VGS-VOL-024"),
        (with("# a comment", "data file: C:\\a.raw"), "VGS-VOL-024"),
        (with("# a comment", "data file: b\\..\\..\\a.raw"), "VGS-VOL-024"),
        (with("# a comment", "data file:"), "VGS-VOL-024"),
        (with("# a comment", "data file: none.raw"), "VGS-VOL-001"),
        (with("# a comment", "data file: ."), "VGS-IO-002"),
    ];
    for (i, (bytes, expected)) in cases.into_iter().enumerate() {
        let error = read_bytes(&bytes).unwrap_err();
        let kind = if expected == "VGS-VOL-001" { Kind::Missing } else { Kind::BadData };
        assert_eq!((error.code, error.kind), (expected, kind), "case {i}: {error}");
        assert!(error.file.is_some() && !error.help.is_empty(), "case {i}: {error:?}");
    }
    let folder = tempfile::tempdir().unwrap();
    let lenient = ReadOptions { lenient: true, ..options() };
    for damaged in [file(&gz, &flipped), file(&gz, &[&packed[..], b"more"].concat())] {
        assert_eq!(read_in(folder.path(), &damaged, &lenient).unwrap().samples, count(12));
    }
    let cut = read_in(folder.path(), &file(&gz, &packed[..packed.len() - 12]), &lenient).unwrap_err();
    assert_eq!(cut.code, "VGS-VOL-006");
}

#[test]
fn damaged_bytes_never_panic() {
    let keys =
        "Segment0_LabelValue:=3\nSegment0_Name:=kidney\nspacings: 0.5 1 2\nbyte skip: -1\nline skip: 0\n";
    let gz = HEAD.replace("encoding: raw", "encoding: gz");
    let folder = tempfile::tempdir().unwrap();
    for good in [file(&format!("{HEAD}{keys}"), &shorts(0..12)), file(&gz, &gzip(&shorts(0..12)))] {
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
