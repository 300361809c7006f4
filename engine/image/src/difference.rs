//! The picture of a comparison: both pictures and a map of their differences side by side, with a colour bar.

use super::annotate::round_up;
use super::flip::Flip;
use super::image::{Image, check_size};
use super::lettering::{Align, line_height, shortened, text_width};
use super::measure::check_sizes;
use base::Result;

/// A map with one difference for each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct DifferenceMap {
    /// The measure that is mapped, as the heading above the map.
    pub name: String,
    /// One value for each pixel, in the order of the pixels.
    pub values: Vec<f32>,
    /// The value at the bright end of the colour bar; the dark end is 0.
    pub greatest: f64,
}

impl DifferenceMap {
    /// Creates the map of a FLIP comparison, on its own scale from 0 to 1.
    pub fn flip(flip: &Flip) -> Self {
        DifferenceMap { name: "FLIP".into(), values: flip.map.clone(), greatest: 1.0 }
    }

    /// Creates the map of |A - B|, the greatest of red, green and blue. The bright end of the scale is the
    /// least round value that is not exceeded.
    ///
    /// # Errors
    /// [`Kind::Usage`](base::Kind::Usage) for pictures of different sizes.
    pub fn absolute(a: &Image, b: &Image) -> Result<Self> {
        check_sizes(a, b)?;
        let value = |(p, q): (&[f32; 4], &[f32; 4])| (0..3).map(|i| (p[i] - q[i]).abs()).fold(0.0, f32::max);
        let values: Vec<f32> = a.pixels.iter().zip(&b.pixels).map(value).collect();
        let greatest = round_up(f64::from(values.iter().copied().fold(0.0, f32::max))).unwrap_or(1.0);
        Ok(DifferenceMap { name: "|A-B|".into(), values, greatest })
    }
}

const MARGIN: usize = 16;
/// Size of letters, pixels.
const LETTERS: f32 = 18.0;
/// Least width of a panel, pixels, so that there is room for letters.
const PANEL: usize = 160;
const BAR: [usize; 2] = [256, 12];
const BACKGROUND: [f32; 4] = [0.08, 0.08, 0.09, 1.0];
const TEXT: [f32; 3] = [0.92; 3];

/// Draws A, B and the map from left to right: A and B over black, under their names, and the map in the
/// colours of magma over its colour bar.
///
/// # Errors
/// [`Kind::Usage`](base::Kind::Usage) for pictures of different sizes,
/// [`Kind::BadData`](base::Kind::BadData) if the picture would be too large.
///
/// # Panics
/// If the map is of another size.
pub fn difference_picture(a: &Image, b: &Image, names: [&str; 2], map: &DifferenceMap) -> Result<Image> {
    check_sizes(a, b)?;
    assert_eq!(map.values.len(), a.pixels.len(), "a map of these pictures");
    let [width, height] = a.size;
    let panel = width.max(PANEL);
    let line = line_height(LETTERS);
    let top = MARGIN + line + 8;
    let size = [4 * MARGIN + 3 * panel, top + height + 10 + BAR[1] + 8 + line + MARGIN];
    check_size(size)?;
    let magma = nv_flip::magma_lut().to_vec();
    let colour = |share: f64| {
        let index = (share.clamp(0.0, 1.0) * 255.0).round() as usize; // NaN is 0.
        [0, 1, 2].map(|i| f32::from(magma[3 * index + i]) / 255.0)
    };

    let mut out = Image::new(size, BACKGROUND);
    let left = |i: usize| MARGIN + i * (panel + MARGIN);
    for (i, name) in [names[0], names[1], &map.name].into_iter().enumerate() {
        let name = shortened(name, LETTERS, panel);
        out.text([left(i) + panel / 2, MARGIN], LETTERS, Align::Middle, TEXT, &name);
    }
    let inset = (panel - width) / 2;
    for (index, value) in map.values.iter().enumerate() {
        let [x, y] = [index % width, index / width];
        for (i, [r, g, b, _]) in [a.pixels[index], b.pixels[index]].into_iter().enumerate() {
            out.put(left(i) + inset + x, top + y, [r, g, b]);
        }
        out.put(left(2) + inset + x, top + y, colour(f64::from(*value) / map.greatest));
    }

    let bar = BAR[0].min(panel - text_width("0", LETTERS));
    let (start, y) = (left(2) + (panel - bar) / 2, top + height + 10);
    for column in 0..bar {
        out.fill([start + column, y], [1, BAR[1]], colour(column as f64 / (bar - 1) as f64));
    }
    let below = y + BAR[1] + 8;
    out.text([start, below], LETTERS, Align::Left, TEXT, "0");
    out.text([start + bar, below], LETTERS, Align::Right, TEXT, &format!("{}", map.greatest));
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair() -> [Image; 2] {
        let a = Image::new([200, 50], [0.25, 0.5, 0.75, 1.0]);
        let mut b = a.clone();
        b.pixels[30 * 200 + 120][1] = 0.53;
        [a, b]
    }

    #[test]
    fn panels_hold_both_pictures_and_the_map() {
        let [a, b] = pair();
        let map = DifferenceMap::absolute(&a, &b).unwrap();
        assert_eq!(map.greatest, 0.05);
        let picture = difference_picture(&a, &b, ["a.png", &"b".repeat(99)], &map).unwrap();
        let top = MARGIN + line_height(LETTERS) + 8;
        let at = |panel: usize, x: usize, y: usize| picture.at(MARGIN + panel * (200 + MARGIN) + x, top + y);
        assert_eq!([at(0, 120, 30), at(1, 120, 30)], [a.at(120, 30), b.at(120, 30)]);
        assert_eq!(at(1, 119, 30), b.at(119, 30));
        // Magma goes from black to a pale yellow; 0.03 of 0.05 lies between.
        let light = |[r, g, b, _]: [f32; 4]| r + g + b;
        assert!(light(at(2, 119, 30)) < 0.1 && (1.0..2.5).contains(&light(at(2, 120, 30))));
        let bar = |share: usize| picture.at(MARGIN + 2 * (200 + MARGIN) + 11 + share, top + 50 + 15);
        assert!(light(bar(0)) < 0.1 && light(bar(170)) > 2.0, "{:?} {:?}", bar(0), bar(170));
    }

    #[test]
    fn small_and_equal_pictures_have_a_picture_too() {
        for size in [[1, 1], [5, 300]] {
            let image = Image::new(size, [0.1, 0.2, 0.3, 1.0]);
            let map = DifferenceMap::absolute(&image, &image).unwrap();
            assert_eq!(map.greatest, 1.0);
            let picture = difference_picture(&image, &image, ["A", "B"], &map).unwrap();
            assert_eq!(picture.pixels.len(), picture.size[0] * picture.size[1]);
        }
        let [a, b] = pair();
        let flip = crate::flip(&a, &b).unwrap();
        let map = DifferenceMap::flip(&flip);
        assert_eq!((map.greatest, &map.values), (1.0, &flip.map));
        let wide = Image::new([1, 4], [0.0; 4]);
        assert_eq!(difference_picture(&a, &wide, ["", ""], &map).unwrap_err().code, "VGS-IMG-030");
    }
}
