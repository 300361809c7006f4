//! Fits whose number of splats follows from an error that they are to reach.

use std::ops::ControlFlow;

use engine::fit::{self, FitConfig, Goal, Going, Problem, to_the_end};
use vgs_tests::Device;
use vgs_tests::fitting::Case;

fn case(config: FitConfig) -> Case {
    let case = Case::phantom([34, 32, 30], 120);
    Case { config: FitConfig { iterations: 120, ..config }, ..case }
}

fn goal_of(case: &Case) -> Goal {
    let (low, high) = case.volume.min_max().expect("a range");
    Goal::of(&case.config, [low, high], 0.0).expect("a goal")
}

#[test]
fn a_fit_reaches_its_goal_with_splats_in_proportion() {
    let gpu = Device::boot();
    let mut counts = Vec::new();
    for target in [30.0, 36.0] {
        for by_hu in [false, true] {
            // 3.3 root mean square errors hold 99 % of the voxels of this phantom; the figure need not be exact.
            let span = 4095.0;
            let hu = span * 10f32.powf(-target / 20.0) * 3.3;
            let config = if by_hu {
                FitConfig::default().with(|c| c.count.target_hu = hu)
            } else {
                FitConfig::default().with(|c| c.count.target_psnr = target)
            };
            let case = case(config);
            let set = fit::run(&gpu, &case.volume, &case.roi, &case.config, |_| ControlFlow::Continue(()))
                .expect("a fit");
            let problem = Problem::new(&case.volume, &case.roi, &case.config).expect("a problem");
            let splats = set.to_voxel(&case.volume.world_from_voxel);
            let goal = goal_of(&case);
            let found = problem.at_voxels(&gpu, &goal, &splats).expect("figures");
            let surplus = goal.surplus_of(&found);
            println!(
                "{target} dB, by HU {by_hu}: {} splats, {surplus:+.2} dB ({:.2} dB, {:.1} HU)",
                splats.len(),
                found.psnr_db,
                found.p99_hu
            );
            // Rows of the file are f32, so what was reached by a hair in the fit may be missed by one in the file.
            assert!(surplus > -0.05, "{surplus} dB with {} splats", splats.len());
            counts.push(splats.len());
        }
    }
    assert!(counts[2] > counts[0] && counts[3] > counts[1], "more splats for less error: {counts:?}");
}

#[test]
fn a_goal_out_of_reach_takes_the_most_splats_there_may_be() {
    let gpu = Device::boot();
    let config = FitConfig::default().with(|c| {
        c.count.target_psnr = 200.0;
        c.count.max = 150;
    });
    let case = case(config);
    let set = fit::run(&gpu, &case.volume, &case.roi, &case.config, |_| ControlFlow::Continue(()))
        .expect("a fit that has missed its goal is a fit");
    assert_eq!(set.splats.len(), 150);
}

#[test]
fn trials_have_the_same_answer_twice_and_end_when_they_are_told_to() {
    let gpu = Device::boot();
    let case = case(FitConfig::default().with(|c| c.count.target_psnr = 33.0));
    let problem = Problem::new(&case.volume, &case.roi, &case.config).expect("a problem");
    let goal = goal_of(&case);
    let count = |going: &mut Going<'_>| {
        let mut trials = 0;
        let count = problem.count_for(&gpu, &goal, 0.0, &mut |_| trials += 1, going).expect("a number");
        (count, trials)
    };
    let found = count(&mut to_the_end);
    assert_eq!(found, count(&mut to_the_end), "the same seed");
    assert!((1..=3).contains(&found.1), "{found:?}");
    let mut parts = Vec::new();
    let heard = count(&mut |part| {
        parts.push(part);
        ControlFlow::Continue(())
    });
    assert_eq!(heard, found, "hearing of it changes nothing");
    assert!(parts.len() >= 10 * found.1 && parts[0] == 0.0, "{parts:?}");
    assert!(parts.windows(2).all(|pair| pair[0] <= pair[1] && pair[1] <= 1.0), "it only rises: {parts:?}");
    assert_eq!(count(&mut |_| ControlFlow::Break(())).1, 1, "told to end at once");
}

/// Of the same splats, those that aim at an error of nearly all voxels have fewer large ones.
#[test]
fn a_fit_that_aims_at_nearly_all_voxels_spares_few() {
    let gpu = Device::boot();
    let goal = Goal { psnr_db: Some(0.0), p99_hu: None, range: [-1024.0, 3071.0], threshold: 0.0 };
    let p99 = |target_hu: f32| {
        let case = case(FitConfig::default().with(|c| {
            c.count.target_hu = target_hu;
            c.count.splats = 200;
        }));
        let splats = case.fit(&gpu).splats().expect("splats");
        let problem = Problem::new(&case.volume, &case.roi, &case.config).expect("a problem");
        problem.at_voxels(&gpu, &goal, &splats).expect("figures").p99_hu
    };
    let (plain, aimed) = (p99(0.0), p99(60.0));
    assert!(aimed < 0.95 * plain, "99 % within {aimed} HU; {plain} without an aim");
}

#[test]
fn a_number_is_changed_in_both_directions() {
    let gpu = Device::boot();
    let case = case(FitConfig::default().with(|c| c.count.splats = 300));
    let splats = case.fit(&gpu).splats().expect("splats");
    let problem = Problem::new(&case.volume, &case.roi, &case.config).expect("a problem");
    let with = |count| problem.with_count(&gpu, &splats, count, &mut to_the_end).expect("splats");
    let goal = Goal { psnr_db: Some(0.0), p99_hu: None, range: [-1024.0, 3071.0], threshold: 0.0 };
    let psnr = |splats: &[_]| problem.at_voxels(&gpu, &goal, splats).expect("figures").psnr_db;
    let [fewer, same, more] = [200, 300, 400].map(|count| {
        let changed = with(count);
        assert_eq!(changed.len(), count);
        assert!(changed == with(count), "the same bits twice");
        psnr(&changed)
    });
    let before = psnr(&splats);
    println!("300: {before:.2} dB; 200, 300, 400 afterwards: {fewer:.2}, {same:.2}, {more:.2}");
    assert!(same > before - 0.2, "fitting again does not spoil a fit: {before}, {same}");
    assert!(fewer < same && same < more, "{fewer}, {same}, {more}");
    assert!(fewer > before - 6.0, "a third of the splats can go: {before}, {fewer}");
}

#[test]
fn what_does_not_go_with_a_goal_is_refused() {
    let changes: [fn(&mut FitConfig); 5] = [
        |c| c.samples.working_grid = 2,
        |c| c.topology.name = "densify".into(),
        |c| c.rates.mean = 1e-4,
        |c| c.count.target_hu = f32::NAN,
        |c| c.count.target_psnr = -1.0,
    ];
    for change in changes {
        let config = FitConfig::default().with(|c| c.count.target_hu = 10.0).with(change);
        assert!(config.check().is_err_and(|e| e.code == "VGS-CFG-001"), "{config:?}");
    }
}
