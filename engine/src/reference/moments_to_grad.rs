//! `moments_to_grad`: dL/d(parameters) of a splat from the moments that `splat_to_volume_grad` sums.
//!
//! With U = S⁻¹Rᵀ and B = U S2 Uᵀ: dL/dμ = α UᵀU S1, dL/dln s_k = α B_kk, dL/dω_k = α B_ij (s_i/s_j - s_j/s_i) for
//! (i, j, k) cyclic, dL/dlogit = α(1 - α) S0, dL/dc = α C0.

use glam::DVec3;

use super::splat_bounds::{opacity, whitening};
use super::splat_to_volume_grad::Moments;
use super::{Gradient, Splat};

/// The gradient of one splat.
pub fn moments_to_grad(splat: &Splat, moments: &Moments) -> Gradient {
    let alpha = opacity(splat);
    let u = whitening(splat);
    let b = u * moments.s2 * u.transpose();
    let scale = splat.log_scale.exp();
    let turn = |i: usize, j: usize| b.col(i)[j] * (scale[i] / scale[j] - scale[j] / scale[i]);
    Gradient {
        mean: alpha * (u.transpose() * (u * moments.s1)),
        opacity_logit: alpha * (1.0 - alpha) * moments.s0,
        rotation: alpha * DVec3::new(turn(1, 2), turn(2, 0), turn(0, 1)),
        log_scale: alpha * DVec3::new(b.x_axis.x, b.y_axis.y, b.z_axis.z),
        intensity: alpha * moments.c0,
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::reference::Adjoint;
    use crate::reference::splat_bounds::footprint;
    use crate::reference::splat_to_volume_grad::{moments, splat_gradient};
    use crate::splat::Kernel;

    #[test]
    fn moments_give_what_the_chain_rule_gives() {
        let splat = Splat {
            mean: DVec3::new(3.2, 2.9, 3.4),
            opacity_logit: 0.4,
            rotation: DQuat::from_xyzw(0.3, -0.5, 0.2, 0.7).normalize(),
            log_scale: DVec3::new(0.9, -0.2, 0.4),
            intensity: 0.3,
        };
        let mut positions = Vec::new();
        let mut folded = Vec::new();
        for i in 0..343 {
            let (x, y, z) = (f64::from(i % 7), f64::from(i / 7 % 7), f64::from(i / 49));
            positions.push(DVec3::new(x, y, z));
            folded.push(Adjoint { value: (x * 1.3 + y).sin(), weight: (z * 0.7 - y).cos() });
        }
        for kernel in [Kernel::Compact, Kernel::Gaussian] {
            let m = moments(&footprint(&splat, kernel), &positions, &folded, kernel);
            assert_eq!(Moments::from_row(m.to_row()).to_row(), m.to_row());
            let by_moments = moments_to_grad(&splat, &m).lanes();
            let by_samples = splat_gradient(&splat, &positions, &folded, kernel).lanes();
            for (lane, (a, b)) in by_moments.into_iter().zip(by_samples).enumerate() {
                assert!((a - b).abs() < 1e-11, "{}, parameter {lane}: {a} and {b}", kernel.name());
                assert!(b.abs() > 1e-3, "parameter {lane} is tested");
            }
        }
    }
}
