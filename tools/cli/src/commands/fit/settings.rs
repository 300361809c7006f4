//! The flags of the hyper-parameters of a fit, which come from five places: a profile, a quality, a file, the
//! environment, flags; later ones win.
//!
//! Keys, flags, types and defaults all come from [`FitConfig`]; a new field there becomes a flag here without
//! further code.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use clap::{Arg, ArgMatches, Args, Command, FromArgMatches};
use engine::fit::{DEFAULT_QUALITY, FitConfig, PROFILES, QUALITIES, Settings};
use engine::{Error, Kind, Result};
use serde_json::Value;

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

impl SettingsArguments {
    /// Merges the values of all places; see [`Settings::new`].
    pub fn resolve(&self, limited: bool) -> Result<Settings> {
        let mut values = match &self.config {
            Some(path) => read_file(path)?,
            None => Vec::new(),
        };
        let defaults = Settings::values(&FitConfig::default());
        for (&key, text) in &self.given {
            let value = parse(text, &defaults[key]).ok_or_else(|| {
                Settings::wrong_value(&format!("--{}", flag_of(key)), &format!("{text:?} cannot be parsed"))
            })?;
            values.push((key.to_owned(), value));
        }
        Settings::new(&self.profile, self.quality.as_deref(), &values, limited)
    }
}

fn flag_of(key: &str) -> String {
    key.replace('_', "-")
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
        .map(|(key, value)| {
            let value = serde_json::to_value(value).map_err(|e| bad(format!("{key}: {e}")))?;
            Settings::check(&key, &value).map_err(|e| e.file(path))?;
            Ok((key, value))
        })
        .collect()
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
        let defaults = Settings::values(&FitConfig::default());
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
        let short = format!("Quality preset: {} [default: {DEFAULT_QUALITY}]", named.join(", "));
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
        assert_eq!((c.iterations, c.rates.mean, c.region.hu_range), (7, 1.0, [-1024.0, 3071.5]));
        assert_eq!((c.kernel.name(), c.adam.epsilon), ("gaussian", 1e-12));
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
}
