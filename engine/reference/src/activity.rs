//! `limit_active`: keeps the most important of the splats that a look can show.

/// Returns flags of which only the first `budget` flagged splats of `order` remain set.
pub fn limit_active(flags: &[bool], order: &[u32], budget: usize) -> Vec<bool> {
    let mut kept = vec![false; flags.len()];
    for &splat in order.iter().filter(|&&splat| flags[splat as usize]).take(budget) {
        kept[splat as usize] = true;
    }
    kept
}
