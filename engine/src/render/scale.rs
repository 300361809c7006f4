//! The 16-bit fractions that intensities and masks are kept as on the device.

/// Greatest value of a 16-bit fraction.
const STEPS: f64 = 65535.0;

/// Which intensities the fractions 0 and 1 stand for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale {
    pub first: f64,
    pub span: f64,
}

impl Scale {
    /// For intensities between two, which are whole numbers or not.
    pub(super) fn of([low, high]: [f64; 2], whole: bool) -> Self {
        let extent = high - low;
        let span = match whole && extent <= STEPS {
            true => STEPS / (STEPS / extent.max(1.0)).floor(),
            false => extent,
        };
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
