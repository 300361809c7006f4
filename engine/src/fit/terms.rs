//! The loss terms of a fit with their weights. The objective is a sum over samples, as Adam and f32 like it: only the
//! ratio of the terms counts. With |ROI| the sum of the ROI's weights it is
//!
//! L = λ_ct/2 Σ m (V̂ - V)² + |ROI|/2 (λ_mask L_mask + λ_leak L_leak) + λ_occ/2 Σ (O - M)²,
//!
//! without the last sum |ROI|/2 times the paper's equation (3) with the mean squared error as L_ct.

use shaders_glsl::types::Target;

use super::FitConfig;
use crate::passes::loss::{DICE, LEAK, MSE, OCCUPANCY, Weighted};
use crate::volume::Roi;

/// Thickness of the shell, voxels: none where no term looks at it.
pub(super) fn shell(config: &FitConfig) -> u32 {
    let looked_at = [config.occupancy_weight, config.mask_weight, config.leak_weight];
    if looked_at.iter().any(|&weight| weight > 0.0) { config.shell } else { 0 }
}

/// Σ (1 - M) over the samples that take part.
pub(super) fn outside(targets: &[Target]) -> f64 {
    targets.iter().map(|t| f64::from(t.occupancy())).filter(|&m| m >= 0.0).map(|m| 1.0 - m).sum()
}

/// The terms that have a weight, and always the squared error, which every fit reports. `outside` is Σ (1 - M) at the
/// offset they are for; which terms there are does not depend on it.
pub(super) fn weighted(config: &FitConfig, roi: &Roi, outside: f64) -> Vec<Weighted> {
    let roi_size = roi.weight_sum();
    let of_roi = |weight: f32, divisor: f64| {
        // With nothing outside nothing can leak.
        if divisor > 0.0 { (f64::from(weight) * roi_size / divisor) as f32 } else { 0.0 }
    };
    let soft = f32::from(u8::from(roi.soft));
    let mut terms = vec![Weighted { term: MSE, weight: config.mse_weight, parameter: soft }];
    if config.occupancy_weight > 0.0 {
        let (weight, parameter) = (config.occupancy_weight, config.occupancy_w0);
        terms.push(Weighted { term: OCCUPANCY, weight, parameter });
    }
    if config.mask_weight > 0.0 {
        terms.push(Weighted { term: DICE, weight: of_roi(config.mask_weight, 1.0), parameter: 0.0 });
    }
    if config.leak_weight > 0.0 {
        terms.push(Weighted { term: LEAK, weight: of_roi(config.leak_weight, outside), parameter: 0.0 });
    }
    terms
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::volume::Volume;

    #[test]
    fn weights_are_those_of_the_objective() {
        let volume = Volume::new([4, 1, 1], DAffine3::IDENTITY, vec![0.0; 4]);
        let roi = Roi::new(vec![1.0, 0.5, 1.0, 0.0], &volume).unwrap();
        let none = FitConfig {
            mse_weight: 0.0,
            occupancy_weight: 0.0,
            mask_weight: 0.0,
            leak_weight: 0.0,
            ..FitConfig::default()
        };
        let list = |config: &FitConfig, outside| -> Vec<_> {
            weighted(config, &roi, outside).iter().map(|t| (t.term, t.weight)).collect()
        };
        assert_eq!(list(&none, 5.0), [(MSE, 0.0)], "the squared error is always reported");
        assert_eq!(shell(&none), 0);
        let all = FitConfig {
            mse_weight: 2.0,
            occupancy_weight: 3.0,
            mask_weight: 4.0,
            leak_weight: 6.0,
            ..FitConfig::default()
        };
        assert_eq!(
            list(&all, 5.0),
            [(MSE, 2.0), (OCCUPANCY, 3.0), (DICE, 4.0 * 2.5), (LEAK, 6.0 * 2.5 / 5.0)]
        );
        assert_eq!(list(&all, 0.0)[3], (LEAK, 0.0), "nothing outside, nothing to leak into");
        for one in [
            FitConfig { occupancy_weight: 1.0, ..none.clone() },
            FitConfig { mask_weight: 1.0, ..none.clone() },
            FitConfig { leak_weight: 1.0, ..none.clone() },
        ] {
            assert_eq!((shell(&one), list(&one, 1.0).len()), (one.shell, 2));
        }
        let targets = [Target::new(0.0, 1.0), Target::IDLE, Target::new(0.5, 0.0), Target::new(0.0, 0.25)];
        assert!((outside(&targets) - 1.75).abs() < 1e-4);
    }
}
