//! Resolves the hyper-parameters of a fit from five places: a profile, a quality, a file, the environment,
//! flags; later ones win.
//!
//! Keys, flags, types and defaults all come from [`FitConfig`]; a new field there becomes a flag here without
//! further code.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use clap::{Arg, ArgMatches, Args, Command, FromArgMatches};
use engine::fit::{DEFAULT_QUALITY, FitConfig, PROFILES, Profile, QUALITIES, QualityPreset};
use engine::{Error, Kind, Result, names};
use serde_json::{Map, Value};

use crate::shared::texts::text_of;

/// The flags: a profile, a quality, a file, and one for every field of [`FitConfig`].
#[derive(Clone, Debug)]
pub struct SettingsArguments {
    profile: String,
    quality: Option<String>,
    config: Option<PathBuf>,
    /// Values as text by key, of the flags and variables that were given.
    given: BTreeMap<&'static str, String>,
}

/// Resolved hyper-parameters.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Values.
    pub config: FitConfig,
    /// Name of the profile they start from.
    pub profile: String,
    /// Name of the quality, if there is one.
    pub quality: Option<String>,
    /// Keys that were set by a file, a variable or a flag.
    pub explicit: Vec<String>,
}

/// Keys that say how many splats there are.
const NUMBERS: [&str; 2] = ["splats", "density"];
/// Keys that say what error is to be reached.
const TARGETS: [&str; 2] = ["target_psnr", "target_hu"];

impl SettingsArguments {
    /// Merges the values of all places and checks the result. Where nothing has to do with the cost of the fit,
    /// neither among them nor beside them (`limited`), the default quality counts. A number of splats replaces the
    /// target of a quality.
    pub fn resolve(&self, limited: bool) -> Result<Settings> {
        let asked = self.merged(self.quality.as_deref())?;
        let costs = NUMBERS.iter().chain(&TARGETS).chain(&["iterations"]);
        let silent = self.quality.is_none()
            && self.profile == PROFILES[0].name
            && !limited
            && !costs.into_iter().any(|key| asked.is_explicit(key));
        if !silent {
            return Ok(asked);
        }
        // Settings that no target goes with need no quality.
        Ok(self.merged(Some(DEFAULT_QUALITY)).unwrap_or(asked))
    }

    /// Merges the values of all places with a quality.
    fn merged(&self, quality: Option<&str>) -> Result<Settings> {
        let profile = Profile::named(&self.profile)?.config()?;
        let mut values = values_of(&match quality {
            Some(name) => QualityPreset::named(name)?.of(&profile)?,
            None => profile,
        });
        let mut explicit = Vec::new();
        if let Some(path) = &self.config {
            for (key, value) in read_file(path)? {
                set(&mut values, &key, value).map_err(|e| e.file(path))?;
                explicit.push(key);
            }
        }
        for (&key, text) in &self.given {
            let flag = flag_of(key);
            let value = parse(text, &values[key])
                .ok_or_else(|| wrong_value(&format!("--{flag}"), &format!("{text:?} cannot be read")))?;
            set(&mut values, key, value)?;
            explicit.push(key.to_owned());
        }
        let mut config: FitConfig = serde_json::from_value(Value::Object(values))
            .map_err(|e| wrong_value("the configuration", &e.to_string()))?;
        let is_given = |keys: [&str; 2]| explicit.iter().any(|key| keys.contains(&key.as_str()));
        if is_given(NUMBERS) && !is_given(TARGETS) {
            config = config.without_goal();
        }
        if is_given(TARGETS) && !explicit.iter().any(|key| key == "target_rounds") {
            // What somebody asks for is to be reached, not only to be aimed at.
            config.target_rounds = FitConfig::default().target_rounds;
        }
        config.check()?;
        let quality = quality.map(str::to_owned);
        Ok(Settings { config, profile: self.profile.clone(), quality, explicit })
    }
}

impl Settings {
    /// Returns true if a file, a variable or a flag has set this key.
    pub fn is_explicit(&self, key: &str) -> bool {
        self.explicit.iter().any(|k| k == key)
    }

    /// Returns the settings for a volume: the target of a quality is in HU, so where there are none a multiple of the
    /// profile's density counts instead.
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

fn flag_of(key: &str) -> String {
    key.replace('_', "-")
}

/// Returns the fields as JSON. They go through text, so that 0.1 as f32 stays 0.1.
fn values_of(config: &FitConfig) -> Map<String, Value> {
    let text = serde_json::to_string(config).unwrap_or_default();
    serde_json::from_str(&text).unwrap_or_default()
}

/// Replaces the value of `key`; an error if the key is unknown or `value` has another type.
fn set(values: &mut Map<String, Value>, key: &str, value: Value) -> Result<()> {
    if !values.contains_key(key) {
        let message = format!("unknown key {key:?}");
        let error = Error::new(Kind::Usage, "VGS-CFG-011", message);
        return Err(match nearest(key) {
            Some(near) => error.help(format!("did you mean {near:?}?")),
            None => error.help("`vgs fit --help` lists them as flags, with `-` for `_`"),
        });
    }
    let alone = Map::from_iter([(key.to_owned(), value.clone())]);
    serde_json::from_value::<FitConfig>(Value::Object(alone))
        .map_err(|e| wrong_value(key, &e.to_string()))?;
    values.insert(key.to_owned(), value);
    Ok(())
}

fn wrong_value(what: &str, why: &str) -> Error {
    Error::new(Kind::Usage, "VGS-CFG-012", format!("{what}: {why}"))
        .help("`vgs fit --help` says what each one means")
}

/// Parses a flag's text as a value of the same type as `like`.
fn parse(text: &str, like: &Value) -> Option<Value> {
    let text = text.trim();
    match like {
        Value::String(_) => Some(Value::String(text.to_owned())),
        Value::Bool(_) => text.parse().ok().map(Value::Bool),
        Value::Array(_) => {
            text.split(',').map(|part| number(part.trim())).collect::<Option<_>>().map(Value::Array)
        }
        _ => number(text),
    }
}

fn number(text: &str) -> Option<Value> {
    if let Ok(n) = text.parse::<u64>() {
        return Some(Value::from(n));
    }
    text.parse::<f64>().ok().and_then(serde_json::Number::from_f64).map(Value::Number)
}

/// Reads keys and values of a TOML file.
fn read_file(path: &Path) -> Result<Vec<(String, Value)>> {
    let bad = |why: String| Error::new(Kind::Usage, "VGS-CFG-013", why).file(path);
    let text = text_of(path).map_err(|e| match e.kind() {
        ErrorKind::InvalidData => bad(format!("no configuration: {e}")),
        _ => Error::io(path, "reading the configuration", &e),
    })?;
    let table: toml::Table = text.parse().map_err(|e: toml::de::Error| {
        let place = e.span().map(|s| text[..s.start.min(text.len())].lines().count().max(1));
        let line = place.map(|n| format!("line {n}: ")).unwrap_or_default();
        bad(format!("not valid TOML: {line}{}", e.message())).help("write lines such as: iterations = 600")
    })?;
    table
        .into_iter()
        .map(|(key, value)| match serde_json::to_value(value) {
            Ok(value) => Ok((key, value)),
            Err(e) => Err(bad(format!("{key}: {e}"))),
        })
        .collect()
}

/// Returns the key that the user probably meant.
fn nearest(key: &str) -> Option<&'static str> {
    names::nearest(&key.replace('-', "_"), FitConfig::FIELDS.iter().map(|field| field.key))
}

impl FromArgMatches for SettingsArguments {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        let given = FitConfig::FIELDS
            .iter()
            .filter_map(|field| matches.get_one::<String>(field.key).map(|text| (field.key, text.clone())));
        Ok(SettingsArguments {
            profile: matches.get_one::<String>("profile").cloned().unwrap_or_default(),
            quality: matches.get_one::<String>("quality").cloned(),
            config: matches.get_one::<PathBuf>("config").cloned(),
            given: given.collect(),
        })
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

impl Args for SettingsArguments {
    fn augment_args(command: Command) -> Command {
        let defaults = values_of(&FitConfig::default());
        let profiles = PROFILES.iter().map(|row| format!("{} ({})", row.name, row.about));
        let profile = Arg::new("profile")
            .long("profile")
            .value_name("NAME")
            .default_value(PROFILES[0].name)
            .env("VGS_PROFILE")
            .hide_env(true)
            .help(format!("Hyper-parameters to start from: {}", profiles.collect::<Vec<_>>().join("; ")));
        let qualities = QUALITIES.iter().map(|row| format!("{} ({})", row.name, row.about));
        let named: Vec<_> = QUALITIES.iter().map(|row| row.name).collect();
        let short = format!("Error against cost: {} [default: {DEFAULT_QUALITY}]", named.join(", "));
        let quality = Arg::new("quality")
            .long("quality")
            .value_name("NAME")
            .env("VGS_QUALITY")
            .hide_env(true)
            .help(short.clone())
            .long_help(format!(
                "{short}: {}. The default counts where neither a profile nor a number of splats or iterations, an error, a \
                 size or a time is given",
                qualities.collect::<Vec<_>>().join("; ")
            ));
        let config = Arg::new("config")
            .long("config")
            .value_name("FILE.toml")
            .value_parser(clap::value_parser!(PathBuf))
            .env("VGS_CONFIG")
            .hide_env(true)
            .help("Hyper-parameters from a file: the names below with _ for -, as in: rate_mean = 0.1");
        let fields = FitConfig::FIELDS.iter().map(|field| {
            let default = &defaults[field.key];
            let several = default.is_array();
            let (name, shown) = match default {
                Value::String(text) => ("NAME", text.clone()),
                Value::Array(parts) => {
                    ("LOW,HIGH", parts.iter().map(ToString::to_string).collect::<Vec<_>>().join(","))
                }
                Value::Bool(yes) => ("true|false", yes.to_string()),
                other => ("N", other.to_string()),
            };
            Arg::new(field.key)
                .long(flag_of(field.key))
                .value_name(name)
                .env(format!("VGS_{}", field.key.to_uppercase()))
                .hide_env(true)
                .allow_hyphen_values(several)
                .allow_negative_numbers(!several)
                .help_heading("Hyper-parameters")
                .help(format!("{} [default: {shown}]", field.doc.trim().trim_end_matches('.')))
        });
        command.next_help_heading("Settings").arg(profile).arg(quality).arg(config).args(fields)
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn resolve(given: &[(&'static str, &str)]) -> Result<Settings> {
        let given = given.iter().map(|&(k, v)| (k, v.to_owned())).collect();
        SettingsArguments { profile: "default".into(), quality: None, config: None, given }.resolve(false)
    }

    #[test]
    fn nothing_given_is_the_default_quality_and_a_word_about_the_cost_is_the_profile() {
        let silent = resolve(&[("seed", "3")]).unwrap();
        let standard = QualityPreset::named(DEFAULT_QUALITY).unwrap().of(&FitConfig::default()).unwrap();
        assert_eq!(silent.config, FitConfig { seed: 3, ..standard.clone() });
        assert_eq!((silent.quality.as_deref(), silent.config.has_goal()), (Some(DEFAULT_QUALITY), true));
        let of_mr = silent.clone().for_volume(false).config;
        assert_eq!((of_mr.has_goal(), of_mr.density, of_mr.iterations), (false, 0.1, standard.iterations));
        assert_eq!(silent.clone().for_volume(true).config, silent.config);
        for (key, value) in [
            ("splats", "7"),
            ("density", "0.2"),
            ("iterations", "9"),
            ("working_grid", "2"),
            ("topology", "growth"),
        ] {
            let settings = resolve(&[(key, value)]).unwrap();
            assert!(!settings.config.has_goal() && settings.quality.is_none(), "{key}");
            assert_eq!(settings.config.storage, FitConfig::default().storage, "{key}");
        }
        let arguments =
            |given: &[(&'static str, &str)], profile: &str, quality: Option<&str>| SettingsArguments {
                profile: profile.into(),
                quality: quality.map(str::to_owned),
                config: None,
                given: given.iter().map(|&(k, v)| (k, v.to_owned())).collect(),
            };
        let limited = arguments(&[], "default", None).resolve(true).unwrap();
        assert_eq!((limited.config, limited.quality), (FitConfig::default(), None), "by time or by bytes");
        assert!(
            !arguments(&[], "bones", None).resolve(false).unwrap().config.has_goal(),
            "a profile's own density"
        );
    }

    #[test]
    fn what_is_asked_for_replaces_the_target_of_a_quality() {
        let fine = |given: &[(&'static str, &str)]| {
            let given = given.iter().map(|&(k, v)| (k, v.to_owned())).collect();
            SettingsArguments { profile: "default".into(), quality: Some("fine".into()), config: None, given }
                .resolve(false)
                .unwrap()
                .config
        };
        assert_eq!((fine(&[]).target_hu, fine(&[]).target_rounds), (15.0, 0));
        let number = fine(&[("density", "0.3")]);
        assert_eq!(
            (number.has_goal(), number.density, number.iterations),
            (false, 0.3, fine(&[]).iterations)
        );
        let target = fine(&[("target_hu", "12")]);
        assert_eq!((target.target_hu, target.target_rounds), (12.0, 5), "to be reached, not only aimed at");
        assert_eq!(fine(&[("target_hu", "12"), ("target_rounds", "1")]).target_rounds, 1);
    }

    #[test]
    fn a_quality_changes_a_profile_and_a_flag_changes_both() {
        let resolve = |profile: &str, quality: &str, given: &[(&'static str, &str)]| {
            let given = given.iter().map(|&(k, v)| (k, v.to_owned())).collect();
            let quality = Some(quality.to_owned());
            SettingsArguments { profile: profile.into(), quality, config: None, given }.resolve(false)
        };
        let bones = Profile::named("bones").unwrap().config().unwrap();
        let fine = resolve("bones", "fine", &[]).unwrap();
        assert_eq!(fine.config, QualityPreset::named("fine").unwrap().of(&bones).unwrap());
        assert_ne!(fine.config, bones);
        assert!(fine.plain_quality().is_none(), "measured with the default profile alone");
        assert_eq!(resolve("default", "fine", &[]).unwrap().plain_quality().unwrap().name, "fine");
        let flagged = resolve("default", "fine", &[("iterations", "7")]).unwrap();
        assert_eq!(
            (flagged.config.iterations, flagged.config.density),
            (7, { QualityPreset::named("fine").unwrap().of(&FitConfig::default()).unwrap().density })
        );
        assert!(flagged.plain_quality().is_none());
        assert!(resolve("default", "best", &[]).is_err_and(|e| e.help.contains("preview")));
    }

    #[test]
    fn flags_of_every_type() {
        let settings = resolve(&[
            ("iterations", "7"),
            ("rate_mean", "1"),
            ("hu_range", "-1024, 3071.5"),
            ("kernel", "gaussian"),
            ("adam_epsilon", "1e-12"),
        ])
        .unwrap();
        let c = &settings.config;
        assert_eq!((c.iterations, c.rate_mean, c.hu_range), (7, 1.0, [-1024.0, 3071.5]));
        assert_eq!((c.kernel.name(), c.adam_epsilon), ("gaussian", 1e-12));
        assert!(settings.is_explicit("kernel") && !settings.is_explicit("seed"));
    }

    #[test]
    fn wrong_values_name_the_key() {
        for (key, text) in [
            ("iterations", "1.5"),
            ("iterations", "-1"),
            ("iterations", "1e12"),
            ("iterations", "0"),
            ("rate_mean", "fast"),
            ("rate_mean", "-0.1"),
            ("rate_mean", "NaN"),
            ("hu_range", "1,2,3"),
            ("hu_range", "5"),
            ("kernel", "box"),
        ] {
            let error = resolve(&[(key, text)]).expect_err(text);
            assert_eq!(error.kind, Kind::Usage, "{key} {text}");
            let said = format!("{} {}", error.message, error.help).replace('-', "_");
            assert!(said.contains(key), "{key} {text}: {said}");
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
        }
    }
}
