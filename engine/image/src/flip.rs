//! FLIP (Andersson and others, "FLIP: a difference evaluator for alternating images", 2020): how strongly an
//! observer who flips between two pictures sees a difference, 0 to 1 at each pixel. NVIDIA's own code through
//! `nv-flip`.

use rayon::prelude::*;

use super::Image;
use super::measure::check_sizes;
use base::Result;

/// Pixels per degree of the observer's visual field: a screen of 3840 pixels, 0.7 m wide and 0.7 m away.
pub const PIXELS_PER_DEGREE: f32 = nv_flip::DEFAULT_PIXELS_PER_DEGREE;

/// Rows of a band that is compared at a time, and the rows that the filters need beyond it: 0.135 degrees,
/// the widest contrast filter of the paper.
const BAND: usize = 128;
const HALO: usize = (0.14 * PIXELS_PER_DEGREE) as usize + 2;

/// A FLIP comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct Flip {
    /// The difference at each pixel, in the order of the pixels.
    pub map: Vec<f32>,
    /// The mean of the map.
    pub mean: f64,
}

/// Compares two pictures over black by LDR-FLIP at [`PIXELS_PER_DEGREE`]. Colours are rounded to 8 bits
/// first, as on a screen.
///
/// # Errors
/// [`Kind::Usage`](base::Kind::Usage) for pictures of different sizes.
pub fn flip(reference: &Image, test: &Image) -> Result<Flip> {
    check_sizes(reference, test)?;
    let [width, height] = reference.size;
    // A pixel depends on no more than HALO rows on either side, so parallel bands give the same bits as the
    // whole.
    let bands: Vec<Vec<f32>> = (0..height.div_ceil(BAND))
        .into_par_iter()
        .map(|band| {
            let (first, end) = (band * BAND, ((band + 1) * BAND).min(height));
            let (low, high) = (first.saturating_sub(HALO), (end + HALO).min(height));
            let rows = |image: &Image| {
                let pixels = &image.pixels[low * width..high * width];
                let bytes: Vec<u8> = pixels.iter().flat_map(|&[r, g, b, _]| [r, g, b].map(byte)).collect();
                nv_flip::FlipImageRgb8::with_data(width as u32, (high - low) as u32, &bytes)
            };
            let map = nv_flip::flip(rows(reference), rows(test), PIXELS_PER_DEGREE).to_vec();
            map[(first - low) * width..(end - low) * width].to_vec()
        })
        .collect();
    let map = bands.concat();
    let mean = map.iter().map(|&v| f64::from(v)).sum::<f64>() / map.len() as f64;
    Ok(Flip { map, mean })
}

fn byte(value: f32) -> u8 {
    (value * 255.0).round().clamp(0.0, 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    fn noise(size: [usize; 2], amplitude: f32) -> Image {
        let pixel = |i: usize| {
            let random = |k: usize| ((i * 3 + k).wrapping_mul(2_654_435_761) >> 7) % 256;
            let [r, g, b] = [0, 1, 2].map(|k| 0.5 + amplitude * (random(k) as f32 / 255.0 - 0.5));
            [r, g, b, 1.0]
        };
        Image { size, pixels: (0..size[0] * size[1]).map(pixel).collect() }
    }

    /// From the paper: HyAB(black, white) = 100 and HyAB(green, blue) = 203.3 in Hunt-adjusted CIELAB. To the
    /// power of 0.7 that is 25.12 of 41.28, and what exceeds 0.4 of the greatest is squeezed into the last
    /// 0.05.
    #[test]
    fn flip_of_black_and_white() {
        let [black, white] = [[0.0, 0.0, 0.0, 1.0], [1.0; 4]].map(|pixel| Image::new([40, 30], pixel));
        let (difference, greatest) = (25.12, 41.28);
        let expected = 0.95 + 0.05 * (difference - 0.4 * greatest) / (0.6 * greatest);
        let found = flip(&black, &white).unwrap();
        assert!((found.mean - expected).abs() < 1e-3, "{} for {expected}", found.mean);
        assert!(found.map.iter().all(|v| (f64::from(*v) - expected).abs() < 1e-3));
    }

    #[test]
    fn flip_grows_with_the_difference() {
        let size = [64, 48];
        let plain = noise(size, 0.0);
        let means = [0.0, 0.1, 0.3, 0.9].map(|amplitude| flip(&plain, &noise(size, amplitude)).unwrap().mean);
        assert_eq!(means[0], 0.0);
        assert!(means.is_sorted_by(|a, b| a < b) && means[3] < 1.0, "{means:?}");
        // One pixel is seen around itself and nowhere else.
        let mut dot = plain.clone();
        dot.pixels[20 * 64 + 30] = [1.0, 0.0, 0.0, 1.0];
        let map = flip(&plain, &dot).unwrap().map;
        let greatest = (0..map.len()).max_by(|&a, &b| map[a].total_cmp(&map[b])).unwrap();
        assert!(
            map[20 * 64 + 30] > 0.05 && (greatest % 64).abs_diff(30).max((greatest / 64).abs_diff(20)) < 4
        );
        assert_eq!(map[40 * 64 + 60], 0.0);
    }

    #[test]
    fn bands_are_as_good_as_the_whole() {
        let size = [33, 2 * BAND + 20];
        let (a, b) = (noise(size, 0.5), noise(size, 0.9));
        let bytes = |image: &Image| -> Vec<u8> {
            image.pixels.iter().flat_map(|p| [p[0], p[1], p[2]].map(byte)).collect()
        };
        let whole =
            |image: &Image| nv_flip::FlipImageRgb8::with_data(size[0] as u32, size[1] as u32, &bytes(image));
        let expected = nv_flip::flip(whole(&a), whole(&b), PIXELS_PER_DEGREE).to_vec();
        assert_eq!(flip(&a, &b).unwrap().map, expected);
    }

    #[test]
    fn pictures_of_different_sizes_are_not_compared() {
        let error = flip(&noise([4, 6], 0.0), &noise([6, 4], 0.0)).unwrap_err();
        assert_eq!(error.code, "VGS-IMG-030");
    }
}
