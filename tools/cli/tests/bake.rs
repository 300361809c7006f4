//! `vgs bake`: splats for other viewers, fitted to the pictures that they should show.

use crate::support::{Folder, fit};
use engine::splat::{self, ReadOptions};

const SMALL: [&str; 8] = ["--views", "6", "--size", "48", "--iterations", "40", "--tf", "CT-Soft-Tissue"];

fn bake<'a>(output: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    [&["bake", "ours.ply", "-o", output], more].concat()
}

#[test]
fn pictures_come_nearer_and_the_same_seed_gives_the_same_file() {
    let folder = Folder::new(16);
    folder.run(&fit("ours.ply", &["--no-eval"]));
    let told = folder.run(&bake("a.spz", &[&SMALL[..], &["--json"]].concat())).json();
    let mean = |key: &str| {
        let views: Vec<f64> =
            told[key].as_array().expect("views").iter().map(|v| v.as_f64().expect("dB")).collect();
        views.iter().sum::<f64>() / views.len() as f64
    };
    let [before, after] = ["psnr_before_db", "psnr_db"].map(mean);
    assert!(after > before + 1.0, "{before} dB before, {after} after");
    assert_eq!(told["iterations"], 40);
    let set = splat::read(folder.path("a.spz"), &ReadOptions::default()).expect("splats");
    assert_eq!(told["splats"], set.splats.len());
    assert!(set.colours.is_some() && !set.unit.is_physical());

    let ended = folder.run(&bake("b.spz", &SMALL));
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(ended.err.contains("dB on 8 views that were not fitted"), "{}", ended.err);
    assert_eq!(folder.read("a.spz"), folder.read("b.spz"), "the same seed, the same bits");
    folder.run(&bake("c.spz", &[&SMALL[..], &["--seed", "1"]].concat()));
    assert_ne!(folder.read("a.spz"), folder.read("c.spz"));

    // Fewer splats, in other formats, without light and within a time.
    let fewer = ["--max-splats", "20", "--shade", "off", "--time-budget", "2s", "--json"];
    for name in ["d.ply", "d.glb"] {
        let told = folder.run(&bake(name, &[&SMALL[..], &fewer].concat())).json();
        assert_eq!(told["splats"], 20, "{name}");
        let set = splat::read(folder.path(name), &ReadOptions::default()).expect("splats");
        assert_eq!(
            set.colours.map(|colours| colours.degree),
            Some(0),
            "without light, from any side the same"
        );
    }
}

#[test]
fn what_cannot_be_baked_is_refused() {
    let folder = Folder::new(16);
    folder.run(&fit("ours.ply", &["--no-eval"]));
    folder.run(&["convert", "ours.ply", "-o", "colours.ply", "--tf", "CT-Soft-Tissue"]);
    folder.run(&["convert", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "coded.vgs"]);
    let cases: [(&[&str], &str, i32, &str); 8] = [
        (&["bake", "colours.ply", "-o", "no.ply"], "VGS-CLI-174", 2, "vgs convert"),
        (&["bake", "coded.vgs", "-o", "no.ply"], "VGS-CLI-171", 2, "vgs fit"),
        (&["bake", "ours.ply", "-o", "no.ply", "--tf", "CT-Lung"], "VGS-CLI-172", 3, "another --tf"),
        (&["bake", "ours.ply", "-o", "ours.ply"], "VGS-CLI-021", 73, "another name"),
        (&["bake", "ours.ply", "-o", "no.splat"], "VGS-SPLAT-002", 2, "ply, vgs, spz, glb"),
        (&["bake", "ours.ply", "-o", "no.vgs"], "VGS-CLI-173", 2, ".spz"),
        (&["bake", "ours.ply", "-o", "no.ply", "--views", "0"], "VGS-BAKE-003", 2, "1 to 10000"),
        (&["bake", "ours.ply", "-o", "no.ply", "--size", "5"], "VGS-BAKE-003", 2, "16 to 1920"),
    ];
    for (arguments, code, exit, word) in cases {
        let ended = folder.run(arguments);
        assert_eq!(ended.code, exit, "{arguments:?}: {}", ended.err);
        assert!(ended.err.contains(code) && ended.err.contains(word), "{arguments:?}: {}", ended.err);
    }
    assert!(["no.ply", "no.splat"].iter().all(|name| !folder.path(name).exists()));
}
