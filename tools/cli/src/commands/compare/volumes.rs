//! Compares two volumes inside a region.

use engine::volume::compare::{self, Comparison, Normalisation};
use engine::volume::{Roi, Volume};
use engine::{Error, Kind};
use serde::Serialize;

use super::arguments::CompareArguments;
use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::flags::Range;
use crate::shared::inputs::{Case, region_of, volume_of};

/// Output of `--json`.
#[derive(Serialize)]
struct VolumeComparison {
    size: [usize; 3],
    psnr_db: f64,
    #[serde(flatten)]
    comparison: Comparison,
    /// Origin of the ranges: the first `volume`, the same inside the `roi`, each volume's `own`, or `given`.
    range_of: &'static str,
}

/// Compares two volumes.
pub fn compare(arguments: &CompareArguments, console: &Console) -> std::result::Result<u8, Stop> {
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
    let of_first = |error: Error| error.or_file(&arguments.a);
    let threshold = (volumes.roi_threshold, &volumes.cleaning);
    let roi = match region_of(&a, &arguments.read, mask, threshold, labels).map_err(of_first)? {
        Some(roi) => roi,
        None => Roi::new(vec![1.0; a.len()], &a).map_err(of_first)?,
    };
    let case = Case { volume: a, roi, mask_within: None };
    let normalisation = match volumes.range {
        Some(Range::Own) => Normalisation::Own,
        chosen => Normalisation::Range(case.range(chosen).map_err(of_first)?),
    };
    let comparison = compare::compare(&case.volume, &b, &case.roi, normalisation)
        .map_err(|error| arguments.name_both(error))?;
    if comparison.left_out > 0 {
        tracing::warn!("{} voxels of the region are left out: NaN or infinite", comparison.left_out);
    }
    let (name, _) = range_of(volumes.range);
    let output = VolumeComparison {
        size: case.volume.size,
        psnr_db: comparison.psnr_db(),
        comparison,
        range_of: name,
    };
    if console.json {
        console.json_data(&output)?;
    } else {
        console.data(&text(&output, &case.volume, volumes.range))?;
    }
    Ok(0)
}

/// Returns the origin of the ranges, for scripts and for people.
fn range_of(chosen: Option<Range>) -> (&'static str, &'static str) {
    match chosen {
        Some(Range::Own) => ("own", "each volume over its own"),
        Some(Range::Roi) => ("roi", "the first volume's inside the region; both are clipped to it"),
        Some(Range::Given(_)) => ("given", "given; both are clipped to it"),
        None => ("volume", "the first volume's; both are clipped to it"),
    }
}

fn text(o: &VolumeComparison, volume: &Volume, chosen: Option<Range>) -> String {
    let (c, unit) = (&o.comparison, volume.unit().text());
    let range = |[low, high]: [f32; 2]| format!("{low} to {high}{unit}");
    let ranges = match chosen {
        Some(Range::Own) => format!("{} and {}", range(c.range_a), range(c.range_b)),
        _ => range(c.range_a),
    };
    let psnr = if c.mse == 0.0 { "∞ (equal)".to_owned() } else { format!("{:.2} dB", o.psnr_db) };
    let [nx, ny, nz] = o.size;
    let mut out = format!(
        "voxels   {} of {nx} x {ny} x {nz}\nrange    {ranges} ({})\nPSNR     {psnr}\nMSE      {:.6e} of the range \
         squared\nRMSE     {:.2}{unit}\nmean     {:+.2}{unit}\nwithin   {:.2}{unit} in 99 % of the voxels\nlargest  ",
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
