//! Coarser grids: the downsampled baseline on real data, and fits on a working grid.

use std::ops::ControlFlow;
use std::path::Path;

use engine::fit::evaluate::{Evaluation, Protocol, evaluate};
use engine::fit::{self, FitConfig, Progress, Scaling};
use engine::gpu::Gpu;
use engine::volume::resample::{AREA, Downsampling, LINEAR, downsampling_loss};
use engine::volume::{LabelChoice, ReadOptions, Roi, Volume};
use glam::{DAffine3, DMat3, DVec3};
use vgs_tests::Device;
use vgs_tests::fitting::Case;

/// Rows of the table in the data's description: mask, whether the range is the window -1000 to 1000 HU (and not that of
/// the whole volume), factor, method, PSNR in dB.
type Row = (&'static str, bool, usize, Downsampling, f64);

fn check(case: &str, rows: &[Row]) {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")).join(case);
    if !folder.is_dir() {
        println!("SKIPPED: no real data: ../shared/data/{case} is not there");
        return;
    }
    let read = |name: &str| {
        Volume::read(folder.join(format!("{name}.nii.gz")), &ReadOptions::default()).expect("a volume")
    };
    let volume = read("ct");
    let whole = volume.min_max().expect("samples");
    for &(mask, window, factor, how, expected_db) in rows {
        let roi = Roi::from_mask(&read(mask), &LabelChoice::Whole, &volume).expect("a region");
        let range = if window { [-1000.0, 1000.0] } else { [whole.0, whole.1] };
        let db = downsampling_loss(&volume, &roi, factor, &how, range).psnr_db;
        println!("{case} {mask} {range:?} ×{factor} {}: {db:.3} dB, expected {expected_db}", how.name);
        assert!((db - expected_db).abs() <= 0.01, "{case} {mask} ×{factor} {}: {db} dB", how.name);
    }
}

#[test]
fn the_baseline_is_that_of_the_table() {
    check(
        "ct-torso-tiny",
        &[
            ("mask_ts", false, 2, AREA, 27.98),
            ("mask_ts", false, 4, AREA, 24.35),
            ("mask_ts", false, 4, LINEAR, 24.58),
            ("mask_ts", true, 2, LINEAR, 26.76),
            ("mask_ts", true, 4, AREA, 23.12),
            ("mask_ts", true, 4, LINEAR, 23.35),
            ("mask_liver_soft", false, 2, AREA, 36.75),
            ("mask_liver_soft", true, 4, LINEAR, 32.16),
        ],
    );
    check(
        "ct-torso-3mm",
        &[
            ("mask_bones", false, 2, AREA, 28.05),
            ("mask_bones", false, 4, AREA, 25.30),
            ("mask_bones", false, 4, LINEAR, 25.53),
            ("mask_bones", true, 2, LINEAR, 22.45),
            ("mask_bones", true, 4, AREA, 20.11),
            ("mask_bones", true, 4, LINEAR, 20.28),
        ],
    );
}

/// Fits on the working grid, takes the splats through the world, and evaluates in `judged` on the native grid.
fn native_evaluation(gpu: &Gpu, case: &Case, judged: &Roi) -> Evaluation {
    let go_on = |_: &Progress| ControlFlow::Continue(());
    let set = fit::run(gpu, &case.volume, &case.roi, &case.config, go_on).expect("a fit");
    let (low, high) = Scaling::new(&case.volume, &case.roi, &case.config).range;
    evaluate(
        gpu,
        &set.to_voxel(&case.volume.world_from_voxel),
        &set.field,
        &case.volume,
        judged,
        &Protocol { offsets: vec![], range: [low, high], shell: case.config.loss.shell, threshold: 0.0 },
    )
    .expect("an evaluation")
}

#[test]
fn a_phantom_fitted_on_a_working_grid_is_right_on_the_native_one() {
    let gpu = Device::boot();
    let mut case = Case::phantom([40, 36, 40], 100);
    case.config.samples.working_grid = 2;
    let e = native_evaluation(&gpu, &case, &case.roi);
    let loss = downsampling_loss(&case.volume, &case.roi, 2, &AREA, e.range);
    println!("{:.2} dB; means of 2³ voxels, back linearly: {:.2} dB", e.on_grid.psnr_db, loss.psnr_db);
    // The fit cannot know more than the grid that it was made on, and should not know much less.
    assert!(e.on_grid.psnr_db > loss.psnr_db - 1.0, "{} dB after {}", e.on_grid.psnr_db, loss.psnr_db);
    assert!(e.on_grid.soft_dice > 0.8, "soft Dice {}", e.on_grid.soft_dice);
}

#[test]
fn a_ramp_fitted_on_a_working_grid_stays_the_ramp() {
    let gpu = Device::boot();
    let n = 24;
    let affine = DAffine3::from_mat3_translation(
        DMat3::from_rotation_x(0.4) * DMat3::from_diagonal(DVec3::new(-0.8, 0.8, 2.0)),
        DVec3::new(10.0, -200.0, 500.0),
    );
    let at = |i: usize| DVec3::new((i % n) as f64, (i / n % n) as f64, (i / (n * n)) as f64);
    let slope = DVec3::new(20.0, 15.0, 10.0);
    let samples = (0..n * n * n).map(|i| slope.dot(at(i)) as f32).collect();
    let volume = Volume::new([n; 3], affine, samples);
    let cube = |low: f64, end: f64| {
        let inside = |p: DVec3| p.cmpge(DVec3::splat(low)).all() && p.cmplt(DVec3::splat(end)).all();
        let weight = (0..n * n * n).map(|i| f32::from(u8::from(inside(at(i))))).collect();
        Roi::new(weight, &volume).expect("a cube")
    };
    // At the border of the region the means of blocks do not reach the values of the outermost voxels.
    let (roi, judged) = (cube(4.0, 20.0), cube(8.0, 16.0));
    for factor in [2, 4] {
        let config = FitConfig::default().with(|c| {
            c.samples.working_grid = factor;
            c.count.splats = 400;
            c.iterations = 150;
        });
        let case = Case { volume: volume.clone(), roi: roi.clone(), config };
        let e = native_evaluation(&gpu, &case, &judged);
        println!("factor {factor}: {:.3} HU", e.on_grid.rmse_hu);
        // Half a voxel beside its place the ramp is off by 13 HU.
        assert!(e.on_grid.rmse_hu < 3.0, "factor {factor}: off by {} HU", e.on_grid.rmse_hu);
    }
}
