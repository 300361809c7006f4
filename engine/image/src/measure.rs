//! Measures of the difference of two pictures: PSNR, SSIM and the largest difference.
//!
//! All of them compare display-referred colour over black, which is premultiplied colour as it is: opacity
//! counts by how much it dims. Sums are in f64 in the order of the pixels, so the same pictures give the same
//! bits on any number of threads.

use rayon::prelude::*;

use super::Image;
use base::{Error, Kind, Result};

/// Returns the peak signal-to-noise ratio, dB: 10 lg(1 / MSE), where MSE is the mean of the squared
/// differences of red, green and blue of all pixels and the peak is 1. It is infinite for equal pictures.
///
/// # Errors
/// [`Kind::Usage`] for pictures of different sizes.
pub fn psnr(a: &Image, b: &Image) -> Result<f64> {
    check_sizes(a, b)?;
    let squares = |a: &[[f32; 4]], b: &[[f32; 4]]| -> f64 {
        let difference = |p: &[f32; 4], q: &[f32; 4], i: usize| f64::from(p[i]) - f64::from(q[i]);
        a.iter().zip(b).map(|(p, q)| (0..3).map(|i| difference(p, q, i).powi(2)).sum::<f64>()).sum()
    };
    let width = a.size[0];
    let rows: Vec<f64> =
        (a.pixels.par_chunks(width).zip(b.pixels.par_chunks(width))).map(|(a, b)| squares(a, b)).collect();
    let mse = rows.iter().sum::<f64>() / (3 * a.pixels.len()) as f64;
    Ok(-10.0 * mse.log10())
}

/// Side of the window of [`ssim`], pixels, and standard deviation of its weights.
const WINDOW: usize = 11;
const SIGMA: f64 = 1.5;
/// Rows of windows of [`ssim`] that are computed together.
const BAND: usize = 64;
/// (K₁ L)² and (K₂ L)² with K₁ = 0.01, K₂ = 0.03 and L = 1.
const C1: f64 = 0.01 * 0.01;
const C2: f64 = 0.03 * 0.03;

/// Returns the structural similarity of two pictures: 1 for equal ones, at least -1. Source: Wang, Bovik,
/// Sheikh and Simoncelli, "Image quality assessment: from error visibility to structural similarity", 2004.
///
/// It is the mean of SSIM over all places where a window of 11 x 11 pixels lies within the picture. Weights
/// are Gaussian with σ 1.5 pixels and sum 1; variances and covariance are weighted sums without Bessel's
/// correction. As in the authors' `ssim_index.m` there is one channel, luma: 0.299 R + 0.587 G + 0.114 B of
/// the display-referred numbers, and the pictures are not downsampled first. In a picture of fewer than 11
/// pixels along an axis the window is as long as fits, an odd number of pixels.
///
/// # Errors
/// [`Kind::Usage`] for pictures of different sizes.
pub fn ssim(a: &Image, b: &Image) -> Result<f64> {
    check_sizes(a, b)?;
    let [width, height] = a.size;
    let (across, down) = (window(width), window(height));
    let [columns, rows] = [width + 1 - across.len(), height + 1 - down.len()];
    // By bands of rows, since the luma of whole pictures would take as much memory as the pictures.
    let band_sums = |first: usize| -> Vec<f64> {
        let end = (first + BAND).min(rows);
        let within = first * width..(end + down.len() - 1) * width;
        let [a, b] = [a, b].map(|image| luma(&image.pixels[within.clone()]));
        let row_sum = |top: usize| -> f64 {
            // The filter is separable: first down each column, for the five moments, then along the row.
            let mut moments = vec![[0.0; 5]; width];
            for (y, weight) in down.iter().enumerate() {
                let row = (top + y) * width..(top + y + 1) * width;
                for ((m, &a), &b) in moments.iter_mut().zip(&a[row.clone()]).zip(&b[row]) {
                    for (m, value) in m.iter_mut().zip([a, b, a * a, b * b, a * b]) {
                        *m += weight * value;
                    }
                }
            }
            let place = |left: usize| {
                let mut sums = [0.0; 5];
                for (m, weight) in moments[left..].iter().zip(&across) {
                    for (sum, m) in sums.iter_mut().zip(m) {
                        *sum += weight * m;
                    }
                }
                similarity(sums)
            };
            (0..columns).map(place).sum()
        };
        (0..end - first).map(row_sum).collect()
    };
    let bands: Vec<Vec<f64>> =
        (0..rows.div_ceil(BAND)).into_par_iter().map(|i| band_sums(i * BAND)).collect();
    Ok(bands.iter().flatten().sum::<f64>() / (columns * rows) as f64)
}

/// Returns the SSIM of one place from the means of a, b, a², b² and ab.
fn similarity([a, b, aa, bb, ab]: [f64; 5]) -> f64 {
    let (variances, covariance) = (aa - a * a + bb - b * b, ab - a * b);
    (2.0 * a * b + C1) * (2.0 * covariance + C2) / ((a * a + b * b + C1) * (variances + C2))
}

/// Returns the Gaussian weights of the longest window that fits into `length` pixels.
fn window(length: usize) -> Vec<f64> {
    let radius = (WINDOW.min(length) - 1) / 2;
    let weight = |i: usize| (-0.5 * ((i as f64 - radius as f64) / SIGMA).powi(2)).exp();
    let weights: Vec<f64> = (0..=2 * radius).map(weight).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter().map(|w| w / sum).collect()
}

fn luma(pixels: &[[f32; 4]]) -> Vec<f64> {
    let weighted =
        |&[r, g, b, _]: &[f32; 4]| 0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b);
    pixels.iter().map(weighted).collect()
}

/// The greatest difference of two pictures, and its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Difference {
    /// The difference |A - B|; 1 is that of black from the brightest.
    pub value: f32,
    /// Column from the left and row from the top of the first pixel with this difference.
    pub at: [usize; 2],
    /// The channel: 0 red, 1 green, 2 blue.
    pub channel: usize,
}

/// Returns the greatest difference in red, green or blue of any pixel.
///
/// # Errors
/// [`Kind::Usage`] for pictures of different sizes.
pub fn largest_difference(a: &Image, b: &Image) -> Result<Difference> {
    check_sizes(a, b)?;
    let mut largest = Difference { value: 0.0, at: [0; 2], channel: 0 };
    for (index, (p, q)) in a.pixels.iter().zip(&b.pixels).enumerate() {
        for channel in 0..3 {
            let value = (p[channel] - q[channel]).abs();
            if value > largest.value {
                largest = Difference { value, at: [index % a.size[0], index / a.size[0]], channel };
            }
        }
    }
    Ok(largest)
}

/// Refuses pictures that cannot be compared pixel by pixel.
pub(super) fn check_sizes(a: &Image, b: &Image) -> Result<()> {
    super::image::check_size(a.size)?;
    if a.size != b.size {
        let [[aw, ah], [bw, bh]] = [a.size, b.size];
        let message = format!("pictures of different sizes: {aw} x {ah} and {bw} x {bh} pixels");
        return Err(Error::new(Kind::Usage, "VGS-IMG-030", message).help("render both at one size"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns a grey picture.
    fn grey(size: [usize; 2], at: impl Fn(usize, usize) -> f64) -> Image {
        let pixel = |i: usize| {
            let v = at(i % size[0], i / size[0]) as f32;
            [v, v, v, 1.0]
        };
        Image { size, pixels: (0..size[0] * size[1]).map(pixel).collect() }
    }

    /// Two pictures with structure and without a period, that anyone can make again.
    fn pair(size: [usize; 2]) -> [Image; 2] {
        let a = |x: usize, y: usize| ((x * x * 7 + y * 13 + x * y * 5) % 101) as f64 / 128.0;
        let b = |x: usize, y: usize| (a(x, y) + ((x * 3 + y * y * 11) % 17) as f64 / 64.0).min(1.0);
        [grey(size, a), grey(size, b)]
    }

    #[test]
    fn psnr_of_known_errors() {
        let size = [5, 4];
        let a = grey(size, |_, _| 0.25);
        for (b, expected) in [
            (grey(size, |_, _| 0.25), f64::INFINITY),
            (grey(size, |_, _| 0.75), -10.0 * 0.25_f64.log10()),
            (grey(size, |x, y| if (x, y) == (3, 2) { 1.25 } else { 0.25 }), 10.0 * 20.0_f64.log10()),
        ] {
            let found = psnr(&a, &b).unwrap();
            assert!(found == expected || (found - expected).abs() < 1e-9, "{found} for {expected}");
        }
        // One channel of three; opacity by itself is nothing that is seen.
        let mut b = a.clone();
        b.pixels.iter_mut().for_each(|p| *p = [p[0], p[1] + 0.5, p[2], 0.5]);
        assert!((psnr(&a, &b).unwrap() - 10.0 * 12.0_f64.log10()).abs() < 1e-9);
    }

    #[test]
    fn ssim_of_pictures_that_can_be_reckoned() {
        let [a, b] = pair([40, 23]);
        assert_eq!(ssim(&a, &a).unwrap(), 1.0);
        assert_eq!(ssim(&a, &b).unwrap().to_bits(), ssim(&a, &b).unwrap().to_bits());
        assert!((ssim(&a, &b).unwrap() - ssim(&b, &a).unwrap()).abs() < 1e-15);
        // Without structure only the means count.
        let (low, high) = (grey([16, 12], |_, _| 0.25), grey([16, 12], |_, _| 0.75));
        let expected = (2.0 * 0.25 * 0.75 + 1e-4) / (0.25 * 0.25 + 0.75 * 0.75 + 1e-4);
        assert!((ssim(&low, &high).unwrap() - expected).abs() < 1e-9);
        // A shift leaves structure alone: the product has one factor left, (2 m n + C1) / (m² + n² + C1), at
        // each place.
        let flat = grey([11, 11], |x, y| 0.4 + 0.1 * f64::from((x + y) as u32 % 2));
        let shifted = grey([11, 11], |x, y| 0.6 + 0.1 * f64::from((x + y) as u32 % 2));
        let w = window(11);
        let odd: f64 = (0..121).filter(|i| i % 2 == 1).map(|i| w[i % 11] * w[i / 11]).sum();
        let (m, n) = (0.4 + 0.1 * odd, 0.6 + 0.1 * odd);
        let expected = (2.0 * m * n + 1e-4) / (m * m + n * n + 1e-4);
        assert!((ssim(&flat, &shifted).unwrap() - expected).abs() < 1e-6);
        // The negative of a pattern around its mean is as dissimilar as can be.
        let bars =
            |sign: f64| grey([44, 30], move |x, _| 0.5 + sign * if x / 2 % 2 == 0 { 0.4 } else { -0.4 });
        assert!(ssim(&bars(1.0), &bars(-1.0)).unwrap() < -0.9);
    }

    /// The definition as it is written, with all 121 weights at each place.
    #[test]
    fn ssim_is_what_its_definition_says() {
        for size in [[37, 26], [11, 11], [12, 7], [3, 40], [1, 1], [2, 2]] {
            let [a, b] = pair(size);
            let (across, down) = (window(size[0]), window(size[1]));
            let mut values = Vec::new();
            for top in 0..=size[1] - down.len() {
                for left in 0..=size[0] - across.len() {
                    let mean = |f: &dyn Fn(f64, f64) -> f64| {
                        let mut sum = 0.0;
                        for (y, wy) in down.iter().enumerate() {
                            for (x, wx) in across.iter().enumerate() {
                                let at = |image: &Image| f64::from(image.at(left + x, top + y)[0]);
                                sum += wx * wy * f(at(&a), at(&b));
                            }
                        }
                        sum
                    };
                    let (m, n) = (mean(&|a, _| a), mean(&|_, b| b));
                    let (vm, vn) = (mean(&|a, _| (a - m).powi(2)), mean(&|_, b| (b - n).powi(2)));
                    let cov = mean(&|a, b| (a - m) * (b - n));
                    let means = (2.0 * m * n + 0.0001) / (m * m + n * n + 0.0001);
                    values.push(means * (2.0 * cov + 0.0009) / (vm + vn + 0.0009));
                }
            }
            let expected = values.iter().sum::<f64>() / values.len() as f64;
            let found = ssim(&a, &b).unwrap();
            assert!((found - expected).abs() < 1e-10, "{size:?}: {found}, {expected}");
        }
        assert_eq!((window(500).len(), window(10).len(), window(1).len()), (11, 9, 1));
    }

    /// scikit-image 0.26, `structural_similarity` with `gaussian_weights`, `sigma=1.5`,
    /// `use_sample_covariance=False`.
    #[test]
    fn ssim_agrees_with_another_program() {
        for (size, expected) in [([40, 23], 0.9062212006329696), ([37, 26], 0.9058629276086726)] {
            let [a, b] = pair(size);
            let found = ssim(&a, &b).unwrap();
            assert!((found - expected).abs() < 1e-9, "{size:?}: {found}");
        }
    }

    #[test]
    fn luma_weighs_green_most() {
        let image = |pixel| Image::new([12, 12], pixel);
        let black = image([0.0, 0.0, 0.0, 1.0]);
        for (pixel, luma) in
            [([1.0, 0.0, 0.0, 1.0], 0.299), ([0.0, 1.0, 0.0, 1.0], 0.587), ([0.0, 0.0, 1.0, 1.0], 0.114)]
        {
            let expected = C1 / (luma * luma + C1);
            assert!((ssim(&image(pixel), &black).unwrap() - expected).abs() < 1e-9, "{pixel:?}");
        }
    }

    #[test]
    fn the_largest_difference_is_found() {
        let [a, mut b] = [grey([6, 5], |_, _| 0.5), grey([6, 5], |_, _| 0.5)];
        let none = Difference { value: 0.0, at: [0, 0], channel: 0 };
        assert_eq!(largest_difference(&a, &b).unwrap(), none);
        b.pixels[3 * 6 + 4][2] = 0.25;
        b.pixels[4 * 6 + 1][0] = 0.625;
        let found = largest_difference(&a, &b).unwrap();
        assert_eq!(found, Difference { value: 0.25, at: [4, 3], channel: 2 });
    }

    #[test]
    fn pictures_of_different_sizes_are_not_compared() {
        let (a, b) = (grey([4, 6], |_, _| 0.0), grey([6, 4], |_, _| 0.0));
        for error in
            [psnr(&a, &b).unwrap_err(), ssim(&a, &b).unwrap_err(), largest_difference(&a, &b).unwrap_err()]
        {
            assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-IMG-030"));
            assert!(error.message.contains("4 x 6") && error.message.contains("6 x 4"));
        }
        let empty = Image::new([0, 3], [0.0; 4]);
        assert_eq!(ssim(&empty, &empty).unwrap_err().code, "VGS-IMG-001");
    }
}
