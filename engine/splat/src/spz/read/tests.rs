//! Files of our own and of others, of every version, and files that are wrong.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;

use super::*;
use crate::file::tests::read_both;
use crate::ordinary::tests::{Errors, check, coloured, rows};
use crate::{WriteOptions, describe, write};
use base::unit::Unit;

/// Colour, ln σ and opacity of the splats of [`section`]s, in the bytes of a file.
const COLOUR: [u8; 3] = [255, 128, 0];
const SCALE: [u8; 3] = [160, 176, 144];

/// Returns a header and the sections of two splats without harmonics, of which `places` and `rotation` depend on the
/// version.
fn content(version: u32, count: u32, places: &[u8], rotation: &[u8]) -> Vec<u8> {
    let mut out = MARK.to_vec();
    out.extend(version.to_le_bytes());
    out.extend(count.to_le_bytes());
    out.extend([0, 8, 0, 0]);
    out.extend(places);
    out.extend([255, 0]);
    out.extend([COLOUR, COLOUR].concat());
    out.extend([SCALE, SCALE].concat());
    out.extend([rotation, rotation].concat());
    out
}

fn gzip(content: &[u8]) -> Vec<u8> {
    let mut packed = GzEncoder::new(Vec::new(), Compression::default());
    packed.write_all(content).expect("memory takes it");
    packed.finish().expect("memory takes it")
}

/// Returns a file of version 4 of these contents of version 3, with records of extensions. Its zstd frames have one raw
/// block each (RFC 8878).
fn in_version_4(content: &[u8], records: &[u8]) -> Vec<u8> {
    let (header, mut body) = content.split_at(16);
    let mut streams = Vec::new();
    for bytes in [18, 2, 6, 6, 8] {
        let (section, rest) = body.split_at(bytes);
        body = rest;
        let block = (section.len() as u32) << 3 | 1;
        let frame =
            [&[0x28, 0xb5, 0x2f, 0xfd, 0x20, bytes as u8], &block.to_le_bytes()[..3], section].concat();
        streams.push((bytes as u64, frame));
    }
    let flags = if records.is_empty() { 0 } else { HAS_EXTENSIONS };
    let mut out = [MARK, &4u32.to_le_bytes()[..], &header[8..14], &[flags, 5]].concat();
    out.extend((ZSTD_HEADER + records.len() as u32).to_le_bytes());
    out.extend([0; 12]);
    out.extend(records);
    for (whole, frame) in &streams {
        out.extend((frame.len() as u64).to_le_bytes());
        out.extend(whole.to_le_bytes());
    }
    out.extend(streams.into_iter().flat_map(|(_, frame)| frame));
    out
}

/// Places of 1, −2 and 0.5 m, in 24 bits with 8 behind the point, and of the second splat at the origin.
fn places() -> Vec<u8> {
    [256i32, -512, 128, 0, 0, 0].iter().flat_map(|v| v.to_le_bytes()[..3].to_vec()).collect()
}

/// A quarter turn about the file's z: x, y, z, w = 0, 0, ½√2, ½√2, of which w is left out.
fn quarter() -> [u8; 4] {
    (3u32 << 30 | 511).to_le_bytes()
}

#[test]
fn what_is_written_is_read() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.spz");
    let set = coloured();
    write(&path, &set, false).expect("a file");
    let found = crate::read(&path, &ReadOptions::default()).expect("the same splats");
    let allowed = Errors { place_mm: 0.001, shape: 0.07, opacity: 0.5 / 255.0 + 1e-6, colour: 0.03 };
    check(&set, &rows(&found), |v| v, &allowed);
    assert_eq!((found.unit, found.labels.as_ref(), found.grid), (Unit::Luminance, None, None));
    let summary = describe(&path, &ReadOptions::default()).expect("a description");
    assert_eq!((summary.format, summary.layout, summary.splats), ("spz", "3dgs", set.splats.len()));
    assert_eq!((summary.encoding.as_str(), summary.harmonics_degree), ("version 3, gzip", Some(2)));
    // A second time nothing is rounded any more but the widths.
    write(&path, &found, true).expect("a file");
    let again = crate::read(&path, &ReadOptions::default()).expect("the same splats");
    let allowed = Errors { place_mm: 0.001, shape: 0.01, opacity: 1e-6, colour: 0.005 };
    check(&found, &rows(&again), |v| v, &allowed);
}

#[test]
fn every_version_is_read() {
    let rows_of_16: Vec<u8> =
        [1.0, -2.0, 0.5, 0.0, 0.0, 0.0].iter().flat_map(|v| f16::from_f32(*v).to_le_bytes()).collect();
    let turn = [128, 128, (127.5 * (1.0 + 0.5f32.sqrt())).round() as u8];
    let third = content(3, 2, &places(), &quarter());
    for (name, file, exact) in [
        ("version 1", gzip(&content(1, 2, &rows_of_16, &turn)), false),
        ("version 2", gzip(&content(2, 2, &places(), &turn)), false),
        ("version 3", gzip(&third), true),
        ("version 4", in_version_4(&third, &[]), true),
        ("an extension of others", in_version_4(&third, &[9, 0, 1, 0, 2, 0, 0, 0, 7, 7]), true),
    ] {
        let set = read_both(read, &file, &ReadOptions::default()).unwrap_or_else(|e| panic!("{name}: {e}"));
        let [first, second] = &set.splats[..] else { panic!("{name}: two splats") };
        // Right, up, back are x, z, −y of RAS.
        assert_eq!((first.mean, second.mean), ([1000.0, -500.0, -2000.0], [0.0; 3]), "{name}");
        assert!(first.opacity() > 0.999_999 && second.opacity() < 1e-6, "{name}");
        // x of the splat lies along y of the file, which is z of RAS.
        let along = first.axes().x_axis;
        assert!((along.z.abs() - 1.0).abs() < if exact { 1e-5 } else { 1e-3 }, "{name}: {along}");
        let sigma: Vec<f32> = SCALE.iter().map(|&b| f32::from(b) / 16.0 - 10.0 + 1000f32.ln()).collect();
        assert!(
            (0..3).all(|k| (first.log_scale[k] - sigma[k]).abs() < 1e-5),
            "{name}: {:?}",
            first.log_scale
        );
        let colour = set.colours.as_ref().expect("colours").colour(0, [0.0, 0.0, 1.0]);
        let wanted = COLOUR.map(|b| (0.5 + 0.282_094_8 * (f64::from(b) / 255.0 - 0.5) / 0.15).max(0.0));
        assert!((0..3).all(|c| (colour[c] - wanted[c]).abs() < 1e-5), "{name}: {colour:?}");
    }
}

#[test]
fn axes_that_a_file_names_are_those_of_its_splats() {
    let third = content(3, 2, &places(), &quarter());
    let record = |number: u32| [COORDINATE_SYSTEM, 4, number].map(u32::to_le_bytes).concat();
    let splat = |file: &[u8]| read_both(read, file, &ReadOptions::default()).expect("a set").splats[0];
    let plain = splat(&in_version_4(&third, &[]));
    // (1, −2, 0.5) m along right, down, front; right, front, up; left, up, back, a mirrored frame.
    for (number, mean) in [
        (0, plain.mean),
        (4, plain.mean),
        (6, [1000.0, 500.0, 2000.0]),
        (12, [1000.0, -2000.0, 500.0]),
        (3, [-1000.0, -500.0, -2000.0]),
    ] {
        let found = splat(&in_version_4(&third, &record(number)));
        assert_eq!(found.mean, mean, "axes {number}");
        assert_eq!(found.log_scale, plain.log_scale, "axes {number}");
    }
    let legacy = [&third[..14], &[HAS_EXTENSIONS, 0], &third[16..], &record(6)].concat();
    assert_eq!(splat(&gzip(&legacy)).mean, [1000.0, 500.0, 2000.0], "behind the splats of version 3");
    let error =
        read_both(read, &in_version_4(&third, &record(17)), &ReadOptions::default()).expect_err("no axes");
    assert_eq!(error.code, "VGS-SPZ-001");
}

#[test]
fn what_is_wrong_is_refused_by_name() {
    let third = content(3, 2, &places(), &quarter());
    let changed = |at: usize, bytes: &[u8]| {
        let mut file = third.clone();
        file[at..at + bytes.len()].copy_from_slice(bytes);
        file
    };
    let fourth = in_version_4(&third, &[]);
    let fourth_with = |at: usize, byte: u8| {
        let mut file = fourth.clone();
        file[at] = byte;
        file
    };
    let strict = ReadOptions { strict: true, max_splats: 1000 };
    for (name, file, code) in [
        ("cut off", gzip(&third[..third.len() - 1]), "VGS-SPZ-001"),
        ("no splats behind the header", gzip(&third[..16]), "VGS-SPZ-001"),
        ("cut off within gzip", gzip(&third)[..40].to_vec(), "VGS-SPZ-001"),
        ("no mark within", gzip(&changed(0, b"NGSQ")), "VGS-SPZ-001"),
        ("a later version", gzip(&changed(4, &[9])), "VGS-SPZ-002"),
        ("too many splats", gzip(&changed(8, &[0xff; 4])), "VGS-SPZ-003"),
        ("more splats than there are", gzip(&changed(8, &[200])), "VGS-SPZ-001"),
        ("degree 5", gzip(&changed(12, &[5])), "VGS-SPZ-001"),
        ("bits behind the point", gzip(&changed(13, &[25])), "VGS-SPZ-001"),
        ("something behind the splats", gzip(&[&third[..], &[0; 3]].concat()), "VGS-SPZ-001"),
        ("version 5", fourth_with(4, 5), "VGS-SPZ-002"),
        ("a stream less", fourth_with(15, 4), "VGS-SPZ-001"),
        ("a stream more", fourth_with(15, 6), "VGS-SPZ-001"),
        ("a table within the header", fourth_with(16, 31), "VGS-SPZ-001"),
        ("a table behind the end", fourth_with(17, 200), "VGS-SPZ-001"),
        ("another size of a stream", fourth_with(40, 19), "VGS-SPZ-001"),
        ("a stream that ends behind the file", fourth[..fourth.len() - 2].to_vec(), "VGS-SPZ-001"),
        ("a frame without its mark", fourth_with(32 + 80, 0), "VGS-SPZ-001"),
    ] {
        let error = read_both(read, &file, &strict).err().unwrap_or_else(|| panic!("{name}: it was read"));
        assert_eq!((error.kind, error.code), (Kind::BadData, code), "{name}: {error}");
    }
    let more = gzip(&[&third[..], &[0; 3]].concat());
    assert!(read_both(read, &more, &ReadOptions::default()).is_ok(), "what follows is ignored but if strict");
    assert!(sniff(&gzip(&third)) && sniff(&fourth) && !sniff(&gzip(b"NGSQ")) && !sniff(b"NG") && !sniff(b""));
}

/// Where the records of a file of version 4 begin, and where the bytes of the first.
const RECORD: usize = ZSTD_HEADER as usize;
const PAYLOAD: usize = RECORD + 8;

/// Returns a file of version 4 with colours and a fit of fewer splats, and the `.vgs` of that.
fn live() -> (Vec<u8>, Vec<u8>) {
    let colours = coloured();
    let mut fit = SplatSet { colours: None, unit: Unit::Hu, ..coloured() };
    fit.splats.truncate(40);
    fit.splats.iter_mut().zip(0..).for_each(|(splat, i)| splat.intensity = 30.0 * i as f32);
    fit.labels = Some((0..40).map(|i| i % 3).collect());
    fit.label_names = vec![(1, "liver".to_owned())];
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.spz");
    let options = WriteOptions { live: Some(&fit), ..WriteOptions::default() };
    crate::write_as(&path, &colours, &options).expect("a file");
    let file = std::fs::read(&path).expect("the file");
    assert_eq!(crate::file_bytes(&path, &colours, &options).expect("bytes"), file.len() as u64);
    (file, vgs::encode(&fit).expect("a .vgs"))
}

/// Returns the file with these bytes at a place.
fn with(file: &[u8], at: usize, bytes: &[u8]) -> Vec<u8> {
    let mut file = file.to_vec();
    file[at..at + bytes.len()].copy_from_slice(bytes);
    file
}

#[test]
fn a_live_file_is_its_fit_here_and_its_colours_elsewhere() {
    let (file, fit) = live();
    assert_eq!(file[PAYLOAD..][..fit.len()], fit);
    let strict = ReadOptions { strict: true, ..ReadOptions::default() };
    let found = read_both(read, &file, &strict).expect("the fit");
    assert_eq!(found, vgs::decode(&fit, &strict).expect("a .vgs").0);
    let summary = describe(Input::of(Cursor::new(file.clone()), "a"), &strict).expect("a description");
    assert_eq!((summary.format, summary.splats, summary.unit), ("spz", 40, Unit::Hu));
    assert!(
        summary.encoding.starts_with("version 4, zstd, beside colours a .vgs of"),
        "{}",
        summary.encoding
    );
    assert_eq!(summary.elements.last(), Some(&("splat with colours".to_owned(), 60)));

    // To those that do not know the record the file is that of version 3.
    let others = read_both(read, &with(&file, RECORD, &[9, 0, 1, 0]), &strict).expect("colours");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.spz");
    write(&path, &coloured(), true).expect("a file");
    assert_eq!(others, crate::read(&path, &strict).expect("colours"));
}

#[test]
fn a_fit_that_is_damaged_is_refused_by_name() {
    let (file, fit) = live();
    let strict = ReadOptions { strict: true, max_splats: 60 };
    let end = PAYLOAD + fit.len();
    let record = |bytes: &[u8]| [&FIT.to_le_bytes()[..], &(bytes.len() as u32).to_le_bytes(), bytes].concat();
    // The same file with other records.
    let recorded = |records: &[u8]| {
        let table = (RECORD + records.len()) as u32;
        [&with(&file[..RECORD], 16, &table.to_le_bytes()), records, &file[end..]].concat()
    };
    assert_eq!(recorded(&record(&fit)), file);
    for (name, file, code) in [
        ("a record longer than the zone", with(&file, RECORD + 4, &[0xff; 3]), "VGS-SPZ-001"),
        ("a record shorter than its bytes", with(&file, RECORD + 4, &[9, 0, 0, 0]), "VGS-SPZ-001"),
        ("a zone behind the end", with(&file, 18, &[0xff]), "VGS-SPZ-001"),
        ("a record without bytes", recorded(&record(&[])), "VGS-SPZ-006"),
        ("a file within itself", recorded(&record(&file)), "VGS-SPZ-006"),
        ("two fits", recorded(&record(&fit).repeat(2)), "VGS-SPZ-001"),
        ("half a fit", recorded(&record(&fit[..fit.len() / 2])), "VGS-SPZ-006"),
        ("a later version", with(&file, PAYLOAD + 8, &[9]), "VGS-SPZ-006"),
        ("another header", with(&file, PAYLOAD + 30, &[0]), "VGS-SPZ-006"),
        ("another last byte", with(&file, end - 1, &[!file[end - 1]]), "VGS-SPZ-006"),
        ("cut off in the colours", file[..file.len() - 1].to_vec(), "VGS-SPZ-001"),
        ("cut off in the table", file[..end + 9].to_vec(), "VGS-SPZ-001"),
        ("cut off in the fit", file[..end - 1].to_vec(), "VGS-SPZ-001"),
    ] {
        let error = read_both(read, &file, &strict).err().unwrap_or_else(|| panic!("{name}: it was read"));
        assert_eq!((error.kind, error.code), (Kind::BadData, code), "{name}: {error}");
        assert!(error.file.is_some() && !error.help.is_empty(), "{name}: {error}");
    }
    // No byte that is changed makes it panic.
    for at in 0..file.len() {
        let changed = Input::of(Cursor::new(with(&file, at, &[!file[at]])), "changed");
        let _ = read(&changed, &ReadOptions::default());
    }
}

#[test]
fn a_fit_goes_only_into_spz_and_only_with_intensities() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let set = coloured();
    let options = WriteOptions { live: Some(&set), ..WriteOptions::default() };
    for (name, code) in [("a.ply", "VGS-SPZ-004"), ("a.glb", "VGS-SPZ-004"), ("a.spz", "VGS-SPZ-005")] {
        let error = crate::write_as(&folder.path().join(name), &set, &options).expect_err(name);
        assert_eq!((error.kind, error.code), (Kind::Usage, code), "{name}");
    }
}
