//! `picture_*`: standard splats blended on a picture, and the loss of the picture, over all splats and all pixels. The
//! kernels' derivatives are compared with central differences of [`loss()`] of [`picture()`].

use glam::{DVec2, DVec3, DVec4};
use splat::harmonics::basis;
use transfer::{Light, Material};

use super::Splat;
use super::eye::{Appearance, Eye};
use super::quads::{Face, Look, Quad, quad};

/// What is behind is not seen where less than this passes.
const LEAST_PASSED: f64 = 1e-4;
/// Radius of the windows of SSIM, pixels, their standard deviation, and its constants for a range of 1.
const WINDOW: (i64, f64) = (5, 1.5);
const SSIM: [f64; 2] = [1e-4, 9e-4];

/// Returns the colour of a splat towards an eye, from its coefficients.
pub fn colour(mean: DVec3, coefficients: &[DVec3], eye: &Eye) -> DVec3 {
    let basis = basis((mean - eye.position).normalize().to_array());
    let sum: DVec3 = coefficients.iter().zip(basis).map(|(c, y)| *c * y).sum();
    (sum + 0.5).max(DVec3::ZERO)
}

/// Returns a splat on a picture of `size` pixels, widened by `widening` pixels²; `None` if it cannot be seen.
pub fn projected(
    splat: &Splat,
    coefficients: &[DVec3],
    eye: &Eye,
    size: [u32; 2],
    widening: f64,
) -> Option<Quad> {
    let (material, light) = (Material::default(), Light::default());
    let look = Look { material: &material, light: &light, dark: 0.0, planes: &[], widening };
    let face = Face::Own(colour(splat.mean, coefficients, eye));
    quad(splat, &face, &Appearance::default(), eye, size, &look)
}

/// Returns the picture, rows from above: the colour over the background, and what passes of it.
pub fn picture(
    splats: &[(Splat, Vec<DVec3>)],
    eye: &Eye,
    size: [u32; 2],
    widening: f64,
    background: DVec3,
) -> Vec<DVec4> {
    let mut quads: Vec<Quad> =
        splats.iter().filter_map(|(s, c)| projected(s, c, eye, size, widening)).collect();
    quads.sort_by(|a, b| a.depth.total_cmp(&b.depth));
    let pixel = |i: u32| {
        let place = DVec2::new(f64::from(i % size[0]), f64::from(i / size[0])) + 0.5;
        let (mut colour, mut passed) = (DVec3::ZERO, 1.0);
        for quad in &quads {
            let opacity = quad.opacity(place);
            colour += quad.colour * (opacity * passed);
            passed *= 1.0 - opacity;
            if passed < LEAST_PASSED {
                break;
            }
        }
        (colour + background * passed).extend(passed)
    };
    (0..size[0] * size[1]).map(pixel).collect()
}

/// Returns the mean SSIM of two pictures, over pixels and channels (Wang et al. 2004). Beside a picture is 0.
fn ssim(a: &[DVec3], b: &[DVec3], size: [u32; 2]) -> f64 {
    let [width, height] = size.map(i64::from);
    let (reach, deviation) = WINDOW;
    let weight = |k: i64| (-((k * k) as f64) / (2.0 * deviation * deviation)).exp();
    let total: f64 = (-reach..=reach).map(weight).sum();
    let window: Vec<f64> = (-reach..=reach).map(|k| weight(k) / total).collect();
    let mut sum = DVec3::ZERO;
    for y in 0..height {
        for x in 0..width {
            let [mut ma, mut mb, mut aa, mut bb, mut ab] = [DVec3::ZERO; 5];
            for (j, wy) in window.iter().enumerate() {
                for (i, wx) in window.iter().enumerate() {
                    let (x, y) = (x + i as i64 - reach, y + j as i64 - reach);
                    if x < 0 || y < 0 || x >= width || y >= height {
                        continue;
                    }
                    let at = (y * width + x) as usize;
                    let (a, b, w) = (a[at], b[at], wx * wy);
                    ma += a * w;
                    mb += b * w;
                    aa += a * a * w;
                    bb += b * b * w;
                    ab += a * b * w;
                }
            }
            let [c1, c2] = SSIM;
            let above = (2.0 * ma * mb + c1) * (2.0 * (ab - ma * mb) + c2);
            let below = (ma * ma + mb * mb + c1) * (aa - ma * ma + bb - mb * mb + c2);
            sum += above / below;
        }
    }
    sum.dot(DVec3::ONE) / (3 * width * height) as f64
}

/// Returns the mean absolute error and the mean SSIM, over pixels and channels. `wanted` has colours times opacity, and
/// opacity.
pub fn losses(picture: &[DVec4], wanted: &[DVec4], size: [u32; 2], background: DVec3) -> [f64; 2] {
    let seen: Vec<DVec3> = picture.iter().map(|c| c.truncate()).collect();
    let want: Vec<DVec3> = wanted.iter().map(|c| c.truncate() + background * (1.0 - c.w)).collect();
    let absolute: f64 = seen.iter().zip(&want).map(|(a, b)| (*a - *b).abs().dot(DVec3::ONE)).sum();
    [absolute / (3.0 * seen.len() as f64), ssim(&seen, &want, size)]
}

/// Returns (1 - λ) |C - C*| + λ (1 - SSIM), λ the weight of SSIM.
pub fn loss([absolute, ssim]: [f64; 2], ssim_weight: f64) -> f64 {
    (1.0 - ssim_weight) * absolute + ssim_weight * (1.0 - ssim)
}
