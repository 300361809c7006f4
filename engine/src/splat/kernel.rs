//! The profile κ(q) of a splat over the squared whitened distance q = |S⁻¹Rᵀ(x − mean)|²; w(x) = α·κ(q).
//!
//! Peak-1 (un-normalised) profiles with finite support, one row of [`KERNELS`] each. A fit is tied to its kernel:
//! a set that was fitted with one and drawn with the other loses some 20 dB.

use serde::{Deserialize, Serialize};

/// The kernel of a splat set. The discriminant is the id that shaders branch on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[repr(u32)]
pub enum Kernel {
    /// κ = (1 − q/6)³ for q < 6: smooth to second order at its border, no exponential. The default of the fit.
    Compact = 0,
    /// κ = exp(−q/2) for q < 9 (3 σ): what ordinary Gaussian splatting viewers draw.
    Gaussian = 1,
}

/// One kernel: its name, its support and its profile.
pub struct KernelRow {
    /// The kernel that this row describes.
    pub kernel: Kernel,
    /// Name in files and on the command line.
    pub name: &'static str,
    /// κ is 0 for q at or beyond this.
    pub support_q: f64,
    value: fn(f64) -> f64,
    slope: fn(f64) -> f64,
}

/// Every kernel; the row's index is the kernel's id.
pub const KERNELS: [KernelRow; 2] = [
    KernelRow {
        kernel: Kernel::Compact,
        name: "compact",
        support_q: 6.0,
        value: |q| (1.0 - q / 6.0).powi(3),
        slope: |q| (1.0 - q / 6.0).powi(2),
    },
    KernelRow {
        kernel: Kernel::Gaussian,
        name: "gaussian",
        support_q: 9.0,
        value: |q| (-0.5 * q).exp(),
        slope: |q| (-0.5 * q).exp(),
    },
];

impl Kernel {
    /// The row of this kernel in [`KERNELS`].
    pub fn row(self) -> &'static KernelRow {
        &KERNELS[self as usize]
    }

    /// Name in files and on the command line.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    /// Number that stands for this kernel in shaders.
    pub fn id(self) -> u32 {
        self as u32
    }

    /// The kernel called `name`, exactly as [`Kernel::name`] spells it.
    pub fn from_name(name: &str) -> Option<Kernel> {
        KERNELS.iter().find(|row| row.name == name).map(|row| row.kernel)
    }

    /// Squared whitened distance from which on κ is 0; its root is the support radius in σ.
    pub fn support_q(self) -> f64 {
        self.row().support_q
    }

    /// κ(q) for q ≥ 0; 0 outside the support.
    pub fn value(self, q: f64) -> f64 {
        if q < self.support_q() { (self.row().value)(q) } else { 0.0 }
    }

    /// −2·dκ/dq for q ≥ 0, the factor of every gradient; 0 outside the support.
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
    fn slope_is_minus_two_times_the_derivative() {
        for row in &KERNELS {
            let kernel = row.kernel;
            assert_eq!(kernel.value(0.0), 1.0, "{}: the peak is 1", row.name);
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
