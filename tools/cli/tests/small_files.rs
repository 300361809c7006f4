//! Splats in small files.

use crate::support::Folder;
use engine::volume::{ReadOptions, Volume, nifti};

const REGION: [&str; 2] = ["--roi", "mask.nii.gz"];

/// Returns PSNR and error of the occupancy at the voxels.
fn errors(folder: &Folder, splats: &str) -> (f64, f64) {
    let eval = ["eval", splats, "ct.nii.gz", "--offsets", "0", "--json"];
    let found = folder.run(&[&eval[..], &REGION].concat()).json();
    let number = |key: &str| found[key].as_f64().expect("a number");
    (number("psnr_db"), number("occupancy_rmse_on_grid"))
}

fn bytes(folder: &Folder, splats: &str) -> usize {
    folder.read(splats).len()
}

#[test]
fn small_files_are_smaller_where_the_fit_makes_up_for_rounding() {
    let folder = Folder::new(28);
    let fit = |output| {
        let settings = ["--splats", "200", "--iterations", "150", "--no-eval"];
        folder.run(&[&["fit", "ct.nii.gz", "-o", output], &REGION[..], &settings].concat())
    };
    let convert = |from, to, more: &[&str]| {
        let ended = folder.run(&[&["convert", from, "-o", to, "--force"], more].concat());
        assert_eq!(ended.code, 0, "{}", ended.err);
    };
    assert_eq!(fit("a.ply").code, 0);
    let (before, outline) = errors(&folder, "a.ply");
    assert_eq!(outline, 0.0, "a file has the mask");
    convert("a.ply", "rounded.vgs", &[]);
    let (fine, outline) = errors(&folder, "rounded.vgs");
    assert!(fine > before - 4.0 && outline == 0.0, "{before} dB, then {fine}, outline {outline}");
    convert("a.ply", "again.vgs", &["--volume", "ct.nii.gz", "--roi", "mask.nii.gz"]);
    // The same by one command, where the fit is still in memory.
    assert_eq!(fit("b.vgs").code, 0);
    for small in ["again.vgs", "b.vgs"] {
        let (size, rounded) = (bytes(&folder, small), bytes(&folder, "rounded.vgs"));
        assert!(size < rounded, "{small}: {size} bytes, and {rounded} are only rounded");
        let (after, outline) = errors(&folder, small);
        assert!(
            after > fine - 0.5 && outline == 0.0,
            "{small}: {fine} dB if only rounded, {after}, outline {outline}"
        );
        // What is rounded already is not rounded a second time.
        convert(small, "same.vgs", &[]);
        assert_eq!(folder.read("same.vgs"), folder.read(small));
    }
}

#[test]
fn another_scan_than_that_of_the_fit_is_refused() {
    let folder = Folder::new(20);
    let fit = ["fit", "ct.nii.gz", "-o", "a.ply", "--splats", "20", "--iterations", "2", "--no-eval"];
    assert_eq!(folder.run(&[&fit[..], &REGION].concat()).code, 0);
    assert_eq!(folder.run(&["phantom", "-o", "other", "--size", "16"]).code, 0);
    let convert = ["convert", "a.ply", "-o", "a.vgs", "--volume"];
    let other = folder.run(&[&convert[..], &["other/ct.nii.gz", "--roi-threshold", "100,3000"]].concat());
    assert!(other.code == 2 && other.err.contains("VGS-CLI-100"), "{}", other.err);
    let regionless = folder.run(&[&convert[..], &["ct.nii.gz"]].concat());
    assert!(regionless.code == 2 && regionless.err.contains("--roi"), "{}", regionless.err);
    assert!(!folder.path("a.vgs").exists());
}

#[test]
fn splats_know_the_volume_that_they_were_fitted_to() {
    let folder = Folder::new(20);
    let fit = ["fit", "ct.nii.gz", "-o", "a.ply", "--splats", "20", "--iterations", "2", "--no-eval"];
    assert_eq!(folder.run(&[&fit[..], &REGION].concat()).code, 0);
    assert_eq!(folder.run(&["convert", "a.ply", "-o", "a.vgs"]).code, 0);
    let mut ct = Volume::read(folder.path("ct.nii.gz"), &ReadOptions::default()).expect("the CT");
    let crc32 = format!("{:08x}", ct.crc32());
    ct.samples[7] += 1.0;
    nifti::write(folder.path("other.nii.gz"), &ct, false).expect("another CT");
    for splats in ["a.ply", "a.vgs"] {
        assert!(folder.run(&["info", splats]).out.contains(&crc32), "{splats}");
        let eval = |ct| folder.run(&[&["eval", splats, ct, "--offsets", "0"], &REGION[..]].concat());
        let (own, other) = (eval("ct.nii.gz"), eval("other.nii.gz"));
        assert!(own.code == 0 && !own.err.contains("another volume"), "{}", own.err);
        assert!(other.code == 0 && other.err.contains("another volume"), "{}", other.err);
    }
}

#[test]
fn a_grid_that_no_memory_holds_has_a_region_that_it_does() {
    let folder = Folder::new(20);
    let fit = ["fit", "ct.nii.gz", "-o", "a.ply", "--splats", "20", "--iterations", "2", "--no-eval"];
    assert_eq!(folder.run(&[&fit[..], &REGION].concat()).code, 0);
    let (stated, claimed) = (b"vgs.grid.size 20 20 20", b"vgs.grid.size 4000000000 4000000000 4000000000");
    let file = folder.read("a.ply");
    let at = file.windows(stated.len()).position(|window| window == stated).expect("the grid");
    let file = [&file[..at], claimed, &file[at + stated.len()..]].concat();
    folder.write("a.ply", file);
    for command in
        [&["convert", "a.ply", "-o", "a.vgs"][..], &["render", "a.ply", "-o", "a.png", "--size", "32x32"]]
    {
        let ended = folder.run(command);
        assert_eq!(ended.code, 0, "{}", ended.err);
    }
}

#[test]
fn a_region_is_coded_within_its_bound_by_one_command() {
    let folder = Folder::new(28);
    let code = |output: &str, more: &[&str]| {
        folder.run(&[&["convert", "ct.nii.gz", "-o", output, "--json"], &REGION[..], more].concat())
    };
    let [near, far] = [("b.vgs", "6"), ("c.vgs", "60")].map(|(name, bound)| {
        let told = code(name, &["--bound", bound]).json();
        assert_eq!(told["bytes"], folder.read(name).len());
        assert_eq!(told["bound"].as_f64().map(|found| found.to_string()), Some(bound.to_owned()));
        let found =
            folder.run(&["eval", name, "ct.nii.gz", "--offsets", "0", "--json", REGION[0], REGION[1]]).json();
        let worst = found["errors"]["region"]["worst_hu"].as_f64().expect("a number");
        assert!(worst <= bound.parse::<f64>().expect("a number") + 0.1, "{worst} at {bound}");
        assert_eq!(found["occupancy_rmse_on_grid"], 0.0, "exactly the mask");
        told
    });
    let number = |told: &serde_json::Value, key: &str| told[key].as_u64().expect("a number");
    assert!(
        number(&far, "bytes") < number(&near, "bytes") && number(&far, "voxels") == number(&near, "voxels")
    );
    assert_eq!(code("usual.vgs", &[]).json()["bound"], 30.0);

    let info = folder.run(&["info", "b.vgs"]).out;
    assert!(
        info.contains("coded in place of splats, each within 6 HU") && !info.contains("kernel"),
        "{info}"
    );
    assert_eq!(folder.run(&["render", "b.vgs", "-o", "b.png", "--size", "64"]).code, 0);
    assert_eq!(folder.run(&["rasterize", "b.vgs", "--like", "ct.nii.gz", "-o", "v.nii"]).code, 0);
    assert_eq!(folder.run(&["convert", "b.vgs", "-o", "same.vgs"]).code, 0);
    assert!(folder.read("same.vgs") == folder.read("b.vgs"), "what is coded stays as it is");
    let part =
        folder.run(&["convert", "b.vgs", "-o", "part.vgs", "--box=-100,-100,-100,0,100,100", "--json"]);
    assert!(number(&part.json(), "splats") < number(&near, "voxels"));

    let refused = |arguments: &[&str], code: &str| {
        let ended = folder.run(arguments);
        assert!(ended.code == 2 && ended.err.contains(code), "{arguments:?}: {} {}", ended.code, ended.err);
    };
    refused(&["convert", "ct.nii.gz", "-o", "x.vgs"], "VGS-CLI-166");
    let with =
        |more: &[&'static str]| [&["convert", "ct.nii.gz", "--roi", "mask.nii.gz", "-o"], more].concat();
    refused(&with(&["x.ply"]), "VGS-CLI-168");
    refused(&with(&["x.vgs", "--tf", "CT-Bone"]), "VGS-CLI-167");
    refused(&with(&["x.vgs", "--bound=-1"]), "VGS-CODE-003");
    refused(&["convert", "b.vgs", "-o", "x.ply"], "VGS-SPLAT-013");
    refused(&["convert", "b.vgs", "-o", "x.vgs", "--tf", "CT-Bone"], "VGS-CLI-170");
    refused(&["convert", "b.vgs", "-o", "x.vgs", "--bound", "3"], "VGS-CLI-165");
    refused(&["convert", "b.vgs", "-o", "x.vgs", "--roi", "mask.nii.gz"], "VGS-CLI-164");
    refused(&["render", "b.vgs", "-o", "x.png", "--mode", "alpha"], "VGS-CLI-169");
    assert!(!folder.path("x.vgs").exists());
    let ended = folder.run(&with(&["b.vgs"]));
    assert_eq!(ended.code, 73, "{}", ended.err);
}
