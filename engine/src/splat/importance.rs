//! Which splats a set can do without: their order of importance.

use rayon::prelude::*;

use super::{Activations, Field, Splat};

/// All splats, the most important first: by a σ₁ σ₂ σ₃, which is ∫ w but for a factor that all share; of equals the first.
pub fn by_importance(splats: &[Splat], field: &Field) -> Vec<u32> {
    // In logarithms, because the product leaves the floats where the limits of scales are reached.
    let importance = |s: &Splat| {
        let log_scale = s.log_scale.map(f64::from);
        f64::from(s.opacity()).ln() + field.kernel.peak(log_scale).ln() + log_scale.iter().sum::<f64>()
    };
    let keys: Vec<f64> = splats.par_iter().map(importance).collect();
    let mut order: Vec<u32> = (0..splats.len() as u32).collect();
    order.par_sort_by(|&a, &b| keys[b as usize].total_cmp(&keys[a as usize]));
    order
}
