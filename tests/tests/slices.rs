//! What lies between thick slices, on real data: every second slice of a CT is left out, and made of its neighbours.

use std::path::Path;

use engine::volume::{Displacements, FinerSlices, LabelChoice, ReadOptions, Roi, Volume};
use glam::{DAffine3, DVec3};

/// Slices of each case that are compared, from the first one left out.
const SLICES: usize = 24;

/// Root mean square error (HU) in the region and Dice of the mask, of slices that were left out.
#[derive(Debug)]
struct Found {
    rmse_hu: f64,
    dice: f64,
}

/// Returns how near slices that were left out are to those made of their neighbours, and to the straight line between
/// these; nothing where the data are not at hand.
fn left_out(case: &str, mask: &str) -> Option<[Found; 2]> {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared/data")).join(case);
    if !folder.is_dir() {
        println!("SKIPPED: no real data: ../shared/data/{case} is not there");
        return None;
    }
    let read = |name: &str| {
        Volume::read(folder.join(format!("{name}.nii.gz")), &ReadOptions::default()).expect("a volume")
    };
    let whole = read("ct");
    let roi = Roi::from_mask(&read(mask), &LabelChoice::Whole, &whole).expect("a region");
    // From the middle of the scan on, where there is most of every mask.
    let first = [0, 0, whole.size[2] / 2 - SLICES];
    let size = [whole.size[0], whole.size[1], 2 * SLICES + 1];
    let (mut whole, roi) = (whole.cropped(first, size), roi.cropped(first, size));
    whole.samples.iter_mut().for_each(|v| *v = v.clamp(-1024.0, 3071.0));
    let plane = size[0] * size[1];
    let half = |values: &[f32]| -> Vec<f32> { values.chunks(plane).step_by(2).flatten().copied().collect() };
    let thick = DAffine3::from_scale(DVec3::new(1.0, 1.0, 2.0));
    let coarse =
        Volume::new([size[0], size[1], SLICES + 1], whole.world_from_voxel * thick, half(&whole.samples));
    let coarse_roi = Roi { size: coarse.size, weight: half(&roi.weight), soft: false };
    let finer = FinerSlices::of(coarse.size, &coarse.world_from_voxel).expect("thick slices");
    let along = Displacements::of(&finer, &coarse);
    let fine = finer.volume(&coarse, None, &along);
    let fine_roi = finer.roi(&coarse_roi, &fine, &along);
    // A slice half-way has one of the finer grid where the factor is even.
    assert_eq!(finer.factor() % 2, 0, "{}", finer.factor());
    let step = finer.factor();
    let between = |made: &dyn Fn(usize, usize) -> (f32, bool)| {
        let (mut squares, mut count, mut both, mut sum) = (0.0, 0.0, 0.0, 0.0);
        for slice in 0..SLICES {
            for pixel in 0..plane {
                let at = (2 * slice + 1) * plane + pixel;
                let (v, inside) = made(slice, pixel);
                let is_in = roi.weight[at] > 0.0;
                if is_in {
                    squares += f64::from(v - whole.samples[at]).powi(2);
                    count += 1.0;
                }
                both += f64::from(u8::from(inside && is_in));
                sum += f64::from(u8::from(inside)) + f64::from(u8::from(is_in));
            }
        }
        Found { rmse_hu: (squares / f64::max(count, 1.0)).sqrt(), dice: 2.0 * both / f64::max(sum, 1.0) }
    };
    let made = between(&|slice, pixel| {
        let at = (slice * step + step / 2) * plane + pixel;
        (fine.samples[at], fine_roi.weight[at] > 0.0)
    });
    let linear = between(&|slice, pixel| {
        let [a, b] = [slice * plane + pixel, (slice + 1) * plane + pixel];
        let v = 0.5 * (coarse.samples[a] + coarse.samples[b]);
        (v, coarse_roi.weight[a] + coarse_roi.weight[b] >= 1.0)
    });
    println!("{case} {mask}: {made:?}, linear {linear:?}");
    Some([made, linear])
}

#[test]
fn slices_that_were_left_out_are_nearer_than_by_a_straight_line() {
    for (case, mask) in [("ct-abdomen-full", "mask_bones"), ("ct-abdomen-full", "mask_liver")] {
        let Some([made, linear]) = left_out(case, mask) else { continue };
        assert!(made.rmse_hu < 0.9 * linear.rmse_hu, "{case} {mask}: {made:?}, linear {linear:?}");
        assert!(made.dice > linear.dice, "{case} {mask}: {made:?}, linear {linear:?}");
    }
}
