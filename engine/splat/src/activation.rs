//! Activations: from the raw parameters of a splat to opacity, scale and rotation, with the limits that keep
//! them finite.
//!
//! Limits (f32): a logit of α = 0 or 1 is infinite, so α is kept in [[`OPACITY_MIN`], [`OPACITY_MAX`]] when
//! it is set. σ is kept where σ² and 1/σ² are finite, and a needle is kept as thick as f32 can measure
//! distances from. Rotations are built in f64 and accept any quaternion.

use glam::{DMat3, DQuat, DVec3};

use super::Splat;

/// Least opacity that can be set: logit −16.1.
pub const OPACITY_MIN: f32 = 1e-7;
/// Greatest opacity that can be set, the f32 below 1: logit 16.6.
pub const OPACITY_MAX: f32 = 1.0 - f32::EPSILON / 2.0;
/// Greatest |ln σ|: beyond it σ² or 1/σ² comes near the end of f32.
pub const LOG_SCALE_LIMIT: f32 = 40.0;
/// Greatest ratio of the longest σ of a splat to its shortest. At 10⁴ the f32 whitened distance q is right to
/// 10⁻² within the support; at 10⁶ it is off by a half (docs/results/numerics.md, N4).
pub const ANISOTROPY_LIMIT: f32 = 1e4;

/// The activations of a splat: opacity, scale and rotation from its raw parameters.
pub trait Activations {
    /// Returns the opacity α = 1 / (1 + exp(−logit)), in [0, 1] for every logit that is not NaN.
    fn opacity(&self) -> f32;
    /// Sets the logit to that of `opacity`, which is first clamped to [[`OPACITY_MIN`], [`OPACITY_MAX`]].
    fn set_opacity(&mut self, opacity: f32);
    /// Returns the standard deviation along each rotated axis, in the unit of the mean; ln σ is first clamped
    /// to ±[`LOG_SCALE_LIMIT`].
    fn scale(&self) -> [f32; 3];
    /// Sets ln σ of each axis, clamped to ±[`LOG_SCALE_LIMIT`].
    fn set_scale(&mut self, scale: [f32; 3]);
    /// Returns the rotation R whose columns are the axes of the splat; see [`rotation_matrix`].
    fn axes(&self) -> DMat3;
    /// Returns the half size of the box around the splat's support q < `support_q`, in the unit of the mean.
    fn reach(&self, support_q: f64) -> DVec3;
}

impl Activations for Splat {
    fn opacity(&self) -> f32 {
        (1.0 / (1.0 + (-f64::from(self.opacity_logit)).exp())) as f32
    }

    fn set_opacity(&mut self, opacity: f32) {
        let opacity = f64::from(opacity.clamp(OPACITY_MIN, OPACITY_MAX));
        self.opacity_logit = (opacity.ln() - (-opacity).ln_1p()) as f32;
    }

    fn scale(&self) -> [f32; 3] {
        self.log_scale.map(|log| log.clamp(-LOG_SCALE_LIMIT, LOG_SCALE_LIMIT).exp())
    }

    fn set_scale(&mut self, scale: [f32; 3]) {
        self.log_scale = scale.map(|s| s.ln().clamp(-LOG_SCALE_LIMIT, LOG_SCALE_LIMIT));
    }

    fn axes(&self) -> DMat3 {
        rotation_matrix(self.rotation)
    }

    fn reach(&self, support_q: f64) -> DVec3 {
        let (axes, scale) = (self.axes(), self.scale().map(f64::from));
        // This is the diagonal of R S² Rᵀ.
        let variance = (0..3).map(|k| (axes.col(k) * scale[k]).powf(2.0)).sum::<DVec3>();
        (variance * support_q).powf(0.5)
    }
}

/// Returns the unit quaternion along `rotation` (w, x, y, z) in f64; the identity if that is zero or not
/// finite.
pub fn unit_quaternion(rotation: [f32; 4]) -> DQuat {
    let [w, x, y, z] = rotation.map(f64::from);
    let length_squared = w * w + x * x + y * y + z * z;
    // In f64 the squares of f32 numbers neither overflow nor vanish, so only zeros and non-finite numbers
    // fail.
    if length_squared > 0.0 && length_squared.is_finite() {
        let scale = length_squared.sqrt().recip();
        DQuat::from_xyzw(x * scale, y * scale, z * scale, w * scale)
    } else {
        DQuat::IDENTITY
    }
}

/// Returns `rotation` at length 1, which the device takes for granted; unchanged if it has that length to
/// within rounding.
pub fn normalised(rotation: [f32; 4]) -> [f32; 4] {
    let length_squared: f64 = rotation.iter().map(|&v| f64::from(v) * f64::from(v)).sum();
    if (length_squared - 1.0).abs() < 1e-6 {
        return rotation;
    }
    let q = unit_quaternion(rotation);
    [q.w, q.x, q.y, q.z].map(|v| v as f32)
}

/// Returns ln σ with the thin axes widened to at least the longest less ln [`ANISOTROPY_LIMIT`].
pub fn limit_anisotropy(log_scale: [f32; 3]) -> [f32; 3] {
    let longest = log_scale.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let least = longest - ANISOTROPY_LIMIT.ln();
    log_scale.map(|log| log.max(least))
}

/// Returns the rotation matrix of the quaternion `rotation` (w, x, y, z) of any length; the identity if that
/// is zero or not finite.
pub fn rotation_matrix(rotation: [f32; 4]) -> DMat3 {
    DMat3::from_quat(unit_quaternion(rotation))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opacity_is_finite_for_every_logit_and_every_opacity() {
        let mut splat = Splat::default();
        for logit in [0.0, 16.0, -16.0, 200.0, -200.0, f32::MAX, f32::MIN, f32::INFINITY, f32::NEG_INFINITY] {
            splat.opacity_logit = logit;
            assert!((0.0..=1.0).contains(&splat.opacity()), "logit {logit}");
        }
        for opacity in [0.0, 1e-30, 1e-7, 0.1, 0.5, 1.0 - 6e-8, 1.0, 2.0, -1.0] {
            splat.set_opacity(opacity);
            assert!(splat.opacity_logit.abs() < 16.7, "opacity {opacity}: logit {}", splat.opacity_logit);
            let kept = opacity.clamp(OPACITY_MIN, OPACITY_MAX);
            assert!((splat.opacity() - kept).abs() <= 2e-6 * kept, "opacity {opacity}: {}", splat.opacity());
        }
    }

    #[test]
    fn scale_and_its_squares_stay_finite() {
        let mut splat = Splat { log_scale: [-1e3, 0.5, 1e3], ..Splat::default() };
        for s in splat.scale() {
            assert!((s * s).is_normal() && (s * s).recip().is_normal(), "σ = {s}");
        }
        splat.set_scale([0.0, 2.0, f32::INFINITY]);
        assert_eq!(splat.log_scale, [-LOG_SCALE_LIMIT, 2f32.ln(), LOG_SCALE_LIMIT]);
    }

    #[test]
    fn needles_have_a_least_thickness() {
        let usual = [0.0, -9.2, -3.0];
        assert_eq!(limit_anisotropy(usual), usual, "1 : 9897 is allowed");
        let widened = limit_anisotropy([2.0, -20.0, -7.0]);
        assert_eq!((widened[0], widened[2]), (2.0, -7.0));
        assert!((widened[1] - (2.0 - 1e4f32.ln())).abs() < 1e-6);
    }

    #[test]
    fn every_quaternion_gives_a_rotation() {
        let quarter = [0.5, -0.5, 0.5, 0.5];
        let rows: [([f32; 4], DMat3); 7] = [
            ([0.0; 4], DMat3::IDENTITY),
            ([f32::NAN, 0.0, 0.0, 1.0], DMat3::IDENTITY),
            ([f32::INFINITY, 0.0, 0.0, 1.0], DMat3::IDENTITY),
            ([1e-30, 0.0, 0.0, 0.0], DMat3::IDENTITY),
            (quarter.map(|v| v * 1e-38), rotation_matrix(quarter)),
            (quarter.map(|v| v * 1e30), rotation_matrix(quarter)),
            (quarter.map(|v| -v), rotation_matrix(quarter)),
        ];
        for (quaternion, expected) in rows {
            let matrix = rotation_matrix(quaternion);
            assert!(matrix.abs_diff_eq(expected, 1e-6), "{quaternion:?}: {matrix}");
            assert!((matrix.determinant() - 1.0).abs() < 1e-12);
        }
    }
}
