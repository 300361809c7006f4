//! Turns splats back into a volume (`vgs rasterize`).

use std::path::PathBuf;

use clap::{ArgGroup, Args, ValueEnum};
use engine::fit::place::place;
use engine::rasterize::{self, grid_around, rasterize};
use engine::splat::{SplatSet, Unplaced};
use engine::volume::{self, Volume};
use engine::{Error, Kind, Result};
use glam::DVec3;

use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::flags::{DeviceArguments, spacing};
use crate::shared::inputs::{CleaningArguments, ReadArguments, region_of};
use crate::shared::{outputs, splat_files};

/// Turns splats back into a volume
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct RasterizeArguments {
    /// The splats (PLY with intensities; also that of the paper's authors)
    splats: PathBuf,
    #[command(flatten)]
    grid: GridArguments,
    #[command(flatten)]
    region: FittedRegion,
    /// Where the volume goes, float32: .nii, .nii.gz, or .zarr (OME-Zarr)
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
    #[arg(long, value_name = "N|NAME|...", requires = "roi")]
    roi_label: Option<String>,
}

/// A quantity of the field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Quantity {
    /// HU where the occupancy is one half or more
    Intensity,
    /// HU everywhere, as vgs eval takes it; far from all splats that of the background
    Field,
    /// From 0 to 1; of a fit to a binary mask, at the voxels, 0 or 1
    Occupancy,
    /// The summed weight of the splats
    Weight,
}

impl Quantity {
    fn of(self, outside: f32) -> rasterize::Quantity {
        match self {
            Quantity::Intensity => rasterize::Quantity::Intensity { outside },
            Quantity::Field => rasterize::Quantity::Field,
            Quantity::Occupancy => rasterize::Quantity::Occupancy,
            Quantity::Weight => rasterize::Quantity::Weight,
        }
    }
}

const EXAMPLES: &str = "\
Examples:
  vgs rasterize bones.ply --like ct.nii.gz -o bones.nii.gz
  vgs rasterize bones.ply --like ct.nii.gz -o mask.nii.gz --quantity occupancy
  vgs rasterize bones.ply --like ct.nii.gz -o field.nii.gz --quantity field       to compare with ct.nii.gz
  vgs rasterize bones.ply --spacing 0.5 -o fine.zarr
  vgs rasterize theirs.ply --like ct.nii.gz --roi bones.nii.gz -o theirs.nii.gz     a PLY of the paper's authors";

/// Runs the command.
pub fn run(arguments: &RasterizeArguments, console: &Console) -> std::result::Result<u8, Stop> {
    let mut inputs = vec![arguments.splats.as_path()];
    inputs.extend(arguments.grid.like.as_deref());
    inputs.extend(arguments.region.roi.as_deref());
    outputs::check(&[&arguments.output], &inputs, arguments.force)?;
    volume::check_output(&arguments.output, arguments.force)?;
    let read = splat_files::read_with_intensity(&arguments.splats)?;
    let (set, mut volume) = arguments.place(read)?;
    let gpu = arguments.device.boot()?;
    let quantity = arguments.quantity.of(arguments.outside);
    let filled = rasterize(&gpu, &set, quantity, &mut volume)?;
    if filled == 0 {
        tracing::warn!("no splat reaches the grid: every voxel is {}", volume.samples[0]);
    }
    volume::write(&arguments.output, &volume, arguments.force)?;
    let [x, y, z] = volume.size;
    if console.json {
        console.json_data(&serde_json::json!({
            "splats": set.splats.len(),
            "size": volume.size,
            "spacing_mm": volume.spacing_mm().to_array(),
            "reached_voxels": filled,
            "outputs": [arguments.output.display().to_string()],
        }))?;
    } else {
        console.say(&format!(
            "{}: {x} x {y} x {z} voxels, {filled} of them reached by {} {}",
            arguments.output.display(),
            set.count(),
            if set.splats.is_empty() { "coded voxels" } else { "splats" }
        ));
    }
    Ok(0)
}

impl RasterizeArguments {
    /// Returns the splats in patient space, and a volume on the grid of the output whose samples are still to
    /// be filled.
    fn place(&self, splats: Unplaced) -> Result<(SplatSet, Volume)> {
        let Some(path) = &self.grid.like else {
            let set = splats.placed(None)?;
            let volume = self.grid.around(&set, &self.read)?;
            return Ok((set, volume));
        };
        let volume = Volume::read(path, &self.read.options())?;
        let FittedRegion { roi, roi_label } = &self.region;
        let no_threshold = (None, &CleaningArguments::default());
        let roi = region_of(&volume, &self.read, roi.as_deref(), no_threshold, roi_label.as_deref())?;
        let set = splats.placed(Some(&place(&volume, roi.as_ref())))?;
        Ok((set, volume))
    }
}

impl GridArguments {
    /// Returns an empty volume on a grid around the splats.
    fn around(&self, set: &SplatSet, read: &ReadArguments) -> Result<Volume> {
        let options = read.options();
        let spacing = self.spacing.unwrap_or(DVec3::ONE);
        let grid = grid_around(set, spacing);
        let size = DVec3::from_array(grid.size.map(f64::from));
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
        let size = grid.size.map(|n| n as usize);
        Ok(Volume::new(size, grid.world_from_voxel, vec![0.0; size.iter().product()]))
    }
}
