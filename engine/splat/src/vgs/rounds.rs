//! Rounds splats to a lattice, one group of their parameters after the other.

use super::lattice::{CODE_LIMIT, Lattice};
use super::layers::Row;
use super::rounding::{Cells, Rounding, Steps};
use crate::Splat;

/// A group of parameters that are rounded together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Rotation and scales.
    Shape,
    /// The mean, whose steps follow from the rounded shape.
    Mean,
    /// The opacity.
    Opacity,
    /// The intensity.
    Intensity,
}

impl Rounding {
    /// Chooses fine steps, for splats that are rounded as they are: they cost a fit of 49 dB 0.2 dB, one of
    /// 60 dB 0.9.
    pub fn fine(splats: &[Splat]) -> Self {
        Rounding::with(splats, 0.02, 1.015, 0.03, 500.0)
    }

    /// Chooses steps for splats that are fitted again after they are rounded, and whose field is `error` (root
    /// mean square, in the unit of the intensities) off the scan: there coarser steps of more splats would be as good.
    pub fn for_error(splats: &[Splat], error: f64) -> Self {
        Rounding::of_share(splats, error / intensity_step(splats, 1.0))
    }

    /// Chooses steps as [`Rounding::for_error`] does before the error is known: those of a usual one.
    pub fn usual(splats: &[Splat]) -> Self {
        Rounding::of_share(splats, 0.01)
    }

    /// Chooses steps for an error of this part of the middle 96 % of the intensities.
    fn of_share(splats: &[Splat], share: f64) -> Self {
        // An error that is not a number is the least.
        let share = if share.is_nan() { 0.002 } else { share.clamp(0.002, 0.04) };
        let root = share.sqrt();
        Rounding::with(splats, 0.54 * root, 1.0 + 0.72 * root, 1.8 * root, 1.0 / (0.45 * share))
    }

    fn with(splats: &[Splat], mean: f64, ratio: f64, opacity: f64, intensities: f64) -> Self {
        let intensity = intensity_step(splats, intensities);
        Rounding { steps: Steps { mean, ratio, opacity, intensity }, cells: cells_of(splats) }
    }

    /// Rounds one group of parameters of each splat; means are counted from the cells that suit them as they
    /// are now. Splats that are rounded stay as they are, and so do those that no lattice holds.
    pub fn round(&mut self, splats: &mut [Splat], group: Group) {
        let Some(lattice) = Lattice::new(self.steps) else { return };
        if group == Group::Mean {
            self.cells = cells_of(splats);
        }
        for splat in splats {
            let row = Row::of(splat, 0, &lattice, &self.cells);
            let Some((rounded, _)) = row.and_then(|row| row.splat(&lattice, &self.cells)) else { continue };
            group.copy(&rounded, splat);
        }
    }
}

impl Group {
    /// Copies this group of parameters from one splat to another.
    pub fn copy(self, from: &Splat, to: &mut Splat) {
        match self {
            Group::Shape => (to.rotation, to.log_scale) = (from.rotation, from.log_scale),
            Group::Mean => to.mean = from.mean,
            Group::Opacity => to.opacity_logit = from.opacity_logit,
            Group::Intensity => to.intensity = from.intensity,
        }
    }
}

fn cells_of(splats: &[Splat]) -> Cells {
    Cells::of(&splats.iter().map(|splat| splat.mean).collect::<Vec<_>>())
}

/// Returns the step that divides the span of the intensities into this many.
fn intensity_step(splats: &[Splat], count: f64) -> f64 {
    let mut intensities: Vec<f32> = splats.iter().map(|splat| splat.intensity).collect();
    intensities.sort_unstable_by(f32::total_cmp);
    let at = |share: usize| intensities.get(intensities.len() * share / 100).copied().unwrap_or(0.0);
    // A few far intensities do not make the steps coarse.
    let span = f64::from(at(98)) - f64::from(at(2));
    let step = if span > 0.0 { (span / count).clamp(1e-20, 1e20) } else { 1.0 };
    // An intensity far beyond the span still has a code.
    let greatest = splats.iter().map(|splat| f64::from(splat.intensity.abs())).fold(0.0, f64::max);
    step.max(greatest / f64::from(CODE_LIMIT))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_follow_the_error() {
        let splats: Vec<Splat> =
            (0..100u8).map(|i| Splat { intensity: f32::from(i) * 10.0, ..Splat::default() }).collect();
        let steps = [f64::NAN, 0.0, 5.0, 20.0, 1e9, f64::INFINITY]
            .map(|error| Rounding::for_error(&splats, error).steps);
        assert!(steps.is_sorted_by(|a, b| a.mean <= b.mean && a.intensity <= b.intensity));
        assert!(steps[2].ratio < steps[3].ratio && (steps[3].intensity - 9.0).abs() < 0.2);
        assert!(steps.iter().all(|&steps| Lattice::new(steps).is_some()));
    }
}
