//! What can be given up to render faster, in the order in which it is missed least.

use std::sync::LazyLock;

use serde::Deserialize;

#[cfg(doc)]
use super::Settings;
use super::mode;
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
    /// Time of a frame relative to the first rung; measured by `bench trade render`.
    pub cost: f64,
}

/// The rungs of viewers, the best first: those of the front of PSNR against cost that `bench trade render --ladder` measures.
/// It writes `ladder.toml`, which says on what.
///
/// # Panics
/// If that file is not in order, which a test sees to.
pub static LADDER: LazyLock<Vec<Rung>> = LazyLock::new(|| {
    let file: File = toml::from_str(include_str!("ladder.toml")).expect("ladder.toml is of this form");
    file.rungs.iter().map(Row::rung).collect()
});

/// What `ladder.toml` holds.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    #[serde(rename = "rung")]
    rungs: Vec<Row>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Row {
    mode: String,
    resolution: f64,
    coarseness: f64,
    splats: f64,
    cost: f64,
    /// For people.
    #[serde(rename = "psnr")]
    _psnr: f64,
}

impl Row {
    fn rung(&self) -> Rung {
        Rung {
            mode: mode(&self.mode).expect("ladder.toml names modes that there are").name,
            quality: Quality {
                resolution: self.resolution,
                coarseness: self.coarseness,
                splats: self.splats,
            },
            cost: self.cost,
        }
    }
}

/// The costs of rungs, for a controller.
pub fn ladder(rungs: &[Rung]) -> budget::Ladder {
    budget::Ladder::new(rungs.iter().map(|r| r.cost))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ladder_begins_with_all_and_goes_down() {
        assert_eq!((LADDER[0].quality, LADDER[0].cost), (Quality::FULL, 1.0));
        // Refuses costs that do not fall.
        assert_eq!(ladder(&LADDER).len(), LADDER.len());
        assert!(LADDER.len() > 1);
    }
}
