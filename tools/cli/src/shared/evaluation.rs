//! How splats are measured against a volume, by `fit` at its end and by `eval`.

use engine::Result;
use engine::fit::evaluate::{self, Evaluation, Protocol};
use engine::gpu::Gpu;
use engine::render;
use engine::splat::SplatSet;

use super::flags::Range;
use super::inputs::Case;

/// Offsets of the closing evaluation come from this seed, as those of `vgs eval` by default.
pub const EVAL_SEED: u64 = 7;

/// Returns the mask value above which voxels count in a figure over this range, all alike; 0 where the mask weighs
/// them. Over the range of the region figures are those of the paper's authors, who do not weigh.
pub fn unweighted(range: Option<Range>) -> f32 {
    if range == Some(Range::Roi) { 0.01 } else { 0.0 }
}

/// Measures what mode decoded shows of a set.
pub fn evaluate_decoded(gpu: &Gpu, set: &SplatSet, case: &Case, protocol: &Protocol) -> Result<Evaluation> {
    let decoded = render::decode(gpu, set, 1.0)?;
    let field = decoded.in_voxels_of(&case.volume, set.origin_mm);
    Ok(evaluate::evaluate_field(field, &case.volume, &case.roi, protocol))
}
