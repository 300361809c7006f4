//! Slices through the data, as radiologists see them: axial, coronal and sagittal, and the crosshair where they
//! meet.
//!
//! Spaces: world, mm RAS; *pixels* of a slice count from its upper left corner, right and down. The patient's right
//! is at the left of an axial and of a coronal slice, the front at the left of a sagittal one.

use std::ops::Range;

use glam::{DVec2, DVec3};

/// A plane in which slices are seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SlicePlane {
    /// Across the body's axis.
    Axial,
    /// Across the direction from front to back.
    Coronal,
    /// Across the direction from side to side.
    Sagittal,
}

impl SlicePlane {
    /// All planes, in the order in which they are shown.
    pub const ALL: [SlicePlane; 3] = [SlicePlane::Axial, SlicePlane::Coronal, SlicePlane::Sagittal];

    /// Returns its name.
    pub fn name(self) -> &'static str {
        match self {
            SlicePlane::Axial => "Axial",
            SlicePlane::Coronal => "Coronal",
            SlicePlane::Sagittal => "Sagittal",
        }
    }

    /// Returns the letters of the patient's sides at the left, right, upper and lower border.
    pub fn letters(self) -> [&'static str; 4] {
        match self {
            SlicePlane::Axial => ["R", "L", "A", "P"],
            SlicePlane::Coronal => ["R", "L", "S", "I"],
            SlicePlane::Sagittal => ["A", "P", "S", "I"],
        }
    }

    /// Returns the world's axes that run against the right, against the downward and along the viewing direction of
    /// a slice: all of RAS fall from left to right and from top to bottom.
    pub fn axes(self) -> [usize; 3] {
        match self {
            SlicePlane::Axial => [0, 1, 2],
            SlicePlane::Coronal => [0, 2, 1],
            SlicePlane::Sagittal => [1, 2, 0],
        }
    }

    /// Returns width and height of a slice through a box (least and greatest corner, mm RAS), mm.
    pub fn extent_mm(self, bounds: [DVec3; 2]) -> DVec2 {
        let [u, v, _] = self.axes();
        let size = bounds[1] - bounds[0];
        DVec2::new(size[u], size[v])
    }

    /// Returns the point (mm RAS) at a place of the slice through `through`, in fractions of its width and height.
    pub fn point(self, place: DVec2, through: DVec3, bounds: [DVec3; 2]) -> DVec3 {
        let [u, v, _] = self.axes();
        let mut at = through;
        at[u] = bounds[1][u] - place.x * (bounds[1][u] - bounds[0][u]);
        at[v] = bounds[1][v] - place.y * (bounds[1][v] - bounds[0][v]);
        at
    }

    /// Returns the place of a point (mm RAS) in a slice, in fractions of its width and height.
    pub fn place(self, at: DVec3, bounds: [DVec3; 2]) -> DVec2 {
        let [u, v, _] = self.axes();
        let part = |k: usize| (bounds[1][k] - at[k]) / (bounds[1][k] - bounds[0][k]).max(f64::MIN_POSITIVE);
        DVec2::new(part(u), part(v))
    }

    /// Returns width and height in pixels of a slice whose longer side has `longer` pixels.
    pub fn pixels(self, bounds: [DVec3; 2], longer: usize) -> [usize; 2] {
        let extent = self.extent_mm(bounds);
        let scale = longer as f64 / extent.max_element().max(f64::MIN_POSITIVE);
        [extent.x, extent.y].map(|mm| ((mm * scale).round() as usize).clamp(1, longer.max(1)))
    }

    /// Returns the intensities of a slice through `through`, row by row from the top; NaN where there are none.
    pub fn intensities(
        self,
        through: DVec3,
        bounds: [DVec3; 2],
        [width, height]: [usize; 2],
        sample: &dyn Fn(DVec3) -> Option<f64>,
    ) -> Vec<f32> {
        let places = (0..width * height).map(|i| {
            let (x, y) = ((i % width) as f64 + 0.5, (i / width) as f64 + 0.5);
            DVec2::new(x / width as f64, y / height as f64)
        });
        places.map(|p| sample(self.point(p, through, bounds)).map_or(f32::NAN, |v| v as f32)).collect()
    }
}

/// Returns the grey of an intensity in a window (least and greatest intensity), 0 to 255; 0 where there is none.
pub fn grey(intensity: f32, window: [f64; 2]) -> u8 {
    let [low, high] = window;
    let part = (f64::from(intensity) - low) / (high - low).max(f64::MIN_POSITIVE);
    // The conversion of NaN is 0.
    (part.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// Intensities of bone and soft tissue, within which a CT is looked at, HU.
const CT: Range<f64> = -200.0..800.0;

/// Returns the window with which slices of data of this range are seen at first.
pub fn first_window(range: [f64; 2], is_ct: bool) -> [f64; 2] {
    let [low, high] = range;
    let window = if is_ct { [low.max(CT.start), high.min(CT.end)] } else { range };
    if window[0] < window[1] { window } else { [low, high.max(low + 1.0)] }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: [DVec3; 2] = [DVec3::new(-10.0, -20.0, -40.0), DVec3::new(30.0, 60.0, 100.0)];

    #[test]
    fn slices_lie_as_radiologists_see_them() {
        let at = DVec3::new(1.0, 2.0, 3.0);
        for (plane, left_top, right_bottom) in [
            (SlicePlane::Axial, DVec3::new(30.0, 60.0, 3.0), DVec3::new(-10.0, -20.0, 3.0)),
            (SlicePlane::Coronal, DVec3::new(30.0, 2.0, 100.0), DVec3::new(-10.0, 2.0, -40.0)),
            (SlicePlane::Sagittal, DVec3::new(1.0, 60.0, 100.0), DVec3::new(1.0, -20.0, -40.0)),
        ] {
            assert_eq!(plane.point(DVec2::ZERO, at, BOUNDS), left_top, "{}", plane.name());
            assert_eq!(plane.point(DVec2::ONE, at, BOUNDS), right_bottom, "{}", plane.name());
            let place = DVec2::new(0.2, 0.7);
            assert!(plane.place(plane.point(place, at, BOUNDS), BOUNDS).distance(place) < 1e-12);
        }
        assert_eq!(SlicePlane::Axial.letters(), ["R", "L", "A", "P"], "x grows to the right of the patient");
    }

    #[test]
    fn a_slice_has_the_intensities_at_its_pixels() {
        let sample = |x: DVec3| (x.z < 90.0).then_some(x.x + 1000.0 * x.z);
        let size = SlicePlane::Coronal.pixels(BOUNDS, 140);
        assert_eq!(size, [40, 140], "a pixel a mm");
        let found = SlicePlane::Coronal.intensities(DVec3::ZERO, BOUNDS, size, &sample);
        assert_eq!(found.len(), 40 * 140);
        assert!(found[..400].iter().all(|v| v.is_nan()), "nothing above 90 mm");
        assert_eq!(found[400], 29.5 + 1000.0 * 89.5, "the patient's right is at the left");
        assert_eq!(found[40 * 140 - 1], -9.5 - 1000.0 * 39.5);
        assert_eq!(SlicePlane::Axial.pixels([DVec3::ZERO, DVec3::ZERO], 100), [1, 1], "a point");
    }

    #[test]
    fn a_window_has_grey_from_black_to_white() {
        let window = [0.0, 100.0];
        assert_eq!([-5.0, 0.0, 50.0, 100.0, 900.0].map(|v| grey(v, window)), [0, 0, 128, 255, 255]);
        assert_eq!(grey(f32::NAN, window), 0);
        assert_eq!(grey(1.0, [1.0, 1.0]), 0);
        assert_eq!(first_window([-1024.0, 3000.0], true), [-200.0, 800.0]);
        assert_eq!(first_window([-1024.0, -500.0], true), [-1024.0, -500.0], "lungs");
        assert_eq!(first_window([0.0, 9.0], false), [0.0, 9.0]);
        assert_eq!(first_window([5.0, 5.0], false), [5.0, 6.0]);
    }
}
