//! Sparse mini-batches, stopping and going on, and what happens between iterations.

use engine::fit::{FitState, Fitter};
use engine::splat::Splat;
use vgs_tests::Device;
use vgs_tests::fitting::Case;

const SIZE: [usize; 3] = [28, 26, 30];

fn case(iterations: u32) -> Case {
    let mut case = Case::phantom(SIZE, iterations);
    case.config.count.splats = 200;
    case
}

fn moved(a: &[Splat], b: &[Splat]) -> usize {
    a.iter().zip(b).filter(|(a, b)| a != b).count()
}

#[test]
fn a_subset_of_all_is_a_full_batch() {
    let gpu = Device::boot();
    let mut case = case(12);
    let full = case.fit(&gpu).splats().expect("splats");
    case.config.subset.size = 200;
    assert!(case.fit(&gpu).splats().expect("splats") == full);
}

#[test]
fn an_epoch_moves_every_splat_once() {
    let gpu = Device::boot();
    for alone in [true, false] {
        let mut case = case(8);
        // Four blocks of 50.
        case.config.subset.size = 60;
        case.config.subset.alone = alone;
        let mut fitter = case.fitter(&gpu, &case.start());
        let first = fitter.splats().expect("splats");
        let mut before = first.clone();
        let mut once = vec![0; first.len()];
        for turn in 1..=8 {
            case.run(&mut fitter, turn);
            let now = fitter.splats().expect("splats");
            assert_eq!(moved(&before, &now), 50, "iteration {turn}, alone {alone}");
            for (count, (a, b)) in once.iter_mut().zip(before.iter().zip(&now)) {
                *count += usize::from(a != b);
            }
            if turn == 4 {
                assert!(once.iter().all(|&count| count == 1), "{once:?}");
            }
            before = now;
        }
        assert!(once.iter().all(|&count| count == 2));
    }
}

/// Two hundred splats in blocks of 67: the last block shares a splat with the one before.
#[test]
fn blocks_that_do_not_divide_the_splats_reach_them_all() {
    let gpu = Device::boot();
    let mut case = case(3);
    case.config.subset.size = 67;
    let mut fitter = case.fitter(&gpu, &case.start());
    let first = fitter.splats().expect("splats");
    case.run(&mut fitter, 3);
    assert_eq!(moved(&first, &fitter.splats().expect("splats")), 200);
}

#[test]
fn the_figures_of_a_subset_are_those_of_all_splats() {
    let gpu = Device::boot();
    for alone in [true, false] {
        let mut case = case(40);
        case.config.subset.size = 50;
        case.config.subset.alone = alone;
        case.config.loss.rim_weight = 0.0; // which the figures on the way have, and those of the region do not
        case.config.rates.decay = 1e-6; // the last steps move next to nothing
        let mut fitter = case.fit(&gpu);
        let on_grid = case.on_grid_db(&gpu, &mut fitter);
        let progress = fitter.progress().expect("progress");
        println!("alone {alone}: {on_grid:.3} dB, on the way {:.3} dB", progress.psnr_db);
        assert!((progress.psnr_db - on_grid).abs() < 0.02, "{} for {on_grid}", progress.psnr_db);
    }
}

/// A part of the splats in a field of all of them is fitted well; a part alone is not, since each block is asked to be
/// the whole volume (docs/design/paper.md has the figures on a CT).
#[test]
fn a_subset_learns_in_the_field_of_all_splats() {
    let gpu = Device::boot();
    let mut case = case(60);
    case.config.subset.size = 50;
    let db = |case: &Case| {
        let mut fitter = case.fitter(&gpu, &case.start());
        let start = case.on_grid_db(&gpu, &mut fitter);
        case.run(&mut fitter, 60);
        case.on_grid_db(&gpu, &mut fitter) - start
    };
    case.config.subset.alone = false;
    let with_all = db(&case);
    case.config.subset.alone = true;
    let alone = db(&case);
    println!("gained in 60 iterations: {with_all:.2} dB with all splats, {alone:.2} dB alone");
    assert!(with_all > 1.0, "{with_all}");
    assert!(with_all > alone + 1.0, "{with_all} and {alone}");
}

#[test]
fn sampled_intensities_are_those_of_the_volume() {
    let gpu = Device::boot();
    let mut case = case(25);
    case.config.rates.learn_intensity = false;
    case.config.topology.every = 10;
    let mut fitter = case.fit(&gpu);
    let (low, high) = fitter.scaling().intensity_range;
    for s in fitter.splats().expect("splats") {
        let at = glam::Vec3::from_array(s.mean).as_dvec3();
        let wanted = (case.volume.trilinear(at) as f32).clamp(low, high);
        assert!((s.intensity - wanted).abs() < 1e-3, "{} for {wanted}", s.intensity);
    }
}

/// Stops a fit at each of `stops`, writes its state, and goes on from the file on a new device.
fn interrupted(case: &Case, stops: &[u32]) -> Vec<Splat> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("fit.state");
    let gpu = Device::boot();
    let mut fitter = case.fitter(&gpu, &case.start());
    case.run(&mut fitter, stops[0]);
    fitter.state().expect("a state").write(&path, "", true).expect("writing");
    drop(fitter);
    for &stop in stops[1..].iter().chain([&case.config.iterations]) {
        let gpu = Device::boot();
        let (state, _) = FitState::read(&path).expect("a state");
        let mut fitter =
            Fitter::resume(&gpu, &case.volume, &case.roi, &state, &case.config).expect("a fitter");
        case.run(&mut fitter, stop);
        fitter.state().expect("a state").write(&path, "", true).expect("writing");
    }
    let (state, _) = FitState::read(&path).expect("a state");
    assert_eq!(state.iteration, case.config.iterations);
    Fitter::resume(&gpu, &case.volume, &case.roi, &state, &case.config)
        .and_then(|mut fitter| fitter.splats())
        .expect("splats")
}

#[test]
fn a_fit_that_stopped_goes_on_to_the_same_bits() {
    let gpu = Device::boot();
    let mut rows = vec![case(24), case(24), case(24)];
    rows[1].config.subset.size = 60;
    rows[2].config.subset.size = 60;
    rows[2].config.subset.alone = false;
    rows[2].config.rates.learn_intensity = false;
    rows[2].config.topology.every = 5;
    for case in rows {
        let whole = case.fit(&gpu).splats().expect("splats");
        let what = format!("subset {}, alone {}", case.config.subset.size, case.config.subset.alone);
        assert!(interrupted(&case, &[1]) == whole, "{what}: stopped after 1");
        assert!(interrupted(&case, &[10, 15, 23]) == whole, "{what}: stopped three times");
    }
}
