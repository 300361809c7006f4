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

    let table = folder.text("a.spz.csv");
    let rows: Vec<Vec<f64>> = table
        .lines()
        .skip(1)
        .map(|row| row.split(',').map(|v| v.parse().expect("a number")).collect())
        .collect();
    let (first, last) = (&rows[0], &rows[rows.len() - 1]);
    assert_eq!((first[0], last[0], last[2] as usize), (0.0, 40.0, set.splats.len()), "{table}");
    assert!(rows.len() == 6 && (first[3] - before).abs() + (last[3] - after).abs() < 1e-9, "{table}");
    assert!(folder.text("a.spz.svg").contains("PSNR of the views"));

    let ended = folder.run(&bake("b.spz", &SMALL));
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(ended.err.contains("dB on 8 views that were not fitted"), "{}", ended.err);
    assert_eq!(folder.read("a.spz"), folder.read("b.spz"), "the same seed, the same bits");
    folder.run(&bake("c.spz", &[&SMALL[..], &["--seed", "1"]].concat()));
    assert_ne!(folder.read("a.spz"), folder.read("c.spz"));

    // Fewer splats, in other formats, without light and within a time.
    let fewer = ["--max-splats", "20", "--shade", "off", "--time-budget", "2s", "--json"];
    for name in ["d.ply", "d.sog", "d.glb"] {
        let told = folder.run(&bake(name, &[&SMALL[..], &fewer].concat())).json();
        assert_eq!(told["splats"], 20, "{name}");
        let set = splat::read(folder.path(name), &ReadOptions::default()).expect("splats");
        assert_eq!(
            set.colours.map(|colours| colours.degree),
            Some(0),
            "without light, from any side the same"
        );
    }
    // Without steps there is no curve, so that one which is there does not matter.
    let curve = folder.read("d.csv");
    std::fs::remove_file(folder.path("d.ply")).expect("removed");
    let ended =
        folder.run(&["bake", "ours.ply", "-o", "d.ply", "--tf", "CT-Soft-Tissue", "--iterations", "0"]);
    assert!(ended.code == 0 && folder.read("d.csv") == curve, "{}", ended.err);
}

#[test]
fn the_light_goes_along_with_the_viewer_unless_it_is_of_the_patient() {
    let folder = Folder::new(16);
    folder.run(&fit("ours.ply", &["--no-eval"]));
    // Without highlights, what does not turn is the same from any side.
    let turns = |output: &str, degree: u8, command: &[&str]| {
        let ended = folder.run(&[command, &["ours.ply", "-o", output, "--tf", "CT-Soft-Tissue"]].concat());
        assert_eq!(ended.code, 0, "{}", ended.err);
        let set = splat::read(folder.path(output), &ReadOptions::default()).expect("splats");
        let colours = set.colours.expect("colours");
        assert_eq!(colours.degree, degree, "{output}");
        let rest = (0..set.splats.len()).flat_map(|i| colours.of(i)[3..].to_vec());
        rest.fold(0.0f32, |most, coefficient| most.max(coefficient.abs()))
    };
    let lit = "bake --iterations 0 --views 1 --size 16 --shade on --specular 0";
    let lit: Vec<&str> = lit.split_whitespace().collect();
    let camera = turns("camera.ply", 3, &lit);
    let head = turns("head.ply", 3, &[&lit[..], &["--headlight"]].concat());
    let stays = turns("left.ply", 2, &[&lit[..], &["--light-direction", "left"]].concat());
    assert!(camera > 0.1 && head > 0.1 && stays < 0.02, "{camera}, {head}, {stays}");
}

#[test]
fn a_live_spz_has_colours_for_others_and_the_fit_for_every_command() {
    let folder = Folder::new(16);
    folder.run(&fit("ours.vgs", &["--no-eval"]));
    let bake = [&["bake", "ours.vgs", "-o", "baked.spz", "--live"], &SMALL[..]].concat();
    let convert = ["convert", "ours.vgs", "-o", "quick.spz", "--live", "--tf", "CT-Soft-Tissue"];
    let picture = |name: &str| {
        let ended =
            folder.run(&["render", name, "--tf", "CT-Bone", "-o", "a.png", "--size", "48x48", "--force"]);
        assert_eq!(ended.code, 0, "{name}: {}", ended.err);
        engine::image::read(folder.path("a.png")).expect("a picture").image.pixels
    };
    let eval = |name: &str| folder.run(&["eval", name, "ct.nii.gz", "--roi", "mask.nii.gz", "--json"]).json();
    let set = |name: &str| splat::read(folder.path(name), &ReadOptions::default()).expect("splats");
    for (arguments, name) in [(&bake[..], "baked.spz"), (&convert, "quick.spz")] {
        let ended = folder.run(arguments);
        assert_eq!(ended.code, 0, "{name}: {}", ended.err);
        assert!(ended.err.contains("HU") && !ended.err.contains("without HU"), "{}", ended.err);
        assert!(folder.read(name).starts_with(b"NGSP\x04"), "{name}");
        assert_eq!(set(name), set("ours.vgs"), "{name}");
        let info = folder.run(&["info", name, "--json"]).json();
        assert_eq!((info["format"].as_str(), info["unit"].as_str()), (Some("spz"), Some("hu")), "{info}");
        assert_eq!(picture(name), picture("ours.vgs"), "{name}");
        assert_eq!(eval(name)["psnr_db"], eval("ours.vgs")["psnr_db"], "{name}");
        let back = ["convert", name, "-o", "back.vgs", "--force"];
        assert_eq!(folder.run(&back).code, 0);
        assert_eq!(folder.read("back.vgs"), folder.read("ours.vgs"), "{name}");
    }
    // What is cut away is not in it.
    let told =
        folder.run(&["convert", "ours.vgs", "-o", "half.spz", "--live", "--clip", "x<0", "--json"]).json();
    let half = set("half.spz").splats.len() as u64;
    assert_eq!(half + told["left_out"].as_u64().expect("a number"), set("ours.vgs").splats.len() as u64);

    folder.run(&["convert", "ours.vgs", "-o", "colours.ply", "--tf", "CT-Soft-Tissue"]);
    for (arguments, code, word) in [
        (["bake", "ours.vgs", "-o", "no.ply", "--live"], "VGS-SPZ-004", ".spz"),
        (["convert", "ours.vgs", "-o", "no.glb", "--live"], "VGS-SPZ-004", ".spz"),
        (["convert", "ours.vgs", "-o", "no.html", "--live"], "VGS-SPZ-004", ".spz"),
        (["convert", "colours.ply", "-o", "no.spz", "--live"], "VGS-SPZ-005", "HU"),
    ] {
        let ended = folder.run(&arguments);
        assert_eq!(ended.code, 2, "{arguments:?}: {}", ended.err);
        assert!(ended.err.contains(code) && ended.err.contains(word), "{arguments:?}: {}", ended.err);
    }
    assert!(["no.ply", "no.glb", "no.html", "no.spz"].iter().all(|name| !folder.path(name).exists()));
}

#[test]
fn what_cannot_be_baked_is_refused() {
    let folder = Folder::new(16);
    folder.run(&fit("ours.ply", &["--no-eval"]));
    folder.run(&["convert", "ours.ply", "-o", "colours.ply", "--tf", "CT-Soft-Tissue"]);
    folder.run(&["convert", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "coded.vgs"]);
    let cases: [(&[&str], &str, i32, &str); 8] = [
        (&["bake", "colours.ply", "-o", "no.ply"], "VGS-BAKE-007", 2, "vgs convert"),
        (&["bake", "coded.vgs", "-o", "no.ply"], "VGS-BAKE-008", 2, "vgs fit"),
        (&["bake", "ours.ply", "-o", "no.ply", "--tf", "CT-Lung"], "VGS-BAKE-009", 3, "another --tf"),
        (&["bake", "ours.ply", "-o", "ours.ply"], "VGS-CLI-021", 73, "another name"),
        (&["bake", "ours.ply", "-o", "no.splat"], "VGS-SPLAT-002", 2, "ply, vgs, spz, sog, glb"),
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
