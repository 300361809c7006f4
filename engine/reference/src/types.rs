//! Splats, footprints and samples in f64, made from the f32 structs that kernels share.

use glam::{DMat3, DQuat, DVec3};
use shader_interface::types as gpu;

/// Number of parameters of a splat by which the loss is differentiated: mean 3, opacity logit, rotation 3,
/// log scale 3, intensity.
pub const LANES: usize = 11;

/// Raw parameters of one splat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Splat {
    /// Centre, voxels.
    pub mean: DVec3,
    /// Opacity α = 1 / (1 + exp(-logit)).
    pub opacity_logit: f64,
    /// Unit quaternion; the columns of its matrix are the splat's axes.
    pub rotation: DQuat,
    /// Natural logarithm of the standard deviation along each axis.
    pub log_scale: DVec3,
    /// Intensity relative to the background.
    pub intensity: f64,
}

/// The part of a splat that rasterization needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Footprint {
    /// Centre, voxels.
    pub mean: DVec3,
    /// a of w = a κ(q): α times the kernel's peak.
    pub amplitude: f64,
    /// T, upper triangular: the whitened distance is u = T (x - mean).
    pub whitening: DMat3,
    /// Intensity relative to the background.
    pub intensity: f64,
    /// Half size of the box that holds the support, voxels.
    pub extent: DVec3,
}

/// dL/d(parameter) of one splat; also a row of Adam's moments.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gradient {
    /// Derivative by the centre.
    pub mean: DVec3,
    /// Derivative by the opacity logit.
    pub opacity_logit: f64,
    /// Derivative by a small rotation about each of the splat's own axes, radians.
    pub rotation: DVec3,
    /// Derivative by the logarithm of each scale.
    pub log_scale: DVec3,
    /// Derivative by the intensity.
    pub intensity: f64,
}

/// W and V̂ (relative to the background) of a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reconstruction {
    /// W = Σ w.
    pub weight: f64,
    /// V̂ = Σ w c / (W + ε).
    pub value: f64,
}

/// Wanted value and occupancy of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// V relative to the background.
    pub value: f64,
    /// M in 0..1; negative where the sample takes no part.
    pub occupancy: f64,
}

/// dL/dV̂ and dL/dW of a sample; A and H after folding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Adjoint {
    /// dL/dV̂, then A.
    pub value: f64,
    /// dL/dW, then H.
    pub weight: f64,
}

pub(super) fn vec3(v: [f32; 3]) -> DVec3 {
    DVec3::from_array(v.map(f64::from))
}

impl From<&gpu::Splat> for Splat {
    fn from(s: &gpu::Splat) -> Self {
        let [w, x, y, z] = s.rotation.map(f64::from);
        Splat {
            mean: vec3(s.mean),
            opacity_logit: f64::from(s.opacity_logit),
            rotation: DQuat::from_xyzw(x, y, z, w),
            log_scale: vec3(s.log_scale),
            intensity: f64::from(s.intensity),
        }
    }
}

impl From<&gpu::Footprint> for Footprint {
    fn from(f: &gpu::Footprint) -> Self {
        let [xx, xy, xz] = f.t_x.map(f64::from);
        let [yy, yz] = f.t_y.map(f64::from);
        Footprint {
            mean: vec3(f.mean),
            amplitude: f64::from(f.amplitude),
            whitening: DMat3::from_cols(
                DVec3::new(xx, 0.0, 0.0),
                DVec3::new(xy, yy, 0.0),
                DVec3::new(xz, yz, f64::from(f.t_z)),
            ),
            intensity: f64::from(f.intensity),
            extent: vec3(f.extent),
        }
    }
}

impl From<&gpu::SplatGrad> for Gradient {
    fn from(g: &gpu::SplatGrad) -> Self {
        Gradient {
            mean: vec3(g.mean),
            opacity_logit: f64::from(g.opacity_logit),
            rotation: vec3(g.rotation),
            log_scale: vec3(g.log_scale),
            intensity: f64::from(g.intensity),
        }
    }
}

impl From<&gpu::Reconstruction> for Reconstruction {
    fn from(r: &gpu::Reconstruction) -> Self {
        Reconstruction { weight: f64::from(r.weight), value: f64::from(r.value) }
    }
}

impl From<&gpu::Target> for Target {
    fn from(t: &gpu::Target) -> Self {
        Target { value: f64::from(t.value()), occupancy: f64::from(t.occupancy()) }
    }
}

impl From<&gpu::Adjoint> for Adjoint {
    fn from(a: &gpu::Adjoint) -> Self {
        Adjoint { value: f64::from(a.value), weight: f64::from(a.weight) }
    }
}

impl Splat {
    /// Returns the splat with parameter `lane` (0..[`LANES`]) larger by `step`. A rotation turns about the
    /// splat's own axis.
    pub fn moved(mut self, lane: usize, step: f64) -> Splat {
        match lane {
            0..3 => self.mean[lane] += step,
            3 => self.opacity_logit += step,
            4..7 => self.rotation *= DQuat::from_axis_angle(DVec3::AXES[lane - 4], step),
            7..10 => self.log_scale[lane - 7] += step,
            10 => self.intensity += step,
            _ => panic!("a splat has {LANES} parameters, {lane} is none of them"),
        }
        self
    }
}

impl Gradient {
    /// Returns all parameters in the order of [`LANES`].
    pub fn lanes(&self) -> [f64; LANES] {
        let ([mx, my, mz], [rx, ry, rz], [sx, sy, sz]) =
            (self.mean.to_array(), self.rotation.to_array(), self.log_scale.to_array());
        [mx, my, mz, self.opacity_logit, rx, ry, rz, sx, sy, sz, self.intensity]
    }
}
