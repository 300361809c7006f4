//! Compares `--profile reference` with the authors' own code: figures of its numeric path, written anew from
//! its text and run on ct-torso-tiny mask_ts; and what each of its differences from the paper's text is
//! worth. PSNR is over the range of the region, -1100..1207 HU.

use engine::fit::{Background, FitConfig, ScaleUnit};
use engine::splat::Kernel;

use super::job::Job;
use super::results::{Results, db};
use super::runs::Record;
use bench::report::Table;

/// Run of the authors' code.
pub struct Peer {
    /// Name of the run.
    pub what: &'static str,
    /// Number of splats.
    pub splats: usize,
    /// Iterations at which its PSNR is known, with the PSNR in dB.
    pub points: &'static [(u32, f64)],
    /// Sets what differs from the profile.
    pub change: fn(&mut FitConfig),
}

impl Peer {
    /// Returns the number of iterations of the run.
    pub fn iterations(&self) -> u32 {
        self.points.iter().map(|p| p.0).max().unwrap_or_default()
    }
}

/// Lets the fit learn intensities and opacities.
pub fn learned(config: &mut FitConfig) {
    config.rates.learn_intensity = true;
    config.rates.learn_opacity = true;
}

fn learned_with_mask(config: &mut FitConfig) {
    learned(config);
    config.loss.mask_weight = 1.0;
}

/// Every run whose figures are known. Iteration 0 is the start of each.
pub const PEERS: &[Peer] = &[
    Peer {
        what: "sampled, all",
        splats: 2205,
        points: &[(0, 22.66), (100, 24.21), (300, 25.66), (1000, 26.33)],
        change: |_| {},
    },
    Peer {
        what: "sampled, 35 a step",
        splats: 2205,
        points: &[(0, 22.66), (100, 22.59), (300, 22.39), (1000, 21.87)],
        change: |c| c.subset.size = 35,
    },
    Peer {
        what: "learned, all",
        splats: 2205,
        points: &[(0, 22.66), (100, 25.17), (200, 26.40), (300, 27.24)],
        change: learned,
    },
    Peer {
        what: "learned, all, mask 1.0",
        splats: 2205,
        points: &[(0, 22.66), (100, 24.14)],
        change: learned_with_mask,
    },
    Peer {
        what: "sampled, 88 a step",
        splats: 5511,
        points: &[(0, 22.93), (100, 22.85), (300, 22.67), (600, 22.42)],
        change: |c| c.subset.size = 88,
    },
    Peer { what: "sampled, all", splats: 5511, points: &[(0, 22.93), (100, 24.66)], change: |_| {} },
    Peer { what: "learned, all", splats: 5511, points: &[(0, 22.93), (100, 25.84)], change: learned },
];

/// Difference between the authors' code and the paper's text, or a choice that either leaves open.
pub struct Difference {
    /// Description of what the run does in place of what the code does.
    pub what: &'static str,
    /// Applies the difference to a configuration.
    pub change: fn(&mut FitConfig),
}

/// Number of iterations of the runs of [`DIFFERENCES`].
pub const DIFFERENCE_ITERATIONS: u32 = 100;

/// Differences, each in one thing, from `--profile reference` with everything learned and every splat in
/// every step.
pub const DIFFERENCES: &[Difference] = &[
    Difference { what: "as it is: all learned, every splat in every step", change: |_| {} },
    Difference {
        what: "intensities over -1024..3071 HU in the loss, not over the region's range",
        change: |c| c.region.hu_range = [-1024.0, 3071.0],
    },
    Difference {
        what: "rate of the means 1e-4 voxel (here 1/121 of the edge's), not 1e-4 of the edge",
        change: |c| c.rates.mean = 1e-4 / 121.0,
    },
    Difference {
        what: "that rate decays as the paper says",
        change: |c| (c.rates.mean_decay, c.rates.mean_decay_iterations) = (0.016, 20_000),
    },
    Difference { what: "Gaussian cut at 3 σ, without the gate", change: |c| c.kernel = Kernel::Gaussian },
    Difference {
        what: "intensities unclamped, at 2.5e-3 a step",
        change: |c| (c.rates.clamp_intensity, c.rates.intensity) = (false, 2.5e-3),
    },
    Difference {
        what: "first opacity 0.1, not the mask",
        change: |c| (c.init.opacity_mask, c.init.opacity) = (false, 0.1),
    },
    Difference {
        what: "leak: mean over a shell of 4 voxels, first power",
        change: |c| (c.loss.leak_volume, c.loss.leak_power, c.loss.shell) = (false, 1, 4),
    },
    Difference { what: "no leak", change: |c| c.loss.leak_weight = 0.0 },
    Difference {
        what: "Dice over region and shell of 4, no smoothing",
        change: |c| (c.region.threshold, c.loss.dice_smoothing, c.loss.shell) = (0.0, 0.0, 4),
    },
    Difference { what: "three draws of scale", change: |c| c.init.initialiser = "uniform".to_owned() },
    Difference {
        what: "scales in mean voxel spacings (mm), not in the unit cube",
        change: |c| {
            c.init.unit = ScaleUnit::Spacing;
            c.rates.mean = 0.0121;
            c.loss.scale_weight = 0.0;
        },
    },
    Difference { what: "no limit of 1.5 times the first scale", change: |c| c.scales.growth = 0.0 },
    Difference { what: "no term of the scales", change: |c| c.loss.scale_weight = 0.0 },
    Difference {
        what: "background: the mean of the region",
        change: |c| c.region.background = Background::Mean,
    },
    Difference { what: "weight of the mask 1, not 0.2", change: |c| c.loss.mask_weight = 1.0 },
    Difference { what: "mask: Tversky's loss", change: |c| c.loss.mask = "tversky".to_owned() },
    Difference { what: "mask: squared error", change: |c| c.loss.mask = "mse".to_owned() },
    Difference { what: "mask: divergence", change: |c| c.loss.mask = "kl".to_owned() },
    Difference { what: "intensity: Dice", change: |c| c.loss.intensity = "dice".to_owned() },
    Difference { what: "intensity: Tversky's loss", change: |c| c.loss.intensity = "tversky".to_owned() },
    Difference { what: "intensity: divergence", change: |c| c.loss.intensity = "kl".to_owned() },
    Difference {
        what: "intensity sampled at the end, not learned",
        change: |c| c.rates.learn_intensity = false,
    },
    Difference { what: "opacity sampled at the end, not learned", change: |c| c.rates.learn_opacity = false },
    Difference { what: "35 of 2205 splats a step, dense Adam", change: |c| c.subset.size = 35 },
    Difference {
        what: "35 of 2205 splats a step, moments of the block alone",
        change: |c| (c.subset.size, c.subset.dense) = (35, false),
    },
    Difference {
        what: "their densification, every 50 iterations from 50",
        change: |c| (c.topology.name, c.topology.from) = ("reference".to_owned(), 50),
    },
    Difference {
        what: "the paper's densification, every 50 iterations from 50, up to 1.9 times",
        change: |c| {
            (c.topology.name, c.topology.from, c.topology.limit) = ("densify".to_owned(), 50, 1.9);
        },
    },
];

/// Returns the PSNR measured after `iteration` iterations, dB.
fn after(record: Option<&Record>, iteration: u32) -> Option<f64> {
    record?.points.iter().find(|p| p.iteration == iteration).map(|p| p.psnr())
}

fn dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| "—".to_owned())
}

/// Returns the table of `--profile reference` beside the authors' code, with a row for each of its known
/// points.
pub fn table(rows: &[(&'static Peer, Job)], results: &Results) -> Table {
    let mut table = Table {
        title: "## `--profile reference` beside the authors' code\n\nTheirs: its numeric path written anew from its text (PyTorch \
                and C, f32), ct-torso-tiny mask_ts. PSNR at the voxels over the range of the region."
            .into(),
        columns: vec![
            "splats",
            "run",
            "iterations",
            "their code, dB",
            "--profile reference, dB",
            "difference, dB",
        ],
        rows: Vec::new(),
    };
    for (peer, job) in rows {
        for &(iterations, theirs) in peer.points {
            let ours = after(results.of(job), iterations);
            table.rows.push(vec![
                peer.splats.to_string(),
                peer.what.to_owned(),
                iterations.to_string(),
                db(theirs),
                dash(ours.map(db)),
                dash(ours.map(|ours| format!("{:+.2}", ours - theirs))),
            ]);
        }
    }
    table
}

/// Returns the table of what each difference is worth.
pub fn differences(rows: &[(&'static Difference, Job)], results: &Results) -> Table {
    let last = |job: &Job| results.of(job).and_then(Record::end).map(|p| p.psnr());
    let whole = rows.first().and_then(|(_, job)| last(job));
    Table {
        title: format!(
            "## What the differences are worth\n\nEach row departs in one thing from `--profile reference --learn-intensity true \
             --learn-opacity true` on ct-torso-tiny mask_ts, 2205 splats, {DIFFERENCE_ITERATIONS} iterations; PSNR at the voxels \
             over the range of the region."
        ),
        columns: vec!["in place of what the code does", "start, dB", "last, dB", "difference, dB"],
        rows: rows
            .iter()
            .map(|(row, job)| {
                let start = results.of(job).and_then(Record::start).map(|p| p.psnr());
                vec![
                    row.what.to_owned(),
                    dash(start.map(db)),
                    dash(last(job).map(db)),
                    dash(last(job).zip(whole).map(|(a, b)| format!("{:+.2}", a - b))),
                ]
            })
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use engine::fit::Profile;

    use super::*;
    use crate::paper::job::tests::job;
    use crate::paper::runs::tests::record;

    #[test]
    fn a_difference_differs_in_something_and_can_run() {
        let mut start = Profile::named("reference").expect("a profile").config().expect("its settings");
        learned(&mut start);
        let mut seen = Vec::new();
        for (i, row) in DIFFERENCES.iter().enumerate() {
            let mut config = start.clone();
            (row.change)(&mut config);
            config.check().unwrap_or_else(|e| panic!("{}: {e}", row.what));
            assert_eq!(config == start, i == 0, "{}", row.what);
            assert!(!seen.contains(&config), "{} is there twice", row.what);
            seen.push(config);
        }
    }

    #[test]
    fn points_are_those_of_the_run() {
        let rows = [(&PEERS[3], job(5))];
        let mut results = Results::default();
        results.add(record(job(5), &[0.01, 0.005, 0.002]));
        let table = table(&rows, &results);
        assert_eq!(table.rows[0][2..], ["0", "22.66", "20.00", "-2.66"]);
        assert_eq!(table.rows[1][2..], ["100", "24.14", "26.99", "+2.85"]);
    }
}
