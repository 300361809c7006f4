use glam::{DAffine3, DMat3, DVec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::*;

/// Sizes with the coarse axis at each place.
const SIZES: [[usize; 3]; 3] = [[5, 9, 7], [8, 4, 6], [7, 9, 5]];

/// Returns an oblique, left-handed grid of this size whose voxels are `ratio` times as long along one axis.
fn grid(size: [usize; 3], axis: usize, ratio: f64) -> Volume {
    let mut edges = DVec3::new(0.8, 0.8, -0.8);
    edges[axis] *= ratio;
    let turned = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -3.0).normalize(), 0.7);
    let affine =
        DAffine3::from_mat3_translation(turned * DMat3::from_diagonal(edges), DVec3::new(30.0, -60.0, 900.0));
    Volume::new(size, affine, vec![0.0; size.iter().product()])
}

fn voxel(size: [usize; 3], i: usize) -> [usize; 3] {
    [i % size[0], i / size[0] % size[1], i / (size[0] * size[1])]
}

fn index(size: [usize; 3], [x, y, z]: [usize; 3]) -> usize {
    x + size[0] * (y + size[1] * z)
}

/// Returns what `reference` makes of the column of a voxel of the finer grid: it gets the values of all slices, the
/// slice below, and the distance from it.
fn by_columns<T: Copy, U>(
    finer: &FinerSlices,
    values: &[T],
    reference: impl Fn(&[T], usize, f64) -> U,
) -> Vec<U> {
    let (size, coarse) = (finer.size(), finer.coarse_size);
    let one = |i: usize| {
        let mut at = voxel(size, i);
        let slice = at[finer.axis];
        let column: Vec<T> = (0..coarse[finer.axis])
            .map(|s| {
                at[finer.axis] = s;
                values[index(coarse, at)]
            })
            .collect();
        reference(&column, slice / finer.factor, (slice % finer.factor) as f64 / finer.factor as f64)
    };
    (0..size.iter().product()).map(one).collect()
}

/// The cubic in the words of Hermite, by its four basis functions.
fn hermite(column: &[f64], below: usize, t: f64) -> f64 {
    if t == 0.0 {
        return column[below];
    }
    let (b, c) = (column[below], column[below + 1]);
    let secant = |i: usize| column[i + 1] - column[i];
    let tangent = |i: usize| {
        let (before, after) = match (i, i + 1 == column.len()) {
            (0, _) => (secant(0), secant(0)),
            (_, true) => (secant(i - 1), secant(i - 1)),
            _ => (secant(i - 1), secant(i)),
        };
        if before * after > 0.0 { 2.0 / (1.0 / before + 1.0 / after) } else { 0.0 }
    };
    (1.0 + 2.0 * t) * (1.0 - t).powi(2) * b
        + t * (1.0 - t).powi(2) * tangent(below)
        + t * t * (3.0 - 2.0 * t) * c
        + t * t * (t - 1.0) * tangent(below + 1)
}

#[test]
fn intensities_are_those_of_the_reference() {
    let mut random = Pcg64::seed_from_u64(7);
    for (axis, size) in SIZES.into_iter().enumerate() {
        let mut volume = grid(size, axis, 4.3);
        volume.samples.iter_mut().for_each(|v| *v = random.random_range(-1000.0..3000.0f32).round());
        let finer = FinerSlices::of(size, &volume.world_from_voxel).expect("thick slices");
        assert_eq!((finer.axis(), finer.factor()), (axis, 4));
        let fine = finer.volume(&volume, None, &Displacements::none());
        let samples: Vec<f64> = volume.samples.iter().copied().map(f64::from).collect();
        let wanted = by_columns(&finer, &samples, hermite);
        let range = by_columns(&finer, &volume.samples, |column, below, _| {
            let (b, c) = (column[below], column[(below + 1).min(column.len() - 1)]);
            [b.min(c), b.max(c)]
        });
        for (i, ((&found, wanted), [low, high])) in fine.samples.iter().zip(wanted).zip(range).enumerate() {
            assert!((f64::from(found) - wanted).abs() < 1e-3, "{i} along {axis}: {found}, not {wanted}");
            assert!((low..=high).contains(&found), "{i} along {axis}: {found} outside of {low} to {high}");
        }
    }
}

/// Returns the bilinear sample at a point of a slice, as the sum of four products; beyond the edge it is that of the edge.
fn sample(finer: &FinerSlices, values: &[f64], slice: usize, at: [f64; 2]) -> f64 {
    let size = finer.coarse_size;
    let across: Vec<usize> = (0..3).filter(|&axis| axis != finer.axis).collect();
    let mut sum = 0.0;
    for corner in 0..4 {
        let (mut share, mut voxel) = (1.0, [slice; 3]);
        for k in 0..2 {
            let last = size[across[k]] as f64 - 1.0;
            let place = at[k].clamp(0.0, last);
            let (low, far) = (place.floor(), corner >> k & 1);
            share *= if far == 1 { place - low } else { 1.0 - (place - low) };
            voxel[across[k]] = (low + f64::from(far)).min(last) as usize;
        }
        sum += share * values[index(size, voxel)];
    }
    sum
}

#[test]
fn lines_are_followed_as_by_the_reference() {
    for (axis, size) in [[6, 30, 26], [30, 5, 26], [30, 26, 5]].into_iter().enumerate() {
        let mut volume = grid(size, axis, 4.0);
        let across: Vec<usize> = (0..3).filter(|&k| k != axis).collect();
        for i in 0..volume.len() {
            let at = voxel(size, i);
            let [x, y, z] = [at[across[0]], at[across[1]], at[axis]].map(|v| v as f64);
            volume.samples[i] = (300.0 * (0.5 * (x - 2.0 * z)).sin() * (0.4 * (y + z)).cos()) as f32;
        }
        let finer = FinerSlices::of(size, &volume.world_from_voxel).expect("thick slices");
        let along = Displacements::of(&finer, &volume);
        let samples: Vec<f64> = volume.samples.iter().copied().map(f64::from).collect();
        let fine = finer.volume(&volume, None, &along);
        let mut moved = 0;
        for (i, &found) in fine.samples.iter().enumerate() {
            let at = voxel(fine.size, i);
            let (below, t) =
                (at[axis] / finer.factor, (at[axis] % finer.factor) as f64 / finer.factor as f64);
            let pixel = [at[across[0]], at[across[1]]];
            let by = along.at(below, pixel);
            moved += usize::from(by != [0.0; 2]);
            let on_line = |slice: usize| {
                let up = slice as f64 - below as f64 - t;
                let place = [0, 1].map(|k| pixel[k] as f64 + up * f64::from(by[k]));
                sample(&finer, &samples, slice, place)
            };
            let line: Vec<f64> = (0..size[axis]).map(on_line).collect();
            let wanted = if t == 0.0 {
                samples[{
                    let mut there = at;
                    there[axis] = below;
                    index(size, there)
                }]
            } else {
                hermite(&line, below, t)
            };
            assert!((f64::from(found) - wanted).abs() < 1e-3, "{at:?} along {axis}: {found}, not {wanted}");
            if t > 0.0 {
                let (low, high) = (line[below].min(line[below + 1]), line[below].max(line[below + 1]));
                assert!((low - 1e-3..=high + 1e-3).contains(&f64::from(found)), "{at:?}: {found}");
            }
        }
        assert!(2 * moved > fine.len(), "{moved} of {}", fine.len());
    }
}

#[test]
fn slices_stay_as_they_are_and_where_they_are() {
    let mut random = Pcg64::seed_from_u64(8);
    for (axis, size) in SIZES.into_iter().enumerate() {
        for ratio in [1.8, 2.6, 5.0] {
            let mut volume = grid(size, axis, ratio);
            volume.samples.iter_mut().for_each(|v| *v = random.random());
            let labels: Vec<u8> = (0..volume.len()).map(|_| random.random_range(0..4)).collect();
            let finer = FinerSlices::of(size, &volume.world_from_voxel).expect("thick slices");
            let (fine, fine_labels) = (
                finer.volume(&volume, None, &Displacements::none()),
                finer.labels(&labels, &Displacements::none()),
            );
            assert_eq!(fine.size[axis], (size[axis] - 1) * ratio.round() as usize + 1);
            for (i, &label) in labels.iter().enumerate() {
                let here = voxel(size, i);
                let mut there = here;
                there[axis] *= finer.factor();
                let at = index(fine.size, there);
                assert_eq!(fine.samples[at].to_bits(), volume.samples[i].to_bits());
                assert_eq!(fine_labels[at], label);
                let world = |of: &Volume, at: [usize; 3]| {
                    of.world_from_voxel.transform_point3(DVec3::from_array(at.map(|v| v as f64)))
                };
                assert!(world(&fine, there).distance(world(&volume, here)) < 1e-9);
            }
        }
    }
}

/// Signed distance by a search of all pixels of the slice, as the module's text has it.
fn distance_by_search(finer: &FinerSlices, labels: &[u8], label: u8, at: [usize; 3]) -> f64 {
    let size = finer.coarse_size;
    let spacing = finer.spacing_mm();
    let reach = REACH * spacing[finer.axis];
    let own = labels[index(size, at)] == label;
    let others = (0..labels.len())
        .filter(|&i| voxel(size, i)[finer.axis] == at[finer.axis] && (labels[i] == label) != own);
    let away = |i: usize| {
        let by = |k: usize| spacing[k] * (voxel(size, i)[k] as f64 - at[k] as f64);
        DVec3::new(by(0), by(1), by(2)).length()
    };
    let nearest = others.map(away).fold(reach, f64::min);
    if own { nearest } else { -nearest }
}

#[test]
fn shapes_are_those_of_a_search() {
    let mut random = Pcg64::seed_from_u64(9);
    for (axis, size) in SIZES.into_iter().enumerate() {
        let volume = grid(size, axis, 3.1);
        let finer = FinerSlices::of(size, &volume.world_from_voxel).expect("thick slices");
        for several in [1, 3] {
            // Balls, some cut off by the faces of the volume, and slices without any.
            let mut labels = vec![0u8; volume.len()];
            for label in 1..=several {
                let centre = DVec3::from_array(size.map(|n| random.random_range(0.0..n as f64)));
                let radius = random.random_range(1.2..3.0);
                for (i, value) in labels.iter_mut().enumerate() {
                    let at = DVec3::from_array(voxel(size, i).map(|v| v as f64));
                    if at.distance(centre) < radius {
                        *value = label;
                    }
                }
            }
            let places: Vec<[usize; 3]> = (0..volume.len()).map(|i| voxel(size, i)).collect();
            let wanted = by_columns(&finer, &places, |column, below, t| {
                let depth = |label: u8| {
                    let depths: Vec<f64> =
                        column.iter().map(|&at| distance_by_search(&finer, &labels, label, at)).collect();
                    hermite(&depths, below, t)
                };
                let depths: Vec<f64> = (1..=several).map(depth).collect();
                let own = labels[index(size, column[below])];
                (depths, (t == 0.0).then_some(own))
            });
            for (i, (found, (depths, own))) in
                finer.labels(&labels, &Displacements::none()).into_iter().zip(wanted).enumerate()
            {
                if let Some(own) = own {
                    assert_eq!(found, own);
                    continue;
                }
                // Rounding decides where the cubic is 0, or two are the same.
                let deepest = depths.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let depth = if found == 0 { 0.0 } else { depths[usize::from(found) - 1] };
                let right =
                    if found == 0 { deepest <= 1e-5 } else { depth >= deepest - 1e-5 && depth >= -1e-5 };
                assert!(right, "{i} along {axis}: {found} of {depths:?}");
            }
        }
    }
}

#[test]
fn an_oblique_bar_stays_straight() {
    // A bar of 9 voxels that moves by 4 voxels from slice to slice: shape moves it by one from each finer slice to the
    // next, where a linear mask would keep the steps.
    let size = [40, 5, 6];
    let volume = grid(size, 2, 4.0);
    let bar = |x: usize, z: usize| (4 * z + 3..4 * z + 12).contains(&x);
    let mask = (0..volume.len()).map(|i| {
        let [x, _, z] = voxel(size, i);
        f32::from(u8::from(bar(x, z)))
    });
    let roi = Roi::new(mask.collect(), &volume).expect("a region");
    let finer = FinerSlices::of(size, &volume.world_from_voxel).expect("thick slices");
    let fine = finer.roi(&roi, &finer.volume(&volume, None, &Displacements::none()), &Displacements::none());
    let size = finer.size();
    for z in 0..size[2] {
        let row = &fine.weight[index(size, [0, 2, z])..][..40];
        let first = row.iter().position(|&w| w > 0.0).expect("a bar");
        let last = row.iter().rposition(|&w| w > 0.0).expect("a bar");
        assert!(first.abs_diff(z + 3) <= 1 && last.abs_diff(z + 11) <= 1, "{z}: {first} to {last}");
    }
    assert!(!fine.soft && fine.size == size);
}

#[test]
fn soft_masks_are_linear_and_holes_stay_holes() {
    let mut volume = grid([2, 2, 4], 2, 2.0);
    volume.samples[5] = f32::NAN;
    volume.samples[10] = f32::INFINITY;
    let weights = (0..16).map(|i| (i % 5) as f32 / 4.0).collect();
    let roi = Roi::new(weights, &volume).expect("a region");
    let finer = FinerSlices::of(volume.size, &volume.world_from_voxel).expect("thick slices");
    let fine = finer.volume(&volume, None, &Displacements::none());
    let soft = finer.roi(&roi, &fine, &Displacements::none());
    assert!(soft.soft);
    for i in 0..fine.len() {
        let [x, y, z] = voxel(fine.size, i);
        let near = [z / 2, z.div_ceil(2)].map(|z| index(volume.size, [x, y, z]));
        let finite = near.iter().all(|&i| volume.samples[i].is_finite());
        assert_eq!(fine.samples[i].is_finite(), finite, "{x} {y} {z}");
        let mean = near.iter().map(|&i| roi.weight[i]).sum::<f32>() / 2.0;
        assert_eq!(soft.weight[i], if finite { mean } else { 0.0 }, "{x} {y} {z}");
    }
    // A neighbour that is not finite does not count beyond the next slice.
    assert!((cubic([f64::NAN, 1.0, 2.0, f64::INFINITY], 0.25) - 1.25).abs() < 1e-12);
}

#[test]
fn only_one_coarse_axis_has_more_slices() {
    let of = |size: [usize; 3], spacing: [f64; 3]| {
        FinerSlices::of(size, &DAffine3::from_scale(DVec3::from_array(spacing)))
            .map(|finer| (finer.axis(), finer.factor()))
    };
    let size = [64, 64, 20];
    assert_eq!(of(size, [0.9766, 0.9766, 4.25]), Some((2, 4)));
    assert_eq!(of(size, [1.0; 3]), None);
    assert_eq!(of(size, [1.0, 1.0, 1.74]), None);
    assert_eq!(of(size, [1.0, 1.0, 1.75]), Some((2, 2)));
    assert_eq!(of(size, [5.0, 1.0, 1.0]), Some((0, 5)));
    assert_eq!(of(size, [1.0, 100.0, 1.0]), Some((1, 8)), "no more than eight");
    assert_eq!(of(size, [1.0, 3.0, 3.0]), None, "two coarse axes");
    assert_eq!(of(size, [0.5, 3.5, 4.0]), None, "nearly two");
    assert_eq!(of([64, 64, 1], [1.0, 1.0, 5.0]), None, "a single slice");
    assert_eq!(of([64, 0, 20], [1.0, 1.0, 5.0]), None);
    for bad in [f64::NAN, f64::INFINITY, 0.0] {
        assert_eq!(of(size, [1.0, 1.0, bad]), None, "{bad}");
    }
    assert_eq!(of([512, 512, 600], [0.7, 0.7, 2.5]), Some((2, 3)), "no more than 2048 slices");
    assert_eq!(of([2048, 2048, 100], [0.5, 0.5, 2.0]), None, "too many voxels");
}

#[test]
fn what_is_not_thick_is_shown_as_it_is() {
    let volume = grid([4, 5, 6], 2, 1.5);
    let roi = Roi::new(vec![1.0; 120], &volume).expect("a region");
    for (between, volume) in
        [(BetweenSlices::Smooth, volume), (BetweenSlices::Linear, grid([4, 5, 6], 2, 4.0))]
    {
        let (shown, region) = between.shown(&volume, Some(&roi));
        assert!(matches!(shown, Cow::Borrowed(_)) && matches!(region, Some(Cow::Borrowed(_))));
    }
    let thick = grid([4, 5, 6], 2, 4.0);
    let (shown, region) = BetweenSlices::Smooth.shown(&thick, Some(&roi));
    assert_eq!((shown.size, region.map(|r| r.size)), ([4, 5, 21], Some([4, 5, 21])));
}

#[test]
fn near_a_region_the_volume_is_that_without_one() {
    let mut volume = grid([50, 46, 6], 2, 4.0);
    let mut random = Pcg64::seed_from_u64(9);
    volume.samples.iter_mut().for_each(|v| *v = random.random_range(-500.0..500.0));
    let finer = FinerSlices::of(volume.size, &volume.world_from_voxel).expect("thick slices");
    let along = Displacements::of(&finer, &volume);
    let inside = |[x, y, z]: [usize; 3]| (20..24).contains(&x) && y == 21 && (2..4).contains(&z);
    let weight = (0..volume.len()).map(|i| f32::from(u8::from(inside(voxel(volume.size, i))))).collect();
    let roi = Roi::new(weight, &volume).expect("a region");
    let [whole, near] = [None, Some(&roi)].map(|roi| finer.volume(&volume, roi, &along));
    let (mut equal, mut other) = (0, 0);
    for i in 0..whole.len() {
        let [x, y, z] = voxel(whole.size, i);
        let same = whole.samples[i] == near.samples[i];
        let beside = (12..32).contains(&x) && (13..30).contains(&y) && (4..=16).contains(&z);
        assert!(same || !beside, "{x}, {y}, {z}");
        (equal, other) = (equal + usize::from(beside), other + usize::from(!same));
    }
    assert!(equal > 4000 && other > 4000, "{equal} beside it, {other} far away");
}
