//! Profiles: named sets of hyper-parameters. Each is a plain TOML file in `profiles/` that states only what
//! differs from the default.

use super::FitConfig;
use base::error::{Error, Kind, Result};
use base::names;

/// A named set of hyper-parameters, a row of [`PROFILES`].
pub struct Profile {
    /// Name on the command line.
    pub name: &'static str,
    /// Purpose, in a few words.
    pub about: &'static str,
    /// Contents of the file: keys of [`FitConfig`].
    pub toml: &'static str,
}

/// Every profile; the first is the default.
pub const PROFILES: &[Profile] = &[
    Profile { name: "default", about: "what is shown: right at the voxels, sharp outline", toml: "" },
    Profile {
        name: "vessels",
        about: "contrast-filled vessels: thin and bright",
        toml: include_str!("vessels.toml"),
    },
    Profile { name: "bones", about: "thin shells of high contrast", toml: include_str!("bones.toml") },
    Profile { name: "organs", about: "smooth and large, with few splats", toml: include_str!("organs.toml") },
    Profile { name: "mr", about: "broad tissues, intensities of any scale", toml: include_str!("mr.toml") },
    Profile {
        name: "field",
        about: "a field without a grid: right between the voxels too",
        toml: include_str!("field.toml"),
    },
    Profile { name: "paper", about: "the paper's method to the letter", toml: include_str!("paper.toml") },
    Profile {
        name: "reference",
        about: "the same to the letter of its authors' code",
        toml: include_str!("reference.toml"),
    },
];

impl Profile {
    /// Returns the profile called `name`; if there is none, fails with the list of names.
    pub fn named(name: &str) -> Result<&'static Profile> {
        PROFILES.iter().find(|row| row.name == name).ok_or_else(|| {
            let known: Vec<_> = PROFILES.iter().map(|row| row.name).collect();
            Error::new(Kind::Usage, "VGS-CFG-010", format!("there is no profile {name:?}")).help(format!(
                "{}profiles: {}",
                names::meant(name, known.iter().copied()),
                known.join(", ")
            ))
        })
    }

    /// Returns the hyper-parameters of the profile.
    pub fn config(&self) -> Result<FitConfig> {
        toml::from_str(self.toml).map_err(|e| {
            Error::new(Kind::Internal, "VGS-CFG-014", format!("profile {:?}: {}", self.name, e.message()))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use volume::BetweenSlices;

    #[test]
    fn every_profile_is_a_configuration_that_can_work() {
        assert_eq!(PROFILES[0].config().expect("a configuration"), FitConfig::default());
        for profile in PROFILES {
            let config = profile.config().unwrap_or_else(|e| panic!("{}: {e}", profile.name));
            config.check().unwrap_or_else(|e| panic!("{}: {e}", profile.name));
        }
        for name in ["paper", "reference"] {
            let config = Profile::named(name).and_then(Profile::config).expect("a configuration");
            assert_eq!(
                config.samples.between_slices,
                BetweenSlices::Linear,
                "{name} knows no slices but the scan's"
            );
        }
        assert!(Profile::named("papre").is_err_and(|e| e.help.contains("paper")));
    }
}
