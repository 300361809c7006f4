//! Tests of what each orientation cue finds in a plane and in a tube, in cubic and in oblong voxels.

use glam::{DMat3, DVec3};

use super::*;

const SIZE: [usize; 3] = [30, 28, 26];
/// Distances in these scenes are in units of the mean spacing, in which voxels are cubic or oblong.
const CUBIC: DVec3 = DVec3::ONE;
const OBLONG: DVec3 = DVec3::new(0.75, 0.75, 1.5);
/// Direction along the tube or across the plane.
const DIRECTION: DVec3 = DVec3::new(2.0, 1.0, -1.5);

/// Returns a grid that is turned against the world as scanners do it, left-handed.
fn affine(spacing_mm: DVec3) -> DAffine3 {
    let turn = DMat3::from_axis_angle(DVec3::new(1.0, -2.0, 0.5).normalize(), 0.4);
    let left = DMat3::from_diagonal(spacing_mm * DVec3::new(-1.0, 1.0, 1.0));
    DAffine3::from_mat3_translation(turn * left, DVec3::new(10.0, -250.0, 1000.0))
}

fn centre(affine: &DAffine3) -> DVec3 {
    affine.transform_point3(DVec3::from_array(SIZE.map(|n| n as f64 / 2.0)))
}

/// Samples a scene, given in the world, on that grid.
fn scene(spacing_mm: DVec3, hu: impl Fn(DVec3) -> f64) -> Volume {
    let affine = affine(spacing_mm);
    let centre = centre(&affine);
    let mut volume = volume(SIZE, |x, y, z| {
        hu(affine.transform_point3(DVec3::new(x as f64, y as f64, z as f64)) - centre) as f32
    });
    volume.world_from_voxel = affine;
    volume
}

fn direction() -> DVec3 {
    DIRECTION.normalize()
}

fn plane(spacing_mm: DVec3) -> Volume {
    scene(spacing_mm, |p| 500.0 * (0.8 * direction().dot(p)).tanh())
}

fn tube(spacing_mm: DVec3) -> Volume {
    scene(spacing_mm, |p| 600.0 * (-0.5 * p.reject_from_normalized(direction()).length_squared() / 4.0).exp())
}

/// Returns the share of the splats at places that `near` accepts whose axis `k` in the world lies within some
/// 14 degrees of the direction; -1 if there are too few to say.
fn share(name: &str, volume: &Volume, k: usize, near: impl Fn(DVec3) -> bool) -> f64 {
    let config = Init {
        orientation: name.to_owned(),
        unit: ScaleUnit::Spacing,
        scale_min: 1.0,
        scale_max: 4.0,
        ..Init::default()
    };
    let roi =
        region(SIZE, |x, y, z| f32::from([x, y, z].iter().zip(SIZE).all(|(&i, n)| (5..n - 5).contains(&i))));
    let splats = super::super::uniform::initialise(volume, &roi, 6000, 2, &config);
    let set =
        splat::SplatSet::from_voxel(&splats, &volume.world_from_voxel, splat::Field { ..Default::default() });
    let centre = centre(&volume.world_from_voxel) - set.origin_mm;
    let (mut hits, mut all) = (0.0, 0.0);
    for splat in &set.splats {
        if !near(DVec3::from_array(splat.mean.map(f64::from)) - centre) {
            continue;
        }
        // The thinnest or the longest axis, whichever column it has become; nearly round splats have none.
        let scale = splat.scale();
        let mut order = [0, 1, 2];
        order.sort_by(|&a, &b| scale[b].total_cmp(&scale[a]));
        let [thin, middle, long] = [2, 1, 0].map(|i| scale[order[i]]);
        let clear = if k == 0 { long > 1.2 * middle } else { middle > 1.2 * thin };
        if clear {
            all += 1.0;
            hits += f64::from(rotation_matrix(splat.rotation).col(order[k]).dot(direction()).abs() > 0.97);
        }
    }
    if all > 50.0 { hits / all } else { -1.0 }
}

/// Name of the cue, volume, axis, test for the means that count, and their least share.
type Row<'a> = (&'a str, &'a Volume, usize, &'a dyn Fn(DVec3) -> bool, f64);

#[test]
fn thin_axes_cross_a_plane_and_long_axes_follow_a_tube() {
    const LONG: usize = 0;
    const THIN: usize = 2;
    for spacing in [CUBIC, OBLONG] {
        let (plane, tube) = (plane(spacing), tube(spacing));
        let on_plane = |p: DVec3| direction().dot(p).abs() < 1.0;
        // The Hessian sees the bends on both sides of an edge, not the edge itself.
        let beside_plane = |p: DVec3| (0.7..1.5).contains(&direction().dot(p).abs());
        let in_tube = |p: DVec3| p.reject_from_normalized(direction()).length() < 2.0;
        let across_tube = |p: DVec3| (1.0..2.5).contains(&p.reject_from_normalized(direction()).length());
        let rows: [Row<'_>; 6] = [
            ("gradient", &plane, THIN, &on_plane, 0.98),
            ("structure-tensor", &plane, THIN, &on_plane, 0.98),
            ("hessian", &plane, THIN, &beside_plane, 0.95),
            ("structure-tensor", &tube, LONG, &across_tube, 0.9),
            ("hessian", &tube, LONG, &in_tube, 0.9),
            ("structure-tensor", &tube, LONG, &in_tube, 0.9),
        ];
        for (name, volume, axis, near, least) in rows {
            let found = share(name, volume, axis, near);
            println!("{name}, {spacing}, axis {axis}: {found:.3}");
            assert!(found >= least, "{name}, spacing {spacing}, axis {axis}: a share of {found}");
        }
        // A gradient knows nothing of the long axis, and without a cue there is no direction.
        assert!(share("gradient", &tube, LONG, in_tube) < 0.5);
        assert!((0.0..0.3).contains(&share("none", &plane, THIN, on_plane)));
    }
}

#[test]
fn the_gradient_initialiser_flattens_or_lengthens_by_the_table() {
    let (plane, tube) = (plane(CUBIC), tube(CUBIC));
    let roi = region(SIZE, |_, _, _| 1.0);
    let a = 1.5f32.ln();
    for row in ORIENTATIONS {
        let config = Init { orientation: row.name.to_owned(), ..Init::default() };
        let shape = match row.name {
            "none" => [0.0; 3],
            "hessian" => [a, -0.5 * a, -0.5 * a],
            _ => [0.5 * a, 0.5 * a, -a],
        };
        for volume in [&plane, &tube] {
            let splats = initialise(volume, &roi, 500, 1, &config);
            let mut turned = 0;
            for splat in &splats {
                let mean = splat.log_scale.iter().sum::<f32>() / 3.0;
                let found = splat.log_scale.map(|log| log - mean);
                let is = |shape: [f32; 3]| found.iter().zip(shape).all(|(f, s)| (f - s).abs() < 1e-5);
                assert!(is(shape) || is([0.0; 3]), "{}: {found:?}", row.name);
                turned += usize::from(is(shape));
                assert_eq!(defect(splat), None);
            }
            assert!(turned > 250, "{}: {turned} splats have a direction", row.name);
        }
    }
}

#[test]
fn there_is_no_direction_in_flat_volumes() {
    let cube = [9, 8, 7];
    let ramp = volume(cube, |x, y, z| (30 * x + 20 * y + 10 * z) as f32);
    let inner =
        region(cube, |x, y, z| f32::from([x, y, z].iter().zip(cube).all(|(&i, n)| i > 2 && i + 3 < n)));
    let whole = region(cube, |_, _, _| 1.0);
    for row in ORIENTATIONS {
        let config = Init { orientation: row.name.to_owned(), smoothing_sigma: 0.0, ..Init::default() };
        let rotations = |volume: &Volume, roi: &Roi| -> Vec<[f32; 4]> {
            let run = super::super::uniform::initialise;
            run(volume, roi, 200, 1, &config).iter().map(|splat| splat.rotation).collect()
        };
        let upright = |found: &[[f32; 4]]| found.iter().filter(|r| **r == [1.0, 0.0, 0.0, 0.0]).count();
        for hu in [0.0, -1024.0, 3e30] {
            assert_eq!(upright(&rotations(&volume(cube, |_, _, _| hu), &whole)), 200, "{}: {hu}", row.name);
        }
        // A ramp has a gradient but does not bend.
        let bends = matches!(row.name, "hessian" | "none");
        assert_eq!(upright(&rotations(&ramp, &inner)), if bends { 200 } else { 0 }, "{}", row.name);
        // A slice, a line, a voxel.
        for size in [[9, 8, 1], [9, 1, 1], [1, 1, 1]] {
            let found = rotations(&ball(size), &region(size, |_, _, _| 1.0));
            assert!(found.iter().flatten().all(|v| v.is_finite()), "{}: {size:?}", row.name);
        }
    }
}
