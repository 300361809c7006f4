use glam::DVec3;

use super::*;

/// Returns numbers on a grid: 1 where `inside` is true of a voxel.
fn numbers(size: [usize; 3], inside: impl Fn(DVec3) -> bool) -> Vec<u8> {
    let at = |i: usize| [i % size[0], i / size[0] % size[1], i / size[0] / size[1]].map(|c| c as f64);
    (0..size.iter().product()).map(|i| u8::from(inside(DVec3::from_array(at(i))))).collect()
}

fn within(numbers: &[u8], size: [usize; 3], voxels: f64) -> Occupancy {
    occupancy(numbers, size, [1.0; 3], Edges::Within(voxels)).unwrap()
}

/// Returns the occupancy on the grid of the region, which the box covers, or 0 where it does not.
fn on_grid(shown: &Occupancy, size: [usize; 3]) -> Vec<u8> {
    let [nx, ny, nz] = size.map(|n| n as i32);
    let all = (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| IVec3::new(x, y, z))));
    all.map(|voxel| shown.at(voxel)).collect()
}

/// Returns the voxels that are on the other side than in the mask.
fn changed(numbers: &[u8], shown: &Occupancy, size: [usize; 3]) -> Vec<usize> {
    let shown = on_grid(shown, size);
    (0..numbers.len()).filter(|&i| (shown[i] >= 128) != (numbers[i] != 0)).collect()
}

/// Returns the root mean square of the distance (voxels) and of the angle (degrees) between the half level
/// of a shown region and a surface, at the edges of the grid that cross the level. `distance` is that from
/// the surface, positive outside.
fn errors(shown: &Occupancy, distance: impl Fn(DVec3) -> f64, wanted: impl Fn(DVec3) -> bool) -> [f64; 2] {
    let value = |p: DVec3| {
        let low = p.floor();
        let f = p - low;
        (0..8).fold(0.0, |sum, corner| {
            let far = DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2));
            let share = far * f + (1.0 - far) * (1.0 - f);
            sum + share.element_product() * f64::from(shown.at((low + far).as_ivec3()))
        })
    };
    let gradient = |f: &dyn Fn(DVec3) -> f64, p: DVec3| {
        DVec3::from_array(DVec3::AXES.map(|axis| f(p + 0.5 * axis) - f(p - 0.5 * axis))).normalize()
    };
    let (mut squares, mut count) = ([0.0; 2], 0.0);
    let [nx, ny, nz] = shown.size.map(|n| n as i32);
    for i in 0..nx * ny * nz {
        let from = shown.origin + IVec3::new(i % nx, i / nx % ny, i / nx / ny);
        for axis in IVec3::AXES {
            let [a, b] = [from, from + axis].map(|v| f64::from(shown.at(v)) - 127.5);
            let at = from.as_dvec3() + axis.as_dvec3() * (a / (a - b));
            if (a > 0.0) == (b > 0.0) || !wanted(at) {
                continue;
            }
            let cosine = -gradient(&value, at).dot(gradient(&distance, at));
            squares[0] += distance(at).powi(2);
            squares[1] += cosine.clamp(-1.0, 1.0).acos().to_degrees().powi(2);
            count += 1.0;
        }
    }
    assert!(count > 0.0, "the surface is there");
    squares.map(|sum| (sum / count).sqrt())
}

fn ball(radius: f64) -> impl Fn(DVec3) -> f64 {
    move |p: DVec3| p.distance(DVec3::splat(radius + 3.3)) - radius
}

/// A body with everything that is hard: a ball, a sheet and a rod of one voxel, a single voxel, a gap of one
/// voxel, and a part that the faces of the grid cut off.
fn odd_things(size: [usize; 3]) -> Vec<u8> {
    numbers(size, |p| {
        let gap = p.x == 12.0 && p.z > 8.0;
        let sheet = p.y == 26.0 && p.x < 20.0;
        let rod = p.y == 30.0 && p.z == 9.0;
        let single = p == DVec3::new(25.0, 22.0, 20.0);
        p.distance(DVec3::new(12.0, 12.0, 12.0)) < 8.4 && !gap || sheet || rod || single || p.x + p.y < 6.0
    })
}

#[test]
fn no_voxel_changes_its_side_at_0() {
    let size = [33, 34, 24];
    let mask = odd_things(size);
    assert!(changed(&mask, &within(&mask, size, 0.0), size).is_empty());
    // Whatever the mask: every other voxel, at random.
    let mask: Vec<u8> = (0..size.iter().product::<usize>())
        .map(|i| u8::from((i as u64 + 1).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 61 == 0))
        .collect();
    assert!(changed(&mask, &within(&mask, size, 0.0), size).is_empty());
}

#[test]
fn a_surface_moves_no_farther_than_the_number() {
    let size = [33, 34, 24];
    let mask = odd_things(size);
    let voxel = |i: usize| DVec3::new((i % 33) as f64, (i / 33 % 34) as f64, (i / (33 * 34)) as f64);
    let mut most = 0;
    for (number, spacing) in [(0.5, [1.0; 3]), (1.0, [1.0; 3]), (1.7, [1.0; 3]), (2.0, [0.5, 1.0, 2.0])] {
        let shown = occupancy(&mask, size, spacing, Edges::Within(number)).unwrap();
        let changed = changed(&mask, &shown, size);
        for &i in &changed {
            // Beyond the faces of the grid all is outside.
            let [low, high] = [voxel(i), DVec3::new(32.0, 33.0, 23.0) - voxel(i)];
            let face = if mask[i] == 0 { f64::INFINITY } else { 1.0 + low.min(high).min_element() };
            let others = (0..mask.len()).filter(|&k| mask[k] != mask[i]);
            let nearest = others.map(|k| voxel(k).distance(voxel(i))).fold(face, f64::min);
            let slack = number / spacing[2].max(spacing[0]);
            assert!(nearest - 1.0 <= slack, "voxel {i} is {nearest} from the other side for {slack}");
        }
        most = most.max(changed.len());
    }
    assert!(most > 100, "numbers let voxels change sides: {most}");
}

#[test]
fn thin_things_survive_any_number() {
    let size = [33, 34, 24];
    let mask = odd_things(size);
    for number in [0.0, 0.5, 1.0, 4.0, 1e9] {
        let shown = within(&mask, size, number);
        let inside = |x, y, z| shown.at(IVec3::new(x, y, z)) >= 128;
        assert!(inside(25, 22, 20), "a single voxel, {number}");
        assert!((0..33).all(|x| inside(x, 30, 9)), "a rod, {number}");
        assert!((0..20).all(|x| (0..24).all(|z| inside(x, 26, z))), "a sheet, {number}");
        assert!(!inside(12, 12, 14), "a gap, {number}");
    }
}

#[test]
fn a_digitised_ball_is_round_again() {
    for (radius, distance_of_blocks, angle_of_blocks, most) in
        [(6.0, 0.19, 24.0, [0.24, 6.5]), (20.0, 0.19, 24.0, [0.12, 4.2])]
    {
        let side = 2 * radius as usize + 8;
        let size = [side; 3];
        let mask = numbers(size, |p| ball(radius)(p) < 0.0);
        let all = |_| true;
        let blocks = errors(&occupancy(&mask, size, [1.0; 3], Edges::Voxel).unwrap(), ball(radius), all);
        assert!(blocks[0] > distance_of_blocks && blocks[1] > angle_of_blocks, "blocks: {blocks:?}");
        let smooth = errors(&within(&mask, size, 0.0), ball(radius), all);
        println!("ball of {radius}: {blocks:?} became {smooth:?} (rms voxels, degrees)");
        assert!(smooth[0] < most[0] && smooth[1] < most[1], "radius {radius}: {smooth:?}");
    }
}

#[test]
fn digitised_rods_and_planes_are_smooth() {
    let size = [40; 3];
    let centre = DVec3::splat(19.8);
    let inner = |p: DVec3| p.cmpgt(DVec3::splat(8.0)).all() && p.cmplt(DVec3::splat(31.0)).all();
    let axis = DVec3::new(0.3, 0.1, 1.0).normalize();
    let rod = |p: DVec3| ((p - centre) - axis * (p - centre).dot(axis)).length() - 8.0;
    let steep = |p: DVec3| (p - centre).dot(DVec3::new(0.4, 0.3, 1.0).normalize());
    let level = |p: DVec3| (p - centre).dot(DVec3::new(0.1, 0.07, 1.0).normalize());
    let check = |distance: &dyn Fn(DVec3) -> f64, most: f64| {
        let mask = numbers(size, |p| distance(p) < 0.0);
        let blocks = errors(&occupancy(&mask, size, [1.0; 3], Edges::Voxel).unwrap(), distance, inner);
        let smooth = errors(&within(&mask, size, 0.0), distance, inner);
        println!("{blocks:?} became {smooth:?}");
        assert!(blocks[1] > 20.0 && smooth[1] < most, "{blocks:?} became {smooth:?}");
        assert!(smooth[0] < blocks[0], "{blocks:?} became {smooth:?}");
    };
    check(&rod, 4.5);
    check(&steep, 5.5);
    check(&level, 6.0);
}

#[test]
fn stairs_of_two_voxels_take_a_number() {
    // A ball that was digitised at twice the spacing.
    let distance = |p: DVec3| 2.0 * ball(10.0)((p - 0.5) / 2.0);
    let size = [56; 3];
    let mask = numbers(size, |p| ball(10.0)((p / 2.0).floor()) < 0.0);
    let [strict, loose] = [0.0, 0.5].map(|number| errors(&within(&mask, size, number), distance, |_| true));
    println!("stairs of two voxels: {strict:?}, {loose:?} with half a voxel");
    assert!(strict[1] > 8.0 && loose[1] < 5.0, "{strict:?}, {loose:?}");
    assert!(loose[0] < 0.6 * strict[0], "{strict:?}, {loose:?}");
}

#[test]
fn voxels_of_one_half_are_those_of_the_mask() {
    let size = [33, 34, 24];
    let mask = odd_things(size);
    let shown = occupancy(&mask, size, [1.0; 3], Edges::Voxel).unwrap();
    let wanted: Vec<u8> = mask.iter().map(|&n| 255 * n).collect();
    assert_eq!(on_grid(&shown, size), wanted);
}

#[test]
fn all_is_empty_around_a_region_and_full_within() {
    let size = [40, 40, 40];
    // It touches the faces of the grid, and the box goes on beyond them.
    let mask = vec![3; 64_000];
    for number in [0.0, 1.0, 3.0] {
        let shown = within(&mask, size, number);
        let [nx, ny, nz] = shown.size;
        for (i, &value) in shown.values.iter().enumerate() {
            let [x, y, z] = [i % nx, i / nx % ny, i / nx / ny];
            let face = x == 0 || y == 0 || z == 0 || x + 1 == nx || y + 1 == ny || z + 1 == nz;
            assert!(!face || value == 0, "{number}: {value} at {x} {y} {z}");
        }
        assert!(shown.origin.cmplt(IVec3::ZERO).all());
        assert_eq!(shown.at(IVec3::splat(20)), 255);
    }
    let nothing = within(&[0; 8], [2, 2, 2], 0.0);
    assert_eq!((nothing.size, nothing.values.len()), ([0; 3], 0));
    assert_eq!(nothing.at(IVec3::ZERO), 0);
}

#[test]
fn occupancy_reaches_as_far_as_values_are_wanted() {
    let size = [33, 34, 24];
    let mask = odd_things(size);
    let region = |p: IVec3| {
        let [x, y, z] = p.to_array().map(|c| usize::try_from(c).unwrap_or(usize::MAX));
        x < 33 && y < 34 && z < 24 && mask[x + 33 * (y + 34 * z)] != 0
    };
    for edges in [Edges::Voxel, Edges::Within(0.0), Edges::Within(0.5), Edges::Within(1.0)] {
        let shown = occupancy(&mask, size, [1.0; 3], edges).unwrap();
        // One layer is that of interpolation.
        let (reach, side) = (edges.layers([1.0; 3]) as i32 - 1, edges.layers([1.0; 3]) as i32 * 2 - 1);
        let [nx, ny, _] = shown.size.map(|n| n as i32);
        for i in (0..shown.values.len()).filter(|&i| shown.values[i] > 0) {
            let i = i as i32;
            let voxel = shown.origin + IVec3::new(i % nx, i / nx % ny, i / nx / ny);
            let near = |k: i32| voxel + IVec3::new(k % side, k / side % side, k / side / side) - reach;
            assert!((0..side.pow(3)).any(|k| region(near(k))), "{edges:?}: {voxel} is not near");
        }
    }
}

#[test]
fn touching_objects_leave_no_gap() {
    // Two objects that meet in an oblique plane, each smoothed as if there were nothing else.
    let size = [40; 3];
    let first = |p: DVec3| (p - 19.7).dot(DVec3::new(0.5, 0.3, 1.0)) < 0.0;
    let [a, b] = [true, false].map(|side| within(&numbers(size, |p| first(p) == side), size, 0.0));
    for i in 0..22 * 22 * 22 {
        let voxel = IVec3::new(i % 22, i / 22 % 22, i / 484) + 9;
        let sum = i32::from(a.at(voxel)) + i32::from(b.at(voxel));
        assert!(sum >= 253, "{voxel}: {sum}");
    }
}

#[test]
fn labels_do_not_change_the_surface_of_their_union() {
    let size = [33, 34, 24];
    let mask = odd_things(size);
    let labels: Vec<u8> = mask.iter().enumerate().map(|(i, &n)| n * (1 + (i % 7) as u8)).collect();
    assert_eq!(within(&mask, size, 0.3), within(&labels, size, 0.3));
}

#[test]
fn bits_do_not_depend_on_threads() {
    let size = [33, 34, 24];
    let mask = odd_things(size);
    let of_threads = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| [0.0, 0.7, 2.0].map(|number| within(&mask, size, number)))
    };
    assert_eq!(of_threads(1), of_threads(5));
}
