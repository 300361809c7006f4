//! The quality levels: what is given up to render faster, least missed first.

use std::sync::LazyLock;

use serde::Deserialize;

use super::modes::mode;
use super::quality::Quality;
#[cfg(doc)]
use super::settings::Settings;
use super::splat_kind::SplatKind;
use crate::budget;

/// A quality level: a way to render, and what it costs.
#[derive(Clone, Copy, Debug)]
pub struct QualityLevel {
    /// Name of the render mode.
    pub mode: &'static str,
    /// Quality within the mode, for a [`Settings::step`] of 1.
    pub quality: Quality,
    /// Time of a frame relative to the first level; measured by `studies trade render`.
    pub cost: f64,
}

impl SplatKind {
    /// Returns the mode of the best quality level.
    pub fn usual_mode(self) -> &'static str {
        quality_levels(self)[0].mode
    }

    /// Returns the only mode that shows such splats as they are meant; `None` if every mode does.
    pub fn own_mode(self) -> Option<&'static str> {
        (self != SplatKind::Field).then(|| self.usual_mode())
    }
}

/// Returns the quality levels for such splats, the best first: those on the front of PSNR against cost that
/// `studies trade render --levels` measures. No level leaves out a splat: what a transfer function shows is
/// there on all of them, in a coarser picture. The first one alone has ambient occlusion. `quality_levels.toml`
/// says on what they were measured.
pub fn quality_levels(kind: SplatKind) -> &'static [QualityLevel] {
    match kind {
        SplatKind::Field => &ALL_LEVELS.field,
        SplatKind::Grid => &ALL_LEVELS.grid,
        SplatKind::Coloured => &ALL_LEVELS.coloured,
    }
}

/// The quality levels that are built in.
///
/// # Panics
/// If `quality_levels.toml` is not in order; a test prevents that.
static ALL_LEVELS: LazyLock<LevelLists> = LazyLock::new(|| {
    let file: File =
        toml::from_str(include_str!("quality_levels.toml")).expect("quality_levels.toml is of this form");
    let all = |rows: &[LevelRow]| rows.iter().enumerate().map(|(i, row)| row.level(i == 0)).collect();
    LevelLists { field: all(&file.field), grid: all(&file.grid), coloured: all(&file.coloured) }
});

struct LevelLists {
    field: Vec<QualityLevel>,
    grid: Vec<QualityLevel>,
    coloured: Vec<QualityLevel>,
}

/// Contents of `quality_levels.toml`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    field: Vec<LevelRow>,
    grid: Vec<LevelRow>,
    coloured: Vec<LevelRow>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LevelRow {
    mode: String,
    resolution: f64,
    coarseness: f64,
    cost: f64,
    /// PSNR, for readers of the file only.
    #[serde(rename = "psnr")]
    _psnr: f64,
}

impl LevelRow {
    fn level(&self, occlusion: bool) -> QualityLevel {
        QualityLevel {
            mode: mode(&self.mode).expect("quality_levels.toml names modes that there are").name,
            quality: Quality { resolution: self.resolution, coarseness: self.coarseness, occlusion },
            cost: self.cost,
        }
    }
}

/// Returns the costs of quality levels, for a controller.
pub fn level_costs(levels: &[QualityLevel]) -> budget::LevelCosts {
    budget::LevelCosts::new(levels.iter().map(|r| r.cost))
}

#[cfg(test)]
mod tests {
    use super::*;
    use splat::Harmonics;
    use splat::{Form, SplatSet};

    #[test]
    fn levels_of_every_kind_begin_with_all_and_go_down() {
        for (kind, first, coarseness) in [
            (SplatKind::Field, "decoded", 0.25),
            (SplatKind::Grid, "decoded", 0.25),
            (SplatKind::Coloured, "alpha", 1.0),
        ] {
            let levels = quality_levels(kind);
            let quality = Quality { coarseness, ..Quality::FULL };
            assert_eq!((levels[0].mode, levels[0].quality, levels[0].cost), (first, quality, 1.0));
            // Refuses costs that do not fall.
            assert_eq!(level_costs(levels).len(), levels.len());
            assert!(levels.len() > 1, "{kind:?}");
            let occluded = levels.iter().filter(|level| level.quality.occlusion).count();
            assert_eq!(occluded, 1, "{kind:?}: only the first level pays for ambient occlusion");
        }
    }

    #[test]
    fn a_set_is_of_the_kind_that_its_file_says() {
        let mut set = SplatSet::default();
        assert_eq!(SplatKind::of(&set), SplatKind::Field);
        set.form = Form::Grid;
        assert_eq!(SplatKind::of(&set), SplatKind::Grid);
        set.colours = Some(Harmonics { degree: 0, coefficients: Vec::new() });
        assert_eq!(SplatKind::of(&set), SplatKind::Coloured);
    }
}
