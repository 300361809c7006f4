//! Pictures, and the limits of their size.

use base::memory;
use base::{Error, Kind, Result};

/// Most pixels that a picture may have when it is read or written: 16384 by 16384.
pub const MAX_PIXELS: usize = 1 << 28;

/// A picture: display-referred colour (sRGB-encoded numbers, 1 is the brightest) premultiplied by opacity.
///
/// Nothing is clamped before it is written as integers. A pixel of opacity 0 has no colour.
#[derive(Clone, Debug, PartialEq)]
pub struct Image {
    /// Width and height, pixels.
    pub size: [usize; 2],
    /// Red, green, blue, opacity; rows from the top, each from the left.
    pub pixels: Vec<[f32; 4]>,
}

impl Image {
    /// Creates a picture of one premultiplied colour.
    pub fn new(size: [usize; 2], colour: [f32; 4]) -> Self {
        Image { size, pixels: vec![colour; size[0] * size[1]] }
    }

    /// Returns the pixel in column `x` from the left and row `y` from the top.
    pub fn at(&self, x: usize, y: usize) -> [f32; 4] {
        self.pixels[y * self.size[0] + x]
    }

    /// Returns this picture over one opaque colour that is not premultiplied. The sRGB-encoded numbers are
    /// composited as they are, without linearisation, as VTK and Slicer do. The result is opaque.
    #[must_use]
    pub fn over(&self, background: [f32; 3]) -> Image {
        let over = |&[r, g, b, a]: &[f32; 4]| {
            let behind = background.map(|c| c * (1.0 - a));
            [r + behind[0], g + behind[1], b + behind[2], 1.0]
        };
        Image { size: self.size, pixels: self.pixels.iter().map(over).collect() }
    }
}

/// Refuses a picture without pixels or with more than [`MAX_PIXELS`], before anything is allocated for it.
pub(super) fn check_size(size: [usize; 2]) -> Result<()> {
    let [width, height] = size;
    match width.checked_mul(height) {
        Some(0) => Err(Error::new(Kind::BadData, "VGS-IMG-001", "the picture has no pixels")),
        Some(n) if n <= MAX_PIXELS => Ok(()),
        _ => {
            let message = format!("{width} x {height} pixels, more than the limit of {MAX_PIXELS}");
            Err(Error::new(Kind::BadData, "VGS-IMG-002", message).help("make the picture smaller"))
        }
    }
}

/// Returns an empty vector with room for `count` values, or an error if there is no memory for them: sizes
/// from files may be too large.
pub(super) fn room<T>(count: usize) -> Result<Vec<T>> {
    memory::require(count.saturating_mul(size_of::<T>()) as u64, "the picture")?;
    let mut values = Vec::new();
    values.try_reserve_exact(count).map_err(|_| {
        let bytes = count.saturating_mul(size_of::<T>());
        let message = format!("no memory for a picture: {bytes} bytes are needed");
        Error::new(Kind::HostMemory, "VGS-IMG-003", message)
    })?;
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_background_shows_where_the_picture_is_transparent() {
        let image = Image { size: [3, 1], pixels: vec![[0.0; 4], [0.2, 0.1, 0.0, 0.5], [1.0; 4]] };
        let over = image.over([0.5, 1.0, 0.0]);
        assert_eq!(over.size, [3, 1]);
        assert_eq!(over.at(0, 0), [0.5, 1.0, 0.0, 1.0]);
        assert_eq!(over.at(1, 0), [0.45, 0.6, 0.0, 1.0]);
        assert_eq!(over.at(2, 0), [1.0; 4]);
    }

    #[test]
    fn sizes_are_checked() {
        check_size([1 << 14, 1 << 14]).unwrap();
        for (size, code) in [
            ([0, 5], "VGS-IMG-001"),
            ([1 << 14, 1 + (1 << 14)], "VGS-IMG-002"),
            ([usize::MAX, 2], "VGS-IMG-002"),
        ] {
            assert_eq!(check_size(size).unwrap_err().code, code, "{size:?}");
        }
        assert_eq!(room::<[f32; 4]>(usize::MAX / 64).unwrap_err().kind, Kind::HostMemory);
    }
}
