//! Evaluation of splats against a volume, by `fit` at its end and by `eval`.

use engine::Result;
use engine::fit::evaluate::{self, Evaluation, Protocol};
use engine::gpu::Gpu;
use engine::render;
use engine::splat::SplatSet;

use super::flags::Range;
use super::inputs::Case;

/// Seed of the offsets of the closing evaluation, and of `vgs eval` by default.
pub const EVAL_SEED: u64 = 7;

/// Returns the mask value above which all voxels count alike in a figure over this range; 0 if they are
/// weighted by the mask. Figures over the range of the region are those of the paper's authors, who do not
/// weight.
pub fn unweighted(range: Option<Range>) -> f32 {
    if range == Some(Range::Roi) { 0.01 } else { 0.0 }
}

/// Measures what mode decoded shows of a set.
pub fn evaluate_decoded(gpu: &Gpu, set: &SplatSet, case: &Case, protocol: &Protocol) -> Result<Evaluation> {
    let decoded = render::decode(gpu, set, 1.0)?;
    let field = decoded.in_voxels_of(&case.volume, set.origin_mm);
    Ok(evaluate::evaluate_field(field, &case.volume, &case.roi, protocol))
}
