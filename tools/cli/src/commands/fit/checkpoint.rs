//! Checkpoints of a fit, by which one can look at it and resume it: splats as PLY, and its state.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};

use clap::Args;
use engine::fit::{CurvePoint, FitConfig, FitState, Interrupted};
use engine::output::check_writable;
use engine::splat::{self, SplatSet, WriteOptions};
use engine::{Error, Kind, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::shared::inputs::{CleaningArguments, InputRecord, RoiArguments};
use crate::shared::interrupted::{self, state_path};
use crate::shared::outputs::beside;

/// Flags for checkpoints and resuming.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Output")]
pub struct CheckpointArguments {
    /// Every N iterations writes the splats so far (OUT.000100.ply) and what --resume needs (OUT.state)
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    checkpoint_every: Option<u32>,
    /// Of the splats on the way the last N files stay
    #[arg(long, value_name = "N", default_value_t = 2, requires = "checkpoint_every",
          value_parser = clap::value_parser!(u32).range(1..))]
    checkpoint_keep: u32,
    /// Goes on from OUT.state, which an interrupted fit leaves: to the splats of a fit that never stopped,
    /// bit for bit. Outputs of the interrupted fit are replaced
    #[arg(long)]
    pub resume: bool,
}

/// Notes in a state file beside the state: the fit that it belongs to, and the curve so far.
#[derive(Serialize, Deserialize)]
struct StateNotes {
    /// Hash of each input file, by its name in the record.
    inputs: BTreeMap<String, String>,
    /// Region of interest, as the flags give it.
    region: String,
    config: FitConfig,
    seconds: f64,
    curve: Vec<CurvePoint>,
}

/// Checkpoints of one fit.
pub struct Checkpoints {
    every: Option<u32>,
    output: PathBuf,
    /// Options with which splats are written; with `force` existing files are replaced.
    write: WriteOptions<'static>,
    inputs: BTreeMap<String, String>,
    region: String,
    config: FitConfig,
    /// Most files of splats on the way that stay, and those that there are, the oldest first.
    keep: usize,
    kept: RefCell<VecDeque<PathBuf>>,
    /// True if the state on disk is whole and of this fit, so that it is worth keeping beside the next one.
    has_good_state: Cell<bool>,
}

/// Returns the path of the state before the last, which stands in if the last one is damaged.
fn previous_path(output: &Path) -> PathBuf {
    beside(output, ".previous.state")
}

impl Checkpoints {
    /// Prepares the checkpoints of a fit to `output`. Returns an error if a file that a checkpoint would
    /// write exists, unless `write` replaces it.
    pub fn new(
        arguments: &CheckpointArguments,
        output: &Path,
        inputs: &BTreeMap<&'static str, InputRecord>,
        region: &RoiArguments,
        config: &FitConfig,
        write: WriteOptions<'static>,
    ) -> Result<Self> {
        let checkpoints = Checkpoints {
            every: arguments.checkpoint_every,
            output: output.to_owned(),
            write: WriteOptions { force: write.force || arguments.resume, ..write },
            inputs: inputs.iter().map(|(&name, input)| (name.to_owned(), input.sha256.clone())).collect(),
            region: region_text(region),
            config: config.clone(),
            keep: arguments.checkpoint_keep as usize,
            kept: RefCell::default(),
            has_good_state: Cell::new(false),
        };
        if !checkpoints.write.force {
            interrupted::check_none_left(&[state_path(output), previous_path(output)])?;
        }
        if let Some(every) = checkpoints.every {
            for k in (every..=config.iterations).step_by(every as usize) {
                let path = checkpoints.splats_path(k);
                check_writable(&path, checkpoints.write.force)?;
                if arguments.resume && path.exists() {
                    // Of the interrupted fit, whose outputs this one replaces.
                    checkpoints.kept.borrow_mut().push_back(path);
                }
            }
        }
        Ok(checkpoints)
    }

    fn splats_path(&self, iteration: u32) -> PathBuf {
        beside(&self.output, &format!(".{iteration:06}.ply"))
    }

    /// Returns true if a checkpoint is written after this iteration.
    pub fn is_due(&self, iteration: u32) -> bool {
        self.every.is_some_and(|every| iteration > 0 && iteration.is_multiple_of(every))
    }

    /// Writes the splats of an iteration. Once they are safe, those of the oldest are removed.
    pub fn write_splats(&self, set: &SplatSet, iteration: u32) -> Result<()> {
        let path = self.splats_path(iteration);
        splat::write_as(&path, set, &self.write)?;
        let mut kept = self.kept.borrow_mut();
        kept.retain(|other| *other != path);
        kept.push_back(path);
        while kept.len() > self.keep {
            // One that somebody has taken away, or holds fast, is no reason to stop a fit.
            let _ = kept.pop_front().map(std::fs::remove_file);
        }
        Ok(())
    }

    /// Writes the state of the fit with its notes.
    pub fn write_state(&self, state: &FitState, seconds: f64, curve: &[CurvePoint]) -> Result<()> {
        let notes = StateNotes {
            inputs: self.inputs.clone(),
            region: self.region.clone(),
            config: self.config.clone(),
            seconds,
            curve: curve.to_vec(),
        };
        let notes = interrupted::notes_text(&notes)?;
        let (path, previous) = (state_path(&self.output), previous_path(&self.output));
        // If writing fails, the state before stays where it is.
        if self.has_good_state.replace(false) {
            std::fs::rename(&path, &previous)
                .map_err(|e| Error::io(&previous, "keeping the state before the last", &e))?;
        }
        // What is there was given up with --force, or cannot be read.
        state.write(&path, &notes, true)?;
        self.has_good_state.set(true);
        Ok(())
    }

    /// Removes the states of a fit that is finished.
    pub fn clean(&self) {
        for path in [state_path(&self.output), previous_path(&self.output)] {
            let _ = std::fs::remove_file(path);
        }
    }

    /// Reads the last state of an interrupted fit or, if that is damaged or missing, the one before it. It
    /// must be this fit: the same inputs, region and hyper-parameters.
    pub fn read(&self) -> Result<Interrupted> {
        let (last, previous) = (state_path(&self.output), previous_path(&self.output));
        if !last.exists() && !previous.exists() {
            return Err(interrupted::nothing_to_resume(last));
        }
        match self.read_from(&last) {
            Ok(interrupted) => {
                self.has_good_state.set(true);
                Ok(interrupted)
            }
            Err(error) if error.kind != Kind::Usage && previous.exists() => {
                let interrupted = self.read_from(&previous)?;
                let iteration = interrupted.state.iteration;
                tracing::warn!("{error}; continuing from the state before it, iteration {iteration}");
                Ok(interrupted)
            }
            Err(error) => Err(error),
        }
    }

    fn read_from(&self, path: &Path) -> Result<Interrupted> {
        let (state, text) = FitState::read(path)?;
        let notes: StateNotes = serde_json::from_str(&text).map_err(|e| interrupted::bad_notes(path, &e))?;
        let other = |what: &str| Err(interrupted::of_other_work(path, what));
        for (name, hash) in &self.inputs {
            if notes.inputs.get(name) != Some(hash) {
                return other(&format!("the file of the {name} differs"));
            }
        }
        if notes.inputs.len() != self.inputs.len() || notes.region != self.region {
            return other("the region of interest is chosen differently");
        }
        let changed = differences(&notes.config, &self.config);
        if !changed.is_empty() {
            let all: Vec<_> =
                changed.iter().map(|(key, was, is)| format!("{key} was {was} and is now {is}")).collect();
            return other(&all.join(", "));
        }
        Ok(Interrupted { state, seconds: notes.seconds, curve: notes.curve })
    }
}

/// Returns the region as text, as the flags give it. Without steps that clean the region the text is the same
/// as before such steps existed, so that older states can be resumed.
fn region_text(region: &RoiArguments) -> String {
    let RoiArguments { roi: _, roi_threshold, roi_label, cleaning } = region;
    let steps =
        if *cleaning == CleaningArguments::default() { String::new() } else { format!(" {cleaning:?}") };
    format!("{roi_threshold:?} {roi_label:?}{steps}")
}

/// Returns the keys in which two configurations differ, and both values of each.
fn differences(a: &FitConfig, b: &FitConfig) -> Vec<(&'static str, Value, Value)> {
    // The values go through text, so that 0.1 as f32 stays 0.1.
    let text = |config| serde_json::to_string(config).unwrap_or_default();
    let values = |config| serde_json::from_str::<Value>(&text(config)).unwrap_or_default();
    let (a, b) = (values(a), values(b));
    let keys = FitConfig::FIELDS.iter().map(|field| field.key);
    keys.filter(|key| a[key] != b[key]).map(|key| (key, a[key].clone(), b[key].clone())).collect()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    fn threshold(cleaning: CleaningArguments) -> RoiArguments {
        RoiArguments { roi: None, roi_threshold: Some([1.0, 2.0]), roi_label: None, cleaning }
    }

    fn checkpoints(folder: &Path, config: FitConfig) -> Checkpoints {
        let arguments = CheckpointArguments { checkpoint_every: Some(10), checkpoint_keep: 2, resume: true };
        let region = threshold(CleaningArguments::default());
        let record = InputRecord { path: "v.nii".into(), bytes: 3, sha256: "abc".into() };
        let inputs = BTreeMap::from([("volume", record)]);
        Checkpoints::new(
            &arguments,
            &folder.join("a.ply"),
            &inputs,
            &region,
            &config,
            WriteOptions::default(),
        )
        .expect("checkpoints")
    }

    #[test]
    fn they_come_every_so_often() {
        let folder = tempfile::tempdir().unwrap();
        let c = checkpoints(folder.path(), FitConfig::default());
        let due: Vec<u32> = (0..35).filter(|&k| c.is_due(k)).collect();
        assert_eq!(due, [10, 20, 30]);
        assert!(c.splats_path(10).ends_with("a.000010.ply"));
    }

    #[test]
    fn the_last_two_stay_whoever_wrote_them() {
        let folder = tempfile::tempdir().unwrap();
        let splat = splat::Splat { rotation: [1.0, 0.0, 0.0, 0.0], ..splat::Splat::default() };
        let set = SplatSet { splats: vec![splat], ..SplatSet::default() };
        let write = |c: &Checkpoints, k| c.write_splats(&set, k).expect("written");
        let names = || {
            let names = std::fs::read_dir(folder.path()).unwrap().map(|e| e.unwrap().file_name());
            let mut names: Vec<_> = names.map(|name| name.into_string().unwrap()).collect();
            names.sort();
            names
        };
        let first = checkpoints(folder.path(), FitConfig::default());
        std::fs::write(folder.path().join("a.000011.ply"), "of somebody else").unwrap();
        for k in [10, 20, 30] {
            write(&first, k);
        }
        assert_eq!(names(), ["a.000011.ply", "a.000020.ply", "a.000030.ply"]);
        let resumed = checkpoints(folder.path(), FitConfig::default());
        // A resumed fit may write one again.
        write(&resumed, 30);
        write(&resumed, 40);
        assert_eq!(names(), ["a.000011.ply", "a.000030.ply", "a.000040.ply"]);
    }

    #[test]
    fn a_region_that_is_cleaned_otherwise_is_another_one() {
        let none = CleaningArguments::default();
        assert_eq!(region_text(&threshold(none.clone())), "Some([1.0, 2.0]) None");
        let others = [
            none.clone(),
            CleaningArguments { roi_min_ml: Some(1.0), ..none.clone() },
            CleaningArguments { roi_largest: Some(1), ..none.clone() },
            CleaningArguments { roi_largest: Some(2), ..none.clone() },
            CleaningArguments { roi_close: Some(1.0), ..none.clone() },
            CleaningArguments { roi_fill: true, ..none },
        ];
        let texts: BTreeSet<String> = others.map(|cleaning| region_text(&threshold(cleaning))).into();
        assert_eq!(texts.len(), 6, "{texts:?}");
    }

    #[test]
    fn another_configuration_is_told_by_its_key() {
        let a = FitConfig::default();
        assert!(differences(&a, &a).is_empty());
        let b = a.clone().with(|c| {
            c.rates.mean = 0.3;
            c.loss.shell = 5;
        });
        let text = |(key, was, is): &(&str, Value, Value)| format!("{key} {was} {is}");
        let all: Vec<_> = differences(&a, &b).iter().map(text).collect();
        assert_eq!(all, ["shell 4 5", "rate_mean 0.2 0.3"]);
    }

    #[test]
    fn a_missing_state_is_told_as_a_missing_file() {
        let folder = tempfile::tempdir().unwrap();
        let error = checkpoints(folder.path(), FitConfig::default()).read().err().unwrap();
        assert_eq!(error.kind, Kind::Missing);
    }
}
