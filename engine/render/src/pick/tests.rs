use reference::eye::Eye;
use reference::slab::{Sums, field_at, seen};
use splat::Kernel;

use super::*;

/// Returns numbers from 0 to 1, the same each time.
fn numbers(mut seed: u64) -> impl FnMut() -> f32 {
    move || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 40) as f32 / (1u64 << 24) as f32
    }
}

fn set(kernel: Kernel, count: usize) -> SplatSet {
    let mut next = numbers(7);
    let splats = (0..count)
        .map(|_| {
            let mut splat = Splat {
                mean: [40.0 * next(), 60.0 * next(), 20.0 + 300.0 * next()],
                rotation: [next() - 0.5, next() - 0.5, next() - 0.5, next() - 0.5],
                intensity: 1000.0 * next() - 300.0,
                ..Splat::default()
            };
            splat.set_opacity(next());
            splat.set_scale([0.5 + 4.0 * next(), 0.5 + 4.0 * next(), 0.5 + 4.0 * next()]);
            splat
        })
        .collect();
    let field = Field { kernel, background: -100.0, ..Field::default() };
    SplatSet { splats, origin_mm: DVec3::new(5.0, -7.0, 1000.0), field, ..SplatSet::default() }
}

#[test]
fn it_is_the_field_of_the_reference() {
    for kernel in [Kernel::Compact, Kernel::Gaussian, Kernel::Density] {
        let set = set(kernel, 400);
        let probe = Probe::new(&set);
        let eye = Eye { position: DVec3::ZERO, turn: DMat3::IDENTITY, tangents: [0.0; 4] };
        // Reference implementations take unit quaternions.
        let of_reference = |s: &Splat| {
            let splat = reference::Splat::from(s);
            reference::Splat { rotation: splat.rotation.normalize(), ..splat }
        };
        let background = f64::from(set.field.background);
        let all: Vec<_> =
            set.splats.iter().filter_map(|s| seen(&of_reference(s), &eye, kernel, background)).collect();
        assert_eq!(all.len(), set.splats.len());
        let mut next = numbers(3);
        let mut inside = 0;
        for _ in 0..2000 {
            let x = DVec3::new(f64::from(next()) * 50.0, f64::from(next()) * 70.0, f64::from(next()) * 340.0);
            let Sums { w, s, .. } = field_at(&all, kernel, x);
            let found = probe.at(x + set.origin_mm);
            assert_eq!(found.is_some(), w > 0.0, "{x}");
            let Some(found) = found else { continue };
            inside += 1;
            let v = -100.0 + s / (w + f64::from(set.field.epsilon));
            let o = w / (w + f64::from(set.field.occupancy_w0));
            assert!((found.intensity - v).abs() < 1e-6, "{x}: {} {v}", found.intensity);
            assert!((found.occupancy - o).abs() < 1e-9, "{x}");
        }
        assert!(inside > 200, "{inside} points within splats");
    }
}

#[test]
fn beyond_the_splats_is_nothing() {
    let probe = Probe::new(&set(Kernel::Compact, 50));
    for x in [DVec3::splat(1e9), DVec3::splat(-1e9), DVec3::NAN, DVec3::INFINITY] {
        assert_eq!(probe.at(x), None, "{x}");
    }
    assert_eq!(Probe::new(&SplatSet::default()).at(DVec3::ZERO), None);
}

#[test]
fn splats_are_listed_a_few_times() {
    let mut set = set(Kernel::Compact, 3000);
    // One splat reaches through all cells, as a fit may have one.
    set.splats[0].set_scale([300.0; 3]);
    let probe = Probe::new(&set);
    assert_eq!(probe.large, [0]);
    let most = probe.starts.windows(2).map(|w| w[1] - w[0]).max().unwrap_or(0) as usize;
    assert!(probe.listed.len() < 8 * set.splats.len() && most < set.splats.len() / 5, "{most}");
}

/// Returns a wall of splats across x from 40 mm on, of two objects: the first 20 mm are number 1, what is
/// behind number 2.
fn wall() -> SplatSet {
    let mut set = SplatSet { origin_mm: DVec3::new(100.0, -50.0, 7.0), ..SplatSet::default() };
    let mut labels = Vec::new();
    for i in 0..20 * 11 * 11 {
        let [x, y, z] = [i % 20, i / 20 % 11, i / 220].map(|n| 2.0 * n as f32);
        let mut splat = Splat {
            mean: [40.0 + x, y, z],
            intensity: 400.0 + 10.0 * x,
            rotation: [1.0, 0.0, 0.0, 0.0],
            ..Splat::default()
        };
        splat.set_opacity(0.9);
        splat.set_scale([1.4, 1.5, 1.6]);
        set.splats.push(splat);
        labels.push(if x < 20.0 { 1 } else { 2 });
    }
    set.labels = Some(labels);
    set
}

fn bone() -> Look {
    Look::new(transfer::load("CT-Bone", [-1000.0, 2000.0]).expect("a preset"))
}

/// Finds the same by the reference implementation, in steps of 0.01 mm: where half of the light is gone.
fn met_by_reference(
    set: &SplatSet,
    from: DVec3,
    direction: DVec3,
    look: &Look,
    hidden: Option<u8>,
) -> Option<f64> {
    let eye = Eye { position: DVec3::ZERO, turn: DMat3::IDENTITY, tangents: [0.0; 4] };
    let labels = set.labels.as_ref().expect("labels");
    let there = set.splats.iter().zip(labels).filter(|(_, label)| Some(**label) != hidden);
    let all: Vec<_> =
        there.filter_map(|(s, _)| seen(&reference::Splat::from(s), &eye, set.field.kernel, 0.0)).collect();
    let mut clear: f64 = 1.0;
    for k in 0..10_000 {
        let distance = (f64::from(k) + 0.5) * 0.01;
        let x = from + direction * distance;
        if look.clip.iter().any(|plane| plane.normal.dot(x) < plane.offset) {
            continue;
        }
        let Sums { w, s, .. } = field_at(&all, set.field.kernel, x - set.origin_mm);
        let v = s / (w + f64::from(set.field.epsilon));
        let share = w / (w + f64::from(set.field.occupancy_w0)) * look.transfer.at(v).1;
        clear *= (1.0 - share).powf(0.01);
        if clear <= 0.5 {
            return Some(distance);
        }
    }
    None
}

#[test]
fn a_ray_goes_through_what_its_own_function_does_not_show() {
    let set = wall();
    let probe = Probe::new(&set);
    let from = set.origin_mm + DVec3::new(0.0, 10.3, 9.1);
    let nothing = bone().transfer.stretched([-505.0, -495.0], [5000.0, 5010.0]).expect("a range");
    let through = Look { functions: [(1, nothing)].into(), ..bone() };
    let [first, second] = [bone(), through].map(|look| probe.along(from, DVec3::X, &look).expect("a wall"));
    let hidden = met_by_reference(&set, from, DVec3::X, &bone(), Some(1)).expect("the second wall");
    assert!(second.distance_mm > first.distance_mm + 2.0, "{first:?} {second:?}");
    // Where both overlap the one with more weight counts, so the end of the first is not sharp.
    assert!((second.distance_mm - hidden).abs() < 2.0, "{} {hidden}", second.distance_mm);
}

#[test]
fn a_ray_meets_what_is_seen_first() {
    let set = wall();
    let probe = Probe::new(&set);
    let from = set.origin_mm + DVec3::new(0.0, 10.3, 9.1);
    let hide = |number, visible, opacity| {
        let appearance = crate::Appearance { visible, tint: None, opacity };
        Look { objects: [(number, appearance)].into(), ..bone() }
    };
    let plane = crate::ClipPlane { normal: DVec3::X, offset: set.origin_mm.x + 55.0 };
    let cut = Look { clip: vec![plane], ..bone() };
    for (what, look, hidden) in [
        ("all", bone(), None),
        ("the first hidden", hide(1, false, 1.0), Some(1)),
        ("the second hidden", hide(2, false, 1.0), Some(2)),
        ("cut", cut, None),
    ] {
        for direction in [DVec3::X, DVec3::new(1.0, 0.1, -0.05).normalize()] {
            let expected = met_by_reference(&set, from, direction, &look, hidden).expect("a wall");
            let met = probe.along(from, direction, &look).expect("a wall");
            // The step is half of a standard deviation.
            assert!((met.distance_mm - expected).abs() < 0.1, "{what}: {} {expected}", met.distance_mm);
            assert!(met.at_mm.distance(from + direction * met.distance_mm) < 1e-9);
            // Intensities rise by 10 HU per mm from 40 mm on.
            let rises = 400.0 + 10.0 * ((met.at_mm - set.origin_mm).x - 40.0);
            let low = if what == "the first hidden" { 600.0 } else { 400.0 };
            assert!(
                (met.intensity - rises.max(low)).abs() < 40.0,
                "{what}: {} HU, not {rises}",
                met.intensity
            );
        }
    }
    // An object with an opacity of 0 holds its place, but one sees through it.
    let through = probe.along(from, DVec3::X, &hide(1, true, 0.0)).expect("what is behind");
    let hidden = probe.along(from, DVec3::X, &hide(1, false, 1.0)).expect("what is behind");
    assert!(through.distance_mm > 55.0 && hidden.distance_mm > 55.0, "{through:?} {hidden:?}");
}

#[test]
fn rays_that_meet_nothing_say_so() {
    let set = wall();
    let probe = Probe::new(&set);
    let from = set.origin_mm + DVec3::new(0.0, 10.0, 10.0);
    let nothing = Look::new(transfer::load("window:10,-500", [-1000.0, 2000.0]).expect("a window"));
    for (from, direction, look) in [
        (from, DVec3::NEG_X, bone()),
        (from, DVec3::Y, bone()),
        (from + DVec3::Y * 100.0, DVec3::X, bone()),
        (from, DVec3::ZERO, bone()),
        (DVec3::NAN, DVec3::X, bone()),
        (
            from,
            DVec3::X,
            Look {
                transfer: nothing.transfer.stretched([-505.0, -495.0], [5000.0, 5010.0]).expect("a range"),
                ..bone()
            },
        ),
    ] {
        assert_eq!(probe.along(from, direction, &look), None, "{from} {direction}");
    }
    assert_eq!(Probe::new(&SplatSet::default()).along(DVec3::ZERO, DVec3::X, &bone()), None);
}

#[test]
fn splats_of_a_grid_are_read_at_its_voxels_and_interpolated() {
    let field = set(Kernel::Compact, 3000);
    let affine = DAffine3::from_mat3_translation(
        DMat3::from_diagonal(DVec3::new(1.5, 2.0, 3.0)),
        DVec3::new(4.0, -8.0, 1010.0),
    );
    let grid = splat::Grid { size: [30, 30, 90], world_from_voxel: affine };
    let grid_set = SplatSet { form: Form::Grid, grid: Some(grid), ..field.clone() };
    let (everywhere, probe) = (Probe::new(&field), Probe::new(&grid_set));
    // Voxels of a region have the occupancy that it says, and beyond it V is its own.
    let middle = [15, 15, 45];
    let of = |inside: bool| {
        let region = splat::Region::of([30, 30, 90], |i| {
            let x = (i % 30) as u32;
            (x < middle[0] || inside && x == middle[0]).then_some(0)
        });
        Probe::new(&SplatSet { region, ..grid_set.clone() })
    };
    let voxel = DVec3::from_array(middle.map(f64::from));
    let read = |inside: bool, voxel: DVec3| of(inside).at(affine.transform_point3(voxel));
    assert_eq!(read(false, voxel), None, "V of what does not belong to it is nobody's");
    let inside = read(true, voxel).expect("splats reach the middle");
    assert!((inside.occupancy - 1.0).abs() < 1e-9, "{}", inside.occupancy);
    let beside = read(true, voxel + 0.25 * DVec3::X).expect("at the edge");
    assert!((beside.occupancy - 0.75).abs() < 1e-6, "{}", beside.occupancy);
    assert!((beside.intensity - inside.intensity).abs() < 1e-6, "{} {}", beside.intensity, inside.intensity);
    let at = |voxel: DVec3| probe.at(affine.transform_point3(voxel));
    let mut between = 0;
    for i in 0..29 * 29 * 80 {
        let voxel = DVec3::new(f64::from(i % 29), f64::from(i / 29 % 29), f64::from(i / (29 * 29)));
        let wanted = everywhere.at(affine.transform_point3(voxel));
        assert_eq!(at(voxel).is_some(), wanted.is_some(), "{voxel}");
        let (Some(here), Some(wanted)) = (at(voxel), wanted) else { continue };
        assert!((here.intensity - wanted.intensity).abs() < 1e-6, "{voxel}");
        assert!((here.occupancy - wanted.occupancy).abs() < 1e-9, "{voxel}");
        if let (Some(next), Some(half)) = (at(voxel + DVec3::X), at(voxel + 0.5 * DVec3::X)) {
            between += 1;
            let mean = 0.5 * (here.intensity + next.intensity);
            assert!((half.intensity - mean).abs() < 1e-6, "{voxel}: {} and {mean}", half.intensity);
            let mean = 0.5 * (here.occupancy + next.occupancy);
            assert!((half.occupancy - mean).abs() < 1e-9, "{voxel}: {} and {mean}", half.occupancy);
        }
    }
    assert!(between > 1000, "{between} pairs of voxels");
    assert!(at(DVec3::splat(-2.0)).is_none_or(|beyond| beyond.occupancy == 0.0));
}
