//! How many splats a goal takes: short fits of parts of the region, at one density after the other.
//!
//! The error of a fit falls smoothly with the logarithm of the density, by 1 to 8 dB where it doubles: little
//! in noise, much in bone. So two or three trials find the density. Splats that are added later, where the
//! error is, are worth less than those that were there from the beginning, with neighbours in their places
//! (`docs/design/method.md`); therefore the number is found first.

use std::ops::Range;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::evaluate::{Metrics, Protocol, evaluate};
use super::goal::Goal;
use super::going::{Going, iterate, part};
use super::run::Problem;
use super::stage::Trial;
use super::{FitConfig, Fitter};
use base::error::Result;
use gpu::Gpu;
use splat::Splat;
use volume::Roi;

/// Iterations of a trial ...
const ITERATIONS: u32 = 150;
/// ... and the part of the weight of the occupancy in it: otherwise the outline has all of its attention.
const OCCUPANCY: f32 = 0.25;
/// Number of parts of a region that is too large to be tried as a whole ...
const PARTS: usize = 6;
/// ... and the weight of the mask in each, voxels.
const PART_VOXELS: f64 = 5_000.0;
/// Half the edge of a part, voxels: the least, the steps, and the most.
const HALF_EDGES: [usize; 3] = [8, 4, 64];

/// Density of the first trial, splats a voxel.
const FIRST: f64 = 0.05;
/// Densities that are tried, splats a voxel.
const DENSITIES: Range<f64> = 0.001..1.0;
/// Most trials.
const TRIALS: usize = 3;
/// Greatest step between two trials, doublings of the density ...
const STEP: f64 = 2.0;
/// ... and a step that needs no further trial.
const NEAR: f64 = 0.4;
/// What a doubling of the density is worth, dB: at first, and within which bounds what two trials on one side of the
/// goal say of it is believed.
const SLOPE: f64 = 3.5;
const SLOPES: [f64; 2] = [0.8, 8.0];
/// What a trial still lacks of a fit of 300 iterations, dB of the error of 99 % of the voxels, by density; medians of bones,
/// liver and vessels of a torso (`docs/results/tradeoffs.md`).
const LACKS: [(f64, f64); 5] = [(0.0125, 0.7), (0.025, 0.9), (0.05, 0.9), (0.1, 1.3), (0.2, 2.3)];

impl Problem<'_> {
    /// Finds out how many splats the fit takes to be `margin_db` better than `goal`. `told` hears of every
    /// trial, and `going` of the part of the greatest number of trials that is done; once that says stop, the best guess
    /// so far is the answer. Waits for the device.
    ///
    /// # Errors
    /// Fails if the device fails.
    pub fn count_for(
        &self,
        gpu: &Gpu,
        goal: &Goal,
        margin_db: f64,
        told: &mut dyn FnMut(&Trial),
        going: &mut Going<'_>,
    ) -> Result<usize> {
        let parts = self.parts();
        let count = |x: f64| ((x.exp2() * self.native_voxels()).round() as usize).max(1);
        let mut tried = Vec::new();
        let mut x = FIRST.log2();
        loop {
            let config = self.trial_config(x.exp2());
            let mut found = Vec::new();
            for (k, trial) in parts.iter().enumerate() {
                let at = |k: usize| (tried.len() as f64 + k as f64 / parts.len() as f64) / TRIALS as f64;
                let mut going = part(going, at(k), at(k + 1));
                found.push(trial.with_config(config.clone()).tried(gpu, goal, &mut going)?);
            }
            let surplus = surplus_of_all(goal, &found) + self.lacks(x.exp2()) - margin_db;
            told(&Trial { splats: count(x), surplus_db: surplus + margin_db });
            tried.push((x, surplus));
            let next = answer(&tried);
            let last = tried.len() == TRIALS || (next - x).abs() <= NEAR;
            if last || going(tried.len() as f64 / TRIALS as f64).is_break() {
                return Ok(count(next));
            }
            x = next;
        }
    }

    /// Returns the configuration of a trial.
    fn trial_config(&self, density: f64) -> FitConfig {
        let usual = self.config();
        let short = usual.iterations > ITERATIONS;
        let (low, high) = self.scaling().range;
        usual.clone().with(|c| {
            c.iterations = usual.iterations.min(ITERATIONS);
            c.loss.occupancy_weight = if short { OCCUPANCY } else { 1.0 } * usual.loss.occupancy_weight;
            c.count.density = density;
            c.count.splats = 0;
            c.subset.size = 0;
            // Nothing is known of what lies beyond a part, so it ends where its samples end.
            c.loss.shell_beyond = false;
            c.region.hu_range = [low, high];
        })
    }

    /// Returns what a trial at this density still lacks, dB.
    fn lacks(&self, density: f64) -> f64 {
        let more = f64::from(self.config().iterations) / f64::from(ITERATIONS);
        interpolated(&LACKS, density) * more.max(1.0).log2().min(1.25)
    }

    /// Fits the part as its configuration says, and measures it.
    fn tried(&self, gpu: &Gpu, goal: &Goal, going: &mut Going<'_>) -> Result<Metrics> {
        let first = self.first_splats()?;
        let mut fitter = Fitter::new(gpu, self.volume(), self.roi(), &first, self.config())?;
        iterate(&mut fitter, self.config().iterations, going)?;
        self.at_voxels(gpu, goal, &fitter.splats()?)
    }

    /// Measures splats (voxel space, HU) at the voxels of the scan, as `goal` counts them. Waits for the device.
    ///
    /// # Errors
    /// Fails if the device fails.
    pub fn at_voxels(&self, gpu: &Gpu, goal: &Goal, splats: &[Splat]) -> Result<Metrics> {
        let protocol =
            Protocol { offsets: Vec::new(), range: goal.range, shell: 0, threshold: goal.threshold };
        Ok(evaluate(gpu, splats, &self.field(), self.volume(), &self.scanned_roi(), &protocol)?.on_grid)
    }

    /// Returns the problems that stand for this one in trials: itself, or parts of a large region, each around
    /// a voxel that is drawn from an equal share of the region.
    fn parts(&self) -> Vec<Problem<'_>> {
        let voxels = self.roi().weight_sum();
        if voxels <= PARTS as f64 * PART_VOXELS {
            return vec![self.with_config(self.config().clone())];
        }
        let mut random = Pcg64::seed_from_u64(self.config().seed ^ 0x0070_6172_7473);
        let centres = (0..PARTS).map(|k| (k as f64 + random.random::<f64>()) / PARTS as f64 * voxels);
        let boxes = voxels_at(self.roi(), centres).map(|centre| box_around(self.roi(), centre));
        boxes.map(|(first, size)| self.part(first, size)).collect()
    }
}

/// Returns the figures of all parts together: errors add up as squares, by the weight of the parts.
fn surplus_of_all(goal: &Goal, parts: &[Metrics]) -> f64 {
    // A part between two slices of the scan has nothing to say.
    let parts = || parts.iter().filter(|part| part.weight > 0.0);
    let weight: f64 = parts().map(|part| part.weight).sum();
    let mean = |f: fn(&Metrics) -> f64| parts().map(|part| part.weight * f(part)).sum::<f64>() / weight;
    let mmse = mean(|part| part.mmse);
    goal.surplus_db(-10.0 * mmse.log10(), mean(|part| part.p99_hu * part.p99_hu).sqrt())
}

/// Returns log₂ of the density at which nothing is lacking, from trials (log₂ of the density, surplus in dB).
fn answer(tried: &[(f64, f64)]) -> f64 {
    let Some(&(x, surplus)) = tried.last() else { return FIRST.log2() };
    let before = tried.iter().rev().skip(1).find(|(other, _)| (other - x).abs() > NEAR);
    // Between two trials the answer is where a line meets it, however steep; beyond them no slope is believed that
    // is far from the usual.
    let slope = before.map_or(SLOPE, |&(other, there)| {
        let slope = (surplus - there) / (x - other);
        let between =
            surplus.is_finite() && there.is_finite() && (surplus > 0.0) != (there > 0.0) && slope > 0.0;
        if between { slope } else { slope.clamp(SLOPES[0], SLOPES[1]) }
    });
    // Where the surplus is infinite, the fit is exact; NaN would be a trial that failed.
    let step = -surplus / slope;
    let step = if step.is_nan() { 0.0 } else { step.clamp(-STEP, STEP) };
    (x + step).clamp(DENSITIES.start.log2(), DENSITIES.end.log2())
}

/// Returns the value of a table at `x`, linear in log x between its rows and constant beyond them.
fn interpolated(table: &[(f64, f64)], x: f64) -> f64 {
    let (first, last) = (table[0], table[table.len() - 1]);
    let Some(pair) = table.windows(2).find(|pair| (pair[0].0..=pair[1].0).contains(&x)) else {
        return if x < first.0 { first.1 } else { last.1 };
    };
    let t = (x / pair[0].0).ln() / (pair[1].0 / pair[0].0).ln();
    pair[0].1 + t * (pair[1].1 - pair[0].1)
}

/// Returns the voxels of a region at which the sum of the mask, x fastest, reaches each of `sums`, which rise.
fn voxels_at(roi: &Roi, sums: impl Iterator<Item = f64>) -> impl Iterator<Item = [usize; 3]> {
    let mut weights = roi.weight.iter().enumerate();
    let (mut sum, mut at) = (0.0, 0);
    let [nx, ny, _] = roi.size;
    sums.map(move |wanted| {
        while sum < wanted
            && let Some((index, &weight)) = weights.next()
        {
            sum += f64::from(weight);
            at = index;
        }
        [at % nx, at / nx % ny, at / (nx * ny)]
    })
}

/// Returns first voxel and size of the smallest box around `centre` that holds enough of the region.
fn box_around(roi: &Roi, centre: [usize; 3]) -> ([usize; 3], [usize; 3]) {
    let [least, step, most] = HALF_EDGES;
    let mut half = least;
    loop {
        let first = centre.map(|c| c.saturating_sub(half));
        let size = std::array::from_fn(|k| (centre[k] + half).min(roi.size[k]) - first[k]);
        if half >= most || roi.cropped(first, size).weight_sum() >= PART_VOXELS {
            return (first, size);
        }
        half += step;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_answer_lies_where_two_trials_point() {
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        assert!(near(answer(&[(-4.0, -3.5)]), -3.0), "one trial: the usual slope");
        assert!(near(answer(&[(-4.0, 1e9)]), -6.0), "no step is longer than two doublings");
        assert!(near(answer(&[(-4.0, f64::INFINITY)]), -6.0) && near(answer(&[(-4.0, f64::NAN)]), -4.0));
        assert!(near(answer(&[(-4.0, 4.0), (-5.0, 2.0)]), -6.0), "2 dB a doubling");
        assert!(near(answer(&[(-4.0, 4.0), (-5.0, 4.0)]), -7.0), "a slope of 0 is not believed");
        assert!(near(answer(&[(-3.0, -10.0), (-2.0, 10.0)]), -2.5), "between two trials, however steep");
        assert!(near(answer(&[(-3.0, -0.1), (-2.0, 0.1)]), -2.5), "or flat");
        assert!(
            near(answer(&[(-4.0, -20.0), (-3.0, -10.0)]), -1.75),
            "beyond them 10 dB a doubling are not believed"
        );
        assert!(near(answer(&[(-0.5, -9.0)]), 0.0), "no more than one a voxel");
    }

    #[test]
    fn a_table_is_interpolated_between_its_rows() {
        assert_eq!(interpolated(&LACKS, 0.001), 0.7);
        assert_eq!(interpolated(&LACKS, 7.0), 2.3);
        assert_eq!(interpolated(&LACKS, 0.1), 1.3);
        assert!((interpolated(&LACKS, (0.1f64 * 0.2).sqrt()) - 1.8).abs() < 1e-12);
    }

    #[test]
    fn parts_are_within_the_region() {
        let size = [90, 20, 70];
        let weight = (0..90 * 20 * 70).map(|i| f32::from(u8::from(i % 90 > 40))).collect();
        let roi = Roi { size, weight, soft: false };
        let half = roi.weight_sum() / 2.0;
        let found: Vec<_> = voxels_at(&roi, [0.5, half, 2.0 * half].into_iter()).collect();
        assert_eq!(found, [[41, 0, 0], [89, 19, 34], [89, 19, 69]]);
        for centre in found {
            let (first, size) = box_around(&roi, centre);
            assert!((0..3).all(|k| first[k] <= centre[k] && centre[k] < first[k] + size[k]));
            assert!(roi.cropped(first, size).weight_sum() >= PART_VOXELS, "{centre:?}: {size:?}");
        }
    }
}
