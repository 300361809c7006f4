//! What commands say is what is: predictions, figures, names of files and of labels.

use crate::support::{Folder, QUICK, fit};
use engine::volume::{ReadOptions, Volume, nifti};
use serde_json::Value;

fn figure(of: &Value, pointer: &str) -> f64 {
    of.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {of}"))
}

fn record(folder: &Folder, name: &str) -> Value {
    serde_json::from_str(&folder.text(name)).expect("a record")
}

/// Two outputs of one name have their own records, with the figures that `vgs eval` finds in their files, and with
/// predictions that came true.
#[test]
fn the_record_says_what_the_file_is_and_what_was_said_of_it() {
    let folder = Folder::new(40);
    for (output, name) in [("a.ply", "a.run.json"), ("a.vgs", "a.vgs.run.json")] {
        let more =
            ["--target-hu", "60", "--target-rounds", "0", "--iterations", "100", "--explain", "-o", output];
        let ended = folder.run(&[&["fit", "ct.nii.gz", "--roi", "mask.nii.gz"][..], &more].concat());
        assert_eq!(ended.code, 0, "{output} beside the other: {}", ended.err);
        assert!(ended.err.contains("99 % of the voxels within 60 HU of the scan"), "{}", ended.err);
        let record = record(&folder, name);
        assert_eq!(record["results"]["outputs"][0], output);
        let eval = ["eval", output, "ct.nii.gz", "--roi", "mask.nii.gz", "--json"];
        let found = folder.run(&eval).json();
        for key in [
            "rmse_hu",
            "p99_hu",
            "psnr_db",
            "psnr_min_offset_db",
            "outline_mm",
            "outline_voxels",
            "soft_dice",
        ] {
            let (of_fit, of_file) =
                (figure(&record["results"], &format!("/{key}")), figure(&found, &format!("/{key}")));
            assert!((of_fit - of_file).abs() <= 1e-3 * of_file, "{output}, {key}: {of_fit} and {of_file}");
        }
        let (estimate, ratio) = (&record["estimate"]["estimate"], &record["estimate"]["ratio"]);
        assert!((figure(estimate, "/p99_hu") - 60.0).abs() < 1e-6, "the target: {estimate}");
        assert!(figure(estimate, "/trial_seconds") > 0.0, "{estimate}");
        let parts = ["before", "fit", "finish"].map(|part| figure(estimate, &format!("/{part}_seconds")));
        assert!((parts.iter().sum::<f64>() / figure(estimate, "/seconds") - 1.0).abs() < 1e-6, "{estimate}");
        let rest = figure(estimate, "/found_seconds") - figure(estimate, "/calibration_seconds");
        assert!(rest > figure(estimate, "/before_seconds") - 0.01, "found out after all of it: {estimate}");
        println!("{output}: {ratio}");
        let memory = figure(ratio, "/device_peak_bytes");
        assert!((0.95..1.7).contains(&memory), "enough, and not much more: {output}: {ratio}");
        assert!((figure(ratio, "/file_bytes") - 1.0).abs() < 0.12, "{output}: {ratio}");
    }
    // The same file again is another matter.
    let again = folder.run(&fit("a.vgs", &[]));
    assert_eq!(again.code, 73, "{}", again.err);
}

/// Patients in one call: each file has the volume of its own scan, and the table has a row for each object.
#[test]
fn several_patients_are_counted_each_with_their_own_scan() {
    let folder = Folder::new(24);
    let other = Folder::with_seed(24, 2);
    for name in ["ct.nii.gz", "mask.nii.gz"] {
        folder.write(&format!("other-{name}"), other.read(name));
    }
    let quick = [&QUICK[..], &["--no-eval", "--quiet"]].concat();
    for (scan, mask, output) in
        [("ct.nii.gz", "mask.nii.gz", "a.ply"), ("other-ct.nii.gz", "other-mask.nii.gz", "b.ply")]
    {
        let ended = folder.run(&[&["fit", scan, "--roi", mask, "-o", output][..], &quick].concat());
        assert_eq!(ended.code, 0, "{}", ended.err);
    }
    let scans = ["--volume", "other-ct.nii.gz", "--volume", "ct.nii.gz"];
    let both =
        folder.run(&[&["stats", "a.ply", "b.ply", "--json", "--csv", "t.csv"][..], &scans].concat()).json();
    for (row, (file, scan)) in [("a.ply", "ct.nii.gz"), ("b.ply", "other-ct.nii.gz")].into_iter().enumerate()
    {
        let alone = folder.run(&["stats", file, "--volume", scan, "--json"]).json();
        assert_eq!(both["objects"][row], alone["objects"][0], "{file}");
        assert_eq!(both["objects"][row]["file"], file);
    }
    let table = folder.text("t.csv");
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 3, "{table}");
    assert!(lines[0].contains("volume (ml),mean (HU)") && lines[2].starts_with("\"b.ply\",1,"), "{table}");
    let volume = figure(&both["objects"][1], "/volume_ml").to_string();
    assert!(lines[2].split(',').any(|cell| cell == volume), "{volume} in {table}");
    // One of the two scans is not that of the other patient, and is not taken for it.
    let one = folder.run(&["stats", "a.ply", "b.ply", "--volume", "ct.nii.gz"]);
    assert!(one.code == 0 && one.err.contains("b.ply: none of the volumes is its scan"), "{}", one.err);
    assert_eq!(folder.run(&["stats", "a.ply", "--csv", "t.csv"]).code, 73, "a table that exists stays");
}

/// Labels by range, pattern and all; a mask tells which it has, with what they cover.
#[test]
fn labels_are_listed_and_chosen_in_every_way() {
    let folder = Folder::new(24);
    let mask = Volume::read(folder.path("mask.nii.gz"), &ReadOptions::default()).expect("the mask");
    let ct = Volume::read(folder.path("ct.nii.gz"), &ReadOptions::default()).expect("the scan");
    let samples: Vec<f32> = mask.samples.iter().enumerate().map(|(i, m)| m * [3.0, 5.0][i % 2]).collect();
    let map = Volume { samples, ..mask.clone() };
    nifti::write(folder.path("labels.nii"), &map, false).expect("a label map");

    let told = folder.run(&["info", "labels.nii", "--volume", "ct.nii.gz", "--json"]).json();
    let ml = mask.spacing_mm().element_product() / 1000.0;
    for (row, label) in told["present"].as_array().expect("labels").iter().zip([3.0, 5.0]) {
        let there: Vec<f64> =
            (0..map.len()).filter(|&i| map.samples[i] == label).map(|i| f64::from(ct.samples[i])).collect();
        assert_eq!((figure(row, "/number"), figure(row, "/voxels")), (f64::from(label), there.len() as f64));
        assert!((figure(row, "/ml") - there.len() as f64 * ml).abs() < 1e-9, "{row}");
        let mean = there.iter().sum::<f64>() / there.len() as f64;
        assert!((figure(row, "/mean") - mean).abs() < 1e-6, "{row}: {mean}");
    }
    let text = folder.run(&["info", "labels.nii"]).out;
    assert!(
        text.contains("2 have voxels") && text.contains("volume, ml") && !text.contains("mean, HU"),
        "{text}"
    );
    assert!(
        folder.run(&["info", "ct.nii.gz", "--json"]).json().get("present").is_none(),
        "a scan has no labels"
    );

    let quick = [&QUICK[..], &["--no-eval", "--quiet"]].concat();
    let fitted = |choice: &str, output: &str| {
        let command = ["fit", "ct.nii.gz", "--roi", "labels.nii", "--roi-label", choice, "-o", output];
        folder.run(&[&command[..], &quick].concat())
    };
    for (choice, output) in [("all", "all.ply"), ("1-4", "three.ply"), ("3-9,5", "both.ply")] {
        let ended = fitted(choice, output);
        assert_eq!(ended.code, 0, "{choice}: {}", ended.err);
    }
    assert!(folder.read("all.ply") == folder.read("both.ply"));
    let labels = |file: &str| {
        let labels = folder.run(&["info", file, "--json"]).json()["labels"].clone();
        labels.as_array().expect("labels").iter().map(|l| figure(l, "/label")).collect::<Vec<_>>()
    };
    assert_eq!((labels("all.ply"), labels("three.ply")), (vec![3.0, 5.0], vec![3.0]));
    let unknown = fitted("6-9", "none.ply");
    assert!(unknown.code == 2 && unknown.err.contains("VGS-ROI-010"), "{}", unknown.err);

    // Objects of splats are chosen in the same ways.
    for (choice, expected) in [("all", vec![3.0, 5.0]), ("4-6", vec![5.0]), ("label*3", vec![3.0])] {
        let ended = folder.run(&["convert", "all.ply", "--object", choice, "-o", "part.ply", "--force"]);
        assert_eq!(ended.code, 0, "{choice}: {}", ended.err);
        assert_eq!(labels("part.ply"), expected, "{choice}");
    }
}

#[test]
fn a_dash_makes_no_file() {
    let folder = Folder::new(12);
    let before = folder.contents();
    for command in
        [&["info", "-"][..], &["rasterize", "a.ply", "--like", "ct.nii.gz", "-o", "-"], &fit("-", &[])]
    {
        let ended = folder.run(command);
        assert!(ended.code == 2 && ended.err.contains("VGS-CLI-145"), "{command:?}: {}", ended.err);
    }
    assert_eq!(folder.contents(), before);
}
