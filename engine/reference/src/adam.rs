//! `adam`: one step of Adam with the clamps of the fit.

use glam::{DQuat, DVec3};
use shader_interface::types::AdamParams;

use super::types::vec3;
use super::{Gradient, Splat};

/// A splat with what Adam keeps of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdamState {
    /// Parameters.
    pub splat: Splat,
    /// Moving mean of the gradient.
    pub first: Gradient,
    /// Moving mean of its square.
    pub second: Gradient,
    /// Σ |dL/dμ| over the steps so far.
    pub gradient_norm: f64,
    /// Upper bound of each log scale.
    pub log_scale_cap: f64,
}

/// Updates the moments of one parameter and returns the step that it takes.
fn moved(g: f64, first: &mut f64, second: &mut f64, rate: f32, p: &AdamParams) -> f64 {
    let (beta1, beta2) = (f64::from(p.beta1), f64::from(p.beta2));
    *first = beta1 * *first + (1.0 - beta1) * g;
    *second = beta2 * *second + (1.0 - beta2) * g * g;
    let mean = *first * f64::from(p.correction1);
    let square = *second * f64::from(p.correction2);
    -f64::from(rate) * mean / (square.sqrt() + f64::from(p.epsilon))
}

fn moved3(g: DVec3, first: &mut DVec3, second: &mut DVec3, rate: [f32; 3], p: &AdamParams) -> DVec3 {
    DVec3::from_array(std::array::from_fn(|k| moved(g[k], &mut first[k], &mut second[k], rate[k], p)))
}

/// Takes one step. Returns `None` if the splat or the gradient is not finite: then nothing changes and the splat is
/// counted as frozen.
pub fn adam(state: &AdamState, gradient: &Gradient, p: &AdamParams) -> Option<AdamState> {
    let size: f64 = gradient.lanes().iter().map(|g| g * g).sum();
    // The square must fit an f32, since it goes into the second moment; NaN fails the comparison.
    let sound = |size: f64| matches!(size.partial_cmp(&1e37), Some(std::cmp::Ordering::Less));
    let held = &state.splat;
    let held = held.mean.length_squared()
        + held.rotation.length_squared()
        + held.log_scale.length_squared()
        + held.opacity_logit.powi(2)
        + held.intensity.powi(2);
    if !sound(size) || !sound(held) {
        return None;
    }
    let AdamState { mut splat, mut first, mut second, gradient_norm, log_scale_cap } = *state;
    let scale = splat.log_scale.exp();
    let pull = f64::from(p.scale_weight) * scale * scale / scale.length();
    splat.mean += moved3(gradient.mean, &mut first.mean, &mut second.mean, p.rate_mean, p);
    splat.mean = splat.mean.clamp(DVec3::splat(-0.5), vec3(p.max_mean));
    // q <- normalise(q (1, ω/2)).
    let turn = moved3(gradient.rotation, &mut first.rotation, &mut second.rotation, [p.rate_rotation; 3], p);
    let step = DQuat::from_xyzw(0.5 * turn.x, 0.5 * turn.y, 0.5 * turn.z, 1.0);
    splat.rotation = multiplied(splat.rotation, step).normalize();
    let (by_scale, rate) = (gradient.log_scale + pull, [p.rate_log_scale; 3]);
    splat.log_scale += moved3(by_scale, &mut first.log_scale, &mut second.log_scale, rate, p);
    let most = vec3(p.max_log_scale).min(DVec3::splat(log_scale_cap));
    splat.log_scale = splat.log_scale.clamp(vec3(p.min_log_scale).min(most), most);
    splat.opacity_logit +=
        moved(gradient.opacity_logit, &mut first.opacity_logit, &mut second.opacity_logit, p.rate_opacity, p);
    splat.opacity_logit = splat.opacity_logit.clamp(-f64::from(p.max_logit), f64::from(p.max_logit));
    splat.intensity +=
        moved(gradient.intensity, &mut first.intensity, &mut second.intensity, p.rate_intensity, p);
    splat.intensity = splat.intensity.clamp(f64::from(p.min_intensity), f64::from(p.max_intensity));
    let gradient_norm = gradient_norm + gradient.mean.length();
    Some(AdamState { splat, first, second, gradient_norm, log_scale_cap })
}

/// Multiplies two quaternions of any lengths: a b.
fn multiplied(a: DQuat, b: DQuat) -> DQuat {
    let (u, v) = (DVec3::new(a.x, a.y, a.z), DVec3::new(b.x, b.y, b.z));
    let vector = a.w * v + b.w * u + u.cross(v);
    DQuat::from_xyzw(vector.x, vector.y, vector.z, a.w * b.w - u.dot(v))
}
