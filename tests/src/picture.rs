//! Golden pictures: at most 128 pixels wide, made by the f64 reference implementation and kept in
//! `tests/golden/` as PNG.
//!
//! `UPDATE_GOLDEN=1` makes them anew with the reference implementation. Without it a missing picture fails
//! the test; if a picture differs, it and the difference are left in `target/golden/`.

use std::path::PathBuf;

use engine::image::{self, Image, WriteOptions};

/// Greatest size of a golden picture, bytes.
const MOST_BYTES: u64 = 32 << 10;
/// Greatest differences of a picture from its golden one, in the 255 steps of a channel: on average, and for
/// 99 % of the pixels.
const MEAN: f64 = 0.6;
const PERCENTILE: f64 = 2.0;

/// Compares a picture over black with the golden picture `name`, or makes that anew with `reference`,
/// the reference implementation.
pub fn check(name: &str, found: &Image, reference: impl FnOnce() -> Image) {
    let path = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/golden")).join(format!("{name}.png"));
    let options = WriteOptions { background: Some([0.0; 3]), force: true, ..WriteOptions::default() };
    if std::env::var_os("UPDATE_GOLDEN").is_some_and(|v| v == "1") {
        image::write(&path, &reference(), None, &options).expect("writing a golden picture");
        let bytes = std::fs::metadata(&path).expect("it was written").len();
        assert!(bytes <= MOST_BYTES, "{name}: {bytes} bytes");
        println!("{name}: made anew");
        return;
    }
    let golden = match image::read(&path) {
        Ok(picture) => picture.image.over([0.0; 3]),
        Err(e) => panic!("the golden picture {name}.png cannot be read ({e}); UPDATE_GOLDEN=1 makes it"),
    };
    let found = found.over([0.0; 3]);
    assert_eq!(found.size, golden.size, "{name}: size");
    let mut errors: Vec<f64> = found
        .pixels
        .iter()
        .zip(&golden.pixels)
        .map(|(a, b)| {
            (0..3).map(|c| f64::from((a[c].clamp(0.0, 1.0) - b[c]).abs())).fold(0.0, f64::max) * 255.0
        })
        .collect();
    errors.sort_by(f64::total_cmp);
    let mean = errors.iter().sum::<f64>() / errors.len() as f64;
    let percentile = errors[errors.len() * 99 / 100];
    println!(
        "golden {name}: mean {mean:.3}, 99 % within {percentile:.3}, worst {:.1} of 255",
        errors[errors.len() - 1]
    );
    if mean <= MEAN && percentile <= PERCENTILE {
        return;
    }
    let left = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../target/golden"));
    let difference: Vec<[f32; 4]> = found
        .pixels
        .iter()
        .zip(&golden.pixels)
        .map(|(a, b)| [0, 1, 2, 3].map(|c| if c < 3 { (a[c] - b[c]).abs() * 8.0 } else { 1.0 }))
        .collect();
    let difference = Image { size: found.size, pixels: difference };
    let kept = std::fs::create_dir_all(&left).is_ok()
        && image::write(left.join(format!("{name}.png")), &found, None, &options).is_ok()
        && image::write(left.join(format!("{name}-difference.png")), &difference, None, &options).is_ok();
    panic!(
        "{name}: mean {mean:.2} (at most {MEAN}), 99 % within {percentile:.2} (at most {PERCENTILE}) of 255 steps; {}",
        if kept {
            "target/golden/ has the picture and the difference, eight times"
        } else {
            "the picture is lost"
        }
    );
}
