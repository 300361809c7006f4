//! The PLY of the paper's authors through the commands: written by a fit, and theirs beside its volume.

use crate::support::{Folder, fit};
use engine::splat::{self, Place, ReadOptions, SplatSet};
use engine::volume::{Volume, nifti};
use glam::{DAffine3, DMat3, DVec3};

/// `ct.nii.gz` on an oblique grid of unequal voxels with more of them along one axis, and the mask with it.
fn turned(folder: &Folder) {
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 0.6);
    let affine = DAffine3::from_mat3_translation(
        turn * DMat3::from_diagonal(DVec3::new(-0.8, 0.8, 2.0)),
        DVec3::new(30.0, -70.0, 412.0),
    );
    for name in ["ct.nii.gz", "mask.nii.gz"] {
        let volume = Volume::read(folder.path(name), &Default::default()).expect("the phantom");
        // The middle slices along z.
        let [nx, ny, nz] = volume.size;
        let (first, count) = (nz / 4, nz / 2);
        let samples = volume.samples[nx * ny * first..][..nx * ny * count].to_vec();
        let flat = Volume::new([nx, ny, count], affine, samples);
        nifti::write(folder.path(name), &flat, true).expect("a volume");
    }
}

#[test]
fn a_fit_in_their_layout_is_the_same_fit() {
    let folder = Folder::new(28);
    turned(&folder);
    // In the form whose intensities stay in the region's range, to which a comparison of volumes clips.
    let more = ["--kernel", "gaussian", "--form", "field", "--checkpoint-every", "12", "--json"];
    let ours = folder.run(&fit("ours.ply", &more)).json();
    let dry = folder.run(&fit("dry.ply", &["--ply-layout", "reference", "--dry-run", "--json"])).json();
    let theirs = folder.run(&fit("theirs.ply", &[&more[..], &["--ply-layout", "reference"]].concat())).json();
    assert_eq!(ours["psnr_db"], theirs["psnr_db"], "the layout changes no splat");
    let length = folder.read("theirs.ply").len();
    let expected = dry["file_bytes"].as_u64().expect("a number") as f64;
    assert!((length as f64 / expected - 1.0).abs() < 0.02, "{length} and {expected}");

    // Their layout does not say on which grid the splats were fitted.
    let region =
        ["ct.nii.gz", "--roi", "mask.nii.gz", "--offsets", "2", "--between-slices", "linear", "--json"];
    let eval = |name: &str| folder.run(&[&["eval", name][..], &region].concat()).json();
    for (a, b) in [("ours.ply", "theirs.ply"), ("ours.000012.ply", "theirs.000012.ply")] {
        let (a, b) = (eval(a), eval(b));
        for key in ["psnr_db", "psnr_min_offset_db", "rmse_hu", "occupancy_rmse", "soft_dice"] {
            let [a, b] = [&a, &b].map(|figures| figures[key].as_f64().expect("a number"));
            assert!((a - b).abs() < 1e-4 * a.abs(), "{key}: {a} and {b}");
        }
    }
    for name in ["ours", "theirs"] {
        let ply = format!("{name}.ply");
        let rasterize = ["rasterize", &ply, "--like", "ct.nii.gz", "-o", &format!("{name}.nii")];
        let ended = folder.run(&rasterize);
        assert_eq!((ended.code, ended.err.contains("hu, because no region")), (0, false), "{}", ended.err);
        let picture = format!("{name}.png");
        // Slabs need no grid.
        let render =
            ["render", &ply, "--volume", "ct.nii.gz", "-o", &picture, "--size", "64", "--mode", "slab"];
        let ended = folder.run(&render);
        assert_eq!(ended.code, 0, "{}", ended.err);
    }
    let same = folder.run(&["compare", "ours.nii", "theirs.nii", "--roi", "mask.nii.gz", "--json"]).json();
    assert!(same["rmse_hu"].as_f64().expect("a number") < 0.1, "{same}");
    let same = folder.run(&["compare", "ours.png", "theirs.png", "--json"]).json();
    assert!(same["psnr_db"].as_f64().is_none_or(|psnr| psnr > 60.0), "{same}");

    // What is evaluated is what a comparison of volumes finds.
    let field = ["rasterize", "theirs.ply", "--like", "ct.nii.gz", "-o", "field.nii", "--quantity", "field"];
    assert_eq!(folder.run(&field).code, 0);
    let in_roi = ["--roi", "mask.nii.gz", "--range", "roi", "--json"];
    let compared = folder.run(&[&["compare", "ct.nii.gz", "field.nii"][..], &in_roi].concat()).json();
    let evaluated = folder.run(&[&["eval", "theirs.ply", "ct.nii.gz"][..], &in_roi].concat()).json();
    for (a, b) in [("psnr_db", "psnr_db"), ("mse", "mmse"), ("p99_hu", "p99_hu"), ("rmse_hu", "rmse_hu")] {
        let [a, b] = [&compared[a], &evaluated[b]].map(|v| v.as_f64().expect("a number"));
        assert!((a / b - 1.0).abs() < 1e-3, "{a} and {b}");
    }
    assert_eq!((&compared["voxels"], &compared["range_a"]), (&evaluated["roi_voxels"], &evaluated["range"]));

    // What it is, and what is missing where there is no volume.
    let info = folder.run(&["info", "theirs.ply"]);
    for says in [
        "layout       reference: that of the paper's authors",
        "voxel index times spacing",
        "0 to 1 stand for",
    ] {
        assert!(info.out.contains(says), "{says}: {}", info.out);
    }
    assert_eq!(folder.run(&["info", "theirs.ply", "--json"]).json()["layout"], "reference");
    assert_eq!(folder.run(&["info", "ours.ply", "--json"]).json()["layout"], "vgs");
    for alone in [
        &["rasterize", "theirs.ply", "--spacing", "2", "-o", "no.nii"][..],
        &["render", "theirs.ply", "-o", "no.png"],
        &["info", "theirs.ply", "--budget"],
    ] {
        let ended = folder.run(alone);
        assert_eq!(ended.code, 2, "{alone:?}: {}", ended.err);
        for says in ["VGS-PLY-026", "theirs.ply: a PLY in the layout of the paper's authors", "--roi MASK"] {
            assert!(ended.err.contains(says), "{alone:?}: {says} in {}", ended.err);
        }
    }
    let wrong = folder.run(&fit("x.ply", &["--ply-layout", "authors"]));
    assert!(wrong.code == 2 && wrong.err.contains("reference ("), "{}", wrong.err);
}

#[test]
fn a_kernel_that_their_programs_do_not_draw_is_told() {
    let folder = Folder::new(16);
    let ended = folder.run(&fit("a.ply", &["--ply-layout", "reference", "--kernel", "compact"]));
    assert_eq!(ended.code, 0, "{}", ended.err);
    assert!(ended.err.contains("the fit is with compact"), "{}", ended.err);
}

/// known.nii with 90 HU in 40 % of its region and 130 HU in the rest, and -1000 to 1000 HU beyond; mask.nii; and
/// theirs.ply: one splat of 0.5 over all of it, so of 110 HU, which their `hu` has as 0.
fn known(folder: &Folder) {
    let size = [14, 12, 10];
    let count = size.iter().product::<usize>();
    let affine = DAffine3::from_mat3_translation(
        DMat3::from_diagonal(DVec3::new(-1.0, 0.5, 2.0)),
        DVec3::new(20.0, -30.0, 40.0),
    );
    let inside = |i: usize| i % 14 < 10;
    let sample = |i: usize| match i {
        i if !inside(i) => [-1000.0, 1000.0][i % 2],
        i if i % 14 < 4 => 90.0,
        _ => 130.0,
    };
    let of = |value: &dyn Fn(usize) -> f32| Volume::new(size, affine, (0..count).map(value).collect());
    nifti::write(folder.path("known.nii"), &of(&sample), false).expect("a CT");
    let mask = of(&|i| f32::from(u8::from(inside(i))));
    nifti::write(folder.path("inside.nii"), &mask, false).expect("a mask");
    let names = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 intensity_01 hu opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let properties: String = names.split(' ').map(|name| format!("property float {name}\n")).collect();
    // Two of the same, so that the line of hu is known: -1000 at 0, 1000 at 1.
    let row = |part: f32, opacity: f32| {
        let hu = -1000.0 + 2000.0 * part;
        format!("6.5 3 9 0 0 0 0 0 0 {part} {hu} {opacity} 5 5 5 1 0 0 0\n")
    };
    let text = format!(
        "ply\nformat ascii 1.0\nelement vertex 2\n{properties}end_header\n{}{}",
        row(0.5, 0.9),
        row(0.6, 0.0)
    );
    folder.write("theirs.ply", text);
}

#[test]
fn their_intensities_are_parts_of_the_range_of_the_region() {
    let folder = Folder::new(8);
    known(&folder);
    let eval = ["eval", "theirs.ply", "known.nii", "--roi", "inside.nii", "--range", "roi"];
    let told = folder.run(&[&eval[..], &["--json"]].concat()).json();
    assert_eq!((&told["range"], &told["range_of"]), (&serde_json::json!([90.0, 130.0]), &"roi".into()));
    let region = &told["errors"]["region"];
    let number = |value: &serde_json::Value| value.as_f64().expect("a number");
    assert!((number(&region["worst_hu"]) - 20.0).abs() < 1e-2, "{region}");
    // 20 of 40: a quarter squared.
    assert!((number(&told["mmse"]) - 0.25).abs() < 1e-3 && (number(&told["psnr_db"]) - 6.02).abs() < 0.01);
    let text = folder.run(&eval);
    assert!(text.out.contains("PSNR over 90 to 130 HU (the volume's inside the region)"), "{}", text.out);
    let whole = folder.run(&[&eval[..4], &["inside.nii", "--json"]].concat()).json();
    assert_eq!(
        (&whole["range"], &whole["range_of"]),
        (&serde_json::json!([-1000.0, 1000.0]), &"volume".into())
    );

    let at = |name: &str| {
        let volume = Volume::read(folder.path(name), &Default::default()).expect("a volume");
        volume.samples[volume.index(6, 6, 4)]
    };
    let like = ["rasterize", "theirs.ply", "--like", "known.nii", "-o"];
    let guessed = folder.run(&[&like[..], &["hu.nii"]].concat());
    assert_eq!(guessed.code, 0, "{}", guessed.err);
    assert!(guessed.err.contains("no region is given") && guessed.err.contains("--roi"), "{}", guessed.err);
    assert!(at("hu.nii").abs() < 0.1, "its hu are 0: {}", at("hu.nii"));
    let known = folder.run(&[&like[..], &["roi.nii", "--roi", "inside.nii"]].concat());
    assert!(known.code == 0 && !known.err.contains("warning"), "{}", known.err);
    assert!((at("roi.nii") - 110.0).abs() < 0.1, "{}", at("roi.nii"));

    // Beside another volume it is another file's.
    let other = folder.run(&["rasterize", "theirs.ply", "--like", "ct.nii.gz", "-o", "other.nii"]);
    assert!(other.err.contains("is it the volume"), "{}", other.err);
}

#[test]
fn a_region_without_a_range_is_refused() {
    let folder = Folder::new(8);
    known(&folder);
    let eval = ["eval", "theirs.ply", "known.nii", "--roi-threshold", "129,131", "--range", "roi"];
    let ended = folder.run(&eval);
    assert_eq!(ended.code, 65, "{}", ended.err);
    assert!(ended.err.contains("VGS-CLI-043") && ended.err.contains("130 everywhere"), "{}", ended.err);
    let own = folder.run(&[&eval[..6], &["own"]].concat());
    assert!(own.code == 2 && own.err.contains("or roi"), "{}", own.err);
}

#[test]
fn splats_of_both_layouts_are_rendered_together() {
    let folder = Folder::new(20);
    let more = ["--kernel", "gaussian"];
    assert_eq!(folder.run(&fit("a.ply", &more)).code, 0);
    assert_eq!(folder.run(&fit("b.ply", &[&more[..], &["--ply-layout", "reference"]].concat())).code, 0);
    let render = ["render", "a.ply", "b.ply", "--volume", "ct.nii.gz", "--roi", "mask.nii.gz"];
    let told = folder.run(&[&render[..], &["-o", "both.png", "--size", "48", "--json"]].concat()).json();
    assert_eq!((&told["splats"], told["objects"].as_array().map(Vec::len)), (&120.into(), Some(2)));
    // The same splats twice, in one place.
    let volume = Volume::read(folder.path("ct.nii.gz"), &Default::default()).expect("a volume");
    let place = Place {
        size: volume.size,
        world_from_voxel: volume.world_from_voxel,
        range: [0.0, 1.0],
        region_range: None,
    };
    let read = |name: &str| -> SplatSet {
        splat::read_unplaced(folder.path(name), &ReadOptions::default())
            .and_then(|read| read.placed(Some(&place)))
            .expect("splats")
    };
    let (a, b) = (read("a.ply"), read("b.ply"));
    assert_eq!((a.form, a.grid), (b.form, b.grid), "both are decoded in the same way");
    for (a_splat, b_splat) in a.splats.iter().zip(&b.splats) {
        let mean = |set: &SplatSet, mean: [f32; 3]| DVec3::from_array(mean.map(f64::from)) + set.origin_mm;
        assert!((mean(&a, a_splat.mean) - mean(&b, b_splat.mean)).length() < 1e-4);
        assert_eq!(a_splat.intensity, b_splat.intensity);
    }
}

/// Splats fitted for the voxels of their CT say so, are decoded where nothing else is asked for, and warned of elsewhere.
#[test]
fn a_fit_for_the_grid_is_decoded() {
    let folder = Folder::new(24);
    folder.run(&fit("grid.ply", &["--json"])).json();
    let header = String::from_utf8_lossy(&folder.read("grid.ply")[..2000]).into_owned();
    assert!(header.contains("comment vgs.form region"), "{header}");
    let render = ["render", "grid.ply", "--size", "64x64", "--json", "-o"];
    let plain = folder.run(&[&render[..], &["plain.png"]].concat());
    assert!(!plain.err.contains("vgs.form"), "{}", plain.err);
    assert_eq!(plain.json()["mode"], "decoded");
    let slab = folder.run(&[&render[..], &["slab.png", "--mode", "slab"]].concat());
    assert!(slab.err.contains("fitted for the voxels of their CT alone"), "{}", slab.err);
    assert_eq!(slab.json()["mode"], "slab");

    assert_eq!(folder.run(&["info", "grid.ply", "--json"]).json()["form"], "region");
    let info = folder.run(&["info", "grid.ply"]).out;
    assert!(info.contains("24 x 24 x 24 voxels; the splats are right at these alone"), "{info}");

    // As a volume, too, it is what is shown: the mask was binary, so O is 0 or 1 at the voxels.
    let rasterize =
        ["rasterize", "grid.ply", "--like", "ct.nii.gz", "-o", "o.nii", "--quantity", "occupancy"];
    assert_eq!(folder.run(&rasterize).code, 0);
    let occupancy = Volume::read(folder.path("o.nii"), &Default::default()).expect("a volume");
    let inside = occupancy.samples.iter().filter(|&&o| (o - 1.0).abs() < 1e-3).count();
    assert!(inside > 100 && occupancy.samples.iter().all(|&o| o < 1e-3 || (o - 1.0).abs() < 1e-3));

    // More splats than any density asks for are refused before anything is done.
    let refused =
        folder.run(&["fit", "ct.nii.gz", "--roi", "mask.nii.gz", "-o", "n.ply", "--splats", "1000000000"]);
    assert!(refused.code == 2 && refused.err.contains("VGS-FIT-040"), "{}", refused.err);

    let eval = ["eval", "grid.ply", "ct.nii.gz", "--roi", "mask.nii.gz"];
    let told = folder.run(&[&eval[..], &["--json"]].concat()).json();
    assert_eq!(told["form"], "region");
    let figure = |of: &serde_json::Value, name: &str| of[name].as_f64().expect("a figure");
    let [field, decoded] = ["psnr_db", "psnr_min_offset_db"]
        .map(|name| [figure(&told["field"], name), figure(&told["decoded"], name)])
        .map(|[field, decoded]| decoded - field);
    assert!(field.abs() < 0.05, "at the voxels the decoded field is the field: {field} dB");
    assert!(decoded > 1.0, "between them it is nearer to the CT: {decoded} dB");
    assert_eq!(told["psnr_min_offset_db"], told["decoded"]["psnr_min_offset_db"], "what is shown leads");
    let text = folder.run(&eval).out;
    let [first, second] = ["mode decoded", "modes slab"].map(|what| text.find(what).expect(what));
    assert!(first < second, "what is shown comes first:\n{text}");
}
