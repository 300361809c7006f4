//! Transformation of splat sets between voxel space and the world.
//!
//! An affine map x ↦ Lx + t takes a covariance Σ = RS²Rᵀ to LΣLᵀ, and under shear the axes of the new
//! ellipsoid are not the images of the old ones. With B = LRS the new covariance is BBᵀ, so its axes are the
//! left singular vectors of B and its standard deviations the singular values. B is orthogonalised column by
//! column in f64 (one-sided Jacobi): unlike an eigendecomposition of BBᵀ it never squares the scales, and
//! where L only rotates, scales evenly or reflects, the columns are orthogonal already, so that every axis
//! and scale passes through unmixed and in place.

use glam::{DAffine3, DMat3, DQuat, DVec3};
use rayon::prelude::*;

use super::activation::{LOG_SCALE_LIMIT, rotation_matrix, unit_quaternion};
use super::{Field, Splat, SplatSet};

/// Cosine below which two columns count as orthogonal.
const ORTHOGONAL: f64 = 1e-15;
/// Rounding that no measure of a set sees, as a part of a splat's least σ: at the place of a splat of 0.3 mm it
/// lets pass 5 m.
const EXACT: f32 = 1e-3;
/// Most sweeps of the Jacobi iteration; a 3×3 matrix converges in about five.
const MAX_SWEEPS: usize = 16;

impl SplatSet {
    /// Returns the splats in the voxel space (mean in voxels, ln σ in voxels) of the volume whose invertible
    /// index-to-world map, mm RAS, is `world_from_voxel`.
    pub fn to_voxel(&self, world_from_voxel: &DAffine3) -> Vec<Splat> {
        let linear = world_from_voxel.matrix3.inverse();
        // L⁻¹(origin − t) is computed once: the mean is then added to small numbers only.
        let origin = linear * (self.origin_mm - world_from_voxel.translation);
        self.splats.par_iter().map(|splat| transformed(splat, &linear, |x| linear * x + origin)).collect()
    }

    /// Returns the world-space set of voxel-space `splats` of a volume with the index-to-world map
    /// `world_from_voxel`, mm RAS.
    ///
    /// The origin is that of the world where f32 means are exact enough from there, and otherwise the centre
    /// of the box of all means, rounded to whole millimetres.
    pub fn from_voxel(splats: &[Splat], world_from_voxel: &DAffine3, field: Field) -> SplatSet {
        let linear = world_from_voxel.matrix3;
        let about = |origin_mm| {
            let offset = world_from_voxel.translation - origin_mm;
            let place = |x: DVec3| linear * x + offset;
            let splats = splats.par_iter().map(|splat| transformed(splat, &linear, place)).collect();
            SplatSet { splats, origin_mm, field, ..SplatSet::default() }
        };
        let set = about(DVec3::ZERO);
        if set.is_exact() {
            return set;
        }
        about(centre(splats.iter().map(|splat| world_from_voxel.transform_point3(mean(splat)))))
    }

    /// Returns true if rounding to f32 moves no mean by more than [`EXACT`] of its splat's least σ.
    pub(super) fn is_exact(&self) -> bool {
        self.splats.par_iter().all(|splat| {
            let far = splat.mean.iter().fold(0.0f32, |far, x| far.max(x.abs()));
            let least = splat.log_scale.iter().copied().fold(f32::INFINITY, f32::min).exp();
            far * (0.5 * f32::EPSILON) <= EXACT * least
        })
    }
}

/// Returns the centre of the box of all means, rounded to whole millimetres; zero if none is finite.
pub(super) fn centre(means: impl Iterator<Item = DVec3>) -> DVec3 {
    let (low, high) = means
        .filter(|x| x.is_finite())
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)));
    if low.cmple(high).all() { ((low + high) * 0.5).round() } else { DVec3::ZERO }
}

fn mean(splat: &Splat) -> DVec3 {
    DVec3::from_array(splat.mean.map(f64::from))
}

/// Returns `splat` with its covariance Σ taken to LΣLᵀ by the invertible `linear` L; its mean stays where it
/// is.
pub fn reshaped(splat: &Splat, linear: &DMat3) -> Splat {
    Splat { mean: splat.mean, ..transformed(splat, linear, |x| x) }
}

/// Returns `splat` with its mean mapped by `place` and its covariance by `linear`; opacity and intensity
/// stay.
pub(super) fn transformed(splat: &Splat, linear: &DMat3, place: impl Fn(DVec3) -> DVec3) -> Splat {
    let limit = f64::from(LOG_SCALE_LIMIT);
    let before = rotation_matrix(splat.rotation);
    let scale = DVec3::from_array(splat.log_scale.map(|log| f64::from(log).clamp(-limit, limit).exp()));
    let (mut axes, scale) = principal_axes(*linear * before * DMat3::from_diagonal(scale));
    if axes.determinant() < 0.0 {
        let flip = most_turned(&before, &axes);
        *axes.col_mut(flip) *= -1.0;
    }
    let old = unit_quaternion(splat.rotation);
    let new = DQuat::from_mat3(&axes).normalize();
    let new = if new.dot(old) < 0.0 { -new } else { new };
    Splat {
        mean: place(mean(splat)).to_array().map(|v| v as f32),
        rotation: [new.w as f32, new.x as f32, new.y as f32, new.z as f32],
        log_scale: scale.to_array().map(|s| s.ln().clamp(-limit, limit) as f32),
        ..*splat
    }
}

/// Returns the left singular vectors (orthonormal columns) and the singular values of `b`, in the order of
/// its columns.
fn principal_axes(b: DMat3) -> (DMat3, DVec3) {
    let mut columns = [b.x_axis, b.y_axis, b.z_axis];
    for _ in 0..MAX_SWEEPS {
        let mut settled = true;
        for (i, j) in [(0, 1), (0, 2), (1, 2)] {
            let (ii, jj, ij) =
                (columns[i].length_squared(), columns[j].length_squared(), columns[i].dot(columns[j]));
            if ij.abs() <= ORTHOGONAL * (ii * jj).sqrt() {
                continue;
            }
            settled = false;
            // Rotation by the smaller angle that makes the pair orthogonal (Golub & Van Loan, 8.6.3).
            let zeta = (jj - ii) / (2.0 * ij);
            let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
            let cosine = 1.0 / tangent.hypot(1.0);
            let sine = cosine * tangent;
            (columns[i], columns[j]) =
                (columns[i] * cosine - columns[j] * sine, columns[i] * sine + columns[j] * cosine);
        }
        if settled {
            break;
        }
    }
    let scale = DVec3::from_array(columns.map(DVec3::length));
    (DMat3::from_cols(columns[0] / scale.x, columns[1] / scale.y, columns[2] / scale.z), scale)
}

/// Returns the axis to flip if the map reflects: the one that points furthest from where it was. The choice
/// is the same for the map and its inverse, so a round trip gives the rotation back; of near ties the first
/// axis is taken.
fn most_turned(before: &DMat3, after: &DMat3) -> usize {
    let alignment = [0, 1, 2].map(|k| before.col(k).dot(after.col(k)));
    let least = alignment.iter().copied().fold(f64::INFINITY, f64::min);
    alignment.iter().position(|&a| a <= least + 1e-6).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    use super::*;
    use crate::{Activations, Kernel};

    fn random_splats(count: usize, anisotropy: f32, seed: u64) -> Vec<Splat> {
        let mut rng = Pcg64::seed_from_u64(seed);
        let mut between = |low: f32, high: f32| rng.random_range(low..high);
        let range = anisotropy.ln();
        (0..count)
            .map(|_| Splat {
                mean: [between(0.0, 512.0), between(0.0, 512.0), between(0.0, 157.0)],
                opacity_logit: between(-9.0, 9.0),
                rotation: [between(-1.0, 1.0), between(-1.0, 1.0), between(-1.0, 1.0), between(-1.0, 1.0)],
                log_scale: [between(-0.9, range - 0.9), between(-0.9, range - 0.9), between(-0.9, 0.0)],
                intensity: between(-1024.0, 3071.0),
            })
            .collect()
    }

    fn affines() -> Vec<(&'static str, DAffine3)> {
        let oblique = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, 3.0).normalize(), 37f64.to_radians());
        let spacing = DMat3::from_diagonal(DVec3::new(0.7, 0.7, 2.5));
        let left = DMat3::from_diagonal(DVec3::new(-0.9, 0.9, 0.9));
        let shear = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::new(0.0, 15f64.to_radians().tan(), 1.0));
        let at = |matrix, x, y, z| DAffine3::from_mat3_translation(matrix, DVec3::new(x, y, z));
        vec![
            ("identity", DAffine3::IDENTITY),
            ("oblique", at(oblique * 0.8, -120.5, 33.25, -700.1)),
            ("anisotropic and oblique", at(oblique * spacing, 10.0, 20.0, 30.0)),
            ("LAS", at(left, 180.0, -200.0, 5.5)),
            ("LAS, oblique, anisotropic", at(oblique * left * spacing, 1.0, 2.0, 3.0)),
            ("shear", at(shear * spacing, 0.0, 0.0, 0.0)),
            ("far away", at(oblique * spacing, 1e5, -1e5, 1e5)),
        ]
    }

    fn covariance(splat: &Splat) -> DMat3 {
        let scale = DVec3::from_array(splat.log_scale.map(|log| f64::from(log).exp()));
        let root = splat.axes() * DMat3::from_diagonal(scale);
        root * root.transpose()
    }

    fn norm(matrix: DMat3) -> f64 {
        matrix.to_cols_array().iter().map(|v| v * v).sum::<f64>().sqrt()
    }

    /// Returns q at `point`, both in the space of the splat.
    fn whitened(splat: &Splat, point: DVec3) -> f64 {
        let scale = DVec3::from_array(splat.log_scale.map(|log| f64::from(log).exp()));
        (splat.axes().transpose() * (point - mean(splat)) / scale).length_squared()
    }

    fn field() -> Field {
        Field { kernel: Kernel::Compact, ..Field::default() }
    }

    #[test]
    fn covariances_follow_the_affine() {
        for (name, affine) in affines() {
            for anisotropy in [2.0, 10.0, 100.0] {
                let splats = random_splats(300, anisotropy, 1);
                let set = SplatSet::from_voxel(&splats, &affine, field());
                // Only where f32 would be too coarse are means relative to something.
                assert_eq!(set.origin_mm != DVec3::ZERO, name == "far away", "{name}: {}", set.origin_mm);
                assert_eq!(set.origin_mm, set.origin_mm.round(), "{name}: whole millimetres");
                for (voxel, world) in splats.iter().zip(&set.splats) {
                    let expected = affine.matrix3 * covariance(voxel) * affine.matrix3.transpose();
                    let error = norm(covariance(world) - expected) / norm(expected);
                    assert!(error < 1e-6, "{name}, {anisotropy}:1: relative error {error:e}");
                    assert!((world.axes().determinant() - 1.0).abs() < 1e-12, "{name}");
                    let point = affine.transform_point3(mean(voxel)) - set.origin_mm;
                    let distance = (mean(world) - point).length();
                    assert!(distance < 5e-5, "{name}: mean off by {distance} mm");
                    assert_eq!(
                        (world.opacity_logit, world.intensity),
                        (voxel.opacity_logit, voxel.intensity)
                    );
                }
            }
        }
    }

    #[test]
    fn there_and_back_keeps_every_distance() {
        let mut rng = Pcg64::seed_from_u64(2);
        let mut unit = || rng.random_range(-1.0..1.0);
        for (name, affine) in affines() {
            // q is most sensitive in thin splats: an f32 mean is off by 2^-16 voxels at 512, σ is 0.4 and
            // more.
            for (anisotropy, bound) in [(2.0, 1e-3), (10.0, 1e-3), (100.0, 5e-3)] {
                let splats = random_splats(200, anisotropy, 3);
                let back = SplatSet::from_voxel(&splats, &affine, field()).to_voxel(&affine);
                for (before, after) in splats.iter().zip(&back) {
                    for _ in 0..20 {
                        // Inside the support of the Gaussian kernel, q < 9.
                        let u = DVec3::new(unit(), unit(), unit()) * 3f64.sqrt();
                        let scale = DVec3::from_array(before.log_scale.map(|log| f64::from(log).exp()));
                        let point = mean(before) + before.axes() * (u * scale);
                        let error = (whitened(after, point) - whitened(before, point)).abs();
                        assert!(error < bound, "{name}, {anisotropy}:1: q off by {error:e}");
                    }
                }
            }
        }
    }

    #[test]
    fn maps_without_shear_keep_axes_and_scales() {
        for (name, affine) in &affines()[..4] {
            if name.contains("anisotropic") {
                continue;
            }
            let factor = affine.matrix3.determinant().abs().cbrt();
            let splats = random_splats(300, 50.0, 4);
            let set = SplatSet::from_voxel(&splats, affine, field());
            let back = set.to_voxel(affine);
            for ((before, world), after) in splats.iter().zip(&set.splats).zip(&back) {
                for k in 0..3 {
                    let expected = before.log_scale[k] + factor.ln() as f32;
                    assert!((world.log_scale[k] - expected).abs() < 1e-6, "{name}: scale {k}");
                    assert!((after.log_scale[k] - before.log_scale[k]).abs() < 1e-6, "{name}: scale {k}");
                }
                let old = unit_quaternion(before.rotation);
                let new = unit_quaternion(after.rotation);
                assert!(old.abs_diff_eq(new, 1e-6), "{name}: {old} became {new}");
            }
        }
        // An image that is only mirrored needs no rotation at all.
        let upright = Splat { rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
        let mirrored = SplatSet::from_voxel(&[upright], &affines()[3].1, field());
        assert_eq!(mirrored.splats[0].rotation, upright.rotation);
    }

    #[test]
    fn the_origin_is_that_of_the_world_as_long_as_f32_is_exact_enough() {
        let at = |mm: f64, log_scale: f32| {
            let splat = Splat { log_scale: [log_scale, 0.0, 1.0], ..Splat::default() };
            let affine = DAffine3::from_translation(DVec3::new(0.0, mm, 0.0));
            SplatSet::from_voxel(&[splat], &affine, field()).origin_mm
        };
        // Half a step of f32 there, against a thousandth of the least σ.
        assert_eq!(at(4_500.4, 0.28f32.ln()), DVec3::ZERO);
        assert_eq!(at(4_900.4, 0.28f32.ln()), DVec3::new(0.0, 4_900.0, 0.0));
        assert_eq!(at(-4_900.4, 0.28f32.ln()), DVec3::new(0.0, -4_900.0, 0.0));
        assert_eq!(at(4_900.4, 0.4f32.ln()), DVec3::ZERO);
    }

    #[test]
    fn extreme_splats_stay_finite() {
        let rows = [
            Splat::default(),
            Splat { rotation: [1e30, -1e30, 0.0, 0.0], log_scale: [-39.0, 0.0, 39.0], ..Splat::default() },
            Splat { rotation: [0.0, 1e-38, 0.0, 1e-38], log_scale: [-40.0; 3], ..Splat::default() },
            Splat { log_scale: [40.0; 3], ..Splat::default() },
        ];
        for (name, affine) in affines() {
            let set = SplatSet::from_voxel(&rows, &affine, field());
            for splat in set.splats.iter().chain(&set.to_voxel(&affine)) {
                assert_eq!(crate::defect(splat), None, "{name}: {splat:?}");
            }
        }
        assert!(SplatSet::from_voxel(&[], &DAffine3::IDENTITY, field()).splats.is_empty());
        assert_eq!(SplatSet::from_voxel(&[], &DAffine3::IDENTITY, field()).origin_mm, DVec3::ZERO);
    }
}
