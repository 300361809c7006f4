//! Costs of a unit of each term on a device, found from frames that were measured, and the times that they
//! predict for other frames.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::nnls::nnls;
use super::stages::{STAGES, Stage};
use super::work::Work;

/// Least share of a frame's time that the error of a stage is relative to, so that short stages count for
/// less.
const LITTLE: f64 = 0.03;

/// Frame that was measured.
#[derive(Clone, Debug)]
pub struct Sample<'a> {
    /// Work of the frame.
    pub work: &'a Work,
    /// Device time of each pass, ms.
    pub passes: &'a BTreeMap<String, f64>,
}

impl Sample<'_> {
    /// Returns the time of a stage, ms.
    pub fn stage(&self, stage: &Stage) -> f64 {
        stage.passes.iter().filter_map(|&pass| self.passes.get(pass)).sum()
    }

    /// Returns the time of all passes, ms, including those that belong to no stage.
    pub fn ms(&self) -> f64 {
        self.passes.values().sum()
    }
}

/// Costs of the terms of a stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StageRates {
    /// Name of the stage.
    pub stage: String,
    /// Time of a dispatch or draw, ms.
    pub dispatch_ms: f64,
    /// Time of one unit of each term, ms.
    pub unit_ms: Vec<f64>,
}

/// Costs of the pieces of a frame on a device.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Rates {
    /// True if the workgroups of the device have 64 invocations.
    pub wide: bool,
    /// Costs of each stage, in the order of [`STAGES`].
    pub stages: Vec<StageRates>,
}

/// Returns the counts of a stage: its dispatches, then its terms.
fn counts(stage: &Stage, work: &Work, wide: bool) -> Vec<f64> {
    [(stage.dispatches)(work)].into_iter().chain(stage.terms.iter().map(|t| (t.of)(work, wide))).collect()
}

impl Rates {
    /// Finds the non-negative costs that minimise the sum of squares of the relative errors of each stage.
    /// Stages that no sample has cost nothing.
    pub fn fit(samples: &[Sample<'_>], wide: bool) -> Self {
        let stages = STAGES.iter().map(|stage| {
            let (mut rows, mut y) = (Vec::new(), Vec::new());
            for sample in samples.iter().filter(|s| stage.is_in(s.work)) {
                let ms = sample.stage(stage);
                let weight = ms.max(LITTLE * sample.ms()).recip();
                if weight.is_finite() {
                    rows.push(counts(stage, sample.work, wide).iter().map(|n| n * weight).collect());
                    y.push(ms * weight);
                }
            }
            let mut costs = nnls(&rows, &y).into_iter();
            let dispatch_ms = costs.next().unwrap_or(0.0);
            let mut unit_ms: Vec<f64> = costs.collect();
            unit_ms.resize(stage.terms.len(), 0.0);
            StageRates { stage: stage.name.to_owned(), dispatch_ms, unit_ms }
        });
        Rates { wide, stages: stages.collect() }
    }

    /// Returns the predicted time of each stage, ms; 0 for a stage that the frame does not have.
    pub fn stages(&self, work: &Work) -> Vec<f64> {
        let time = |(stage, rates): (&Stage, &StageRates)| {
            if !stage.is_in(work) {
                return 0.0;
            }
            let costs = std::iter::once(&rates.dispatch_ms).chain(&rates.unit_ms);
            counts(stage, work, self.wide).iter().zip(costs).map(|(n, ms)| n * ms).sum()
        };
        STAGES.iter().zip(&self.stages).map(time).collect()
    }

    /// Returns the predicted time of a frame, ms.
    pub fn predict(&self, work: &Work) -> f64 {
        self.stages(work).iter().sum()
    }
}

/// Returns the predicted time of each sample, ms, by the rates of the samples with other keys: no measurement
/// with its own key is used. NaN where all have the same key.
pub fn held_out<K: PartialEq>(samples: &[Sample<'_>], keys: &[K], wide: bool) -> Vec<f64> {
    let mut predicted = vec![f64::NAN; samples.len()];
    for (at, key) in keys.iter().enumerate() {
        if predicted[at].is_nan() {
            let others: Vec<Sample<'_>> =
                samples.iter().zip(keys).filter(|(_, k)| *k != key).map(|(s, _)| s.clone()).collect();
            if others.is_empty() {
                continue;
            }
            let rates = Rates::fit(&others, wide);
            for (other, sample) in samples.iter().enumerate().filter(|(i, _)| keys[*i] == *key) {
                predicted[other] = rates.predict(sample.work);
            }
        }
    }
    predicted
}

/// Errors of predictions, by the ratio of predicted to measured time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Errors {
    /// Number of frames.
    pub frames: usize,
    /// Median of |ratio − 1|.
    pub median: f64,
    /// Value of |ratio − 1| that nine of ten frames do not exceed.
    pub p90: f64,
    /// Greatest |ratio − 1|.
    pub worst: f64,
    /// Share of frames whose |ratio − 1| is at most [`BAND`].
    pub within: f64,
    /// Geometric mean of the ratio, above 1 if too much is predicted.
    pub bias: f64,
}

/// Greatest |ratio − 1| of the frames that [`Errors::within`] counts.
pub const BAND: f64 = 0.3;

impl Errors {
    /// Returns the errors of pairs of predicted and measured times; `None` if there are no pairs.
    pub fn of(pairs: &[(f64, f64)]) -> Option<Self> {
        let off: Vec<f64> = pairs.iter().map(|(predicted, ms)| (predicted / ms - 1.0).abs()).collect();
        let logs: f64 = pairs.iter().map(|(predicted, ms)| (predicted / ms).ln()).sum();
        Some(Errors {
            frames: off.len(),
            median: bench::cost::median(&off)?,
            p90: bench::cost::percentile(&off, 0.9)?,
            worst: bench::cost::percentile(&off, 1.0)?,
            within: off.iter().filter(|&&x| x <= BAND).count() as f64 / off.len() as f64,
            bias: (logs / off.len() as f64).exp(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::work::Pixels;

    /// Returns frames of three scenes, each with the number of its scene; none is a multiple of another.
    fn frames() -> Vec<(u32, Work)> {
        let mut frames = Vec::new();
        for n in 0..120u32 {
            let x = |k: u32| f64::from((n * 7 + k * 5) % 11 + 1);
            let narrow = Pixels {
                evaluations: 1e6 * x(1),
                classified: 1e4 * x(2),
                looked: 1e3 * x(3),
                rounds: 1e5 * x(1),
                samples: 1e5 * x(2),
                gradients: 1e4 * x(3),
            };
            frames.push((
                n % 3,
                Work {
                    mode: ["slab", "decoded", "slab", "alpha"][n as usize % 4].into(),
                    views: 1.0 + f64::from(n % 2),
                    pixels: 1e4 * x(4),
                    pixel_bytes: 8.0,
                    lit: n % 2 == 0,
                    rows: 1e4,
                    shown: 1e3 * x(5),
                    sorted: 1e5 * x(6),
                    digits: 3.0,
                    table: 64.0 * x(7),
                    tiles: 1e5 * x(8),
                    lists: 1e3 * x(9),
                    fragments: 1e6 * x(10),
                    image_bytes: 1e6 * x(11),
                    narrow,
                    ..Work::default()
                },
            ));
        }
        frames
    }

    #[test]
    fn a_device_that_keeps_to_its_rates_is_predicted_and_scenes_held_out_as_well() {
        let truth = Rates {
            wide: false,
            stages: STAGES
                .iter()
                .map(|stage| StageRates {
                    stage: stage.name.into(),
                    dispatch_ms: 0.01,
                    unit_ms: (0..stage.terms.len()).map(|k| 1e-6 * (k + 1) as f64).collect(),
                })
                .collect(),
        };
        let frames = frames();
        let times: Vec<BTreeMap<String, f64>> = frames
            .iter()
            .map(|(_, work)| {
                let stages = truth.stages(work);
                STAGES.iter().zip(stages).map(|(s, ms)| (s.passes[0].to_owned(), ms)).collect()
            })
            .collect();
        let samples: Vec<Sample<'_>> =
            frames.iter().zip(&times).map(|((_, work), passes)| Sample { work, passes }).collect();
        let scenes: Vec<u32> = frames.iter().map(|(scene, _)| *scene).collect();
        let rates = Rates::fit(&samples, false);
        for (sample, held) in samples.iter().zip(held_out(&samples, &scenes, false)) {
            let ms = sample.ms();
            assert!((rates.predict(sample.work) / ms - 1.0).abs() < 1e-6, "{ms}");
            assert!((held / ms - 1.0).abs() < 1e-3, "{held} {ms}");
        }
        assert!(rates.stages.iter().all(|s| s.unit_ms.iter().all(|&ms| ms >= 0.0)));
    }

    #[test]
    fn a_scene_has_no_say_in_what_it_is_predicted_by() {
        let work = |evaluations: f64| Work {
            mode: "slab".into(),
            narrow: Pixels { evaluations, ..Pixels::default() },
            ..Work::default()
        };
        let works = [work(1e6), work(2e6), work(1e6), work(2e6)];
        // The second scene is ten times as slow.
        let times: Vec<BTreeMap<String, f64>> =
            [1.0, 2.0, 10.0, 20.0].map(|ms| BTreeMap::from([("slab".to_owned(), ms)])).into();
        let samples: Vec<Sample<'_>> =
            works.iter().zip(&times).map(|(work, passes)| Sample { work, passes }).collect();
        let held = held_out(&samples, &["a", "a", "b", "b"], false);
        for (got, wanted) in held.iter().zip([10.0, 20.0, 1.0, 2.0]) {
            assert!((got - wanted).abs() < 1e-6, "{held:?}");
        }
        let pairs: Vec<(f64, f64)> = held.into_iter().zip([1.0, 2.0, 10.0, 20.0]).collect();
        let errors = Errors::of(&pairs).expect("errors");
        assert!(
            (errors.bias - 1.0).abs() < 1e-6 && errors.within == 0.0 && (errors.worst - 9.0).abs() < 1e-5
        );
        assert_eq!(Errors::of(&[(1.2, 1.0), (1.0, 2.0)]).map(|e| (e.frames, e.within)), Some((2, 0.5)));
        assert_eq!(Errors::of(&[]), None);
    }
}
