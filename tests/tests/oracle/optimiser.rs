//! Adam, and the rows of a subset.

use engine::gpu::{Gpu, Kernel};
use engine::passes::Rows;
use engine::splat::Splat;
use rand::RngExt;
use rand_pcg::Pcg64;
use reference::{adam, rows};
use shaders_glsl::types::{AdamParams, History, SplatGrad};
use vgs_tests::scene::{random, splat};
use vgs_tests::{Bound, Device, assert_close};

use super::run;

struct AdamRows {
    splats: Vec<Splat>,
    first: Vec<SplatGrad>,
    second: Vec<SplatGrad>,
    frozen: u32,
    histories: Vec<History>,
}

fn params(count: usize) -> AdamParams {
    AdamParams {
        splat_count: count as u32,
        chunk_count: 2,
        capacity: 100,
        beta1: 0.8,
        beta2: 0.9,
        correction1: 1.7,
        correction2: 3.1,
        epsilon: 1e-15,
        rate_mean: [0.2, 0.3, 0.1],
        rate_rotation: 0.12,
        rate_log_scale: 0.11,
        rate_opacity: 0.21,
        rate_intensity: 0.02,
        min_log_scale: [-0.9, -0.7, -1.1],
        max_log_scale: [1.5, 1.2, 1.0],
        scale_weight: 0.03,
        max_logit: 4.5,
        min_intensity: -0.45,
        max_intensity: 0.4,
        max_mean: [30.5, 31.5, 18.0],
    }
}

fn step(
    gpu: &Gpu,
    state: &AdamRows,
    gradients: &[SplatGrad],
    pair_totals: &[u32],
    params: &AdamParams,
) -> AdamRows {
    let kernel = Kernel::new(gpu, &shaders_glsl::ADAM, &[]).unwrap();
    let gradients = gpu.upload("gradients", "test", gradients).unwrap();
    let mut splats = gpu.upload("splats", "test", &state.splats).unwrap();
    let mut first = gpu.upload("first", "test", &state.first).unwrap();
    let mut second = gpu.upload("second", "test", &state.second).unwrap();
    let totals = gpu.upload("pair totals", "test", pair_totals).unwrap();
    let mut frozen = gpu.upload("frozen", "test", &[state.frozen]).unwrap();
    let mut histories = gpu.upload("histories", "test", &state.histories).unwrap();
    run(gpu, |r| {
        r.pass(&kernel)
            .read("gradients", &gradients)
            .write("splats", &mut splats)
            .write("first_moments", &mut first)
            .write("second_moments", &mut second)
            .read("pair_totals", &totals)
            .write("frozen", &mut frozen)
            .write("histories", &mut histories)
            .push(params)
            .dispatch_over(params.splat_count);
    });
    AdamRows {
        splats: splats.read().unwrap(),
        first: first.read().unwrap(),
        second: second.read().unwrap(),
        frozen: frozen.read().unwrap()[0],
        histories: histories.read().unwrap(),
    }
}

fn row(rng: &mut Pcg64, low: f32, high: f32) -> SplatGrad {
    let mut row = SplatGrad::default();
    let lanes: &mut [f32; 11] = bytemuck::cast_mut(&mut row);
    *lanes = std::array::from_fn(|_| rng.random_range(low..high));
    row
}

pub fn adam() {
    let gpu = Device::boot();
    let count = 300;
    let mut rng = random(31);
    let extent = glam::Vec3::new(34.0, 32.0, 19.0);
    let state = AdamRows {
        splats: (0..count).map(|_| splat(&mut rng, extent)).collect(),
        first: (0..count).map(|_| row(&mut rng, -0.1, 0.1)).collect(),
        second: (0..count).map(|_| row(&mut rng, 0.0, 0.02)).collect(),
        frozen: 3,
        histories: (0..count)
            .map(|i| History {
                gradient_norm: rng.random_range(0.0..2.0),
                // Some below the least scale, some between, some far beyond the greatest.
                log_scale_cap: [-1.5, 0.3, 1e30][i % 3],
            })
            .collect(),
    };
    let mut gradients: Vec<SplatGrad> = (0..count).map(|_| row(&mut rng, -0.5, 0.5)).collect();
    for (i, row) in gradients.iter_mut().enumerate() {
        let lanes: &mut [f32; 11] = bytemuck::cast_mut(row);
        match i % 50 {
            10 => *lanes = [0.0; 11],
            11 => *lanes = [1e-30; 11],
            12 => lanes[i / 50] = f32::NAN,
            13 => lanes[i / 50 + 3] = f32::INFINITY,
            14 => lanes[i / 50 + 5] = -1e20, // its square is not finite
            15 => *lanes = lanes.map(|v| v * 1e15),
            _ => {}
        }
    }
    let params = params(count);
    let got = step(&gpu, &state, &gradients, &[100, 0], &params);
    let (mut splats, mut moments, mut squares, mut norms) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let mut frozen = state.frozen;
    for (i, gradient) in gradients.iter().enumerate() {
        let before = adam::AdamState {
            splat: (&state.splats[i]).into(),
            first: (&state.first[i]).into(),
            second: (&state.second[i]).into(),
            gradient_norm: f64::from(state.histories[i].gradient_norm),
            log_scale_cap: f64::from(state.histories[i].log_scale_cap),
        };
        let Some(want) = adam::adam(&before, &gradient.into(), &params) else {
            frozen += 1;
            assert_eq!(got.splats[i], state.splats[i], "splat {i} is frozen");
            assert_eq!((got.first[i], got.second[i]), (state.first[i], state.second[i]), "and its moments");
            assert_eq!(got.histories[i], state.histories[i], "and its history");
            continue;
        };
        let splat: reference::Splat = (&got.splats[i]).into();
        let lanes = |s: &reference::Splat| {
            let ([mx, my, mz], [sx, sy, sz]) = (s.mean.to_array(), s.log_scale.to_array());
            [
                mx,
                my,
                mz,
                sx,
                sy,
                sz,
                s.opacity_logit,
                s.intensity,
                s.rotation.x,
                s.rotation.y,
                s.rotation.z,
                s.rotation.w,
            ]
        };
        splats.extend(lanes(&splat).into_iter().zip(lanes(&want.splat)));
        let first: reference::Gradient = (&got.first[i]).into();
        let second: reference::Gradient = (&got.second[i]).into();
        moments.extend(first.lanes().into_iter().zip(want.first.lanes()));
        norms.push((f64::from(got.histories[i].gradient_norm), want.gradient_norm));
        assert_eq!(got.histories[i].log_scale_cap, state.histories[i].log_scale_cap);
        squares.extend(second.lanes().into_iter().zip(want.second.lanes()));
    }
    assert_close("adam: parameters", Bound::new(5e-7, 5e-7), splats);
    assert_close("adam: first moments", Bound::new(2e-8, 1e-6), moments);
    assert_close("adam: second moments", Bound::new(2e-9, 1e-6), squares);
    assert_close("adam: gradient norms", Bound::new(0.0, 1e-6), norms);
    assert_eq!((frozen - state.frozen, got.frozen), (18, frozen), "six NaN, six infinite, six too large");

    // A step whose bins were too small in any chunk moves nothing and counts nothing.
    for too_many in [[101, 7], [0, 1000]] {
        let void = step(&gpu, &state, &gradients, &too_many, &params);
        assert_eq!(void.splats, state.splats);
        assert!(void.first == state.first && void.second == state.second && void.frozen == state.frozen);
        assert_eq!(void.histories, state.histories);
    }
}

/// Splats of 12 words, half of them, in a random order.
struct Taken {
    gpu: Device,
    splats: Vec<Splat>,
    indices: Vec<u32>,
    first: usize,
}

impl Taken {
    fn new() -> Self {
        let mut rng = random(32);
        let extent = glam::Vec3::new(34.0, 32.0, 19.0);
        let splats: Vec<Splat> = (0..301).map(|_| splat(&mut rng, extent)).collect();
        let indices = (0..301).map(|i| (i * 160 + 7) % 301).collect();
        Taken { gpu: Device::boot(), splats, indices, first: 100 }
    }

    fn words(splats: &[Splat]) -> &[u32] {
        bytemuck::cast_slice(splats)
    }
}

pub fn gather_rows() {
    let Taken { gpu, splats, indices, first } = Taken::new();
    let kernels = Rows::new(&gpu).unwrap();
    let (rows, order) =
        (gpu.upload("rows", "test", &splats).unwrap(), gpu.upload("i", "test", &indices).unwrap());
    let mut gathered = gpu.buffer::<Splat>("gathered", "test", 150).unwrap();
    run(&gpu, |r| kernels.gather(r, &rows, &order, first, &mut gathered));
    let wanted = rows::gather_rows(Taken::words(&splats), &indices[first..first + 150], 12);
    assert_eq!(Taken::words(&gathered.read().unwrap()), wanted);
}

pub fn scatter_rows() {
    let Taken { gpu, splats, indices, first } = Taken::new();
    let kernels = Rows::new(&gpu).unwrap();
    let mut rows = gpu.upload("rows", "test", &splats).unwrap();
    let order = gpu.upload("i", "test", &indices).unwrap();
    let moved: Vec<Splat> = (0..150).map(|i| Splat { intensity: i as f32, ..Splat::default() }).collect();
    let gathered = gpu.upload("gathered", "test", &moved).unwrap();
    run(&gpu, |r| kernels.scatter(r, &gathered, &order, first, &mut rows));
    let mut wanted = Taken::words(&splats).to_vec();
    rows::scatter_rows(Taken::words(&moved), &indices[first..first + 150], 12, &mut wanted);
    assert_eq!(Taken::words(&rows.read().unwrap()), wanted);
}
