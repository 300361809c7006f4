//! How a picture is written: its size, what is behind it, and what is told on it.

use glam::DVec3;

/// Length of an inch, mm.
const INCH_MM: f64 = 25.4;

/// What is behind a picture that is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backing {
    /// The background of the window.
    #[default]
    AsShown,
    /// White, as paper.
    White,
    /// Nothing: what shows through depends on where the picture is put.
    Transparent,
}

/// How a picture is written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureOptions {
    /// Width and height, pixels.
    pub size: [u32; 2],
    /// Pixels per inch of the printed picture, which a PNG tells.
    pub dpi: u32,
    /// What is behind it.
    pub backing: Backing,
    /// True if letters, bars, cube, names and distances that the window shows are on it.
    pub told: bool,
}

impl Backing {
    /// All of them, with their names.
    pub const ALL: [(Backing, &'static str); 3] =
        [(Backing::AsShown, "as shown"), (Backing::White, "white"), (Backing::Transparent, "transparent")];

    /// Returns the colour behind a picture, where the window shows `shown`; `None` if it is transparent.
    pub fn colour(self, shown: DVec3) -> Option<DVec3> {
        match self {
            Backing::AsShown => Some(shown),
            Backing::White => Some(DVec3::ONE),
            Backing::Transparent => None,
        }
    }
}

impl PictureOptions {
    /// Creates options for a picture of the window.
    pub fn new(size: [u32; 2]) -> Self {
        PictureOptions { size, dpi: 300, backing: Backing::default(), told: true }
    }

    /// Returns width and height in print, mm.
    pub fn printed_mm(&self) -> [f64; 2] {
        self.size.map(|n| f64::from(n) / f64::from(self.dpi) * INCH_MM)
    }

    /// Gives it another width in print, mm, and the height that keeps its shape; neither exceeds `most` pixels.
    pub fn set_printed_width(&mut self, mm: f64, most: u32) {
        let [width, height] = self.size.map(f64::from);
        let wide = mm / INCH_MM * f64::from(self.dpi);
        let factor = (wide / width).min(f64::from(most) / width.max(height));
        self.size = [width, height].map(|n| (n * factor).round().max(1.0) as u32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_width_in_print_keeps_the_shape() {
        let mut options = PictureOptions::new([1200, 800]);
        assert!((options.printed_mm()[0] - 101.6).abs() < 1e-9);
        options.set_printed_width(85.0, 8192);
        assert_eq!(options.size, [1004, 669]);
        assert!((options.printed_mm()[0] - 85.0).abs() < 0.1);
        options.set_printed_width(9e9, 8192);
        assert_eq!(options.size[0], 8192);
        assert!(options.size[1].abs_diff(5461) <= 4, "{:?}", options.size);
    }

    #[test]
    fn what_is_behind() {
        let blue = DVec3::Z;
        assert_eq!(Backing::AsShown.colour(blue), Some(blue));
        assert_eq!(Backing::White.colour(blue), Some(DVec3::ONE));
        assert_eq!(Backing::Transparent.colour(blue), None);
    }
}
