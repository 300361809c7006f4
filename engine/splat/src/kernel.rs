//! The profile κ(q) of a splat over the squared whitened distance q = |S⁻¹Rᵀ(x − mean)|²; w(x) = a·κ(q) with
//! the amplitude a = α·[peak](Kernel::peak).
//!
//! Profiles are 1 at the centre and have finite support; each is a row of [`KERNELS`]. A fit is tied to its
//! kernel: a set that was fitted with one and drawn with another loses some 20 dB.

use serde::{Deserialize, Serialize};
use shader_interface::kernel::{KERNEL_COMPACT, KERNEL_DENSITY, KERNEL_GATED, KERNEL_GAUSSIAN};

/// The kernel of a splat set. The discriminant is the id that shaders branch on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[repr(u32)]
pub enum Kernel {
    /// κ = (1 − q/6)³ for q < 6: smooth to second order at its border, no exponential. The default of the
    /// fit.
    Compact = KERNEL_COMPACT,
    /// κ = exp(−q/2) for q < 9 (3 σ): what ordinary Gaussian splatting viewers draw.
    Gaussian = KERNEL_GAUSSIAN,
    /// The Gaussian at a peak of 1/((2π)^{3/2} s₁s₂s₃), so that its integral over space, in voxels, is 1
    /// before the cut. So w and the effect of ε on it depend on the size of a splat and on the voxels: on a
    /// grid twice as fine w is an eighth.
    Density = KERNEL_DENSITY,
    /// κ = exp(−q/2) σ((1.794 − √(q + 10⁻⁶))/0.75), the Gaussian of the paper's authors behind a soft gate at
    /// 1.794 σ, where it would be 0.2; cut off 10 voxels from the mean along each axis of a volume.
    Gated = KERNEL_GATED,
}

/// Greatest ln of a peak. With it neither sums of w nor the gradient of the smallest splat leave f32; it is
/// reached at scales of 7·10⁻⁷ voxels.
pub const LN_PEAK_MAX: f64 = shader_interface::kernel::LN_PEAK_MAX as f64;

/// A kernel: its name, its support and its profile.
pub struct KernelRow {
    /// The kernel that this row describes.
    pub kernel: Kernel,
    /// Name in files and on the command line.
    pub name: &'static str,
    /// Support: κ is 0 for q at or beyond this.
    pub support_q: f64,
    /// Reach: in a volume κ is 0 beyond this distance from the mean along any axis, voxels; infinite for most
    /// kernels.
    pub reach: f64,
    /// True if the peak depends on the scales, so that the profile integrates to 1 before its cut.
    pub unit_integral: bool,
    value: fn(f64) -> f64,
    slope: fn(f64) -> f64,
}

/// Every kernel; the row's index is the kernel's id.
pub const KERNELS: [KernelRow; 4] = [
    KernelRow {
        kernel: Kernel::Compact,
        name: "compact",
        support_q: 6.0,
        reach: f64::INFINITY,
        unit_integral: false,
        value: |q| (1.0 - q / 6.0).powi(3),
        slope: |q| (1.0 - q / 6.0).powi(2),
    },
    KernelRow {
        kernel: Kernel::Gaussian,
        name: "gaussian",
        support_q: 9.0,
        reach: f64::INFINITY,
        unit_integral: false,
        value: |q| (-0.5 * q).exp(),
        slope: |q| (-0.5 * q).exp(),
    },
    KernelRow {
        kernel: Kernel::Density,
        name: "density",
        support_q: 9.0,
        reach: f64::INFINITY,
        unit_integral: true,
        value: |q| (-0.5 * q).exp(),
        slope: |q| (-0.5 * q).exp(),
    },
    KernelRow {
        kernel: Kernel::Gated,
        name: "gated",
        // √q = 1.794 + 4 · 0.75: here the gate has fallen to 0.018 and κ to 2·10⁻⁷.
        support_q: 4.794 * 4.794,
        reach: 10.0,
        unit_integral: false,
        value: |q| (-0.5 * q).exp() * gate(q),
        slope: |q| (-0.5 * q).exp() * gate(q) * (1.0 + (1.0 - gate(q)) / (0.75 * (q + 1e-6).sqrt())),
    },
];

/// Returns the gate of [`Kernel::Gated`] at q.
fn gate(q: f64) -> f64 {
    1.0 / (1.0 + (((q + 1e-6).sqrt() - 1.794) / 0.75).exp())
}

impl Kernel {
    /// Returns the row of this kernel in [`KERNELS`].
    pub fn row(self) -> &'static KernelRow {
        &KERNELS[self as usize]
    }

    /// Returns the name of this kernel in files and on the command line.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// Returns the number that stands for this kernel in shaders.
    pub fn id(self) -> u32 {
        self as u32
    }

    /// Returns the kernel called `name`, exactly as [`Kernel::name`] spells it.
    pub fn from_name(name: &str) -> Option<Kernel> {
        KERNELS.iter().find(|row| row.name == name).map(|row| row.kernel)
    }

    /// Returns the squared whitened distance from which on κ is 0; its root is the support radius in σ.
    pub fn support_q(self) -> f64 {
        self.row().support_q
    }

    /// Returns the factor of α in the amplitude: 1, or 1/((2π)^{3/2} s₁s₂s₃) for scales given by their
    /// logarithms, in voxels.
    pub fn peak(self, log_scale: [f64; 3]) -> f64 {
        if !self.row().unit_integral {
            return 1.0;
        }
        // In logarithms, as on the device: a product of scales within their limits may leave f32.
        let ln_peak = -log_scale.iter().sum::<f64>() - 1.5 * std::f64::consts::TAU.ln();
        ln_peak.min(LN_PEAK_MAX).exp()
    }

    /// Returns κ(q) for q ≥ 0; 0 outside the support.
    pub fn value(self, q: f64) -> f64 {
        if q < self.support_q() { (self.row().value)(q) } else { 0.0 }
    }

    /// Returns true if a sample of a volume at `d` voxels from the mean is not cut off. The margin is that of
    /// the device, so that both decide alike.
    pub fn reaches(self, d: glam::DVec3) -> bool {
        d.abs().max_element() <= self.row().reach + 1e-3
    }

    /// Returns κ(q) at a sample of a volume, `d` voxels from the mean.
    pub fn cut_value(self, d: glam::DVec3, q: f64) -> f64 {
        if self.reaches(d) { self.value(q) } else { 0.0 }
    }

    /// Returns −2·dκ/dq at a sample of a volume, `d` voxels from the mean.
    pub fn cut_slope(self, d: glam::DVec3, q: f64) -> f64 {
        if self.reaches(d) { self.slope(q) } else { 0.0 }
    }

    /// Returns −2·dκ/dq for q ≥ 0, the factor of every gradient; 0 outside the support.
    pub fn slope(self, q: f64) -> f64 {
        if q < self.support_q() { (self.row().slope)(q) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_in_id_order_and_named_uniquely() {
        for (index, row) in KERNELS.iter().enumerate() {
            assert_eq!(row.kernel.id() as usize, index);
            assert_eq!(Kernel::from_name(row.name), Some(row.kernel));
        }
        assert_eq!(Kernel::from_name("Compact"), None);
    }

    #[test]
    fn the_density_integrates_to_one() {
        // The mass beyond 3 σ of a Gaussian in space: erfc(3/√2) + 3·√(2/π)·exp(-9/2) = 0.029291.
        let log_scale = [0.3, 0.9, 0.6];
        let s: [f64; 3] = log_scale.map(f64::exp);
        let reach = |k: usize| (3.0 * s[k]).ceil() as i32;
        let mut sum = 0.0;
        for z in -reach(2)..=reach(2) {
            for y in -reach(1)..=reach(1) {
                for x in -reach(0)..=reach(0) {
                    let u = [f64::from(x) / s[0], f64::from(y) / s[1], f64::from(z) / s[2]];
                    sum += Kernel::Density.value(u.iter().map(|v| v * v).sum());
                }
            }
        }
        let mass = sum * Kernel::Density.peak(log_scale);
        assert!((mass - (1.0 - 0.029_291)).abs() < 2e-3, "{mass}");
        assert_eq!(Kernel::Gaussian.peak(log_scale), 1.0);
        assert_eq!(Kernel::Density.peak([-40.0; 3]), LN_PEAK_MAX.exp(), "a peak stays within f32");
    }

    #[test]
    fn slope_is_minus_two_times_the_derivative() {
        for row in &KERNELS {
            let kernel = row.kernel;
            let peak = if kernel == Kernel::Gated { 0.916 } else { 1.0 };
            assert!((kernel.value(0.0) - peak).abs() < 5e-4, "{}: the peak", row.name);
            assert_eq!(kernel.value(row.support_q), 0.0, "{}: no value at the border", row.name);
            assert_eq!(kernel.slope(row.support_q + 1.0), 0.0);
            let step = 1e-5;
            for i in 1..50 {
                let q = row.support_q * f64::from(i) / 50.0;
                let central = (kernel.value(q + step) - kernel.value(q - step)) / (2.0 * step);
                assert!((kernel.slope(q) + 2.0 * central).abs() < 1e-9, "{} at q = {q}", row.name);
            }
        }
    }
}
