//! The quality of a frame: what can change from one frame to the next without anything being created anew.

#[cfg(doc)]
use super::Settings;

/// Quality of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Edges of the picture as a part of those of the target, in whose upper left corner it lies: 0 to 1.
    pub resolution: f64,
    /// Distance of slabs or samples in units of [`Settings::step`], 1 or more.
    pub coarseness: f64,
}

impl Quality {
    /// Full quality of the settings.
    pub const FULL: Self = Quality { resolution: 1.0, coarseness: 1.0 };

    /// Returns the width and height of the picture in a target of `size`, pixels.
    ///
    /// # Panics
    /// If the quality is better than the target.
    pub fn size(&self, size: [u32; 2]) -> [u32; 2] {
        assert!(self.resolution <= 1.0 && self.coarseness >= 1.0, "better than the settings: {self:?}");
        size.map(|n| ((f64::from(n) * self.resolution).round() as u32).max(1))
    }
}
