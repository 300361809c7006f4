//! `hidden_parts` and the test in `project_quads` for what the lens hides: which parts of a picture lie in
//! patches that no eye sees. All tests of tiles use whole numbers, so that a kernel must give the same
//! results.

use glam::DVec2;
use shader_interface::types::PATCHES;

/// Width and height of the parts of a tile, pixels.
const PART: [u32; 2] = [4, 8];

/// Returns true if a patch, counted from the upper left corner of the picture, is hidden by the lens.
pub type Patches<'a> = &'a dyn Fn([usize; 2]) -> bool;

/// Returns the patches along one axis that hold all or a part of a pixel, for a picture of `size` pixels.
fn patches_of(pixel: u32, size: u32) -> impl Iterator<Item = usize> {
    let [pixel, size, edge] = [u64::from(pixel), u64::from(size), PATCHES as u64];
    (0..PATCHES)
        .filter(move |&k| k as u64 * size < (pixel + 1) * edge && (k as u64 + 1) * size > pixel * edge)
}

/// Returns true if no eye sees a pixel of a picture of `size`: all patches that it lies in are hidden by the
/// lens.
pub fn is_hidden(patches: Patches<'_>, [x, y]: [u32; 2], size: [u32; 2]) -> bool {
    patches_of(x, size[0]).all(|i| patches_of(y, size[1]).all(|j| patches([i, j])))
}

/// Returns a bit for each part of a tile. It is set if no eye sees any pixel of the part, nor any pixel
/// beside it, within the picture; it is also set for a part beyond the picture.
pub fn hidden_parts(patches: Patches<'_>, tile: [u32; 2], size: [u32; 2]) -> u32 {
    let part_is_hidden = |part: u32| {
        let from = [tile[0] * 16 + part % 4 * PART[0], tile[1] * 16 + part / 4 * PART[1]];
        let pixels =
            |axis: usize| from[axis].saturating_sub(1)..(from[axis] + PART[axis] + 1).min(size[axis]);
        let beyond = from[0] >= size[0] || from[1] >= size[1];
        beyond || pixels(1).all(|y| pixels(0).all(|x| is_hidden(patches, [x, y], size)))
    };
    (0..8).map(|part| u32::from(part_is_hidden(part)) << part).sum()
}

/// Returns true if `project_quads` drops an ellipse: all patches that its rectangle around `centre` touches
/// are hidden by the lens. The rectangle, pixels, is widened by one pixel.
pub fn rectangle_is_hidden(patches: Patches<'_>, centre: DVec2, half_size: DVec2, size: [u32; 2]) -> bool {
    let touched = |axis: usize| {
        let reach = half_size[axis] + 1.0;
        let patch = |pixels: f64| (pixels * PATCHES as f64 / f64::from(size[axis])).floor();
        let inside = |patch: f64| patch.clamp(0.0, PATCHES as f64 - 1.0) as usize;
        inside(patch(centre[axis] - reach))..=inside(patch(centre[axis] + reach))
    };
    touched(0).all(|i| touched(1).all(|j| patches([i, j])))
}
