//! Fields in HU on a small grid, sampled as in `fit::evaluate`.

use engine::fit::evaluate::{FieldSample, Sampler};
use engine::gpu::Gpu;
use engine::splat::{Field, Kernel, Splat};
use engine::volume::Bricks;
use engine::volume::bricks::SAMPLES;
use glam::{IVec3, UVec3};

use crate::scene::{EPSILON, random, splat};

/// All splat kernels.
pub const KERNELS: [Kernel; 3] = [Kernel::Compact, Kernel::Gaussian, Kernel::Density];
/// The quaternion without a rotation.
pub const IDENTITY: [f32; 4] = [1.0, 0.0, 0.0, 0.0];
/// Size of the grid, voxels.
pub const EXTENT: UVec3 = UVec3::new(20, 17, 12);

/// Creates the grid: all voxels of a box of [`EXTENT`].
pub fn bricks() -> Bricks {
    Bricks::of_box(IVec3::ZERO, EXTENT, |_| true)
}

/// Creates a field with the ε of the tests.
pub fn field(kernel: Kernel, background: f32) -> Field {
    Field { kernel, background, epsilon: EPSILON, occupancy_w0: 0.05 }
}

/// Evaluates a field at all samples that take part.
pub fn sample(
    gpu: &Gpu,
    splats: &[Splat],
    field: &Field,
    bricks: &Bricks,
    offset: [f32; 3],
) -> Vec<FieldSample> {
    let mut sampler = Sampler::new(gpu, splats, field, bricks).expect("a sampler");
    let all = sampler.sample(offset).expect("samples");
    let active = |i: &usize| bricks.is_active(i / SAMPLES, i % SAMPLES);
    (0..all.len()).filter(active).map(|i| all[i]).collect()
}

/// Creates random splats of −1000 to 3000 HU.
pub fn some_splats(seed: u64, count: usize) -> Vec<Splat> {
    let mut rng = random(seed);
    let hu = |s: Splat| Splat { intensity: s.intensity * 4000.0 + 1000.0, ..s };
    (0..count).map(|_| hu(splat(&mut rng, EXTENT.as_vec3()))).collect()
}

/// Creates a splat that is not rotated.
pub fn one(mean: [f32; 3], log_scale: [f32; 3], opacity_logit: f32, intensity: f32) -> Splat {
    Splat { mean, opacity_logit, rotation: IDENTITY, log_scale, intensity }
}

/// Returns the splats with all opacities times `factor`.
pub fn fainter(splats: &[Splat], factor: f64) -> Vec<Splat> {
    let scaled = |s: &Splat| {
        let alpha = factor / (1.0 + (-f64::from(s.opacity_logit)).exp());
        Splat { opacity_logit: (alpha.ln() - (-alpha).ln_1p()) as f32, ..*s }
    };
    splats.iter().map(scaled).collect()
}
