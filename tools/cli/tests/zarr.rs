//! OME-Zarr in and out, and parts of volumes.

use crate::support::{Folder, QUICK, fit};

#[test]
fn a_fit_of_zarr_is_that_of_nifti_and_parts_are_parts() {
    let folder = Folder::new(16);
    let phantom = ["phantom", "-o", "ct.zarr", "--mask", "mask.zarr", "--size", "16", "--seed", "1"];
    assert_eq!(folder.run(&phantom).code, 0);
    let zarr = [&["fit", "ct.zarr", "--roi", "mask.zarr", "-o", "zarr.ply", "-q"], &QUICK[..]].concat();
    let ended = folder.run(&zarr);
    assert_eq!((ended.code, ended.err.as_str()), (0, ""));
    folder.run(&fit("nifti.ply", &[]));
    assert!(folder.read("zarr.ply") == folder.read("nifti.ply"), "the same splats");

    // A part of both files, chosen by voxels, is the part of their grid.
    let part = ["--voxels", "0:12,2:16,1:9"];
    let of = |ct: &'static str, mask: &'static str, out: &'static str| {
        [&["fit", ct, "--roi", mask, "-o", out, "-q"], &part[..], &QUICK].concat()
    };
    for arguments in [of("ct.zarr", "mask.zarr", "a.ply"), of("ct.nii.gz", "mask.nii.gz", "b.ply")] {
        let ended = folder.run(&arguments);
        assert_eq!((ended.code, ended.err.as_str()), (0, ""));
    }
    assert!(folder.read("a.ply") == folder.read("b.ply"), "the same splats");
    // Of chunks no more is read for the record than for the fit.
    let record = |name: &str| {
        let run: serde_json::Value = serde_json::from_str(&folder.text(name)).expect("JSON");
        run["inputs"]["roi"]["bytes"].as_u64()
    };
    let file = std::fs::metadata(folder.path("mask.nii.gz")).expect("a file").len();
    assert_eq!([record("a.run.json"), record("b.run.json")], [Some(4 * 12 * 14 * 8), Some(file)]);
    let info = folder.run(&[&["info", "ct.zarr", "--json"], &part[..]].concat()).json();
    assert_eq!(info["size"], serde_json::json!([12, 14, 8]));
    assert_eq!(info["levels"][0]["size"], serde_json::json!([16, 16, 16]));
    let beyond = folder.run(&["info", "ct.nii.gz", "--voxels", "0:12,0:17,0:9"]);
    assert!(beyond.code == 2 && beyond.err.contains("0:16,0:16,0:16"), "{}", beyond.err);
    let none = folder.run(&["info", "ct.zarr", "--level", "1"]);
    assert!(none.code == 2 && none.err.contains("VGS-ZAR-006"), "{}", none.err);
    let large = folder.run(&["info", "ct.zarr", "--max-bytes", "1000"]);
    assert!(
        large.code == 0 && large.out.contains("level 0") && !large.out.contains("values"),
        "{}",
        large.out
    );
}

#[test]
fn rasterized_splats_are_written_as_zarr() {
    let folder = Folder::new(16);
    folder.run(&fit("a.ply", &[]));
    let rasterize = |out, more: &[&'static str]| {
        folder.run(&[&["rasterize", "a.ply", "--like", "ct.nii.gz", "-o", out], more].concat())
    };
    for out in ["field.zarr", "field.nii"] {
        assert_eq!(rasterize(out, &[]).code, 0);
    }
    let compared = folder.run(&["compare", "field.zarr", "field.nii", "--json"]).json();
    assert_eq!(compared["mse"], 0.0, "{compared}");
    // A folder of another kind is not replaced, a store only when that is asked for.
    assert!(rasterize("field.zarr", &[]).err.contains("VGS-OUT-001"));
    assert_eq!(rasterize("field.zarr", &["--force"]).code, 0);
    folder.write("field.zarr/note.txt", "a thesis");
    std::fs::create_dir(folder.path("mine.zarr")).unwrap();
    folder.write("mine.zarr/note.txt", "a thesis");
    assert!(rasterize("mine.zarr", &["--force"]).err.contains("VGS-OUT-003"));
    assert_eq!(folder.text("mine.zarr/note.txt"), "a thesis");
    let wrong = rasterize("field.zip", &[]);
    assert!(wrong.code == 2 && wrong.err.contains(".zarr"), "{}", wrong.err);
}

#[test]
fn a_phantom_is_the_same_by_boxes() {
    let folder = Folder::new(16);
    let phantom = |more: &[&'static str]| folder.run(&[&["phantom"], more].concat());
    let [zarr, nifti] = [
        ["-o", "p.zarr", "--mask", "m.zarr", "--size", "70,66,65"],
        ["-o", "p.nii", "--mask", "m.nii", "--size", "70,66,65"],
    ];
    assert_eq!((phantom(&zarr).code, phantom(&nifti).code), (0, 0));
    for (a, b) in [("p.zarr", "p.nii"), ("m.zarr", "m.nii")] {
        assert_eq!(folder.run(&["compare", a, b, "--json"]).json()["mse"], 0.0, "{a}");
    }
    // Blocks of chunks, some of which are missing because nothing of the mask is there.
    let table = |scan, mask| {
        let out = folder.run(&["blocks", scan, "--roi", mask, "-o", "t.csv", "--edge", "16", "-f", "--json"]);
        let rows = folder.text("t.csv").replace(".zarr", "").replace(".nii", "");
        (out.json()["voxels"].as_u64(), rows)
    };
    assert_eq!(table("p.zarr", "m.zarr"), table("p.nii", "m.nii"));
    let large = phantom(&["--size", "900", "-o", "large.nii.gz"]);
    assert!(large.code == 2 && large.err.contains("VGS-CLI-193"), "{}", large.err);
}
