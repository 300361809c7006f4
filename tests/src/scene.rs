//! Seeded scenes: splats that differ as much as possible, and a brick grid with holes.

use engine::splat::{Kernel, Splat};
use engine::volume::Bricks;
use engine::volume::bricks::SAMPLES;
use glam::{IVec3, UVec3, Vec3};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use reference::Samples;
use shaders_glsl::types::Target;

/// ε of equation (2) in the tests.
pub const EPSILON: f32 = 1e-3;

/// Creates a random stream for a seed.
pub fn random(seed: u64) -> Pcg64 {
    Pcg64::seed_from_u64(seed)
}

/// Splats over a brick grid, with the samples' targets and positions.
#[derive(Clone)]
pub struct Scene {
    /// The sample grid.
    pub bricks: Bricks,
    /// Splats in local voxels and units of the fit.
    pub splats: Vec<Splat>,
    /// Targets of all samples, in memory order.
    pub targets: Vec<Target>,
    /// Kernel of the splats.
    pub kernel: Kernel,
    /// Displacement of the samples from the voxel centres, voxels.
    pub offset: [f32; 3],
}

impl Scene {
    /// Creates `count` random splats over a grid of 5 × 4 × 3 bricks, the outermost partly cut off, some of
    /// which have no slot; about one active sample in eight is missing. Among the splats are small and large,
    /// flat and long ones, some outside the grid and one that covers all of it. `soft` says that the mask has
    /// values between 0 and 1.
    pub fn random(seed: u64, count: usize, kernel: Kernel, soft: bool) -> Self {
        let mut rng = random(seed);
        let extent = UVec3::new(37, 32, 19);
        let holes: Vec<u32> = (0..4).map(|_| rng.random_range(0..60)).collect();
        let bricks = Bricks::of_box(IVec3::new(3, -2, 7), extent, |v| {
            let brick = v / 8;
            let hole = holes.contains(&((brick.z * 4 + brick.y) * 5 + brick.x));
            !hole && (v.x * 7 + v.y * 3 + v.z * 5) % 8 != 0
        });
        let mut splats: Vec<Splat> = (0..count).map(|_| splat(&mut rng, extent.as_vec3())).collect();
        if count > 8 {
            splats[1].mean = [-60.0, 4.0, 4.0]; // reaches nothing
            splats[2].mean = [20.0, 90.0, 10.0]; // nor does this one
            splats[3].mean = [-3.0, 16.0, 10.0]; // from outside into the grid
            splats[3].log_scale = [2.0, 1.5, 0.5];
            splats[4].mean = [18.0, 16.0, 9.0]; // everywhere
            splats[4].log_scale = [4.0, 4.2, 3.9];
            splats[5].mean = [8.0, 8.0, 8.0]; // on a sample, at the corner of eight bricks
            splats[5].log_scale = [-0.9, -0.9, -0.9];
        }
        let targets = targets(&mut rng, &bricks, soft);
        let offset = std::array::from_fn(|_| rng.random_range(-0.5f32..0.5));
        Scene { bricks, splats, targets, kernel, offset }
    }

    /// Returns the positions of the samples, for the reference implementations.
    pub fn samples(&self) -> Samples<'_> {
        Samples::all(&self.bricks, self.offset)
    }

    /// Returns the splats in f64.
    pub fn splats64(&self) -> Vec<reference::Splat> {
        self.splats.iter().map(Into::into).collect()
    }

    /// Returns the targets in f64.
    pub fn targets64(&self) -> Vec<reference::Target> {
        self.targets.iter().map(Into::into).collect()
    }
}

/// Creates a splat anywhere in a box, of any opacity and orientation, with scales from 0.4 to 5 voxels.
pub fn splat(rng: &mut Pcg64, extent: Vec3) -> Splat {
    let mean = std::array::from_fn(|axis| rng.random_range(-2.0..extent[axis] + 2.0));
    Splat {
        mean,
        opacity_logit: rng.random_range(-5.0f32..5.0),
        rotation: rotation(rng),
        log_scale: std::array::from_fn(|_| rng.random_range(-0.9f32..1.6)),
        intensity: rng.random_range(-0.5f32..0.5),
    }
}

/// Creates a random rotation, as a unit quaternion (w, x, y, z).
pub fn rotation(rng: &mut Pcg64) -> [f32; 4] {
    loop {
        let q: [f64; 4] = std::array::from_fn(|_| rng.random_range(-1.0..1.0));
        let length = q.iter().map(|v| v * v).sum::<f64>().sqrt();
        if (0.1..1.0).contains(&length) {
            return q.map(|v| (v / length) as f32);
        }
    }
}

/// Creates random targets; samples that take no part are marked.
fn targets(rng: &mut Pcg64, bricks: &Bricks, soft: bool) -> Vec<Target> {
    let mut out = Vec::with_capacity(bricks.len() * SAMPLES);
    for slot in 0..bricks.len() {
        for morton in 0..SAMPLES {
            let value = rng.random_range(-0.5f32..0.5);
            let m = rng.random_range(0.0f32..1.0);
            let m = if soft { m } else { m.round() };
            out.push(if bricks.is_active(slot, morton) { Target::new(value, m) } else { Target::IDLE });
        }
    }
    out
}
