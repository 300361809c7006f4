//! A fit beside the window, as the panels show it: what it is asked for, what it will cost, how far it is.

use std::path::Path;

use engine::Result;
use engine::fit::{FitConfig, Profile, QualityPreset};
use engine::splat::{self, Splat, SplatSet, WriteOptions};

use engine::figures::seconds;

/// Number of splats that stand for a file when the bytes of one are counted.
const COUNTED: usize = 1000;

/// Returns the profile with which the qualities were measured for volumes of a kind.
pub fn usual_profile(is_ct: bool) -> &'static str {
    if is_ct { "default" } else { "mr" }
}

/// Returns the hyper-parameters of a profile at a quality. The target of a quality is in HU, so a volume that is no
/// CT has none.
///
/// # Errors
/// Returns [`Kind::Usage`](engine::Kind::Usage) if there is no such profile or quality.
pub fn config(profile: &str, quality: &str, is_ct: bool) -> Result<FitConfig> {
    let config = QualityPreset::named(quality)?.of(&Profile::named(profile)?.config()?)?;
    Ok(if is_ct { config } else { config.without_goal() })
}

/// Returns the size of the PLY file of this many splats, without the exceptions that a fit may add, bytes.
pub fn ply_bytes(splats: usize) -> u64 {
    let bytes = |count: usize| {
        let set = SplatSet { splats: vec![Splat::default(); count], ..SplatSet::default() };
        splat::file_bytes(Path::new("x.ply"), &set, &WriteOptions::default()).unwrap_or_default()
    };
    let [none, some] = [0, COUNTED].map(bytes);
    none + (some - none) * splats as u64 / COUNTED as u64
}

/// What a fit is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Stage {
    /// It finds out how many splats there are to be, places the first ones and prepares the device.
    #[default]
    Preparing,
    /// Its iterations are running.
    Running,
    /// Its iterations have ended: splats are there to be kept.
    Ended,
    /// A file of its splats is being written.
    Writing,
}

/// Progress of a fit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitStatus {
    /// What it is doing.
    pub stage: Stage,
    /// The same in words, before and after its iterations.
    pub doing: &'static str,
    /// Part of that which is done, 0 to 1, where it is known.
    pub done: Option<f64>,
    /// Number of splats, as soon as they are placed.
    pub splats: Option<usize>,
    /// Number of iterations done.
    pub iteration: u32,
    /// Number of iterations of the whole fit.
    pub iterations: u32,
    /// Time of the iterations so far, seconds.
    pub seconds: f64,
    /// PSNR over the range of the fit, dB, as soon as it is known.
    pub psnr_db: Option<f64>,
    /// Root mean square error at the voxels of the region, HU for CT, as soon as it is known.
    pub rmse: Option<f64>,
    /// Error that 99 % of the voxels of the region do not exceed, HU for CT, once the fit has ended.
    pub p99: Option<f64>,
    /// True if the user has asked it to stop.
    pub stopping: bool,
}

/// Iterations after which their time tells how long the fit will take; the first ones compile kernels.
const TELLING: u32 = 8;

impl FitStatus {
    /// Returns the part of what it is doing that is done, 0 to 1; `None` if it is not known.
    pub fn share(&self) -> Option<f32> {
        match self.stage {
            Stage::Preparing | Stage::Writing => self.done.map(|done| done as f32),
            Stage::Running | Stage::Ended => Some(self.iteration as f32 / self.iterations.max(1) as f32),
        }
    }

    /// Returns the time that the iterations still take, seconds; `None` until a few are done.
    pub fn seconds_left(&self) -> Option<f64> {
        let left = self.iterations.saturating_sub(self.iteration);
        (self.iteration >= TELLING).then(|| self.seconds / f64::from(self.iteration) * f64::from(left))
    }

    /// Returns what it is doing in a few words.
    pub fn text(&self) -> String {
        match self.stage {
            Stage::Preparing if self.stopping => "stopping the fit".to_owned(),
            Stage::Preparing | Stage::Writing => self.doing.to_owned(),
            Stage::Running if self.stopping => "stopping the fit".to_owned(),
            Stage::Running => match self.seconds_left() {
                Some(left) => format!("{} of {}, {} left", self.iteration, self.iterations, seconds(left)),
                None => format!("{} of {}", self.iteration, self.iterations),
            },
            Stage::Ended => {
                format!("{} of {} iterations in {}", self.iteration, self.iterations, seconds(self.seconds))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use engine::fit::{PROFILES, QUALITIES};

    use super::*;

    #[test]
    fn every_choice_can_be_fitted_and_its_file_is_counted() {
        for (profile, quality) in PROFILES.iter().flat_map(|p| QUALITIES.iter().map(move |q| (p, q))) {
            let config = |is_ct| config(profile.name, quality.name, is_ct).expect("a configuration");
            config(true).check().expect("it can work");
            assert!(!config(false).has_goal());
        }
        assert_eq!(config("default", "best", true).expect_err("no quality").code, "VGS-CFG-015");
        assert!([true, false].into_iter().all(|is_ct| Profile::named(usual_profile(is_ct)).is_ok()));
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("x.ply");
        let splat = Splat { rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
        let set = SplatSet { splats: vec![splat; 2345], ..SplatSet::default() };
        splat::write(&path, &set, false).expect("written");
        let bytes = std::fs::metadata(&path).expect("a file").len();
        // The header has the number of splats.
        assert!(bytes.abs_diff(ply_bytes(2345)) < 10, "{bytes} and {}", ply_bytes(2345));
    }

    #[test]
    fn time_left_is_told_by_the_iterations_so_far() {
        let mut status = FitStatus { iterations: 200, doing: "placing", ..FitStatus::default() };
        assert_eq!((status.text().as_str(), status.share()), ("placing", None));
        status.done = Some(0.5);
        assert_eq!(status.share(), Some(0.5), "of the placing");
        status = FitStatus { stage: Stage::Running, iteration: 4, seconds: 3.0, ..status };
        assert_eq!((status.seconds_left(), status.text()), (None, "4 of 200".to_owned()));
        status = FitStatus { iteration: 50, seconds: 10.0, ..status };
        assert_eq!(status.text(), "50 of 200, 30 s left");
        assert_eq!(status.share(), Some(0.25));
        status.stopping = true;
        assert_eq!(status.text(), "stopping the fit");
        status.stage = Stage::Ended;
        assert_eq!(status.text(), "50 of 200 iterations in 10 s");
    }
}
