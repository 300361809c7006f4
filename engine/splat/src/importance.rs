//! The order of importance of splats: which of them a set can do without.

use rayon::prelude::*;

use super::{Activations, Field, Splat};

/// Returns the indices of all splats, the most important first. The importance is a σ₁ σ₂ σ₃, which is ∫ w
/// but for a factor that all share; equally important splats keep their order.
pub fn by_importance(splats: &[Splat], field: &Field) -> Vec<u32> {
    // In logarithms, since the product leaves the range of floats where scales reach their limits.
    let importance = |s: &Splat| {
        let log_scale = s.log_scale.map(f64::from);
        f64::from(s.opacity()).ln() + field.kernel.peak(log_scale).ln() + log_scale.iter().sum::<f64>()
    };
    let keys: Vec<f64> = splats.par_iter().map(importance).collect();
    let mut order: Vec<u32> = (0..splats.len() as u32).collect();
    order.par_sort_by(|&a, &b| keys[b as usize].total_cmp(&keys[a as usize]));
    order
}
