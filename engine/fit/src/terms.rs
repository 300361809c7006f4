//! The loss terms of a fit with their weights. The objective is a sum over samples, which suits Adam and f32:
//! only the ratio of the terms counts. With |ROI| the sum of the ROI's weights it is
//!
//! L = λ_ct/2 Σ m ((V̂ - V)² + t(V̂ - V)) + |ROI|/2 (λ_mask L_mask + λ_leak L_leak) + λ_occ/2 Σ max(|O - M| - τ, 0)².
//!
//! t is the tail of a fit that aims at an error of nearly all voxels (`loss_tail`), and 0 in others. τ is the tolerance of
//! a fit for the grid of a binary mask, and 0 in others.
//!
//! Without the last sum this is |ROI|/2 times the paper's equation (3) with the mean squared error as L_ct.

use shaders_glsl::types::Target;

use super::config::{FitConfig, row};
use super::targets::Scaling;
use base::error::Result;
use passes::loss::{DICE, INTENSITY_DICE, INTENSITY_KL, KL, LEAK, MSE, OCCUPANCY, SQUARE, TAIL, Weighted};
use volume::Roi;

/// Where a fit aims at an error of nearly all voxels, this part of it is s of the tail.
const TAIL_FROM: f32 = 0.5;

/// A way to compare masks or intensities, as a configuration names it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChosenLoss {
    /// Name in configurations.
    pub name: &'static str,
    /// Row of `passes::loss::TERMS`.
    pub term: usize,
    /// Factor of the configuration's smoothing. Tversky's loss with weights 1/2 is Dice with twice the
    /// smoothing.
    smoothing: f32,
    mean: Mean,
}

/// Divisor that turns the sum of a term into the loss that the weight applies to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mean {
    /// None: the term is a ratio already.
    None,
    /// The number of voxels of the region.
    Region,
    /// The number of slices of the volume, as in PyTorch's `batchmean` of a volume.
    Slices,
}

/// Ways to compare the predicted mask with the mask; the first is the default.
pub const MASK_LOSSES: &[ChosenLoss] = &[
    ChosenLoss { name: "dice", term: DICE, smoothing: 1.0, mean: Mean::None },
    ChosenLoss { name: "mse", term: SQUARE, smoothing: 0.0, mean: Mean::Region },
    ChosenLoss { name: "tversky", term: DICE, smoothing: 2.0, mean: Mean::None },
    ChosenLoss { name: "kl", term: KL, smoothing: 0.0, mean: Mean::Slices },
];

/// Ways to compare intensities; the first is the default.
pub const INTENSITY_LOSSES: &[ChosenLoss] = &[
    ChosenLoss { name: "mse", term: MSE, smoothing: 0.0, mean: Mean::Region },
    ChosenLoss { name: "dice", term: INTENSITY_DICE, smoothing: 1.0, mean: Mean::None },
    ChosenLoss { name: "tversky", term: INTENSITY_DICE, smoothing: 2.0, mean: Mean::None },
    ChosenLoss { name: "kl", term: INTENSITY_KL, smoothing: 0.0, mean: Mean::Slices },
];

impl FitConfig {
    /// Returns the row of the table that `mask_loss` names.
    pub fn mask_loss(&self) -> Result<&'static ChosenLoss> {
        row("mask_loss", &self.loss.mask, MASK_LOSSES, |row| row.name)
    }

    /// Returns the row of the table that `intensity_loss` names.
    pub fn intensity_loss(&self) -> Result<&'static ChosenLoss> {
        row("intensity_loss", &self.loss.intensity, INTENSITY_LOSSES, |row| row.name)
    }
}

/// Returns the number of voxels of the region as the mean intensity error counts them: the sum of the mask,
/// or all above the threshold.
pub(super) fn region_size(config: &FitConfig, roi: &Roi) -> f64 {
    match config.region.threshold {
        0.0 => roi.weight_sum(),
        t => roi.weight.iter().filter(|&&w| w > t).count() as f64,
    }
}

/// Returns the thickness of the shell, voxels: that of the configuration, if a term of what lies around the region has a
/// weight; 1 if only what is beside a binary region counts; else 0.
pub(super) fn shell(config: &FitConfig, roi: &Roi) -> u32 {
    let classified = config.is_classified(roi);
    let occupancy = if classified { 0.0 } else { config.loss.occupancy_weight };
    let beside = u32::from(config.has_rim(roi) || classified && config.loss.hold_weight > 0.0);
    let looked_at = [occupancy, config.loss.mask_weight, config.loss.leak_weight];
    if looked_at.iter().any(|&weight| weight > 0.0) { config.loss.shell.max(beside) } else { beside }
}

/// Returns Σ (1 - M) over the samples that take part, or, if the region has a threshold, the number of
/// samples outside it.
pub(super) fn outside(config: &FitConfig, targets: &[Target]) -> f64 {
    let part = |m: f64| match f64::from(config.region.threshold) {
        0.0 => 1.0 - m,
        t => f64::from(u8::from(m <= t)),
    };
    targets.iter().map(|t| f64::from(t.occupancy())).filter(|&m| m >= 0.0).map(part).sum()
}

/// Returns the terms that have a weight, and always the squared error, which every fit reports. `outside` is
/// Σ (1 - M) at the offset that the terms are for; it affects the weights but not which terms there are.
pub(super) fn weighted(config: &FitConfig, roi: &Roi, scaling: &Scaling, outside: f64) -> Vec<Weighted> {
    let size = region_size(config, roi);
    let of_region = |weight: f32, divisor: f64| {
        // With nothing outside nothing can leak.
        if divisor > 0.0 { (f64::from(weight) * size / divisor) as f32 } else { 0.0 }
    };
    let threshold = if config.region.threshold > 0.0 { config.region.threshold } else { -1.0 };
    let hard = if roi.soft || threshold > 0.0 { threshold } else { 0.5 };
    let low = scaling.value(scaling.range.0);
    let term = |term, weight| Weighted { term, weight, region: threshold, low, ..Weighted::default() };
    let chosen = |loss: &ChosenLoss, weight: f32| {
        let divisor = match loss.mean {
            Mean::None => 1.0,
            Mean::Region => size,
            Mean::Slices => roi.size[2] as f64,
        };
        let parameter = loss.smoothing * config.loss.dice_smoothing;
        Weighted { parameter, ..term(loss.term, of_region(weight, divisor)) }
    };
    // Names were checked with the configuration.
    let intensity = config.intensity_loss().unwrap_or(&INTENSITY_LOSSES[0]);
    let mask = config.mask_loss().unwrap_or(&MASK_LOSSES[0]);
    let of_mse = if intensity.term == MSE { config.loss.mse_weight } else { 0.0 };
    let rim = if config.has_rim(roi) { config.loss.rim_weight } else { 0.0 };
    let mut terms = vec![Weighted { region: hard, parameter: rim, ..term(MSE, of_mse) }];
    if of_mse > 0.0 && config.count.target_hu > 0.0 {
        let parameter = TAIL_FROM * config.count.target_hu / scaling.unit;
        terms.push(Weighted { region: hard, parameter, ..term(TAIL, of_mse) });
    }
    let weight = config.occupancy_weight(roi);
    if weight > 0.0 {
        let tolerance = if config.is_classified(roi) { config.loss.occupancy_tolerance } else { 0.0 };
        let occupancy = term(OCCUPANCY, weight);
        terms.push(Weighted { parameter: config.loss.occupancy_w0, tolerance, ..occupancy });
    }
    if intensity.term != MSE && config.loss.mse_weight > 0.0 {
        terms.push(chosen(intensity, config.loss.mse_weight));
    }
    if config.loss.mask_weight > 0.0 {
        terms.push(chosen(mask, config.loss.mask_weight));
    }
    if config.loss.leak_weight > 0.0 {
        let outside = if config.loss.leak_volume { roi.weight.len() as f64 - size } else { outside };
        let parameter = config.loss.leak_power as f32;
        terms.push(Weighted { parameter, ..term(LEAK, of_region(config.loss.leak_weight, outside)) });
    }
    terms
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::FitForm;
    use volume::Volume;

    #[test]
    fn weights_are_those_of_the_objective() {
        let volume = Volume::new([4, 1, 1], DAffine3::IDENTITY, vec![0.0; 4]);
        let roi = Roi::new(vec![1.0, 0.5, 1.0, 0.0], &volume).unwrap();
        let none = FitConfig::default().with(|c| {
            c.loss.mse_weight = 0.0;
            c.loss.occupancy_weight = 0.0;
            c.loss.mask_weight = 0.0;
            c.loss.leak_weight = 0.0;
        });
        let list = |config: &FitConfig, outside| -> Vec<_> {
            let scaling = Scaling::new(&volume, &roi, config);
            weighted(config, &roi, &scaling, outside).iter().map(|t| (t.term, t.weight)).collect()
        };
        assert_eq!(list(&none, 5.0), [(MSE, 0.0)], "the squared error is always reported");
        assert_eq!(shell(&none, &roi), 0, "nothing beside a soft region counts");
        let binary = Roi { soft: false, ..roi.clone() };
        assert_eq!(shell(&none, &binary), 1, "the rim, and what holds splats");
        let alone = none.clone().with(|c| {
            c.loss.rim_weight = 0.0;
            c.loss.hold_weight = 0.0;
        });
        assert_eq!(shell(&alone, &binary), 0);
        let all = FitConfig::default().with(|c| {
            c.loss.mse_weight = 2.0;
            c.loss.occupancy_weight = 3.0;
            c.samples.form = FitForm::Field;
            c.loss.mask_weight = 4.0;
            c.loss.leak_weight = 6.0;
        });
        assert_eq!(
            list(&all, 5.0),
            [(MSE, 2.0), (OCCUPANCY, 3.0), (DICE, 4.0 * 2.5), (LEAK, 6.0 * 2.5 / 5.0)]
        );
        let aims = none.clone().with(|c| {
            c.count.target_hu = 30.0;
            c.loss.mse_weight = 2.0;
        });
        assert_eq!(list(&aims, 5.0), [(MSE, 2.0), (TAIL, 2.0)]);
        assert_eq!(list(&all, 0.0)[3], (LEAK, 0.0), "nothing outside, nothing to leak into");
        for one in [
            none.clone().with(|c| {
                c.loss.occupancy_weight = 1.0;
                c.samples.form = FitForm::Field;
            }),
            none.clone().with(|c| c.loss.mask_weight = 1.0),
            none.clone().with(|c| c.loss.leak_weight = 1.0),
        ] {
            assert_eq!((shell(&one, &roi), list(&one, 1.0).len()), (one.loss.shell, 2));
        }
        let targets = [Target::new(0.0, 1.0), Target::IDLE, Target::new(0.5, 0.0), Target::new(0.0, 0.25)];
        assert!((outside(&none, &targets) - 1.75).abs() < 1e-4);
        let above = none.with(|c| c.region.threshold = 0.01);
        assert_eq!((outside(&above, &targets), region_size(&above, &roi)), (1.0, 3.0));
    }
}
