//! Tests of the paper's initialisation: where splats lie, how large they are, and what they take from the
//! volume.

use super::*;
use crate::init::uniform;

const SIZE: [usize; 3] = [16, 14, 12];

fn paper() -> Init {
    Init { scale_min: 1.5, scale_max: 4.0, opacity: 0.1, ..Init::default() }
}

/// Returns the greatest distance between the distribution of `values` and the uniform one from `low` to
/// `high` (Kolmogorov-Smirnov), times the root of their number: beyond 1.95 once in a thousand.
fn distance_from_uniform(mut values: Vec<f32>, low: f32, high: f32) -> f32 {
    values.sort_by(f32::total_cmp);
    let n = values.len() as f32;
    let apart = |(i, v): (usize, &f32)| {
        let expected = (v - low) / (high - low);
        (expected - i as f32 / n).abs().max((expected - (i + 1) as f32 / n).abs())
    };
    values.iter().enumerate().map(apart).fold(0.0, f32::max) * n.sqrt()
}

#[test]
fn the_mask_is_the_probability_and_means_fill_their_voxels() {
    // Weights of 0, 0.1 ... 1, some voxels at the border of the volume.
    let roi = region(SIZE, |x, y, z| ((x * 7 + y * 5 + z * 3) % 11) as f32 / 10.0);
    let count = 200_000;
    let splats = uniform::initialise(&ball(SIZE), &roi, count, 11, &paper());
    assert_eq!(splats.len(), count);
    let total = roi.weight_sum();
    let mut found = vec![0.0f64; roi.weight.len()];
    for splat in &splats {
        let voxel = splat.mean.map(|m| (m + 0.5).floor() as usize);
        assert!(splat.mean.iter().zip(SIZE).all(|(&m, n)| m >= -0.5 && m <= n as f32 - 0.5));
        // A mean on a voxel's wall may count as its neighbour's; there are a handful at most.
        found[(0..3).rev().fold(0, |i, k| i * SIZE[k] + voxel[k].min(SIZE[k] - 1))] += 1.0;
    }
    let mut chi_square = 0.0;
    let mut free = -1.0;
    for (found, &weight) in found.iter().zip(&roi.weight) {
        let expected = count as f64 * f64::from(weight) / total;
        if expected > 0.0 {
            chi_square += (found - expected).powi(2) / expected;
            free += 1.0;
        } else {
            assert!(*found < 3.0, "{found} splats in a voxel outside the region");
        }
    }
    // Mean `free`, standard deviation √(2 free).
    let deviations = (chi_square - free) / (2.0f64 * free).sqrt();
    assert!(deviations.abs() < 4.0, "χ² is {chi_square} of {free}");
    for k in 0..3 {
        let within = splats.iter().map(|s| s.mean[k] + 0.5 - (s.mean[k] + 0.5).floor()).collect();
        let distance = distance_from_uniform(within, 0.0, 1.0);
        assert!(distance < 1.95, "along axis {k} means are not even in their voxels: {distance}");
    }
}

#[test]
fn scales_are_uniform_in_voxels_or_in_the_mean_spacing() {
    let count = 20_000;
    let roi = region(SIZE, |_, _, _| 1.0);
    // A slab of 0.8 × 0.8 × 2 mm; the mean is 1.2 mm.
    let mut slab = ball(SIZE);
    slab.world_from_voxel = DAffine3::from_scale(DVec3::new(0.8, 0.8, 2.0));
    for (unit, factor) in
        [(ScaleUnit::Voxel, [1.0; 3]), (ScaleUnit::Spacing, [1.2 / 0.8, 1.2 / 0.8, 1.2 / 2.0])]
    {
        let init = Init { orientation: "none".to_owned(), unit, ..paper() };
        let splats = uniform::initialise(&slab, &roi, count, 3, &init);
        for (k, factor) in factor.iter().enumerate() {
            let scales: Vec<f32> = splats.iter().map(|s| s.scale()[k] / factor).collect();
            assert!(scales.iter().all(|s| (1.4999..4.0001).contains(s)), "{unit:?}");
            let distance = distance_from_uniform(scales, 1.5, 4.0);
            assert!(distance < 1.95, "{unit:?}, axis {k}: {distance} from uniform");
        }
        // Not one draw for all three axes.
        let alike = splats.iter().filter(|s| (s.scale()[0] / s.scale()[1] - 1.0).abs() < 0.01).count();
        assert!(alike < count / 20, "{unit:?}: {alike} splats are round");
        assert!(
            splats.iter().all(|s| s.rotation == [1.0, 0.0, 0.0, 0.0] && (s.opacity() - 0.1).abs() < 1e-6)
        );
    }
    // One scale for all.
    let fixed = Init { scale_min: 2.0, scale_max: 2.0, ..paper() };
    assert!(
        uniform::initialise(&slab, &roi, 100, 3, &fixed)
            .iter()
            .all(|s| s.log_scale.iter().all(|l| (l - 2.0f32.ln()).abs() < 1e-6))
    );
}

#[test]
fn millimetre_splats_lie_within_the_clamp_of_the_fit() {
    use crate::FitConfig;
    let config = FitConfig::default().with(|c| {
        c.init.unit = ScaleUnit::Spacing;
        c.scales.min = 1.5;
        c.scales.max = 10.0;
        c.init.scale_min = 1.5;
        c.init.scale_max = 10.0;
    });
    let mut slab = ball(SIZE);
    slab.world_from_voxel = DAffine3::from_mat3(
        glam::DMat3::from_axis_angle(DVec3::new(1.0, 1.0, 0.2).normalize(), 0.7)
            * glam::DMat3::from_diagonal(DVec3::new(0.7, -0.9, 2.5)),
    );
    let mean = (0.7 + 0.9 + 2.5) / 3.0;
    let (low, high) = config.scale_clamp(&slab);
    assert!(
        (low - (1.5 * mean / 2.5) as f32).abs() < 1e-6 && (high - (10.0 * mean / 0.7) as f32).abs() < 1e-5
    );
    let splats = uniform::initialise(&slab, &region(SIZE, |_, _, _| 1.0), 4000, 3, &config.init);
    let scales = || splats.iter().flat_map(|s| s.scale());
    assert!(scales().all(|s| s > 0.9999 * low && s < 1.0001 * high));
    // Some come near both ends: the box is no wider than need be.
    assert!(scales().any(|s| s < 1.5 * low) && scales().any(|s| s > 0.7 * high));
    let voxel = config.with(|c| c.init.unit = ScaleUnit::Voxel);
    assert_eq!(voxel.scale_clamp(&slab), (1.5, 10.0));
}

#[test]
fn intensities_are_of_the_mean_or_of_the_footprint() {
    let size = [24, 20, 18];
    let mut rough = volume(size, |x, y, z| ((x * 31 + y * 17 + z * 7) % 101) as f32);
    for i in (0..rough.len()).step_by(13) {
        rough.samples[i] = f32::NAN;
    }
    let roi = Roi::new(vec![1.0; rough.len()], &rough).expect("a region");
    let run = |footprint| uniform::initialise(&rough, &roi, 3000, 5, &Init { footprint, ..paper() });
    let (at_mean, wide, some) = (run(0.0), run(0.01), run(2.6));
    let (mut near, mut averaged) = (0, 0);
    for ((at_mean, wide), some) in at_mean.iter().zip(&wide).zip(&some) {
        let centre = density::trilinear(&rough.samples, size, at_mean.mean);
        assert!(at_mean.intensity == centre || centre.is_nan());
        let geometric = at_mean.scale().iter().product::<f32>().cbrt();
        let expected = if geometric >= 2.6 { wide } else { at_mean };
        if (geometric - 2.6).abs() > 1e-4 {
            assert_eq!(some.intensity, expected.intensity, "of scale {geometric}");
        }
        averaged += usize::from(geometric >= 2.6);
        // The definition, over all voxels.
        let (mut sum, mut count) = (0.0, 0.0);
        let inverse = (wide.axes()
            * glam::DMat3::from_diagonal(DVec3::from_array(wide.scale().map(f64::from))))
        .inverse();
        let mut on_the_border = false;
        for (i, &v) in rough.samples.iter().enumerate() {
            let x = DVec3::new((i % 24) as f64, (i / 24 % 20) as f64, (i / 480) as f64);
            let q = (inverse * (x - DVec3::from_array(wide.mean.map(f64::from)))).length_squared();
            on_the_border |= (q - 1.0).abs() < 1e-9;
            if v.is_finite() && q <= 1.0 {
                sum += f64::from(v);
                count += 1.0;
            }
        }
        if count > 0.0 && !on_the_border {
            near += 1;
            let mean = (sum / count) as f32;
            assert!((wide.intensity - mean).abs() < 1e-3, "{} and not {mean}", wide.intensity);
        }
    }
    assert!(near > 2900 && (1000..2000).contains(&averaged), "{near}, {averaged}");
    // A splat between all voxel centres has no footprint.
    let tiny = Init { scale_min: 0.05, scale_max: 0.06, footprint: 0.01, ..paper() };
    let ball = ball(size);
    for splat in uniform::initialise(&ball, &region(size, |_, _, _| 1.0), 200, 5, &tiny) {
        let centre = density::trilinear(&ball.samples, size, splat.mean);
        assert!((splat.intensity - centre).abs() < 20.0, "{} and not {centre}", splat.intensity);
    }
}

#[test]
fn the_seed_decides_and_the_threads_do_not() {
    let roi = region(SIZE, |x, _, _| x as f32 / 15.0);
    let volume = ball(SIZE);
    for orientation in ORIENTATIONS {
        let orientation = orientation.name.to_owned();
        let config = Init { orientation, unit: ScaleUnit::Spacing, footprint: 2.0, ..paper() };
        let run = |seed, threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| uniform::initialise(&volume, &roi, 700, seed, &config))
        };
        let first = run(1, 1);
        for threads in [2, 5] {
            let again = run(1, threads);
            let bits = |splats: &[Splat]| bytemuck::cast_slice::<_, u32>(splats).to_vec();
            assert_eq!(bits(&first), bits(&again), "{}, {threads} threads", config.orientation);
        }
        assert_ne!(first, run(2, 1));
    }
}

#[test]
fn the_count_is_exact_however_small_the_region() {
    let one = region(SIZE, |x, y, z| 0.25 * f32::from(x == 3 && y == 13 && z == 0));
    for unit in [ScaleUnit::Voxel, ScaleUnit::Spacing] {
        for orientation in ORIENTATIONS {
            let orientation = orientation.name.to_owned();
            let config = Init { orientation, unit, ..paper() };
            for count in [0, 1, 7, 1000] {
                let splats = uniform::initialise(&ball(SIZE), &one, count, 0, &config);
                assert_eq!(splats.len(), count);
                for splat in splats {
                    assert_eq!(defect(&splat), None);
                    let off = [splat.mean[0] - 3.0, splat.mean[1] - 13.0, splat.mean[2]];
                    assert!(off.iter().all(|d| d.abs() <= 0.5), "{:?}", splat.mean);
                }
            }
        }
    }
    let none = region(SIZE, |_, _, _| 0.0);
    assert!(uniform::initialise(&ball(SIZE), &none, 10, 0, &paper()).is_empty());
}
