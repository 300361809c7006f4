//! What can be given up to render faster, in the order in which it is missed least.

#[cfg(doc)]
use super::Settings;
use crate::budget;
#[cfg(doc)]
use crate::splat::SplatSet;

/// What a frame may spend: what can change from one to the next without anything being made anew.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Edges of the picture, as a part of those of the target, in whose upper left corner it lies: 0 to 1.
    pub resolution: f64,
    /// Distance of slabs or samples in units of [`Settings::step`], 1 or more.
    pub coarseness: f64,
    /// The first splats of the scene that are shown, as a part of all: 0 to 1. It looks best where a set begins with those that
    /// matter most ([`SplatSet::order_by_importance`]).
    pub splats: f64,
}

impl Quality {
    /// All that the settings promise.
    pub const FULL: Self = Quality { resolution: 1.0, coarseness: 1.0, splats: 1.0 };

    /// Width and height of the picture in a target of `size`, pixels.
    ///
    /// # Panics
    /// If the quality is better than the target.
    pub fn size(&self, size: [u32; 2]) -> [u32; 2] {
        assert!(
            self.resolution <= 1.0 && self.coarseness >= 1.0 && self.splats <= 1.0,
            "better than the settings: {self:?}"
        );
        size.map(|n| ((f64::from(n) * self.resolution).round() as u32).max(1))
    }

    /// How many of so many splats are shown; at least one, where there is one.
    pub fn splat_count(&self, all: usize) -> usize {
        ((all as f64 * self.splats).ceil() as usize).min(all)
    }
}

/// A rung of a ladder: a way to render, and what it costs.
#[derive(Clone, Copy, Debug)]
pub struct Rung {
    /// Name of the mode.
    pub mode: &'static str,
    /// What is given up within the mode.
    pub quality: Quality,
    /// Device time relative to the first rung; measured by `bench ladder`.
    pub cost: f64,
}

const fn rung(mode: &'static str, resolution: f64, coarseness: f64, splats: f64, cost: f64) -> Rung {
    Rung { mode, quality: Quality { resolution, coarseness, splats }, cost }
}

/// The mode that classifies before it adds up comes first, then coarser pictures, then the least important splats are left out.
///
/// Measured on a CPU driver (lavapipe, 250,000 splats of bones, two eyes of 240 x 240 pixels). There coarser pictures and
/// thicker slabs save nothing in mode `slab` (1.2 to 1.4 of the first rung at resolutions of 0.7 and 0.85), and less
/// important splats left out make rays end later. On a GPU that may be otherwise: `bench ladder` measures it.
pub static LADDER: [Rung; 6] = [
    rung("slab", 1.0, 1.0, 1.0, 1.0),
    rung("alpha", 0.85, 1.0, 1.0, 0.48),
    rung("alpha", 0.7, 1.0, 0.6, 0.29),
    rung("alpha", 0.6, 1.0, 0.3, 0.15),
    rung("alpha", 0.5, 1.0, 0.15, 0.08),
    rung("alpha", 0.5, 1.0, 0.05, 0.02),
];

/// The costs of rungs, for a controller.
pub fn ladder(rungs: &[Rung]) -> budget::Ladder {
    budget::Ladder::new(rungs.iter().map(|r| r.cost))
}
