//! Plans the pictures: a default, choices that differ from it in one thing, and some that give up several.

use engine::render::{Quality, QualityLevel, SplatKind, quality_levels};
use serde::{Deserialize, Serialize};

/// Step of the best quality levels of mode decoded, voxels: that of finished pictures.
const FINEST_DECODED: f64 = 0.25;

/// One way to render splats.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Choice {
    /// Name of the mode.
    pub mode: String,
    /// True if the splats are those of a fit for the CT's grid, not of one that is right between the voxels,
    /// too.
    pub of_grid: bool,
    /// Distance of slabs, in standard deviations of a splat, or of samples, in voxels.
    pub step: f64,
    /// Edge of the picture as a part of the full one; the picture is enlarged to be compared.
    pub resolution: f64,
    /// Part of the splats that is rendered, the most important ones; the others are left out of the scene.
    pub splats: f64,
    /// True if splats are kept in 16 bytes each.
    pub packed: bool,
}

impl Choice {
    /// Returns the choice with which viewers begin, for a mode.
    pub fn usual(mode: &str) -> Self {
        Choice { mode: mode.into(), of_grid: false, step: 1.0, resolution: 1.0, splats: 1.0, packed: false }
    }

    /// Returns the choice for a fit for the grid, which has one mode, in steps of a voxel.
    pub fn of_grid() -> Self {
        Choice { of_grid: true, ..Self::usual("decoded") }
    }

    /// Returns the choice with which the quality levels for splats of this kind begin.
    pub fn best(kind: SplatKind) -> Self {
        match kind {
            SplatKind::Field => Choice { step: FINEST_DECODED, ..Self::usual("decoded") },
            SplatKind::Grid => Choice { step: FINEST_DECODED, ..Self::of_grid() },
            SplatKind::Coloured => Self::usual("alpha"),
        }
    }

    /// Returns the least step of a quality level.
    fn finest(&self) -> f64 {
        if self.mode == "decoded" { FINEST_DECODED } else { 1.0 }
    }

    /// Returns the choice that corresponds to a quality level for splats of this kind.
    pub fn of_level(kind: SplatKind, level: &QualityLevel) -> Self {
        Choice {
            mode: level.mode.into(),
            of_grid: kind == SplatKind::Grid,
            step: level.quality.coarseness,
            resolution: level.quality.resolution,
            ..Self::usual("")
        }
    }

    /// Returns true if a frame can change to this choice without creating anything anew and without leaving
    /// anything out, so that it can be a quality level. Rays in longer steps than two voxels miss thin bone in
    /// every second pixel.
    pub fn can_be_level(&self) -> bool {
        let misses_nothing = self.splats == 1.0 && (self.mode != "decoded" || self.step <= 2.0);
        misses_nothing && !self.packed && self.step >= self.finest() && self.mode != "exact"
    }

    /// Returns what is given up within the mode.
    pub fn quality(&self) -> Quality {
        Quality { resolution: self.resolution, coarseness: self.step.max(self.finest()), ..Quality::FULL }
    }

    /// Returns [`engine::render::Settings::step`], of which [`Choice::quality`] has multiples: 1 for all that
    /// can be a quality level.
    pub fn settings_step(&self) -> f64 {
        self.step / self.quality().coarseness
    }

    /// Describes the choice in a few words.
    pub fn name(&self) -> String {
        let mut name = self.mode.clone();
        if self.of_grid {
            name += ", fitted for the grid";
        }
        if self.step != 1.0 {
            name += &format!(", steps × {}", self.step);
        }
        if self.resolution != 1.0 {
            name += &format!(", edges × {}", self.resolution);
        }
        if self.splats != 1.0 {
            name += &format!(", {} % of the splats", (100.0 * self.splats).round());
        }
        if self.packed {
            name += ", packed";
        }
        name
    }
}

/// Returns all choices, each once.
pub fn choices() -> Vec<Choice> {
    let mut all: Vec<Choice> = ["exact", "slab", "decoded", "alpha"].map(Choice::usual).into();
    all.push(Choice::of_grid());
    for step in [0.5, 1.5, 2.0, 3.0] {
        all.push(Choice { step, ..Choice::usual("slab") });
    }
    for mode in ["slab", "alpha"] {
        let usual = Choice::usual(mode);
        all.push(Choice { packed: true, ..usual.clone() });
        all.extend([0.7, 0.5, 0.35].map(|resolution| Choice { resolution, ..usual.clone() }));
    }
    all.extend([0.6, 0.3, 0.15].map(|splats| Choice { splats, ..Choice::usual("slab") }));
    for (step, resolution) in [(1.5, 0.85), (2.0, 0.7), (2.0, 0.5), (3.0, 0.5), (3.0, 0.35)] {
        all.push(Choice { step, resolution, ..Choice::usual("slab") });
    }
    for usual in [Choice::usual("decoded"), Choice::of_grid()] {
        for (step, resolution) in [
            (0.25, 1.0),
            (0.375, 1.0),
            (0.375, 0.7),
            (0.5, 1.0),
            (0.5, 0.7),
            (0.5, 0.5),
            (0.5, 0.35),
            (1.0, 0.7),
            (1.0, 0.5),
            (1.0, 0.35),
            (2.0, 0.35),
        ] {
            all.push(Choice { step, resolution, ..usual.clone() });
        }
    }
    // The current quality levels are measured, too, so that they can be compared with what they should be.
    for kind in SplatKind::ALL {
        all.extend(quality_levels(kind).iter().map(|level| Choice::of_level(kind, level)));
    }
    let mut once: Vec<Choice> = Vec::new();
    for choice in all {
        if !once.contains(&choice) {
            once.push(choice);
        }
    }
    once
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_knob_is_turned_alone_and_all_quality_levels_are_there() {
        let all = choices();
        let usual = Choice::usual("slab");
        let names: std::collections::BTreeSet<String> = all.iter().map(Choice::name).collect();
        assert_eq!(names.len(), all.len(), "a name is one choice");
        for alone in [
            |c: &Choice, u: &Choice| c.step != u.step && *c == Choice { step: c.step, ..u.clone() },
            |c: &Choice, u: &Choice| {
                c.resolution != u.resolution && *c == Choice { resolution: c.resolution, ..u.clone() }
            },
            |c: &Choice, u: &Choice| c.splats != u.splats && *c == Choice { splats: c.splats, ..u.clone() },
            |c: &Choice, u: &Choice| c.packed && *c == Choice { packed: true, ..u.clone() },
        ] {
            assert!(all.iter().any(|c| alone(c, &usual)));
        }
        for kind in SplatKind::ALL {
            for level in quality_levels(kind) {
                let choice = Choice::of_level(kind, level);
                // Looks are measured without ambient occlusion.
                let given_up = Quality { occlusion: choice.quality().occlusion, ..level.quality };
                assert!(choice.can_be_level() && choice.quality() == given_up && all.contains(&choice));
            }
        }
    }
}
