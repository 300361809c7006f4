//! The panel of the error, and its colours.

use engine::fit::evaluate::Metrics;
use engine::volume::Volume;
use glam::DAffine3;

use super::*;

/// Creates an error that is 5.8 HU in the mean, in a region of two voxels.
fn error(other_volume: bool) -> ShownError {
    let figures = Metrics {
        offset: [0.0; 3],
        mmse: 1e-6,
        psnr_db: 60.0,
        rmse_hu: 8.0,
        mean_error_hu: 5.83,
        p99_hu: 27.4,
        occupancy_rmse: 0.0,
        soft_dice: 1.0,
        weight: 2.0,
        outline: Default::default(),
    };
    let map = Volume::new([3, 1, 1], DAffine3::IDENTITY, vec![-27.4, 10.0, f32::NAN]);
    ShownError::of(figures, " HU", map, other_volume)
}

#[test]
fn the_error_is_told_in_words() {
    let mut bench = Bench::new();
    bench.rest();
    assert_eq!(bench.place_of("Error"), None, "nothing to compare");
    bench.error = Some(error(false));
    bench.rest();
    bench.find("99 % of the voxels are within 27 HU; mean 5.8 HU");
    bench.find("2 voxels where the splats are, splats minus volume");
    let warning = "They were fitted to another volume, or to this one read differently.";
    assert_eq!(bench.place_of(warning), None);
    bench.error = Some(error(true));
    bench.rest();
    bench.find(warning);
}

#[test]
fn its_colours_are_switched_and_have_a_bar() {
    let mut bench = Bench::new();
    bench.error = Some(error(false));
    bench.rest();
    bench.app.take_changes();
    let at = bench.find("Colours in the picture");
    bench.click(at);
    assert!(bench.app.state.errors.picture && bench.app.take_changes().look);
    // Until the picture has them, the bar is that of the transfer function.
    let bar = "+50 HU too high";
    assert_eq!(bench.place_of(bar), None);
    bench.error_shown = true;
    bench.rest();
    assert!(bench.app.picture().contains(bench.find(bar)), "a round number above 27");
    let at = bench.find("Colours in the slices");
    bench.click(at);
    bench.app.state.slices.shown = true;
    bench.app.state.slices.at_mm = Some(DVec3::ZERO);
    bench.rest();
    bench.find("error -27.4 HU");
    bench.find("-50 HU, too low");
    bench.app.state.slices.at_mm = Some(DVec3::new(2.0, 0.0, 0.0));
    bench.rest();
    bench.find("no error here: outside the region");
}
