//! `limit_active`: the most important of the splats that a look can show.

/// Of the flagged splats the first `budget` ones of `order` stay flagged.
pub fn limit_active(flags: &[bool], order: &[u32], budget: usize) -> Vec<bool> {
    let mut kept = vec![false; flags.len()];
    for &splat in order.iter().filter(|&&splat| flags[splat as usize]).take(budget) {
        kept[splat as usize] = true;
    }
    kept
}
