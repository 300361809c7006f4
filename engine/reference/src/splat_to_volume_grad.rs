//! `splat_to_volume_grad`: the moments of the loss gradient over the support of a splat, and the gradient by
//! its parameters that they lead to. The gradient is computed here without moments, by the chain rule at
//! every sample, so that the two computations check each other.
//!
//! With d = x - mean, y = Rᵀd, u = S⁻¹y, q = |u|² and κ' = dκ/dq the chain rule is applied sample by sample:
//! dL/dw = A c + H,  dw/dμ = -2aκ' Pd (P = R S⁻² Rᵀ),  dw/dln s_k = -2aκ' u_k²,  dw/dlogit = a(1-α)κ,
//! dL/dc = A w, with the amplitude a = α times the kernel's peak. A peak of 1/((2π)^{3/2} s₁s₂s₃) adds -w to
//! dw/dln s_k. A rotation by ω in the splat's own axes moves y by -ω × y, hence dq/dω = 2 (S⁻²y) · (-ω × y).

use glam::{DMat3, DVec3};

use super::{Adjoint, Footprint, Gradient, Splat};
use crate::splat_bounds::{amplitude, opacity};
use splat::Kernel;

/// S0 = Σ h κ, C0 = Σ A κ, S1 = Σ h e d and S2 = Σ h e d dᵀ, with h = A c + H, e = -2κ' and d = x - mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moments {
    /// Σ h κ.
    pub s0: f64,
    /// Σ A κ.
    pub c0: f64,
    /// Σ h e d.
    pub s1: DVec3,
    /// Σ h e d dᵀ.
    pub s2: DMat3,
}

impl Moments {
    /// Returns the row that the kernels store: S0, C0, S1 x y z, S2 xx yy zz yz zx xy.
    pub fn to_row(&self) -> [f64; 11] {
        let (s1, [x, y, z]) = (self.s1, [self.s2.x_axis, self.s2.y_axis, self.s2.z_axis]);
        [self.s0, self.c0, s1.x, s1.y, s1.z, x.x, y.y, z.z, y.z, z.x, x.y]
    }

    /// Reads the row that the kernels store.
    pub fn from_row([s0, c0, x, y, z, xx, yy, zz, yz, zx, xy]: [f64; 11]) -> Self {
        let s2 = DMat3::from_cols(DVec3::new(xx, xy, zx), DVec3::new(xy, yy, yz), DVec3::new(zx, yz, zz));
        Moments { s0, c0, s1: DVec3::new(x, y, z), s2 }
    }
}

/// Returns the moments of one splat.
pub fn moments(footprint: &Footprint, positions: &[DVec3], folded: &[Adjoint], kernel: Kernel) -> Moments {
    let mut m = Moments { s0: 0.0, c0: 0.0, s1: DVec3::ZERO, s2: DMat3::ZERO };
    for (&x, adjoint) in positions.iter().zip(folded) {
        let d = x - footprint.mean;
        let q = (footprint.whitening * d).length_squared();
        let h = adjoint.value * footprint.intensity + adjoint.weight;
        m.s0 += h * kernel.cut_value(d, q);
        m.c0 += adjoint.value * kernel.cut_value(d, q);
        let he = h * kernel.cut_slope(d, q);
        m.s1 += he * d;
        m.s2 += DMat3::from_cols(he * d.x * d, he * d.y * d, he * d.z * d);
    }
    m
}

/// Returns the gradient of one splat, by the chain rule at every sample.
pub fn splat_gradient(splat: &Splat, positions: &[DVec3], folded: &[Adjoint], kernel: Kernel) -> Gradient {
    let axes = DMat3::from_quat(splat.rotation);
    let inverse_variance = (-2.0 * splat.log_scale).exp();
    let (alpha, amplitude) = (opacity(splat), amplitude(splat, kernel));
    let mut g = Gradient::default();
    for (&x, adjoint) in positions.iter().zip(folded) {
        let y = axes.transpose() * (x - splat.mean);
        let q = (y * y).dot(inverse_variance);
        if q >= kernel.support_q() || !kernel.reaches(x - splat.mean) {
            continue;
        }
        let by_weight = adjoint.value * splat.intensity + adjoint.weight;
        let value = kernel.value(q);
        // dL/dq, of which the slope of the kernel is -2 times a factor.
        let by_q = by_weight * amplitude * kernel.slope(q) * -0.5;
        let white = inverse_variance * y;
        g.mean += by_q * -2.0 * (axes * white);
        g.log_scale += by_q * -2.0 * (white * y);
        if kernel.row().unit_integral {
            g.log_scale -= by_weight * amplitude * value;
        }
        g.rotation += by_q * 2.0 * white.cross(y);
        g.opacity_logit += by_weight * amplitude * (1.0 - alpha) * value;
        g.intensity += adjoint.value * amplitude * value;
    }
    g
}

/// Returns the gradients of all splats.
pub fn splat_to_volume_grad(
    splats: &[Splat],
    positions: &[DVec3],
    folded: &[Adjoint],
    kernel: Kernel,
) -> Vec<Gradient> {
    splats.iter().map(|splat| splat_gradient(splat, positions, folded, kernel)).collect()
}
