//! `moments_to_grad`: dL/d(parameters) of a splat from the moments that `splat_to_volume_grad` sums.
//!
//! With U = S⁻¹Rᵀ, B = U S2 Uᵀ and the amplitude a = α times the kernel's peak: dL/dμ = a UᵀU S1,
//! dL/dln s_k = a B_kk, dL/dω_k = a B_ij (s_i/s_j - s_j/s_i) for (i, j, k) cyclic, dL/dlogit = a(1 - α) S0,
//! dL/dc = a C0. A peak that falls with the scales subtracts a S0 from each dL/dln s_k.

use glam::DVec3;

use super::splat_bounds::{amplitude, opacity, stretched_whitening};
use super::splat_to_volume_grad::Moments;
use super::{Gradient, Splat};
use splat::Kernel;

/// Returns the gradient of one splat that is shaped in voxel space.
pub fn moments_to_grad(splat: &Splat, moments: &Moments, kernel: Kernel) -> Gradient {
    stretched(splat, moments, kernel, DVec3::ONE)
}

/// Returns the gradient of one splat that is shaped in a space whose unit is `stretch` voxels along each
/// axis.
pub fn stretched(splat: &Splat, moments: &Moments, kernel: Kernel, stretch: DVec3) -> Gradient {
    let (alpha, amplitude) = (opacity(splat), amplitude(splat, kernel));
    let peak_falls = if kernel.row().unit_integral { moments.s0 } else { 0.0 };
    let u = stretched_whitening(splat, stretch);
    let b = u * moments.s2 * u.transpose();
    let scale = splat.log_scale.exp();
    let turn = |i: usize, j: usize| b.col(i)[j] * (scale[i] / scale[j] - scale[j] / scale[i]);
    Gradient {
        mean: amplitude * (u.transpose() * (u * moments.s1)),
        opacity_logit: amplitude * (1.0 - alpha) * moments.s0,
        rotation: amplitude * DVec3::new(turn(1, 2), turn(2, 0), turn(0, 1)),
        log_scale: amplitude * (DVec3::new(b.x_axis.x, b.y_axis.y, b.z_axis.z) - peak_falls),
        intensity: amplitude * moments.c0,
    }
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::Adjoint;
    use crate::splat_bounds::{footprint, stretched_footprint};
    use crate::splat_to_volume;
    use crate::splat_to_volume_grad::{moments, splat_gradient};
    use splat::kernel::KERNELS;

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
        for kernel in KERNELS.map(|row| row.kernel) {
            // A small rotation, a scale and a place do the same in a stretched space.
            let stretch = DVec3::new(1.3, 0.8, 1.1);
            let m = moments(&stretched_footprint(&splat, kernel, stretch), &positions, &folded, kernel);
            let g = stretched(&splat, &m, kernel, stretch);
            let sum = |splat: &Splat| -> f64 {
                let f = stretched_footprint(splat, kernel, stretch);
                let at = |(x, a): (&DVec3, &Adjoint)| {
                    (a.value * splat.intensity + a.weight) * splat_to_volume::weight(&f, *x, kernel)
                };
                positions.iter().zip(&folded).map(at).sum()
            };
            for lane in 0..10 {
                let h = 1e-6;
                let difference = (sum(&splat.moved(lane, h)) - sum(&splat.moved(lane, -h))) / (2.0 * h);
                let found = g.lanes()[lane];
                assert!((found - difference).abs() < 1e-6 * (1.0 + found.abs()), "{}, {lane}", kernel.name());
            }
            let m = moments(&footprint(&splat, kernel), &positions, &folded, kernel);
            assert_eq!(Moments::from_row(m.to_row()).to_row(), m.to_row());
            let by_moments = moments_to_grad(&splat, &m, kernel).lanes();
            let by_samples = splat_gradient(&splat, &positions, &folded, kernel).lanes();
            for (lane, (a, b)) in by_moments.into_iter().zip(by_samples).enumerate() {
                assert!((a - b).abs() < 1e-11, "{}, parameter {lane}: {a} and {b}", kernel.name());
                assert!(b.abs() > 1e-3, "parameter {lane} is tested");
            }
        }
    }
}
