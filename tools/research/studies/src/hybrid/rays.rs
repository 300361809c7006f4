//! Unlit volume rendering of voxels in a region, on the CPU, and its derivative by the voxels.
//!
//! A ray gathers `C = Σ Tᵢ αᵢ c(vᵢ)` with `αᵢ = oᵢ (1 − exp(−κ(vᵢ) s))` over places `s` apart, front to back, where `v` and
//! `o` are the trilinear intensity and occupancy, and `c` and `κ` are of the transfer function. With `Rᵢ` the colour from behind place `i`,
//! `∂C/∂αᵢ = Tᵢ cᵢ − Rᵢ / (1 − αᵢ)` (Weiss and Navab 2021).

use engine::render::Camera;
use engine::transfer::TransferFunction;
use engine::volume::{Roi, Volume};
use glam::{DAffine3, DVec3};

/// Entries of a table.
const ENTRIES: usize = 4096;
/// Distance of places on a ray, in the least spacing of the voxels.
const STEP: f64 = 0.5;
/// A ray ends where less than this passes.
const DARK: f64 = 0.003;
/// Parts of a picture that are summed apart: the sums are the same on any number of cores.
const PARTS: usize = 4;

/// Colour and extinction (1/mm) of a transfer function at even intensities.
pub struct Table {
    low: f64,
    per_unit: f64,
    entries: Vec<(DVec3, f64)>,
}

impl Table {
    /// Samples a function from the least to the greatest intensity.
    pub fn new(function: &TransferFunction, [low, high]: [f64; 2]) -> Self {
        let step = (high - low).max(1e-6) / (ENTRIES - 1) as f64;
        let entry = |i: usize| {
            let v = low + i as f64 * step;
            (function.at(v).0, function.extinction(v))
        };
        Table { low, per_unit: 1.0 / step, entries: (0..ENTRIES).map(entry).collect() }
    }

    /// Returns colour and extinction at an intensity, and their derivatives by it.
    fn at(&self, v: f64) -> [(DVec3, f64); 2] {
        let place = (v - self.low) * self.per_unit;
        let i = place.clamp(0.0, (ENTRIES - 2) as f64) as usize;
        let (a, b) = (self.entries[i], self.entries[i + 1]);
        let slope = ((b.0 - a.0) * self.per_unit, (b.1 - a.1) * self.per_unit);
        let along = place - i as f64;
        if (0.0..=1.0).contains(&along) {
            let by = along / self.per_unit;
            [(a.0 + slope.0 * by, a.1 + slope.1 * by), slope]
        } else {
            [if along < 0.0 { a } else { b }, (DVec3::ZERO, 0.0)]
        }
    }
}

/// A place on a ray that shows something.
struct Place {
    voxel: DVec3,
    colour: DVec3,
    opacity: f64,
    /// Light that comes through from behind it, before it was met.
    passes: f64,
    /// Derivatives of colour and opacity by the intensity.
    slope: (DVec3, f64),
}

/// The region that rays go through.
pub struct Rays<'a> {
    roi: &'a Roi,
    size: [usize; 3],
    voxel_from_world: DAffine3,
    /// Corners of the region's box, voxels.
    bounds: [DVec3; 2],
    /// mm.
    step: f64,
}

/// A picture: colours over black, row by row from the top.
pub type Picture = Vec<DVec3>;

impl<'a> Rays<'a> {
    /// Prepares rays through the region of a volume, whose weights are its occupancy.
    pub fn new(volume: &Volume, roi: &'a Roi) -> Self {
        let [nx, ny, _] = volume.size;
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for i in roi.members() {
            let at = DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64);
            (low, high) = (low.min(at), high.max(at));
        }
        Rays {
            roi,
            size: volume.size,
            voxel_from_world: volume.voxel_from_world(),
            bounds: [low - 1.0, high + 1.0],
            step: STEP * volume.spacing_mm().min_element(),
        }
    }

    /// Returns the picture of voxels that a camera sees, `pixels` square.
    pub fn picture(&self, samples: &[f32], table: &Table, camera: &Camera, pixels: usize) -> Picture {
        let ray = |i: usize| self.gathered(samples, table, camera, pixels, i, &mut Vec::new());
        let part = |part: usize| (part..pixels * pixels).step_by(PARTS).map(ray).collect::<Vec<_>>();
        let parts = in_parts(part);
        (0..pixels * pixels).map(|i| parts[i % PARTS][i / PARTS]).collect()
    }

    /// Returns half the sum of the squared differences of a picture from the wanted one over pixels and channels, and
    /// adds its derivative by each voxel to `gradient`.
    pub fn difference(
        &self,
        samples: &[f32],
        table: &Table,
        camera: &Camera,
        wanted: &Picture,
        gradient: &mut [f64],
    ) -> f64 {
        let pixels = wanted.len().isqrt();
        let part = |part: usize| {
            let (mut sum, mut places) = (0.0, Vec::new());
            let mut found: Vec<(u32, f64)> = Vec::new();
            for i in (part..wanted.len()).step_by(PARTS) {
                places.clear();
                let colour = self.gathered(samples, table, camera, pixels, i, &mut places);
                let apart = colour - wanted[i];
                sum += 0.5 * apart.length_squared();
                let mut behind = DVec3::ZERO;
                for place in places.iter().rev() {
                    let Place { colour, opacity, passes, slope, .. } = place;
                    let by_opacity = *passes * *colour - behind / (1.0 - opacity).max(1e-9);
                    let by_value = apart.dot(by_opacity) * slope.1 + passes * opacity * apart.dot(slope.0);
                    behind += *passes * *opacity * *colour;
                    corners(self.size, place.voxel, |index, weight| {
                        found.push((index as u32, weight * by_value));
                    });
                }
            }
            (sum, found)
        };
        let mut sum = 0.0;
        for (of_part, found) in in_parts(part) {
            sum += of_part;
            found.into_iter().for_each(|(index, by_value)| gradient[index as usize] += by_value);
        }
        sum
    }

    /// Returns the colour of pixel `i`, and adds the places of its ray that show something.
    fn gathered(
        &self,
        samples: &[f32],
        table: &Table,
        camera: &Camera,
        pixels: usize,
        i: usize,
        places: &mut Vec<Place>,
    ) -> DVec3 {
        let fov = camera.fov;
        let [x, y] = [i % pixels, i / pixels].map(|at| (at as f64 + 0.5) / pixels as f64);
        let right = fov.left + (fov.right - fov.left) * x;
        let up = fov.up + (fov.down - fov.up) * y;
        let ray = (camera.forward() + camera.right * right + camera.up * up).normalize();
        let eye = self.voxel_from_world.transform_point3(camera.eye);
        let along = self.voxel_from_world.transform_vector3(ray);
        let [a, b] = self.bounds.map(|corner| (corner - eye) / along);
        let (from, to) = (a.min(b).max_element().max(0.0), a.max(b).min_element());
        let (mut colour, mut passes) = (DVec3::ZERO, 1.0);
        let mut t = from + 0.5 * self.step;
        while t < to && passes > DARK {
            let voxel = eye + along * t;
            t += self.step;
            let occupancy = self.roi.trilinear(voxel);
            if occupancy <= 0.0 {
                continue;
            }
            let mut value = 0.0;
            corners(self.size, voxel, |index, weight| value += weight * f64::from(samples[index]));
            let [(own, extinction), slope] = table.at(value);
            if extinction <= 0.0 && slope.1 <= 0.0 {
                continue;
            }
            let clear = (-extinction * self.step).exp();
            let opacity = occupancy * (1.0 - clear);
            colour += passes * opacity * own;
            let slope = (slope.0, occupancy * slope.1 * self.step * clear);
            places.push(Place { voxel, colour: own, opacity, passes, slope });
            passes *= 1.0 - opacity;
        }
        colour
    }
}

/// Runs a function for each part on threads and returns what they found, in order.
fn in_parts<T: Send>(work: impl Fn(usize) -> T + Sync) -> Vec<T> {
    std::thread::scope(|scope| {
        let work = &work;
        let parts: Vec<_> = (0..PARTS).map(|part| scope.spawn(move || work(part))).collect();
        parts
            .into_iter()
            .map(|part| part.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    })
}

/// Calls `take` with the voxels around a place, clamped to the grid, and their trilinear weights.
fn corners(size: [usize; 3], voxel: DVec3, mut take: impl FnMut(usize, f64)) {
    let most = DVec3::from_array(size.map(|n| (n - 1) as f64));
    let at = voxel.clamp(DVec3::ZERO, most);
    let first = at.floor().min((most - 1.0).max(DVec3::ZERO));
    let part = at - first;
    let [x, y, z] = first.to_array().map(|v| v as usize);
    for corner in 0..8usize {
        let step = [corner & 1, corner >> 1 & 1, corner >> 2];
        let weight: f64 = (0..3).map(|k| if step[k] == 1 { part[k] } else { 1.0 - part[k] }).product();
        if weight > 0.0 {
            take(((z + step[2]) * size[1] + y + step[1]) * size[0] + x + step[0], weight);
        }
    }
}

#[cfg(test)]
mod tests {
    use engine::render::Fov;
    use engine::transfer;

    use super::*;

    /// Returns a ball of bone in a sheet of soft tissue, its region, and a camera that sees it.
    fn scene() -> (Volume, Roi, Camera) {
        let size = [9, 8, 7];
        let at = |i: usize| DVec3::new((i % 9) as f64, (i / 9 % 8) as f64, (i / 72) as f64);
        let value = |i: usize| (500.0 - 140.0 * at(i).distance(DVec3::new(4.2, 3.7, 3.1))) as f32;
        let affine = DAffine3::from_scale(DVec3::new(0.8, 0.9, 1.1));
        let volume = Volume::new(size, affine, (0..504).map(value).collect());
        let inside = |i: usize| f32::from(u8::from(at(i).distance(DVec3::new(4.0, 4.0, 3.0)) < 3.2));
        let roi = Roi::new((0..504).map(inside).collect(), &volume).expect("a region");
        let fov = Fov::symmetric(30.0, 1.0);
        let camera = Camera::looking(DVec3::new(20.0, 6.0, 9.0), DVec3::new(3.3, 3.3, 3.4), DVec3::Z, fov);
        (volume, roi, camera.expect("a camera"))
    }

    #[test]
    fn derivatives_are_those_of_central_differences() {
        let (volume, roi, camera) = scene();
        let rays = Rays::new(&volume, &roi);
        for name in ["CT-Bone", "CT-Soft-Tissue"] {
            let function = transfer::load(name, [-500.0, 500.0]).expect("a preset");
            let table = Table::new(&function, [-1100.0, 1100.0]);
            let wanted: Picture = rays
                .picture(&volume.samples, &table, &camera, 12)
                .into_iter()
                .enumerate()
                .map(|(i, colour)| colour * 0.7 + 0.02 * (i % 5) as f64)
                .collect();
            let mut gradient = vec![0.0; volume.len()];
            rays.difference(&volume.samples, &table, &camera, &wanted, &mut gradient);
            let greatest = gradient.iter().fold(0.0, |most: f64, g| most.max(g.abs()));
            assert!(greatest > 0.0, "{name}");
            let moved = |voxel: usize, by: f32| {
                let mut samples = volume.samples.clone();
                samples[voxel] += by;
                rays.difference(&samples, &table, &camera, &wanted, &mut vec![0.0; samples.len()])
            };
            let mut checked = 0;
            for voxel in roi.members() {
                let found = (moved(voxel, 0.125) - moved(voxel, -0.125)) / 0.25;
                // A step over a corner of the table is not the derivative at it.
                let apart = (found - gradient[voxel]).abs();
                assert!(apart < 0.03 * greatest, "{name}, voxel {voxel}: {found} and {}", gradient[voxel]);
                checked += usize::from(gradient[voxel].abs() > 0.05 * greatest);
            }
            assert!(checked > 10, "{name}: {checked} voxels are seen");
        }
    }

    #[test]
    fn nothing_outside_of_the_region_is_seen() {
        let (volume, roi, camera) = scene();
        let rays = Rays::new(&volume, &roi);
        let table =
            Table::new(&transfer::load("CT-Bone", [-500.0, 500.0]).expect("a preset"), [-1100.0, 1100.0]);
        let picture = rays.picture(&volume.samples, &table, &camera, 16);
        assert!(picture.iter().any(|colour| colour.max_element() > 0.1));
        assert_eq!(picture[0], DVec3::ZERO, "a corner of the picture");
        let dark = vec![-1000.0; volume.len()];
        assert!(rays.picture(&dark, &table, &camera, 16).iter().all(|colour| *colour == DVec3::ZERO));
    }
}
