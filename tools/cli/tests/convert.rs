//! `vgs convert`: layouts of the PLY, what another program has dropped, some of the splats, and files for programs
//! that know only colours.

use crate::support::{Folder, fit};
use engine::splat::{self, Form, ReadOptions, Splat, SplatSet};
use glam::DVec3;
use view::model::state::{Object, Plane, ViewState};

/// Returns a PLY of ours as splat-transform writes it: without comments and without a second element.
fn without_comments(file: &[u8]) -> Vec<u8> {
    let end = file.windows(11).position(|w| w == b"end_header\n").expect("a header") + 11;
    let header = std::str::from_utf8(&file[..end]).expect("ASCII");
    let (vertices, _) = header.split_once("element region").expect("a fit to a binary mask has a region");
    let kept: Vec<&str> = vertices.lines().filter(|line| !line.starts_with("comment")).collect();
    let count: usize = kept[2].rsplit(' ').next().expect("a count").parse().expect("a number");
    let floats = kept.iter().filter(|line| line.starts_with("property float")).count();
    [kept.join("\n").as_bytes(), b"\nend_header\n", &file[end..][..count * floats * 4]].concat()
}

#[test]
fn what_a_program_has_dropped_comes_back_from_the_original() {
    let folder = Folder::new(16);
    assert_eq!(folder.run(&fit("ours.ply", &["--no-eval"])).code, 0);
    folder.write("edited.ply", without_comments(&folder.read("ours.ply")));
    let ended = folder.run(&["info", "edited.ply", "--json"]);
    assert!(ended.err.contains("--like ORIGINAL"), "{}", ended.err);
    assert_eq!(ended.json()["kernel"], "gaussian", "no one says which it is");
    let places = |name: &str| folder.run(&["info", name, "--json"]).json()["bounding_box_mm"].clone();
    assert_eq!(places("edited.ply"), places("ours.ply"), "the places do not depend on a comment");

    let ended = folder.run(&["convert", "edited.ply", "--like", "ours.ply", "-o", "back.ply"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(folder.read("back.ply") == folder.read("ours.ply"), "all of it is back");

    let ended = folder.run(&["convert", "ours.ply", "--like", "ours.ply", "-o", "no.ply"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(ended.err.contains("VGS-CLI-129"), "{}", ended.err);
}

#[test]
fn a_ply_is_written_in_any_layout_that_needs_no_volume() {
    let folder = Folder::new(16);
    assert_eq!(folder.run(&fit("ours.ply", &["--no-eval"])).code, 0);
    let ended = folder.run(&["convert", "ours.ply", "-o", "rows.ply", "--ply-layout", "inria"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert_eq!(folder.run(&["info", "rows.ply", "--json"]).json()["layout"], "inria");
    assert_eq!(folder.run(&["convert", "rows.ply", "-o", "again.ply"]).code, 0);
    assert!(folder.read("again.ply") == folder.read("ours.ply"), "there and back it is the same file");

    let ended = folder.run(&["convert", "ours.ply", "-o", "no.ply", "--ply-layout", "reference"]);
    assert_eq!(ended.code, 2, "{}", ended.err);
    assert!(ended.err.contains("vgs fit --ply-layout reference"), "{}", ended.err);
}

#[test]
fn splats_in_formats_of_others_are_told_by_name() {
    let folder = Folder::new(16);
    for (name, start, word) in
        [("a.splat", &b"1234"[..], "a SPLAT file"), ("a.ksplat", b"1234", "a KSPLAT file")]
    {
        folder.write(name, start);
        for command in [&["info", name][..], &["convert", name, "-o", "a.ply"]] {
            let ended = folder.run(command);
            assert_eq!(ended.code, 65, "{}", ended.err);
            assert!(ended.err.contains(word) && ended.err.contains("splat-transform"), "{}", ended.err);
        }
    }
}

fn set(folder: &Folder, name: &str) -> SplatSet {
    splat::read(folder.path(name), &ReadOptions::default()).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// A fit whose splats above the middle are a liver, and the others a spleen of the label 7.
fn labelled(folder: &Folder) -> SplatSet {
    assert_eq!(folder.run(&fit("plain.ply", &["--no-eval"])).code, 0);
    let mut labelled = set(folder, "plain.ply");
    let middle = {
        let mut heights: Vec<f32> = labelled.splats.iter().map(|splat| splat.mean[2]).collect();
        heights.sort_by(f32::total_cmp);
        heights[heights.len() / 2]
    };
    labelled.labels =
        Some(labelled.splats.iter().map(|splat| if splat.mean[2] >= middle { 2 } else { 7 }).collect());
    labelled.label_names = vec![(2, "liver".to_owned()), (7, "spleen".to_owned())];
    labelled.label_region();
    splat::write(&folder.path("ours.ply"), &labelled, false).expect("a file");
    labelled
}

#[test]
fn splats_are_selected_by_object_and_by_box() {
    let folder = Folder::new(16);
    let ours = labelled(&folder);
    let count = ours.splats.len();
    let with = |label: u8| ours.labels.iter().flatten().filter(|&&own| own == label).count();
    for (flags, wanted) in [
        (&["--object", "Liver"][..], with(2)),
        (&["--object", "7"], with(7)),
        (&["--object", "liver", "--object", "spleen"], count),
    ] {
        let arguments = [&["convert", "ours.ply", "-o", "part.ply", "--force", "--json"], flags].concat();
        let told = folder.run(&arguments).json();
        assert_eq!((&told["splats"], &told["left_out"]), (&wanted.into(), &(count - wanted).into()));
        let part = set(&folder, "part.ply");
        assert_eq!((part.splats.len(), part.grid, part.form), (wanted, ours.grid, ours.form));
        assert_eq!(part.labels.map(|labels| labels.len()), Some(wanted));
    }
    // All of it is the whole again.
    assert_eq!(set(&folder, "part.ply").region, ours.region);

    let place = |i: usize| ours.splats[i].mean.map(f64::from);
    let [x, y, z] = place(0);
    let corners = format!("--box={},{},{},{},{},{}", x - 4.0, y - 4.0, z - 4.0, x + 4.0, y + 4.0, z + 4.0);
    let inside = (0..count).filter(|&i| (0..3).all(|k| (place(i)[k] - [x, y, z][k]).abs() <= 4.0)).count();
    assert!(inside < count, "some are outside");
    let told = folder.run(&["convert", "ours.ply", &corners, "-o", "box.vgs", "--json"]).json();
    assert_eq!(told["splats"], inside);
    assert_eq!(set(&folder, "box.vgs").splats.len(), inside);
    let outside = corners.replace("--box", "--outside-box");
    let told = folder.run(&["convert", "ours.ply", &outside, "-o", "rest.ply", "--json"]).json();
    assert_eq!(told["splats"], count - inside);
    assert_eq!(folder.run(&["stats", "box.vgs"]).code, 0, "a part is a set like any other");

    for (flags, code, exit, word) in [
        (&["--object", "kidney"][..], "VGS-SPLAT-010", 2, "liver (2), spleen (7)"),
        (&["--box", "900,900,900,901,901,901"], "VGS-CLI-131", 3, "mm RAS"),
        (&["--box", "1,2,3"], "", 2, "X0,Y0,Z0,X1,Y1,Z1"),
        (&["--object", "liver", "--volume", "ct.nii.gz", "--roi", "mask.nii.gz"], "", 2, "--volume"),
    ] {
        let ended = folder.run(&[&["convert", "ours.ply", "-o", "no.ply"], flags].concat());
        assert_eq!(ended.code, exit, "{}", ended.err);
        assert!(ended.err.contains(code) && ended.err.contains(word), "{}", ended.err);
    }
    assert!(!folder.path("no.ply").exists());
}

#[test]
fn programs_that_know_only_colours_get_those_of_a_transfer_function() {
    let folder = Folder::new(16);
    let ours = labelled(&folder);
    let ended = folder.run(&["convert", "ours.ply", "-o", "a.spz"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    for word in ["those of each object", "without HU, kernel, grid and labels"] {
        assert!(ended.err.contains(word), "{word}: {}", ended.err);
    }
    assert!(folder.read("a.spz").starts_with(b"\x1f\x8b") && folder.path("a.spz").is_file());
    let packed = set(&folder, "a.spz");
    assert!(packed.colours.is_some() && !packed.splats.is_empty(), "it is read again");

    assert_eq!(folder.run(&["convert", "ours.ply", "-o", "a.sog"]).code, 0);
    let info = folder.run(&["info", "a.sog", "--json"]).json();
    assert_eq!(
        (info["format"].as_str(), info["harmonics_degree"].as_u64()),
        (Some("sog"), Some(2)),
        "{info}"
    );
    assert_eq!(set(&folder, "a.sog").splats.len(), packed.splats.len());

    let told = folder.run(&["convert", "ours.ply", "-o", "a.glb", "--tf", "ct-bones-steep", "--json"]).json();
    assert_eq!(told["transfer_function"], "CT-Bones-Steep");
    let shown = ours.splats.len() as u64 - told["hidden"].as_u64().expect("a number");
    assert_eq!(told["splats"], shown);
    let file = folder.read("a.glb");
    assert!(file.starts_with(b"glTF\x02\0\0\0"));
    let json = u32::from_le_bytes(file[12..16].try_into().expect("four bytes")) as usize;
    let document: serde_json::Value = serde_json::from_slice(&file[20..20 + json]).expect("JSON");
    assert_eq!(document["accessors"][0]["count"], shown);
    // From it they come back with their intensities and labels, and nothing but floats is rounded.
    let ended = folder.run(&["convert", "a.glb", "-o", "back.ply"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let back = set(&folder, "back.ply");
    assert_eq!((back.field, back.unit, back.grid, back.form), (ours.field, ours.unit, ours.grid, ours.form));
    assert_eq!((back.splats.len() as u64, &back.label_names), (shown, &ours.label_names));
    let found = back.splats.iter().all(|splat| {
        ours.splats.iter().any(|own| {
            let near = |a: [f32; 3], b: [f32; 3]| (0..3).all(|k| (a[k] - b[k]).abs() < 1e-4);
            (own.intensity, own.opacity_logit) == (splat.intensity, splat.opacity_logit)
                && near(own.mean, splat.mean)
                && near(own.log_scale, splat.log_scale)
        })
    });
    assert!(found, "each is one of them");
    assert_eq!(folder.run(&["stats", "a.glb"]).code, 0, "a set like any other");

    // A PLY of colours is what an ordinary viewer needs; its labels stay, and nothing else acts on it.
    let ended = folder.run(&["convert", "ours.ply", "-o", "a.ply", "--tf", "CT-Bone"]);
    assert_eq!(ended.code, 0, "{}", ended.err);
    let colours = set(&folder, "a.ply");
    assert!(!colours.unit.is_physical() && colours.labels.is_some());
    assert_eq!(colours.colours.as_ref().map(|colours| colours.degree), Some(2), "with the light");
    assert_eq!(folder.run(&["convert", "a.ply", "-o", "b.spz"]).code, 0, "colours stay as they are");

    for (arguments, code, exit, word) in [
        (&["convert", "a.ply", "-o", "no.glb", "--tf", "CT-Bone"][..], "VGS-RENDER-028", 2, "--tf"),
        (&["convert", "ours.ply", "-o", "no.glb", "--tf", "CT-Lung"], "VGS-CLI-132", 3, "another --tf"),
        (&["convert", "ours.ply", "-o", "no.glb", "--tf", "CT-Bon"], "VGS-TF-006", 2, "CT-Bone"),
        (&["convert", "ours.ply", "-o", "no.vgs", "--tf", "CT-Bone"], "VGS-FILE-001", 2, ".ply"),
        (&["convert", "ours.ply", "-o", "no.nii.gz"], "VGS-CLI-130", 2, "vgs rasterize ours.ply"),
        (&["convert", "ours.ply", "-o", "no.splat"], "VGS-SPLAT-002", 2, "ply, vgs, spz, sog, glb"),
        (&["convert", "a.spz", "-o", "no.spz", "--object", "liver:hiden"], "", 2, "NAME:hidden"),
        (&fit("no.spz", &["--no-eval"]), "VGS-CLI-133", 2, "vgs convert SPLATS -o OUT.spz"),
    ] {
        let ended = folder.run(arguments);
        assert_eq!(ended.code, exit, "{arguments:?}: {}", ended.err);
        assert!(ended.err.contains(code) && ended.err.contains(word), "{arguments:?}: {}", ended.err);
    }
    assert!(["no.glb", "no.vgs", "no.nii.gz"].iter().all(|name| !folder.path(name).exists()));
}

#[test]
fn a_function_is_chosen_that_shows_the_splats() {
    let folder = Folder::new(16);
    let mut ours = labelled(&folder);
    let labels = ours.labels.clone().expect("labels");
    for (splat, &label) in ours.splats.iter_mut().zip(&labels) {
        splat.intensity = if label == 2 { 60.0 } else { 900.0 };
    }
    splat::write(&folder.path("ours.ply"), &ours, true).expect("a file");
    let liver = labels.iter().filter(|&&label| label == 2).count() as u64;
    let convert = |flags: &[&str]| {
        folder.run(&[&["convert", "ours.ply", "-o", "a.glb", "--force", "--object", "liver"], flags].concat())
    };
    let told = convert(&["--json"]).json();
    assert_eq!(told["transfer_function"], "CT-Soft-Tissue");
    let [shown, hidden] = ["splats", "hidden"].map(|key| told[key].as_u64().expect("a number"));
    assert!(shown + hidden == liver && shown > hidden, "{shown} of {liver}");

    // A function that was asked for is taken, and what it hides is said.
    let ended = convert(&["--tf", "CT-Bone"]);
    let none = ended.code == 3 && ended.err.contains("VGS-CLI-132");
    assert!(none || ended.err.contains("CT-Bone shows nothing of"), "{}", ended.err);
    let told = folder.run(&["convert", "ours.ply", "-o", "b.glb", "--object", "spleen", "--json"]).json();
    assert_eq!(told["transfer_function"], "CT-Bone", "which shows the other");
}

/// Returns the mean of the colours of a file, from the front.
fn mean_colour(folder: &Folder, name: &str) -> [f64; 3] {
    let set = set(folder, name);
    let colours = set.colours.as_ref().expect("colours");
    let mut sum = [0.0; 3];
    for i in 0..set.splats.len() {
        let own = colours.colour(i, [0.0, 1.0, 0.0]);
        sum = [0, 1, 2].map(|c| sum[c] + own[c] / set.splats.len() as f64);
    }
    sum
}

#[test]
fn objects_have_the_colours_that_flags_and_sessions_give_them() {
    let folder = Folder::new(16);
    let ours = labelled(&folder);
    let count = |label: u8| ours.labels.iter().flatten().filter(|&&own| own == label).count();
    let convert = |flags: &[&str]| {
        let ended = folder.run(&[&["convert"], flags, &["--force", "--json"]].concat());
        assert_eq!(ended.code, 0, "{}", ended.err);
        ended.json()
    };
    let number = |told: &serde_json::Value, key: &str| told[key].as_u64().expect("a number") as usize;
    convert(&[
        "ours.ply",
        "-o",
        "red.spz",
        "--object",
        "liver:colour=#ff0000",
        "--object",
        "7:colour=#ff0000",
    ]);
    let [r, g, b] = mean_colour(&folder, "red.spz");
    assert!(r > 2.0 * g && r > 2.0 * b, "{r} {g} {b}");
    let told = convert(&["ours.ply", "-o", "one.glb", "--object", "liver:hidden", "--object-colours"]);
    assert_eq!(number(&told, "left_out"), count(2));
    assert_eq!(set(&folder, "one.glb").label_names, [(7, "spleen".to_owned())], "the other");
    let faint = convert(&["ours.ply", "-o", "faint.spz", "--object", "spleen:opacity=0", "--tf", "CT-Bone"]);
    assert!(number(&faint, "hidden") >= count(7), "{faint}");

    // The same from a session: the spleen is hidden, the liver green, and what is to the right is cut away.
    let function = engine::transfer::load("CT-Bone", [-1000.0, 3000.0]).expect("a preset");
    let mut state = ViewState::new(&function);
    state.files.splats = vec![folder.path("ours.ply")];
    let row = |label, name: &str| Object::new(0, Some(label), name);
    state.objects = vec![
        Object { tint: Some(DVec3::Y), ..row(2, "liver") },
        Object { visible: false, ..row(7, "spleen") },
    ];
    let middle = {
        let mut places: Vec<f64> =
            ours.splats.iter().map(|s| f64::from(s.mean[0]) + ours.origin_mm.x).collect();
        places.sort_by(f64::total_cmp);
        places[places.len() / 2]
    };
    state.clip.planes.push(Plane { on: true, normal: DVec3::NEG_X, offset_mm: -middle });
    state.write(folder.path("s.toml"), false).expect("a session");
    let kept = (0..ours.splats.len()).filter(|&i| {
        let x = f64::from(ours.splats[i].mean[0]) + ours.origin_mm.x;
        ours.labels.as_ref().expect("labels")[i] == 2 && x <= middle
    });
    let kept = kept.count();
    let told = convert(&["s.toml", "-o", "scene.ply"]);
    assert_eq!((number(&told, "splats"), number(&told, "left_out")), (kept, ours.splats.len() - kept));
    let told = convert(&["s.toml", "-o", "scene.glb"]);
    assert_eq!(number(&told, "splats") + number(&told, "hidden"), kept);
    let scene = set(&folder, "scene.glb");
    assert!(scene.unit.is_physical() && scene.label_names == [(2, "liver".to_owned())]);
    convert(&["s.toml", "-o", "scene.spz"]);
    let [r, g, b] = mean_colour(&folder, "scene.spz");
    assert!(g > 2.0 * r && g > 2.0 * b, "{r} {g} {b}");
    let ended = folder.run(&["convert", "s.toml", "-o", "no.ply", "--like", "ours.ply"]);
    assert!(ended.code == 2 && ended.err.contains("VGS-CLI-134"), "{}", ended.err);
    let ended = folder.run(&["convert", "ours.ply", "-o", "no.ply", "--clip", "x<1e6"]);
    assert!(ended.code == 3 && ended.err.contains("VGS-CLI-136"), "{}", ended.err);
}

#[test]
fn a_splat_far_from_all_others_is_told_and_not_framed() {
    let folder = Folder::new(16);
    assert_eq!(folder.run(&fit("near.ply", &["--no-eval"])).code, 0);
    let mut far = set(&folder, "near.ply");
    let splat = Splat { mean: [2e4, 0.0, 0.0], ..far.splats[0] };
    far.splats.push(splat);
    (far.grid, far.form, far.region) = (None, Form::Field, None);
    let near = SplatSet { splats: far.splats[..far.splats.len() - 1].to_vec(), ..far.clone() };
    splat::write(&folder.path("near.ply"), &near, true).expect("a file");
    splat::write(&folder.path("far.ply"), &far, true).expect("a file");
    let picture = |name: &str| {
        let ended = folder.run(&["render", name, "-o", "a.png", "--size", "48x48", "--force"]);
        assert_eq!(ended.code, 0, "{}", ended.err);
        let image = engine::image::read(folder.path("a.png")).expect("a picture").image;
        (ended.err, image.pixels.iter().filter(|pixel| pixel[..3].iter().any(|c| *c > 0.1)).count())
    };
    let ((quiet, wanted), (told, seen)) = (picture("near.ply"), picture("far.ply"));
    assert!(!quiet.contains("far from all others") && told.contains("1 of "), "{told}");
    assert!(told.contains("lie far from all others"), "{told}");
    assert!(wanted > 50 && seen as f64 > 0.9 * wanted as f64, "{seen} of {wanted} pixels");
}
