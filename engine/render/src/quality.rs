//! The quality of a frame: what can change from one frame to the next without anything being created anew.

#[cfg(doc)]
use super::Settings;

/// Quality of a frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    /// Edges of the picture as a part of those of the target, in whose upper left corner it lies: 0 to 1.
    pub resolution: f64,
    /// Distance of slabs or samples in units of [`Settings::step`], more than 0.
    pub coarseness: f64,
    /// True if ambient occlusion is shown, where a look has it and a mode knows it.
    pub occlusion: bool,
}

impl Quality {
    /// Full quality of the settings.
    pub const FULL: Self = Quality { resolution: 1.0, coarseness: 1.0, occlusion: true };

    /// Returns the quality at [`Settings::step`] `step` in which slabs or samples lie as far apart as in this
    /// one at a step of 1, but no nearer than the step.
    pub fn at_step(self, step: f64) -> Self {
        Quality { coarseness: (self.coarseness / step).max(1.0), ..self }
    }

    /// Returns the width and height of the picture in a target of `size`, pixels.
    ///
    /// # Panics
    /// If the picture is larger than the target, or slabs and samples lie nowhere.
    pub fn size(&self, size: [u32; 2]) -> [u32; 2] {
        assert!(self.resolution <= 1.0 && self.coarseness > 0.0, "better than the target: {self:?}");
        size.map(|n| ((f64::from(n) * self.resolution).round() as u32).max(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_keeps_its_distances_at_every_step_but_is_never_finer_than_the_step() {
        let level = |coarseness| Quality { resolution: 0.7, coarseness, occlusion: false };
        assert_eq!(level(2.0).at_step(0.5), level(4.0));
        assert_eq!(level(0.5).at_step(0.5), level(1.0));
        assert_eq!(level(0.5).at_step(3.0), level(1.0));
    }
}
