//! The layout of the paper's authors: what its numbers mean, there and back, and what is refused.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::*;
use crate::ply::reference::KERNEL;
use crate::{Activations, Harmonics, PLY_LAYOUTS, PlyLayout, WriteOptions, read_unplaced, write_as};
use crate::{Place, Unplaced};
use base::unit::Unit;

const THEIRS: [&str; 20] = [
    "x",
    "y",
    "z",
    "nx",
    "ny",
    "nz",
    "f_dc_0",
    "f_dc_1",
    "f_dc_2",
    "intensity_01",
    "hu",
    "ao",
    "opacity",
    "scale_0",
    "scale_1",
    "scale_2",
    "rot_0",
    "rot_1",
    "rot_2",
    "rot_3",
];

/// A splat as the authors' code has it: in the cube [0, 1]³, with its part of the region's intensities.
struct Theirs {
    at: DVec3,
    scale: DVec3,
    rotation: DQuat,
    part: f32,
    opacity: f32,
}

fn some(count: usize) -> Vec<Theirs> {
    let wave = |i: usize, k: f64| 0.5 + 0.45 * (k * (i as f64 + 1.0)).sin();
    (0..count)
        .map(|i| Theirs {
            at: DVec3::new(wave(i, 1.3), wave(i, 2.1), wave(i, 0.7)),
            scale: DVec3::new(0.05 * wave(i, 3.3), 0.02 * wave(i, 1.9), 0.1 * wave(i, 0.3)),
            rotation: DQuat::from_axis_angle(DVec3::new(1.0, -2.0, 0.5 * i as f64).normalize(), i as f64),
            part: wave(i, 0.9) as f32,
            opacity: wave(i, 5.1) as f32,
        })
        .collect()
}

/// Returns the file that the authors' code writes of these splats; `hu` is over the range of the whole
/// volume.
fn their_file(splats: &[Theirs], place: &Place, without: &[&str]) -> Vec<u8> {
    let names: Vec<&str> = THEIRS.iter().copied().filter(|name| !without.contains(name)).collect();
    let extent = place.steps() * place.spacing_mm();
    let mut payload = Vec::new();
    for splat in splats {
        let at = splat.at * extent;
        let size = (splat.scale * extent).to_array().map(f64::ln);
        let [low, high] = place.range.map(f64::from);
        let [x, y, z, w] = splat.rotation.to_array();
        for &name in &names {
            let value = match name {
                "x" => at.x,
                "y" => at.y,
                "z" => at.z,
                "intensity_01" => f64::from(splat.part),
                "hu" => low + f64::from(splat.part) * (high - low),
                "ao" => 0.25,
                "opacity" => f64::from(splat.opacity),
                "scale_0" => size[0],
                "scale_1" => size[1],
                "scale_2" => size[2],
                // Of any length: a reader normalises.
                "rot_0" => 2.0 * w,
                "rot_1" => 2.0 * x,
                "rot_2" => 2.0 * y,
                "rot_3" => 2.0 * z,
                _ => 0.0,
            };
            payload.extend((value as f32).to_le_bytes());
        }
    }
    let header = format!("element vertex {}\n{}", splats.len(), declared("float", &names));
    file("binary_little_endian", &header, &payload)
}

fn places() -> Vec<(&'static str, Place)> {
    let oblique = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.7);
    let spacing = DMat3::from_diagonal(DVec3::new(0.7, 0.8, 2.5));
    let left = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
    let at = |size, matrix, x, y, z| Place {
        size,
        world_from_voxel: DAffine3::from_mat3_translation(matrix, DVec3::new(x, y, z)),
        range: [-1024.0, 3071.0],
        region_range: Some([-80.0, 720.0]),
    };
    vec![
        ("cube", at([64, 64, 64], DMat3::IDENTITY, 0.0, 0.0, 0.0)),
        ("anisotropic", at([122, 101, 30], spacing, -40.0, 12.5, 900.25)),
        ("oblique", at([122, 101, 30], oblique * spacing, -40.0, 12.5, 900.25)),
        ("left-handed and oblique", at([40, 512, 20], oblique * left * spacing, 1e4, -2e4, 3.0)),
        ("one slice", at([60, 50, 1], oblique * spacing, 0.0, 0.0, 0.0)),
    ]
}

fn unplaced(file: &[u8]) -> Result<Unplaced> {
    let loaded = loaded(file, &STRICT)?;
    Ok(Unplaced { path: "theirs.ply".into(), set: loaded.set, rows: loaded.rows })
}

fn covariance(splat: &Splat) -> DMat3 {
    let root = splat.axes() * DMat3::from_diagonal(DVec3::from_array(splat.scale().map(f64::from)));
    root * root.transpose()
}

fn apart(a: DMat3, b: DMat3) -> f64 {
    let norm = |m: DMat3| m.to_cols_array().iter().map(|v| v * v).sum::<f64>().sqrt();
    norm(a - b) / norm(a)
}

fn world_mean(set: &SplatSet, index: usize) -> DVec3 {
    DVec3::from_array(set.splats[index].mean.map(f64::from)) + set.origin_mm
}

#[test]
fn their_splats_lie_where_their_code_has_them() {
    for (name, place) in places() {
        let theirs = some(50);
        let read = unplaced(&their_file(&theirs, &place, &[])).expect(name);
        assert!(read.needs_volume() && read.len() == 50 && read.unit().is_physical(), "{name}");
        let set = read.placed(Some(&place)).expect(name);
        let steps = place.steps();
        for (i, splat) in theirs.iter().enumerate() {
            let mean = place.world_from_voxel.transform_point3(splat.at * steps);
            assert!((world_mean(&set, i) - mean).length() < 1e-4, "{name}, splat {i}");
            let root = place.world_from_voxel.matrix3
                * DMat3::from_diagonal(steps)
                * DMat3::from_quat(splat.rotation)
                * DMat3::from_diagonal(splat.scale);
            let error = apart(root * root.transpose(), covariance(&set.splats[i]));
            assert!(error < 1e-5, "{name}, splat {i}: {error}");
            let hu = -80.0 + 800.0 * splat.part;
            assert!((set.splats[i].intensity - hu).abs() < 1e-3, "{name}: not the range of the file");
            assert!((set.splats[i].opacity() - splat.opacity).abs() < 1e-6, "{name}: no logit");
        }
        let field = Field { kernel: KERNEL, background: -80.0, epsilon: 1e-6, ..Field::default() };
        assert_eq!((set.field, set.unit.is_physical()), (field, true), "{name}");
    }
}

#[test]
fn what_is_written_comes_back() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.ply");
    for (name, place) in places() {
        let field = Field { kernel: Kernel::Compact, background: 12.7, epsilon: 1e-3, occupancy_w0: 0.07 };
        let voxel: Vec<Splat> = (0..200)
            .map(|i| {
                let t = i as f32;
                Splat {
                    mean: [30.0 + 29.0 * t.sin(), 25.0 + 24.0 * (2.0 * t).sin(), 9.0 * (0.1 * t).cos() + 9.5],
                    opacity_logit: 9.0 * (0.7 * t).sin(),
                    rotation: [t.cos(), 0.1 * t, -0.2, 0.3],
                    log_scale: [0.3 + t.sin(), (0.3 * t).cos(), 0.9 * (0.9 * t).sin()],
                    intensity: -80.0 + 4.0 * t,
                }
            })
            .collect();
        let set = SplatSet {
            iterations: Some(400),
            ..SplatSet::from_voxel(&voxel, &place.world_from_voxel, field)
        };
        let layout = PlyLayout::named("reference").expect("a row");
        let options = WriteOptions { layout, place: Some(place), force: true, made_of: None, live: None };
        write_as(&path, &set, &options).expect(name);
        let bytes = crate::file_bytes(&path, &set, &options).expect(name);
        assert_eq!(bytes, std::fs::metadata(&path).expect("a file").len());

        let back = read_unplaced(&path, &STRICT).and_then(|read| read.placed(Some(&place))).expect(name);
        assert_eq!((back.field, back.iterations), (set.field, set.iterations), "{name}");
        for (i, (a, b)) in set.splats.iter().zip(&back.splats).enumerate() {
            let error = apart(covariance(a), covariance(b));
            assert!(error < 3e-6, "{name}, splat {i}: covariance {error}");
            let error = (world_mean(&set, i) - world_mean(&back, i)).length();
            assert!(error < 3e-5, "{name}, splat {i}: {error} mm");
            assert_eq!(a.intensity, b.intensity, "{name}: the right HU, to the bit");
            assert!((a.opacity() - b.opacity()).abs() < 2e-7, "{name}, splat {i}");
        }
        // Without our comments it is one of theirs: the same, as far as their field goes.
        let text = std::fs::read(&path).expect("a file");
        let plain = without_comments(&text);
        let theirs = unplaced(&plain).and_then(|read| read.placed(Some(&place))).expect(name);
        assert_eq!((theirs.field.kernel, theirs.field.background), (KERNEL, -80.0));
        for (a, b) in set.splats.iter().zip(&theirs.splats) {
            let clamped = a.intensity.clamp(-80.0, 720.0);
            assert!((clamped - b.intensity).abs() < 1e-3, "{name}: {a:?} and {b:?}");
        }
    }
}

/// Returns one of our files without its comments, as a program that drops them would write it.
fn without_comments(file: &[u8]) -> Vec<u8> {
    let end = file.windows(11).position(|w| w == b"end_header\n").expect("a header");
    let header = std::str::from_utf8(&file[..end]).expect("ASCII");
    let lines = header.split_inclusive('\n').filter(|line| !line.starts_with("comment"));
    [lines.collect::<String>().as_bytes(), &file[end..]].concat()
}

#[test]
fn the_file_is_laid_out_as_theirs() {
    let (_, place) = places().swap_remove(1);
    let splat = Splat {
        mean: [10.0, 20.0, 5.0],
        opacity_logit: 3f32.ln(),
        rotation: [1.0, 0.0, 0.0, 0.0],
        log_scale: [0.0, 1.0, -0.5],
        intensity: 120.0,
    };
    let field = Field { background: -80.0, ..Field::default() };
    let set = SplatSet::from_voxel(&[splat], &place.world_from_voxel, field);
    let mut file = Vec::new();
    crate::ply::reference::encode(&set, Some(&place), &mut file).expect("writing to memory");
    let end = file.windows(11).position(|w| w == b"end_header\n").expect("a header") + 11;
    let header = std::str::from_utf8(&file[..end]).expect("ASCII");
    let lines: Vec<&str> = header.lines().collect();
    let expected: Vec<String> =
        THEIRS.iter().filter(|n| **n != "ao").map(|n| format!("property float {n}")).collect();
    assert_eq!(lines[2..22], [&["element vertex 1".to_owned()][..], &expected].concat());
    for comment in ["vgs.layout reference", "vgs.intensity_01_range -80 720", "vgs.kernel compact"] {
        assert!(lines[22..].contains(&format!("comment {comment}").as_str()), "{comment}: {header}");
    }
    assert!(!header.contains("vgs.axes") && !header.contains("vgs.origin"), "it has neither");
    let values: Vec<f32> =
        file[end..].chunks(4).map(|b| f32::from_le_bytes(b.try_into().expect("four bytes"))).collect();
    let grey = (0.25 - 0.5) / SH0;
    let ln = |s: f64, voxel: f64| (s.ln() + voxel) as f32;
    let wanted = [
        7.0,
        16.0,
        12.5,
        0.0,
        0.0,
        0.0,
        grey,
        grey,
        grey,
        0.25,
        120.0,
        0.75,
        ln(0.7, 0.0),
        ln(0.8, 1.0),
        ln(2.5, -0.5),
        1.0,
        0.0,
        0.0,
        0.0,
    ];
    assert_eq!(values.len(), wanted.len());
    for (at, (value, wanted)) in values.iter().zip(wanted).enumerate() {
        assert!((value - wanted).abs() < 2e-5 * wanted.abs().max(0.1), "value {at}: {value}, not {wanted}");
    }
}

#[test]
fn intensities_come_from_the_region_or_else_from_hu() {
    let (_, place) = places().swap_remove(2);
    let nowhere = Place { region_range: None, ..place };
    let theirs = some(20);
    let read = |without: &[&str], place: &Place| {
        unplaced(&their_file(&theirs, place, without)).and_then(|read| read.placed(Some(place)))
    };
    let by_hu = read(&[], &nowhere).expect("by hu");
    for (splat, theirs) in by_hu.splats.iter().zip(&theirs) {
        assert!((splat.intensity - (-1024.0 + 4095.0 * theirs.part)).abs() < 1e-2);
    }
    assert!((by_hu.field.background + 1024.0).abs() < 1.0, "what 0 stands for: {}", by_hu.field.background);
    let by_region = read(&["hu", "ao"], &place).expect("no hu is needed");
    assert!((by_region.splats[3].intensity - (-80.0 + 800.0 * theirs[3].part)).abs() < 1e-3);
    let error = read(&["hu"], &nowhere).expect_err("neither");
    assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-PLY-028"));
    assert!(error.help.contains("--roi") && error.file.is_some(), "{error}");
}

#[test]
fn only_their_files_are_taken_for_theirs() {
    let (_, place) = places().swap_remove(1);
    let theirs = their_file(&some(3), &place, &[]);
    let with = |insert: &str| {
        let end = theirs.windows(11).position(|w| w == b"end_header\n").expect("a header");
        [&theirs[..end], insert.as_bytes(), &theirs[end..]].concat()
    };
    assert!(unplaced(&with("comment made by hand\n")).expect("theirs").needs_volume());
    let ours = unplaced(&with("comment vgs.kernel compact\n")).expect("an ordinary file with hu");
    assert!(!ours.needs_volume());
    assert_eq!(ours.placed(None).expect("a set").field.kernel, Kernel::Compact);
    let beside =
        [with("element splat_intensity 3\nproperty float intensity\n"), little(&[7.0, 8.0, 9.0])].concat();
    let beside = unplaced(&beside).expect("an ordinary file").placed(None).expect("it needs no volume");
    assert_eq!(beside.splats[2].intensity, 9.0);

    let error = unplaced(&theirs).expect("theirs").placed(None).expect_err("no volume");
    assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-PLY-026"));
    assert!(error.help.contains("vgs eval") && error.file.is_some(), "{}", error.help);

    let mut logits = some(3);
    logits[1].opacity = -2.5;
    let mut slightly = some(3);
    slightly[1].opacity = 1.000_1;
    assert!(unplaced(&their_file(&slightly, &place, &[])).is_ok(), "rounding is no logit");
    let rows = [
        (their_file(&logits, &place, &[]), "VGS-PLY-027", "splat 1 has the opacity -2.5"),
        (their_file(&some(3), &place, &["rot_2"]), "VGS-PLY-019", "rot_2"),
        (with("comment vgs.layout other\n"), "VGS-PLY-016", "vgs.layout"),
        (with("comment vgs.layout reference\ncomment vgs.layout reference\n"), "VGS-PLY-016", "twice"),
        (with("comment vgs.intensity_01_range 5\n"), "VGS-PLY-016", "range"),
    ];
    for (file, code, says) in rows {
        let error = unplaced(&file).expect_err(says);
        assert_eq!((error.kind, error.code), (Kind::BadData, code), "{error}");
        assert!(error.message.contains(says), "{error}");
    }
    let stated =
        file("binary_little_endian", &format!("{}comment vgs.layout reference\n", plain_header("0")), &[]);
    assert!(unplaced(&stated).expect_err("it says so and is not").message.contains("intensity_01"));
}

#[test]
fn splats_that_are_dropped_take_their_intensities_along() {
    let (_, place) = places().swap_remove(1);
    let mut theirs = some(4);
    theirs[0].part = f32::NAN;
    theirs[2].opacity = f32::INFINITY;
    let file = their_file(&theirs, &place, &[]);
    let read = loaded(&file, &LENIENT).expect("leniently");
    assert_eq!(read.mended.dropped, 2);
    let read = Unplaced { path: "theirs.ply".into(), set: read.set, rows: read.rows };
    let set = read.placed(Some(&place)).expect("a set");
    for (splat, i) in set.splats.iter().zip([1, 3]) {
        assert!((splat.intensity - (-80.0 + 800.0 * theirs[i].part)).abs() < 1e-3);
    }
    assert_eq!(loaded(&file, &STRICT).err().expect("strictly").code, "VGS-PLY-022");
}

#[test]
fn what_cannot_be_written_so_is_refused_and_what_is_lost_is_told() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("a.ply");
    let (_, place) = places().swap_remove(1);
    let layout = PlyLayout::named("reference").expect("a layout");
    let try_with = |set: &SplatSet, place: Option<Place>| {
        write_as(&path, set, &WriteOptions { layout, place, ..WriteOptions::default() }).map_err(|e| e.code)
    };
    let colours = Harmonics { degree: 0, coefficients: vec![0.0; 9] };
    let coloured = SplatSet { unit: Unit::Luminance, colours: Some(colours), ..sample(3) };
    assert_eq!(try_with(&coloured, Some(place)), Err("VGS-PLY-030"));
    assert_eq!(try_with(&sample(3), None), Err("VGS-PLY-029"));
    assert_eq!(try_with(&sample(3), Some(Place { region_range: None, ..place })), Err("VGS-PLY-029"));
    assert_eq!(try_with(&SplatSet::default(), Some(place)), Err("VGS-PLY-011"));
    assert!(!path.exists());

    let losses = |set: &SplatSet| layout.losses(set, Some(&place)).join("; ");
    let inside = SplatSet { splats: sample(40).splats[24..].to_vec(), ..sample(1) };
    assert_eq!(losses(&inside), "");
    assert!(
        losses(&SplatSet { region: Some(region_of(&[([1; 3], 0)])), ..inside }).starts_with("the region")
    );
    let labelled = SplatSet { labels: Some(vec![1; 40]), ..sample(40) };
    let told = losses(&labelled);
    assert!(
        told.contains("labels") && told.contains("23 intensities beyond the region's -80 to 720"),
        "{told}"
    );
    assert!(PLY_LAYOUTS[0].losses(&labelled, None).is_empty());
}

#[test]
fn they_are_described_without_a_volume() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("theirs.ply");
    let (_, place) = places().swap_remove(1);
    std::fs::write(&path, their_file(&some(9), &place, &[])).expect("writing");
    let summary = describe(&path, &STRICT).expect("a description");
    assert_eq!((summary.layout, summary.splats, summary.kernel), ("reference", 9, KERNEL.name()));
    assert_eq!((summary.bounding_box_mm, summary.intensity_01_range), (None, None));
    let [low, high] = summary.index_box_mm.expect("splats");
    assert!(low[2] >= 0.0 && high[2] <= 29.0 * 2.5 && high[0] > 50.0, "{low:?} {high:?}");
    std::fs::write(&path, their_file(&some(9), &place, &["hu"])).expect("writing");
    assert_eq!(describe(&path, &STRICT).expect("a description").intensity_range, None);

    let set = SplatSet { splats: sample(40).splats[24..].to_vec(), ..sample(1) };
    let options = WriteOptions {
        layout: PlyLayout::named("reference").expect("a layout"),
        place: Some(place),
        force: true,
        made_of: None,
        live: None,
    };
    write_as(&path, &set, &options).expect("writing");
    let summary = describe(&path, &STRICT).expect("a description");
    assert_eq!((summary.layout, summary.intensity_01_range), ("reference", Some([-80.0, 720.0])));
    assert_eq!((summary.intensity_range, summary.iterations), (Some([-40.0, 560.0]), Some(400)));
}
