//! What a mode is made for.

use super::look::Classification;
use super::scene::Scene;
#[cfg(doc)]
use super::{GpuSplats, VisibilityMask};

/// What a mode is made for; to change one of these is to make the mode anew.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Width and height of the pictures, pixels.
    pub size: [u32; 2],
    /// Views that are rendered at once: 1, or 2 or 4 for a headset.
    pub views: u32,
    /// True if colour is kept in floats rather than in halves.
    pub precise: bool,
    /// True if depth is kept.
    pub depth: bool,
    /// True if it is said what of the pictures no eye sees ([`VisibilityMask`]), which modes of splats then
    /// leave transparent.
    pub masked: bool,
    /// Distance of the slabs in units of [`GpuSplats::sigma_mm`]; of the samples of a volume or a decoded
    /// field in units of the shortest edge of its voxels. A volume takes 1 where speed counts, 0.5 where
    /// looks do, and 0.25 where others are measured against it.
    pub step: f64,
    /// Distance of the voxels that splats are decoded to in mode decoded, in voxels of the grid that they
    /// were fitted on.
    pub pitch: f64,
    /// True if the samples of a volume begin at a random part of a step in each pixel, which turns the rings
    /// of a coarse step into noise. Not where pictures are measured.
    pub jitter: bool,
    /// How the transfer function is applied; by the look's own choice where nothing is said.
    pub classification: Option<Classification>,
    /// Rays end where less light than this would pass.
    pub dark: f32,
    /// True if pictures show the work of each pixel instead of its colour, for benchmarks, with `precise`. In
    /// mode slab its channels are, alike for the 4 × 8 pixels of a part of a tile: planes at which splats
    /// were evaluated, summed over the splats; the same over all splats of the tile's lists, which is what a
    /// group as wide as a tile goes through; planes classified; pairs looked at. In mode alpha: fragments,
    /// and those of them that were blended.
    pub counting: bool,
}

impl Settings {
    /// One view of this size, at full quality.
    pub fn new(size: [u32; 2]) -> Self {
        Settings {
            size,
            views: 1,
            precise: false,
            depth: false,
            masked: false,
            step: 1.0,
            pitch: 1.0,
            jitter: false,
            classification: None,
            dark: 1.0 / 512.0,
            counting: false,
        }
    }
}

impl Settings {
    /// Returns how a scene is classified, and whether it is lit: what kernels are made for.
    pub(super) fn variant(&self, scene: &Scene) -> (Classification, bool) {
        let classification = self.classification.unwrap_or_else(|| scene.look().classification());
        (classification, scene.look_buffers().shaded)
    }
}
