//! The 16-bit fractions in which intensities and masks are kept on the device.

/// Greatest value of a 16-bit fraction.
const STEPS: f64 = 65535.0;

/// The range of intensities that the fractions from 0 to 1 stand for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale {
    pub first: f64,
    pub span: f64,
}

impl Scale {
    /// Creates the scale for intensities from `low` to `high`. Multiples of `step` are kept as they are, if there are not
    /// too many.
    pub(super) fn of([low, high]: [f64; 2], step: Option<f64>) -> Self {
        if let Some(step) = step {
            let first = (low / step).floor() * step;
            let fractions = (STEPS / ((high - first) / step).max(1.0)).floor();
            if fractions >= 1.0 {
                return Scale { first, span: STEPS * step / fractions };
            }
        }
        let span = high - low;
        Scale { first: low, span: if span > 0.0 { span } else { 1.0 } }
    }

    pub(super) fn fraction(self, v: f32) -> u16 {
        ((f64::from(v) - self.first) / self.span * STEPS).round().clamp(0.0, STEPS) as u16
    }

    pub(super) fn value(self, fraction: u16) -> f64 {
        self.first + self.span * (f64::from(fraction) / STEPS)
    }
}

pub(super) fn to_fraction(m: f32) -> u16 {
    (f64::from(m) * STEPS).round().clamp(0.0, STEPS) as u16
}
