//! Quality presets: trade-offs between error and cost, as small changes to any profile.
//!
//! Each is a plain TOML file in `qualities/` with keys of [`FitConfig`] that replace those of the profile. All but the
//! first have an error for a target, so that a scene gets the splats that it needs. Where there can be no such target
//! (a fit whose trials say nothing, a volume without HU), `density_times` counts instead, by which the profile's
//! splats per voxel (or its number of splats) are multiplied. `docs/results/tradeoffs.md` lists the cost and the error
//! of each.

use serde::Deserialize;

use super::FitConfig;
use base::error::{Error, Kind, Result};
use base::names;

/// Number of iterations after which the error of a fit predicts its final error:
/// [`QualityPreset::rmse_of_early`].
pub const EARLY: u32 = 16;

/// A quality preset, a row of [`QUALITIES`].
pub struct QualityPreset {
    /// Name on the command line.
    pub name: &'static str,
    /// Purpose, in a few words.
    pub about: &'static str,
    /// Contents of the file.
    pub toml: &'static str,
    /// Ratio of the final root mean square error at the voxels to that after the first [`EARLY`] iterations
    /// where `density_times` counts, for the default profile (`mr` for an MR) at this quality. It is the
    /// geometric mean over the cases of `docs/results/tradeoffs.md`, which says how far they scatter.
    pub rmse_of_early: f64,
    /// The same ratio for the 99th percentile of the error.
    pub p99_of_early: f64,
}

/// Name of the quality of a fit about which nothing is said that has to do with its cost.
pub const DEFAULT_QUALITY: &str = "standard";

/// Every quality, from the cheapest to the best.
pub const QUALITIES: &[QualityPreset] = &[
    QualityPreset {
        name: "preview",
        about: "a first look",
        toml: include_str!("preview.toml"),
        rmse_of_early: 0.710,
        p99_of_early: 0.675,
    },
    QualityPreset {
        name: "standard",
        about: "for a headset: 99 % of the voxels within about 30 HU of the scan",
        toml: include_str!("standard.toml"),
        rmse_of_early: 0.376,
        p99_of_early: 0.368,
    },
    QualityPreset {
        name: "fine",
        about: "for a reading room: within 15 HU",
        toml: include_str!("fine.toml"),
        rmse_of_early: 0.251,
        p99_of_early: 0.321,
    },
    QualityPreset {
        name: "exact",
        about: "for an archive: within 6 HU",
        toml: include_str!("exact.toml"),
        rmse_of_early: 0.081,
        p99_of_early: 0.041,
    },
];

/// Contents of a quality file.
#[derive(Deserialize)]
struct Overlay {
    density_times: f64,
    #[serde(flatten)]
    keys: toml::Table,
}

impl QualityPreset {
    /// Returns the quality called `name`; if there is none, fails with the list of names.
    pub fn named(name: &str) -> Result<&'static QualityPreset> {
        QUALITIES.iter().find(|row| row.name == name).ok_or_else(|| {
            let known: Vec<_> = QUALITIES.iter().map(|row| row.name).collect();
            Error::new(Kind::Usage, "VGS-CFG-015", format!("there is no quality {name:?}")).help(format!(
                "{}qualities: {}",
                names::meant(name, known.iter().copied()),
                known.join(", ")
            ))
        })
    }

    /// Returns the hyper-parameters of `profile` at this quality.
    pub fn of(&self, profile: &FitConfig) -> Result<FitConfig> {
        let broken = |why: String| {
            Error::new(Kind::Internal, "VGS-CFG-016", format!("quality {:?}: {why}", self.name))
        };
        let overlay: Overlay = toml::from_str(self.toml).map_err(|e| broken(e.message().into()))?;
        let mut keys = toml::Table::try_from(profile).map_err(|e| broken(e.to_string()))?;
        keys.extend(overlay.keys);
        let config: FitConfig = keys.try_into().map_err(|e: toml::de::Error| broken(e.message().into()))?;
        let splats = profile.count.splats as f64 * overlay.density_times;
        let config = if config.check().is_ok() { config } else { config.without_goal() };
        Ok(config.with(|c| {
            c.count.density = profile.count.density * overlay.density_times;
            c.count.splats = if profile.count.splats > 0 { (splats.round() as usize).max(1) } else { 0 };
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PROFILES;

    fn preset(toml: &'static str) -> QualityPreset {
        QualityPreset { name: "a", about: "", toml, rmse_of_early: 0.5, p99_of_early: 0.5 }
    }

    #[test]
    fn every_quality_of_every_profile_can_work_and_costs_more_than_the_one_before() {
        for profile in PROFILES {
            let plain = profile.config().expect("a configuration");
            let configs: Vec<FitConfig> = QUALITIES
                .iter()
                .map(|q| q.of(&plain).unwrap_or_else(|e| panic!("{}: {e}", q.name)))
                .collect();
            for config in &configs {
                config.check().unwrap_or_else(|e| panic!("{}: {e}", profile.name));
                assert_eq!(config.init.gradient_exponent, plain.init.gradient_exponent, "the profile's own");
            }
            let work = |c: &FitConfig| c.count.density * f64::from(c.iterations);
            assert!(configs.windows(2).all(|pair| work(&pair[0]) < work(&pair[1])), "{}", profile.name);
            let targets: Vec<f32> = configs.iter().map(|c| c.count.target_hu).collect();
            let slow = plain.rates.mean < FitConfig::default().rates.mean;
            let falling =
                targets[0] == 0.0 && targets[1..].windows(2).all(|pair| pair[0] > pair[1] && pair[1] > 0.0);
            assert!(if slow { targets == [0.0; 4] } else { falling }, "{}: {targets:?}", profile.name);
        }
        let better = |a: &QualityPreset, b: &QualityPreset| {
            a.rmse_of_early > b.rmse_of_early && a.p99_of_early > b.p99_of_early && b.rmse_of_early > 0.0
        };
        assert!(
            QUALITIES.windows(2).all(|pair| better(&pair[0], &pair[1])),
            "each is better than the one before"
        );
    }

    #[test]
    fn a_number_of_splats_grows_like_a_density() {
        let preset = preset("density_times = 2.5\niterations = 7\n");
        let config =
            preset.of(&FitConfig::default().with(|c| c.count.splats = 100)).expect("a configuration");
        assert_eq!((config.count.splats, config.count.density, config.iterations), (250, 0.25, 7));
        let same = config.with(|c| {
            c.count.density = 0.1;
            c.iterations = 300;
            c.count.splats = 0;
        });
        assert_eq!(same, FitConfig::default(), "all else stays what it is, to the bit");
    }

    #[test]
    fn the_default_quality_is_one_of_them() {
        assert!(QualityPreset::named(DEFAULT_QUALITY).is_ok());
    }

    #[test]
    fn a_wrong_name_is_answered_with_the_right_ones() {
        assert!(QualityPreset::named("finest").is_err_and(|e| e.help.contains("fine")));
        let broken = preset("density_times = 1.0\nno_such_key = 1\n");
        assert!(broken.of(&FitConfig::default()).is_err_and(|e| e.message.contains("no_such_key")));
    }
}
