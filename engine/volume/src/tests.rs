//! Tests of the volume type, the choice of format, and the real cases.

use std::fs;
use std::io::Cursor;
use std::path::PathBuf;

use glam::{DAffine3, DVec3};

use super::*;
use base::input::Input;
use base::{Kind, Result};

fn ramp(size: [usize; 3]) -> Volume {
    let mut samples = Vec::new();
    for z in 0..size[2] {
        for y in 0..size[1] {
            samples.extend((0..size[0]).map(|x| (x + 10 * y + 100 * z) as f32));
        }
    }
    Volume::new(size, DAffine3::from_scale(DVec3::new(1.0, 2.0, 3.0)), samples)
}

#[test]
fn indices_interpolation_and_geometry() {
    let v = ramp([4, 3, 2]);
    assert_eq!((v.len(), v.is_empty(), v.index(3, 2, 1)), (24, false, 23));
    for (p, expected) in [
        ([1.0, 2.0, 1.0], 121.0),
        ([1.5, 0.25, 0.5], 54.0),
        ([-3.0, 0.0, 0.0], 0.0),
        ([9.0, 9.0, 9.0], 123.0),
        ([3.0, 1.5, -1.0], 18.0),
    ] {
        assert_eq!(v.trilinear(DVec3::from_array(p)), expected, "{p:?}");
    }
    assert_eq!(v.spacing_mm(), DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(v.world_corners()[0], DVec3::new(-0.5, -1.0, -1.5));
    assert_eq!(v.world_corners()[7], DVec3::new(3.5, 5.0, 4.5));
    assert_eq!(v.voxel_from_world().transform_point3(DVec3::new(1.0, 2.0, 3.0)), DVec3::ONE);
}

#[test]
fn one_voxel_is_a_volume() {
    let v = Volume::new([1, 1, 1], DAffine3::IDENTITY, vec![7.0]);
    assert_eq!(v.trilinear(DVec3::new(0.3, -4.0, 0.0)), 7.0);
}

#[test]
fn stats_leave_out_what_is_not_finite() {
    let mut v = ramp([2, 1, 2]);
    v.samples.copy_from_slice(&[1.0, 3.0, f32::NAN, f32::INFINITY]);
    let expected = Stats { finite: 2, non_finite: 2, min: 1.0, max: 3.0, mean: 2.0, std_dev: 1.0 };
    assert_eq!(v.gather_stats(), expected);
    assert_eq!(v.min_max(), Some((1.0, 3.0)));
    v.samples.fill(f32::NAN);
    assert_eq!(v.min_max(), None);
    assert_eq!(v.gather_stats().finite, 0);
    // A NaN neighbour of no weight does not spoil its neighbour.
    v.samples[0] = 5.0;
    assert_eq!(v.trilinear(DVec3::ZERO), 5.0);
}

#[test]
fn axis_codes_follow_the_closest_direction() {
    let cases = [
        ([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], "RAS"),
        ([[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], "LAS"),
        ([[-0.9, -0.3, 0.1], [0.2, -0.9, 0.2], [0.1, 0.2, 4.0]], "LPS"),
        ([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]], "IRP"),
        // Two axes closest to one direction: the clearer one has it.
        ([[1.0, 0.9, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]], "ARS"),
    ];
    for ([x, y, z], codes) in cases {
        let affine = DAffine3::from_cols(x.into(), y.into(), z.into(), DVec3::ZERO);
        assert_eq!(Volume::new([1, 1, 1], affine, vec![0.0]).axis_codes(), codes);
    }
}

#[test]
fn files_in_no_known_format_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let cases: [(&str, &[u8], Kind, &str); 11] = [
        ("a.mnc", b"CDF\x01", Kind::BadData, "VGS-VOL-009"),
        ("a.nrrd", b"NRRD0004\n", Kind::BadData, "VGS-NRD-003"),
        ("text.nhdr", b"hello", Kind::BadData, "VGS-NRD-001"),
        ("a.mha", b"ObjectType = Image\n", Kind::BadData, "VGS-MHA-002"),
        ("text.mhd", b"hello", Kind::BadData, "VGS-MHA-001"),
        ("a.npy", b"\x93NUMPY\x01\0", Kind::BadData, "VGS-NPY-001"),
        ("text.npy", b"hello", Kind::BadData, "VGS-NPY-002"),
        ("empty.npy", b"", Kind::BadData, "VGS-VOL-003"),
        ("empty.nii", b"", Kind::BadData, "VGS-VOL-003"),
        ("empty.inv3", b"", Kind::BadData, "VGS-VOL-003"),
        ("text.inv3", b"hello", Kind::BadData, "VGS-INV-001"),
    ];
    for (name, content, kind, code) in cases {
        let error = read_both(name, content, &ReadOptions::default()).unwrap_err();
        assert_eq!((error.kind, error.code), (kind, code), "{name}");
        assert!(error.file.is_some_and(|file| file.ends_with(name)));
    }
    let missing = Volume::read(dir.path().join("none.nii"), &ReadOptions::default()).unwrap_err();
    assert_eq!(missing.kind, Kind::Missing);
    // A folder is one of DICOM slices, and this one has none.
    assert_eq!(Volume::read(dir.path(), &ReadOptions::default()).unwrap_err().code, "VGS-DCM-001");
}

/// Reads a file from a path and from memory, which must give the same, and returns that.
pub(super) fn read_both(name: &str, bytes: &[u8], options: &ReadOptions) -> Result<Volume> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    fs::write(&path, bytes).unwrap();
    let found = Volume::read(&path, options);
    // From here on nothing can be read by the name.
    drop(folder);
    let again = Volume::read(Input::of(Cursor::new(bytes.to_vec()), &path), options);
    match &again {
        Err(e) if e.code == "VGS-IO-003" => assert!(found.is_err(), "another file is missing: {e}"),
        _ => assert_eq!(format!("{again:?}"), format!("{found:?}")),
    }
    found
}

#[test]
fn what_is_several_files_is_not_read_from_one() {
    let mut half = vec![0; 352];
    half[..4].copy_from_slice(&348_i32.to_le_bytes());
    half[344..348].copy_from_slice(b"ni1\0");
    let slice = [vec![0; 128], b"DICM".to_vec()].concat();
    let nrrd = b"NRRD0004\ntype: uchar\ndimension: 3\nsizes: 1 1 1\nencoding: raw\ndata file: a.raw\n\n";
    let meta =
        b"ObjectType = Image\nNDims = 3\nDimSize = 1 1 1\nElementType = MET_UCHAR\nElementDataFile = a.raw\n";
    let cases: [(&str, &[u8]); 4] = [("a.img", &half), ("a.dcm", &slice), ("a.nhdr", nrrd), ("a.mhd", meta)];
    for (name, bytes) in cases {
        let input = Input::of(Cursor::new(bytes.to_vec()), name);
        let error = Volume::read(input, &ReadOptions::default()).unwrap_err();
        assert_eq!((error.kind, error.code, error.file), (Kind::Usage, "VGS-IO-003", Some(name.into())));
    }
}

/// Returns the folder of real cases, or `None` with a note where it is absent.
pub(super) fn real_data() -> Option<PathBuf> {
    let folder = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: the real cases are not at {}", folder.display());
    None
}

#[test]
fn the_real_cases_read_as_documented() {
    let Some(folder) = real_data() else { return };
    // Case, volume, size, axes, range; a mask and its number of voxels and sum of weights.
    type Case = (&'static str, &'static str, [usize; 3], &'static str, (f32, f32), &'static str, usize, f64);
    let cases: [Case; 8] = [
        ("ct-abdomen-full", "ct", [512, 512, 99], "LAS", (-3024.0, 1288.0), "bones", 322824, 322824.0),
        ("ct-chest-full", "ct", [512, 512, 100], "LAS", (-3024.0, 3071.0), "vessels_soft", 629161, 279433.7),
        ("ct-liver-native", "ct", [512, 512, 20], "LAS", (-1024.0, 1839.0), "liver", 366708, 366708.0),
        ("ct-skull", "ct", [256, 256, 108], "LAS", (-1024.0, 2986.0), "bones", 475759, 475759.0),
        ("ct-thorax-1p5mm", "ct", [233, 167, 191], "LPS", (-1094.0, 3343.0), "ts", 286416, 286416.0),
        ("ct-torso-3mm", "ct", [122, 101, 112], "RAS", (-1207.0, 3382.0), "liver_soft", 73160, 41670.2),
        ("ct-torso-tiny", "ct", [122, 101, 30], "RAS", (-1100.0, 1207.0), "vessels", 3266, 3266.0),
        ("mr-brain-mni", "mr", [197, 233, 189], "RAS", (0.0, 255.0), "gm_soft", 1961850, 1008199.2),
    ];
    for (case, name, size, axes, range, mask, voxels, weight) in cases {
        let read = |file: &str| {
            Volume::read(folder.join(case).join(file), &ReadOptions::default())
                .unwrap_or_else(|e| panic!("{e}"))
        };
        let volume = read(&format!("{name}.nii.gz"));
        assert_eq!(
            (volume.size, volume.axis_codes().as_str(), volume.oriented),
            (size, axes, true),
            "{case}"
        );
        assert_eq!(volume.min_max(), Some(range), "{case}");
        let roi =
            Roi::from_mask(&read(&format!("mask_{mask}.nii.gz")), &LabelChoice::Whole, &volume).unwrap();
        assert_eq!(roi.voxel_count(), voxels, "{case} {mask}");
        assert!((roi.weight_sum() - weight).abs() < 0.06, "{case} {mask}: {}", roi.weight_sum());
    }
}

#[test]
fn the_skull_is_its_bones_threshold() {
    let Some(folder) = real_data() else { return };
    let read = |f: &str| Volume::read(folder.join("ct-skull").join(f), &ReadOptions::default()).unwrap();
    let roi = Roi::from_threshold(&read("ct.nii.gz"), 226.0, 3071.0).unwrap();
    assert_eq!(roi.weight, read("mask_bones.nii.gz").samples);
}

#[test]
fn real_label_maps_carry_their_names() {
    let Some(folder) = real_data() else { return };
    let read = |f: &str| Volume::read(folder.join("ct-torso-tiny").join(f), &ReadOptions::default()).unwrap();
    let (ct, map) = (read("ct.nii.gz"), read("ts_labels.nii.gz"));
    assert_eq!(map.labels.get(&5).map(String::as_str), Some("liver"));
    let by_name = Roi::from_mask(&map, &"liver".parse().unwrap(), &ct).unwrap();
    assert_eq!(by_name.weight, read("mask_liver.nii.gz").samples);
    let undecided = Roi::from_mask(&map, &LabelChoice::Whole, &ct).unwrap_err();
    assert_eq!(undecided.kind, Kind::Usage);
    assert!(undecided.help.contains("lists its 41 labels"), "{}", undecided.help);
}

#[test]
fn an_invesalius_project_equals_its_nifti_export() {
    let Some(folder) = real_data() else { return };
    let project = std::env::var_os("VGS_TEST_INV3")
        .map(PathBuf::from)
        .unwrap_or_else(|| "/usr/share/doc/invesalius-examples/examples/Cranium.inv3".into());
    if !project.is_file() {
        println!("skipped: no {} (package invesalius-examples, or VGS_TEST_INV3)", project.display());
        return;
    }
    let project = Volume::read(&project, &ReadOptions::default()).unwrap();
    let nifti = Volume::read(folder.join("ct-skull/ct.nii.gz"), &ReadOptions::default()).unwrap();
    assert_eq!(project.size, nifti.size);
    assert_eq!(project.samples, nifti.samples);
    assert!(project.world_from_voxel.abs_diff_eq(nifti.world_from_voxel, 1e-4));
}

#[test]
fn trilinear_is_exact_on_linear_functions_and_clamps() {
    let size = [4, 3, 5];
    let at = |i: usize| {
        let (x, y, z) = (i % 4, i / 4 % 3, i / 12);
        x as f64 * 2.0 - y as f64 + z as f64 * 0.5
    };
    let x = DVec3::new(1.25, 0.5, 3.75);
    assert!((trilinear(size, x, at) - (2.5 - 0.5 + 1.875)).abs() < 1e-12);
    assert_eq!(trilinear(size, DVec3::splat(-1.0), at), at(0));
    assert_eq!(trilinear(size, DVec3::splat(99.0), at), at(59));
}
