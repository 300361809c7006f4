//! Compares two pictures.

use std::path::{Path, PathBuf};

use engine::Result;
use engine::image::{self, DifferenceMap, Flip, Image, WriteOptions, difference_picture};
use serde::Serialize;

use super::arguments::{CompareArguments, Map};
use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::outputs;
use crate::shared::terminal::clean;

/// Output of `--json`.
#[derive(Serialize)]
struct PictureComparison {
    /// Width and height, pixels.
    size: [usize; 2],
    psnr_db: f64,
    ssim: f64,
    flip_mean: f64,
    /// Largest difference of a channel; 1 is the difference between black and the brightest.
    largest_difference: f32,
    /// Place of the largest difference: column from the left and row from the top.
    largest_at: [usize; 2],
    largest_in: &'static str,
    outputs: Vec<String>,
}

/// Compares two pictures.
pub fn compare(arguments: &CompareArguments, console: &Console) -> std::result::Result<u8, Stop> {
    let written: Vec<&Path> = arguments.diff.iter().map(PathBuf::as_path).collect();
    outputs::check(&written, &[&arguments.a, &arguments.b], arguments.force)?;
    for path in &written {
        image::file::of_extension(path)?;
    }

    let a = image::read(&arguments.a)?.image;
    let more = a.pixels.len() * (size_of::<[f32; 4]>() + size_of::<f32>());
    engine::memory::require(more as u64, "the other picture and the map of differences")?;
    let b = image::read(&arguments.b)?.image;
    let largest = image::largest_difference(&a, &b).map_err(|e| arguments.name_both(e))?;
    let flip = image::flip(&a, &b)?;
    let output = PictureComparison {
        size: a.size,
        psnr_db: image::psnr(&a, &b)?,
        ssim: image::ssim(&a, &b)?,
        flip_mean: flip.mean,
        largest_difference: largest.value,
        largest_at: largest.at,
        largest_in: ["red", "green", "blue"][largest.channel],
        outputs: written.iter().map(|path| path.display().to_string()).collect(),
    };
    if let Some(path) = &arguments.diff {
        draw(arguments, path, &a, &b, &flip)?;
    }
    if console.json {
        console.json_data(&output)?;
    } else {
        console.data(&text(&output))?;
    }
    Ok(0)
}

/// Draws two pictures and a map of their differences side by side.
fn draw(arguments: &CompareArguments, path: &Path, a: &Image, b: &Image, flip: &Flip) -> Result<()> {
    let map = match arguments.map {
        Map::Flip => DifferenceMap::flip(flip),
        Map::Absolute => DifferenceMap::absolute(a, b)?,
    };
    let [name_a, name_b] = [&arguments.a, &arguments.b]
        .map(|path| clean(&path.file_name().unwrap_or_default().to_string_lossy()));
    let picture = difference_picture(a, b, [&name_a, &name_b], &map)?;
    image::write(path, &picture, None, &WriteOptions { force: arguments.force, ..WriteOptions::default() })
}

fn text(o: &PictureComparison) -> String {
    let [width, height] = o.size;
    let psnr =
        if o.psnr_db == f64::INFINITY { "∞ (equal)".to_owned() } else { format!("{:.2} dB", o.psnr_db) };
    let mut out = format!(
        "size     {width} x {height} pixels\nPSNR     {psnr}\nSSIM     {:.5}\nFLIP     {:.5}\nlargest  ",
        o.ssim, o.flip_mean
    );
    if o.largest_difference > 0.0 {
        let [x, y] = o.largest_at;
        out += &format!(
            "{:.4} ({:.1} of 255) in {}, column {x}, row {y}\n",
            o.largest_difference,
            o.largest_difference * 255.0,
            o.largest_in
        );
    } else {
        out += "none\n";
    }
    out
}
