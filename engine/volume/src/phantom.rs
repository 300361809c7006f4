//! A synthetic CT whose true value is known everywhere, not only at voxels.
//!
//! Air, an ellipsoid body of soft tissue with a brighter rim and a slow gradient, a long bone (a dense shell
//! around marrow), and curved, tapering, contrast-filled vessels. Every edge is a smooth step about one voxel
//! wide, so the scene is band-limited as a scan is. Only additions, products, quotients and square roots are
//! used, all of which IEEE 754 rounds alike on every machine: one seed gives the same bits everywhere.

use glam::{DAffine3, DVec3};
use rand_pcg::Pcg32;
use rand_pcg::rand_core::Rng;
use rayon::prelude::*;

use super::roi::empty;
use super::{Grid, Roi, Volume, VoxelSource};
use base::Result;

const AIR_HU: f64 = -1000.0;
const TISSUE_HU: f64 = 40.0;
const MARROW_HU: f64 = 180.0;
/// Number of capsules that approximate one vessel's curve.
const SEGMENTS: usize = 8;
const VESSELS: usize = 4;
/// Edge of the boxes in which the region is counted, voxels.
const BOX: usize = 64;

/// An analytic scene and the grid on which it is sampled.
#[derive(Clone, Debug)]
pub struct Phantom {
    size: [usize; 3],
    world_from_voxel: DAffine3,
    /// Half the size of the grid, mm.
    half: DVec3,
    /// Half the width of a smooth edge, mm.
    edge: f64,
    body: Ellipsoid,
    bone: Ellipsoid,
    marrow: Ellipsoid,
    bone_hu: f64,
    vessels: Vec<Vessel>,
}

#[derive(Clone, Copy, Debug)]
struct Ellipsoid {
    centre: DVec3,
    radii: DVec3,
}

impl Ellipsoid {
    /// Returns the signed distance to the surface to first order, negative inside.
    fn distance(&self, p: DVec3) -> f64 {
        let q = p - self.centre;
        let level = (q / self.radii).length();
        let slope = (q / (self.radii * self.radii)).length();
        if slope == 0.0 { -self.radii.min_element() } else { level * (level - 1.0) / slope }
    }
}

/// A chain of capsules along a quadratic Bézier curve.
#[derive(Clone, Debug)]
struct Vessel {
    points: [DVec3; SEGMENTS + 1],
    radii: [f64; SEGMENTS + 1],
    hu: f64,
}

impl Vessel {
    /// Returns the signed distance to the wall, negative inside, and the radius there.
    fn distance(&self, p: DVec3) -> (f64, f64) {
        let segment = |i: usize| {
            let (a, b) = (self.points[i], self.points[i + 1]);
            let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
            let radius = self.radii[i] + (self.radii[i + 1] - self.radii[i]) * t;
            ((p - (a + (b - a) * t)).length() - radius, radius)
        };
        (0..SEGMENTS).map(segment).min_by(|a, b| a.0.total_cmp(&b.0)).expect("a vessel has segments")
    }

    /// Returns true if all of a box is farther from the wall than `edge`, outside.
    fn is_far_from(&self, [low, high]: [DVec3; 2], edge: f64) -> bool {
        let reach = edge + self.radii.into_iter().fold(0.0, f64::max);
        let first = self.points.into_iter().fold(DVec3::INFINITY, DVec3::min) - reach;
        let last = self.points.into_iter().fold(DVec3::NEG_INFINITY, DVec3::max) + reach;
        (first.cmpgt(high) | last.cmplt(low)).any()
    }
}

/// A source of uniform numbers that does not depend on how a library turns bits into reals.
struct Uniform(Pcg32);

impl Uniform {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (f64::from(self.0.next_u32()) / 4_294_967_296.0)
    }

    fn vector(&mut self, low: DVec3, high: DVec3) -> DVec3 {
        let [x, y, z] = [0, 1, 2].map(|i| self.between(low[i], high[i]));
        DVec3::new(x, y, z)
    }
}

impl Phantom {
    /// Creates a scene that fills a grid of `size` voxels of `spacing_mm`, centred on the world's origin,
    /// with the axes of RAS. The seed places and shapes bone and vessels.
    ///
    /// # Panics
    /// If a size is zero or a spacing not positive.
    pub fn new(size: [usize; 3], spacing_mm: DVec3, seed: u64) -> Self {
        assert!(size.iter().all(|&n| n > 0) && spacing_mm.cmpgt(DVec3::ZERO).all(), "a grid with an extent");
        let counts = DVec3::from_array(size.map(|n| n as f64));
        let half = counts * spacing_mm / 2.0;
        let world_from_voxel =
            DAffine3 { translation: (counts - 1.0) * spacing_mm / -2.0, ..DAffine3::from_scale(spacing_mm) };
        let mut uniform = Uniform(Pcg32::new(seed, 0x7667_7321));
        let edge = 0.75 * spacing_mm.element_sum() / 3.0;
        let body = Ellipsoid { centre: DVec3::ZERO, radii: half * DVec3::new(0.9, 0.85, 1.1) };
        let bone = Ellipsoid {
            centre: half * uniform.vector(DVec3::new(-0.1, -0.45, -0.1), DVec3::new(0.1, -0.35, 0.1)),
            radii: half * uniform.vector(DVec3::new(0.2, 0.22, 0.5), DVec3::new(0.3, 0.3, 0.7)),
        };
        // The shell is at least as thick as its two edges, so that it reaches its full value.
        let shell = (0.25 * bone.radii.min_element()).max(2.0 * edge);
        let marrow = Ellipsoid { radii: (bone.radii - shell).max(DVec3::splat(0.1 * edge)), ..bone };
        let bone_hu = uniform.between(900.0, 1200.0);
        let vessels = (0..VESSELS).map(|i| vessel(&mut uniform, half, edge, i)).collect();
        Phantom { size, world_from_voxel, half, edge, body, bone, marrow, bone_hu, vessels }
    }

    /// Returns the true value at a world point (mm), HU.
    pub fn hu(&self, world: DVec3) -> f64 {
        let cover = |distance: f64| smooth_step(0.5 - 0.5 * distance / self.edge);
        let mix = |below: f64, above: f64, share: f64| below + (above - below) * share;
        let g = world / self.half;
        let skin = self.body.distance(world);
        // Slow change across the body, and a rim that brightens over the outermost eighth.
        let rim = smooth_step(1.0 + skin / (0.125 * self.half.min_element()));
        let tissue = TISSUE_HU + 20.0 * g.x + 10.0 * g.y * g.z + 60.0 * rim;
        let mut hu = mix(AIR_HU, tissue, cover(skin));
        hu = mix(hu, self.bone_hu * (1.0 + 0.1 * g.z), cover(self.bone.distance(world)));
        hu = mix(hu, MARROW_HU - 40.0 * g.x, cover(self.marrow.distance(world)));
        for vessel in &self.vessels {
            let (distance, radius) = vessel.distance(world);
            // Flow fills the middle better: a parabola from the axis to the wall.
            let depth = (-distance / radius).clamp(0.0, 1.0);
            let filled = vessel.hu + 80.0 * depth * (2.0 - depth);
            hu = mix(hu, filled, cover(distance));
        }
        hu
    }

    /// Returns true if a world point (mm) lies in the bone, marrow included, or in a vessel.
    pub fn inside(&self, world: DVec3) -> bool {
        self.bone.distance(world) <= 0.0 || self.vessels.iter().any(|v| v.distance(world).0 <= 0.0)
    }

    /// Returns the scene, which is sampled at the voxel centres of a box when it is read.
    pub fn ct(&self) -> impl VoxelSource + '_ {
        Sampled { phantom: self, value: INTENSITY }
    }

    /// Returns the region of bone and vessels, which is sampled when it is read.
    pub fn mask(&self) -> impl VoxelSource + '_ {
        Sampled { phantom: self, value: INSIDE }
    }

    /// Returns the scene sampled at the voxel centres.
    pub fn volume(&self) -> Volume {
        self.sampled([0; 3], self.size, INTENSITY)
    }

    /// Returns the region of bone and vessels on the same grid.
    ///
    /// # Errors
    /// [`base::Kind::NothingToDo`] if the grid is so coarse that no voxel centre lies inside.
    pub fn roi(&self) -> Result<Roi> {
        Roi::new(self.sampled([0; 3], self.size, INSIDE).samples, &self.volume())
    }

    /// Returns the number of voxels of [`Self::roi`].
    ///
    /// # Errors
    /// [`base::Kind::NothingToDo`] if there are none.
    pub fn roi_voxels(&self) -> Result<usize> {
        // Of a small box few vessels are near.
        let counts = self.size.map(|n| n.div_ceil(BOX));
        let voxels = |i: usize| {
            let place = [i % counts[0], i / counts[0] % counts[1], i / (counts[0] * counts[1])];
            let first = place.map(|at| at * BOX);
            let size = [0, 1, 2].map(|k| BOX.min(self.size[k] - first[k]));
            let inside = self.sampled(first, size, INSIDE);
            inside.samples.iter().filter(|&&inside| inside > 0.0).count()
        };
        let all = (0..counts.iter().product()).map(voxels).sum();
        if all > 0 { Ok(all) } else { Err(empty()) }
    }

    /// Returns the samples of a box.
    fn sampled(&self, first: [usize; 3], size: [usize; 3], value: Value) -> Volume {
        let [nx, ny, _] = size;
        let grid = Grid { size: self.size, world_from_voxel: self.world_from_voxel }.of_box(first, size);
        let of_voxel = |voxel: [usize; 3]| {
            self.world_from_voxel.transform_point3(DVec3::from_array(voxel.map(|at| at as f64)))
        };
        // Vessels that are far from the box change nothing in it.
        let ends = [of_voxel(first), of_voxel([0, 1, 2].map(|k| first[k] + size[k] - 1))];
        let is_near = |vessel: &&Vessel| !vessel.is_far_from(ends, self.edge);
        let near =
            Phantom { vessels: self.vessels.iter().filter(is_near).cloned().collect(), ..self.clone() };
        let samples = (0..size.iter().product::<usize>()).into_par_iter().map(|i| {
            let at = [i % nx, i / nx % ny, i / (nx * ny)];
            value(&near, of_voxel([0, 1, 2].map(|k| first[k] + at[k])))
        });
        Volume::new(size, grid.world_from_voxel, samples.collect())
    }
}

/// A property of a phantom at a world point (mm).
type Value = fn(&Phantom, DVec3) -> f32;

const INTENSITY: Value = |phantom, p| phantom.hu(p) as f32;
const INSIDE: Value = |phantom, p| f32::from(u8::from(phantom.inside(p)));

/// A property of a phantom, sampled when it is read.
struct Sampled<'a> {
    phantom: &'a Phantom,
    value: Value,
}

impl VoxelSource for Sampled<'_> {
    fn grid(&self) -> Grid {
        Grid { size: self.phantom.size, world_from_voxel: self.phantom.world_from_voxel }
    }

    fn read_box(&self, first: [usize; 3], size: [usize; 3]) -> Result<Volume> {
        self.grid().check_box(first, size)?;
        Ok(self.phantom.sampled(first, size, self.value))
    }
}

/// Returns a vessel that runs from the feet end to the head end through a random bend, in front of the bone.
fn vessel(uniform: &mut Uniform, half: DVec3, edge: f64, index: usize) -> Vessel {
    let lane = -0.3 + 0.6 * (index as f64 + 0.5) / VESSELS as f64;
    let ends = [-0.55, 0.0, 0.55].map(|z| {
        let low = DVec3::new(lane - 0.15, 0.05, z - 0.1);
        half * uniform.vector(low, low + DVec3::new(0.3, 0.35, 0.2))
    });
    let radius = half.min_element() * uniform.between(0.05, 0.1);
    let taper = uniform.between(0.5, 0.9);
    let at = |i: usize| i as f64 / SEGMENTS as f64;
    Vessel {
        points: std::array::from_fn(|i| {
            let (t, s) = (at(i), 1.0 - at(i));
            ends[0] * (s * s) + ends[1] * (2.0 * s * t) + ends[2] * (t * t)
        }),
        radii: std::array::from_fn(|i| (radius * (1.0 + (taper - 1.0) * at(i))).max(edge)),
        hu: uniform.between(250.0, 400.0),
    }
}

/// Returns the cubic that rises from 0 at t ≤ 0 to 1 at t ≥ 1 with flat ends.
fn smooth_step(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn phantom(seed: u64) -> Phantom {
        Phantom::new([40, 36, 44], DVec3::new(1.0, 1.0, 1.5), seed)
    }

    #[test]
    fn one_seed_gives_the_same_bits() {
        assert_eq!(phantom(7).volume().samples, phantom(7).volume().samples);
        assert_ne!(phantom(7).volume().samples, phantom(8).volume().samples);
        // Taken once; a change means that every fit of a phantom changes.
        let hash = phantom(7).volume().samples.iter().fold(0xcbf2_9ce4_8422_2325_u64, |h, v| {
            (h ^ u64::from(v.to_bits())).wrapping_mul(0x0100_0000_01b3)
        });
        assert_eq!(hash, 0x6dfb_71de_0964_a53d);
    }

    #[test]
    fn volume_and_roi_are_samples_of_the_scene() {
        for seed in 0..8 {
            let p = phantom(seed);
            let (volume, roi) = (p.volume(), p.roi().unwrap());
            assert_eq!((volume.size, roi.size, roi.soft), (p.size, p.size, false));
            for (x, y, z) in [(0, 0, 0), (20, 18, 22), (39, 35, 43), (20, 11, 22)] {
                let world =
                    volume.world_from_voxel.transform_point3(DVec3::new(x as f64, y as f64, z as f64));
                let i = volume.index(x, y, z);
                assert_eq!(volume.samples[i], p.hu(world) as f32);
                assert_eq!(roi.weight[i] == 1.0, p.inside(world));
            }
            let mut marked = roi.weight.iter().zip(&volume.samples).filter(|(w, _)| **w > 0.0);
            assert!(marked.all(|(_, &hu)| hu > 0.0), "seed {seed}: bone and vessels lie in the body");
            let share = roi.voxel_count() as f64 / volume.len() as f64;
            assert!((0.01..0.2).contains(&share), "seed {seed}: {share}");
            let (min, max) = volume.min_max().unwrap();
            assert!(min == -1000.0 && (800.0..1500.0).contains(&max), "seed {seed}: {min} {max}");
        }
    }

    #[test]
    fn boxes_have_the_bits_of_the_whole() {
        let p = phantom(5);
        let (volume, roi) = (p.volume(), p.roi().unwrap());
        assert_eq!(p.roi_voxels().unwrap(), roi.voxel_count());
        let mask = Volume { samples: roi.weight, ..volume.clone() };
        for (first, size) in [([0; 3], [7, 5, 9]), ([11, 12, 13], [20, 8, 20]), ([39, 35, 43], [1; 3])] {
            assert_eq!(p.ct().read_box(first, size).unwrap().samples, volume.cropped(first, size).samples);
            assert_eq!(p.mask().read_box(first, size).unwrap().samples, mask.cropped(first, size).samples);
        }
    }

    #[test]
    fn edges_are_smooth_over_about_a_voxel() {
        let p = phantom(3);
        let (from, to) = (p.half * DVec3::new(-1.2, -0.4, 0.0), p.half * DVec3::new(1.2, -0.4, 0.0));
        let n = 4000;
        let values: Vec<f64> = (0..=n).map(|i| p.hu(from.lerp(to, f64::from(i) / f64::from(n)))).collect();
        let step = (to - from).length() / f64::from(n);
        // The steepest slope of a smooth step is 1.5 times its height over its width.
        let steepest = values.windows(2).map(|w| (w[1] - w[0]).abs() / step).fold(0.0, f64::max);
        let most = 1.5 * (1400.0 - AIR_HU) / (2.0 * p.edge);
        assert!(steepest < most && steepest > 0.2 * most, "{steepest} against {most}");
    }

    #[test]
    fn tiny_grids_do_not_break() {
        for size in [[1, 1, 1], [2, 2, 2], [16, 16, 1]] {
            let p = Phantom::new(size, DVec3::ONE, 1);
            assert!(p.volume().samples.iter().all(|v| v.is_finite()));
            let _ = p.roi();
        }
    }
}
