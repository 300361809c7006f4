//! What a fit is told by names: a profile, a quality, and values of single hyper-parameters; later ones win.
//!
//! Keys, types and defaults all come from [`FitConfig`]: a new field there is a new key here without further code.

use serde_json::{Map, Value};

use super::{DEFAULT_QUALITY, FitConfig, PROFILES, Profile, QualityPreset};
use base::error::{Error, Kind, Result};
use base::names;

/// Keys that say how many splats there are.
const NUMBERS: [&str; 2] = ["splats", "density"];
/// Keys that say what error is to be reached.
const TARGETS: [&str; 2] = ["target_psnr", "target_hu"];

/// What a fit may miss of an error that it only aims at without a word, dB: half as much again.
const AIM_DB: f64 = 3.5;

/// Resolved hyper-parameters.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Values.
    pub config: FitConfig,
    /// Name of the profile they start from.
    pub profile: String,
    /// Name of the quality, if there is one.
    pub quality: Option<String>,
    /// Keys that were set one by one.
    pub explicit: Vec<String>,
}

impl Settings {
    /// Merges a profile, a quality and values by key, and checks the result. Where nothing has to do with the cost of
    /// the fit, neither among these nor beside them (`limited`, by bytes or time), [`DEFAULT_QUALITY`] counts. A number
    /// of splats replaces the target of a quality.
    ///
    /// # Errors
    /// Fails for names that are unknown, values of another type, and a configuration that cannot work.
    pub fn new(
        profile: &str,
        quality: Option<&str>,
        values: &[(String, Value)],
        limited: bool,
    ) -> Result<Self> {
        let asked = Settings::merged(profile, quality, values)?;
        let costs = NUMBERS.iter().chain(&TARGETS).chain(&["iterations"]);
        let silent = quality.is_none()
            && profile == PROFILES[0].name
            && !limited
            && !costs.into_iter().any(|key| asked.is_explicit(key));
        if !silent {
            return Ok(asked);
        }
        // Settings that no target goes with need no quality.
        Ok(Settings::merged(profile, Some(DEFAULT_QUALITY), values).unwrap_or(asked))
    }

    fn merged(profile: &str, quality: Option<&str>, values: &[(String, Value)]) -> Result<Self> {
        let of_profile = Profile::named(profile)?.config()?;
        let mut merged = Settings::values(&match quality {
            Some(name) => QualityPreset::named(name)?.of(&of_profile)?,
            None => of_profile,
        });
        let mut explicit = Vec::new();
        for (key, value) in values {
            Settings::check(key, value)?;
            merged.insert(key.clone(), value.clone());
            explicit.push(key.clone());
        }
        let mut config: FitConfig = serde_json::from_value(Value::Object(merged))
            .map_err(|e| Settings::wrong_value("the configuration", &e.to_string()))?;
        let is_given = |keys: [&str; 2]| explicit.iter().any(|key| keys.contains(&key.as_str()));
        if is_given(NUMBERS) && !is_given(TARGETS) {
            config = config.without_goal();
        }
        if is_given(TARGETS) && !explicit.iter().any(|key| key == "target_rounds") {
            // What somebody asks for is to be reached, not only to be aimed at.
            config.count.target_rounds = FitConfig::default().count.target_rounds;
        }
        if let Some(number) = NUMBERS.iter().find(|number| explicit.iter().any(|key| key == *number))
            && config.has_goal()
        {
            let message = format!("{number} and a target both say how many splats there are");
            return Err(Error::new(Kind::Usage, "VGS-CFG-017", message)
                .help("leave one out; --max-splats limits what a target takes"));
        }
        config.check()?;
        let quality = quality.map(str::to_owned);
        Ok(Settings { config, profile: profile.to_owned(), quality, explicit })
    }

    /// Returns the values of a configuration by key. They go through text, so that 0.1 as f32 stays 0.1.
    pub fn values(config: &FitConfig) -> Map<String, Value> {
        let text = serde_json::to_string(config).unwrap_or_default();
        serde_json::from_str(&text).unwrap_or_default()
    }

    /// Fails if there is no such key, or if the value has another type.
    ///
    /// # Errors
    /// [`Kind::Usage`], with the key that was probably meant.
    pub fn check(key: &str, value: &Value) -> Result<()> {
        if !FitConfig::FIELDS.iter().any(|field| field.key == key) {
            let error = Error::new(Kind::Usage, "VGS-CFG-011", format!("unknown key {key:?}"));
            return Err(match nearest(key) {
                Some(near) => error.help(format!("did you mean {near:?}?")),
                None => error.help("`vgs fit --help` lists them as flags, with `-` for `_`"),
            });
        }
        let alone = Map::from_iter([(key.to_owned(), value.clone())]);
        serde_json::from_value::<FitConfig>(Value::Object(alone))
            .map(|_| ())
            .map_err(|e| Settings::wrong_value(key, &e.to_string()))
    }

    /// Returns the error of a value that cannot be taken.
    pub fn wrong_value(what: &str, why: &str) -> Error {
        Error::new(Kind::Usage, "VGS-CFG-012", format!("{what}: {why}"))
            .help("`vgs fit --help` says what each one means")
    }

    /// Returns true if this key was set.
    pub fn is_explicit(&self, key: &str) -> bool {
        self.explicit.iter().any(|k| k == key)
    }

    /// Returns true if an error or a number of splats was set: a limit of bytes then only limits.
    pub fn says_how_many(&self) -> bool {
        self.config.has_goal() || NUMBERS.iter().any(|key| self.is_explicit(key))
    }

    /// Returns true if the error to reach is only aimed at: trials find the number of splats, and that is final.
    pub fn is_aim(&self) -> bool {
        self.config.count.target_rounds == 0
    }

    /// Returns by how much the error to reach is missed, dB, if that is worth a word: `surplus_db` is how much better
    /// than that a finished fit is ([`Goal::surplus_db`](super::Goal::surplus_db)).
    pub fn missed_db(&self, surplus_db: f64) -> Option<f64> {
        let allowed = if self.is_aim() { AIM_DB } else { 0.0 };
        (surplus_db < -allowed).then_some(-surplus_db)
    }

    /// Returns the settings for a volume: the target of a quality is in HU, so where there are none a multiple of the
    /// profile's density counts instead.
    #[must_use]
    pub fn for_volume(self, is_ct: bool) -> Settings {
        if is_ct || TARGETS.iter().any(|key| self.is_explicit(key)) {
            return self;
        }
        Settings { config: self.config.without_goal(), ..self }
    }

    /// Returns the quality if it was chosen with the default profile and nothing else was changed: its errors
    /// are measured only for that.
    pub fn plain_quality(&self) -> Option<&'static QualityPreset> {
        let measured = self.explicit.is_empty() && self.profile == PROFILES[0].name;
        self.quality.as_deref().filter(|_| measured).and_then(|name| QualityPreset::named(name).ok())
    }
}

/// Returns the key that the user probably meant.
fn nearest(key: &str) -> Option<&'static str> {
    names::nearest(&key.replace('-', "_"), FitConfig::FIELDS.iter().map(|field| field.key))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn settings(
        profile: &str,
        quality: Option<&str>,
        given: &[(&str, Value)],
        limited: bool,
    ) -> Result<Settings> {
        let given: Vec<_> = given.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect();
        Settings::new(profile, quality, &given, limited)
    }

    fn resolve(given: &[(&str, Value)]) -> Result<Settings> {
        settings("default", None, given, false)
    }

    #[test]
    fn nothing_given_is_the_default_quality_and_a_word_about_the_cost_is_the_profile() {
        let silent = resolve(&[("seed", json!(3))]).unwrap();
        let standard = QualityPreset::named(DEFAULT_QUALITY).unwrap().of(&FitConfig::default()).unwrap();
        assert_eq!(silent.config, FitConfig { seed: 3, ..standard.clone() });
        assert_eq!((silent.quality.as_deref(), silent.config.has_goal()), (Some(DEFAULT_QUALITY), true));
        let of_mr = silent.clone().for_volume(false).config;
        assert_eq!(
            (of_mr.has_goal(), of_mr.count.density, of_mr.iterations),
            (false, 0.1, standard.iterations)
        );
        assert_eq!(silent.clone().for_volume(true).config, silent.config);
        for (key, value) in [
            ("splats", json!(7)),
            ("density", json!(0.2)),
            ("iterations", json!(9)),
            ("working_grid", json!(2)),
            ("topology", json!("growth")),
        ] {
            let settings = resolve(&[(key, value)]).unwrap();
            assert!(!settings.config.has_goal() && settings.quality.is_none(), "{key}");
            assert_eq!(settings.config.storage, FitConfig::default().storage, "{key}");
        }
        let limited = settings("default", None, &[], true).unwrap();
        assert_eq!((limited.config, limited.quality), (FitConfig::default(), None), "by time or by bytes");
        let bones = settings("bones", None, &[], false).unwrap();
        assert!(!bones.config.has_goal(), "a profile's own density");
    }

    #[test]
    fn what_is_asked_for_replaces_the_target_of_a_quality() {
        let fine = |given: &[(&str, Value)]| settings("default", Some("fine"), given, false).unwrap().config;
        assert_eq!((fine(&[]).count.target_hu, fine(&[]).count.target_rounds), (15.0, 0));
        let number = fine(&[("density", json!(0.3))]);
        assert_eq!(
            (number.has_goal(), number.count.density, number.iterations),
            (false, 0.3, fine(&[]).iterations)
        );
        let target = fine(&[("target_hu", json!(12))]);
        assert_eq!(
            (target.count.target_hu, target.count.target_rounds),
            (12.0, 5),
            "to be reached, not only aimed at"
        );
        assert_eq!(fine(&[("target_hu", json!(12)), ("target_rounds", json!(1))]).count.target_rounds, 1);
    }

    #[test]
    fn two_answers_to_one_question_are_refused() {
        for number in ["splats", "density"] {
            let error = resolve(&[(number, json!(10)), ("target_hu", json!(50))]).expect_err("both");
            assert!(error.code == "VGS-CFG-017" && error.message.contains(number), "{error}");
        }
    }

    #[test]
    fn what_is_aimed_at_may_be_missed_by_a_little() {
        let of = |given: &[(&str, Value)]| resolve(given).unwrap();
        let (aim, goal) = (of(&[]), of(&[("target_hu", json!(30))]));
        assert_eq!((aim.missed_db(-3.0), aim.missed_db(-4.0)), (None, Some(4.0)));
        assert_eq!((goal.missed_db(0.0), goal.missed_db(-0.5)), (None, Some(0.5)));
    }

    #[test]
    fn a_quality_changes_a_profile_and_a_value_changes_both() {
        let bones = Profile::named("bones").unwrap().config().unwrap();
        let fine = settings("bones", Some("fine"), &[], false).unwrap();
        assert_eq!(fine.config, QualityPreset::named("fine").unwrap().of(&bones).unwrap());
        assert_ne!(fine.config, bones);
        assert!(fine.plain_quality().is_none(), "measured with the default profile alone");
        let plain = settings("default", Some("fine"), &[], false).unwrap();
        assert_eq!(plain.plain_quality().unwrap().name, "fine");
        let changed = settings("default", Some("fine"), &[("iterations", json!(7))], false).unwrap();
        let density = QualityPreset::named("fine").unwrap().of(&FitConfig::default()).unwrap().count.density;
        assert_eq!((changed.config.iterations, changed.config.count.density), (7, density));
        assert!(changed.plain_quality().is_none());
        assert!(settings("default", Some("best"), &[], false).is_err_and(|e| e.help.contains("preview")));
    }

    #[test]
    fn wrong_values_name_the_key() {
        for (key, value) in [
            ("iterations", json!(1.5)),
            ("iterations", json!(-1)),
            ("iterations", json!(1e12)),
            ("iterations", json!(0)),
            ("rate_mean", json!("fast")),
            ("rate_mean", json!(-0.1)),
            ("hu_range", json!([1, 2, 3])),
            ("hu_range", json!(5)),
            ("kernel", json!("box")),
            ("init_opacity_mask", json!(1)),
        ] {
            let error = resolve(&[(key, value)]).expect_err(key);
            assert_eq!(error.kind, Kind::Usage, "{key}");
            let said = format!("{} {}", error.message, error.help).replace('-', "_");
            assert!(said.contains(key), "{key}: {said}");
        }
    }

    #[test]
    fn a_near_miss_is_pointed_out() {
        for (typed, meant) in [
            ("iteration", Some("iterations")),
            ("rate-mean", Some("rate_mean")),
            ("Densty", Some("density")),
            ("learning_rate_of_everything", None),
        ] {
            assert_eq!(nearest(typed), meant, "{typed}");
            let error = resolve(&[(typed, json!(1))]).expect_err(typed);
            assert_eq!((error.code, error.help.contains(meant.unwrap_or("--help"))), ("VGS-CFG-011", true));
        }
    }
}
