//! `splat_to_volume_grad`: dL/d(parameters) of each splat from the folded adjoints.
//!
//! With d = x - mean, y = Rᵀd, u = S⁻¹y, q = |u|² and κ' = dκ/dq the chain rule is applied sample by sample:
//! dL/dw = A c + H,  dw/dμ = -2ακ' Pd (P = R S⁻² Rᵀ),  dw/dln s_k = -2ακ' u_k²,  dw/dlogit = α(1-α)κ,  dL/dc = A w.
//! A rotation by ω in the splat's own axes moves y by -ω × y, so that dq/dω = 2 (S⁻²y) · (-ω × y).

use glam::{DMat3, DVec3};

use super::{Adjoint, Gradient, Splat};
use crate::reference::splat_bounds::opacity;
use crate::splat::Kernel;

/// The gradient of one splat.
pub fn splat_gradient(splat: &Splat, positions: &[DVec3], folded: &[Adjoint], kernel: Kernel) -> Gradient {
    let axes = DMat3::from_quat(splat.rotation);
    let inverse_variance = (-2.0 * splat.log_scale).exp();
    let alpha = opacity(splat);
    let mut g = Gradient::default();
    for (&x, adjoint) in positions.iter().zip(folded) {
        let y = axes.transpose() * (x - splat.mean);
        let q = (y * y).dot(inverse_variance);
        if q >= kernel.support_q() {
            continue;
        }
        let by_weight = adjoint.value * splat.intensity + adjoint.weight;
        let value = kernel.value(q);
        // dL/dq, of which the slope of the kernel is -2 times a factor.
        let by_q = by_weight * alpha * kernel.slope(q) * -0.5;
        let white = inverse_variance * y;
        g.mean += by_q * -2.0 * (axes * white);
        g.log_scale += by_q * -2.0 * (white * y);
        g.rotation += by_q * 2.0 * white.cross(y);
        g.opacity_logit += by_weight * alpha * (1.0 - alpha) * value;
        g.intensity += adjoint.value * alpha * value;
    }
    g
}

/// The gradients of all splats.
pub fn splat_to_volume_grad(
    splats: &[Splat],
    positions: &[DVec3],
    folded: &[Adjoint],
    kernel: Kernel,
) -> Vec<Gradient> {
    splats.iter().map(|splat| splat_gradient(splat, positions, folded, kernel)).collect()
}
