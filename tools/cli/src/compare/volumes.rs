//! Two volumes inside a region.

use std::path::PathBuf;

use clap::Args;
use engine::volume::compare::{Comparison, Normalisation, compare};
use engine::volume::{Roi, Volume};
use engine::{Error, Kind};
use serde::Serialize;

use crate::arguments::{Range, any_range, pair};
use crate::console::Console;
use crate::failure::Stop;
use crate::inputs::{Case, region_of, volume_of};
use crate::report::decibel;

/// What of two volumes is compared, and over which range.
#[derive(Args, Debug)]
#[group(skip)]
#[command(next_help_heading = "Volumes")]
pub struct Arguments {
    /// Compares inside this mask of the first volume [default: everywhere]
    #[arg(long, value_name = "MASK", conflicts_with = "roi_threshold")]
    roi: Option<PathBuf>,
    /// Or where the first volume is from LOW to HIGH, HU
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair, allow_hyphen_values = true)]
    roi_threshold: Option<[f32; 2]>,
    /// Which labels of the mask, by number or name
    #[arg(long, value_name = "N|NAME,...", requires = "roi")]
    roi_label: Option<String>,
    /// What the PSNR is over: two HU, or roi for the range of the first volume inside the region; both volumes are clipped
    /// to it. Or own: each volume over its own full range [default: the full range of the first]
    #[arg(long, value_name = "LOW,HIGH|roi|own", value_parser = any_range, allow_hyphen_values = true)]
    range: Option<Range>,
}

impl Arguments {
    /// Whether any of them is.
    pub fn are_given(&self) -> bool {
        self.roi.is_some() || self.roi_threshold.is_some() || self.range.is_some()
    }
}

/// What `--json` prints.
#[derive(Serialize)]
struct Output {
    size: [usize; 3],
    #[serde(serialize_with = "decibel")]
    psnr_db: f64,
    #[serde(flatten)]
    comparison: Comparison,
    /// What the ranges are: of the first `volume`, of it inside the `roi`, of each its `own`, or `given`.
    range_of: &'static str,
}

/// Runs the command.
pub fn run(arguments: &super::Arguments, console: &Console) -> std::result::Result<u8, Stop> {
    if let Some(path) = &arguments.diff {
        let message = "--diff draws pictures; these are volumes";
        return Err(Error::new(Kind::Usage, "VGS-CLI-044", message)
            .file(path)
            .help("the error of splats as a volume: vgs eval SPLATS VOLUME --roi MASK --map FILE.nii.gz")
            .into());
    }
    let volumes = &arguments.volumes;
    let [a, b] = [&arguments.a, &arguments.b].map(|path| volume_of(path, &arguments.read));
    let (a, b) = (a?, b?);
    let (mask, labels) = (volumes.roi.as_deref(), volumes.roi_label.as_deref());
    let of_first = |error: Error| if error.file.is_some() { error } else { error.file(&arguments.a) };
    let roi = match region_of(&a, &arguments.read, mask, volumes.roi_threshold, labels).map_err(of_first)? {
        Some(roi) => roi,
        None => Roi::new(vec![1.0; a.len()], &a).map_err(of_first)?,
    };
    let case = Case { volume: a, roi };
    let normalisation = match volumes.range {
        Some(Range::Own) => Normalisation::Own,
        chosen => Normalisation::Range(case.range(chosen).map_err(of_first)?),
    };
    let comparison =
        compare(&case.volume, &b, &case.roi, normalisation).map_err(|error| of_both(error, arguments))?;
    if comparison.left_out > 0 {
        tracing::warn!("{} voxels of the region are left out: NaN or infinite", comparison.left_out);
    }
    let (name, _) = range_of(volumes.range);
    let output = Output { size: case.volume.size, psnr_db: comparison.psnr_db(), comparison, range_of: name };
    if console.json {
        console.json_data(&output)?;
    } else {
        console.data(&text(&output, &case.volume, volumes.range))?;
    }
    Ok(0)
}

/// Names both volumes in what is wrong with the pair.
fn of_both(error: Error, arguments: &super::Arguments) -> Error {
    let message = format!("{} and {}: {}", arguments.a.display(), arguments.b.display(), error.message);
    Error { message, ..error }
}

/// What the ranges were taken from, for scripts and for people.
fn range_of(chosen: Option<Range>) -> (&'static str, &'static str) {
    match chosen {
        Some(Range::Own) => ("own", "each volume over its own"),
        Some(Range::Roi) => ("roi", "the first volume's inside the region; both are clipped to it"),
        Some(Range::Given(_)) => ("given", "given; both are clipped to it"),
        None => ("volume", "the first volume's; both are clipped to it"),
    }
}

fn text(o: &Output, volume: &Volume, chosen: Option<Range>) -> String {
    let (c, unit) = (&o.comparison, volume.unit());
    let range = |[low, high]: [f32; 2]| format!("{low} to {high}{unit}");
    let ranges = match chosen {
        Some(Range::Own) => format!("{} and {}", range(c.range_a), range(c.range_b)),
        _ => range(c.range_a),
    };
    let psnr = if c.mse == 0.0 { "∞ (equal)".to_owned() } else { format!("{:.2} dB", o.psnr_db) };
    let [nx, ny, nz] = o.size;
    let mut out = format!(
        "voxels   {} of {nx} x {ny} x {nz}\nrange    {ranges} ({})\nPSNR     {psnr}\nMSE      {:.6e} of the range \
         squared\nRMSE     {:.2}{unit}\nmean     {:+.2}{unit}\n99 %     within {:.2}{unit}\nlargest  ",
        c.voxels,
        range_of(chosen).1,
        c.mse,
        c.rmse_hu,
        c.mean_hu,
        c.p99_hu,
    );
    if c.largest_hu == 0.0 {
        return out + "none\n";
    }
    let ([x, y, z], [wx, wy, wz]) = (c.largest_voxel, c.largest_mm);
    out += &format!("{:+.2}{unit} at voxel {x} {y} {z} ({wx:.1} {wy:.1} {wz:.1} mm)\n", c.largest_hu);
    out
}
