//! Annotations of medical pictures: how the patient lies, and a scale bar.

use glam::DVec3;

use super::lettering::{Align, text_width};
use super::{Image, font};

/// Least component along an axis for which a direction gets the letter of that axis: sin 15°.
const OBLIQUE: f64 = 0.258_819_045_102_520_74;

/// What [`annotate`] writes on a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Annotation {
    /// Letters at the left, right, top and bottom border; `None` if it is unknown how the patient lies.
    pub labels: Option<[String; 4]>,
    /// Millimetres per pixel in the plane that the viewer looks at; `None` for no scale bar.
    pub mm_per_pixel: Option<f64>,
}

/// Returns the letters of the patient's sides at the left, right, top and bottom border of a picture, from
/// the directions to its right and upwards in RAS.
///
/// A direction along an axis has one letter (R or L, A or P, S or I); an oblique one has up to three, the
/// nearest axis first, as in "LA"; axes that it leaves by less than 15° are not named. A zero or broken
/// vector has no letters.
pub fn orientation_labels(right: DVec3, up: DVec3) -> [String; 4] {
    [-right, right, up, -up].map(direction_label)
}

fn direction_label(direction: DVec3) -> String {
    let Some(direction) = direction.try_normalize() else { return String::new() };
    let mut parts: Vec<(f64, char)> = (direction.to_array().into_iter())
        .zip([('R', 'L'), ('A', 'P'), ('S', 'I')])
        .map(|(part, (positive, negative))| (part.abs(), if part > 0.0 { positive } else { negative }))
        .filter(|(part, _)| *part >= OBLIQUE)
        .collect();
    // Equal parts stay in the order of the axes.
    parts.sort_by(|a, b| b.0.total_cmp(&a.0));
    parts.into_iter().map(|(_, letter)| letter).collect()
}

/// Returns the greatest of 1, 2 and 5 times a power of ten that is at most `value`; `None` unless `value` is
/// a positive number.
pub fn round_down(value: f64) -> Option<f64> {
    near(value).filter(|round| *round <= value).last()
}

/// Returns the least of 1, 2 and 5 times a power of ten that is at least `value`; `None` unless `value` is a
/// positive number.
pub fn round_up(value: f64) -> Option<f64> {
    near(value).find(|round| *round >= value)
}

/// Returns round numbers around `value`, ascending; none unless `value` is a positive number.
fn near(value: f64) -> impl Iterator<Item = f64> {
    let decade = (value.is_finite() && value > 0.0).then(|| value.log10().floor() as i32);
    decade.into_iter().flat_map(|decade| {
        // Decimal text gives the nearest double, products of powers do not.
        let round = move |(digit, decade): (u8, i32)| format!("{digit}e{decade}").parse::<f64>();
        let digits = (decade - 1..=decade + 1).flat_map(|decade| [1, 2, 5].map(|digit| (digit, decade)));
        digits.filter_map(move |n| round(n).ok()).filter(|n| *n > 0.0 && n.is_finite())
    })
}

/// Writes the letters at the borders and draws a scale bar at the bottom left, whose length is round and at
/// most a quarter of the width. A bar or letters that do not fit are left out.
pub fn annotate(image: &mut Image, annotation: &Annotation) {
    let [width, height] = image.size;
    let scale = (width.min(height) / 240).clamp(1, 12);
    let (margin, letter) = (4 * scale, font::HEIGHT * scale);
    if height < 4 * (letter + margin) {
        return;
    }
    if let Some([left, right, top, bottom]) = &annotation.labels {
        let (middle, row) = (width / 2, (height - letter) / 2);
        let last = height - margin - letter;
        for (at, align, text) in [
            ([margin, row], Align::Left, left),
            ([width - margin.min(width), row], Align::Right, right),
            ([middle, margin], Align::Middle, top),
            ([middle, last], Align::Middle, bottom),
        ] {
            if text_width(text, scale) + 2 * margin <= width / 3 {
                image.outlined_text(at, scale, align, text);
            }
        }
    }
    let bar = annotation.mm_per_pixel.and_then(|mm| scale_bar(mm, width));
    if let Some((length, text)) = bar.filter(|(_, text)| text_width(text, scale) + 2 * margin <= width / 2) {
        let (bottom, tick) = (height - margin, 3 * scale);
        let bar = [
            ([margin, bottom - tick], [scale, tick]),
            ([margin + length - scale.min(length), bottom - tick], [scale, tick]),
            ([margin, bottom - 2 * scale], [length, scale]),
        ];
        for ([x, y], [w, h]) in bar {
            image.fill([x - scale, y - scale], [w + 2 * scale, h + 2 * scale], [0.0; 3]);
        }
        for (at, size) in bar {
            image.fill(at, size, [1.0; 3]);
        }
        image.outlined_text([margin, bottom - tick - 2 * scale - letter], scale, Align::Left, &text);
    }
}

/// Returns the length in pixels and the label of the scale bar for a picture of `width` pixels: a round
/// length of at most a quarter of the width. `None` if there is no such length of a pixel or more.
pub fn scale_bar(mm_per_pixel: f64, width: usize) -> Option<(usize, String)> {
    let mm = round_down(mm_per_pixel * width as f64 / 4.0)?;
    let pixels = (mm / mm_per_pixel).round();
    (pixels >= 1.0).then(|| (pixels as usize, format!("{mm} mm")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn borders_are_named_after_the_patients_sides() {
        let rows = [
            // From the front: the patient's left is at the right.
            (DVec3::new(-1.0, 0.0, 0.0), DVec3::Z, ["R", "L", "S", "I"]),
            // From the patient's left: the front is at the left.
            (DVec3::new(0.0, -2.0, 0.0), DVec3::Z, ["A", "P", "S", "I"]),
            // From below, as slices are shown.
            (DVec3::new(-1.0, 0.0, 0.0), DVec3::Y, ["R", "L", "A", "P"]),
            (DVec3::new(-0.8, 0.6, 0.0), DVec3::Z, ["RP", "LA", "S", "I"]),
            (DVec3::new(-0.6, 0.8, 0.0), DVec3::Z, ["PR", "AL", "S", "I"]),
            // 14° are not named, 16° are.
            (DVec3::new(-0.9703, 0.2419, 0.0), DVec3::Z, ["R", "L", "S", "I"]),
            (DVec3::new(-0.9613, 0.2756, 0.0), DVec3::Z, ["RP", "LA", "S", "I"]),
            (DVec3::new(1.0, 1.0, 1.0), DVec3::ZERO, ["LPI", "RAS", "", ""]),
            (DVec3::NAN, DVec3::Y, ["", "", "A", "P"]),
        ];
        for (right, up, expected) in rows {
            assert_eq!(orientation_labels(right, up), expected, "{right} {up}");
        }
    }

    #[test]
    fn round_lengths() {
        for (value, down, up) in [
            (1.0, 1.0, 1.0),
            (1.99, 1.0, 2.0),
            (49.0, 20.0, 50.0),
            (50.0, 50.0, 50.0),
            (999.0, 500.0, 1000.0),
            (1000.0, 1000.0, 1000.0),
            (0.07, 0.05, 0.1),
            (0.002, 0.002, 0.002),
            (1e-300, 1e-300, 1e-300),
        ] {
            assert_eq!((round_down(value), round_up(value)), (Some(down), Some(up)), "{value}");
        }
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!((round_down(value), round_up(value)), (None, None), "{value}");
        }
    }

    #[test]
    fn a_scale_bar_has_its_length() {
        for (mm_per_pixel, width, expected) in [
            (1.0, 400, (100, "100 mm")),
            (0.3, 400, (67, "20 mm")),
            (0.001, 400, (100, "0.1 mm")),
            (2.5, 100, (20, "50 mm")),
        ] {
            let (pixels, text) = scale_bar(mm_per_pixel, width).unwrap();
            assert_eq!((pixels, text.as_str()), expected, "{mm_per_pixel} {width}");
        }
        for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(scale_bar(wrong, 400), None);
        }

        let mut image = Image::new([400, 300], [0.5, 0.5, 0.5, 1.0]);
        annotate(&mut image, &Annotation { labels: None, mm_per_pixel: Some(1.0) });
        let white = |y: usize| (0..400).filter(|&x| image.at(x, y) == [1.0; 4]).collect::<Vec<_>>();
        let longest = (0..300).map(white).max_by_key(Vec::len).unwrap();
        assert_eq!(longest, (4..104).collect::<Vec<_>>());
    }

    #[test]
    fn letters_are_at_their_borders() {
        let plain = Image::new([300, 240], [0.5; 4]);
        let labels = ["R", "L", "S", "I"].map(str::to_owned);
        for (i, [x, y]) in [[6, 120], [293, 120], [150, 8], [150, 232]].into_iter().enumerate() {
            let mut only: [String; 4] = Default::default();
            only[i].clone_from(&labels[i]);
            let mut image = plain.clone();
            annotate(&mut image, &Annotation { labels: Some(only), mm_per_pixel: None });
            let changed: Vec<usize> =
                (0..plain.pixels.len()).filter(|&p| image.pixels[p] != plain.pixels[p]).collect();
            assert!(changed.len() > 20, "border {i}");
            let far = |p: usize| (p % 300).abs_diff(x).max((p / 300).abs_diff(y));
            assert!(changed.into_iter().map(far).max() <= Some(7), "border {i}");
        }
    }

    #[test]
    fn no_picture_is_too_small_or_too_odd() {
        let labels = Some(["LPI", "RAS", "SAR", "IPL"].map(str::to_owned));
        for size in [[0, 0], [1, 1], [10, 500], [500, 10], [47, 45], [3000, 60]] {
            for mm_per_pixel in [0.5, 1e300, 1e-300, f64::NAN] {
                let mut image = Image::new(size, [0.0; 4]);
                annotate(
                    &mut image,
                    &Annotation { labels: labels.clone(), mm_per_pixel: Some(mm_per_pixel) },
                );
                assert_eq!(image.pixels.len(), size[0] * size[1]);
            }
        }
        let mut image = Image::new([10, 10], [0.0; 4]);
        annotate(&mut image, &Annotation { labels, mm_per_pixel: Some(1.0) });
        assert_eq!(image, Image::new([10, 10], [0.0; 4]));
    }
}
