//! A folder of DICOM slices as a user has it: listed, chosen from, fitted.

use crate::support::series::{write_series, write_two_series};
use crate::support::{Folder, fit};
use engine::splat::read;
use engine::volume::{ReadOptions, Volume, nifti};

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
            .chain(crate::support::QUICK)
            .collect::<Vec<_>>(),
    );
    assert_eq!(ended.code, 0, "{}", ended.err);
    let ended = folder.run(&fit("b.ply", &[]));
    assert_eq!(ended.code, 0, "{}", ended.err);
    let splats = ["a.ply", "b.ply"].map(|name| read(folder.path(name), &Default::default()).expect("splats"));
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
    write_two_series(&folder, "scan", &volume);
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
