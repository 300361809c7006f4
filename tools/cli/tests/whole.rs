//! From a phantom to splats, figures and a volume again, through every command.

use crate::support::{Folder, QUICK, fit};
use engine::splat;
use engine::volume::resample::{AREA, downsampling_loss};
use engine::volume::{LabelChoice, ReadOptions, Roi, Volume, nifti};
use glam::{DAffine3, DMat3, DVec3};

#[test]
fn phantom_fit_eval_rasterize_info() {
    let folder = Folder::new(28);
    let result = folder.run(&fit("a.ply", &["--json"])).json();
    for key in [
        "splats",
        "psnr_db",
        "psnr_min_offset_db",
        "psnr_mean_offset_db",
        "mmse",
        "rmse_hu",
        "p99_hu",
        "range",
        "occupancy_rmse",
        "soft_dice",
        "seconds",
        "fit_seconds",
        "seconds_per_iteration",
        "iterations",
        "device_peak_bytes",
        "host_peak_bytes",
        "device",
        "driver",
        "roi_voxels",
        "outputs",
    ] {
        assert!(!result[key].is_null(), "{key} in {result}");
    }
    assert_eq!((&result["splats"], &result["iterations"]), (&60.into(), &24.into()));

    let record: serde_json::Value = serde_json::from_str(&folder.text("a.run.json")).expect("a record");
    assert_eq!(record["end"], "finished");
    assert_eq!(record["config"]["splats"], 60);
    assert_eq!(record["config"]["rate_mean"].to_string(), "0.2", "numbers as people write them");
    for (input, path) in [("volume", "ct.nii.gz"), ("roi", "mask.nii.gz")] {
        assert_eq!(record["inputs"][input]["path"], path);
        assert_eq!(record["inputs"][input]["sha256"].as_str().map(str::len), Some(64));
    }
    assert_eq!(record["volume"]["size"], serde_json::json!([28, 28, 28]));
    assert!(record["timings"]["passes"].as_array().is_some_and(|passes| passes.len() > 3));
    assert!(record["memory"]["device_by_purpose"]["splats"].is_number());
    assert_eq!(record["results"]["psnr_db"], result["psnr_db"]);

    let curve = folder.text("a.csv");
    assert!(curve.starts_with("iteration,seconds,psnr_db,mse,occupancy_rmse,dice_loss,leak\n"), "{curve}");
    assert!(curve.lines().last().is_some_and(|line| line.starts_with("24,")), "{curve}");
    assert!(folder.text("a.svg").contains("</svg>"));

    // The closing evaluation of a fit and that of `eval` are the same figures.
    let eval = ["eval", "a.ply", "ct.nii.gz", "--roi", "mask.nii.gz", "--offsets", "2"];
    let again = folder.run(&[&eval[..], &["--json"]].concat()).json();
    for key in ["psnr_db", "psnr_min_offset_db", "soft_dice"] {
        let (a, b) = (result[key].as_f64().expect("a number"), again[key].as_f64().expect("a number"));
        assert!((a - b).abs() < 1e-3 * a.abs(), "{key}: {a} after the fit, {b} from the file");
    }
    assert_eq!(again["iterations"], result["iterations"], "the file says how long it was fitted");
    let more = ["--picture", "a.png", "--table", "table.csv"];
    let table = folder.run(&[&eval[..], &more].concat());
    assert_eq!(table.code, 0, "{}", table.err);
    assert!(table.out.contains("PSNR over") && table.out.contains("worst between"), "{}", table.out);
    assert_eq!(folder.text("table.csv").lines().count(), 4);
    assert!(folder.read("a.png").starts_with(b"\x89PNG\r\n\x1a\n"));

    let back =
        folder.run(&["rasterize", "a.ply", "--like", "ct.nii.gz", "-o", "back.nii.gz", "--json"]).json();
    assert_eq!(back["size"], serde_json::json!([28, 28, 28]));
    let weight = ["rasterize", "a.ply", "--spacing", "2", "-o", "w.nii", "--quantity", "weight"];
    assert_eq!(folder.run(&weight).code, 0);

    let info = folder.run(&["info", "a.ply", "back.nii.gz", "w.nii", "--json"]);
    let objects: Vec<serde_json::Value> =
        info.out.lines().map(|line| serde_json::from_str(line).expect("an object on each line")).collect();
    let [splats, volume, weight] = objects.as_slice() else { panic!("{}", info.out) };
    assert_eq!((&splats["kind"], &splats["splats"]), (&"splats".into(), &60.into()));
    assert_eq!((&volume["kind"], &volume["datatype"]), (&"volume".into(), &"float32".into()));
    assert_eq!(volume["min"], -1024.0);
    assert!(volume["max"].as_f64().is_some_and(|hu| (100.0..2000.0).contains(&hu)), "{volume}");
    assert!(weight["min"] == 0.0 && weight["max"].as_f64().is_some_and(|w| w > 0.1), "{weight}");
    assert!(folder.run(&["info", "a.ply"]).out.contains("60"));
    let budget =
        folder.run(&["info", "a.ply", "--budget", "--tf", "CT-Bone", "--size", "96x64", "--json"]).json();
    let budget = &budget["budget"];
    assert_eq!((&budget["all"]["splats"], &budget["size"][0]), (&60.into(), &96.into()), "{budget}");
    assert!(
        budget["shown"]["splats"].as_u64() <= Some(60) && budget["shown"]["ms"].as_f64() > Some(0.0),
        "{budget}"
    );
    // What is left out shows nothing.
    assert!(budget["psnr_db"].is_null() || budget["psnr_db"].as_f64() > Some(80.0), "{budget}");
    assert!(budget["memory"]["pictures"].as_u64() >= Some(96 * 64 * 8), "{budget}");
    let told = folder.run(&["info", "a.ply", "--budget", "--size", "64", "--mode", "alpha"]);
    assert!(
        told.code == 0 && told.out.contains("can be seen") && told.out.contains("memory"),
        "{}",
        told.out
    );
    assert_eq!(folder.run(&["info", "a.ply", "--budget", "--mode", "fast"]).code, 2);
}

#[test]
fn a_fit_says_before_what_it_will_cost() {
    let folder = Folder::new(28);
    let dry = folder.run(&fit("a.ply", &["--dry-run", "--json"])).json();
    let left = std::fs::read_dir(folder.path("."))
        .expect("the folder")
        .filter(|entry| entry.as_ref().is_ok_and(|e| e.file_name().to_string_lossy().starts_with("a.")));
    assert_eq!(left.count(), 0, "a dry run writes nothing");
    assert_eq!((&dry["splats"], &dry["iterations"]), (&60.into(), &24.into()));
    assert!(dry["seconds"].as_f64().is_some_and(|s| s > 0.0), "{dry}");

    let ended = folder.run(&fit("a.ply", &["--explain"]));
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(ended.err.contains("will cost") && ended.err.contains("24 iterations"), "{}", ended.err);
    let record: serde_json::Value = serde_json::from_str(&folder.text("a.run.json")).expect("a record");
    let (estimate, ratio) = (&record["estimate"]["estimate"], &record["estimate"]["ratio"]);
    assert_eq!(estimate["file_bytes"], dry["file_bytes"]);
    let told = estimate["file_bytes"].as_u64().expect("bytes");
    let file = folder.read("a.ply");
    assert!((told as f64 / file.len() as f64 - 1.0).abs() < 0.1, "{told} of {}", file.len());
    let real = told as f64 / ratio["file_bytes"].as_f64().expect("a ratio");
    assert!((real / file.len() as f64 - 1.0).abs() < 2e-3, "{ratio}");
    let memory = ratio["device_peak_bytes"].as_f64().expect("a number");
    // Whether the buffers of pairs grow once more is not known before.
    assert!((0.95..2.2).contains(&memory), "{memory}");
    assert!(ratio["seconds"].as_f64().is_some_and(|r| r > 0.0), "{ratio}");

    // The fit is the same as without.
    let plain = folder.run(&fit("b.ply", &["--json"]));
    assert_eq!(plain.code, 0, "{}", plain.err);
    assert!(folder.read("a.ply") == folder.read("b.ply"));
    let record: serde_json::Value = serde_json::from_str(&folder.text("b.run.json")).expect("a record");
    assert!(record["estimate"].is_null());

    // A quality as it is says what errors it gives; existing files are no matter.
    let quality = ["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "a.ply", "--quality", "preview"];
    let told = folder.run(&[&quality[..], &["--dry-run", "--json"]].concat()).json();
    assert!(
        told["rmse_hu"].as_f64() > Some(0.0) && told["p99_hu"].as_f64() > told["rmse_hu"].as_f64(),
        "{told}"
    );
    assert!(dry["rmse_hu"].is_null());
}

#[test]
fn a_working_grid_is_fitted_and_judged_on_the_native_one() {
    let folder = Folder::new(28);
    let native = folder.run(&fit("a.ply", &["--json"])).json();
    let coarse = folder.run(&fit("b.ply", &["--json", "--working-grid", "2"])).json();
    let record: serde_json::Value = serde_json::from_str(&folder.text("b.run.json")).expect("a record");
    assert_eq!(record["config"]["working_grid"], 2);
    assert_eq!(record["volume"]["size"], serde_json::json!([28, 28, 28]));
    assert_eq!(record["working_grid"]["volume"]["size"], serde_json::json!([14, 14, 14]));
    assert_eq!(record["working_grid"]["roi"]["soft"], true);
    for key in ["splats", "roi_voxels", "range"] {
        assert_eq!(coarse[key], native[key], "{key} is that of the native grid");
    }
    let db = |result: &serde_json::Value| result["psnr_db"].as_f64().expect("a number");
    // What the means of 2³ voxels keep at all.
    let read = |name: &str| Volume::read(folder.path(name), &ReadOptions::default()).expect("a volume");
    let ct = read("ct.nii.gz");
    let roi = Roi::from_mask(&read("mask.nii.gz"), &LabelChoice::Whole, &ct).expect("a region");
    let (low, high) = ct.min_max().expect("samples");
    let kept = downsampling_loss(&ct, &roi, 2, &AREA, [low, high]).psnr_db;
    assert!(db(&coarse) > kept - 1.5, "{} dB, of {kept} dB at best", db(&coarse));
    let eval = ["eval", "b.ply", "ct.nii.gz", "--roi", "mask.nii.gz", "--offsets", "2", "--json"];
    let again = folder.run(&eval).json();
    assert!((db(&again) - db(&coarse)).abs() < 0.01, "{again}");
    let record: serde_json::Value = serde_json::from_str(&folder.text("a.run.json")).expect("a record");
    assert!(record["working_grid"].is_null());
}

#[test]
fn thick_slices_get_others_and_their_own_voxels_stay_right() {
    let folder = Folder::new(28);
    // Every third slice of the phantom, and of its mask, three times as thick.
    for name in ["ct.nii.gz", "mask.nii.gz"] {
        let all = Volume::read(folder.path(name), &ReadOptions::default()).expect("a volume");
        let samples = all.samples.chunks(28 * 28).step_by(3).flatten().copied().collect();
        let thick = DAffine3::from_scale(DVec3::new(1.0, 1.0, 3.0));
        let thick = Volume::new([28, 28, 10], all.world_from_voxel * thick, samples);
        nifti::write(folder.path(name), &thick, true).expect("written");
    }
    let smooth = folder.run(&fit("a.ply", &["--json"])).json();
    let linear = folder.run(&fit("b.ply", &["--json", "--between-slices", "linear"])).json();
    let record =
        |name: &str| -> serde_json::Value { serde_json::from_str(&folder.text(name)).expect("a record") };
    let (a, b) = (record("a.run.json"), record("b.run.json"));
    assert_eq!(
        (&a["config"]["between_slices"], &b["config"]["between_slices"]),
        (&"smooth".into(), &"linear".into())
    );
    assert_eq!(a["working_grid"]["volume"]["size"], serde_json::json!([28, 28, 28]));
    assert!(b["working_grid"].is_null());
    for key in ["splats", "roi_voxels", "range"] {
        assert_eq!(smooth[key], linear[key], "{key} is that of the scan's own voxels");
    }
    let db = |result: &serde_json::Value| result["psnr_db"].as_f64().expect("a number");
    assert!(db(&smooth) > db(&linear) - 3.0, "{} dB, and {} dB without", db(&smooth), db(&linear));
    let info = folder.run(&["info", "a.ply", "--json"]).json();
    assert_eq!(info["grid_size"], serde_json::json!([28, 28, 28]));
    // The closing evaluation is that of eval, which tells by the splats what lies between slices.
    let eval = |more: &[&str]| {
        let eval = ["eval", "a.ply", "ct.nii.gz", "--roi", "mask.nii.gz", "--offsets", "2", "--json"];
        folder.run(&[&eval[..], more].concat()).json()
    };
    let (own, straight) = (eval(&[]), eval(&["--between-slices", "linear"]));
    assert_eq!(db(&own), db(&straight), "at the voxels");
    let between = |result: &serde_json::Value| result["psnr_mean_offset_db"].as_f64().expect("a number");
    assert_ne!(between(&own), between(&straight), "measured on another grid");
    // Pictures of the volume differ, and only one of two words is known.
    for word in ["smooth", "linear"] {
        let png = format!("{word}.png");
        folder.run(&[
            "render",
            "--volume",
            "ct.nii.gz",
            "-o",
            &png,
            "--size",
            "48x48",
            "--between-slices",
            word,
        ]);
    }
    assert_ne!(std::fs::read(folder.path("smooth.png")).ok(), std::fs::read(folder.path("linear.png")).ok());
}

/// A label map in `labels.nii` with its names: the mask, whose left half (up to the middle of the grid) is 5 and whose
/// right half is 200; 7 around a corner.
fn write_labels(folder: &Folder, name: &str) {
    let mask = Volume::read(folder.path("mask.nii.gz"), &ReadOptions::default()).expect("the mask");
    let [nx, ny, nz] = mask.size;
    let value = |i: usize| match mask.samples[i] {
        m if m > 0.5 => [5.0, 200.0][usize::from(2 * (i % nx) >= nx)],
        _ => f32::from(u8::from(i == nx * ny * nz - 1)) * 7.0,
    };
    let map = Volume { samples: (0..mask.len()).map(value).collect(), ..mask.clone() };
    nifti::write(folder.path("plain.nii"), &map, true).expect("a label map");
    // Our writer leaves names out, so the extension is put in by hand: size, code, text, up to a multiple of 16.
    let mut file = folder.read("plain.nii");
    let mut text = format!(
        "<CaretExtension><LabelTable><Label Key=\"5\">{name}</Label><Label Key=\"7\">other</Label></LabelTable>\
         </CaretExtension>"
    )
    .into_bytes();
    text.resize((8 + text.len()).next_multiple_of(16) - 8, 0);
    let size = 8 + text.len();
    let extension = [&(size as i32).to_le_bytes()[..], &[0; 4], &text].concat();
    file[108..112].copy_from_slice(&(352.0 + size as f32).to_le_bytes());
    file[348] = 1;
    file.splice(352..352, extension);
    folder.write("labels.nii", file);
}

#[test]
fn splats_keep_the_labels_of_the_map() {
    let folder = Folder::new(28);
    write_labels(&folder, "left  part");
    let mut arguments = fit("a.ply", &["--no-eval", "--roi-label", "Left  part,200", "--force"]);
    let at = arguments.iter().position(|a| *a == "mask.nii.gz").expect("the mask");
    arguments[at] = "labels.nii";
    for more in [&["--quiet"][..], &["--quiet", "--working-grid", "2"]] {
        let ended = folder.run(&[&arguments[..], more].concat());
        assert_eq!((ended.code, ended.err.as_str()), (0, ""));
        let set = splat::read(folder.path("a.ply"), &splat::ReadOptions::default()).expect("splats");
        assert_eq!(set.label_names, [(5, "left part".to_owned())]);
        let labels = set.labels.as_ref().expect("labels");
        let ct = Volume::read(folder.path("ct.nii.gz"), &ReadOptions::default()).expect("the volume");
        let middle = ct.size[0] as f32 / 2.0 - 0.5;
        let mut halves = [0; 2];
        for (splat, &label) in set.to_voxel(&ct.world_from_voxel).iter().zip(labels) {
            // Some lie a little outside the region, where the nearest voxel may be across the middle.
            if (splat.mean[0] - middle).abs() > 1.0 {
                let half = usize::from(splat.mean[0] > middle);
                assert_eq!(label, [5, 200][half], "{:?}", splat.mean);
                halves[half] += 1;
            }
        }
        assert!(halves.iter().all(|&n| n > 4), "{halves:?}");
        assert!(labels.iter().all(|&label| label > 0), "outside the region it is the nearest label");
        let count = |wanted: u8| labels.iter().filter(|&&label| label == wanted).count();
        let info = folder.run(&["info", "a.ply"]).out;
        let line = format!("5 left part ({}), 200 ({})", count(5), count(200));
        assert!(info.contains(&line), "{line} in {info}");
        let told = folder.run(&["info", "a.ply", "--json"]).json();
        let expected = serde_json::json!([
            {"label": 5, "name": "left part", "splats": count(5)},
            {"label": 200, "name": null, "splats": count(200)},
        ]);
        assert_eq!(told["labels"], expected);
    }
    // A mask without labels gives none.
    assert_eq!(folder.run(&fit("b.ply", &["--no-eval", "--quiet"])).code, 0);
    assert_eq!(folder.run(&["info", "b.ply", "--json"]).json()["labels"], serde_json::json!([]));
}

#[test]
fn harmonics_are_told() {
    let folder = Folder::new(8);
    let rest: String = (0..24).map(|i| format!("property float f_rest_{i}\n")).collect();
    let names = "x y z f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let names: String = names.split(' ').map(|name| format!("property float {name}\n")).collect();
    let row = format!("0 0 0 1 0 0 0 0 0 0 1 0 0 0{}", " 0.5".repeat(24));
    folder.write(
        "sh.ply",
        format!("ply\nformat ascii 1.0\nelement vertex 1\n{names}{rest}end_header\n{row}\n"),
    );
    assert!(folder.run(&["info", "sh.ply"]).out.contains("spherical harmonics of degree 2"));
    assert_eq!(folder.run(&["info", "sh.ply", "--json"]).json()["harmonics_degree"], 2);
}

#[test]
fn one_seed_gives_the_same_bytes_and_force_replaces() {
    let folder = Folder::new(20);
    for output in ["a.ply", "b.ply"] {
        let ended = folder.run(&fit(output, &["--no-eval", "--quiet"]));
        assert_eq!((ended.code, ended.out.as_str(), ended.err.as_str()), (0, "", ""));
    }
    assert_eq!(folder.read("a.ply"), folder.read("b.ply"));
    let before = folder.read("a.run.json");
    assert_eq!(folder.run(&fit("a.ply", &["--no-eval", "--seed", "9", "--force"])).code, 0);
    assert_ne!(folder.read("a.ply"), folder.read("b.ply"));
    assert_ne!(folder.read("a.run.json"), before);
}

#[test]
fn a_flag_wins_over_the_environment_and_that_over_the_file() {
    let folder = Folder::new(12);
    folder.write("c.toml", "iterations = 2\nsplats = 5\nseed = 3\nkernel = \"gaussian\"\n");
    let mut command = folder.command(&["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "a.ply"]);
    command.args(["--config", "c.toml", "--seed", "8", "--no-eval"]);
    command.env("VGS_SEED", "7").env("VGS_SPLATS", "6").env("VGS_HU_RANGE", "-1024,3071");
    let output = command.output().expect("the program starts");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let record: serde_json::Value = serde_json::from_str(&folder.text("a.run.json")).expect("a record");
    let config = &record["config"];
    assert_eq!(
        (&config["iterations"], &config["splats"], &config["seed"], &config["kernel"]),
        (&2.into(), &6.into(), &8.into(), &"gaussian".into())
    );
    assert_eq!(config["hu_range"], serde_json::json!([-1024.0, 3071.0]));
}

#[test]
fn a_constant_volume_is_fitted_exactly() {
    let folder = Folder::new(12);
    // The mask as a volume between thresholds that only its ones meet: a region of one value.
    let more = ["--splats", "20", "--iterations", "4", "--json", "--eval-range", "0,1"];
    // A fit for the grid would see the zeros of the rim as well.
    let base = ["fit", "mask.nii.gz", "--roi-threshold", "1,1", "-o", "a.ply", "--form", "field"];
    let result = folder.run(&[&base[..], &more].concat()).json();
    assert!(result["psnr_db"].is_null(), "{result}");
    assert_eq!((&result["rmse_hu"], &result["p99_hu"]), (&0.0.into(), &0.0.into()));
}

/// A box of bone with walls of 3 mm, a hole of 1 mm through one of them and soft tissue within, among specks of noise: 1 mm
/// voxels.
fn noisy_box() -> Volume {
    let within = |p: [usize; 3], low: usize, high: usize| p.into_iter().all(|c| (low..=high).contains(&c));
    let value = |i: usize| {
        let p = [i % 24, i / 24 % 24, i / (24 * 24)];
        let speck = p.into_iter().all(|c| c % 3 == 0);
        match (within(p, 4, 16), within(p, 7, 13)) {
            (_, true) if speck => 400.0,
            (_, true) => 40.0,
            (true, _) if p[0] == 10 && p[1] == 10 && p[2] < 7 => -1000.0,
            (true, _) => 500.0,
            _ if speck && !within(p, 2, 18) => 400.0,
            _ => -1000.0,
        }
    };
    Volume::new([24; 3], DAffine3::IDENTITY, (0..24 * 24 * 24).map(value).collect())
}

#[test]
fn a_threshold_is_made_clean() {
    let folder = Folder::new(8);
    nifti::write(folder.path("box.nii"), &noisy_box(), false).expect("a volume");
    // 13³ voxels, of which 7³ lie within the walls and 3 in the hole; 8 specks within and 8³ − 6³ around.
    let walls = 13_u64.pow(3) - 7_u64.pow(3) - 3;
    // The ball reaches into the hole by a voxel from either side, and leaves the outer one of these open.
    let whole = 13_u64.pow(3) - 1;
    let region = ["--roi-threshold", "200,3000", "--roi-largest", "--roi-close", "2", "--roi-fill"];
    let ended =
        folder.run(&[&["fit", "box.nii", "-o", "a.ply", "-v", "--json"], &region[..], &QUICK].concat());
    assert_eq!(ended.json()["roi_voxels"], whole, "{}", ended.err);
    for says in [
        format!("from 200 to 3000: {} voxels (2.155 ml)", walls + 304),
        format!("; 1 of 305 connected pieces kept: {walls} voxels (1.851 ml); closed by 2 mm: "),
        format!("; holes filled: {whole} voxels (2.196 ml)"),
    ] {
        assert!(ended.err.contains(&says), "{says} in {}", ended.err);
    }
    let record: serde_json::Value = serde_json::from_str(&folder.text("a.run.json")).expect("a record");
    assert_eq!(record["roi"]["voxels"], whole);
    let command = record["command"].as_array().expect("the command line");
    assert!(region.iter().all(|word| command.contains(&(*word).into())), "{command:?}");

    // Pieces by their volume: a speck has 0.001 ml.
    for (flag, voxels) in
        [("--roi-min-ml=0.002", walls), ("--roi-min-ml=0.001", walls + 304), ("--roi-largest=11", walls + 10)]
    {
        let eval =
            ["eval", "a.ply", "box.nii", "--roi-threshold", "200,3000", flag, "--offsets", "1", "--json"];
        assert_eq!(folder.run(&eval).json()["roi_voxels"], voxels, "{flag}");
    }
    // The same region in the comparison of volumes, and in a picture.
    let compare = [&["compare", "box.nii", "box.nii", "--json"], &region[..]].concat();
    assert_eq!(folder.run(&compare).json()["voxels"], whole);
    let picture = |name: &str, flags: &[&str]| {
        let render = ["render", "box.nii", "-o", name, "--size", "96x96", "--tf", "CT-Bone"];
        let ended = folder.run(&[&render[..], &region[..2], flags].concat());
        assert_eq!(ended.code, 0, "{}", ended.err);
    };
    picture("specks.png", &[]);
    picture("clean.png", &region[2..]);
    let same = folder.run(&["compare", "specks.png", "clean.png", "--json"]).json();
    assert!(same["psnr_db"].as_f64().is_some_and(|db| db < 60.0), "the specks are gone: {same}");
}

/// The phantom's own intensities and the volume of its mask are what the objects of a fit have.
#[test]
fn objects_have_the_volume_and_the_intensities_of_their_labels() {
    let folder = Folder::new(24);
    write_labels(&folder, "left");
    let labels = "--roi labels.nii --roi-label 5,200 -o s.ply --splats 1500 --iterations 60 --no-eval";
    let ended = folder.run(&[&["fit", "ct.nii.gz"][..], &labels.split(' ').collect::<Vec<_>>()].concat());
    assert_eq!(ended.code, 0, "{}", ended.err);
    let told = folder.run(&["stats", "s.ply", "--volume", "ct.nii.gz", "--json"]).json();
    let read =
        |name: &str| engine::volume::Volume::read(folder.path(name), &Default::default()).expect("a volume");
    let (ct, map) = (read("ct.nii.gz"), read("labels.nii"));
    let ml = ct.spacing_mm().element_product() / 1000.0;
    for (object, label) in told["objects"].as_array().expect("objects").iter().zip([5.0, 200.0]) {
        let of_label: Vec<_> = map.samples.iter().zip(&ct.samples).filter(|(l, _)| **l == label).collect();
        let mean = of_label.iter().map(|(_, hu)| f64::from(**hu)).sum::<f64>() / of_label.len() as f64;
        let expected = of_label.len() as f64 * ml;
        let figure = |path: &str| object.pointer(path).and_then(serde_json::Value::as_f64).expect("a figure");
        assert!((figure("/volume_ml") / expected - 1.0).abs() < 0.1, "{object}: {expected} ml");
        assert!((figure("/volume/mean") - mean).abs() < 30.0, "{object}: {mean} HU");
        assert!((figure("/field/mean") - figure("/volume/mean")).abs() < 30.0, "{object}");
    }
    // Without the volume the grid is that of the fit, so the voxels are the same.
    let alone = folder.run(&["stats", "s.ply", "--json"]).json();
    assert_eq!(alone["objects"][0]["voxels"], told["objects"][0]["voxels"]);
    assert!(alone["objects"][0].get("volume").is_none());
    let text = folder.run(&["stats", "s.ply", "--volume", "ct.nii.gz"]).out;
    assert!(text.contains("volume, ml") && text.contains("left"), "{text}");
}

/// A voxel outside of the mask has no share of the voxel beside it, also where two affines of one grid differ by rounding.
#[test]
fn the_occupancy_is_zero_outside_of_the_mask() {
    let folder = Folder::new(20);
    for name in ["ct.nii.gz", "mask.nii.gz"] {
        let mut volume = Volume::read(folder.path(name), &ReadOptions::default()).expect("a volume");
        let (spacing, first) = (DVec3::new(0.703_125, 0.703_125, 1.3), DVec3::new(-123.4, 87.65, -1021.3));
        volume.world_from_voxel = DAffine3::from_mat3_translation(DMat3::from_diagonal(spacing), first);
        nifti::write(folder.path(name), &volume, true).expect("a volume");
    }
    assert_eq!(folder.run(&fit("a.ply", &["--no-eval"])).code, 0);
    let ended =
        folder.run(&["rasterize", "a.ply", "--like", "ct.nii.gz", "-o", "o.nii", "--quantity", "occupancy"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let read =
        |name: &str| Volume::read(folder.path(name), &ReadOptions::default()).expect("a volume").samples;
    let (occupancy, mask) = (read("o.nii"), read("mask.nii.gz"));
    let faint = occupancy.iter().filter(|o| **o > 0.0 && **o < 0.5).count();
    assert_eq!(faint, 0, "{:?}", occupancy.iter().find(|o| **o > 0.0 && **o < 0.5));
    let (inside, marked) =
        (occupancy.iter().filter(|o| **o > 0.0).count(), mask.iter().filter(|m| **m > 0.0).count());
    assert!(inside <= marked && 2 * inside > marked, "{inside} of {marked}");
}

/// A CT whose air was cut off has HU all the same: by its values, by its name, or because the user says so.
#[test]
fn a_ct_without_air_is_told_or_asked_about() {
    let folder = Folder::new(16);
    let mut volume = Volume::read(folder.path("ct.nii.gz"), &ReadOptions::default()).expect("a volume");
    volume.samples.iter_mut().for_each(|v| *v = v.clamp(0.0, 400.0));
    for name in ["scan.nii", "head_ct.nii", "t1w.nii"] {
        nifti::write(folder.path(name), &volume, false).expect("a volume");
    }
    let info = |arguments: &[&str]| folder.run(&[&["info", "--json"], arguments].concat()).json();
    assert_eq!(info(&["scan.nii"])["unit"], "arbitrary");
    assert!(
        info(&["scan.nii"])["unit_doubt"].as_str().is_some_and(|doubt| doubt.contains("nothing is below 0"))
    );
    for (arguments, unit) in [
        (&["head_ct.nii"][..], "hu"),
        (&["t1w.nii"], "arbitrary"),
        (&["scan.nii", "--unit", "hu"], "hu"),
        (&["head_ct.nii", "--unit", "arbitrary"], "arbitrary"),
        (&["ct.nii.gz"], "hu"),
    ] {
        let found = info(arguments);
        assert_eq!((&found["unit"], found.get("unit_doubt")), (&unit.into(), None), "{arguments:?}");
    }
    assert!(info(&["mask.nii.gz"]).get("unit").is_none(), "a mask is no scan");
    let splats = |arguments: &[&str]| {
        let fit = [
            "fit",
            "--roi",
            "mask.nii.gz",
            "-o",
            "a.ply",
            "--force",
            "--quality",
            "preview",
            "--dry-run",
            "--json",
        ];
        folder.run(&[&fit[..], arguments].concat())
    };
    let doubted = splats(&["scan.nii"]);
    assert!(doubted.code == 0 && doubted.err.contains("--unit hu"), "{}", doubted.err);
    for sure in [
        splats(&["scan.nii", "--unit", "hu"]),
        splats(&["head_ct.nii"]),
        splats(&["scan.nii", "--unit", "arbitrary"]),
    ] {
        assert!(sure.code == 0 && !sure.err.contains("--unit"), "{}", sure.err);
    }
    assert_eq!(folder.run(&["info", "scan.nii", "--unit", "luminance"]).code, 2);
}

/// What is probably not meant is told; where nobody can answer it is done all the same.
#[test]
fn a_mask_of_another_scan_and_too_many_splats_are_doubted() {
    let folder = Folder::new(16);
    let mut mask =
        engine::volume::Volume::read(folder.path("mask.nii.gz"), &Default::default()).expect("a mask");
    mask.samples.fill(1.0);
    mask.world_from_voxel.translation.x += 12.0 * mask.spacing_mm().x;
    nifti::write(folder.path("away.nii.gz"), &mask, false).expect("a mask");
    let fit = ["fit", "ct.nii.gz", "--roi", "away.nii.gz", "-o", "d.ply", "--no-eval", "--iterations", "2"];
    let ended = folder.run(&[&fit[..], &["--splats", "6000"]].concat());
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(ended.err.contains("only 25 % of the mask lies within the volume"), "{}", ended.err);
    assert!(ended.err.contains("5.9 for each voxel"), "{}", ended.err);
}

/// The record of a fit tells volumes apart whose headers are alike.
#[test]
fn the_voxels_beside_a_header_are_recorded() {
    let folder = Folder::new(16);
    let ct = engine::volume::Volume::read(folder.path("ct.nii.gz"), &Default::default()).expect("a volume");
    let header = "NDims = 3\nDimSize = 16 16 16\nElementType = MET_FLOAT\nElementByteOrderMSB = False\n\
                  ElementDataFile = ct.raw\n";
    folder.write("ct.mhd", header);
    let hash = |change: f32| {
        let bytes: Vec<u8> = ct.samples.iter().flat_map(|hu| (hu + change).to_le_bytes()).collect();
        let stored = bytes.len() + header.len();
        folder.write("ct.raw", bytes);
        let fit = ["fit", "ct.mhd", "--roi-threshold", "-200,3000", "-o", "r.ply", "--force", "--no-eval"];
        let ended = folder.run(&[&fit[..], &QUICK].concat());
        assert_eq!(ended.code, 0, "{}", ended.err);
        let record: serde_json::Value = serde_json::from_str(&folder.text("r.run.json")).expect("a record");
        assert_eq!(record["inputs"]["volume"]["bytes"], stored);
        record["inputs"]["volume"]["sha256"].clone()
    };
    assert_ne!(hash(0.0), hash(1.0));
}

#[test]
fn a_time_budget_is_kept() {
    let folder = Folder::new(16);
    let ended = folder.run(&[
        "fit",
        "ct.nii.gz",
        "--roi",
        "mask.nii.gz",
        "-o",
        "a.ply",
        "--splats",
        "30",
        "--time-budget",
        "2s",
        "--no-eval",
        "--json",
    ]);
    let result = ended.json();
    let seconds = result["seconds"].as_f64().expect("a number");
    assert!((1.5..6.0).contains(&seconds), "{result}");
    assert!(result["iterations"].as_u64().is_some_and(|n| n > 1), "{result}");
}

#[test]
fn a_time_budget_that_cannot_be_kept_is_told() {
    let folder = Folder::new(16);
    let fit = ["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "a.ply", "--splats", "30", "--no-eval"];
    let ended = folder.run(&[&fit[..], &["--time-budget", "0.1s"]].concat());
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(ended.err.contains("fewer splats take less"), "{}", ended.err);
    assert!(folder.path("a.ply").exists());
}

#[test]
fn devices_are_listed_and_one_of_them_is_usable() {
    let folder = Folder::new(8);
    let list = folder.run(&["devices", "--json"]).json();
    let usable = |d: &serde_json::Value| d["missing"].as_array().is_some_and(Vec::is_empty);
    assert!(list["devices"].as_array().is_some_and(|all| all.iter().any(usable)), "{list}");
    let name = list["devices"][0]["name"].as_str().expect("a name").to_owned();
    assert!(folder.run(&["devices"]).out.contains(&name));
}

#[test]
fn a_closed_stdout_is_no_panic() {
    let folder = Folder::new(8);
    let mut child = folder.start(&["info", "ct.nii.gz", "mask.nii.gz", "ct.nii.gz"]);
    drop(child.stdout.take());
    let ended = crate::support::finish(child);
    assert_eq!((ended.code, ended.err.as_str()), (0, ""));
}

#[test]
fn a_full_stdout_is_an_error() {
    let folder = Folder::new(8);
    let full = std::fs::OpenOptions::new().write(true).open("/dev/full").expect("/dev/full");
    let mut command = folder.command(&["info", "ct.nii.gz"]);
    let output = command.stdout(full).output().expect("the program starts");
    let err = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(74), "{err}");
    assert!(err.contains("writing to standard output failed"), "{err}");
}
