//! Describes a run: what is fitted, how, and over which range its errors are measured. Its key names the file
//! of its result.

use engine::Result;
use engine::fit::FitConfig;
use serde::{Deserialize, Serialize};

use bench::store::hash;

/// Number of iterations between two measurements.
pub const MEASURE_EVERY: u32 = 50;
/// [`MEASURE_EVERY`] for the mini-batches of Tables 2, 4 and 6: a measurement rasterizes every splat and
/// takes as long as hundreds of their iterations.
pub const MEASURE_BATCHES_EVERY: u32 = 250;
/// Number of held-out offsets at which fits of the default profile are measured at the end.
pub const HELD_OUT: usize = 8;
/// Seed of the held-out offsets; never that of a fit.
pub const HELD_OUT_SEED: u64 = 7;

/// Range by which errors are normalised.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Range {
    /// Least to greatest value of the whole volume.
    MinMax,
    /// -1024..3071 HU, the range of the prototype's figures.
    Hu,
    /// Least to greatest value of the region, the range of the authors' code.
    Roi,
}

/// One complete run: two jobs with the same fields give the same figures on the same device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job {
    /// Folder of the case.
    pub folder: String,
    /// Name of the mask in the folder.
    pub mask: String,
    /// Profile that the configuration started from.
    pub profile: String,
    /// Hyper-parameters; `splats` and `iterations` are set.
    pub config: FitConfig,
    /// Range by which errors are divided.
    pub range: Range,
    /// Number of held-out offsets at the end; 0 measures on the grid only.
    pub held_out: usize,
    /// Number of iterations between two measurements.
    pub measure_every: u32,
    /// Name of the device; figures of several devices do not mix.
    pub device: String,
}

impl Job {
    /// Returns the name of the result's file without its extension: a readable part, then a hash of all
    /// fields.
    pub fn key(&self) -> String {
        format!("{}-{}-{}-{}-{}", self.folder, self.mask, self.config.count.splats, self.profile, hash(self))
    }

    /// Returns an error that names the job if its configuration cannot run.
    pub fn check(&self) -> Result<()> {
        self.config.check().map_err(|e| {
            let message = format!("{} (run {})", e.message, self.key());
            engine::Error { message, ..e }
        })
    }

    /// Returns a short title for people.
    pub fn title(&self) -> String {
        let subset = match (self.config.subset.size, self.config.subset.alone) {
            (0, _) => String::new(),
            (n, true) => format!(", subset {n} alone"),
            (n, false) => format!(", subset {n}"),
        };
        format!(
            "{} {}: {} splats, --profile {}{subset}, {} iterations",
            self.folder, self.mask, self.config.count.splats, self.profile, self.config.iterations
        )
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// Creates a job of no particular case.
    pub fn job(splats: usize) -> Job {
        Job {
            folder: "ct-none".into(),
            mask: "mask_none".into(),
            profile: "default".into(),
            config: FitConfig::default().with(|c| {
                c.count.splats = splats;
                c.iterations = 7;
            }),
            range: Range::MinMax,
            held_out: 2,
            measure_every: 3,
            device: "none".into(),
        }
    }

    #[test]
    fn every_setting_is_in_the_key() {
        let first = job(5);
        let config = |change: fn(&mut FitConfig)| {
            let mut job = first.clone();
            change(&mut job.config);
            job
        };
        let others = [
            job(6),
            Job { mask: "mask_other".into(), ..first.clone() },
            Job { range: Range::Hu, ..first.clone() },
            Job { held_out: 3, ..first.clone() },
            Job { measure_every: 4, ..first.clone() },
            Job { device: "other".into(), ..first.clone() },
            config(|c| c.iterations = 8),
            config(|c| c.epsilon *= 1.0 + f32::EPSILON),
        ];
        for other in others {
            assert_ne!(other.key(), first.key());
        }
        assert_eq!(first.key(), job(5).key());
        assert!(first.key().starts_with("ct-none-mask_none-5-default-"), "{}", first.key());
    }

    #[test]
    fn a_configuration_that_cannot_run_names_its_job() {
        let mut bad = job(5);
        bad.config.samples.offsets = 0;
        assert!(bad.check().is_err_and(|e| e.message.contains("offsets") && e.message.contains(&bad.key())));
    }
}
