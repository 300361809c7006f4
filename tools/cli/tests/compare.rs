//! `vgs compare` on pictures and volumes that can be reckoned.

use crate::support::Folder;
use engine::image::{Image, WriteOptions, read, write};
use engine::volume::{Volume, nifti};
use glam::{DAffine3, DVec3};

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
    assert!(equal["psnr_db"].is_null());
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

/// a.nii of 0 to 99 HU and -500 beyond its region; b.nii, which is 4 more and 40 less at voxel 2 3 1; inside.nii; and
/// elsewhere.nii, b on another grid.
fn volumes(folder: &Folder) {
    let size = [5, 5, 8];
    let affine = DAffine3 {
        translation: DVec3::new(-7.0, 8.0, 9.0),
        ..DAffine3::from_scale(DVec3::new(1.0, 2.0, 3.0))
    };
    let put = |name: &str, affine, value: &dyn Fn(usize) -> f32| {
        let volume = Volume::new(size, affine, (0..200).map(value).collect());
        nifti::write(folder.path(name), &volume, false).expect("a volume");
    };
    let a = |i: usize| if i < 100 { i as f32 } else { -500.0 };
    let b = |i: usize| match i {
        42 => 2.0,
        i if i < 100 => i as f32 + 4.0,
        _ => 2000.0,
    };
    put("a.nii", affine, &a);
    put("b.nii.gz", affine, &b);
    put("elsewhere.nii", DAffine3::from_translation(DVec3::X) * affine, &b);
    put("inside.nii", affine, &|i| f32::from(u8::from(i < 100)));
    put("halves.nii", affine, &|i| if i < 50 { 1.0 } else { 2.0 });
}

#[test]
fn volumes_are_compared_inside_a_mask_in_each_normalisation() {
    let folder = Folder::new(8);
    volumes(&folder);
    let compare = |more: &[&str]| {
        let all = [&["compare", "a.nii", "b.nii.gz", "--roi", "inside.nii", "--json"][..], more].concat();
        folder.run(&all).json()
    };
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    let psnr = |mse: f64| -10.0 * mse.log10();
    let own: f64 = (0..100)
        .map(|i| {
            let b = if i == 42 { 2.0 } else { f64::from(i) + 4.0 };
            ((b - 2.0) / 1998.0 - (f64::from(i) + 500.0) / 599.0).powi(2)
        })
        .sum();
    // Clipped to 0 to 99: the last four are 3, 2, 1 and 0 off.
    let clipped = (95.0 * 16.0 + 9.0 + 4.0 + 1.0 + 1600.0) / 100.0;
    let plain = (99.0 * 16.0 + 1600.0) / 100.0;
    let rows: [(&[&str], &str, f64); 4] = [
        (&[], "volume", clipped / 599f64.powi(2)),
        (&["--range", "roi"], "roi", clipped / 99f64.powi(2)),
        (&["--range", "-100,400"], "given", plain / 500f64.powi(2)),
        (&["--range", "own"], "own", own / 100.0),
    ];
    for (more, of, mse) in rows {
        let told = compare(more);
        assert_eq!((&told["range_of"], &told["voxels"]), (&of.into(), &100.into()), "{told}");
        assert!((number(&told["mse"]) / mse - 1.0).abs() < 1e-6, "{of}: {told}");
        assert!((number(&told["psnr_db"]) - psnr(mse)).abs() < 1e-6, "{of}: {told}");
        // In the volume's unit whatever the normalisation is.
        assert!((number(&told["rmse_hu"]) - plain.sqrt()).abs() < 1e-6, "{told}");
        assert_eq!((&told["p99_hu"], &told["largest_hu"]), (&4.0.into(), &(-40.0).into()), "{told}");
        assert_eq!(told["largest_voxel"], serde_json::json!([2, 3, 1]));
        assert_eq!(told["largest_mm"], serde_json::json!([-5.0, 14.0, 12.0]));
    }
    assert_eq!(compare(&["--range", "own"])["range_b"], serde_json::json!([2.0, 2000.0]));
    let label = ["compare", "a.nii", "b.nii.gz", "--roi", "halves.nii", "--roi-label", "1", "--json"];
    assert_eq!(folder.run(&label).json()["voxels"], 50);
    let threshold = ["compare", "a.nii", "b.nii.gz", "--roi-threshold", "10,19", "--json"];
    assert_eq!(folder.run(&threshold).json()["voxels"], 10);
    assert_eq!(folder.run(&["compare", "a.nii", "b.nii.gz", "--json"]).json()["voxels"], 200, "everywhere");

    let text = folder.run(&["compare", "a.nii", "b.nii.gz", "--roi", "inside.nii", "--range", "roi"]);
    assert_eq!(text.code, 0, "{}", text.err);
    for says in [
        "voxels   100 of 5 x 5 x 8\n",
        "range    0 to 99 HU (the first volume's inside the region; both are clipped to it)\n",
        "RMSE     5.64 HU\n",
        "within   4.00 HU in 99 % of the voxels\n",
        "largest  -40.00 HU at voxel 2 3 1 (-5.0 14.0 12.0 mm)\n",
    ] {
        assert!(text.out.contains(says), "{says}: {}", text.out);
    }
    let equal = folder.run(&["compare", "a.nii", "a.nii", "--roi", "inside.nii"]);
    assert!(equal.out.contains("∞ (equal)") && equal.out.contains("largest  none"), "{}", equal.out);
    let equal = folder.run(&["compare", "a.nii", "a.nii", "--json"]).json();
    assert!(equal["psnr_db"].is_null());
}

#[test]
fn volumes_that_cannot_be_compared_are_refused() {
    let folder = Folder::new(8);
    volumes(&folder);
    write(folder.path("p.png"), &Image::new([8, 8], [0.0; 4]), None, &WriteOptions::default())
        .expect("a picture");
    let before = folder.contents();
    for (arguments, exit, says) in [
        (&["a.nii", "elsewhere.nii"][..], 65, "a.nii and elsewhere.nii: the volumes lie on different grids"),
        (&["a.nii", "ct.nii.gz"], 65, "vgs rasterize"),
        (&["a.nii", "none.nii"], 66, "none.nii"),
        (&["a.nii", "p.png"], 65, "p.png: not a volume in a known format"),
        (&["p.png", "p.png", "--roi", "inside.nii"], 65, "p.png: not a volume in a known format"),
        (&["a.nii", "b.nii.gz", "--roi", "halves.nii"], 2, "--roi-label"),
        (
            &["a.nii", "b.nii.gz", "--roi-threshold", "3,3", "--range", "roi"],
            65,
            "3 everywhere in the region",
        ),
        (
            &["a.nii", "inside.nii", "--roi-threshold", "9999,99999"],
            3,
            "a.nii: the region of interest is empty",
        ),
        (&["a.nii", "b.nii.gz", "--range", "2,1"], 2, "lower"),
        (&["a.nii", "b.nii.gz", "--range", "mine"], 2, "own"),
        (&["a.nii", "b.nii.gz", "--diff", "d.png"], 2, "VGS-CLI-044"),
    ] {
        let ended = folder.run(&[&["compare"][..], arguments].concat());
        assert_eq!(ended.code, exit, "{arguments:?}: {}", ended.err);
        assert!(ended.err.contains(says), "{arguments:?}: {}", ended.err);
        assert_eq!(folder.contents(), before, "{arguments:?}");
    }
}
