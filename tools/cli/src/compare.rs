//! `vgs compare`: how different two pictures are, or two volumes inside a region.

mod volumes;

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use engine::image::{self, DifferenceMap, Flip, Image, WriteOptions, difference_picture};
use engine::{Error, Result, volume};
use serde::Serialize;

use crate::console::Console;
use crate::failure::{Stop, clean};
use crate::inputs::ReadArguments;
use crate::outputs;
use crate::report::decibel;

/// Tells how different two pictures are, or two volumes inside a region
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Arguments {
    /// A picture (PNG or EXR) or a volume; the reference where one is
    a: PathBuf,
    /// Another of the same size, or on the same grid
    b: PathBuf,
    #[command(flatten)]
    volumes: volumes::Arguments,
    #[command(flatten)]
    read: ReadArguments,
    /// Of pictures: both and a map of their differences side by side
    #[arg(long, value_name = "FILE.png", help_heading = "Output")]
    diff: Option<PathBuf>,
    /// What the map shows
    #[arg(long, value_enum, default_value_t = Map::Flip, requires = "diff", help_heading = "Output")]
    map: Map,
    /// Replaces an output that exists
    #[arg(short, long, help_heading = "Output")]
    force: bool,
}

const EXAMPLES: &str = "\
Pictures: colours are compared as a display shows them, over black. PSNR is
over red, green and blue of all pixels with peak 1. SSIM is that of Wang 2004
on luma. FLIP is the mean at 67 pixels per degree: 0 is no difference that is
seen, 1 the greatest; the order of the two pictures does not matter.

Volumes: PSNR is -10 log10 of the mean squared difference of intensities from
0 to 1, over the range that is stated. RMSE, the difference that 99 % of the
voxels do not exceed and the largest one are B less A in the unit of the
volumes, not clipped. Every voxel of the region counts once; of a soft mask
these are the ones above 1 % of its maximum. Splats are brought onto the grid
of a volume by vgs rasterize --quantity field; vgs eval does both, and more.

Examples:
  vgs compare volume.png slab.png
  vgs compare volume.exr slab.exr --json
  vgs compare volume.png slab.png --diff diff.png --map absolute
  vgs compare ct.nii.gz field.nii.gz --roi bones.nii.gz
  vgs compare ct.nii.gz field.nii.gz --roi bones.nii.gz --range roi     the paper's Table 2
  vgs compare ct.nii.gz upsampled.nii.gz --roi bones.nii.gz --range own       its Table 3";

/// What a map of differences shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Map {
    /// How strongly the difference is seen, on a scale from 0 to 1
    Flip,
    /// The greatest of |A-B| in red, green and blue, amplified to a round scale
    Absolute,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Output {
    /// Width and height, pixels.
    size: [usize; 2],
    #[serde(serialize_with = "decibel")]
    psnr_db: f64,
    ssim: f64,
    flip_mean: f64,
    /// 1 is from black to the brightest.
    largest_difference: f32,
    /// Column from the left and row from the top.
    largest_at: [usize; 2],
    largest_in: &'static str,
    outputs: Vec<String>,
}

/// Runs the command.
pub fn run(arguments: &Arguments, console: &Console) -> std::result::Result<u8, Stop> {
    if arguments.of_volumes() {
        return volumes::run(arguments, console);
    }
    let written: Vec<&Path> = arguments.diff.iter().map(PathBuf::as_path).collect();
    outputs::check(&written, &[&arguments.a, &arguments.b], arguments.force)?;
    for path in &written {
        image::file::of_extension(path)?;
    }

    let [a, b] = [image::read(&arguments.a)?.image, image::read(&arguments.b)?.image];
    let largest = image::largest_difference(&a, &b).map_err(|e| of_both(e, arguments))?;
    let flip = image::flip(&a, &b)?;
    let output = Output {
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
        arguments.draw(path, &a, &b, &flip)?;
    }
    if console.json {
        console.json_data(&output)?;
    } else {
        console.data(&text(&output))?;
    }
    Ok(0)
}

impl Arguments {
    /// Whether volumes are compared: by the name of the first file, or by flags that only volumes have.
    fn of_volumes(&self) -> bool {
        let name = self.a.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        let mut endings = volume::FORMATS.iter().flat_map(|format| format.extensions);
        self.volumes.are_given() || endings.any(|ending| name.ends_with(ending))
    }

    fn draw(&self, path: &Path, a: &Image, b: &Image, flip: &Flip) -> Result<()> {
        let map = match self.map {
            Map::Flip => DifferenceMap::flip(flip),
            Map::Absolute => DifferenceMap::absolute(a, b)?,
        };
        let [name_a, name_b] =
            [&self.a, &self.b].map(|path| clean(&path.file_name().unwrap_or_default().to_string_lossy()));
        let picture = difference_picture(a, b, [&name_a, &name_b], &map)?;
        image::write(path, &picture, None, &WriteOptions { background: None, force: self.force })
    }
}

/// Names both pictures in what is wrong with the pair.
fn of_both(error: Error, arguments: &Arguments) -> Error {
    let message = format!("{} and {}: {}", arguments.a.display(), arguments.b.display(), error.message);
    Error { message, ..error }
}

fn text(o: &Output) -> String {
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
