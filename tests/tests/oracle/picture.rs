//! Standard splats on a picture, the loss of the picture, and the derivatives by the splats.

use engine::gpu::{Buffer, Gpu, Kernel};
use engine::passes::picture::{HarmonicsState, Shot, Splats};
use engine::passes::{Picture, WorkgroupShape};
use engine::render::Camera;
use engine::splat::Splat;
use engine::splat::harmonics::basis_count;
use glam::{DQuat, DVec3, DVec4, Vec3};
use rand::RngExt;
use reference::eye::Eye;
use reference::picture;
use shaders_glsl::types::{
    AdamHarmonicsParams, PicturePairParams, PictureProjectParams, PictureSplat, SplatGrad,
};
use vgs_tests::scene::{random, splat};
use vgs_tests::{Bound, Device, assert_close};

use super::run;

/// A splat and its coefficients, for the reference implementation.
type Row = (reference::Splat, Vec<DVec3>);

/// No multiple of a tile, of the loss or of the picture.
const SIZE: [u32; 2] = [45, 37];
const SSIM_WEIGHT: f64 = 0.3;
const SHAPES: [WorkgroupShape; 2] = [WorkgroupShape::OneByOne, WorkgroupShape::SideBySide];
/// Some splats are behind it, mm.
const FARTHEST: f32 = 85.0;

/// Splats in mm about the origin, in front of and around a background, and what the picture should be.
struct Stage {
    splats: Vec<Splat>,
    coefficients: Vec<[f32; 3]>,
    degree: u8,
    shot: Shot,
    wanted: Vec<u32>,
}

fn stage(seed: u64, count: usize, degree: u8) -> Stage {
    let mut rng = random(seed);
    let splats: Vec<Splat> = (0..count)
        .map(|i| {
            let mut s = splat(&mut rng, Vec3::splat(40.0));
            s.mean = s.mean.map(|v| v - 20.0);
            s.log_scale = s.log_scale.map(|v| v + 0.6);
            // Some opacities are cut, and some splats are too faint to be drawn.
            s.opacity_logit = [-7.0, 6.0, 0.3, -1.0, 1.5][i % 5] + rng.random_range(-0.2..0.2);
            s
        })
        .collect();
    let coefficients = (0..count * basis_count(degree))
        .map(|_| std::array::from_fn(|_| rng.random_range(-0.9f32..0.9)))
        .collect();
    let mut camera =
        Camera::from_side("anterior-left-superior", DVec3::ZERO, 26.0, 40.0, 1.2).expect("a camera");
    camera.fov.left *= 0.8;
    let wanted = (0..SIZE[0] * SIZE[1])
        .map(|i| {
            let opacity = if i % SIZE[0] > 20 { rng.random_range(0u32..256) } else { 255 };
            (0..3).fold(opacity << 24, |word, c| word | rng.random_range(0..=opacity) << (8 * c))
        })
        .collect();
    let shot = Shot {
        view: camera.view(DVec3::ZERO),
        depths: [20.0, 200.0],
        widening: [0.3, 0.02][seed as usize % 2],
        background: [0.2, 0.9, 0.5],
    };
    Stage { splats, coefficients, degree, shot, wanted }
}

fn wide(v: [f32; 3]) -> DVec3 {
    Vec3::from_array(v).as_dvec3()
}

impl Stage {
    fn basis(&self) -> usize {
        basis_count(self.degree)
    }

    fn eye(&self) -> Eye {
        (&self.shot.view).into()
    }

    fn widening(&self) -> f64 {
        f64::from(self.shot.widening)
    }

    /// The splats for the reference implementation.
    fn rows(&self) -> Vec<Row> {
        let colours = self.coefficients.chunks(self.basis());
        self.splats
            .iter()
            .zip(colours)
            .map(|(s, c)| (s.into(), c.iter().copied().map(wide).collect()))
            .collect()
    }

    fn wanted(&self) -> Vec<DVec4> {
        let part = |word: u32, c: u32| f64::from(word >> (8 * c) & 255) / 255.0;
        self.wanted.iter().map(|&w| DVec4::from_array([0, 1, 2, 3].map(|c| part(w, c)))).collect()
    }

    fn picture_of(&self, rows: &[Row]) -> Vec<DVec4> {
        picture::picture(rows, &self.eye(), SIZE, self.widening(), wide(self.shot.background))
    }

    fn losses_of(&self, picture: &[DVec4]) -> [f64; 2] {
        picture::losses(picture, &self.wanted(), SIZE, wide(self.shot.background))
    }

    fn loss_of(&self, rows: &[Row]) -> f64 {
        picture::loss(self.losses_of(&self.picture_of(rows)), SSIM_WEIGHT)
    }

    fn params(&self) -> PictureProjectParams {
        PictureProjectParams {
            view: self.shot.view,
            size: SIZE,
            splat_count: self.splats.len() as u32,
            coefficients: self.basis() as u32,
            nearest: 20.0,
            farthest: FARTHEST,
            widening: self.shot.widening,
        }
    }
}

/// What a projection gives.
struct Projected {
    seen: Buffer<PictureSplat>,
    tile_counts: Vec<u32>,
    /// By depth.
    keys: Vec<u32>,
}

/// Draws, compares and differentiates.
fn made(gpu: &Gpu, stage: &Stage) -> Picture {
    made_with(gpu, stage, WorkgroupShape::of(gpu))
}

fn made_with(gpu: &Gpu, stage: &Stage, shape: WorkgroupShape) -> Picture {
    let splats = gpu.upload("splats", "test", &stage.splats).unwrap();
    let harmonics = gpu.upload("harmonics", "test", &stage.coefficients).unwrap();
    let wanted = gpu.upload("wanted", "test", &stage.wanted).unwrap();
    let mut picture = Picture::with_shape(gpu, stage.splats.len(), stage.basis(), SIZE, shape).unwrap();
    let of = Splats { splats: &splats, harmonics: &harmonics };
    loop {
        run(gpu, |r| {
            picture.draw(r, &of, &stage.shot);
            picture.compare(r, &wanted, stage.shot.background, SSIM_WEIGHT as f32);
            picture.differentiate(r, &of, &stage.shot);
        });
        let needed = picture.needed().unwrap();
        if needed <= picture.capacity() {
            return picture;
        }
        // What found no room is drawn and differentiated again.
        picture.grow(needed).unwrap();
    }
}

/// Projects with the kernel alone.
fn projected(gpu: &Gpu, stage: &Stage) -> Projected {
    let kernel = Kernel::new(gpu, &shaders_glsl::PICTURE_PROJECT, &[]).unwrap();
    let splats = gpu.upload("splats", "test", &stage.splats).unwrap();
    let harmonics = gpu.upload("harmonics", "test", &stage.coefficients).unwrap();
    let count = stage.splats.len();
    let mut seen = gpu.buffer("seen", "test", count).unwrap();
    let [mut tile_counts, mut keys, mut values] =
        ["tile counts", "keys", "values"].map(|name| gpu.buffer(name, "test", count).unwrap());
    run(gpu, |r| {
        r.pass(&kernel)
            .read("splats", &splats)
            .read("harmonics_of", &harmonics)
            .write("picture_splats", &mut seen)
            .write("tile_counts", &mut tile_counts)
            .write("keys", &mut keys)
            .write("values", &mut values)
            .push(&stage.params())
            .dispatch_over(count as u32);
    });
    assert!(values.read().unwrap().into_iter().eq(0..count as u32), "a splat's value is its number");
    let [tile_counts, keys] = [tile_counts, keys].map(|buffer: Buffer<u32>| buffer.read().unwrap());
    Projected { seen, tile_counts, keys }
}

pub fn picture_project() {
    let gpu = Device::boot();
    for degree in 0..=3 {
        let stage = stage(300 + u64::from(degree), 400, degree);
        let Projected { seen, keys, .. } = projected(&gpu, &stage);
        let (mut places, mut shapes, mut values, mut steps) = (vec![], vec![], vec![], vec![]);
        for ((got, key), (s, c)) in seen.read().unwrap().iter().zip(keys).zip(stage.rows()) {
            let Some(wanted) = picture::projected(&s, &c, &stage.eye(), SIZE, stage.widening()) else {
                continue;
            };
            let part = ((wanted.depth - 20.0) / (f64::from(FARTHEST) - 20.0)).clamp(0.0, 1.0);
            steps.push((f64::from(key), part * f64::from(shaders_glsl::picture::DEPTH_STEPS)));
            let unit = wanted.covariance.determinant().sqrt();
            let conic = wanted.covariance.inverse() * unit;
            places.extend(got.centre.iter().zip(wanted.centre.to_array()).map(|(&g, w)| (f64::from(g), w)));
            let wanted_conic = [conic.x_axis.x, conic.x_axis.y, conic.y_axis.y];
            shapes.extend(got.conic.iter().zip(wanted_conic).map(|(&g, w)| (f64::from(g) * unit, w)));
            values.push((f64::from(got.opacity), wanted.thickness));
            values.push((f64::from(got.depth), wanted.depth));
            values.extend(got.colour.iter().zip(wanted.colour.to_array()).map(|(&g, w)| (f64::from(g), w)));
        }
        assert!(places.len() > 300, "{} splats are too few to tell", places.len() / 2);
        assert_close("picture_project: centres", Bound::new(2e-4, 1e-6), places);
        assert_close("picture_project: conics", Bound::new(1e-4, 1e-4), shapes);
        assert_close("picture_project: opacity, depth, colour", Bound::new(1e-5, 1e-5), values);
        assert_close("picture_project: keys", Bound::new(16.0, 0.0), steps);
    }
}

pub fn picture_pairs() {
    let gpu = Device::boot();
    let stage = stage(310, 300, 1);
    let Projected { seen, tile_counts: counts, .. } = projected(&gpu, &stage);
    // In any order, as here from the last to the first.
    let order: Vec<u32> = (0..counts.len() as u32).rev().collect();
    let mut offsets = vec![0];
    for count in counts.iter().rev() {
        offsets.push(offsets[offsets.len() - 1] + count);
    }
    let total = offsets[counts.len()] as usize;
    let kernel = Kernel::new(&gpu, &shaders_glsl::PICTURE_PAIRS, &[]).unwrap();
    let pair_offsets = gpu.upload("offsets", "test", &offsets).unwrap();
    let order = gpu.upload("order", "test", &order).unwrap();
    let emitted = |capacity: usize| {
        let [mut keys, mut values, mut splats] = ["keys", "values", "splats"]
            .map(|name| gpu.upload(name, "test", &vec![u32::MAX; total]).unwrap());
        run(&gpu, |r| {
            r.pass(&kernel)
                .read("order", &order)
                .read("picture_splats", &seen)
                .read("pair_offsets", &pair_offsets)
                .write("keys", &mut keys)
                .write("values", &mut values)
                .write("pair_splats", &mut splats)
                .push(&PicturePairParams {
                    size: SIZE,
                    splat_count: counts.len() as u32,
                    capacity: capacity as u32,
                })
                .dispatch_over(counts.len() as u32);
        });
        [keys, values, splats].map(|buffer| buffer.read().unwrap())
    };
    let [keys, values, splats] = emitted(total);
    assert!(values.iter().copied().eq(0..total as u32), "a pair's value is its number");
    // Each splat has the tiles with a pixel that it is drawn in, and hardly any other.
    let columns = SIZE[0].div_ceil(8);
    let mut idle = 0;
    for (i, (s, c)) in stage.rows().iter().enumerate() {
        let rank = counts.len() - 1 - i;
        let own = offsets[rank] as usize..offsets[rank + 1] as usize;
        assert!(splats[own.clone()].iter().all(|&s| s == i as u32), "the pairs of splat {i} are together");
        let tiles = &keys[own];
        let quad = picture::projected(s, c, &stage.eye(), SIZE, stage.widening());
        for tile in 0..columns * SIZE[1].div_ceil(8) {
            let drawn = |margin: f64| {
                quad.as_ref().is_some_and(|quad| {
                    (0..64).any(|pixel| {
                        let place = [tile % columns * 8 + pixel % 8, tile / columns * 8 + pixel / 8];
                        let inside = place[0] < SIZE[0] && place[1] < SIZE[1];
                        let d = glam::DVec2::from_array(place.map(f64::from)) + 0.5 - quad.centre;
                        inside && d.dot(quad.covariance.inverse() * d) < quad.edge() * margin
                    })
                })
            };
            match tiles.contains(&tile) {
                true => idle += usize::from(!drawn(1.001)),
                false => assert!(!drawn(0.999), "splat {i} is drawn in tile {tile} and has no pair there"),
            }
        }
    }
    // Between the middles of the pixels a tile has places where no pixel is.
    assert!(idle * 10 < total, "{idle} of {total} pairs are of tiles that the splat is not drawn in");
    let [fewer, ..] = emitted(total / 2);
    assert_eq!(fewer[..total / 2], keys[..total / 2]);
    assert!(fewer[total / 2..].iter().all(|&key| key == u32::MAX), "nothing is written behind the capacity");
}

pub fn picture_blend() {
    let gpu = Device::boot();
    for (seed, count) in [(320, 300), (321, 3), (322, 2000)] {
        let stage = stage(seed, count, 2);
        let [got, other] = SHAPES.map(|shape| made_with(&gpu, &stage, shape).colours.read().unwrap());
        let bits = |picture: &[[f32; 4]]| picture.iter().map(|c| c.map(f32::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&got), bits(&other), "both shapes have the same bits");
        let wanted = stage.picture_of(&stage.rows());
        let pairs = got.iter().zip(&wanted).flat_map(|(g, w)| g.map(f64::from).into_iter().zip(w.to_array()));
        // Where an opacity is cut to 0, and where the walk ends, either side may be right.
        assert_close("picture_blend", Bound::new(3e-5, 0.0).outliers(0.02, 8e-3), pairs);
    }
}

pub fn picture_ssim() {
    let gpu = Device::boot();
    let stage = stage(330, 200, 1);
    let picture = made(&gpu, &stage);
    let seen: Vec<DVec4> =
        picture.colours.read().unwrap().iter().map(|c| DVec4::from_array(c.map(f64::from))).collect();
    let wanted = stage.losses_of(&seen);
    assert_close("picture_ssim", Bound::new(2e-6, 0.0), picture.losses().unwrap().into_iter().zip(wanted));
}

pub fn picture_loss_grad() {
    let gpu = Device::boot();
    let stage = stage(340, 200, 1);
    let picture = made(&gpu, &stage);
    let seen: Vec<DVec4> =
        picture.colours.read().unwrap().iter().map(|c| DVec4::from_array(c.map(f64::from))).collect();
    let got = picture.picture_gradient.read().unwrap();
    let mut rng = random(341);
    let loss = |picture: &[DVec4]| picture::loss(stage.losses_of(picture), SSIM_WEIGHT);
    let count = (SIZE[0] * SIZE[1]) as usize;
    // The corners, and others.
    let places =
        [0, SIZE[0] as usize - 1, count - 1].into_iter().chain((0..40).map(|_| rng.random_range(0..count)));
    let pairs = places.flat_map(|at| (0..3).map(move |c| (at, c))).map(|(at, c)| {
        let moved = |step: f64| {
            let mut moved = seen.clone();
            moved[at][c] += step;
            loss(&moved)
        };
        let slope = (moved(1e-6) - moved(-1e-6)) / 2e-6;
        (f64::from(got[at][c]) * count as f64, slope * count as f64)
    });
    assert_close("picture_loss_grad", Bound::new(2e-4, 1e-3), pairs);
}

/// All of the way back: the derivatives of the loss by each parameter against central differences of the reference.
pub fn picture_blend_grad() {
    let gpu = Device::boot();
    for (seed, degree) in [(350, 0), (351, 1), (352, 3)] {
        let stage = stage(seed, 16, degree);
        let base = stage.rows();
        // An opacity that is cut to 0 at 1/255 jumps there; of three steps the middle slope has no jump in it.
        let slope = |change: &dyn Fn(&mut Row, f64), i: usize| {
            let mut slopes = [1e-5, 3e-6, 1e-6].map(|step| {
                let moved = |step: f64| {
                    let mut rows = base.clone();
                    change(&mut rows[i], step);
                    stage.loss_of(&rows)
                };
                (moved(step) - moved(-step)) / (2.0 * step)
            });
            slopes.sort_by(f64::total_cmp);
            slopes[1]
        };
        let (mut shapes, mut own) = (vec![], vec![]);
        for i in 0..base.len() {
            for k in 0..3 {
                shapes.push(slope(&|(s, _), step| s.mean[k] += step, i));
                shapes.push(slope(&|(s, _), step| s.log_scale[k] += step, i));
                let turn = |(s, _): &mut Row, step: f64| {
                    s.rotation *= DQuat::from_scaled_axis(DVec3::AXES[k] * step);
                };
                shapes.push(slope(&turn, i));
            }
            shapes.push(slope(&|(s, _), step| s.opacity_logit += step, i));
            for k in 0..stage.basis() {
                own.extend([0, 1, 2].map(|c| slope(&|(_, colour), step| colour[k][c] += step, i)));
            }
        }
        for shape in SHAPES {
            let picture = made_with(&gpu, &stage, shape);
            let rows = picture.rows.read().unwrap();
            assert!(rows.iter().all(|row| row.intensity == 0.0));
            let of_shape = rows.iter().flat_map(|row| {
                let SplatGrad { mean, opacity_logit, rotation, log_scale, .. } = *row;
                (0..3)
                    .flat_map(move |k| [mean[k], log_scale[k], rotation[k]])
                    .chain(std::iter::once(opacity_logit))
            });
            let of_colour = picture.harmonic_rows.read().unwrap().into_iter().flatten();
            let bound = Bound::new(1e-3, 2e-3).outliers(0.01, 0.05);
            let compare = |what: &str, got: Vec<f32>, slopes: &[f64]| {
                assert_eq!(got.len(), slopes.len());
                let unit = slopes.iter().map(|w| w.abs()).fold(0.0, f64::max);
                let pairs = got.into_iter().zip(slopes).map(|(g, w)| (f64::from(g) / unit, w / unit));
                assert_close(
                    &format!("picture_blend_grad, degree {degree}, {shape:?}: {what}"),
                    bound,
                    pairs,
                );
            };
            compare("shapes", of_shape.collect(), &shapes);
            compare("colours", of_colour.collect(), &own);
        }
    }
}

/// The same bits again, gradients of zero for splats that are not seen, and none that is not a number.
pub fn picture_project_grad() {
    let gpu = Device::boot();
    let mut stage = stage(360, 500, 2);
    for s in stage.splats.iter_mut().step_by(7) {
        s.mean = [900.0, -3.0, 5.0];
    }
    stage.splats[1].log_scale = [-30.0; 3];
    stage.splats[2].log_scale = [12.0, -12.0, 0.0];
    stage.splats[3].opacity_logit = 1000.0;
    stage.splats[4].mean = [f32::NAN, 0.0, 0.0];
    let [first, second] = [(); 2].map(|()| made(&gpu, &stage));
    let (rows, colours) = (first.rows.read().unwrap(), first.harmonic_rows.read().unwrap());
    assert_eq!(
        bytemuck::cast_slice::<_, u8>(&rows),
        bytemuck::cast_slice::<_, u8>(&second.rows.read().unwrap())
    );
    assert_eq!(colours, second.harmonic_rows.read().unwrap());
    for (i, row) in rows.iter().enumerate() {
        let floats: [f32; 11] = bytemuck::cast(*row);
        assert!(floats.iter().all(|v| v.is_finite()), "{i}: {row:?}");
        if i % 7 == 0 || i == 4 {
            assert!(floats.iter().all(|&v| v == 0.0), "{i}: {row:?}");
            assert!(colours[i * 9..][..9].iter().flatten().all(|&v| v == 0.0));
        }
    }
}

pub fn adam_harmonics() {
    let gpu = Device::boot();
    let (splats, coefficients) = (50, 4);
    let count = splats * coefficients;
    let mut rng = random(370);
    let mut values = |low: f32, high: f32| -> Vec<[f32; 3]> {
        (0..count).map(|_| std::array::from_fn(|_| rng.random_range(low..high))).collect()
    };
    let (before, mut gradients) = (values(-1.0, 1.0), values(-0.3, 0.3));
    gradients[5] = [f32::NAN, 0.0, 0.0];
    let mut state = HarmonicsState::new(&gpu, &before).unwrap();
    let mut picture = Picture::new(&gpu, splats, coefficients, SIZE).unwrap();
    let params = |step: i32, capacity: u32| AdamHarmonicsParams {
        splat_count: splats as u32,
        coefficients: coefficients as u32,
        capacity,
        beta1: 0.9,
        beta2: 0.99,
        correction1: (1.0 / (1.0 - 0.9f64.powi(step))) as f32,
        correction2: (1.0 / (1.0 - 0.99f64.powi(step))) as f32,
        epsilon: 1e-15,
        rate: 0.02,
        rate_rest: 0.001,
    };
    picture.harmonic_rows.write_range(0, &gradients).unwrap();
    picture.pair_totals.write_range(0, &[10]).unwrap();
    run(&gpu, |r| picture.step_harmonics(r, &mut state, &params(1, 9)));
    assert_eq!(state.harmonics.read().unwrap(), before, "a step without room is void");
    for step in 1..=2 {
        run(&gpu, |r| picture.step_harmonics(r, &mut state, &params(step, 10)));
    }
    let pairs = state.harmonics.read().unwrap().into_iter().zip(before).zip(gradients).enumerate().flat_map(
        |(i, ((got, before), g))| {
            let rate = if i % coefficients == 0 { 0.02 } else { 0.001 };
            // The same gradient twice: both of Adam's means are of it alone.
            let sound = g.iter().all(|v| v.is_finite());
            let moved = move |c: usize| if sound { 2.0 * rate * f64::from(g[c].signum()) } else { 0.0 };
            (0..3).map(move |c| (f64::from(got[c]), f64::from(before[c]) - moved(c)))
        },
    );
    assert_close("adam_harmonics", Bound::new(1e-6, 1e-6), pairs);
}
