//! Defects of splats: what a file must not hold.

use super::{Splat, activation};

/// Returns why a file must not hold this splat, or `None` if it may.
pub fn defect(splat: &Splat) -> Option<&'static str> {
    let values: &[f32; 12] = bytemuck::cast_ref(splat);
    if !values.iter().all(|v| v.is_finite()) {
        Some("a value is not finite")
    } else if splat.rotation == [0.0; 4] {
        Some("its quaternion is zero")
    } else if splat.log_scale.iter().any(|log| log.abs() > activation::LOG_SCALE_LIMIT) {
        Some("its scale is out of range")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defects_are_found() {
        let good = Splat { rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
        let rows = [
            (good, true),
            (Splat { rotation: [0.0, 0.0, -0.0, 0.0], ..good }, false),
            (Splat { rotation: [0.0, 0.0, 1e-30, 0.0], ..good }, true),
            (Splat { mean: [0.0, f32::NAN, 0.0], ..good }, false),
            (Splat { opacity_logit: f32::NEG_INFINITY, ..good }, false),
            (Splat { log_scale: [0.0, -1e3, 0.0], ..good }, false),
            (Splat { log_scale: [0.0, 0.0, 1e3], ..good }, false),
            (Splat { intensity: f32::INFINITY, ..good }, false),
            (Splat { intensity: f32::MIN, ..good }, true),
        ];
        for (splat, usable) in rows {
            assert_eq!(defect(&splat).is_none(), usable, "{splat:?}");
        }
    }
}
