//! The settings that a mode is created for.

use super::decoded::DecodeOptions;
use super::look::Classification;
use super::scene::Scene;
#[cfg(doc)]
use super::{GpuSplats, VisibilityMask};

/// How the rays of modes volume and decoded are started. The pictures are the same, bit by bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Rays {
    /// A kernel marches the ray of every pixel.
    Computed,
    /// Fragment shaders march the rays of those pixels that faces around the visible bricks cover, so that
    /// what a device does for fragments is done for rays: fewer of them at the rim of a headset's field of
    /// view. Where a device's fragment shaders have no subgroups, rays are computed all the same.
    #[default]
    Rasterized,
}

impl Rays {
    /// Returns the way of a device whose fragment shaders have subgroups, or not.
    pub(super) fn where_subgroups_are(self, in_fragments: bool) -> Self {
        if in_fragments { self } else { Rays::Computed }
    }
}

/// Settings that a mode is created for; a change of one of them requires a new mode.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Width and height of the pictures, pixels.
    pub size: [u32; 2],
    /// Number of views that are rendered at once: 1, or 2 or 4 for a headset.
    pub views: u32,
    /// True if colour is kept in floats rather than in halves.
    pub precise: bool,
    /// True if depth is kept.
    pub depth: bool,
    /// True if the pictures have visibility masks ([`VisibilityMask`]). Modes of splats leave the hidden
    /// parts transparent.
    pub masked: bool,
    /// Distance of the slabs in units of [`GpuSplats::sigma_mm`]; for a volume or a decoded field, distance
    /// of the samples where something shows, in units of the shortest edge of its voxels.
    pub step: f64,
    /// For a volume or a decoded field, length of the cells of a ray in the same units, 0.01 to 2, or the step where
    /// that is longer; `None` for four steps, at least 1 and at most 1.5. A cell is sampled at its ends and, only where
    /// something can show, at every step.
    pub cell: Option<f64>,
    /// How splats are decoded in mode decoded. The pitch of splats that were fitted for the voxels alone is 1 or the
    /// next power of two.
    pub decoding: DecodeOptions,
    /// True if the samples of a volume begin at a random part of a step in each pixel, which turns the rings
    /// of a coarse step into noise. It is not for pictures that are measured.
    pub jitter: bool,
    /// How rays are started.
    pub rays: Rays,
    /// How the transfer function is applied; `None` leaves the choice to the look.
    pub classification: Option<Classification>,
    /// Least light: rays end when less than this would pass.
    pub dark: f32,
    /// True if frames of less than full quality may follow a new look over some frames, so that none of them is late: the
    /// colours of mode alpha, the light of volume and decoded. For programs that render all the time.
    pub gradual: bool,
    /// True if pictures show the work of each pixel instead of its colour, for benchmarks, with `precise`. In
    /// mode slab the channels are, alike for the 4 × 8 pixels of a part of a tile: planes at which splats
    /// were evaluated, summed over the splats; the same over the splats of this part and the one beside it,
    /// as for a group as wide as both; planes classified; pairs visited. In mode alpha: fragments, and those of them that
    /// were blended. In modes volume and decoded, alike for the pixels of a subgroup: rounds of its rays, those
    /// of them in which the field was sampled, and those in which the gradient was; and 1 where a ray was
    /// started.
    pub counting: bool,
}

impl Settings {
    /// Creates settings for one view of this size, at full quality.
    pub fn new(size: [u32; 2]) -> Self {
        Settings {
            size,
            views: 1,
            precise: false,
            depth: false,
            masked: false,
            step: 1.0,
            cell: None,
            decoding: DecodeOptions::default(),
            jitter: false,
            rays: Rays::default(),
            classification: None,
            dark: 1.0 / 512.0,
            gradual: false,
            counting: false,
        }
    }
}

impl Settings {
    /// Returns how a scene is classified, and true if it is lit: kernels are created for both.
    pub(super) fn variant(&self, scene: &Scene) -> (Classification, bool) {
        let classification = self.classification.unwrap_or_else(|| scene.look().classification());
        (classification, scene.look_buffers().facts.shaded)
    }

    /// Returns the classifications that looks may ask for.
    pub(super) fn classifications(&self) -> Vec<Classification> {
        self.classification
            .map_or(vec![Classification::Point, Classification::PreIntegrated], |one| vec![one])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rays_are_computed_where_fragments_have_no_subgroups() {
        for (rays, fragment_subgroups, wanted) in [
            (Rays::Computed, true, Rays::Computed),
            (Rays::Computed, false, Rays::Computed),
            (Rays::Rasterized, true, Rays::Rasterized),
            (Rays::Rasterized, false, Rays::Computed),
        ] {
            assert_eq!(rays.where_subgroups_are(fragment_subgroups), wanted);
        }
    }
}
