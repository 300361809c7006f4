//! `vgs compare` on pictures that can be reckoned.

mod support;

use engine::image::{Image, WriteOptions, read, write};
use support::Folder;

/// A folder with pictures: a gradient, the same as EXR, two that differ from it, and one of another size.
fn folder() -> Folder {
    let folder = Folder::new(16);
    let a = Image {
        size: [48, 32],
        pixels: (0..48 * 32).map(|i| [(i % 48) as f32 / 51.0, (i / 48) as f32 / 51.0, 0.2, 1.0]).collect(),
    };
    let mut b = a.clone();
    b.pixels.iter_mut().for_each(|p| p[2] += 0.2);
    let mut c = a.clone();
    c.pixels[20 * 48 + 7][1] += 0.6;
    let small = Image::new([40, 32], [0.0, 0.0, 0.0, 1.0]);
    for (name, image) in
        [("a.png", &a), ("a.exr", &a), ("b.png", &b), ("c.png", &c), ("c.exr", &c), ("small.png", &small)]
    {
        write(folder.path(name), image, None, &WriteOptions::default()).expect("writing a picture");
    }
    folder
}

#[test]
fn figures_are_those_of_the_pictures() {
    let folder = folder();
    let equal = folder.run(&["compare", "a.png", "a.png", "--json"]).json();
    assert_eq!(equal["psnr_db"], "inf");
    assert_eq!((equal["ssim"].as_f64(), equal["flip_mean"].as_f64()), (Some(1.0), Some(0.0)));
    assert_eq!(
        (equal["largest_difference"].as_f64(), &equal["size"]),
        (Some(0.0), &serde_json::json!([48, 32]))
    );

    // 0.2 in one channel of three.
    let shift = folder.run(&["compare", "a.png", "b.png", "--json"]).json();
    let expected = -10.0 * (0.04_f64 / 3.0).log10();
    assert!((shift["psnr_db"].as_f64().unwrap() - expected).abs() < 1e-4, "{shift}");
    assert!(shift["ssim"].as_f64().unwrap() > 0.9 && shift["flip_mean"].as_f64().unwrap() > 0.05);

    for ending in ["png", "exr"] {
        let dot = folder.run(&["compare", &format!("a.{ending}"), &format!("c.{ending}"), "--json"]).json();
        assert_eq!(dot["largest_at"], serde_json::json!([7, 20]));
        assert_eq!(dot["largest_in"], "green");
        assert!((dot["largest_difference"].as_f64().unwrap() - 0.6).abs() < 1e-5, "{dot}");
    }

    let text = folder.run(&["compare", "a.png", "c.png"]);
    assert_eq!(text.code, 0, "{}", text.err);
    for part in ["48 x 32", "PSNR", "dB", "SSIM", "FLIP", "0.6000 (153.0 of 255) in green, column 7, row 20"]
    {
        assert!(text.out.contains(part), "{part}: {}", text.out);
    }
    let text = folder.run(&["compare", "a.png", "a.exr"]);
    assert!(text.out.contains("SSIM     1.00000"), "PNG and EXR hold the same picture: {}", text.out);
}

#[test]
fn the_difference_is_drawn() {
    let folder = folder();
    let run = |more: &[&str]| {
        let mut all = vec!["compare", "a.png", "c.png", "--diff", "diff.png"];
        all.extend(more);
        folder.run(&all)
    };
    let ended = run(&["--json"]);
    assert_eq!(ended.json()["outputs"], serde_json::json!(["diff.png"]));
    let flip = folder.read("diff.png");
    assert!(read(folder.path("diff.png")).expect("a picture").image.size[0] > 3 * 48);
    let refused = run(&[]);
    assert_eq!(refused.code, 73, "{}", refused.err);
    assert_eq!(run(&["--force", "--map", "absolute"]).code, 0);
    assert_ne!(folder.read("diff.png"), flip);
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let folder = folder();
    folder.write("text.png", "no picture");
    let before = folder.contents();
    for (arguments, exit, says) in [
        (
            &["a.png", "small.png"][..],
            2,
            "a.png and small.png: pictures of different sizes: 48 x 32 and 40 x 32",
        ),
        (&["a.png", "none.png"], 66, "none.png"),
        (&["a.png", "text.png"], 65, "text.png: not a picture of a known format"),
        (&["a.png", "ct.nii.gz"], 65, "png, exr"),
        (&["a.png"], 2, "<B>"),
        (&["a.png", "c.png", "--diff", "d.jpg"], 2, "d.jpg: no picture format is called \"jpg\""),
        (&["a.png", "c.png", "--diff", "c.png", "--force"], 73, "the output is the input"),
        (&["a.png", "c.png", "--map", "flip"], 2, "--diff"),
    ] {
        let mut all = vec!["compare"];
        all.extend(arguments);
        let ended = folder.run(&all);
        assert_eq!(ended.code, exit, "{arguments:?}: {}", ended.err);
        assert!(ended.err.contains(says), "{arguments:?}: {}", ended.err);
        assert_eq!(folder.contents(), before, "{arguments:?}");
    }
}
