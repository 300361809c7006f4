//! Fits of the phantom against figures that were written down: `tests/golden/phantom.txt` and `phantom-field.txt`.
//!
//! On one driver the figures repeat to the bit. Another rounds otherwise, and Adam's first steps turn that into small
//! differences; the tolerances are for these, not for a change of method.

use engine::fit::FitForm;
use engine::fit::evaluate::{Protocol, Sampler, evaluate, random_offsets};
use engine::volume::Bricks;
use engine::volume::bricks::SAMPLES;
use vgs_tests::fitting::Case;
use vgs_tests::golden::{GoldenRow, check};
use vgs_tests::{Bound, Device};

/// Samples whose V̂ and O are written down.
const PROBES: usize = 64;
/// Upper ends of the histogram's classes of V̂ in the region, HU; one class more lies above.
const CLASSES: [f32; 9] = [0.0, 100.0, 200.0, 300.0, 400.0, 600.0, 800.0, 1000.0, 1200.0];

#[test]
fn the_phantom_is_fitted_as_it_was() {
    as_it_was("phantom", FitForm::Grid);
}

#[test]
fn the_field_of_the_phantom_is_fitted_as_it_was() {
    as_it_was("phantom-field", FitForm::Field);
}

fn as_it_was(name: &str, form: FitForm) {
    let gpu = Device::boot();
    let mut case = Case::phantom([40, 36, 40], 60);
    case.config.samples.form = form;
    let start = case.start();
    let mut fitter = case.fitter(&gpu, &start);
    let mut curve = Vec::new();
    for end in [1, 2, 5, 10, 20, 40, 60] {
        case.run(&mut fitter, end);
        curve.push(fitter.progress().expect("progress"));
    }
    let splats = fitter.splats().expect("splats");
    let field = case.config.field(fitter.scaling().background);
    let range = [fitter.scaling().range.0, fitter.scaling().range.1];
    let protocol =
        Protocol { offsets: random_offsets(2, 1), range, shell: case.config.loss.shell, threshold: 0.0 };
    let e = evaluate(&gpu, &splats, &field, &case.volume, &case.roi, &protocol).expect("an evaluation");

    let bricks = Bricks::around(&case.roi, case.config.loss.shell);
    let samples = Sampler::new(&gpu, &splats, &field, &bricks)
        .and_then(|mut sampler| sampler.sample([0.0; 3]))
        .expect("samples");
    let active: Vec<usize> =
        (0..samples.len()).filter(|&i| bricks.is_active(i / SAMPLES, i % SAMPLES)).collect();
    let probes: Vec<_> = (0..PROBES).map(|k| samples[active[k * active.len() / PROBES]]).collect();
    let mut histogram = [0.0; CLASSES.len() + 1];
    for &i in &active {
        let voxel = bricks.voxel(i / SAMPLES, i % SAMPLES).as_uvec3().to_array().map(|v| v as usize);
        if case.roi.weight[case.volume.index(voxel[0], voxel[1], voxel[2])] > 0.0 {
            histogram[CLASSES.partition_point(|&end| end <= samples[i].hu)] += 1.0;
        }
    }

    let exact = Bound::new(0.0, 0.0);
    // The golden text is lavapipe's; SwiftShader's exponentials round otherwise, and after the fit that is 2.3 %.
    // O is held but weakly: samples of it wander further than its mean.
    let near = Bound::new(0.0, 0.03);
    let rows = [
        GoldenRow::new("splats", exact, [splats.len() as f64]),
        GoldenRow::new("roi_voxels", exact, [case.roi.voxel_count() as f64]),
        GoldenRow::new("samples", exact, [active.len() as f64]),
        GoldenRow::new("background_hu", Bound::new(1e-3, 0.0), [f64::from(field.background)]),
        GoldenRow::new("mmse_on_grid", near, [e.on_grid.mmse]),
        GoldenRow::new("mmse_between", near, e.between.iter().map(|m| m.mmse)),
        GoldenRow::new("occupancy_rmse", near, [e.on_grid.occupancy_rmse, e.occupancy_rmse()]),
        GoldenRow::new("soft_dice", Bound::new(0.005, 0.0), [e.on_grid.soft_dice]),
        GoldenRow::new("curve_mse", near, curve.iter().map(|p| p.mse)),
        GoldenRow::new("curve_occupancy", near, curve.iter().map(|p| p.occupancy_rmse)),
        GoldenRow::new("histogram", Bound::new(3.0, 0.03), histogram),
        GoldenRow::new(
            "probe_hu",
            Bound::new(8.0, 0.0).outliers(0.08, 100.0),
            probes.iter().map(|s| f64::from(s.hu)),
        ),
        GoldenRow::new(
            "probe_occupancy",
            Bound::new(0.02, 0.0).outliers(0.08, 0.1),
            probes.iter().map(|s| f64::from(s.occupancy)),
        ),
    ];
    check(name, &rows);
}
