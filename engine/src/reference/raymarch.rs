//! Volume rendering by marching rays: emission and absorption, front to back, with gradient shading.
//!
//! A medium is an intensity h and an occupancy O on a voxel grid. Along a ray with step Δ (mm) the extinction is
//! σ = O · tf(h).extinction, a step's opacity 1 − exp(−σ Δ), and its colour tf(h).colour, lit where σ has a gradient
//! (Max, "Optical models for direct volume rendering", 1995; Levoy 1988). h is interpolated as Σ O h / Σ O, so that
//! nothing from outside the region bleeds in. Orthographic, f64; the world is mm.

use glam::{DAffine3, DMat3, DVec3};
use rayon::prelude::*;

/// Rays end where less light than this would pass.
const DARK: f64 = 1e-3;

/// Intensity and occupancy on a grid, x fastest.
#[derive(Clone, Debug)]
pub struct Medium {
    size: [usize; 3],
    voxel_from_world: DAffine3,
    /// O·h and O of each voxel.
    samples: Vec<[f32; 2]>,
    /// Whether a point with its low corner in a block of 4³ voxels may see an occupancy; blocks start at voxel -1.
    blocks: Vec<bool>,
}

/// Edge of a block, voxels.
const BLOCK: usize = 4;

/// A point of a transfer function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlPoint {
    /// Intensity, HU.
    pub hu: f64,
    /// Red, green, blue from 0 to 1.
    pub colour: DVec3,
    /// Extinction, 1/mm.
    pub extinction: f64,
}

/// Colour and extinction over intensity: linear between points of ascending intensity, constant beyond them.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferFunction(pub Vec<ControlPoint>);

/// An orthographic view; the axes are unit vectors at right angles in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// What the middle of the image shows, mm.
    pub target: DVec3,
    /// To the right of the image.
    pub right: DVec3,
    /// To the top of the image.
    pub up: DVec3,
    /// Millimetres per pixel.
    pub mm_per_pixel: f64,
    /// Width and height, pixels.
    pub size: [usize; 2],
}

impl Medium {
    /// # Panics
    /// If there is not one value and one occupancy for every voxel.
    pub fn new(size: [usize; 3], world_from_voxel: DAffine3, hu: &[f32], occupancy: &[f32]) -> Self {
        let count: usize = size.iter().product();
        assert!(hu.len() == count && occupancy.len() == count, "one value and one occupancy for every voxel");
        let samples = hu.iter().zip(occupancy).map(|(&h, &o)| {
            // 0 · NaN would be NaN.
            if o > 0.0 && h.is_finite() { [o * h, o] } else { [0.0; 2] }
        });
        let mut medium = Medium {
            size,
            voxel_from_world: world_from_voxel.inverse(),
            samples: samples.collect(),
            blocks: Vec::new(),
        };
        medium.blocks = medium.occupied_blocks();
        medium
    }

    fn block_counts(&self) -> [usize; 3] {
        self.size.map(|n| n / BLOCK + 1)
    }

    fn occupied_blocks(&self) -> Vec<bool> {
        let [bx, by, bz] = self.block_counts();
        let [nx, ny, _] = self.size;
        let mut blocks = vec![false; bx * by * bz];
        for (i, _) in self.samples.iter().enumerate().filter(|(_, s)| s[1] > 0.0) {
            // Voxel v is seen from low corners v - 1 and v, which are v and v + 1 when counted from -1.
            let voxel = [i % nx, i / nx % ny, i / (nx * ny)];
            let [xs, ys, zs] = voxel.map(|v| [v / BLOCK, (v + 1) / BLOCK]);
            for z in zs {
                for y in ys {
                    for x in xs {
                        blocks[(z * by + y) * bx + x] = true;
                    }
                }
            }
        }
        blocks
    }

    /// Whether there may be an occupancy at a point of the grid with its border.
    fn may_hold(&self, voxel: DVec3) -> bool {
        let counts = self.block_counts();
        let at = |axis: usize| ((voxel[axis] + 1.0).max(0.0) as usize / BLOCK).min(counts[axis] - 1);
        self.blocks[(at(2) * counts[1] + at(1)) * counts[0] + at(0)]
    }

    /// Intensity and occupancy at a point of voxel space; beyond the grid the occupancy fades to 0 over a voxel.
    pub fn sample(&self, voxel: DVec3) -> (f64, f64) {
        let low = voxel.floor();
        let part = voxel - low;
        let low = low.as_i64vec3();
        let mut sum = [0.0; 2];
        for corner in 0..8 {
            let mut share = 1.0;
            let mut index = 0;
            for axis in (0..3).rev() {
                let far = corner >> axis & 1;
                let at = low[axis] + far;
                if at < 0 || at >= self.size[axis] as i64 {
                    share = 0.0;
                    break;
                }
                share *= if far == 1 { part[axis] } else { 1.0 - part[axis] };
                index = index * self.size[axis] + at as usize;
            }
            if share > 0.0 {
                let [value, occupancy] = self.samples[index];
                sum[0] += share * f64::from(value);
                sum[1] += share * f64::from(occupancy);
            }
        }
        if sum[1] > 0.0 { (sum[0] / sum[1], sum[1]) } else { (0.0, 0.0) }
    }

    /// Where a ray in voxel space is inside the grid with its border of one voxel, as a range of its parameter.
    fn crossing(&self, origin: DVec3, direction: DVec3) -> Option<(f64, f64)> {
        let mut range = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            let (low, high) = (-1.0, self.size[axis] as f64);
            if direction[axis] == 0.0 {
                if !(low..=high).contains(&origin[axis]) {
                    return None;
                }
                continue;
            }
            let a = (low - origin[axis]) / direction[axis];
            let b = (high - origin[axis]) / direction[axis];
            range = (range.0.max(a.min(b)), range.1.min(a.max(b)));
        }
        (range.0 < range.1).then_some(range)
    }
}

impl TransferFunction {
    /// Colour and extinction at an intensity; black and clear without points.
    pub fn at(&self, hu: f64) -> (DVec3, f64) {
        let points = &self.0;
        let after = points.partition_point(|p| p.hu <= hu);
        match (after.checked_sub(1).map(|i| points[i]), points.get(after)) {
            (Some(a), Some(b)) => {
                let t = (hu - a.hu) / (b.hu - a.hu);
                (a.colour.lerp(b.colour, t), a.extinction + (b.extinction - a.extinction) * t)
            }
            (Some(a), None) => (a.colour, a.extinction),
            (None, Some(b)) => (b.colour, b.extinction),
            (None, None) => (DVec3::ZERO, 0.0),
        }
    }
}

/// Renders a view: colour and opacity of each pixel, colour times opacity, rows from the top. `step` is Δ in mm.
pub fn render(medium: &Medium, transfer: &TransferFunction, camera: &Camera, step: f64) -> Vec<[f32; 4]> {
    let [width, height] = camera.size;
    let forward = camera.up.cross(camera.right);
    (0..width * height)
        .into_par_iter()
        .map(|i| {
            let x = (i % width) as f64 + 0.5 - width as f64 / 2.0;
            let y = height as f64 / 2.0 - 0.5 - (i / width) as f64;
            let start = camera.target + (camera.right * x + camera.up * y) * camera.mm_per_pixel;
            march(medium, transfer, start, forward, camera, step)
        })
        .collect()
}

/// One ray through `start` along `forward` (unit, world).
fn march(
    medium: &Medium,
    transfer: &TransferFunction,
    start: DVec3,
    forward: DVec3,
    camera: &Camera,
    step: f64,
) -> [f32; 4] {
    let origin = medium.voxel_from_world.transform_point3(start);
    let direction = medium.voxel_from_world.transform_vector3(forward);
    let Some((first, last)) = medium.crossing(origin, direction) else { return [0.0; 4] };
    // Gradients in voxel space become normals in the world.
    let normals = medium.voxel_from_world.matrix3.transpose();
    let (mut colour, mut clear) = (DVec3::ZERO, 1.0);
    let mut index = (first / step).ceil();
    while index * step < last && clear > DARK {
        let voxel = origin + direction * (index * step);
        index += 1.0;
        if !medium.may_hold(voxel) {
            continue;
        }
        let (hu, occupancy) = medium.sample(voxel);
        let (base, extinction) = transfer.at(hu);
        let opacity = 1.0 - (-occupancy * extinction * step).exp();
        if opacity > 0.0 {
            let lit = shade(base, gradient(medium, transfer, voxel, &normals), forward, camera);
            colour += lit * (clear * opacity);
            clear *= 1.0 - opacity;
        }
    }
    [colour.x as f32, colour.y as f32, colour.z as f32, (1.0 - clear) as f32]
}

/// Gradient of σ in world space, by central differences over two voxels.
fn gradient(medium: &Medium, transfer: &TransferFunction, voxel: DVec3, normals: &DMat3) -> DVec3 {
    let sigma = |p: DVec3| {
        let (hu, occupancy) = medium.sample(p);
        occupancy * transfer.at(hu).1
    };
    let along = |axis: DVec3| sigma(voxel + axis) - sigma(voxel - axis);
    *normals * DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
}

/// Blinn and Phong with one light above the viewer's left shoulder; unlit where there is no surface.
fn shade(base: DVec3, gradient: DVec3, forward: DVec3, camera: &Camera) -> DVec3 {
    let Some(normal) = (-gradient).try_normalize() else { return base };
    let light = (-forward + 0.5 * camera.up - 0.4 * camera.right).normalize();
    let half = (light - forward).normalize();
    let diffuse = normal.dot(light).max(0.0);
    let shine = normal.dot(half).max(0.0).powi(30);
    base * (0.25 + 0.75 * diffuse) + DVec3::splat(0.12 * shine)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flat(extinction: f64) -> TransferFunction {
        TransferFunction(vec![ControlPoint { hu: 0.0, colour: DVec3::new(1.0, 0.5, 0.0), extinction }])
    }

    fn camera() -> Camera {
        Camera {
            target: DVec3::splat(7.5),
            right: DVec3::NEG_X,
            up: DVec3::Z,
            mm_per_pixel: 1.0,
            size: [5, 5],
        }
    }

    /// A slab of 8 voxels along y in a grid of 16³.
    fn slab() -> Medium {
        let occupancy: Vec<f32> =
            (0..4096).map(|i| f32::from(u8::from((4..12).contains(&(i / 16 % 16))))).collect();
        Medium::new([16; 3], DAffine3::IDENTITY, &vec![100.0; 4096], &occupancy)
    }

    #[test]
    fn a_slab_absorbs_by_its_thickness() {
        // Trilinear edges: the integral of the occupancy along the ray is exactly 8.
        for extinction in [0.01, 0.1, 0.5] {
            let image = render(&slab(), &flat(extinction), &camera(), 0.05);
            let expected = 1.0 - (-8.0 * extinction).exp();
            for pixel in image {
                assert!((f64::from(pixel[3]) - expected).abs() < 1e-3, "{pixel:?} against {expected}");
                assert!(pixel[1] < pixel[0] && pixel[2] <= pixel[1], "the colour is the transfer function's");
            }
        }
    }

    #[test]
    fn the_surface_towards_the_viewer_is_lit() {
        // The viewer stands at +y. A thin opaque skin shows its near side.
        let camera = camera();
        let image = render(&slab(), &flat(50.0), &camera, 0.1);
        let forward = camera.up.cross(camera.right);
        assert_eq!(forward, DVec3::NEG_Y);
        let facing = shade(DVec3::new(1.0, 0.5, 0.0), DVec3::NEG_Y, forward, &camera);
        assert!((f64::from(image[12][0]) - facing.x).abs() < 0.02, "{:?} {facing}", image[12]);
        let averted = shade(DVec3::new(1.0, 0.5, 0.0), DVec3::Y, forward, &camera);
        assert!(averted.x < 0.5 * facing.x);
    }

    #[test]
    fn intensities_outside_do_not_bleed_in() {
        let hu: Vec<f32> =
            (0..4096).map(|i| if (4..12).contains(&(i / 16 % 16)) { 50.0 } else { f32::NAN }).collect();
        let occupancy: Vec<f32> = hu.iter().map(|h| f32::from(u8::from(h.is_finite()))).collect();
        let medium = Medium::new([16; 3], DAffine3::IDENTITY, &hu, &occupancy);
        let (h, o) = medium.sample(DVec3::new(8.0, 3.25, 8.0));
        assert!((h - 50.0).abs() < 1e-6 && (o - 0.25).abs() < 1e-6, "{h} {o}");
        assert_eq!(medium.sample(DVec3::splat(-2.0)), (0.0, 0.0));
    }

    #[test]
    fn nothing_is_skipped_that_holds_something() {
        let size = [9, 8, 11];
        let marked = [[0, 0, 0], [3, 3, 3], [8, 7, 10], [4, 7, 5]];
        for mark in marked {
            let index = (mark[2] * size[1] + mark[1]) * size[0] + mark[0];
            let mut occupancy = vec![0.0; 9 * 8 * 11];
            occupancy[index] = 1.0;
            let medium = Medium::new(size, DAffine3::IDENTITY, &vec![1.0; 9 * 8 * 11], &occupancy);
            let mut skipped = 0;
            for i in 0..40 * 40 * 40 {
                let p = DVec3::new((i % 40) as f64, (i / 40 % 40) as f64, (i / 1600) as f64) * 0.31 - 1.0;
                if !medium.may_hold(p) {
                    skipped += 1;
                    assert_eq!(medium.sample(p).1, 0.0, "{p}");
                }
            }
            assert!(skipped > 32_000, "most of the grid is skipped: {skipped}");
        }
    }

    #[test]
    fn transfer_functions_are_linear_between_points_and_constant_beyond() {
        let point = |hu, extinction| ControlPoint { hu, colour: DVec3::splat(extinction), extinction };
        let tf = TransferFunction(vec![point(0.0, 0.0), point(10.0, 1.0)]);
        for (hu, expected) in [(-5.0, 0.0), (0.0, 0.0), (2.5, 0.25), (10.0, 1.0), (99.0, 1.0)] {
            assert_eq!(tf.at(hu), (DVec3::splat(expected), expected), "{hu}");
        }
        assert_eq!(TransferFunction(Vec::new()).at(0.0).1, 0.0);
    }
}
