//! `vgs render` on a phantom and a quick fit of it.

use crate::support::{Folder, fit};
use engine::image::{Picture, psnr, read};
use engine::volume::{ReadOptions, Volume, nifti};

/// A folder with splats of a phantom that every mode can show.
fn folder() -> Folder {
    let folder = Folder::new(40);
    let more = ["--no-eval", "--profile", "field", "--iterations", "24", "--splats", "800", "--offsets", "4"];
    let ended = folder.run(&fit("s.ply", &more));
    assert_eq!(ended.code, 0, "{}", ended.err);
    folder
}

fn picture(folder: &Folder, name: &str) -> Picture {
    read(folder.path(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Pixels in which something is to be seen, over black.
fn seen(picture: &Picture) -> usize {
    picture.image.pixels.iter().filter(|p| p[0] + p[1] + p[2] > 0.05).count()
}

#[test]
fn a_picture_of_splats_is_like_that_of_their_volume() {
    let folder = folder();
    let shared = ["--tf", "CT-Bones-Steep", "--size", "96x80", "--camera", "anterior-left", "--shade", "off"];
    fn of<'a>(more: &[&'a str], shared: &[&'a str]) -> Vec<&'a str> {
        [&["render"], more, shared].concat()
    }
    let usual = folder.run(&of(&["s.ply", "-o", "usual.png", "--json"], &shared)).json();
    assert_eq!(usual["mode"], "decoded");
    let usual = picture(&folder, "usual.png").image;
    for (memory, least, most) in [("1G", f64::INFINITY, f64::INFINITY), ("400k", 18.0, 60.0)] {
        let ended = folder.run(&of(&["s.ply", "-o", "m.png", "--force", "--field-memory", memory], &shared));
        assert_eq!(ended.code, 0, "{}", ended.err);
        let db = psnr(&usual, &picture(&folder, "m.png").image).expect("pictures of one size");
        println!("--field-memory {memory}: {db:.1} dB");
        assert!((least..=most).contains(&db), "{memory}: {db} dB");
    }
    let json = folder.run(&of(&["s.ply", "-o", "slab.png", "--mode", "slab", "--json"], &shared)).json();
    assert_eq!(json["mode"], "slab");
    assert_eq!((json["size"].clone(), json["frames"].as_u64()), (serde_json::json!([96, 80]), Some(1)));
    assert!(
        json["active_splats"].as_u64() <= json["splats"].as_u64()
            && json["seconds_per_frame"].as_f64() > Some(0.0)
    );
    let slab = picture(&folder, "slab.png");
    assert_eq!(slab.image.size, [96, 80]);
    assert!((300..7000).contains(&seen(&slab)), "{}", seen(&slab));

    let packed = ["--mode", "slab", "--precision", "packed"];
    for (name, more) in [("exact", &["--mode", "exact"][..]), ("packed", &packed)] {
        let output = format!("{name}.png");
        let ended = folder.run(&of(&[&["s.ply", "-o", &output], more].concat(), &shared));
        assert_eq!(ended.code, 0, "{}", ended.err);
        let db = psnr(&slab.image, &picture(&folder, &output).image).expect("pictures of one size");
        println!("{name}: {db:.1} dB");
        assert!(db > 30.0, "{name}: {db}");
    }
}

#[test]
fn outputs_are_what_was_asked_for() {
    let folder = folder();
    let run = |more: &[&str]| {
        let ended =
            folder.run(&[&["render", "s.ply", "--size", "120x100", "--tf", "CT-Soft-Tissue"], more].concat());
        assert_eq!(ended.code, 0, "{more:?}: {}", ended.err);
        ended
    };
    // Floats and depth: what is seen is as far away as the camera, give or take the scene.
    run(&["-o", "a.exr", "--background", "transparent"]);
    let exr = picture(&folder, "a.exr");
    let depth = exr.depth.expect("EXR has depth");
    let near: Vec<f32> = depth.iter().copied().filter(|d| d.is_finite()).collect();
    assert!(near.len() > 500 && near.iter().all(|d| (10.0..500.0).contains(d)), "{} pixels", near.len());
    assert!(exr.image.pixels.iter().any(|p| p[3] == 0.0) && exr.image.pixels.iter().any(|p| p[3] > 0.5));

    run(&["-o", "white.png", "--background", "white"]);
    assert_eq!(picture(&folder, "white.png").image.at(0, 0), [1.0; 4]);
    // Letters and a bar are white on black, at the borders and below.
    run(&["-o", "plain.png"]);
    run(&["-o", "told.png", "--orientation", "--scale-bar"]);
    let (plain, told) = (picture(&folder, "plain.png"), picture(&folder, "told.png"));
    let changed = plain.image.pixels.iter().zip(&told.image.pixels).filter(|(a, b)| a != b).count();
    assert!((20..3000).contains(&changed), "{changed} pixels");
    // Half of it is cut away.
    run(&["-o", "cut.png", "--clip", "x<0"]);
    assert!(seen(&picture(&folder, "cut.png")) < seen(&plain));

    run(&["-o", "turn.png", "--turntable", "4"]);
    let bytes = folder.read("turn.png");
    assert!(bytes.windows(4).any(|w| w == b"acTL"), "an animated PNG");
    run(&["-o", "frame.png", "--turntable", "3", "--sequence"]);
    let frames: Vec<Picture> = (0..3).map(|i| picture(&folder, &format!("frame-00{i}.png"))).collect();
    assert!(frames[0].image == plain.image && frames[1].image != frames[0].image);
    folder.write("cam.json", r#"{"eye_mm": [0, 400, 0], "target_mm": [0, 0, 0], "fov_deg": 20}"#);
    run(&["-o", "cam.png", "--camera", "cam.json"]);
}

/// What a PNG says of its size in print: pixels per metre.
fn pixels_per_metre(folder: &Folder, name: &str) -> Option<u32> {
    let bytes = folder.read(name);
    let at = bytes.windows(4).position(|w| w == b"pHYs")? + 4;
    assert_eq!((&bytes[at..at + 4], bytes[at + 8]), (&bytes[at + 4..at + 8], 1), "both ways, per metre");
    Some(u32::from_be_bytes(bytes[at..at + 4].try_into().expect("four bytes")))
}

#[test]
fn pictures_for_print_have_a_size_a_background_and_legible_letters() {
    let folder = folder();
    let run = |output: &str, more: &[&str]| {
        let shared = ["render", "s.ply", "--tf", "CT-Bone", "-o", output];
        let ended = folder.run(&[&shared, more].concat());
        assert_eq!(ended.code, 0, "{more:?}: {}", ended.err);
        picture(&folder, output).image
    };
    let told = ["--orientation", "--scale-bar", "--colour-bar"];
    let plain = run("plain.png", &["--size", "200x150"]);
    assert_eq!((plain.size, pixels_per_metre(&folder, "plain.png")), ([200, 150], None));
    let printed = run("printed.png", &["--size", "17x12.7mm"]);
    assert_eq!((printed.size, pixels_per_metre(&folder, "printed.png")), ([201, 150], Some(11811)));
    let fine = run("fine.png", &["--size", "0.5x0.25in", "--dpi", "600"]);
    assert_eq!((fine.size, pixels_per_metre(&folder, "fine.png")), ([300, 150], Some(23622)));
    // Letters are dark on white, and bright on black; what is transparent ends on paper.
    for (background, ink) in [("white", 0.0), ("black", 1.0), ("transparent", 0.0), ("#202060", 1.0)] {
        let size = ["--size", "400x300", "--background", background];
        let name = background.trim_start_matches('#');
        let plain = run(&format!("{name}.png"), &size);
        let with = run(&format!("{name}-told.png"), &[&size[..], &told].concat());
        let written: Vec<_> =
            plain.pixels.iter().zip(&with.pixels).filter(|(a, b)| a != b).map(|(_, b)| b).collect();
        let inked = written.iter().filter(|p| p[3] == 1.0 && p[..3].iter().all(|v| *v == ink)).count();
        assert!(inked > 200, "{background}: {inked} of {} pixels", written.len());
        assert_eq!(with.at(0, 0)[3] == 0.0, background == "transparent");
        // Smooth: between letters and what is around them there is something.
        let smooth = written.iter().filter(|p| p[0] > 0.2 && p[0] < 0.8).count();
        assert!(smooth > 100, "{background}: {smooth} pixels between");
    }
    for (more, told) in [
        (["--size", "3m"], "85x60mm"),
        (["--dpi", "0"], "1 to 10000"),
        (["--size", "5000x10mm"], "VGS-CLI-140"),
    ] {
        let ended = folder.run(&[&["render", "s.ply", "-o", "no.png"], &more[..]].concat());
        assert!(ended.code == 2 && ended.err.contains(told), "{more:?}: {}", ended.err);
    }
    let ended = folder.run(&["render", "s.ply", "-o", "no.exr", "--dpi", "300"]);
    assert!(ended.code == 2 && ended.err.contains("VGS-CLI-141"), "{}", ended.err);
}

#[test]
fn occlusion_darkens_where_a_mode_shows_it() {
    let folder = folder();
    let run = |output: &str, more: &[&str]| {
        let shared = ["render", "s.ply", "--tf", "CT-Bone", "--size", "64x64", "-o", output];
        folder.run(&[&shared, more].concat())
    };
    let sum = |name: &str| picture(&folder, name).image.pixels.iter().map(|p| p[0]).sum::<f32>();
    for (output, more) in [("off.png", ["--occlusion", "0"]), ("on.png", ["--occlusion", "1"])] {
        let ended = run(output, &[&["--mode", "decoded"], more.as_slice()].concat());
        assert!(ended.code == 0 && !ended.err.contains("occlusion"), "{}", ended.err);
    }
    assert!(sum("on.png") < sum("off.png"));
    for (output, more, word) in [
        ("slab.png", ["--mode", "slab"].as_slice(), "mode slab shows no ambient occlusion"),
        ("dark.png", &["--mode", "decoded", "--shade", "off"], "--shade on"),
    ] {
        let ended = run(output, &[&["--occlusion", "0.5"], more].concat());
        assert!(ended.code == 0 && ended.err.contains(word), "{output}: {}", ended.err);
    }
    let ended = run("none.png", &["--occlusion", "1.5"]);
    assert!(ended.code == 2 && ended.err.contains("from 0 to 1"), "{}", ended.err);
}

/// The light is where a flag puts it, and its flags are refused where they mean nothing.
#[test]
fn the_light_is_where_it_is_asked_for() {
    let folder = folder();
    let run = |output: &str, more: &[&str]| {
        let shared = ["render", "s.ply", "--tf", "CT-Bone", "--size", "64x64", "-o", output];
        folder.run(&[&shared, more].concat())
    };
    let rows: [(&str, &[&str]); 5] = [
        ("first.png", &[]),
        ("same.png", &["--light-direction", "-21.80140949,24.90488396"]),
        ("head.png", &["--headlight"]),
        ("patient.png", &["--light-direction", "anterior"]),
        ("fill.png", &["--fill-light", "0.5", "--ambient", "0.1"]),
    ];
    for (output, more) in rows {
        let ended = run(output, more);
        assert!(ended.code == 0 && !ended.err.contains("--shade on"), "{output}: {}", ended.err);
    }
    let apart =
        |a: &str, b: &str| psnr(&picture(&folder, a).image, &picture(&folder, b).image).expect("one size");
    assert!(apart("first.png", "same.png") > 60.0, "the angles of the first light");
    // Seen from the front, a light in front of the patient is that of the viewer.
    assert!(apart("head.png", "patient.png") > 60.0);
    for other in ["head.png", "fill.png"] {
        assert!(apart("first.png", other) < 45.0, "{other}");
    }
    let ended = run("unlit.png", &["--headlight", "--shade", "off"]);
    assert!(ended.code == 0 && ended.err.contains("--shade on"), "{}", ended.err);
    for (wrong, word) in [
        (["--light-direction", "sideways"], "sideways"),
        (["--light-direction", "200,0"], "180"),
        (["--fill-light", "0.7"], "0.5"),
        (["--shininess", "2000"], "1000"),
    ] {
        let ended = run("none.png", &wrong);
        assert!(ended.code == 2 && ended.err.contains(word), "{wrong:?}: {}", ended.err);
    }
}

/// Surfaces have the colours of their error, whose figures are those of `vgs eval`.
#[test]
fn an_error_is_seen_as_it_is_measured() {
    let folder = folder();
    let error = ["render", "s.ply", "--error", "--size", "64x64"];
    let of = ["--volume", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "error.png", "--json"];
    let rendered = folder.run(&[&error[..], &of].concat());
    assert_eq!(rendered.code, 0, "{}", rendered.err);
    let (json, evaluated) = (
        rendered.json(),
        folder.run(&["eval", "s.ply", "ct.nii.gz", "--roi", "mask.nii.gz", "--json"]).json(),
    );
    let [found, wanted] =
        [&json["error"]["p99_hu"], &evaluated["p99_hu"]].map(|v| v.as_f64().expect("a number"));
    assert!((found - wanted).abs() < 1e-6 * wanted, "{found} {wanted}");
    let range = json["error"]["range_hu"].as_f64().expect("a number");
    assert!(json["mode"] == "decoded" && range >= found && range <= 2.5 * found, "{range} for {found}");
    // Blue and red are seen, and neither in the picture without them.
    let colourful = |name: &str| {
        let pixels = picture(&folder, name).image.pixels;
        [
            pixels.iter().filter(|p| p[2] > 1.3 * p[0]).count(),
            pixels.iter().filter(|p| p[0] > 1.3 * p[1]).count(),
        ]
    };
    let [blue, red] = colourful("error.png");
    assert!(blue > 10 && red > 10, "{blue} {red}");
    for (more, code) in [
        (&["-o", "none.png"][..], "VGS-CLI-155"),
        (&["--volume", "ct.nii.gz", "--mode", "slab", "-o", "none.png"], "VGS-CLI-156"),
    ] {
        let ended = folder.run(&[&error[..], more].concat());
        assert!(ended.code == 2 && ended.err.contains(code), "{more:?}: {}", ended.err);
    }
}

/// Of what is everywhere the same nothing is left, and of what has an edge the edge.
#[test]
fn gradient_opacity_leaves_edges() {
    let folder = folder();
    let run = |output: &str, more: &[&str]| {
        let shared =
            ["render", "s.ply", "--tf", "CT-Bone", "--size", "64x64", "--background", "none", "-o", output];
        folder.run(&[&shared, more].concat())
    };
    let sum = |name: &str| picture(&folder, name).image.pixels.iter().map(|p| p[3]).sum::<f32>();
    let opacity = |value: &str| {
        let ended = run("out.png", &["--mode", "decoded", "--force", "--gradient-opacity", value]);
        assert!(ended.code == 0 && !ended.err.contains("gradient"), "{}", ended.err);
        sum("out.png")
    };
    let [whole, all, some, none] = ["none", "0,0", "50,400", "1e6,1e6"].map(opacity);
    assert!(whole == all && some < whole && some > 0.0 && none == 0.0, "{whole} {all} {some} {none}");
    // A file with such opacities, drawn where a mode can.
    folder.write("steep.vp", "1\n0\n\n\n\n\n4 0 0 3000 1\n4 1e6 0 2e6 1\n8 0 1 1 1 3000 1 1 1\n");
    for (mode, warns) in [("decoded", false), ("slab", true)] {
        let told =
            ["render", "s.ply", "--tf", "steep.vp", "--size", "64x64", "--background", "none", "--force"];
        let ended = folder.run(&[&told[..], &["-o", "steep.png", "--mode", mode]].concat());
        assert!(ended.code == 0, "{}", ended.err);
        assert_eq!(ended.err.contains("mode slab shows no gradient opacity"), warns, "{}", ended.err);
        assert_eq!(sum("steep.png") > 0.0, warns, "{mode}");
    }
    for value in ["80,20", "-5,10", "7", "nan,nan"] {
        let ended = run("bad.png", &[&format!("--gradient-opacity={value}")]);
        assert!(ended.code == 2 && ended.err.contains("two gradients"), "{value}: {}", ended.err);
    }
}

/// What has no HU is shown by a function over the range of the data, as a volume and as splats.
#[test]
fn what_has_no_hu_has_another_first_function() {
    let folder = Folder::new(24);
    let ct = Volume::read(folder.path("ct.nii.gz"), &ReadOptions::default()).expect("a volume");
    let samples = ct.samples.iter().map(|v| (v + 1024.0) * 0.1).collect();
    let mr = Volume::new(ct.size, ct.world_from_voxel, samples);
    nifti::write(folder.path("mr.nii.gz"), &mr, false).expect("written");
    let fitted =
        ["fit", "mr.nii.gz", "--roi", "mask.nii.gz", "--no-eval", "--iterations", "4", "--splats", "200"];
    for output in ["mr.ply", "small.vgs"] {
        let ended = folder.run(&[&fitted[..], &["-o", output]].concat());
        assert_eq!(ended.code, 0, "{}", ended.err);
        assert_eq!(folder.run(&["info", output, "--json"]).json()["unit"], "arbitrary", "{output}");
    }
    assert!(folder.run(&["info", "mr.ply"]).out.contains("without a unit"));
    for source in [&["mr.ply"][..], &["--volume", "mr.nii.gz"]] {
        let render = |output: &str, more: &[&str]| {
            let ended = folder
                .run(&[&["render"], source, &["--size", "48x48", "--force", "-o", output], more].concat());
            assert_eq!(ended.code, 0, "{}", ended.err);
            picture(&folder, output).image
        };
        let [first, mr, ct] =
            [&[][..], &["--tf", "MR-Default"], &["--tf", "CT-Bone"]].map(|tf| render("p.png", tf));
        assert!(first == mr && first != ct, "{source:?}");
    }
    // Those of a CT say so, too.
    let ended = folder.run(&fit("s.ply", &["--no-eval", "--iterations", "4", "--splats", "200"]));
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert_eq!(folder.run(&["info", "s.ply", "--json"]).json()["unit"], "hu");
}

#[test]
fn files_are_objects_of_one_picture() {
    let folder = folder();
    std::fs::copy(folder.path("s.ply"), folder.path("t.ply")).expect("a second file");
    let shared = ["--tf", "CT-Bones-Steep", "--size", "64x64", "--shade", "off", "--json"];
    let run = |more: &[&str]| folder.run(&[&["render"], more, shared.as_slice()].concat()).json();
    let alone = run(&["s.ply", "-o", "alone.png"]);
    let count = alone["splats"].as_u64().expect("a count");
    let object = serde_json::json!([{
        "number": 1, "name": "s", "splats": count, "transfer_function": "CT-Bones-Steep", "colour": null
    }]);
    assert_eq!(alone["objects"], object);

    let both = run(&["s.ply", "t.ply", "-o", "both.png"]);
    assert_eq!(both["splats"].as_u64(), Some(2 * count));
    let objects = [1, 2].map(|number| ["s", "t"][number - 1]).map(|name| (name, count));
    for (object, (name, splats)) in both["objects"].as_array().expect("objects").iter().zip(objects) {
        assert_eq!((object["name"].as_str(), object["splats"].as_u64()), (Some(name), Some(splats)));
    }
    // Without the second one the first is as it was alone, where splats are added up anew.
    run(&["s.ply", "-o", "alone.png", "--mode", "slab", "--force"]);
    for (output, more) in [("o.png", ["--object", "t:hidden"]), ("h.png", ["--hide-label", "2"])] {
        run(&[&["s.ply", "t.ply", "-o", output, "--mode", "slab"], more.as_slice()].concat());
        let (a, b) = (picture(&folder, "alone.png"), picture(&folder, output));
        let db = psnr(&a.image, &b.image).expect("pictures of one size");
        assert!(db > 50.0, "{output}: {db}");
    }

    run(&["s.ply", "t.ply", "-o", "red.png", "--object", "s:colour=#ff0000", "--object", "2:colour=#ff0000"]);
    let (red, plain) = (picture(&folder, "red.png"), picture(&folder, "both.png"));
    assert!(red.image.pixels.iter().all(|p| p[1] == 0.0 && p[2] == 0.0) && seen(&red) > 100);
    run(&["s.ply", "-o", "faint.png", "--object", "s:opacity=0.01"]);
    let sum = |picture: &Picture| picture.image.pixels.iter().map(|p| p[0]).sum::<f32>();
    assert!(sum(&picture(&folder, "faint.png")) < 0.5 * sum(&plain));

    // The liver's usual colour is a brownish red, the vein's a blue; a colour that is asked for goes before.
    std::fs::copy(folder.path("s.ply"), folder.path("liver.ply")).expect("a liver");
    std::fs::copy(folder.path("s.ply"), folder.path("vein.ply")).expect("a vein");
    let one = |name: &str, more: &[&str]| {
        run(&[&[name, "-o", "one.png", "-f", "--object-colours"], more].concat());
        picture(&folder, "one.png")
            .image
            .pixels
            .iter()
            .fold([0.0; 3], |s, p| [s[0] + p[0], s[1] + p[1], s[2] + p[2]])
    };
    let (liver, vein) = (one("liver.ply", &[]), one("vein.ply", &[]));
    assert!(liver[0] > 1.5 * liver[1] && liver[1] > liver[2], "{liver:?}");
    assert!(vein[2] > vein[1] && vein[0] == 0.0, "{vein:?}");
    let green = one("liver.ply", &["--object", "liver:colour=#00ff00"]);
    assert!(green[1] > 0.0 && green[0] == 0.0 && green[2] == 0.0, "{green:?}");
    // What is here and cannot be seen is said.
    let unseen = folder.run(&[
        "render",
        "s.ply",
        "t.ply",
        "-o",
        "u.png",
        "--tf-shift",
        "9000",
        "--object",
        "t:hidden",
    ]);
    assert!(unseen.err.contains("HU, is barely visible"), "{}", unseen.err);
    assert!(unseen.err.contains("s, mostly") && !unseen.err.contains("t, mostly"), "{}", unseen.err);

    let few = run(&["s.ply", "-o", "few.png", "--splat-budget", "100"]);
    assert!(alone["active_splats"].as_u64() > Some(100));
    assert_eq!(few["active_splats"], 100);
}

#[test]
fn several_objects_have_the_usual_look_of_each_unless_a_function_is_asked_for() {
    let folder = folder();
    for name in ["liver.ply", "vein.ply", "rib_1.ply"] {
        std::fs::copy(folder.path("s.ply"), folder.path(name)).expect("an object");
    }
    let all = ["render", "liver.ply", "vein.ply", "rib_1.ply", "--size", "64x64", "--shade", "off", "-f"];
    let run = |more: &[&str]| folder.run(&[&all[..], more].concat());
    let found = run(&["-o", "usual.png", "--json"]).json();
    assert_eq!(found["transfer_function"], "By kind");
    let of = |key: &str| -> Vec<serde_json::Value> {
        found["objects"].as_array().expect("objects").iter().map(|object| object[key].clone()).collect()
    };
    assert_eq!(of("transfer_function"), ["Organ", "Vessel", "Bone"]);
    let red: Vec<f64> = of("colour").iter().map(|colour| colour[0].as_f64().expect("red")).collect();
    assert!(red[0] > 0.8 && red[1] == 0.0 && red[2] > 0.9, "{red:?}");
    // What they are is said once, with how to change it.
    let told = run(&["-o", "usual.png"]);
    assert!(told.code == 0 && told.err.contains("3 objects, each in its usual colour"), "{}", told.err);
    assert!(told.err.contains("--tf") && !told.err.contains("hardly"), "{}", told.err);
    // A colour and a function that are asked for go before.
    let changed = run(&["-o", "c.png", "--object", "liver:colour=#00ff00", "--json"]).json();
    assert_eq!(changed["objects"][0]["colour"], serde_json::json!([0.0, 1.0, 0.0]));
    let asked = run(&["-o", "asked.png", "--tf", "CT-Bone", "--json"]).json();
    assert_eq!(
        (&asked["transfer_function"], &asked["objects"][0]["colour"]),
        (&"CT-Bone".into(), &().into())
    );
    assert!(seen(&picture(&folder, "usual.png")) > 100);
    assert_ne!(picture(&folder, "usual.png").image, picture(&folder, "asked.png").image);
    // One warning for all of them, with what mends it.
    let unseen = run(&["-o", "u.png", "--tf", "CT-Fat"]);
    let warnings: Vec<_> = unseen.err.lines().filter(|line| line.contains("barely visible")).collect();
    let [warning] = warnings[..] else { panic!("{}", unseen.err) };
    assert!(warning.contains("3 of 3 objects") && warning.contains("leave --tf out"), "{warning}");
}

#[test]
fn what_cannot_be_rendered_is_refused_and_nothing_is_written() {
    let folder = folder();
    folder.write("broken.json", "{\"eye_mm\": [0, 1]}");
    folder.write("there.png", "mine");
    let before = folder.contents();
    for (code, arguments, told) in [
        (2, &["s.ply", "-o", "a.jpg"][..], "jpg"),
        (2, &["s.ply", "-o", "a.png", "--tf", "CT-Bnoe"], "CT-Bone"),
        (2, &["s.ply", "-o", "a.png", "--camera", "above"], "superior"),
        (2, &["s.ply", "-o", "a.png", "--camera", "broken.json"], "eye_mm"),
        (2, &["s.ply", "-o", "a.png", "--mode", "slob"], "slab"),
        (2, &["s.ply", "-o", "a.png", "--mode", "volume"], "--volume"),
        (2, &["--volume", "ct.nii.gz", "-o", "a.png", "--mode", "slab"], "PLY"),
        (2, &["s.ply", "-o", "a.png", "--hide-label", "liver"], "label"),
        (2, &["s.ply", "-o", "a.png", "--object", "liver:hidden"], "s (1)"),
        (2, &["s.ply", "-o", "a.png", "--object", "s:colour=red"], "#rrggbb"),
        (2, &["s.ply", "-o", "a.png", "--object", "s:opacity=1.5"], "from 0 to 1"),
        (2, &["s.ply", "-o", "a.png", "--splat-budget", "0"], "splat-budget"),
        (2, &["--volume", "ct.nii.gz", "-o", "a.png", "--object", "1:hidden"], "volume has no objects"),
        (66, &["s.ply", "none.ply", "-o", "a.png"], "none.ply"),
        (2, &["s.ply", "-o", "a.exr", "--turntable", "4"], "png"),
        (2, &["-o", "a.png"], "<SPLATS|VOLUME>"),
        (66, &["none.ply", "-o", "a.png"], "none.ply"),
        (73, &["s.ply", "-o", "there.png"], "--force"),
    ] {
        let ended = folder.run(&[&["render"], arguments].concat());
        assert_eq!(ended.code, code, "{arguments:?}: {}", ended.err);
        assert!(ended.err.to_lowercase().contains(&told.to_lowercase()), "{arguments:?}: {}", ended.err);
    }
    assert_eq!(folder.contents(), before);
}

/// A volume may be given like splats, and what makes no sense with it is said.
#[test]
fn a_volume_is_rendered_without_a_flag() {
    let folder = Folder::new(24);
    let run = |more: &[&str]| folder.run(&[&["render", "--size", "48x40", "--tf", "CT-Bone"], more].concat());
    let flag = run(&["--volume", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "a.png"]);
    let plain = run(&["ct.nii.gz", "--roi", "mask.nii.gz", "-o", "b.png"]);
    assert_eq!((flag.code, plain.code), (0, 0), "{} {}", flag.err, plain.err);
    assert_eq!(picture(&folder, "a.png"), picture(&folder, "b.png"));
    for (more, code) in [
        (&["ct.nii.gz", "--volume", "ct.nii.gz", "-o", "c.png"][..], "VGS-CLI-098"),
        (&["ct.nii.gz", "mask.nii.gz", "-o", "c.png"], "VGS-CLI-098"),
        (&["s.ply", "--roi", "mask.nii.gz", "-o", "c.png"], "VGS-CLI-099"),
    ] {
        let refused = run(more);
        assert!(
            refused.code == 2 && refused.err.contains(code),
            "{more:?}: {} {}",
            refused.code,
            refused.err
        );
    }
}
