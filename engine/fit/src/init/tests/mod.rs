//! Tests of count, place, spacing, orientation and repeatability of the first splats.

mod orientation;
mod uniform;

use glam::{DAffine3, DVec3};
use rand::SeedableRng;
use rand_pcg::Pcg64;

use super::*;
use crate::{FitConfig, ScaleUnit};
use splat::activation::{Activations, rotation_matrix};
use splat::defect;

fn initialise(volume: &Volume, roi: &Roi, count: usize, seed: u64, init: &Init) -> Vec<Splat> {
    gradient::initialise(volume, roi, count, seed, init, None)
}

fn volume(size: [usize; 3], hu: impl Fn(usize, usize, usize) -> f32) -> Volume {
    let mut samples = Vec::new();
    for z in 0..size[2] {
        for y in 0..size[1] {
            samples.extend((0..size[0]).map(|x| hu(x, y, z)));
        }
    }
    Volume::new(size, DAffine3::IDENTITY, samples)
}

fn region(size: [usize; 3], weight: impl Fn(usize, usize, usize) -> f32) -> Roi {
    let weight = volume(size, weight).samples;
    let soft = weight.iter().any(|&w| w > 0.0 && w < 1.0);
    Roi { size, weight, soft }
}

/// Creates a bright ball with an even inside, in an even outside.
fn ball(size: [usize; 3]) -> Volume {
    let centre = size.map(|n| n as f32 / 2.0);
    volume(size, |x, y, z| {
        let d = [x as f32 - centre[0], y as f32 - centre[1], z as f32 - centre[2]];
        let r = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        1000.0 / (1.0 + (2.0 * (r - centre[0] * 0.6)).exp()) - 500.0
    })
}

fn nearest_distances(splats: &[Splat]) -> Vec<f32> {
    let mut grid = PointGrid::new(2.0, splats.len());
    splats.iter().for_each(|splat| grid.insert(splat.mean));
    let mut distances: Vec<f32> = (0..splats.len())
        .map(|i| {
            let [d]: [f32; 1] = grid.nearest_squared(i, 1e9);
            d.sqrt()
        })
        .collect();
    distances.sort_by(f32::total_cmp);
    distances
}

#[test]
fn after_the_deadline_splats_are_placed_at_random() {
    let size = [24; 3];
    let (volume, roi) = (ball(size), region(size, |_, _, _| 1.0));
    let mut least = Vec::new();
    for deadline in [None, Some(Instant::now())] {
        let splats = gradient::initialise(&volume, &roi, 300, 3, &Init::default(), deadline);
        assert_eq!(splats.len(), 300);
        assert!(splats.iter().all(|splat| defect(splat).is_none()));
        least.push(nearest_distances(&splats).into_iter().fold(f32::INFINITY, f32::min));
    }
    assert!(least[1] < 0.5 * least[0], "spaced, and at random: {least:?}");
}

#[test]
fn the_count_is_exact_and_every_splat_lies_in_the_region() {
    let init = Init::default();
    let everywhere = |size| region(size, |_, _, _| 1.0);
    let cube = [12, 10, 8];
    // Name, volume, region, counts.
    let rows = [
        ("constant", volume(cube, |_, _, _| 40.0), everywhere(cube), vec![1, 2, 7, 960, 5000]),
        ("ball", ball(cube), everywhere(cube), vec![1, 100, 2000]),
        (
            "one voxel",
            ball(cube),
            region(cube, |x, y, z| f32::from(x == 3 && y == 9 && z == 0)),
            vec![1, 5, 3000],
        ),
        ("1 × 1 × 1", volume([1; 3], |_, _, _| -1024.0), everywhere([1; 3]), vec![1, 4, 100]),
        ("one slice", ball([20, 20, 1]), everywhere([20, 20, 1]), vec![1, 100, 1000]),
        ("one line", ball([1, 1, 30]), everywhere([1, 1, 30]), vec![10]),
        (
            "two corners",
            ball(cube),
            region(cube, |x, y, z| f32::from(x + y + z == 0 || x + y + z == 27)),
            vec![9],
        ),
        ("soft", ball(cube), region(cube, |x, _, _| x as f32 / 11.0), vec![300]),
        (
            "weights out of range",
            ball(cube),
            region(cube, |x, _, _| [f32::NAN, -1.0, 1e30, 1e-30][x % 4]),
            vec![300],
        ),
        (
            "samples that are not finite",
            volume(cube, |x, y, _| [f32::NAN, f32::INFINITY, 3.0, -1.0][(x + y) % 4]),
            everywhere(cube),
            vec![300],
        ),
        ("huge samples", volume(cube, |x, _, _| [1e30, -1e30][x % 2]), everywhere(cube), vec![300]),
    ];
    for (name, volume, roi, counts) in rows {
        for count in counts {
            let splats = initialise(&volume, &roi, count, 5, &init);
            assert_eq!(splats.len(), count, "{name}");
            for splat in &splats {
                assert_eq!(defect(splat), None, "{name}: {splat:?}");
                let voxel: [usize; 3] =
                    std::array::from_fn(|k| (splat.mean[k].round().max(0.0) as usize).min(roi.size[k] - 1));
                // A point on a voxel's wall may round to its neighbour.
                let near = (0..3).any(|k| (splat.mean[k].fract().abs() - 0.5).abs() < 1e-4);
                let weight = roi.weight[voxel[0] + roi.size[0] * (voxel[1] + roi.size[1] * voxel[2])];
                assert!(weight > 0.0 || near, "{name}: {:?} has weight {weight}", splat.mean);
                assert!(splat.mean.iter().zip(roi.size).all(|(&x, n)| x >= -0.5 && x <= n as f32 - 0.5));
                assert_eq!(splat.opacity_logit, 0.0, "{name}: opacity ½");
                for scale in splat.scale() {
                    let (least, most) = (init.scale_min / init.anisotropy, init.scale_max * 1.2248);
                    assert!(scale > 0.999 * least && scale < 1.001 * most, "{name}: scale {scale}");
                }
            }
        }
    }
}

#[test]
fn nothing_comes_of_nothing() {
    let size = [4, 4, 4];
    let init = Init::default();
    assert!(initialise(&ball(size), &region(size, |_, _, _| 0.0), 10, 0, &init).is_empty());
    assert!(initialise(&ball(size), &region(size, |_, _, _| 1.0), 0, 0, &init).is_empty());
    let empty = [0, 4, 4];
    assert!(initialise(&volume(empty, |_, _, _| 0.0), &region(empty, |_, _, _| 1.0), 3, 0, &init).is_empty());
}

#[test]
fn the_seed_decides_and_the_threads_do_not() {
    let size = [24, 24, 24];
    let (volume, roi) = (ball(size), region(size, |x, _, _| f32::from(x > 4)));
    let run = |seed, threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| initialise(&volume, &roi, 700, seed, &Init::default()))
    };
    let first = run(1, 1);
    for threads in [1, 2, 5] {
        let again = run(1, threads);
        assert_eq!(
            bytemuck::cast_slice::<_, u32>(&first),
            bytemuck::cast_slice::<_, u32>(&again),
            "{threads}"
        );
    }
    assert_ne!(first, run(2, 1));
}

#[test]
fn points_keep_apart() {
    let size = [32, 32, 32];
    let (volume, roi) = (volume(size, |_, _, _| 0.0), region(size, |_, _, _| 1.0));
    let count = 3000;
    // This is the spacing of an even density, (voxels / count)^⅓.
    let spacing = (32.0f32.powi(3) / count as f32).cbrt();
    let blue = nearest_distances(&initialise(&volume, &roi, count, 3, &Init::default()));
    let mut rng = Pcg64::seed_from_u64(3);
    let random: Vec<Splat> = (0..count)
        .map(|_| Splat {
            mean: std::array::from_fn(|_| 32.0 * rand::RngExt::random::<f32>(&mut rng)),
            ..Splat::default()
        })
        .collect();
    let random = nearest_distances(&random);
    // Least distance and first percentile, in units of the spacing. Independent points have 0.55·(i/n)^⅓ or
    // so.
    assert!(blue[0] > 0.5 * spacing, "least distance {}", blue[0] / spacing);
    assert!(random[0] < 0.15 * spacing, "least random distance {}", random[0] / spacing);
    assert!(blue[count / 100] > 4.0 * random[count / 100]);
}

#[test]
fn splats_gather_at_edges_and_lie_in_them() {
    let size = [40, 30, 30];
    // An oblique plane edge.
    let normal = DVec3::new(2.0, 1.0, -1.0).normalize();
    let depth = |x: f64, y: f64, z: f64| normal.dot(DVec3::new(x - 20.0, y - 15.0, z - 15.0));
    let edge = volume(size, |x, y, z| 500.0 * depth(x as f64, y as f64, z as f64).tanh() as f32);
    let roi = region(size, |_, _, _| 1.0);
    let splats = initialise(&edge, &roi, 4000, 7, &Init::default());
    let at = |splat: &Splat| depth(splat.mean[0].into(), splat.mean[1].into(), splat.mean[2].into());

    let share = |splats: &[Splat]| splats.iter().filter(|s| at(s).abs() < 1.5).count() as f64 / 4000.0;
    let uniform = Init { gradient_exponent: 0.0, ..Init::default() };
    let even = share(&initialise(&edge, &roi, 4000, 7, &uniform));
    assert!(share(&splats) > 2.5 * even, "{} at the edge, {even} of an even density", share(&splats));

    // At the border the smoothing goes on with the outermost samples, which bends the gradient.
    let inside = |splat: &&Splat| (0..3).all(|k| (4.0..size[k] as f32 - 5.0).contains(&splat.mean[k]));
    for splat in splats.iter().filter(inside).filter(|splat| at(splat).abs() < 1.0) {
        let thin = rotation_matrix(splat.rotation).z_axis;
        assert!(thin.dot(normal).abs() > 0.98, "thin axis {thin} at {:?}", splat.mean);
        let [a, b, c] = splat.log_scale;
        assert!(a == b && (a - c - 1.5f32.ln() * 1.5).abs() < 1e-5);
        let expected = density::trilinear(&edge.samples, size, splat.mean);
        assert_eq!(splat.intensity, expected);
    }
    // Far from the edge there is no direction.
    let flat = volume(size, |_, _, _| 7.0);
    for splat in initialise(&flat, &roi, 500, 7, &Init::default()) {
        assert_eq!((splat.rotation, splat.intensity), ([1.0, 0.0, 0.0, 0.0], 7.0));
        assert!(splat.log_scale[0] == splat.log_scale[2]);
    }
}

#[test]
fn configurations_are_checked() {
    let wrong = |change: fn(&mut Init)| {
        let config = FitConfig::default().with(|c| change(&mut c.init));
        let message = config.check().err().map(|error| error.message).unwrap_or_default();
        message.split(' ').next().map(str::to_owned).unwrap_or_default()
    };
    assert_eq!(wrong(|_| ()), "");
    assert_eq!(wrong(|init| init.scale_max = 0.1), "scale_max");
    assert_eq!(wrong(|init| init.smoothing_sigma = f32::NAN), "smoothing_sigma");
    assert_eq!(wrong(|init| init.smoothing_sigma = 1e9), "smoothing_sigma");
    assert_eq!(wrong(|init| init.opacity = 1.5), "opacity");
    assert_eq!(wrong(|init| init.anisotropy = 0.0), "anisotropy");
}

#[test]
fn every_initialiser_has_a_name_of_its_own() {
    let usual = Init::default();
    assert_eq!((&*usual.initialiser, &*usual.orientation), (INITIALISERS[0].name, ORIENTATIONS[0].name));
    for (index, row) in INITIALISERS.iter().enumerate() {
        assert!(INITIALISERS[..index].iter().all(|other| other.name != row.name));
        let size = [6, 6, 6];
        let roi = region(size, |_, _, _| 1.0);
        assert_eq!((row.run)(&ball(size), &roi, 20, 0, &Init::default(), None).len(), 20, "{}", row.name);
    }
}
