//! `vgs rasterize`: splats back to a volume.
//!
//! Only bricks that a splat reaches are computed, in slabs of bounded size: cost and memory follow the splats, whatever
//! the size of the grid.

use std::cmp::Ordering;
use std::path::PathBuf;

use clap::{ArgGroup, Args, ValueEnum};
use engine::fit::evaluate::{FieldSample, Sampler};
use engine::fit::place::place;
use engine::gpu::Gpu;
use engine::splat::{Activations, Field, Splat, SplatSet, Unplaced};
use engine::volume::bricks::{BRICK, SAMPLES};
use engine::volume::{Bricks, Volume, nifti};
use engine::{Error, Kind, Result};
use glam::{DAffine3, DVec3, IVec3, UVec3};
use rayon::prelude::*;

use crate::arguments::DeviceArguments;
use crate::console::Console;
use crate::failure::Stop;
use crate::inputs::{ReadArguments, region_of};
use crate::outputs;
use crate::splats;

/// Samples of one slab; with their results they take some 400 MB.
const SLAB_SAMPLES: usize = 1 << 24;

/// Turns splats back into a volume
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct Arguments {
    /// The splats (PLY with intensities; also that of the paper's authors)
    splats: PathBuf,
    #[command(flatten)]
    grid: GridArguments,
    #[command(flatten)]
    region: FittedRegion,
    /// Where the volume goes: .nii or .nii.gz, float32
    #[arg(short, long, value_name = "OUT.nii.gz", help_heading = "Output")]
    output: PathBuf,
    /// Replaces an output that exists
    #[arg(short, long, help_heading = "Output")]
    force: bool,
    /// What the voxels hold
    #[arg(long, value_enum, default_value_t = Quantity::Intensity, help_heading = "Output")]
    quantity: Quantity,
    /// Intensity where the occupancy is below one half, HU
    #[arg(long, value_name = "HU", default_value_t = -1024.0, allow_negative_numbers = true, help_heading = "Output")]
    outside: f32,
    #[command(flatten)]
    read: ReadArguments,
    #[command(flatten)]
    device: DeviceArguments,
}

/// The grid of the new volume.
#[derive(Args, Debug)]
#[group(skip)]
#[command(group = ArgGroup::new("grid").required(true).args(["like", "spacing"]))]
struct GridArguments {
    /// A volume whose grid is used
    #[arg(long, value_name = "VOLUME")]
    like: Option<PathBuf>,
    /// Or a grid of this spacing around the splats, mm: one number or three, axes RAS
    #[arg(long, value_name = "MM", value_parser = spacing)]
    spacing: Option<DVec3>,
}

/// The region that splats were fitted to, for files whose intensities are parts of its range.
#[derive(Args, Debug)]
#[command(next_help_heading = "A PLY of the paper's authors")]
struct FittedRegion {
    /// The mask of the fit: the intensities of the file are parts of the range that --like has inside it
    #[arg(long, value_name = "MASK", requires = "like")]
    roi: Option<PathBuf>,
    /// Which labels of the mask, by number or name
    #[arg(long, value_name = "N|NAME,...", requires = "roi")]
    roi_label: Option<String>,
}

/// A quantity of the field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Quantity {
    /// HU where the occupancy is one half or more
    Intensity,
    /// HU everywhere, as vgs eval takes it; where no splat reaches, that of the background
    Field,
    /// From 0 to 1
    Occupancy,
    /// The summed weight of the splats
    Weight,
}

const EXAMPLES: &str = "\
Examples:
  vgs rasterize bones.ply --like ct.nii.gz -o bones.nii.gz
  vgs rasterize bones.ply --like ct.nii.gz -o mask.nii.gz --quantity occupancy
  vgs rasterize bones.ply --like ct.nii.gz -o field.nii.gz --quantity field       to compare with ct.nii.gz
  vgs rasterize bones.ply --spacing 0.5 -o fine.nii.gz
  vgs rasterize theirs.ply --like ct.nii.gz --roi bones.nii.gz -o theirs.nii.gz     a PLY of the paper's authors";

/// Parses one spacing or three, mm.
pub fn spacing(text: &str) -> std::result::Result<DVec3, String> {
    let numbers: std::result::Result<Vec<f64>, _> =
        text.split(',').map(|t| t.trim().parse::<f64>()).collect();
    let spacing = match numbers.as_deref() {
        Ok(&[s]) => DVec3::splat(s),
        Ok(&[x, y, z]) => DVec3::new(x, y, z),
        _ => return Err("one number or three with commas between are needed, mm".into()),
    };
    let sensible = spacing.is_finite() && spacing.min_element() >= 1e-3 && spacing.max_element() <= 1e3;
    if sensible { Ok(spacing) } else { Err("0.001 to 1000 mm".into()) }
}

/// Runs the command.
pub fn run(arguments: &Arguments, console: &Console) -> std::result::Result<u8, Stop> {
    let mut inputs = vec![arguments.splats.as_path()];
    inputs.extend(arguments.grid.like.as_deref());
    inputs.extend(arguments.region.roi.as_deref());
    outputs::check(&[&arguments.output], &inputs, arguments.force)?;
    let name = arguments.output.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    if !(name.ends_with(".nii") || name.ends_with(".nii.gz")) {
        let message = "the name of the volume must end in .nii or .nii.gz";
        return Err(Error::new(Kind::Usage, "VGS-CLI-050", message).file(&arguments.output).into());
    }
    let read = splats::read_with_intensity(&arguments.splats)?;
    let (set, mut volume) = arguments.place(read)?;
    let splats = set.to_voxel(&volume.world_from_voxel);
    let gpu = arguments.device.boot()?;
    let quantity = arguments.quantity;
    let nothing = match quantity {
        Quantity::Intensity => arguments.outside,
        Quantity::Field => set.field.background,
        Quantity::Occupancy | Quantity::Weight => 0.0,
    };
    volume.samples.fill(nothing);
    let value = |s: &FieldSample| match quantity {
        Quantity::Intensity if s.occupancy >= 0.5 => s.hu,
        Quantity::Intensity => nothing,
        Quantity::Field => s.hu,
        Quantity::Occupancy => s.occupancy,
        Quantity::Weight => s.weight,
    };
    let (mut filled, size) = (0, volume.size);
    visit(&gpu, &splats, &set.field, size, |index, sample| {
        volume.samples[index] = value(sample);
        filled += usize::from(sample.weight > 0.0);
    })?;
    if filled == 0 {
        tracing::warn!("no splat reaches the grid: every voxel is {nothing}");
    }
    nifti::write(&arguments.output, &volume, arguments.force)?;
    let [x, y, z] = volume.size;
    if console.json {
        console.json_data(&serde_json::json!({
            "splats": splats.len(),
            "size": volume.size,
            "spacing_mm": volume.spacing_mm().to_array(),
            "reached_voxels": filled,
            "outputs": [arguments.output.display().to_string()],
        }))?;
    } else {
        console.say(&format!(
            "{}: {x} x {y} x {z} voxels, {filled} of them reached by {} splats",
            arguments.output.display(),
            splats.len()
        ));
    }
    Ok(0)
}

impl Arguments {
    /// The splats in the world, and a volume on the grid, whose samples are no matter.
    fn place(&self, splats: Unplaced) -> Result<(SplatSet, Volume)> {
        let Some(path) = &self.grid.like else {
            let set = splats.placed(None)?;
            let volume = self.grid.around(&set, &self.read)?;
            return Ok((set, volume));
        };
        let volume = Volume::read(path, &self.read.options())?;
        let FittedRegion { roi, roi_label } = &self.region;
        let roi = region_of(&volume, &self.read, roi.as_deref(), None, roi_label.as_deref())?;
        let set = splats.placed(Some(&place(&volume, roi.as_ref())))?;
        Ok((set, volume))
    }
}

impl GridArguments {
    /// An empty volume on a grid around the splats.
    fn around(&self, set: &SplatSet, read: &ReadArguments) -> Result<Volume> {
        let options = read.options();
        let spacing = self.spacing.unwrap_or(DVec3::ONE);
        let (low, high) = set
            .splats
            .iter()
            .map(|s| {
                let (mean, reach) = reach(s, &set.field);
                (mean - reach, mean + reach)
            })
            .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |a, b| (a.0.min(b.0), a.1.max(b.1)));
        let size = ((high - low) / spacing).ceil() + 1.0;
        let bytes = 4.0 * size.x * size.y * size.z;
        if bytes.is_nan() || bytes > options.max_bytes as f64 {
            let message = format!(
                "a grid of {:.0} x {:.0} x {:.0} voxels around the splats takes {bytes:.0} bytes, more than the limit \
                 of {}",
                size.x, size.y, size.z, options.max_bytes
            );
            return Err(Error::new(Kind::Usage, "VGS-CLI-051", message)
                .help("choose a larger --spacing, or raise --max-bytes"));
        }
        let size = size.to_array().map(|n| n as usize);
        let affine = DAffine3 { translation: low + set.origin_mm, ..DAffine3::from_scale(spacing) };
        Ok(Volume::new(size, affine, vec![0.0; size.iter().product()]))
    }
}

/// Mean of a splat, and how far it reaches along each axis of its space.
fn reach(splat: &Splat, field: &Field) -> (DVec3, DVec3) {
    let mean = DVec3::from_array(splat.mean.map(f64::from));
    let axes = splat.axes();
    let scale = splat.scale().map(f64::from);
    // Diagonal of R S² Rᵀ.
    let variance = (0..3).map(|k| (axes.col(k) * scale[k]).powf(2.0)).sum::<DVec3>();
    (mean, (variance * field.kernel.support_q()).powf(0.5))
}

/// First and last brick of the grid that a splat reaches; `None` if it lies outside.
fn bricks_of(splat: &Splat, field: &Field, size: [usize; 3]) -> Option<[[usize; 2]; 3]> {
    let (mean, reach) = reach(splat, field);
    let mut out = [[0; 2]; 3];
    for axis in 0..3 {
        let first = (mean[axis] - reach[axis]).ceil().max(0.0);
        let last = (mean[axis] + reach[axis]).floor().min(size[axis] as f64 - 1.0);
        // Also where one of them is NaN.
        if first.partial_cmp(&last).is_none_or(Ordering::is_gt) {
            return None;
        }
        out[axis] = [first as usize / BRICK, last as usize / BRICK];
    }
    Some(out)
}

/// Calls `take` with index and field of every voxel of a grid that a splat may reach; splats in its voxel space.
pub fn visit(
    gpu: &Gpu,
    splats: &[Splat],
    field: &Field,
    size: [usize; 3],
    mut take: impl FnMut(usize, &FieldSample),
) -> Result<()> {
    let grid = size.map(|n| n.div_ceil(BRICK));
    let boxes: Vec<_> = splats.par_iter().map(|s| bricks_of(s, field, size)).collect();
    let mut touched = vec![false; grid.iter().product()];
    for [x, y, z] in boxes.iter().flatten() {
        for bz in z[0]..=z[1] {
            for by in y[0]..=y[1] {
                let row = (bz * grid[1] + by) * grid[0];
                touched[row + x[0]..=row + x[1]].fill(true);
            }
        }
    }
    let layer = grid[0] * grid[1] * SAMPLES;
    let depth = (SLAB_SAMPLES / layer.max(1)).max(1);
    for first in (0..grid[2]).step_by(depth) {
        let last = (first + depth).min(grid[2]);
        let near: Vec<Splat> = splats
            .iter()
            .zip(&boxes)
            .filter(|(_, b)| b.is_some_and(|[_, _, z]| z[0] < last && z[1] >= first))
            .map(|(s, _)| *s)
            .collect();
        let low = IVec3::new(0, 0, (first * BRICK) as i32);
        let high = (last * BRICK).min(size[2]) - first * BRICK;
        let extent = UVec3::new(size[0] as u32, size[1] as u32, high as u32);
        let bricks = Bricks::of_box(low, extent, |v| {
            let [x, y, z] = (v / BRICK as u32).to_array().map(|n| n as usize);
            touched[((first + z) * grid[1] + y) * grid[0] + x]
        });
        if near.is_empty() || bricks.is_empty() {
            continue;
        }
        let samples = Sampler::new(gpu, &near, field, &bricks)?.sample([0.0; 3])?;
        for (i, sample) in samples.iter().enumerate() {
            let (slot, morton) = (i / SAMPLES, i % SAMPLES);
            if bricks.is_active(slot, morton) {
                let [x, y, z] = bricks.voxel(slot, morton).to_array().map(|n| n as usize);
                take((z * size[1] + y) * size[0] + x, sample);
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_splat_reaches_as_far_as_its_kernel() {
        let mut splat = Splat { mean: [20.0, 4.0, 4.0], rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
        splat.set_scale([2.0, 1.0, 1.0]);
        let field = Field::default();
        let (_, far) = reach(&splat, &field);
        assert!((far - DVec3::new(2.0, 1.0, 1.0) * 6f64.sqrt()).length() < 1e-6, "{far}");
        // From 15.1 to 24.9, and 1.6 to 6.4.
        assert_eq!(bricks_of(&splat, &field, [64, 64, 64]), Some([[2, 3], [0, 0], [0, 0]]));
        assert_eq!(bricks_of(&splat, &field, [8, 8, 8]), None);
    }

    #[test]
    fn spacings() {
        assert_eq!(spacing("0.5"), Ok(DVec3::splat(0.5)));
        assert_eq!(spacing("1,2,3"), Ok(DVec3::new(1.0, 2.0, 3.0)));
        for text in ["", "0", "-1", "1,2", "nan", "1e9"] {
            assert!(spacing(text).is_err(), "{text}");
        }
    }
}
