//! `vgs eval` on a phantom whose errors are known: splats of 100 HU everywhere.

use crate::support::Folder;
use engine::splat::{self, Field, Splat, SplatSet};
use engine::volume::{ReadOptions, Volume, nifti};
use glam::{DAffine3, DMat3, DVec3};

const SIZE: [usize; 3] = [14, 12, 10];

/// known.nii with 90 HU on the left and 130 HU on the right, a label map of both halves, and flat.ply. The last voxel is air,
/// which makes it a CT, and has no label.
fn known(folder: &Folder) -> Volume {
    let affine = DAffine3::from_mat3_translation(
        DMat3::from_diagonal(DVec3::new(-1.0, 0.5, 2.0)),
        DVec3::new(20.0, -30.0, 40.0),
    );
    let left = |i: usize| i % SIZE[0] < 4;
    let of = |a: f32, b: f32, last: f32| {
        let mut samples: Vec<f32> = (0..SIZE.iter().product()).map(|i| if left(i) { a } else { b }).collect();
        *samples.last_mut().expect("voxels") = last;
        Volume::new(SIZE, affine, samples)
    };
    let ct = of(90.0, 130.0, -1000.0);
    nifti::write(folder.path("known.nii"), &ct, false).expect("a CT");
    nifti::write(folder.path("labels.nii"), &of(5.0, 9.0, 0.0), false).expect("labels");
    let flat = Splat {
        mean: [7.0, 6.0, 5.0],
        log_scale: [5.0; 3],
        opacity_logit: 3.0,
        rotation: [1.0, 0.0, 0.0, 0.0],
        intensity: 100.0,
    };
    let field = Field { background: 100.0, ..Field::default() };
    splat::write(&folder.path("flat.ply"), &SplatSet::from_voxel(&[flat], &affine, field), false)
        .expect("splats");
    ct
}

#[test]
fn the_error_is_told_where_it_is() {
    let folder = Folder::new(8);
    let ct = known(&folder);
    let eval = ["eval", "flat.ply", "known.nii", "--roi", "labels.nii", "--roi-label", "5,9"];
    let more = ["--map", "error.nii.gz", "--picture", "error.png", "--slices", "worst", "--json"];
    let told = folder.run(&[&eval[..], &more].concat()).json();
    let errors = &told["errors"];
    assert_eq!((&errors["region"]["voxels"], &errors["uncovered_voxels"]), (&1679.into(), &0.into()));
    assert_eq!(
        (&errors["region"]["worst_hu"], &errors["worst_voxel"]),
        (&30.0.into(), &serde_json::json!([4, 0, 0]))
    );
    assert_eq!(errors["worst_mm"], serde_json::json!([16.0, -30.0, 40.0]));
    let labels = errors["by_label"].as_array().expect("labels");
    let figures: Vec<_> =
        labels.iter().map(|g| (g["name"].as_str(), g["voxels"].as_u64(), g["mean_hu"].as_f64())).collect();
    assert_eq!(figures, [(Some("5"), Some(480), Some(10.0)), (Some("9"), Some(1199), Some(-30.0))]);
    let rmse = |value: &serde_json::Value| value["rmse_hu"].as_f64().expect("a number");
    assert!((rmse(&errors["region"]) - rmse(&told)).abs() < 1e-9, "one figure for the region");
    assert!((rmse(&told) - ((480.0 * 100.0 + 1199.0 * 900.0) / 1679.0f64).sqrt()).abs() < 1e-4);
    assert!(folder.read("error.png").starts_with(b"\x89PNG\r\n\x1a\n"));

    let map = Volume::read(folder.path("error.nii.gz"), &ReadOptions::default()).expect("a map");
    assert_eq!(map.size, ct.size);
    assert!(map.world_from_voxel.abs_diff_eq(ct.world_from_voxel, 1e-5), "the grid of the CT");
    for (i, (&error, &v)) in map.samples.iter().zip(&ct.samples).enumerate() {
        let wanted = if v > 0.0 { 100.0 - v } else { 0.0 };
        assert!((error - wanted).abs() < 1e-4, "voxel {i}: {error}");
    }
    // Outside the region there is no error to tell.
    let one = folder.run(
        &[
            &["eval", "flat.ply", "known.nii", "--roi", "labels.nii", "--roi-label", "5"][..],
            &["--map", "left.nii"],
        ]
        .concat(),
    );
    assert_eq!(one.code, 0, "{}", one.err);
    for line in ["region", "by label", "by tissue", "soft tissue, -30 to 200 HU", "up to 1 mm"] {
        assert!(one.out.contains(line), "{line}: {}", one.out);
    }
    let left = Volume::read(folder.path("left.nii"), &ReadOptions::default()).expect("a map");
    for (i, &error) in left.samples.iter().enumerate() {
        assert!((error - if i % SIZE[0] < 4 { 10.0 } else { 0.0 }).abs() < 1e-4, "voxel {i}: {error}");
    }
}

#[test]
fn an_exact_field_is_infinitely_good() {
    let folder = Folder::new(8);
    known(&folder);
    let near = folder.run(&["eval", "flat.ply", "known.nii", "--roi-threshold", "89,91", "--json"]).json();
    assert!(near["psnr_db"].is_number());
    let flat = Volume { samples: vec![100.0; SIZE.iter().product()], ..known_volume(&folder) };
    nifti::write(folder.path("flat.nii"), &flat, false).expect("a volume");
    let exact = folder.run(&["eval", "flat.ply", "flat.nii", "--roi-threshold", "99,101", "--json"]).json();
    assert_eq!((&exact["psnr_db"], &exact["mmse"]), (&serde_json::Value::Null, &0.0.into()));
    assert_eq!(exact["errors"]["region"]["worst_hu"], 0.0);
}

fn known_volume(folder: &Folder) -> Volume {
    Volume::read(folder.path("known.nii"), &ReadOptions::default()).expect("a CT")
}

#[test]
fn a_map_of_another_name_is_refused_before_anything_is_done() {
    let folder = Folder::new(8);
    known(&folder);
    let before = folder.contents();
    let eval = ["eval", "flat.ply", "known.nii", "--roi", "labels.nii", "--roi-label", "5"];
    let refused = folder.run(&[&eval[..], &["--map", "error.mha"]].concat());
    assert_eq!(refused.code, 2, "{}", refused.err);
    assert!(refused.err.contains("VGS-NII-020") && refused.err.contains(".nii.gz"), "{}", refused.err);
    assert!(folder.contents() == before, "nothing is left behind");
    let exists = folder.run(&[&eval[..], &["--map", "known.nii", "--force"]].concat());
    assert!(exists.code != 0 && exists.err.contains("VGS-CLI-021"), "{}", exists.err);
}
