//! `blind_parts`, and what `project_quads` leaves out: what of a picture lies in patches that no eye sees. In whole numbers,
//! so that a kernel must give the same.

use glam::DVec2;
use shaders_glsl::types::PATCHES;

/// Width and height of the parts of a tile, pixels.
const PART: [u32; 2] = [4, 8];

/// Whether a patch, counted from the upper left corner of the picture, is blind.
pub type Patches<'a> = &'a dyn Fn([usize; 2]) -> bool;

/// Patches along an axis that a pixel of `size` lies in, with all or a part of it.
fn patches_of(pixel: u32, size: u32) -> impl Iterator<Item = usize> {
    let [pixel, size, edge] = [u64::from(pixel), u64::from(size), PATCHES as u64];
    (0..PATCHES)
        .filter(move |&k| k as u64 * size < (pixel + 1) * edge && (k as u64 + 1) * size > pixel * edge)
}

/// Whether no eye sees a pixel of a picture of `size`: all patches that it lies in are blind.
pub fn is_blind(patches: Patches<'_>, [x, y]: [u32; 2], size: [u32; 2]) -> bool {
    patches_of(x, size[0]).all(|i| patches_of(y, size[1]).all(|j| patches([i, j])))
}

/// `blind_parts`: a bit for each part of a tile of which no pixel that is in the picture, and none beside it, is seen.
pub fn blind_parts(patches: Patches<'_>, tile: [u32; 2], size: [u32; 2]) -> u32 {
    let part_is_blind = |part: u32| {
        let from = [tile[0] * 16 + part % 4 * PART[0], tile[1] * 16 + part / 4 * PART[1]];
        let pixels =
            |axis: usize| from[axis].saturating_sub(1)..(from[axis] + PART[axis] + 1).min(size[axis]);
        let beyond = from[0] >= size[0] || from[1] >= size[1];
        beyond || pixels(1).all(|y| pixels(0).all(|x| is_blind(patches, [x, y], size)))
    };
    (0..8).map(|part| u32::from(part_is_blind(part)) << part).sum()
}

/// What `project_quads` asks of an ellipse: whether all patches that a rectangle around `centre`, pixels, touches, widened by a
/// pixel, are blind.
pub fn rectangle_is_blind(patches: Patches<'_>, centre: DVec2, half_size: DVec2, size: [u32; 2]) -> bool {
    let touched = |axis: usize| {
        let reach = half_size[axis] + 1.0;
        let patch = |pixels: f64| (pixels * PATCHES as f64 / f64::from(size[axis])).floor();
        let inside = |patch: f64| patch.clamp(0.0, PATCHES as f64 - 1.0) as usize;
        inside(patch(centre[axis] - reach))..=inside(patch(centre[axis] + reach))
    };
    touched(0).all(|i| touched(1).all(|j| patches([i, j])))
}
