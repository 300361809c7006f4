//! Evaluation of splats against a volume, by `fit` at its end and by `eval`.

use super::flags::Range;

/// Seed of the offsets of the closing evaluation, and of `vgs eval` by default.
pub const EVAL_SEED: u64 = 7;

/// Returns the mask value above which all voxels count alike in a figure over this range; 0 if they are
/// weighted by the mask. Figures over the range of the region are those of the paper's authors, who do not
/// weight.
pub fn unweighted(range: Option<Range>) -> f32 {
    if range == Some(Range::Roi) { 0.01 } else { 0.0 }
}
