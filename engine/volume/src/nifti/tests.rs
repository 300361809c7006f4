//! Crafted files: what must be read, and what must be refused and how.

use std::fs;
use std::io::{Cursor, Write};

use flate2::{Compression, write::GzEncoder};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use proptest::prelude::*;

use super::header::{SIZE_1, SIZE_2};
use super::*;
use crate::tests::read_both;
use crate::{ReadOptions, Volume};
use base::input::Input;
use base::{Kind, Result};

/// A header and the bytes that follow it, to be stored in either version and byte order.
#[derive(Clone)]
struct Crafted {
    version: u8,
    big: bool,
    single: bool,
    dim: [i64; 8],
    datatype: i16,
    bitpix: i16,
    pixdim: [f64; 8],
    vox_offset: f64,
    slope: f64,
    inter: f64,
    units: u8,
    qform_code: i16,
    sform_code: i16,
    quaternion: [f64; 6],
    srow: [[f64; 4]; 3],
    /// From the end of the header to the voxels.
    gap: Vec<u8>,
    voxels: Vec<u8>,
}

impl Default for Crafted {
    /// NIfTI-1, 4 × 3 × 2 int16 from 0 to 23, 1 × 2 × 3 mm, LAS.
    fn default() -> Self {
        Crafted {
            version: 1,
            big: false,
            single: true,
            dim: [3, 4, 3, 2, 1, 1, 1, 1],
            datatype: 4,
            bitpix: 16,
            pixdim: [-1.0, 1.0, 2.0, 3.0, 1.0, 1.0, 1.0, 1.0],
            vox_offset: 352.0,
            slope: 1.0,
            inter: 0.0,
            units: 2,
            qform_code: 0,
            sform_code: 1,
            quaternion: [0.0, 1.0, 0.0, 10.0, 20.0, 30.0],
            srow: [[-1.0, 0.0, 0.0, 10.0], [0.0, 2.0, 0.0, 20.0], [0.0, 0.0, 3.0, 30.0]],
            gap: vec![0; 4],
            voxels: encode(4, false, 0..24),
        }
    }
}

/// Returns whole numbers as elements of a datatype.
fn encode(datatype: i16, big: bool, values: impl IntoIterator<Item = i64>) -> Vec<u8> {
    let one = |v: i64| -> Vec<u8> {
        match datatype {
            2 => (v as u8).to_le_bytes().to_vec(),
            4 => (v as i16).to_le_bytes().to_vec(),
            8 => (v as i32).to_le_bytes().to_vec(),
            16 => (v as f32).to_le_bytes().to_vec(),
            64 => (v as f64).to_le_bytes().to_vec(),
            256 => (v as i8).to_le_bytes().to_vec(),
            512 => (v as u16).to_le_bytes().to_vec(),
            768 => (v as u32).to_le_bytes().to_vec(),
            1024 => v.to_le_bytes().to_vec(),
            1280 => (v as u64).to_le_bytes().to_vec(),
            other => panic!("no scalar datatype: {other}"),
        }
    };
    let swapped = |v| one(v).into_iter().rev().collect();
    values.into_iter().flat_map(|v| if big { swapped(v) } else { one(v) }).collect()
}

impl Crafted {
    fn header(&self) -> Vec<u8> {
        let two = self.version == 2;
        let mut out = vec![0; if two { SIZE_2 } else { SIZE_1 }];
        let mut put = |at: usize, mut bytes: Vec<u8>| {
            if self.big {
                bytes.reverse();
            }
            out[at..at + bytes.len()].copy_from_slice(&bytes);
        };
        let real = |v: f64| if two { v.to_le_bytes().to_vec() } else { (v as f32).to_le_bytes().to_vec() };
        let code = |v: i16| if two { i32::from(v).to_le_bytes().to_vec() } else { v.to_le_bytes().to_vec() };
        let at = |second: usize, first: usize| if two { second } else { first };
        let width = at(8, 4);
        put(0, if two { 540_i32 } else { 348 }.to_le_bytes().to_vec());
        for (i, d) in self.dim.into_iter().enumerate() {
            match two {
                true => put(16 + 8 * i, d.to_le_bytes().to_vec()),
                false => put(40 + 2 * i, (d as i16).to_le_bytes().to_vec()),
            }
        }
        put(at(12, 70), self.datatype.to_le_bytes().to_vec());
        put(at(14, 72), self.bitpix.to_le_bytes().to_vec());
        self.pixdim.into_iter().enumerate().for_each(|(i, v)| put(at(104, 76) + width * i, real(v)));
        match two {
            true => put(168, (self.vox_offset as i64).to_le_bytes().to_vec()),
            false => put(108, real(self.vox_offset)),
        }
        put(at(176, 112), real(self.slope));
        put(at(184, 116), real(self.inter));
        match two {
            true => put(500, i32::from(self.units).to_le_bytes().to_vec()),
            false => put(123, vec![self.units]),
        }
        put(at(344, 252), code(self.qform_code));
        put(at(348, 254), code(self.sform_code));
        self.quaternion.into_iter().enumerate().for_each(|(i, v)| put(at(352, 256) + width * i, real(v)));
        self.srow.concat().into_iter().enumerate().for_each(|(i, v)| put(at(400, 280) + width * i, real(v)));
        let magic: &[u8] = match (two, self.single) {
            (true, true) => b"n+2\0\r\n\x1a\n",
            (true, false) => b"ni2\0\r\n\x1a\n",
            (false, true) => b"n+1\0",
            (false, false) => b"ni1\0",
        };
        let place = at(4, 344);
        out[place..place + magic.len()].copy_from_slice(magic);
        out
    }

    fn bytes(&self) -> Vec<u8> {
        [self.header(), self.gap.clone(), self.voxels.clone()].concat()
    }
}

fn crafted(change: impl FnOnce(&mut Crafted)) -> Crafted {
    let mut c = Crafted::default();
    change(&mut c);
    c
}

fn gzip(data: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(data).unwrap();
    encoder.finish().unwrap()
}

/// Small, so that a test that passes the limit is quick.
fn options() -> ReadOptions {
    ReadOptions { max_bytes: 1 << 20, ..ReadOptions::default() }
}

fn read_crafted(c: &Crafted) -> Result<Volume> {
    read_both("a.nii", &c.bytes(), &options())
}

fn describe_bytes(bytes: &[u8]) -> Result<Header> {
    describe(Input::of(Cursor::new(bytes.to_vec()), "a.nii"))
}

fn count(n: usize) -> Vec<f32> {
    (0..n).map(|v| v as f32).collect()
}

#[test]
fn every_scalar_type_in_both_byte_orders_and_versions() {
    for datatype in [2, 4, 8, 16, 64, 256, 512, 768, 1024, 1280] {
        for (version, big) in [(1, false), (1, true), (2, false), (2, true)] {
            let c = crafted(|c| {
                (c.version, c.big, c.datatype) = (version, big, datatype);
                c.bitpix = 8 * (encode(datatype, false, [0]).len() as i16);
                c.vox_offset = if version == 1 { 352.0 } else { 544.0 };
                c.voxels = encode(datatype, big, 0..24);
            });
            let v = read_crafted(&c).unwrap_or_else(|e| panic!("{datatype} {version} {big}: {e}"));
            assert_eq!((v.size, v.samples), ([4, 3, 2], count(24)), "{datatype} {version} {big}");
            assert_eq!(v.world_from_voxel.translation, DVec3::new(10.0, 20.0, 30.0));
            let h = describe_bytes(&c.bytes()).unwrap();
            assert_eq!((h.axes.as_str(), h.spacing_mm, h.big_endian), ("LAS", [1.0, 2.0, 3.0], big));
            assert_eq!((h.notes, h.scalar), (vec![], true));
        }
    }
}

#[test]
fn oddities_that_are_read() {
    let labels = b"<LabelTable><Label Key=\"3\">rib</Label></LabelTable>\0\0";
    let extension = [&[1, 0, 0, 0][..], &64_i32.to_le_bytes(), &[0; 4], labels, &[0; 3]].concat();
    let nan = f64::NAN;
    // What, file, first two samples, a word of the note (or "" for none).
    let cases: Vec<(&str, Crafted, [f32; 2], &str)> = vec![
        ("slope", crafted(|c| (c.slope, c.inter) = (2.0, -5.0)), [-5.0, -3.0], ""),
        ("negative slope", crafted(|c| c.slope = -1.0), [0.0, -1.0], ""),
        ("slope 0", crafted(|c| (c.slope, c.inter) = (0.0, 7.0)), [0.0, 1.0], ""),
        ("slope NaN", crafted(|c| c.slope = nan), [0.0, 1.0], "without scaling"),
        ("bitpix 0", crafted(|c| c.bitpix = 0), [0.0, 1.0], "bitpix is 0"),
        ("offset 0", crafted(|c| c.vox_offset = 0.0), [0.0, 1.0], "vox_offset is 0"),
        (
            "a gap without extension",
            crafted(|c| (c.vox_offset, c.gap) = (512.0, [vec![0; 4], vec![b'x'; 160]].concat())),
            [0.0, 1.0],
            "",
        ),
        ("a flag without extension", crafted(|c| c.gap = vec![1, 0, 0, 0]), [0.0, 1.0], ""),
        ("an extension", crafted(|c| (c.vox_offset, c.gap) = (416.0, extension.clone())), [0.0, 1.0], ""),
        ("trailing zeros in dim", crafted(|c| c.dim = [5, 4, 3, 2, 0, 0, 0, 0]), [0.0, 1.0], ""),
        ("rank 7 of ones", crafted(|c| c.dim[0] = 7), [0.0, 1.0], ""),
        ("two dimensions", crafted(|c| c.dim = [2, 6, 4, 0, 0, 0, 0, 0]), [0.0, 1.0], ""),
        ("one dimension", crafted(|c| c.dim = [1, 24, 0, 0, 0, 0, 0, 0]), [0.0, 1.0], ""),
        ("bytes after the voxels", crafted(|c| c.voxels.push(1)), [0.0, 1.0], ""),
        (
            "nanometres",
            crafted(|c| c.srow.as_flattened_mut().iter_mut().for_each(|v| *v *= 1e-6)),
            [0.0, 1.0],
            "is the unit right",
        ),
    ];
    for (what, c, first, note) in cases {
        let v = read_crafted(&c).unwrap_or_else(|e| panic!("{what}: {e}"));
        assert_eq!((v.samples.len(), &v.samples[..2]), (24, &first[..]), "{what}");
        let notes = describe_bytes(&c.bytes()).unwrap().notes;
        assert_eq!(notes.is_empty(), note.is_empty(), "{what}: {notes:?}");
        assert!(notes.concat().contains(note), "{what}: {notes:?}");
        assert_eq!(v.labels.get(&3).map(String::as_str), (what == "an extension").then_some("rib"), "{what}");
    }
}

#[test]
fn malformed_files_are_refused() {
    let nan = f64::NAN;
    let good = Crafted::default().bytes();
    let extension = |size: i32| {
        crafted(|c| {
            c.vox_offset = 384.0;
            c.gap = [&[1, 0, 0, 0][..], &size.to_le_bytes(), &[0; 28]].concat();
        })
        .bytes()
    };
    let of = |change: fn(&mut Crafted)| crafted(change).bytes();
    let mut analyze = good.clone();
    analyze[344..348].fill(0);
    let mut text = good.clone();
    text[0] = b'#';
    let mut flipped = gzip(&good);
    let crc = flipped.len() - 6;
    flipped[crc] ^= 0x10;
    let trailing = [gzip(&good), b"junk".to_vec()].concat();
    let mut cut = gzip(&good);
    cut.truncate(cut.len() - 12);
    let cases: Vec<(&str, Vec<u8>, &str, &str)> = vec![
        ("empty", vec![], "VGS-VOL-003", "the file is empty"),
        ("gzip of nothing", gzip(&[]), "VGS-VOL-003", "the file is empty"),
        ("short", good[..100].to_vec(), "VGS-NII-001", "too short for a NIfTI header (100 of 348 bytes)"),
        ("short gzip", gzip(&good[..100]), "VGS-NII-001", "too short for a NIfTI header (100 of 348 bytes)"),
        ("text", text, "VGS-NII-002", "sizeof_hdr"),
        ("ANALYZE", analyze, "VGS-NII-003", "ANALYZE 7.5"),
        ("short NIfTI-2", of(|c| c.version = 2)[..400].to_vec(), "VGS-NII-001", "(400 of 540 bytes)"),
        ("rank 0", of(|c| c.dim[0] = 0), "VGS-NII-005", "dim[0] is 0"),
        ("rank 8", of(|c| c.dim[0] = 8), "VGS-NII-005", "dim[0] is 8"),
        ("rank -3", of(|c| c.dim[0] = -3), "VGS-NII-005", "dim[0] is -3"),
        ("dim 0", of(|c| c.dim[2] = 0), "VGS-NII-005", "dim[2] is 0"),
        ("dim -8", of(|c| c.dim[1] = -8), "VGS-NII-005", "dim[1] is -8"),
        ("dim4 -1", of(|c| (c.dim[0], c.dim[4]) = (4, -1)), "VGS-NII-005", "dim[4] is -1"),
        ("overflow", of(|c| c.dim = [7; 8].map(|_| 32767)), "VGS-NII-005", "dim[0] is 32767"),
        ("product", of(|c| c.dim = [7, 32767, 32767, 32767, 32767, 32767, 32767, 9]), "VGS-NII-006", "32767"),
        ("a large claim", of(|c| c.dim[1..4].fill(2000)), "VGS-VOL-005", "limit of 1048576"),
        (
            "a claim beyond the file",
            of(|c| c.dim[1..4].fill(50)),
            "VGS-VOL-006",
            "expected 250352 bytes, got 400",
        ),
        ("no datatype", of(|c| c.datatype = 9999), "VGS-NII-007", "9999"),
        ("datatype 0", of(|c| c.datatype = 0), "VGS-NII-015", "unknown (0) is not a scalar volume"),
        ("binary", of(|c| c.datatype = 1), "VGS-NII-015", "binary (1)"),
        ("complex", of(|c| c.datatype = 32), "VGS-NII-015", "complex64 (32)"),
        ("RGB", of(|c| c.datatype = 128), "VGS-NII-015", "RGB (128) is not a scalar volume"),
        ("float128", of(|c| c.datatype = 1536), "VGS-NII-015", "float128 (1536)"),
        ("complex256", of(|c| c.datatype = 2048), "VGS-NII-015", "complex256 (2048)"),
        ("RGBA", of(|c| c.datatype = 2304), "VGS-NII-015", "RGBA (2304)"),
        ("offset NaN", of(|c| c.vox_offset = f64::NAN), "VGS-NII-008", "vox_offset is NaN"),
        ("offset -1e30", of(|c| c.vox_offset = -1e30), "VGS-NII-008", "vox_offset is -1"),
        ("offset 1e30", of(|c| c.vox_offset = 1e30), "VGS-NII-008", "vox_offset is 1"),
        ("offset 352.5", of(|c| c.vox_offset = 352.5), "VGS-NII-008", "352.5"),
        ("offset 100", of(|c| c.vox_offset = 100.0), "VGS-NII-008", "inside the header"),
        ("offset past the end", of(|c| c.vox_offset = 4096.0), "VGS-VOL-006", "expected 4096 bytes, got 400"),
        ("extension 0", extension(0), "VGS-NII-013", "claims 0 bytes"),
        ("extension -16", extension(-16), "VGS-NII-013", "claims -16 bytes"),
        ("extension 2 GiB", extension(i32::MAX), "VGS-NII-013", "claims 2147483647 bytes"),
        ("slope inf", of(|c| c.slope = f64::INFINITY), "VGS-NII-009", "scl_slope is inf"),
        ("inter inf", of(|c| c.inter = f64::NEG_INFINITY), "VGS-NII-009", "scl_inter is -inf"),
        ("sform NaN", crafted(|c| c.srow[1][1] = nan).bytes(), "VGS-NII-012", "NaN"),
        ("sform 0", of(|c| c.srow = [[0.0; 4]; 3]), "VGS-NII-012", "singular"),
        ("sform flat", of(|c| c.srow[2] = c.srow[1]), "VGS-NII-012", "singular"),
        ("pixdim 0", of(|c| (c.sform_code, c.pixdim[2]) = (0, 0.0)), "VGS-NII-010", "pixdim[2] is 0"),
        (
            "pixdim NaN",
            of(|c| (c.sform_code, c.pixdim[1]) = (0, f64::NAN)),
            "VGS-NII-010",
            "pixdim[1] is NaN",
        ),
        (
            "quaternion NaN",
            of(|c| (c.sform_code, c.qform_code, c.quaternion[0]) = (0, 1, f64::NAN)),
            "VGS-NII-011",
            "not a rotation",
        ),
        (
            "quaternion 1.1",
            of(|c| (c.sform_code, c.qform_code, c.quaternion[1]) = (0, 1, 1.1)),
            "VGS-NII-011",
            "not a rotation",
        ),
        ("truncated", good[..390].to_vec(), "VGS-VOL-006", "expected 400 bytes, got 390"),
        ("truncated in gzip", gzip(&good[..390]), "VGS-VOL-006", "expected 48 bytes of voxels, got 38"),
        ("gzip cut", cut, "VGS-VOL-008", "ends inside"),
        ("gzip in gzip", gzip(&gzip(&good)), "VGS-VOL-004", "gzip inside gzip"),
        ("gzip CRC", flipped, "VGS-VOL-007", "damaged gzip"),
        ("bytes after gzip", trailing, "VGS-VOL-007", "4 bytes follow"),
        ("bomb", gzip(&[good.clone(), vec![0; 2 << 20]].concat()), "VGS-VOL-005", "follow the content"),
        ("gzip claim", gzip(&of(|c| c.dim[1..4].fill(79))), "VGS-VOL-006", "hold at most"),
        (
            "float64 1e300",
            crafted(|c| {
                (c.datatype, c.bitpix) = (64, 64);
                c.voxels =
                    (0..24).flat_map(|i| (if i == 5 { 1e300 } else { 0.0_f64 }).to_le_bytes()).collect();
            })
            .bytes(),
            "VGS-VOL-022",
            "voxel 5 is 1e300",
        ),
    ];
    for (what, bytes, code, word) in cases {
        let error = read_both("a.nii", &bytes, &options()).map(|v| v.size).unwrap_err();
        assert_eq!((error.kind, error.code), (Kind::BadData, code), "{what}: {error}");
        assert!(error.message.contains(word), "{what}: {error}");
        assert!(error.file.is_some(), "{what}");
    }
}

#[test]
fn compression_is_recognised_by_content() {
    let good = Crafted::default().bytes();
    let (first, second) = good.split_at(371);
    let members = [gzip(first), gzip(&[]), gzip(second)].concat();
    let padded = [gzip(&good), vec![0; 700]].concat();
    for (name, bytes) in [
        ("a.nii.gz", gzip(&good)),
        ("a.nii", gzip(&good)),
        ("a.nii.gz", good.clone()),
        ("a", good.clone()),
        ("a.nii.gz", members),
        ("a.nii.gz", padded),
    ] {
        assert_eq!(read_both(name, &bytes, &options()).unwrap().samples, count(24), "{name}");
    }
    // A name that promises something else is told.
    let dir = tempfile::tempdir().unwrap();
    for (name, bytes, note) in [
        ("a.nii", gzip(&good), "does not end in .gz"),
        ("a.nii.gz", good.clone(), "ends in .gz"),
        ("b.nii.gz", gzip(&good), ""),
    ] {
        fs::write(dir.path().join(name), bytes).unwrap();
        let notes = describe(dir.path().join(name)).unwrap().notes.concat();
        assert!(notes.contains(note) && notes.is_empty() == note.is_empty(), "{name}: {notes}");
    }
}

#[test]
fn leniency_accepts_damage_beside_the_voxels() {
    let good = Crafted::default().bytes();
    let mut crc = gzip(&good);
    let n = crc.len();
    crc[n - 6] ^= 1;
    let extension = crafted(|c| {
        c.vox_offset = 384.0;
        c.gap = [&[1, 0, 0, 0][..], &[255; 32]].concat();
    });
    let lenient = ReadOptions { lenient: true, ..options() };
    for (what, bytes) in
        [("CRC", crc), ("junk", [gzip(&good), b"junk".to_vec()].concat()), ("extension", extension.bytes())]
    {
        assert_eq!(read_both("a.nii", &bytes, &options()).unwrap_err().kind, Kind::BadData, "{what}");
        assert_eq!(read_both("a.nii", &bytes, &lenient).unwrap().samples, count(24), "{what}");
    }
    assert!(read_both("a.nii", &good[..390], &lenient).is_err(), "missing voxels stay missing");
}

#[test]
fn one_volume_of_a_series() {
    let series = crafted(|c| (c.dim[0], c.dim[3], c.dim[4]) = (4, 1, 2));
    for (index, expected) in [(Some(0), Ok(0.0)), (Some(1), Ok(12.0)), (Some(2), Err(())), (None, Err(()))] {
        let options = ReadOptions { volume_index: index, ..options() };
        match (read_both("a.nii", &series.bytes(), &options), expected) {
            (Ok(v), Ok(first)) => assert_eq!((v.size, v.samples[0]), ([4, 3, 1], first)),
            (Err(e), Err(())) => {
                assert_eq!((e.kind, e.code), (Kind::Usage, "VGS-VOL-020"));
                assert!(e.help.contains("--volume-index 0..1"), "{}", e.help);
            }
            (found, _) => panic!("{index:?}: {found:?}"),
        }
    }
    let single = ReadOptions { volume_index: Some(0), ..options() };
    assert!(read_both("a.nii", &Crafted::default().bytes(), &single).is_ok());
}

#[test]
fn pairs_are_found_from_either_file() {
    let pair = crafted(|c| (c.single, c.vox_offset, c.gap) = (false, 16.0, vec![]));
    let image = [vec![7; 16], pair.voxels.clone()].concat();
    for (header, voxels) in [
        ("a.hdr", "a.img"),
        ("a.hdr.gz", "a.img.gz"),
        ("a.hdr", "a.img.gz"),
        ("a.hdr.gz", "a.img"),
        ("A.HDR", "A.IMG"),
    ] {
        let dir = tempfile::tempdir().unwrap();
        let pack = |name: &str, bytes: &[u8]| if name.ends_with("gz") { gzip(bytes) } else { bytes.to_vec() };
        fs::write(dir.path().join(header), pack(header, &pair.header())).unwrap();
        for name in [header, voxels] {
            let error = Volume::read(dir.path().join(name), &options()).unwrap_err();
            assert_eq!(error.kind, Kind::Missing, "{name} without {voxels}");
        }
        fs::write(dir.path().join(voxels), pack(voxels, &image)).unwrap();
        for name in [header, voxels] {
            let v = Volume::read(dir.path().join(name), &options()).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!(v.samples, count(24), "{name}");
            assert!(describe(dir.path().join(name)).unwrap().voxel_file.is_some());
        }
        fs::remove_file(dir.path().join(header)).unwrap();
        assert_eq!(Volume::read(dir.path().join(voxels), &options()).unwrap_err().kind, Kind::Missing);
    }
    let misnamed = read_both("a.nii", &pair.bytes(), &options()).unwrap_err();
    assert_eq!((misnamed.kind, misnamed.code), (Kind::BadData, "VGS-NII-018"));
}

#[test]
fn the_affine_comes_from_sform_then_qform_then_pixdim() {
    let turn = std::f64::consts::FRAC_1_SQRT_2;
    let quaternion = |b, c, d| {
        crafted(|x| (x.sform_code, x.qform_code, x.quaternion) = (0, 1, [b, c, d, 10.0, 20.0, 30.0]))
    };
    let right = |mut c: Crafted| {
        c.pixdim[0] = 1.0;
        c
    };
    // Offsets are half a metre in the file.
    let metres = crafted(|c| c.srow.as_flattened_mut().iter_mut().for_each(|v| *v /= 1000.0));
    let metres = Crafted { units: 1, pixdim: [-1.0, 0.001, 0.002, 0.003, 1.0, 1.0, 1.0, 1.0], ..metres };
    let sheared = crafted(|c| c.srow[1][2] = -(3.0 * 15_f64.to_radians().tan()));
    let cases: Vec<(&str, Crafted, &str, &str, &str)> = vec![
        ("sform", Crafted::default(), "sform", "LAS", ""),
        ("sform first", crafted(|c| c.qform_code = 1), "sform", "LAS", ""),
        ("metres", metres, "sform", "LAS", ""),
        ("shear", sheared, "sform", "LAS", "sheared by 15.0°"),
        ("qform identity, left-handed", quaternion(0.0, 0.0, 0.0), "qform", "RAI", ""),
        ("qform identity", right(quaternion(0.0, 0.0, 0.0)), "qform", "RAS", ""),
        ("half turn about z", right(quaternion(0.0, 0.0, 1.0)), "qform", "LPS", ""),
        ("half turn about y, left-handed", quaternion(0.0, 1.0, 0.0), "qform", "LAS", ""),
        ("quarter turn about x", right(quaternion(turn, 0.0, 0.0)), "qform", "RSP", ""),
        ("rounded", right(quaternion(0.0, 0.0, 1.0005)), "qform", "LPS", ""),
        (
            "pixdim[0] = 0",
            Crafted { pixdim: [0.0, 1.0, 2.0, 3.0, 1.0, 1.0, 1.0, 1.0], ..quaternion(0.0, 0.0, 0.0) },
            "qform",
            "RAS",
            "pixdim[0] is 0",
        ),
        (
            "negative pixdim",
            Crafted { pixdim: [1.0, -1.0, 2.0, 3.0, 1.0, 1.0, 1.0, 1.0], ..quaternion(0.0, 0.0, 0.0) },
            "qform",
            "RAS",
            "pixdim[1] is -1",
        ),
        ("neither", crafted(|c| c.sform_code = 0), "pixdim", "???", "orientation is unknown"),
        ("1e6 mm", crafted(|c| (c.sform_code, c.pixdim[3]) = (0, 1e6)), "pixdim", "???", "is the unit right"),
    ];
    for (what, c, source, axes, note) in cases {
        let (v, h) = (read_crafted(&c).unwrap(), describe_bytes(&c.bytes()).unwrap());
        assert_eq!(
            (h.affine_source, v.axis_codes().as_str(), h.axes.as_str()),
            (source, axes, axes),
            "{what}"
        );
        assert_eq!((v.oriented, h.oriented), (source != "pixdim", source != "pixdim"), "{what}");
        let notes = h.notes.concat();
        assert!(notes.contains(note) && notes.is_empty() == note.is_empty(), "{what}: {notes:?}");
        let expected = match what {
            "1e6 mm" => DVec3::new(1.0, 2.0, 1e6),
            "shear" => DVec3::new(1.0, 2.0, 3.0 / 15_f64.to_radians().cos()),
            _ => DVec3::new(1.0, 2.0, 3.0),
        };
        assert!(v.spacing_mm().abs_diff_eq(expected, 1e-5), "{what}: {}", v.spacing_mm());
        let origin = if source == "pixdim" { DVec3::ZERO } else { DVec3::new(10.0, 20.0, 30.0) };
        assert!(v.world_from_voxel.translation.abs_diff_eq(origin, 1e-5), "{what}");
    }
}

/// Returns a file with another value in one field, where that field is used.
fn with_field(name: &str, value: &str) -> Vec<u8> {
    let (mut c, number) = (Crafted::default(), value.parse::<f64>().unwrap());
    match name {
        "sizeof_hdr" | "magic" => {
            let mut bytes = c.bytes();
            let at = if name == "magic" { 344 } else { 0 };
            bytes[at..at + 4].copy_from_slice(&(number as i32).to_le_bytes());
            return bytes;
        }
        "dim[0]" | "dim[1]" => c.dim[usize::from(name == "dim[1]")] = number as i64,
        "datatype" => c.datatype = number as i16,
        "pixdim[0]" | "pixdim[1]" => {
            (c.sform_code, c.qform_code) = (0, 1);
            c.pixdim[usize::from(name == "pixdim[1]")] = number;
        }
        "vox_offset" => c.vox_offset = number,
        "scl_slope" => c.slope = number,
        "scl_inter" => (c.slope, c.inter) = (2.0, number),
        "xyzt_units" => c.units = number as u8,
        "sform_code" => c.sform_code = number as i16,
        "qform_code" => c.qform_code = number as i16,
        "srow_x" => c.srow[0][3] = number,
        "quatern_b" | "qoffset_x" => {
            (c.sform_code, c.qform_code) = (0, 1);
            c.quaternion[if name == "quatern_b" { 0 } else { 3 }] = number;
        }
        other => panic!("no row for {other}"),
    }
    c.bytes()
}

#[test]
fn no_field_that_cannot_be_read_counts_as_absent() {
    for row in FIELDS {
        for value in row.refused {
            let error = read_both("a.nii", &with_field(row.name, value), &options()).expect_err(row.name);
            let is_named = error.kind == Kind::BadData && error.message.contains(row.name);
            assert!(is_named, "{} = {value}: {error}", row.name);
        }
    }
}

#[test]
fn forms_that_contradict_each_other_are_told() {
    let notes = |change: &dyn Fn(&mut Crafted)| {
        let c = crafted(|c| change(c));
        describe_bytes(&c.bytes()).unwrap().notes.concat()
    };
    // The qform of the default says the same as its sform.
    assert_eq!(notes(&|c| c.qform_code = 1), "");
    let moved = notes(&|c| (c.qform_code, c.quaternion[3]) = (1, 15.0));
    assert!(moved.contains("up to 5.0000 units of length apart: the sform is used"), "{moved}");
    let wider = notes(&|c| c.pixdim[1] = 1.5);
    assert!(wider.contains("pixdim has voxels of 1.5") && wider.contains("sform of 1.0000"), "{wider}");
    // A qform that is not used need not be right.
    assert_eq!(notes(&|c| (c.qform_code, c.quaternion[0]) = (1, f64::NAN)), "");
}

#[test]
fn colour_is_described_though_it_is_not_read() {
    let c = crafted(|c| (c.datatype, c.bitpix, c.voxels) = (128, 24, vec![0; 72]));
    let h = describe_bytes(&c.bytes()).unwrap();
    assert_eq!((h.datatype, h.datatype_code, h.scalar, h.dims), ("RGB", 128, false, vec![4, 3, 2]));
}

#[test]
fn integers_beyond_f32_round_and_infinities_stay() {
    let c = crafted(|c| {
        (c.datatype, c.bitpix) = (8, 32);
        c.voxels = encode(8, false, (0..24).map(|i| (1 << 24) + i));
    });
    assert_eq!(read_crafted(&c).unwrap().samples[2], 16_777_218.0);
    let c = crafted(|c| {
        (c.datatype, c.bitpix) = (16, 32);
        c.voxels = [f32::INFINITY, f32::NAN].repeat(12).iter().flat_map(|v| v.to_le_bytes()).collect();
    });
    let v = read_crafted(&c).unwrap();
    assert!(v.samples[0].is_infinite() && v.samples[1].is_nan());
    assert_eq!(v.gather_stats().non_finite, 24);
}

#[test]
fn written_files_are_what_others_read() {
    let dir = tempfile::tempdir().unwrap();
    let rotation = DMat3::from_quat(DQuat::from_rotation_z(0.3) * DQuat::from_rotation_x(-0.2));
    let matrix3 = rotation * DMat3::from_diagonal(DVec3::new(0.5, 0.75, -2.0));
    let affine = DAffine3 { matrix3, translation: DVec3::new(-12.5, 40.0, 7.0) };
    let volume = Volume::new([4, 3, 2], affine, count(24));
    for name in ["scan.v1.nii", "scan.v2.nii", "scan.nii.gz"] {
        let path = dir.path().join(name);
        write(&path, &volume, false).unwrap();
        assert_eq!(write(&path, &volume, false).unwrap_err().kind, Kind::CannotCreate);
        let object =
            ::nifti::NiftiObject::header(&::nifti::ReaderOptions::new().read_file(&path).unwrap()).clone();
        assert_eq!((&object.dim[..4], object.datatype, object.qform_code), (&[3, 4, 3, 2][..], 16, 1));
        // Read back by the qform alone.
        let mut bytes = if name.ends_with("gz") { continue } else { fs::read(&path).unwrap() };
        bytes[254..256].fill(0);
        let by_qform = read_both("q.nii", &bytes, &options()).unwrap();
        assert!(by_qform.world_from_voxel.abs_diff_eq(affine, 1e-5), "{:?}", by_qform.world_from_voxel);
    }
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 3);
    let error = write(dir.path().join("scan.mha"), &volume, false).unwrap_err();
    assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-NII-020"));

    let flat = Volume { world_from_voxel: DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0)), ..volume.clone() };
    assert_eq!(write(dir.path().join("flat.nii"), &flat, false).unwrap_err().kind, Kind::Internal);
}

#[test]
fn long_axes_are_written_as_nifti_2_and_unknown_orientation_stays_unknown() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("long.nii");
    let long = Volume::new([40000, 1, 2], DAffine3::from_scale(DVec3::new(0.1, 1.0, 1.0)), count(80000));
    write(&path, &long, false).unwrap();
    let (back, h) = (Volume::read(&path, &options()).unwrap(), describe(&path).unwrap());
    assert_eq!((h.format, back.size, back.samples), ("NIfTI-2", long.size, long.samples));
    assert_eq!((back.world_from_voxel, h.qform_code, h.sform_code), (long.world_from_voxel, 1, 1));

    let unknown = read_crafted(&crafted(|c| c.sform_code = 0)).unwrap();
    write(&path, &unknown, true).unwrap();
    let back = Volume::read(&path, &options()).unwrap();
    assert_eq!((back.oriented, back.world_from_voxel), (false, unknown.world_from_voxel));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_is_read_back(
        size in prop::array::uniform3(1_usize..6),
        columns in prop::array::uniform3(prop::array::uniform3(-3.0..3.0_f64)),
        translation in prop::array::uniform3(-500.0..500.0_f64),
        bits in any::<u32>(),
        gz in any::<bool>(),
    ) {
        let [x, y, z] = columns.map(DVec3::from_array);
        let affine = DAffine3::from_cols(x, y, z, translation.into());
        prop_assume!(affine.matrix3.determinant().abs() > 1e-3);
        prop_assume!([x, y, z].iter().all(|c| c.length() > 0.01));
        let n = size.iter().product::<usize>() as u32;
        // Any bits: subnormals, NaN and infinities too.
        let samples = (0..n).map(|i| f32::from_bits(bits.wrapping_mul(i.wrapping_mul(2_654_435_761) | 1))).collect();
        let volume = Volume::new(size, affine, samples);
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(if gz { "a.nii.gz" } else { "a.nii" });
        write(&path, &volume, false).unwrap();
        let back = Volume::read(&path, &options()).unwrap();
        prop_assert_eq!(back.size, size);
        prop_assert!(back.world_from_voxel.abs_diff_eq(affine, 5e-5));
        // NaN keeps being NaN, though its payload may change on the way through f64.
        let same = |a: &f32, b: &f32| a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan());
        prop_assert!(back.samples.iter().zip(&volume.samples).all(|(a, b)| same(a, b)));
    }

    #[test]
    fn damaged_bytes_never_panic(
        version in 1_u8..3,
        damage in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
        keep in any::<prop::sample::Index>(),
        truncate in any::<bool>(),
        gz in any::<bool>(),
        lenient in any::<bool>(),
    ) {
        let c = crafted(|c| {
            let header = if version == 1 { 352.0 } else { 544.0 };
            (c.version, c.vox_offset) = (version, header + 32.0);
            c.gap = [&[1, 0, 0, 0, 32, 0, 0, 0, 0, 0, 0, 0][..], b"<LabelTable></LabelTable"].concat();
        });
        let mut bytes = if gz { gzip(&c.bytes()) } else { c.bytes() };
        for (place, value) in damage {
            let at = place.index(bytes.len());
            bytes[at] = value;
        }
        if truncate {
            bytes.truncate(keep.index(bytes.len()));
        }
        let options = ReadOptions { lenient, ..options() };
        if let Ok(v) = read_both("a.nii", &bytes, &options) {
            prop_assert_eq!(v.samples.len(), v.size.iter().product::<usize>());
            prop_assert!(v.world_from_voxel.is_finite());
        }
        let _ = describe_bytes(&bytes);
    }
}
