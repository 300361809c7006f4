//! Series that the tests write, byte by byte, and what is read of them.

use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::list;
use crate::{ReadOptions, Volume};
use base::{Error, Kind, Result};

mod elements;
mod faults;
mod phases;
mod structures;
mod values;
mod writer;

use writer::{Dicom, words};

/// Returns the place of slice `i` without a tilt; slices are 3 mm apart along their normal.
fn place(i: f64) -> DVec3 {
    DVec3::new(10.0, -20.0, 30.0 + 3.0 * i)
}

fn read(path: &Path, options: &ReadOptions) -> Result<Volume> {
    Volume::read(path, options)
}

/// Returns a folder with these files, their names in reverse order.
fn folder(files: &[Dicom]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for (i, file) in files.iter().enumerate() {
        fs::write(folder.path().join(format!("{:03}.dcm", 999 - i)), file.bytes()).unwrap();
    }
    folder
}

fn even(count: u16) -> Vec<Dicom> {
    (0..count).map(|i| Dicom::slice(i, place(f64::from(i)))).collect()
}

fn volume(files: &[Dicom]) -> Result<Volume> {
    read(folder(files).path(), &ReadOptions::default())
}

fn refused(files: &[Dicom]) -> Error {
    volume(files).expect_err("a series that is refused")
}

fn at(folder: &Path, name: &str) -> PathBuf {
    folder.join(name)
}

#[test]
fn a_series_is_a_volume_where_it_lies() {
    let read = volume(&even(5)).unwrap();
    assert_eq!((read.size, read.oriented), ([4, 3, 5], true));
    for (voxel, lps) in [
        (DVec3::ZERO, place(0.0)),
        (DVec3::new(0.0, 0.0, 4.0), place(4.0)),
        // Columns along (0.8, 0.6, 0), half a millimetre each; rows along (-0.6, 0.8, 0), two.
        (DVec3::new(2.0, 0.0, 0.0), place(0.0) + DVec3::new(0.8, 0.6, 0.0)),
        (DVec3::new(0.0, 2.0, 1.0), place(1.0) + 4.0 * DVec3::new(-0.6, 0.8, 0.0)),
    ] {
        let ras = DVec3::new(-lps.x, -lps.y, lps.z);
        let found = read.world_from_voxel.transform_point3(voxel);
        assert!((found - ras).length() < 1e-9, "{voxel}: {found} for {ras}");
    }
    // Slope 2, intercept -1024; columns fastest, then rows, then slices from the feet up.
    for (x, y, z) in [(0, 0, 0), (3, 0, 0), (1, 2, 3), (3, 2, 4)] {
        let stored = (100 * z + 4 * y + x) as f32;
        assert_eq!(read.samples[read.index(x, y, z)], 2.0 * stored - 1024.0, "{x} {y} {z}");
    }
}

#[test]
fn a_slice_stands_for_its_series_and_a_dicomdir_for_its_folder() {
    let mut other = Dicom::slice(90, place(0.0));
    other.text((0x0020, 0x000e), b"UI", "9.9");
    let folder = folder(&[even(5), vec![other]].concat());
    let whole = read(&at(folder.path(), "997.dcm"), &ReadOptions::default()).unwrap();
    assert_eq!(whole.size, [4, 3, 5]);
    let mut index = Dicom::slice(0, place(0.0));
    index.class = "1.2.840.10008.1.3.10";
    fs::write(at(folder.path(), "DICOMDIR"), index.bytes()).unwrap();
    let by_index = read(&at(folder.path(), "DICOMDIR"), &ReadOptions::default()).unwrap();
    assert_eq!(by_index.samples, whole.samples);
    assert_eq!(Volume::read(folder.path(), &ReadOptions::default()).unwrap().samples, whole.samples);
}

#[test]
fn a_tilt_is_a_shear_and_nothing_is_resampled() {
    let files: Vec<_> = (0..6)
        .map(|i| Dicom::slice(i, place(f64::from(i)) + f64::from(i) * DVec3::new(0.3, 0.5, 0.0)))
        .collect();
    let read = volume(&files).unwrap();
    assert_eq!(read.size, [4, 3, 6]);
    let step = read.world_from_voxel.matrix3.z_axis;
    assert!((step - DVec3::new(-0.3, -0.5, 3.0)).length() < 1e-9, "{step}");
    assert_eq!(read.samples[read.index(0, 0, 5)], 2.0 * 500.0 - 1024.0);
}

#[test]
fn missing_and_uneven_slices_are_at_their_true_places() {
    let at = |places: &[f64]| {
        let files: Vec<_> =
            places.iter().enumerate().map(|(i, &z)| Dicom::slice(i as u16, place(z))).collect();
        volume(&files).unwrap()
    };
    let missing = at(&[0.0, 1.0, 2.0, 6.0, 7.0]);
    assert_eq!(missing.size, [4, 3, 8]);
    let empty: Vec<_> = (0..8).filter(|&z| missing.samples[missing.index(1, 1, z)].is_nan()).collect();
    assert_eq!(empty, [3, 4, 5], "no value is made up");
    let place = missing.world_from_voxel.transform_point3(DVec3::new(0.0, 0.0, 6.0));
    assert!((place.z - 48.0).abs() < 1e-9);
    assert_eq!(missing.samples[missing.index(0, 0, 6)], 2.0 * 300.0 - 1024.0);
    let uneven = at(&[0.0, 2.0, 3.0, 5.0]);
    assert_eq!((uneven.size[2], uneven.spacing_mm().z.round()), (6, 3.0));
    assert_eq!(refused_at(&[0.0, 1.0, 2.7, 3.1, 9.3, 10.77]).code, "VGS-DCM-008");
}

fn refused_at(places: &[f64]) -> Error {
    let files: Vec<_> = places.iter().enumerate().map(|(i, &z)| Dicom::slice(i as u16, place(z))).collect();
    refused(&files)
}

#[test]
fn one_series_of_several_is_chosen() {
    let mut second = even(3);
    for (i, file) in second.iter_mut().enumerate() {
        file.text((0x0020, 0x000e), b"UI", "1.2.4");
        file.text((0x0020, 0x0011), b"IS", "3");
        file.text((0x0008, 0x0018), b"UI", &format!("7.{i}"));
        file.text((0x0008, 0x103e), b"LO", "Lung");
    }
    let mut scout = Dicom::slice(50, place(0.0));
    scout.text((0x0008, 0x0008), b"CS", "ORIGINAL\\PRIMARY\\LOCALIZER");
    scout.text((0x0020, 0x000e), b"UI", "1.2.2");
    scout.text((0x0020, 0x0011), b"IS", "1");
    // A scout view beside one series is in nobody's way.
    assert_eq!(volume(&[even(5), vec![scout.clone()]].concat()).unwrap().size[2], 5);
    let folder = folder(&[even(5), second, vec![scout.clone()]].concat());
    let listed = list(folder.path(), &ReadOptions::default()).unwrap();
    let slices: Vec<_> = listed.iter().map(|row| (row.number, row.size[2], row.localizer)).collect();
    assert_eq!(slices, [(1, 1, true), (2, 5, false), (3, 3, false)]);
    let chosen = |series: Option<&str>| {
        read(folder.path(), &ReadOptions { series: series.map(str::to_owned), ..ReadOptions::default() })
    };
    let error = chosen(None).unwrap_err();
    assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-DCM-006"));
    assert!(error.help.contains("--series") && error.help.contains("3: CT Lung, 3 slices"), "{}", error.help);
    for (asked, slices) in [("2", 5), ("3", 3), ("1.2.4", 3), ("lung", 3), ("abdomen 1", 5)] {
        // The scout's description is that of the first series.
        match chosen(Some(asked)) {
            Ok(volume) => assert_eq!(volume.size[2], slices, "{asked}"),
            Err(error) => assert!(
                asked.starts_with("abdomen") && error.message.contains("2 series"),
                "{asked}: {error}"
            ),
        }
    }
    for none in ["4", "0", "pelvis", ""] {
        assert_eq!(chosen(Some(none)).unwrap_err().code, "VGS-DCM-006", "{none}");
    }
    let mut alone = scout.clone();
    alone.text((0x0008, 0x0018), b"UI", "5.5");
    alone.text((0x0020, 0x0032), b"DS", "0\\0\\90");
    assert!(refused(&[scout, alone]).message.contains("localizers"));
}

#[test]
fn slices_at_one_place_are_told_apart_or_refused() {
    let mut doubled = even(3);
    for (i, mut file) in even(3).into_iter().enumerate() {
        file.text((0x0008, 0x0018), b"UI", &format!("8.{i}"));
        doubled.push(file);
    }
    let error = refused(&doubled);
    assert!(error.code == "VGS-DCM-007" && error.message.contains(".dcm"), "{error}");
    for (i, file) in doubled.iter_mut().enumerate() {
        file.text((0x0018, 0x0086), b"IS", if i < 3 { "1" } else { "2" });
    }
    let error = refused(&doubled);
    assert!(error.code == "VGS-DCM-006" && error.help.contains("echo 2"), "{error}: {}", error.help);
    let echo = ReadOptions { series: Some("echo 2".into()), ..ReadOptions::default() };
    assert_eq!(read(folder(&doubled).path(), &echo).unwrap().size[2], 3);
    // The same file twice is one slice.
    assert_eq!(volume(&[even(3), even(3)].concat()).unwrap().size[2], 3);
}

#[test]
fn bits_signs_and_padding() {
    let mut files = even(2);
    for file in &mut files {
        // Twelve bits, signed, with what is none of the value's above them; -5 means nothing.
        file.put((0x0028, 0x0101), b"US", words(&[12]));
        file.put((0x0028, 0x0102), b"US", words(&[11]));
        file.put((0x0028, 0x0103), b"US", words(&[1]));
        file.put((0x0028, 0x0120), b"SS", words(&[0xfffb]));
        let mut pixels = [0_u16; 12];
        pixels[..3].copy_from_slice(&[0xf801, 0x0fff, 0x0ffb]);
        file.put((0x7fe0, 0x0010), b"OW", words(&pixels));
    }
    let samples = volume(&files).unwrap().samples;
    assert_eq!(samples[..2], [2.0 * -2047.0 - 1024.0, -2.0 - 1024.0]);
    assert!(samples[2].is_nan() && samples[3] == -1024.0);
}

#[test]
fn each_slice_has_its_own_scale() {
    let mut files = even(3);
    files[1].text((0x0028, 0x1053), b"DS", "0.5");
    let read = volume(&files).unwrap();
    assert_eq!(read.samples[read.index(0, 0, 1)], 0.5 * 100.0 - 1024.0);
    assert_eq!(read.samples[read.index(0, 0, 2)], 2.0 * 200.0 - 1024.0);
}

#[test]
fn what_is_no_volume_is_refused_by_name() {
    type Change = fn(&mut Dicom);
    let rows: [(&str, Change); 7] = [
        ("VGS-DCM-010", |file| file.text((0x0028, 0x0004), b"CS", "RGB")),
        ("VGS-DCM-011", |file| file.syntax = "1.2.840.10008.1.2.4.80"),
        ("VGS-DCM-004", |file| file.remove((0x0020, 0x0032))),
        ("VGS-DCM-021", |file| file.text((0x0028, 0x0030), b"DS", "0\\1")),
        ("VGS-DCM-022", |file| file.remove((0x0028, 0x0010))),
        ("VGS-DCM-012", |file| file.put((0x7fe0, 0x0010), b"OW", words(&[1; 6]))),
        ("VGS-DCM-021", |file| file.text((0x0028, 0x1053), b"DS", "1e400")),
    ];
    for (code, change) in rows {
        let mut files = even(3);
        files.iter_mut().for_each(change);
        let error = refused(&files);
        assert_eq!(error.code, code, "{error}");
        assert!(error.file.is_some() && !error.help.is_empty(), "{error}");
    }
    let mut aside = even(4);
    aside[2].text((0x0020, 0x0032), b"DS", "13\\-20\\36");
    assert_eq!(refused(&aside).code, "VGS-DCM-009");
    let nothing = tempfile::tempdir().unwrap();
    fs::write(at(nothing.path(), "a.txt"), "hello").unwrap();
    assert_eq!(read(nothing.path(), &ReadOptions::default()).unwrap_err().code, "VGS-DCM-001");
    let small = ReadOptions { max_bytes: 100, ..ReadOptions::default() };
    assert_eq!(read(folder(&even(3)).path(), &small).unwrap_err().code, "VGS-VOL-005");
}

/// Whatever is cut off or changed, there is a volume or an error.
#[test]
fn damage_never_panics() {
    let folder = folder(&even(2));
    let path = at(folder.path(), "999.dcm");
    let whole = fs::read(&path).unwrap();
    for length in (0..whole.len()).step_by(29) {
        fs::write(&path, &whole[..length]).unwrap();
        let _ = read(folder.path(), &ReadOptions::default());
    }
    for place in (128..whole.len()).step_by(5) {
        let mut bytes = whole.clone();
        bytes[place] ^= [0x01, 0x80, 0xff][place % 3];
        fs::write(&path, &bytes).unwrap();
        let _ = read(folder.path(), &ReadOptions::default());
    }
}
