//! Annotations of medical pictures: how the patient lies, and a scale bar.

use glam::DVec3;

use super::Image;
use super::lettering::{Align, Ink, capital_height, outline_width, text_width};

/// Least component along an axis for which a direction gets the letter of that axis: sin 15°.
const OBLIQUE: f64 = 0.258_819_045_102_520_74;

/// What [`annotate`] writes on a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Annotation {
    /// Letters at the left, right, top and bottom border; `None` if it is unknown how the patient lies.
    pub labels: Option<[String; 4]>,
    /// Millimetres per pixel in the plane that the viewer looks at; `None` for no scale bar.
    pub mm_per_pixel: Option<f64>,
    /// Bar of colours with their intensities; `None` for none.
    pub colours: Option<ColourBar>,
    /// Colours of letters and bars.
    pub ink: Ink,
}

impl Default for Annotation {
    fn default() -> Self {
        Annotation { labels: None, mm_per_pixel: None, colours: None, ink: Ink::LIGHT }
    }
}

/// Bar of the colours of intensities.
#[derive(Clone, Debug, PartialEq)]
pub struct ColourBar {
    /// Colours from the least intensity to the greatest, display-referred.
    pub colours: Vec<[f32; 3]>,
    /// Texts at the least, the middle and the greatest intensity.
    pub labels: [String; 3],
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

/// Writes the letters at the borders, and draws a scale bar at the bottom left, whose length is round and at most a
/// quarter of the width, with the bar of colours above it. What does not fit is left out.
pub fn annotate(image: &mut Image, annotation: &Annotation) {
    let [width, height] = image.size;
    let size = (width.min(height) as f32 / 28.0).clamp(10.0, 280.0);
    let (margin, letter) = ((0.4 * size).ceil() as usize, capital_height(size));
    let ink = annotation.ink;
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
            if text_width(text, size) + 2 * margin <= width / 3 {
                image.outlined_text(at, size, align, ink, text);
            }
        }
    }
    // Smaller than the letters of the sides.
    let size = 0.8 * size;
    let letter = capital_height(size);
    let (line, edge) = ((0.1 * size).round().max(1.0) as usize, outline_width(size).round() as usize);
    let tick = 3 * line;
    let bottom = height - margin;
    let bar = annotation.mm_per_pixel.and_then(|mm| scale_bar(mm, width));
    if let Some((length, text)) = bar.filter(|(_, text)| text_width(text, size) + 2 * margin <= width / 2) {
        let bar = [
            ([margin, bottom - tick], [line, tick]),
            ([margin + length - line.min(length), bottom - tick], [line, tick]),
            ([margin, bottom - line], [length, line]),
        ];
        for ([x, y], [w, h]) in bar {
            image.fill([x - edge, y - edge], [w + 2 * edge, h + 2 * edge], ink.outline);
        }
        for (at, size) in bar {
            image.fill(at, size, ink.letters);
        }
        let above = bottom - tick - margin / 2 - letter - edge;
        image.outlined_text([margin, above], size, Align::Left, ink, &text);
    }
    if let Some(bar) = &annotation.colours {
        let foot = bottom - tick - 2 * letter - margin;
        draw_colours(image, bar, [margin, foot], size, ink);
    }
}

/// Draws a bar of colours that stands on a place, with its texts to the right.
fn draw_colours(image: &mut Image, bar: &ColourBar, [left, foot]: [usize; 2], size: f32, ink: Ink) {
    let [width, height] = image.size;
    let (wide, high) = (size.round() as usize, (10.0 * size).min(0.3 * height as f32) as usize);
    let gap = (0.4 * size).ceil() as usize;
    let room = bar.labels.iter().map(|text| text_width(text, size)).max().unwrap_or(0);
    let (letter, count) = (capital_height(size), bar.colours.len());
    if high < 4 * letter || foot < high + letter || left + wide + 2 * gap + room > width / 2 || count == 0 {
        return;
    }
    let edge = (0.06 * size).round().max(1.0) as usize;
    image.fill([left - edge, foot - high - edge], [wide + 2 * edge, high + 2 * edge], ink.letters);
    for row in 0..high {
        let colour = bar.colours[(count * row / high).min(count - 1)];
        image.fill([left, foot - row - 1], [wide, 1], colour);
    }
    for (i, text) in bar.labels.iter().enumerate() {
        let middle = foot - i * high / 2;
        image.outlined_text([left + wide + gap, middle - letter / 2], size, Align::Left, ink, text);
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
        annotate(&mut image, &Annotation { mm_per_pixel: Some(1.0), ..Annotation::default() });
        let white = |y: usize| (0..400).filter(|&x| image.at(x, y) == [1.0; 4]).collect::<Vec<_>>();
        let longest = (0..300).map(white).max_by_key(Vec::len).unwrap();
        let margin = longest[0];
        assert!(margin < 10);
        assert_eq!(longest, (margin..margin + 100).collect::<Vec<_>>());
    }

    #[test]
    fn letters_are_at_their_borders() {
        let plain = Image::new([300, 240], [0.5; 4]);
        let labels = ["R", "L", "S", "I"].map(str::to_owned);
        for (i, [x, y]) in [[8, 120], [292, 120], [150, 8], [150, 232]].into_iter().enumerate() {
            let mut only: [String; 4] = Default::default();
            only[i].clone_from(&labels[i]);
            let mut image = plain.clone();
            annotate(&mut image, &Annotation { labels: Some(only), ..Annotation::default() });
            let changed: Vec<usize> =
                (0..plain.pixels.len()).filter(|&p| image.pixels[p] != plain.pixels[p]).collect();
            assert!(changed.len() > 20, "border {i}");
            let far = |p: usize| (p % 300).abs_diff(x).max((p / 300).abs_diff(y));
            assert!(changed.into_iter().map(far).max() <= Some(9), "border {i}");
        }
    }

    #[test]
    fn colours_stand_above_the_scale_from_the_least_to_the_greatest() {
        let colours = vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let bar = ColourBar { colours, labels: ["0", "50", "100 HU"].map(str::to_owned) };
        for (background, ink) in
            [([0.0, 0.0, 0.0, 1.0], Ink::LIGHT), ([1.0; 4], Ink::DARK), ([0.0; 4], Ink::DARK)]
        {
            let mut image = Image::new([400, 300], background);
            let colours = Some(bar.clone());
            annotate(&mut image, &Annotation { colours, ink, ..Annotation::default() });
            let rows = |c: usize| {
                let pure = |y: &usize| {
                    (0..400).any(|x| (0..3).all(|i| image.at(x, *y)[i] == f32::from(u8::from(i == c))))
                };
                (0..300).filter(pure).collect::<Vec<_>>()
            };
            let [red, green, blue] = [0, 1, 2].map(rows);
            assert!(
                red.len() > 20 && red.len().abs_diff(blue.len()) <= 1,
                "{} and {}",
                red.len(),
                blue.len()
            );
            assert!(red[0] > green[0] && green[0] > blue[0] && red[red.len() - 1] < 290, "{red:?}");
            let text = image.pixels.iter().filter(|p| p[..3] == ink.letters && p[3] == 1.0).count();
            assert!(text > 40, "{text} pixels of letters and the frame");
        }
    }

    #[test]
    fn no_picture_is_too_small_or_too_odd() {
        let labels = Some(["LPI", "RAS", "SAR", "IPL"].map(str::to_owned));
        let bar =
            ColourBar { colours: vec![[0.5; 3]; 3], labels: ["-100", "0", "100 HU"].map(str::to_owned) };
        for size in [[0, 0], [1, 1], [10, 500], [500, 10], [47, 45], [3000, 60]] {
            for mm_per_pixel in [0.5, 1e300, 1e-300, f64::NAN] {
                let mut image = Image::new(size, [0.0; 4]);
                let (labels, mm_per_pixel) = (labels.clone(), Some(mm_per_pixel));
                let colours = Some(bar.clone());
                annotate(&mut image, &Annotation { labels, mm_per_pixel, colours, ink: Ink::LIGHT });
                assert_eq!(image.pixels.len(), size[0] * size[1]);
            }
        }
        let mut image = Image::new([10, 10], [0.0; 4]);
        annotate(&mut image, &Annotation { labels, mm_per_pixel: Some(1.0), ..Annotation::default() });
        assert_eq!(image, Image::new([10, 10], [0.0; 4]));
    }
}
