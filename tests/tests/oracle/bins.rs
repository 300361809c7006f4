//! Which splats reach which samples: footprints, pairs and masks.
//!
//! Boxes and ellipsoids are widened a little on the device, so that rounding never cuts a sample off. A set
//! is right if it holds all that the reference implementation finds without a margin and nothing that it does
//! not find with a larger one.

use engine::gpu::{Gpu, Kernel};
use engine::splat::kernel::{KERNELS, KernelRow};
use glam::DVec3;
use rand::RngExt;
use reference::{Footprint, Samples, pairs, scan, splat_bounds};
use shaders_glsl::types::{self, Grid, PairParams, RangeParams, SplatParams};
use vgs_tests::scene::random;
use vgs_tests::{Bound, Device, Scene, assert_close};

use super::run;

/// Voxels: what must be found lies this far inside a box, what may be found this far outside.
const INSIDE: f64 = -1e-4;
const OUTSIDE: f64 = 2e-3;

/// Scenes of every kernel, cut into one chunk or looked at through a part of their slots.
fn scenes() -> Vec<(Scene, std::ops::Range<usize>)> {
    KERNELS
        .into_iter()
        .flat_map(|KernelRow { kernel, .. }| {
            let scene = || Scene::random(11 + u64::from(kernel.id()), 150, kernel, false);
            let all = 0..scene().bricks.len();
            [(scene(), all), (scene(), 13..29)]
        })
        .collect()
}

fn grid(scene: &Scene, slots: &std::ops::Range<usize>) -> Grid {
    Grid {
        bricks: scene.bricks.grid.to_array(),
        first_slot: slots.start as u32,
        offset: scene.offset,
        slot_count: slots.len() as u32,
    }
}

fn samples<'a>(scene: &'a Scene, slots: &std::ops::Range<usize>) -> Samples<'a> {
    Samples { slots: slots.clone(), ..scene.samples() }
}

/// Footprints and pair counts as the device finds them.
fn bounds(gpu: &Gpu, scene: &Scene, slots: &std::ops::Range<usize>) -> (Vec<types::Footprint>, Vec<u32>) {
    stretched_bounds(gpu, scene, slots, [1.0; 3])
}

/// The same of splats that are shaped in a space of which a unit is so many voxels along each axis.
fn stretched_bounds(
    gpu: &Gpu,
    scene: &Scene,
    slots: &std::ops::Range<usize>,
    stretch: [f32; 3],
) -> (Vec<types::Footprint>, Vec<u32>) {
    let kernel = Kernel::new(gpu, &shaders_glsl::SPLAT_BOUNDS, &[scene.kernel.id()]).unwrap();
    let count = scene.splats.len();
    let splats = gpu.upload("splats", "test", &scene.splats).unwrap();
    let table = gpu.upload("slots", "test", &scene.bricks.slots).unwrap();
    let mut footprints = gpu.buffer("footprints", "test", count).unwrap();
    let mut counts = gpu.buffer("pair counts", "test", count).unwrap();
    let params = SplatParams { grid: grid(scene, slots), splat_count: count as u32, capacity: 0, stretch };
    run(gpu, |r| {
        r.pass(&kernel)
            .read("splats", &splats)
            .read("slots", &table)
            .write("footprints", &mut footprints)
            .write("pair_counts", &mut counts)
            .push(&params)
            .dispatch_over(count as u32);
    });
    (footprints.read().unwrap(), counts.read().unwrap())
}

pub fn splat_bounds() {
    let gpu = Device::boot();
    let stretches = [[1.0; 3], [1.7, 0.6, 2.5]];
    for ((scene, slots), stretch) in scenes().into_iter().flat_map(|s| stretches.map(|d| (s.clone(), d))) {
        let (got, counts) = stretched_bounds(&gpu, &scene, &slots, stretch);
        let samples = samples(&scene, &slots);
        let splats = scene.splats64();
        let stretch = DVec3::from_array(stretch.map(f64::from));
        let footprint = |s: &_| splat_bounds::stretched_footprint(s, scene.kernel, stretch);
        let wanted: Vec<Footprint> = splats.iter().map(footprint).collect();
        let got64: Vec<Footprint> = got.iter().map(Into::into).collect();
        assert_close(
            "splat_bounds: amplitude",
            Bound::new(0.0, 1e-6),
            got64.iter().zip(&wanted).map(|(g, w)| (g.amplitude, w.amplitude)),
        );
        // A column of T is a column of S⁻¹Rᵀ turned: its rounding is measured against the largest of them.
        let whitening = got64.iter().zip(&wanted).flat_map(|(g, w)| {
            let size = w.whitening.to_cols_array().into_iter().fold(0.0f64, |a, v| a.max(v.abs()));
            let (g, w) = (g.whitening.to_cols_array(), w.whitening.to_cols_array());
            (0..9).map(move |i| (g[i] / size, w[i] / size))
        });
        assert_close("splat_bounds: whitening", Bound::new(1e-6, 0.0), whitening);
        let extents = got64.iter().zip(&wanted).flat_map(|(g, w)| {
            let (g, w) = (g.extent, w.extent);
            (0..3).map(move |axis| (g[axis], w[axis]))
        });
        assert_close("splat_bounds: extent", Bound::new(0.0, 1e-6), extents);
        for (i, (g, w)) in got64.iter().zip(&wanted).enumerate() {
            assert_eq!((g.mean, g.intensity), (w.mean, w.intensity), "splat {i}");
            let least = splat_bounds::brick_count(w, &samples, INSIDE);
            let most = splat_bounds::brick_count(w, &samples, OUTSIDE);
            let found = counts[i] as usize;
            assert!(
                (least..=most).contains(&found),
                "splat {i}: {found} bricks, reference {least} to {most}"
            );
        }
        if stretch == DVec3::ONE {
            assert_eq!(counts[1..3], [0, 0], "splats far outside reach nothing");
        }
        let whole = counts[4] as usize == slots.len();
        assert_eq!(
            whole,
            scene.kernel.row().reach.is_infinite(),
            "a splat over everything reaches every brick of the chunk, unless it is cut off"
        );
        let sizes = [counts.contains(&1), counts.iter().any(|&n| n > 7)];
        assert!(stretch != DVec3::ONE || !whole || sizes == [true; 2], "the scene has small and large ones");
    }
}

pub fn emit_pairs() {
    let gpu = Device::boot();
    let kernel = Kernel::new(&gpu, &shaders_glsl::EMIT_PAIRS, &[]).unwrap();
    for (scene, slots) in scenes() {
        let (footprints, counts) = bounds(&gpu, &scene, &slots);
        let offsets = scan::scan(&counts);
        let total = offsets[counts.len()] as usize;
        let emitted = |capacity: usize| {
            let footprints = gpu.upload("footprints", "test", &footprints).unwrap();
            let table = gpu.upload("slots", "test", &scene.bricks.slots).unwrap();
            let offsets = gpu.upload("offsets", "test", &offsets).unwrap();
            let mut keys = gpu.upload("keys", "test", &vec![u32::MAX; total]).unwrap();
            let mut values = gpu.upload("values", "test", &vec![u32::MAX; total]).unwrap();
            let params = SplatParams {
                grid: grid(&scene, &slots),
                splat_count: counts.len() as u32,
                capacity: capacity as u32,
                stretch: [1.0; 3],
            };
            run(&gpu, |r| {
                r.pass(&kernel)
                    .read("footprints", &footprints)
                    .read("slots", &table)
                    .read("pair_offsets", &offsets)
                    .write("keys", &mut keys)
                    .write("values", &mut values)
                    .push(&params)
                    .dispatch_over(counts.len() as u32);
            });
            let pairs = keys.read().unwrap().into_iter().zip(values.read().unwrap());
            pairs.collect::<Vec<(u32, u32)>>()
        };
        let got = emitted(total);
        let samples = samples(&scene, &slots);
        let footprints: Vec<Footprint> = footprints.iter().map(Into::into).collect();
        let least = pairs::emit_pairs(&footprints, &samples, INSIDE);
        let most = pairs::emit_pairs(&footprints, &samples, OUTSIDE);
        println!("emit_pairs: {total} pairs, reference {} to {}", least.len(), most.len());
        assert!(least.iter().all(|pair| got.contains(pair)), "a pair is missing");
        assert!(got.iter().all(|pair| most.contains(pair)), "a pair is too many");
        assert!(got.is_sorted_by_key(|&(_, splat)| splat), "a splat writes into its own run");
        let mut distinct = got.clone();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(distinct.len(), total, "a pair is there twice");
        // Too little room: what fits is right, nothing is written behind.
        let part = emitted(total / 2);
        assert_eq!(part[..total / 2], got[..total / 2]);
        assert!(part[total / 2..].iter().all(|&pair| pair == (u32::MAX, u32::MAX)));
    }
}

pub fn brick_ranges() {
    let gpu = Device::boot();
    let kernel = Kernel::new(&gpu, &shaders_glsl::BRICK_RANGES, &[]).unwrap();
    let mut rng = random(5);
    let mut many: Vec<u32> = (0..3000).map(|_| rng.random_range(3..200)).collect();
    many.sort_unstable();
    for (keys, slot_count) in [
        (vec![], 7),
        (vec![0], 1),
        (vec![6], 7),
        (vec![0, 0, 0, 6, 6], 7),
        (vec![4; 600], 9),
        ((0..512).collect(), 512),
        (many, 210),
    ] {
        let capacity = keys.len() + 100;
        let mut padded = keys.clone();
        padded.resize(capacity, 1); // what lies behind the count must not matter
        let counts = gpu.upload("counts", "test", &[0, 0, keys.len() as u32]).unwrap();
        let buffer = gpu.upload("keys", "test", &padded).unwrap();
        let mut starts = gpu.upload("starts", "test", &vec![u32::MAX; slot_count + 1]).unwrap();
        let params = RangeParams { slot_count: slot_count as u32, count_index: 2, capacity: capacity as u32 };
        run(&gpu, |r| {
            r.pass(&kernel)
                .read("pair_offsets", &counts)
                .read("keys", &buffer)
                .write("starts", &mut starts)
                .push(&params)
                .dispatch_over(capacity as u32 + 1);
        });
        assert_eq!(starts.read().unwrap(), pairs::brick_ranges(&keys, slot_count), "{} keys", keys.len());
    }
}

pub fn pair_masks() {
    let gpu = Device::boot();
    for (scene, slots) in scenes() {
        let kernel = Kernel::new(&gpu, &shaders_glsl::PAIR_MASKS, &[scene.kernel.id()]).unwrap();
        let (footprints, _) = bounds(&gpu, &scene, &slots);
        let footprints64: Vec<Footprint> = footprints.iter().map(Into::into).collect();
        let samples = samples(&scene, &slots);
        let list = pairs::emit_pairs(&footprints64, &samples, OUTSIDE);
        let (keys, values): (Vec<u32>, Vec<u32>) = list.iter().copied().unzip();
        let coordinates: Vec<[u32; 3]> = scene.bricks.coordinates.iter().map(|c| c.to_array()).collect();
        let counts = gpu.upload("counts", "test", &[list.len() as u32]).unwrap();
        let key_buffer = gpu.upload("keys", "test", &keys).unwrap();
        let value_buffer = gpu.upload("values", "test", &values).unwrap();
        let footprint_buffer = gpu.upload("footprints", "test", &footprints).unwrap();
        let coordinate_buffer = gpu.upload("coordinates", "test", &coordinates).unwrap();
        let active = gpu.upload("active cells", "test", &scene.bricks.active_cells()).unwrap();
        let mut masks = gpu.buffer::<u32>("pair masks", "test", list.len() * 2).unwrap();
        let params = PairParams { grid: grid(&scene, &slots), count_index: 0, capacity: list.len() as u32 };
        run(&gpu, |r| {
            r.pass(&kernel)
                .read("pair_offsets", &counts)
                .read("keys", &key_buffer)
                .read("pair_splats", &value_buffer)
                .read("footprints", &footprint_buffer)
                .read("brick_coordinates", &coordinate_buffer)
                .read("active_cells", &active)
                .write("pair_masks", &mut masks)
                .push(&params)
                .dispatch_over(list.len() as u32);
        });
        let support = scene.kernel.support_q();
        let mut totals = [0; 3];
        for (i, [low, high]) in masks.read().unwrap().as_chunks::<2>().0.iter().enumerate() {
            let footprint = &footprints64[values[i] as usize];
            let slot = keys[i] as usize + slots.start;
            let least = {
                let inside = support * (1.0 - 1e-5);
                pairs::pair_mask(footprint, &samples, slot, scene.kernel, inside, pairs::Reach::Active)
            };
            let reach = pairs::Reach::Widened(OUTSIDE);
            let outside = support * (1.0 + 1e-5);
            let most = pairs::pair_mask(footprint, &samples, slot, scene.kernel, outside, reach);
            let found = u64::from(*low) | u64::from(*high) << 32;
            assert_eq!(least & !found, 0, "pair {i}: cells are missing: {found:x}, reference {least:x}");
            assert_eq!(found & !most, 0, "pair {i}: cells are too many: {found:x}, reference {most:x}");
            for (sum, mask) in totals.iter_mut().zip([least, found, most]) {
                *sum += mask.count_ones();
            }
        }
        println!(
            "pair_masks: {} pairs, {} cells, reference {} to {}",
            list.len(),
            totals[1],
            totals[0],
            totals[2]
        );
        assert!(totals[0] > 1000, "the scene has something to find");
    }
}

pub fn cell_masks() {
    let gpu = Device::boot();
    let kernel = Kernel::new(&gpu, &shaders_glsl::CELL_MASKS, &[]).unwrap();
    for slots in [1, 2, 33] {
        // Some slots without pairs, some with just 32, 64, ...
        let mut rng = random(slots as u64);
        let mut starts = vec![0];
        for slot in 0..slots {
            let pairs = [rng.random_range(1..200), 0, 32, 31, 65][slot % 5];
            starts.push(starts[slot] + pairs);
        }
        let pairs = starts[slots] as usize;
        let masks: Vec<u64> =
            (0..pairs).map(|i| if i % 9 == 0 { 0 } else { rng.random_range(0..=u64::MAX) }).collect();
        let words: Vec<u32> = masks.iter().flat_map(|&m| [m as u32, (m >> 32) as u32]).collect();
        let start_buffer = gpu.upload("starts", "test", &starts).unwrap();
        let mask_buffer = gpu.upload("pair masks", "test", &words).unwrap();
        let mut cell_masks = gpu.buffer::<u32>("cell masks", "test", (pairs / 32 + slots + 1) * 64).unwrap();
        run(&gpu, |r| {
            r.pass(&kernel)
                .read("starts", &start_buffer)
                .read("pair_masks", &mask_buffer)
                .write("cell_masks", &mut cell_masks)
                .dispatch(slots as u32);
        });
        let got = cell_masks.read().unwrap();
        for (slot, blocks) in pairs::cell_masks(&starts, &masks).into_iter().enumerate() {
            // `mask_block` in brick.glsl: where the blocks of a slot begin.
            let first = starts[slot] as usize / 32 + slot;
            for (i, block) in blocks.iter().enumerate() {
                assert_eq!(got[(first + i) * 64..][..64], block[..], "slot {slot} of {slots}, block {i}");
            }
        }
    }
}
