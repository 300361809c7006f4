//! A folder of DICOM slices as a user has it: listed, chosen from, fitted.

mod support;

#[path = "../../../engine/src/volume/dicom/tests/writer.rs"]
mod writer;

use engine::splat::read;
use engine::volume::{ReadOptions, Volume, nifti};
use glam::DVec3;
use support::{Folder, fit};
use writer::{Dicom, words};

/// Writes a volume whose axes are those of the world as slices, into a folder of the test's.
fn write_series(folder: &Folder, name: &str, volume: &Volume, change: impl Fn(usize, &mut Dicom)) {
    std::fs::create_dir(folder.path(name)).expect("a folder");
    let [columns, rows, slices] = volume.size;
    let spacing = volume.spacing_mm();
    for z in 0..slices {
        let at = volume.world_from_voxel.transform_point3(DVec3::new(0.0, 0.0, z as f64));
        let mut file = Dicom::slice(z as u16, DVec3::new(-at.x, -at.y, at.z));
        // The phantom's axes point to the right, front and head.
        file.text((0x0020, 0x0037), b"DS", "-1\\0\\0\\0\\-1\\0");
        file.text((0x0028, 0x0030), b"DS", &format!("{}\\{}", spacing.y, spacing.x));
        file.text((0x0028, 0x1053), b"DS", "1");
        file.text((0x0028, 0x1052), b"DS", "-2048");
        file.put((0x0028, 0x0010), b"US", words(&[rows as u16]));
        file.put((0x0028, 0x0011), b"US", words(&[columns as u16]));
        let plane = &volume.samples[z * columns * rows..][..columns * rows];
        let stored: Vec<u16> = plane.iter().map(|&hu| (hu + 2048.0).round() as u16).collect();
        file.put((0x7fe0, 0x0010), b"OW", words(&stored));
        change(z, &mut file);
        // Names that say nothing of the order.
        folder.write(&format!("{name}/{:04x}", (z * 7919) % 65521), file.bytes());
    }
}

/// A folder with a phantom of whole HU, as a scanner stores them.
fn phantom() -> (Folder, Volume) {
    let folder = Folder::new(24);
    let path = folder.path("ct.nii.gz");
    let mut volume = Volume::read(&path, &ReadOptions::default()).expect("the phantom");
    volume.samples.iter_mut().for_each(|hu| *hu = hu.round());
    nifti::write(&path, &volume, true).expect("the phantom");
    (folder, volume)
}

#[test]
fn a_series_is_fitted_like_the_same_scan_in_another_format() {
    let (folder, volume) = phantom();
    write_series(&folder, "scan", &volume, |_, _| ());
    let same = folder.run(&["compare", "scan", "ct.nii.gz", "--json"]).json();
    assert_eq!(same["largest_hu"].as_f64(), Some(0.0), "{same}");
    let whole = folder.run(&["info", "scan", "--json"]).json();
    assert_eq!((&whole["file_format"], &whole["axes"]), (&"DICOM".into(), &"RAS".into()), "{whole}");
    let ended = folder.run(
        &["fit", "scan", "--roi", "mask.nii.gz", "-o", "a.ply"]
            .into_iter()
            .chain(support::QUICK)
            .collect::<Vec<_>>(),
    );
    assert_eq!(ended.code, 0, "{}", ended.err);
    let ended = folder.run(&fit("b.ply", &[]));
    assert_eq!(ended.code, 0, "{}", ended.err);
    let splats =
        ["a.ply", "b.ply"].map(|name| read(&folder.path(name), &Default::default()).expect("splats"));
    let [a, b] = &splats;
    assert_eq!(a.splats.len(), b.splats.len());
    let apart = a.splats.iter().zip(&b.splats).map(|(a, b)| {
        (0..3)
            .map(|i| (a.mean[i] - b.mean[i]).abs())
            .fold((a.intensity - b.intensity).abs() / 100.0, f32::max)
    });
    let apart = apart.fold(0.0, f32::max);
    assert!(apart < 1e-4, "{apart} mm, or hundreds of HU");
    // The record knows the folder by all that is in it.
    let record: serde_json::Value = serde_json::from_str(&folder.text("a.run.json")).expect("JSON");
    let slices = std::fs::read_dir(folder.path("scan")).expect("a folder");
    let stored: u64 = slices.map(|slice| slice.and_then(|s| s.metadata()).expect("a slice").len()).sum();
    assert_eq!(record["inputs"]["volume"]["bytes"].as_u64(), Some(stored));
}

#[test]
fn several_series_are_listed_and_one_is_chosen() {
    let (folder, volume) = phantom();
    write_series(&folder, "scan", &volume, |_, _| ());
    write_series(&folder, "scan/sharp", &volume, |z, file| {
        file.text((0x0020, 0x000e), b"UI", "1.2.9");
        file.text((0x0020, 0x0011), b"IS", "7");
        file.text((0x0008, 0x0018), b"UI", &format!("1.2.9.{z}"));
        file.text((0x0008, 0x103e), b"LO", "Bone kernel");
    });
    let listed = folder.run(&["info", "scan"]);
    assert_eq!(listed.code, 0, "{}", listed.err);
    assert!(listed.out.contains("2: CT Bone kernel, 24 slices of 24 x 24"), "{}", listed.out);
    let rows = folder.run(&["info", "scan", "--json"]).json();
    assert_eq!(rows["series"].as_array().map(Vec::len), Some(2), "{rows}");
    let refused = folder.run(&["compare", "scan", "ct.nii.gz"]);
    assert_eq!(refused.code, 2, "{}", refused.err);
    assert!(refused.err.contains("VGS-DCM-006") && refused.err.contains("--series"), "{}", refused.err);
    let chosen = folder.run(&["info", "scan", "--series", "bone", "--json"]).json();
    assert_eq!(chosen["size"], serde_json::json!([24, 24, 24]), "{chosen}");
    for (what, code) in [("scan/sharp", 0), ("mask.nii.gz", 0), ("config", 66)] {
        assert_eq!(folder.run(&["info", what]).code, code, "{what}");
    }
}
