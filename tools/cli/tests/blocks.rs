//! `vgs blocks`: a region that is fitted in blocks, and shown as one.

use std::collections::BTreeSet;

use engine::volume::{Volume, write};

use crate::support::{Folder, QUICK};

fn blocks<'a>(more: &[&'a str]) -> Vec<&'a str> {
    [&["blocks", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "blocks.csv", "--edge", "16"], more].concat()
}

#[test]
fn blocks_are_cases_that_go_together() {
    let folder = Folder::new(32);
    let told = folder.run(&blocks(&["--json"])).json();
    let count = told["blocks"].as_u64().expect("a number");
    assert!((2..=8).contains(&count), "{told}");
    let rows = folder.text("blocks.csv").lines().count() as u64 - 1;
    assert_eq!(rows, count);
    // A block inside of the body, without air, could not tell what its numbers are.
    let table = folder.text("blocks.csv");
    assert!(table.lines().next().is_some_and(|names| names.ends_with(",unit")), "{table}");
    assert!(table.lines().skip(1).all(|row| row.ends_with(",hu")), "{table}");
    // By two processes, and again by one, for which nothing is left.
    let batch = |more: &[&'static str]| {
        let all = [&["batch", "blocks.csv", "-o", "out", "--format", "vgs"], more, &["--"], &QUICK].concat();
        folder.run(&all)
    };
    for shard in ["1/2", "2/2"] {
        let ended = batch(&["--shard", shard]);
        assert_eq!(ended.code, 0, "{}", ended.err);
    }
    let ended = batch(&[]);
    assert_eq!(ended.out.matches("is done").count() as u64, count, "{}", ended.out);

    // Together they have the region of the whole, on its grid.
    let files: Vec<String> = folder
        .contents()
        .into_keys()
        .map(|path| path.display().to_string())
        .filter(|path| path.ends_with(".vgs"))
        .collect();
    assert_eq!(files.len() as u64, count);
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let stats = |files: &[&str]| {
        let told = folder.run(&[&["stats"], files, &["--volume", "ct.nii.gz", "--json"]].concat()).json();
        let ml = |row: &serde_json::Value| row["volume_ml"].as_f64().expect("a volume");
        told["objects"].as_array().expect("objects").iter().map(ml).sum::<f64>()
    };
    folder
        .run(&[&["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "whole.vgs", "-q"], &QUICK[..]].concat());
    let (parts, whole) = (stats(&files), stats(&["whole.vgs"]));
    assert!((parts - whole).abs() < 1e-6 * whole, "{parts} ml of {whole} ml");
    // They are one structure, named after the folder, and look like one.
    let render = [&["render"], &files[..], &["-o", "a.png", "--size", "64x64"]].concat();
    let ended = folder.run(&render);
    assert!(ended.code == 0 && !ended.err.contains("usual colour"), "{}", ended.err);
    let ended = folder.run(&[&render[..], &["--force", "--object", "nothing:hidden"]].concat());
    assert!(ended.err.contains("out (1), out (2)"), "{}", ended.err);
    // Each is measured by the whole volume, without a doubt of what it was fitted to.
    let eval = folder.run(&["eval", files[0], "ct.nii.gz", "--roi", "mask.nii.gz", "--json"]);
    assert_eq!((eval.code, eval.err.as_str()), (0, ""));
}

#[test]
fn a_block_has_the_labels_that_it_has() {
    let folder = Folder::new(32);
    let mask = Volume::read(folder.path("mask.nii.gz"), &Default::default()).expect("a mask");
    let label = |(i, &inside): (usize, &f32)| if i % 32 < 16 { 3.0 * inside } else { 8.0 * inside };
    let samples = mask.samples.iter().enumerate().map(label).collect();
    write(&folder.path("labels.nii.gz"), &Volume { samples, ..mask }, false).expect("a mask");
    let blocks = |labels: &'static str| {
        let all = ["blocks", "ct.nii.gz", "--roi", "labels.nii.gz", "--edge", "16", "-f", "-o", "blocks.csv"];
        folder.run(&[&all[..], &["--roi-label", labels]].concat())
    };
    assert_eq!(blocks("8,1-9").code, 0);
    let table = folder.text("blocks.csv");
    for row in table.lines().skip(1) {
        let [name, label] =
            [0, row.find('"').map_or(0, |at| at + row[at + 1..].find('"').expect("quotes") + 3)]
                .map(|at| row[at..].split(',').next().expect("a column"));
        let first: usize = name[1..6].parse().expect("a number");
        assert_eq!(label, if first < 16 { "3" } else { "8" }, "{row}");
    }
    let batch = ["batch", "blocks.csv", "-o", "out", "--format", "vgs", "--"];
    assert_eq!(folder.run(&[&batch[..], &QUICK].concat()).code, 0);
    let files: Vec<String> = std::fs::read_dir(folder.path("out"))
        .expect("a folder")
        .map(|entry| entry.expect("a file").path().display().to_string())
        .filter(|path| path.ends_with(".vgs"))
        .collect();
    let files: Vec<&str> = files.iter().map(String::as_str).collect();
    let told = folder.run(&[&["stats"], &files[..], &["--json"]].concat()).json();
    let names: BTreeSet<&str> =
        told["objects"].as_array().expect("objects").iter().filter_map(|o| o["name"].as_str()).collect();
    assert!(names.iter().all(|name| name.contains("label 3") || name.contains("label 8")), "{names:?}");
    let missing = blocks("3,5");
    assert!(missing.code == 2 && missing.err.contains("VGS-CLI-194"), "{}", missing.err);
    let missing = blocks("liver");
    assert!(missing.code == 2 && missing.err.contains("label 'liver'"), "{}", missing.err);
}

#[test]
fn what_has_no_blocks_is_refused() {
    let folder = Folder::new(16);
    let code = |arguments: &[&str]| {
        let ended = folder.run(arguments);
        (ended.code, ended.err.lines().next().unwrap_or_default().to_owned())
    };
    let (exit, told) = code(&["blocks", "ct.nii.gz", "--roi-threshold", "9000,9001", "-o", "no.csv"]);
    assert!(exit == 3 && told.contains("VGS-CLI-191"), "{exit} {told}");
    folder.run(&["phantom", "-o", "other", "--size", "15"]);
    let (exit, told) = code(&["blocks", "ct.nii.gz", "--roi", "other/mask.nii.gz", "-o", "no.csv"]);
    assert!(exit == 65 && told.contains("VGS-CLI-190"), "{exit} {told}");
    assert_eq!(folder.run(&blocks(&[])).code, 0);
    assert!(code(&blocks(&[])).1.contains("VGS-OUT-001"));
    assert!(!folder.path("no.csv").exists());
}
