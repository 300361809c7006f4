//! The error of what is shown of splats: its figures are those of an evaluation, and its colours are seen.

use engine::fidelity::{ShownError, diverging, evaluate_decoded};
use engine::fit::evaluate::Protocol;
use engine::render::{Camera, DecodeOptions, Scene, Settings, decode, mode};
use engine::splat::{Form, Grid, Kernel, SplatSet};
use engine::volume::Roi;
use glam::{DAffine3, DVec3};
use vgs_tests::rendering::{look, render, set, settings};
use vgs_tests::{Bound, Device, assert_close};

/// Splats that were fitted on a grid of 2 mm, as far as anybody knows.
fn of_grid() -> SplatSet {
    let splats = set(200, Kernel::Compact);
    let affine =
        DAffine3::from_translation(splats.origin_mm - 50.0) * DAffine3::from_scale(DVec3::splat(2.0));
    let grid = Grid { size: [50; 3], world_from_voxel: affine };
    SplatSet { form: Form::Grid, grid: Some(grid), ..splats }
}

/// A volume that is 30 HU lower than what is shown at the patient's left, and 10 HU higher at the right.
#[test]
fn an_error_that_is_known_is_found_and_seen() {
    let gpu = Device::boot();
    let splats = of_grid();
    let decoded = decode(&gpu, &splats, 1.0).expect("decoded");
    let (mut volume, occupied) = decoded.volume(splats.origin_mm).expect("a volume");
    let shift = |x: f64| if x < splats.origin_mm.x { -30.0 } else { 10.0 };
    let ([nx, ny, _], world_from_voxel) = (volume.size, volume.world_from_voxel);
    let place = |i: usize| {
        let voxel = DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64);
        world_from_voxel.transform_point3(voxel)
    };
    let shifts: Vec<f32> = (0..volume.len()).map(|i| shift(place(i).x)).collect();
    volume.samples.iter_mut().zip(&shifts).for_each(|(v, shift)| *v += shift);

    let mut parts = Vec::new();
    let found = ShownError::new(&gpu, &splats, &volume, None, &mut |part| parts.push(part))
        .expect("measured")
        .expect("the splats are in the volume");
    assert!(parts.is_sorted() && parts.last() == Some(&1.0), "{parts:?}");
    // Fractions of 16 bits and the field's own arithmetic differ a little.
    assert!((found.figures.p99_hu - 30.0).abs() < 1.0 && found.range == 50.0, "{:?}", found.figures);
    assert!((10.0..30.0).contains(&found.figures.mean_error_hu) && !found.other_volume);
    let half = occupied.weight.iter().map(|w| f32::from(u8::from(*w >= 0.5))).collect();
    let region = Roi::new(half, &volume).expect("a region");
    assert_eq!(found.voxels, region.voxel_count());
    let errors = region.members().map(|i| {
        let error = found.at(place(i)).expect("an error in the region");
        (error, -f64::from(shifts[i]))
    });
    assert_close("errors of voxels", Bound::new(1.0, 0.0).outliers(0.02, 200.0), errors.collect::<Vec<_>>());

    // In the same region the figures are those of an evaluation.
    let (low, high) = volume.min_max().expect("numbers");
    let protocol = Protocol { offsets: Vec::new(), range: [low, high], shell: 0, threshold: 0.0 };
    let wanted = evaluate_decoded(&gpu, &splats, &volume, &region, &protocol).expect("measured").on_grid;
    let again = ShownError::new(&gpu, &splats, &volume, Some(&region), &mut |_| ()).expect("measured");
    let again = again.expect("the region is not empty").figures;
    assert_close(
        "figures",
        Bound::new(1e-9, 1e-9),
        [
            (found.figures.p99_hu, wanted.p99_hu),
            (again.p99_hu, wanted.p99_hu),
            (found.figures.mean_error_hu, wanted.mean_error_hu),
            (again.rmse_hu, wanted.rmse_hu),
        ],
    );

    // From the front the patient's right is at the left of the picture: blue there is too low, red is too high.
    let scene = Scene::new(&gpu, Some(&splats), None, &found.look(&look("CT-Soft-Tissue", false), 30.0))
        .expect("a scene");
    let (classes, origin) = (found.clone(), scene.origin);
    let on_device = scene.splats.as_ref().expect("splats");
    on_device
        .decoding_objects(&gpu, DecodeOptions::default(), move |at| classes.class(at + origin))
        .expect("a job")(&mut |_| ())
    .expect("decoded");
    let [low, high] = scene.bounds();
    let camera =
        Camera::from_side("anterior", (low + high) * 0.5, 40.0, 30.0, 72.0 / 56.0).expect("a camera");
    let settings = Settings { dark: 1e-4, ..settings() };
    let picture = render(&gpu, mode("decoded").expect("a mode"), &scene, &settings, &[camera]).remove(0);
    let mut counts = [0; 2];
    let mut pairs = Vec::new();
    for (i, pixel) in picture.pixels.iter().enumerate() {
        let column = i % picture.size[0];
        let side = if column < 30 { 0 } else { usize::from(column > 42) };
        if pixel[3] > 0.2 && !(30..=42).contains(&column) {
            let wanted = diverging(if side == 0 { -10.0 / 30.0 } else { 1.0 });
            counts[side] += 1;
            pairs.extend((0..3).map(|k| (f64::from(pixel[k] / pixel[3]), f64::from(wanted[k]))));
        }
    }
    println!("{counts:?} pixels at both sides");
    assert!(counts.iter().all(|n| *n > 30), "{counts:?}");
    assert_close("colours", Bound::new(0.05, 0.0).outliers(0.05, 1.0), pairs);

    let elsewhere = SplatSet { origin_mm: splats.origin_mm + 1e4, grid: None, form: Form::Field, ..splats };
    assert!(ShownError::new(&gpu, &elsewhere, &volume, None, &mut |_| ()).expect("no error").is_none());
}
