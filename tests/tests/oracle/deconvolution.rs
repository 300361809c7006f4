//! Mode alpha: extinction and colour of each splat.

use engine::passes::deconvolution::{DevicePoints, Points, ROUNDS, index_of, pair, weight_of};
use engine::passes::{Deconvolution, Lists};
use engine::render::{Look, LookBuffers};
use engine::transfer::{Table, preset};
use glam::DVec3;
use rand::RngExt;
use reference::deconvolution;
use vgs_tests::scene::random;
use vgs_tests::{Bound, Device, assert_close};

use super::run;

const RANGE: [f64; 2] = [-300.0, 1300.0];

/// Creates points in `splats` splats, of which some draw nowhere, and among which some see nothing.
fn points(seed: u64, splats: usize, count: usize) -> Points {
    let mut rng = random(seed);
    let mut pairs = Vec::new();
    for point in 0..count {
        for _ in 0..rng.random_range(0..9) {
            let splat = rng.random_range(0..splats);
            if splat % 13 != 5 {
                pairs.push((point, splat, rng.random_range(0.0f32..1.0)));
            }
        }
    }
    let lists = |count, row: fn(&(usize, usize, f32)) -> (usize, usize)| {
        Lists::new(count, |take| {
            for found in &pairs {
                let (list, other) = row(found);
                take(list, pair(other as u32, found.2));
            }
        })
    };
    let mut value = |_| [rng.random_range(-400.0f32..1500.0), rng.random_range(-0.2f32..1.0).max(0.0)];
    let values = (0..count).map(&mut value).collect();
    let of_splats = lists(splats, |&(point, splat, _)| (splat, point));
    let shares = (0..splats).map(|_| rng.random_range(0.0f32..1.3)).collect();
    Points { values, of_points: lists(count, |&(point, splat, _)| (point, splat)), of_splats, shares }
}

/// Compares the media after one round and after all with the reference implementation.
fn check(rounds: u32) {
    let gpu = Device::boot();
    for (seed, name) in (0..).zip(["CT-Bone", "CT-Bones-Steep", "CT-Soft-Tissue"]) {
        let points = points(seed, 70 + 64 * seed as usize, 300);
        let look = Look::new(preset(name).unwrap().over([-1000.0, 2000.0]));
        let buffers = LookBuffers::new(&gpu, &look, RANGE, DVec3::ZERO).unwrap();
        let device = DevicePoints::new(&gpu, &points).unwrap();
        let mut made = Deconvolution::new(&gpu, &device).unwrap();
        let tables = (&buffers.rows, &buffers.points, &buffers.integrals);
        run(&gpu, |r| made.record(r, &device, (buffers.number, tables), rounds));
        let lists = |lists: &Lists| -> Vec<deconvolution::List> {
            let list =
                |i| lists.of(i).iter().map(|&pair| (index_of(pair), f64::from(weight_of(pair)))).collect();
            (0..lists.len()).map(list).collect()
        };
        let of = deconvolution::Points {
            values: &points.values,
            of_points: &lists(&points.of_points),
            of_splats: &lists(&points.of_splats),
            shares: &points.shares,
        };
        let wanted = deconvolution::media(&of, &Table::new(&look.transfer, RANGE), rounds);
        let got = made.media.read().unwrap();
        let logs = got.iter().zip(&wanted).flat_map(|(got, wanted)| {
            // What draws nothing has no logarithm.
            let log = |medium: f64| medium.max(1e-30).ln();
            got.iter().zip(wanted.to_array()).map(move |(&g, w)| (log(f64::from(g)), log(w)))
        });
        // The entries of a look and what pairs lead to are rounded to 16 bits.
        assert_close(&format!("{name}, {rounds} rounds"), Bound::new(0.02, 0.0).outliers(0.02, 0.4), logs);
    }
}

pub fn deconvolve_points() {
    check(2);
}

pub fn deconvolve_splats() {
    check(1);
    check(ROUNDS + 1);
}

#[test]
fn rounds_over_several_frames_give_the_bits_of_one_frame() {
    let gpu = Device::boot();
    let points = points(9, 120, 500);
    let looks = ["CT-Bone", "CT-Soft-Tissue"].map(|name| {
        let look = Look::new(preset(name).unwrap().over([-1000.0, 2000.0]));
        LookBuffers::new(&gpu, &look, RANGE, DVec3::ZERO).unwrap()
    });
    let device = DevicePoints::new(&gpu, &points).unwrap();
    let frame = |made: &mut Deconvolution, look: &LookBuffers, at_most| {
        let tables = (&look.rows, &look.points, &look.integrals);
        run(&gpu, |r| made.record(r, &device, (look.number, tables), at_most));
    };
    let mut at_once = Deconvolution::new(&gpu, &device).unwrap();
    frame(&mut at_once, &looks[0], u32::MAX);
    let mut slow = Deconvolution::new(&gpu, &device).unwrap();
    // The look changes before its rounds are done, and frames after the last round change nothing.
    frame(&mut slow, &looks[1], 1);
    frame(&mut slow, &looks[1], 1);
    for _ in 0..ROUNDS {
        frame(&mut slow, &looks[0], 1);
    }
    assert_ne!(slow.media.read().unwrap(), at_once.media.read().unwrap());
    for _ in 0..2 {
        frame(&mut slow, &looks[0], 1);
        assert_eq!(slow.media.read().unwrap(), at_once.media.read().unwrap());
    }
}
