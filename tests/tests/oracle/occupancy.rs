//! Which bricks of a volume can be seen, how far the others are from them, and the faces around them.

use engine::gpu::Kernel;
use engine::passes::Faces;
use engine::render::{Look, LookBuffers};
use engine::transfer::{Table, preset};
use glam::DVec3;
use rand::RngExt;
use reference::occupancy;
use shaders_glsl::types::{BrickGrid, OccupancyParams, SpreadParams};
use vgs_tests::Device;
use vgs_tests::scene::random;

use super::run;

const RANGE: [f64; 2] = [-1000.0, 2000.0];

pub fn occupancy_mark() {
    let gpu = Device::boot();
    let kernel = Kernel::new(&gpu, &shaders_glsl::OCCUPANCY_MARK, &[]).unwrap();
    for (name, count) in [("CT-Skin", 1000usize), ("CT-Soft-Tissue", 64), ("CT-Bones-Steep", 1)] {
        let look = Look::new(preset(name).unwrap().over(RANGE));
        let table = Table::new(&look.transfer, RANGE);
        let buffers = LookBuffers::new(&gpu, &look, RANGE, DVec3::ZERO).unwrap();
        let mut rng = random(count as u64);
        let intervals: Vec<[f32; 2]> = (0..count)
            .map(|i| {
                // Whole numbers, so that f32 and f64 agree on which entry they are.
                let a = rng.random_range(-1500i32..2500) as f32;
                match i % 5 {
                    0 => [f32::INFINITY, f32::NEG_INFINITY],
                    1 => [a, a],
                    _ => [a, a + rng.random_range(0i32..300) as f32],
                }
            })
            .collect();
        let on_device = gpu.upload("intervals", "test", &intervals).unwrap();
        let mut distances = gpu.buffer::<u32>("distances", "test", count).unwrap();
        run(&gpu, |r| {
            r.pass(&kernel)
                .read("look_rows", &buffers.rows)
                .read("visible_before", &buffers.visible)
                .read("intervals", &on_device)
                .write("distances", &mut distances)
                .push(&OccupancyParams { count: count as u32, most: 9 })
                .dispatch_over(count as u32);
        });
        let wanted = occupancy::occupancy_mark(&intervals, &table, 9);
        assert!(count < 10 || wanted.contains(&0) && wanted.contains(&9), "{name}: both kinds");
        assert_eq!(distances.read().unwrap(), wanted, "{name}");
    }
}

pub fn occupancy_spread() {
    let gpu = Device::boot();
    let kernel = Kernel::new(&gpu, &shaders_glsl::OCCUPANCY_SPREAD, &[]).unwrap();
    let mut rng = random(8);
    for (bricks, most) in
        [([1, 1, 1], 5), ([70, 1, 3], 32), ([5, 40, 2], 32), ([9, 8, 7], 3), ([13, 11, 12], 32)]
    {
        let grid = BrickGrid { texels: [8; 3], bricks: bricks.map(|n: usize| n as u32), shift: [3; 3] };
        let count: usize = bricks.iter().product();
        let marks: Vec<u32> =
            (0..count).map(|_| if rng.random_range(0..60) == 0 { 0 } else { most }).collect();
        let mut wanted = marks.clone();
        let mut from = gpu.upload("from", "test", &marks).unwrap();
        let mut to = gpu.buffer::<u32>("to", "test", count).unwrap();
        for axis in 0..3 {
            run(&gpu, |r| {
                r.pass(&kernel)
                    .read("before", &from)
                    .write("after", &mut to)
                    .push(&SpreadParams { grid, axis: axis as u32 })
                    .dispatch_over_3d(grid.bricks);
            });
            wanted = occupancy::occupancy_spread(&wanted, bricks, axis);
            assert_eq!(to.read().unwrap(), wanted, "{bricks:?} along {axis}");
            std::mem::swap(&mut from, &mut to);
        }
        // All three make the Chebyshev distance.
        let place = |i: usize| [i % bricks[0], i / bricks[0] % bricks[1], i / (bricks[0] * bricks[1])];
        for (i, &distance) in wanted.iter().enumerate() {
            let to = |j: usize| (0..3).map(|k| place(i)[k].abs_diff(place(j)[k]) as u32).max().unwrap_or(0);
            let nearest = (0..count).filter(|&j| marks[j] == 0).map(to).min().unwrap_or(most);
            assert_eq!(distance, nearest.min(most), "brick {i} of {bricks:?}");
        }
    }
}

pub fn list_faces() {
    let gpu = Device::boot();
    let mut rng = random(12);
    for (bricks, one_in) in [
        ([1, 1, 1], 1),
        ([7, 1, 3], 2),
        ([5, 4, 9], 1),
        ([23, 18, 30], 40),
        ([16, 9, 10], 3),
        ([6, 6, 6], 9999),
    ] {
        let grid = BrickGrid { texels: [8; 3], bricks: bricks.map(|n: usize| n as u32), shift: [3; 3] };
        let count: usize = bricks.iter().product();
        let distances: Vec<u32> = (0..count).map(|_| u32::from(rng.random_range(0..one_in) != 0)).collect();
        let on_device = gpu.upload("distances", "test", &distances).unwrap();
        let mut faces = Faces::new(&gpu, grid).unwrap();
        let wanted = occupancy::list_faces(&distances, bricks);
        // The second time in place of the first.
        for _ in 0..2 {
            run(&gpu, |r| faces.record(r, &on_device));
            assert_eq!(faces.arguments.read().unwrap(), [[6 * wanted.len() as u32, 1, 0, 0]], "{bricks:?}");
            let mut found = faces.rows.read().unwrap();
            found.truncate(wanted.len());
            found.sort_unstable();
            assert_eq!(found, wanted, "{bricks:?}");
        }
        // A closed surface: along each axis as many lower as upper ones.
        for axis in 0..3 {
            let ends = [0, 1].map(|end| wanted.iter().filter(|&&f| f % 6 == 2 * axis + end).count());
            assert_eq!(ends[0], ends[1], "{bricks:?}");
        }
        assert_eq!(wanted.is_empty(), one_in == 9999, "{bricks:?}");
    }
}
