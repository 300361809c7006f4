//! Round trips, the files of others, and files that are wrong.

use std::io::{BufReader, Cursor};

use glam::{DAffine3, DVec3};
use proptest::prelude::*;

use super::encode::{Row, encode};
use super::read::{Loaded, load};
use super::write::check;
use crate::activation::limit_anisotropy;
use crate::harmonics::SH0;
use crate::kernel::KERNELS;
use crate::region::tests::region_of;
use crate::{Activations, Field, Form, Grid, Kernel, ReadOptions, Splat, SplatSet, describe, read, write};
use base::error::{Kind, Result};
use base::unit::Unit;

mod colours;
mod labels;
mod layouts;
mod reference;
mod unusual;

const STRICT: ReadOptions = ReadOptions { strict: true, max_splats: 1_000_000 };
const LENIENT: ReadOptions = ReadOptions { strict: false, ..STRICT };

fn loaded(file: &[u8], options: &ReadOptions) -> Result<Loaded> {
    load(BufReader::new(Cursor::new(file)), file.len() as u64, options)
}

fn encoded(set: &SplatSet) -> Vec<u8> {
    encoded_as(set, Row::Named)
}

fn encoded_as(set: &SplatSet, row: Row) -> Vec<u8> {
    check(set).expect("a set that can be written");
    let mut file = Vec::new();
    encode(set, row, &mut file).expect("writing to memory");
    file
}

/// Returns the header of a file, `end_header` and its line feed included.
fn header_of(file: &[u8]) -> &str {
    let end = file.windows(11).position(|w| w == b"end_header\n").expect("a header") + 11;
    std::str::from_utf8(&file[..end]).expect("UTF-8")
}

fn sample(count: usize) -> SplatSet {
    let splats = (0..count).map(|i| {
        let t = i as f32;
        Splat {
            mean: [t, -0.1 * t, 1e-3 * t],
            opacity_logit: (0.3 * t).sin() * 5.0,
            rotation: [1.0, 0.1 * t, -0.2, 0.3],
            log_scale: [-0.5, (0.01 * t).cos(), 0.3],
            intensity: 40.0 * t - 1000.0,
        }
    });
    let field = Field { kernel: Kernel::Compact, background: 12.7, epsilon: 1e-3, occupancy_w0: 0.05 };
    SplatSet {
        splats: splats.collect(),
        origin_mm: DVec3::new(-1e5, 0.1, 33.0),
        field,
        iterations: Some(400),
        grid: Some(Grid {
            size: [512, 511, 99],
            world_from_voxel: DAffine3::from_cols_array(&[
                -0.7,
                1e-17,
                0.0,
                0.1,
                0.7,
                0.0,
                0.0,
                -0.3,
                3.0,
                1e5,
                -17.3,
                1.0 / 3.0,
            ]),
        }),
        form: Form::Grid,
        ..SplatSet::default()
    }
}

/// Returns a PLY file made of its parts: header lines after `format`, then the payload.
fn file(format: &str, header: &str, payload: &[u8]) -> Vec<u8> {
    let mut file = format!("ply\nformat {format} 1.0\n{header}end_header\n").into_bytes();
    file.extend_from_slice(payload);
    file
}

const PLAIN: [&str; 14] = [
    "x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0",
    "rot_1", "rot_2", "rot_3",
];
const PLAIN_ROW: [f32; 14] = [1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.5, -1.0, -2.0, -3.0, 1.0, 0.0, 0.0, 0.25];

fn declared(kind: &str, names: &[&str]) -> String {
    names.iter().map(|name| format!("property {kind} {name}\n")).collect()
}

fn plain_header(count: &str) -> String {
    format!("element vertex {count}\n{}", declared("float", &PLAIN))
}

fn little(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn expected_plain(intensity: f32) -> Splat {
    Splat {
        mean: [1.0, 2.0, 3.0],
        opacity_logit: 0.5,
        rotation: [1.0, 0.0, 0.0, 0.25],
        log_scale: [-1.0, -2.0, -3.0],
        intensity,
    }
}

#[test]
fn the_region_survives_behind_all_else() {
    let region = Some(region_of(&[([511, 0, 0], 3), ([0, 3, 1], 3), ([511, 0, 1], 0)]));
    let plain = sample(7);
    let set = SplatSet { region, labels: Some(vec![3; 7]), ..plain.clone() };
    let ours = encoded(&set);
    assert_eq!(loaded(&ours, &STRICT).expect("our own file").set, set);
    let text = String::from_utf8_lossy(&ours).into_owned();
    assert!(text.contains("property uchar code\n") && text.contains("element region "), "{text:.1500}");
    let beyond = SplatSet { region: Some(region_of(&[([512, 0, 0], 0)])), ..plain.clone() };
    let homeless = SplatSet { grid: None, ..set.clone() };
    for broken in [beyond, homeless] {
        assert_eq!(check(&broken).expect_err("no file must hold it").code, "VGS-PLY-012");
    }
    // Another program may drop the element and keep the comments.
    let header = header_of(&ours);
    let (before, _) = header.split_once("element region").expect("the element");
    let rows = ours.len() - header.len() - set.region.as_ref().map_or(0, |region| region.encode().len());
    let bare = [before.as_bytes(), b"end_header\n", &ours[header.len()..][..rows]].concat();
    let error = loaded(&bare, &STRICT).err().expect("its region is missing");
    assert!(error.code == "VGS-PLY-033" && error.help.contains("--like"), "{error}");
    // Without a grid an element of that name is another program's.
    for name in ["region", "exception"] {
        let element = format!("{}element {name} 1\nproperty list uchar int voxels\n", plain_header("1"));
        let theirs = file("binary_little_endian", &element, &[little(&PLAIN_ROW), vec![0]].concat());
        assert_eq!(loaded(&theirs, &STRICT).expect("another program's").set.region, None);
    }
}

#[test]
fn a_set_survives_bit_for_bit() {
    for unit in [Unit::Hu, Unit::Arbitrary, Unit::Luminance] {
        let set = SplatSet { unit, ..sample(10_000) };
        let read = loaded(&encoded(&set), &STRICT).expect("our own file");
        assert_eq!(read.mended.dropped, 0);
        assert_eq!(read.set, set);
        assert_eq!(
            bytemuck::cast_slice::<_, u8>(&read.set.splats),
            bytemuck::cast_slice::<_, u8>(&set.splats)
        );
    }
}

#[test]
fn our_files_have_the_layout_that_every_reader_accepts() {
    let file = encoded(&sample(3));
    let header = header_of(&file);
    let end = header.len();
    let lines: Vec<&str> = header.lines().collect();
    assert_eq!(lines[..3], ["ply", "format binary_little_endian 1.0", "element vertex 3"]);
    let names = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3 \
                 intensity";
    for (line, name) in lines[3..21].iter().zip(names.split(' ')) {
        assert_eq!(*line, format!("property float {name}"));
    }
    assert!(lines[21..].contains(&"comment not for diagnosis"));
    assert!(!lines[21..].iter().any(|line| line.starts_with("property") || line.starts_with("element")));
    assert_eq!(file.len(), end + 3 * 18 * 4);
    // The ramp: black for the least intensity, white for the greatest.
    let grey = |row: usize| {
        let at = end + row * 72 + 24;
        0.5 + SH0 * f32::from_le_bytes(file[at..at + 4].try_into().expect("four bytes"))
    };
    for (row, expected) in [(0, 0.0), (1, 0.5), (2, 1.0)] {
        assert!((grey(row) - expected).abs() < 1e-6, "row {row}: {}", grey(row));
    }

    // An independent reader agrees.
    let ply = ply_rs::parser::Parser::<ply_rs::ply::DefaultElement>::new()
        .read_ply(&mut file.as_slice())
        .expect("the PLY crate reads it");
    let set = sample(3);
    for (index, splat) in set.splats.iter().enumerate() {
        let number = |element: &str, name: &str| ply.payload[element][index][name].to_f32_lossy();
        assert_eq!(number("vertex", "intensity"), Some(splat.intensity));
        assert_eq!(number("vertex", "rot_1"), Some(splat.rotation[1]));
        assert_eq!(number("vertex", "opacity"), Some(splat.opacity_logit));
    }
}

#[test]
fn files_of_others_are_read() {
    let all = PLAIN_ROW.map(f64::from);
    let doubles = |big: bool| -> Vec<u8> {
        all.iter().flat_map(|v| if big { v.to_be_bytes() } else { v.to_le_bytes() }).collect()
    };
    let reversed_names: Vec<&str> = PLAIN.iter().rev().copied().collect();
    let reversed_row: Vec<f32> = PLAIN_ROW.iter().rev().copied().collect();
    let text = PLAIN_ROW.map(|v| v.to_string()).join(" ");
    let rest: Vec<String> = (0..45).map(|i| format!("f_rest_{i}")).collect();
    let rest: Vec<&str> = rest.iter().map(String::as_str).collect();
    let plain = plain_header("1");
    let le = "binary_little_endian";
    let with = |extra: &[u8]| [little(&PLAIN_ROW), extra.to_vec()].concat();
    let intensity = "element splat_intensity 1\nproperty float intensity\n";

    // Name, file, intensity, whether it is physical.
    let rows: Vec<(&str, Vec<u8>, f32, bool)> = vec![
        ("plain", file(le, &plain, &with(b"")), 0.5, false),
        (
            "order",
            file(
                le,
                &format!("element vertex 1\n{}", declared("float", &reversed_names)),
                &little(&reversed_row),
            ),
            0.5,
            false,
        ),
        (
            "normals and harmonics",
            {
                let names = [&PLAIN[..3], &["nx", "ny", "nz"], &PLAIN[3..6], &rest, &PLAIN[6..]].concat();
                let mut values = PLAIN_ROW.to_vec();
                values.splice(6..6, [7.0; 45]);
                values.splice(3..3, [9.0; 3]);
                file(le, &format!("element vertex 1\n{}", declared("float32", &names)), &little(&values))
            },
            0.5,
            false,
        ),
        (
            "double",
            file(le, &format!("element vertex 1\n{}", declared("double", &PLAIN)), &doubles(false)),
            0.5,
            false,
        ),
        (
            "big endian",
            file(
                "binary_big_endian",
                &format!("element vertex 1\n{}", declared("double", &PLAIN)),
                &doubles(true),
            ),
            0.5,
            false,
        ),
        ("uchar", file(le, &format!("{plain}property uchar intensity\n"), &with(&[200])), 200.0, true),
        (
            "short",
            file(le, &format!("{plain}property short hu\n"), &with(&(-1000i16).to_le_bytes())),
            -1000.0,
            true,
        ),
        (
            "hu first",
            {
                let header = format!("{plain}property float intensity\nproperty float hu\n");
                file(le, &header, &with(&little(&[0.3, 77.0])))
            },
            77.0,
            true,
        ),
        ("second element", file(le, &format!("{plain}{intensity}"), &with(&little(&[55.0]))), 55.0, true),
        (
            "intensities before the splats",
            file(le, &format!("{intensity}{plain}"), &[little(&[55.0]), little(&PLAIN_ROW)].concat()),
            55.0,
            true,
        ),
        (
            "another element before",
            file(
                le,
                &format!("element camera 2\nproperty uchar a\n{plain}"),
                &[vec![1, 2], little(&PLAIN_ROW)].concat(),
            ),
            0.5,
            false,
        ),
        (
            "a list behind",
            file(le, &format!("{plain}element face 1\nproperty list uchar int i\n"), &with(&[0])),
            0.5,
            false,
        ),
        ("ASCII", file("ascii", &plain, format!("\n {text}  \r\n").as_bytes()), 0.5, false),
        ("ASCII without the last line feed", file("ascii", &plain, text.as_bytes()), 0.5, false),
        (
            "ASCII with a list before",
            {
                let header = format!("element face 1\nproperty list uchar int i\n{plain}");
                file("ascii", &header, format!("3 0 1 2\n{text}\n").as_bytes())
            },
            0.5,
            false,
        ),
        ("obj_info", file(le, &format!("obj_info anything\n{plain}"), &with(b"")), 0.5, false),
        (
            "CRLF",
            {
                let header =
                    format!("ply\r\nformat {le} 1.0\r\n{}end_header\r\n", plain.replace('\n', "\r\n"));
                [header.into_bytes(), little(&PLAIN_ROW)].concat()
            },
            0.5,
            false,
        ),
        (
            "Latin-1",
            {
                let mut file = file(le, &format!("comment @ \u{1}\n{plain}"), &with(b""));
                let at = file.iter().position(|&b| b == b'@').expect("the mark");
                file[at] = 0xfc;
                file
            },
            0.5,
            false,
        ),
        (
            "comment that looks like the end",
            file(le, &format!("comment end_header\n{plain}"), &with(b"")),
            0.5,
            false,
        ),
        (
            "colour",
            {
                let mut row = PLAIN_ROW;
                row[4] = 1.0;
                file(le, &plain, &little(&row))
            },
            0.5 + 0.7152 * SH0,
            false,
        ),
    ];
    for (name, file, intensity, physical) in rows {
        let Loaded { set, .. } = loaded(&file, &STRICT).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(set.splats.len(), 1, "{name}");
        let mut expected = expected_plain(intensity);
        let difference = set.splats[0].intensity - intensity;
        assert!(difference.abs() < 1e-6, "{name}: intensity {}", set.splats[0].intensity);
        expected.intensity = set.splats[0].intensity;
        assert_eq!(set.splats[0], expected, "{name}");
        assert_eq!(set.unit.is_physical(), physical, "{name}");
        assert_eq!(set.field.kernel, Kernel::Gaussian, "{name}");
        assert_eq!(set.field.background, expected.intensity, "{name}: the mean");
        assert_eq!(set.origin_mm, DVec3::ZERO, "{name}");
    }
}

#[test]
fn wrong_files_are_refused_with_a_reason() {
    let le = "binary_little_endian";
    let plain = plain_header("1");
    let row = little(&PLAIN_ROW);
    let good = file(le, &plain, &row);
    let comment = |text: &str| file(le, &format!("{plain}comment {text}\n"), &row);
    let with_element = |form: &str, element: &str, name: &str, code: &[u8]| {
        let grid = "comment vgs.grid.size 3 4 5\ncomment vgs.grid.affine 1 0 0 0 0 1 0 0 0 0 1 0\n";
        let form = format!("comment vgs.form {form}\n");
        let header = format!("{plain}{grid}{form}element {element} {}\nproperty uchar {name}\n", code.len());
        file(le, &header, &[row.clone(), code.to_vec()].concat())
    };
    let excepted = |name: &str, code: &[u8]| with_element("grid-binary", "exception", name, code);
    let counted = |count: &str| file(le, &plain_header(count), &row);
    let text = PLAIN_ROW.map(|v| v.to_string()).join(" ");
    let own = encoded(&sample(5));

    // Name, file, code, a word that the message must have.
    let rows: Vec<(&str, Vec<u8>, &str, &str)> = vec![
        ("empty", vec![], "VGS-PLY-001", "ply"),
        ("no PLY", b"plywood".to_vec(), "VGS-PLY-001", "ply"),
        ("magic alone", b"ply\n".to_vec(), "VGS-PLY-002", "4 bytes"),
        ("half a header", good[..60].to_vec(), "VGS-PLY-002", "end_header"),
        ("endless line", [b"ply\ncomment ".to_vec(), vec![b'x'; 200_000]].concat(), "VGS-PLY-002", "65536"),
        (
            "200 000 properties",
            {
                let names: String = (0..200_000).map(|i| format!("property float p{i}\n")).collect();
                file(le, &format!("element vertex 1\n{names}"), &[])
            },
            "VGS-PLY-002",
            "65536",
        ),
        ("no format", b"ply\nelement vertex 0\nend_header\n".to_vec(), "VGS-PLY-003", "format"),
        ("version 2.0", b"ply\nformat ascii 2.0\nend_header\n".to_vec(), "VGS-PLY-003", "2.0"),
        ("unknown format", b"ply\nformat zip 1.0\nend_header\n".to_vec(), "VGS-PLY-003", "line 2"),
        ("unknown type", file(le, "element vertex 1\nproperty half x\n", &[]), "VGS-PLY-003", "half x"),
        ("NUL", file(le, "element ver\0tex 1\n", &[]), "VGS-PLY-003", "ver\\0tex"),
        ("control characters", file(le, "\u{1b}[31mred\n", &[]), "VGS-PLY-003", "\\u{1b}[31mred"),
        ("negative count", counted("-1"), "VGS-PLY-003", "vertex -1"),
        ("count 10^30", counted("1000000000000000000000000000000"), "VGS-PLY-003", "line 3"),
        ("count 2^64 - 1", counted("18446744073709551615"), "VGS-PLY-014", "18446744073709551615"),
        ("count 10^9", counted("1000000000"), "VGS-PLY-014", "1000000"),
        ("count 10^6", counted("1000000"), "VGS-PLY-006", "56000000"),
        ("rows without a property", file(le, "element ghost 50000000\n", &[]), "VGS-PLY-004", "ghost"),
        (
            "binary list first",
            { file(le, &format!("element face 1\nproperty list uchar int i\n{plain}"), &row) },
            "VGS-PLY-005",
            "face",
        ),
        ("truncated", good[..good.len() - 1].to_vec(), "VGS-PLY-006", "56"),
        ("truncated intensities", own[..own.len() - 1].to_vec(), "VGS-PLY-006", "360"),
        ("trailing bytes", [good.clone(), vec![0; 3]].concat(), "VGS-PLY-023", "3 bytes"),
        ("property twice", file(le, &format!("{plain}property float x\n"), &row), "VGS-PLY-007", "`x`"),
        ("element twice", file(le, &format!("{plain}{plain}"), &row), "VGS-PLY-007", "`vertex`"),
        ("ASCII count", file("ascii", &plain_header("1000"), text.as_bytes()), "VGS-PLY-006", "28000"),
        ("ASCII row missing", file("ascii", &plain_header("2"), text.as_bytes()), "VGS-PLY-006", ""),
        (
            "ASCII rows missing",
            { file("ascii", &plain_header("2"), format!("{text}{}\n", "0".repeat(100)).as_bytes()) },
            "VGS-PLY-009",
            "ended",
        ),
        ("ASCII word", file("ascii", &plain, text.replace("0.25", "rot").as_bytes()), "VGS-PLY-010", "`rot`"),
        (
            "ASCII too long",
            file("ascii", &plain, format!("{text} 1").as_bytes()),
            "VGS-PLY-010",
            "last property",
        ),
        (
            "ASCII too short",
            file("ascii", &plain, b"1 2 3 4 5 6 7 8 9 10 11 1.00001"),
            "VGS-PLY-010",
            "rot_2",
        ),
        ("ASCII endless line", file("ascii", &plain, &vec![b'1'; 100_000]), "VGS-PLY-010", "64 KiB"),
        ("ASCII binary", file("ascii", &plain, &[0xff; 60]), "VGS-PLY-010", "text"),
        ("ASCII NaN", file("ascii", &plain, text.replace("0.25", "nan").as_bytes()), "VGS-PLY-022", "finite"),
        ("no vertex", file(le, "element point 0\nproperty float x\n", &[]), "VGS-PLY-013", "point"),
        (
            "points only",
            {
                file(
                    le,
                    &format!("element vertex 1\n{}", declared("float", &["x", "y", "z"])),
                    &little(&[0.0; 3]),
                )
            },
            "VGS-PLY-019",
            "opacity, rot_0",
        ),
        (
            "no intensity, no colour",
            {
                let names: Vec<&str> =
                    PLAIN.iter().filter(|name| !name.starts_with("f_dc")).copied().collect();
                file(le, &format!("element vertex 1\n{}", declared("float", &names)), &little(&[0.0; 11]))
            },
            "VGS-PLY-019",
            "f_dc_0, f_dc_1, f_dc_2",
        ),
        (
            "list property",
            { file(le, &format!("{plain}property list uchar int i\n"), &[row.clone(), vec![0]].concat()) },
            "VGS-PLY-018",
            "`i`",
        ),
        (
            "too few intensities",
            {
                let header =
                    format!("{}element splat_intensity 1\nproperty float intensity\n", plain_header("2"));
                file(le, &header, &[row.clone(), row.clone(), little(&[1.0])].concat())
            },
            "VGS-PLY-020",
            "1 intensities for 2",
        ),
        (
            "unnamed intensities",
            {
                let header = format!("{plain}element splat_intensity 1\nproperty float i\n");
                file(le, &header, &[row.clone(), little(&[1.0])].concat())
            },
            "VGS-PLY-021",
            "intensity",
        ),
        ("kernel", comment("vgs.kernel cubic"), "VGS-PLY-016", "cubic"),
        ("axes", comment("vgs.axes lps"), "VGS-PLY-016", "lps"),
        ("origin", comment("vgs.origin_mm 1 2"), "VGS-PLY-016", "origin"),
        ("two origins", comment("vgs.epsilon 1\ncomment vgs.epsilon 1"), "VGS-PLY-016", "twice"),
        ("infinite origin", comment("vgs.origin_mm 1 inf 2"), "VGS-PLY-017", "origin"),
        ("negative epsilon", comment("vgs.epsilon -1"), "VGS-PLY-017", "epsilon"),
        ("half a size", comment("vgs.grid.size 3 4"), "VGS-PLY-016", "size"),
        (
            "a word in the affine",
            comment("vgs.grid.affine 1 0 0 0 0 1 0 0 0 0 one 0"),
            "VGS-PLY-016",
            "affine",
        ),
        ("form", comment("vgs.form mesh"), "VGS-PLY-016", "mesh"),
        ("a size alone", comment("vgs.grid.size 3 4 5"), "VGS-PLY-017", "affine"),
        (
            "a flat grid",
            comment("vgs.grid.size 3 4 5\ncomment vgs.grid.affine 1 0 0 0 0 1 0 0 0 0 0 0"),
            "VGS-PLY-017",
            "plane",
        ),
        ("no w0", comment("vgs.occupancy_w0 0"), "VGS-PLY-017", "w0"),
        ("exceptions of a later version", excepted("rice", &[2]), "VGS-PLY-032", "`code`"),
        ("an exception beyond the grid", excepted("code", &[0xff, 0x01]), "VGS-PLY-033", "beyond"),
        ("an exception twice", excepted("code", &[2, 1]), "VGS-PLY-033", "twice"),
        ("half an exception", excepted("code", &[2, 0x80]), "VGS-PLY-033", "no end"),
        (
            "a region that is none",
            with_element("region", "region", "code", &[7; 9]),
            "VGS-PLY-033",
            "as it was",
        ),
        (
            "a region beside a soft form",
            with_element("grid", "region", "code", &[0; 9]),
            "VGS-PLY-033",
            "another",
        ),
        ("a form without its region", comment("vgs.form region"), "VGS-PLY-033", "no grid"),
        ("an endless exception", excepted("code", &[0x80; 12]), "VGS-PLY-033", "too long"),
    ];
    for (name, file, code, word) in rows {
        let error = loaded(&file, &STRICT).err().unwrap_or_else(|| panic!("{name}: it was read"));
        assert_eq!((error.kind, error.code), (Kind::BadData, code), "{name}: {error}");
        assert!(error.message.contains(word), "{name}: {error}");
        assert!(
            !error.message.chars().any(char::is_control),
            "{name}: unescaped text in {:?}",
            error.message
        );
    }
}

#[test]
fn no_splats_can_be_read_but_not_written() {
    let empty = file("binary_little_endian", &plain_header("0"), &[]);
    let set = loaded(&empty, &STRICT).expect("an empty file is valid").set;
    assert!(set.splats.is_empty() && set.field.background == 0.0);
    assert_eq!(check(&set).expect_err("nothing to write").kind, Kind::NothingToDo);

    let mut broken = sample(3);
    broken.splats[2].intensity = f32::NAN;
    assert!(check(&broken).expect_err("a NaN").message.contains("splat 2"));
    let mut broken = sample(3);
    broken.field.occupancy_w0 = 0.0;
    assert_eq!(check(&broken).expect_err("no w0").code, "VGS-PLY-012");
}

#[test]
fn files_are_described_and_never_replaced_by_accident() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("splats.ply");
    let set = sample(11);
    write(&path, &set, false).expect("the first time");
    assert_eq!(write(&path, &set, false).expect_err("it exists").kind, Kind::CannotCreate);
    write(&path, &set, true).expect("by force");
    assert_eq!(read(&path, &STRICT).expect("our own file"), set);

    let summary = describe(&path, &STRICT).expect("our own file");
    assert_eq!((summary.format, summary.splats, summary.dropped), ("ply", 11, 0));
    assert_eq!(summary.encoding, "binary_little_endian");
    assert_eq!(summary.elements, [("vertex".to_owned(), 11)]);
    assert_eq!(summary.properties.len(), 18);
    assert_eq!((summary.kernel, summary.unit), ("compact", Unit::Hu));
    assert_eq!(summary.intensity_range, Some([-1000.0, -600.0]));
    let [low, high] = summary.bounding_box_mm.expect("there are splats");
    assert_eq!((low[0], high[0]), (-1e5, -1e5 + 10.0));
    assert!((low[1] + 0.9).abs() < 1e-6 && (high[2] - 33.01).abs() < 1e-6);
    assert_eq!(summary.file_bytes, std::fs::metadata(&path).expect("the file").len());

    let error = read(folder.path(), &STRICT).expect_err("a folder is no file");
    assert_eq!(error.kind, Kind::BadData);
    std::fs::write(&path, "ply\n").expect("writing");
    assert_eq!(read(&path, &STRICT).expect_err("half a header").file, Some(path));
}

/// Generates any splat that a file may hold and a reader leaves as it is.
fn any_splat() -> impl Strategy<Value = Splat> {
    let finite = || any::<f32>().prop_filter("finite", |v| v.is_finite());
    let values = prop::array::uniform12(finite());
    values.prop_map(|values| {
        let mut splat: Splat = bytemuck::cast(values);
        splat.log_scale = limit_anisotropy(splat.log_scale.map(|log| log % 40.0));
        if splat.rotation == [0.0; 4] {
            splat.rotation[0] = f32::MIN_POSITIVE;
        }
        splat
    })
}

proptest! {
    #[test]
    fn any_set_survives_bit_for_bit(
        splats in prop::collection::vec(any_splat(), 1..20),
        origin in prop::array::uniform3(-1e7..1e7f64),
        background in -3e38..3e38f32,
        epsilon in 0.0..1.0f32,
        occupancy_w0 in 1e-30..1.0f32,
        kernel in prop::sample::select(KERNELS.map(|row| row.kernel).to_vec()),
        unit in prop::sample::select(vec![Unit::Hu, Unit::Arbitrary, Unit::Luminance]),
        labelled: bool,
        fixed: bool,
        names in prop::collection::btree_map(1..=u8::MAX, "[!-~]{1,20}( [à-ü(]{1,9})?", 0..9),
    ) {
        let field = Field { kernel, background, epsilon, occupancy_w0 };
        let labels = labelled.then(|| splats.iter().map(|s| s.mean[0].to_bits() as u8).collect());
        let label_names = names.into_iter().collect();
        let origin_mm = DVec3::from_array(origin);
        let set =
            SplatSet { splats, origin_mm, field, unit, labels, label_names, ..SplatSet::default() };
        let row = if fixed { Row::Fixed } else { Row::Named };
        let read = loaded(&encoded_as(&set, row), &STRICT).expect("our own file").set;
        prop_assert_eq!(bytemuck::cast_slice::<_, u32>(&read.splats), bytemuck::cast_slice::<_, u32>(&set.splats));
        prop_assert_eq!(SplatSet { splats: Vec::new(), ..read }, SplatSet { splats: Vec::new(), ..set });
    }

    #[test]
    fn damaged_files_never_panic(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..4u8), 1..12),
        ascii: bool,
        strict: bool,
    ) {
        let mut file = if ascii {
            file("ascii", &plain_header("1"), PLAIN_ROW.map(|v| v.to_string()).join(" ").as_bytes())
        } else {
            encoded(&sample(4))
        };
        for (at, byte, kind) in edits {
            let at = at.index(file.len().max(1)).min(file.len().saturating_sub(1));
            match kind {
                _ if file.is_empty() => file.push(byte),
                0 => file[at] = byte,
                1 => drop(file.remove(at)),
                2 => file.insert(at, byte),
                // A digit more easily gives a header that parses and lies.
                _ => file[at] = b'0' + byte % 10,
            }
        }
        match loaded(&file, &ReadOptions { strict, ..STRICT }) {
            Ok(read) => prop_assert!(read.set.splats.len() <= 1_000_000),
            Err(error) => prop_assert_eq!(error.kind, Kind::BadData),
        }
    }

    #[test]
    fn random_headers_never_panic(
        lines in prop::collection::vec(
            prop::sample::select(vec![
                "format ascii 1.0", "format binary_little_endian 1.0", "format binary_big_endian 1.0",
                "element vertex 2", "element splat_intensity 2", "element face 1", "property float intensity",
                "property float x", "property list uchar int i", "property list float float j",
                "comment vgs.kernel compact", "obj_info", "comment", "", "\0", "property float", "element vertex",
            ]),
            0..12,
        ),
        payload in prop::collection::vec(any::<u8>(), 0..200),
    ) {
        let mut file = format!("ply\n{}\nend_header\n", lines.join("\n")).into_bytes();
        file.extend(payload);
        if let Err(error) = loaded(&file, &LENIENT) {
            prop_assert_eq!(error.kind, Kind::BadData);
        }
    }
}

#[test]
fn a_compressed_ply_of_supersplat_is_told_by_its_name() {
    let packed: String = ["position", "rotation", "scale", "color"]
        .map(|name| format!("property uint packed_{name}\n"))
        .concat();
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement chunk 1\nproperty float min_x\nelement vertex 1\n{packed}end_header\n"
    );
    let file = [header.as_bytes(), &[0; 20]].concat();
    let error = loaded(&file, &LENIENT).err().expect("packed splats");
    assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-PLY-031"));
    assert!(error.help.contains("splat-transform FILE.compressed.ply FILE.ply"), "{}", error.help);
}
