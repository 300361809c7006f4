//! Settings that the viewer keeps from one start to the next.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use engine::error::{Error, Kind, Result};
use serde::{Deserialize, Serialize};

use crate::model::state::{text_of, toml_text};

/// Greatest number of recent files.
const MOST_RECENT: usize = 12;
/// Size of the largest settings file that is read, bytes.
const MAX_BYTES: u64 = 1 << 20;

/// The user's settings.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// True if the notice that this is not for diagnosis was seen.
    pub notice_seen: bool,
    /// True if the card of what buttons do in a headset was seen.
    pub headset_card_seen: bool,
    /// True if the window asks for files by its own dialog although the desktop has one.
    pub own_file_dialog: bool,
    /// Time that the last whole fit of each profile and quality took for a million voxels, seconds.
    pub fit_seconds: BTreeMap<String, f64>,
    /// Files that were opened, the latest first.
    pub recent: Vec<PathBuf>,
    /// Path that the settings are written to; `None` without a home folder.
    #[serde(skip)]
    path: Option<PathBuf>,
}

impl Settings {
    /// Returns the path of a user's settings: `$XDG_CONFIG_HOME/vgs/view.toml`, or below `~/.config`.
    pub fn place() -> Option<PathBuf> {
        let absolute = |name: &str| std::env::var_os(name).map(PathBuf::from).filter(|p| p.is_absolute());
        let folder = absolute("XDG_CONFIG_HOME").or_else(|| Some(absolute("HOME")?.join(".config")))?;
        Some(folder.join("vgs").join("view.toml"))
    }

    /// Reads the settings from a file, which they are written to later. Missing keys have the values of the
    /// first start.
    ///
    /// # Errors
    /// Returns [`Kind::BadData`] if the file is no settings file, [`Kind::Io`] if it cannot be read.
    pub fn read(path: Option<PathBuf>) -> Result<Self> {
        let Some(path) = path else { return Ok(Settings::default()) };
        let text = match text_of(&path, MAX_BYTES) {
            Err(e) if e.kind == Kind::Missing => {
                return Ok(Settings { path: Some(path), ..Settings::default() });
            }
            other => other?,
        };
        let settings: Settings = toml::from_str(&text).map_err(|e| {
            Error::new(Kind::BadData, "VGS-VIEW-004", format!("not the viewer's settings: {e}"))
                .file(&path)
                .help("correct or delete the file")
        })?;
        Ok(Settings { path: Some(path), ..settings })
    }

    /// Puts a file to the front of the recent ones.
    pub fn opened(&mut self, file: &Path) {
        self.recent.retain(|p| p != file);
        self.recent.insert(0, file.to_owned());
        self.recent.truncate(MOST_RECENT);
    }

    /// Returns the time that a fit of so many voxels will take, seconds, if one of this profile and quality has ended
    /// before.
    pub fn seconds_of_fit(&self, profile: &str, quality: &str, voxels: usize) -> Option<f64> {
        let million = self.fit_seconds.get(&format!("{profile} {quality}"))?;
        Some(million * voxels as f64 * 1e-6).filter(|seconds| *seconds >= 0.0 && seconds.is_finite())
    }

    /// Keeps how long a whole fit of so many voxels took, seconds.
    pub fn fit_took(&mut self, profile: &str, quality: &str, voxels: usize, seconds: f64) {
        let million = seconds * 1e6 / voxels.max(1) as f64;
        self.fit_seconds.insert(format!("{profile} {quality}"), million);
    }

    /// Writes the settings, if there is a place for them.
    ///
    /// # Errors
    /// Returns the errors of [`engine::output::write_atomic`].
    pub fn write(&self) -> Result<()> {
        let Some(path) = &self.path else { return Ok(()) };
        if let Some(folder) = path.parent() {
            std::fs::create_dir_all(folder)
                .map_err(|e| Error::io(folder, "making the folder of settings", &e))?;
        }
        let text = toml_text(self)?;
        engine::output::write_atomic(path, true, |out| out.write_all(text.as_bytes()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_come_back() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("vgs").join("view.toml");
        let mut settings = Settings::read(Some(path.clone())).expect("a first start");
        assert!(!settings.notice_seen && settings.recent.is_empty());
        settings.notice_seen = true;
        for name in ["a", "b", "a"] {
            settings.opened(Path::new(name));
        }
        assert_eq!(settings.seconds_of_fit("mr", "fine", 5), None);
        settings.fit_took("mr", "fine", 2_000_000, 30.0);
        settings.write().expect("written, with its folder");
        settings.write().expect("and replaced");
        let back = Settings::read(Some(path.clone())).expect("read");
        assert_eq!(back, settings);
        assert_eq!(back.seconds_of_fit("mr", "fine", 500_000), Some(7.5));
        assert_eq!(back.recent, [Path::new("a"), Path::new("b")]);
        std::fs::write(&path, "colour = 3").expect("written");
        let error = Settings::read(Some(path.clone())).expect_err("no settings");
        assert_eq!((error.code, error.file), ("VGS-VIEW-004", Some(path)));
    }

    #[test]
    fn without_a_home_nothing_is_written() {
        let settings = Settings::read(None).expect("defaults");
        settings.write().expect("nowhere");
        let mut many = settings;
        for i in 0..100 {
            many.opened(Path::new(&i.to_string()));
        }
        assert_eq!((many.recent.len(), many.recent[0].as_path()), (MOST_RECENT, Path::new("99")));
    }
}
