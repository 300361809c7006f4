//! A fit brought to another number of splats: some are added where the error is largest, or the least important
//! go, and all are fitted again.

use super::Fitter;
use super::going::{Going, iterate};
use super::rounding::config_after;
use super::run::Problem;
use base::error::Result;
use gpu::Gpu;
use splat::{Splat, by_importance};

/// Iterations after a change of the number.
const ITERATIONS: u32 = 100;
/// Rounds after which no goal comes nearer.
const MOST_ROUNDS: u32 = 20;
/// What a doubling of the number by added splats is worth, dB: less than of splats that were there from the
/// beginning.
const SLOPE: f64 = 2.5;
/// Least part of the splats that a first change adds; each further one adds at least twice that part.
const LEAST_ADDED: f64 = 0.05;
/// Most splats after a change, in parts of those before.
const MOST_TIMES: f64 = 1.9;

impl Problem<'_> {
    /// Brings fitted splats (voxel space, HU) to `count`, and fits them again. `going` hears how far
    /// that is. Waits for the device.
    ///
    /// # Errors
    /// Fails if the device fails.
    pub fn with_count(
        &self,
        gpu: &Gpu,
        splats: &[Splat],
        count: usize,
        going: &mut Going<'_>,
    ) -> Result<Vec<Splat>> {
        let mut kept: Vec<u32> = by_importance(splats, &self.field());
        kept.truncate(count);
        // The order of the file stays.
        kept.sort_unstable();
        let kept: Vec<Splat> = kept.into_iter().map(|i| splats[i as usize]).collect();
        let config = config_after(self.config(), &[], &kept).with(|c| {
            c.iterations = ITERATIONS;
            c.topology.name = "growth".to_owned();
            c.topology.from = 1;
            c.topology.until = 1;
            c.topology.every = 1;
            c.topology.share = 1.0;
            c.topology.limit = (count as f64 / kept.len().max(1) as f64).max(1.0) as f32;
        });
        let mut fitter = Fitter::new(gpu, self.volume(), self.roi(), &kept, &config)?;
        iterate(&mut fitter, ITERATIONS, going)?;
        fitter.splats()
    }

    /// Adds splats to fitted ones (voxel space, HU) where the error is largest until a goal is reached, or the
    /// configuration allows no more splats or no further round; splats that are good enough stay
    /// as they are. `surplus` measures splats as [`Goal::surplus_db`](super::Goal::surplus_db) does; `told` hears
    /// of each new number, and `going` how far each round is. Waits for the device.
    ///
    /// # Errors
    /// Fails if the device or `surplus` fails.
    pub fn brought_to_goal(
        &self,
        gpu: &Gpu,
        splats: Vec<Splat>,
        surplus: &mut dyn FnMut(&[Splat]) -> Result<f64>,
        told: &mut dyn FnMut(usize),
        going: &mut Going<'_>,
    ) -> Result<Vec<Splat>> {
        let mut splats = splats;
        let most = self.config().most_splats(self.native_voxels());
        for round in 0..self.config().count.target_rounds.min(MOST_ROUNDS) {
            let missed_db = -surplus(&splats)?;
            let least = 1.0 + LEAST_ADDED * 2f64.powi(round as i32);
            let times = (missed_db / SLOPE).exp2().clamp(least, MOST_TIMES);
            let count = ((splats.len() as f64 * times).ceil() as usize).min(most.max(splats.len()));
            let reached = missed_db.is_nan() || missed_db <= 0.0 || count == splats.len();
            if reached || going(0.0).is_break() {
                break;
            }
            told(count);
            splats = self.with_count(gpu, &splats, count, going)?;
        }
        Ok(splats)
    }
}
