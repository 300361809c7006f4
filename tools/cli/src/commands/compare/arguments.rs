//! Flags of `vgs compare`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use engine::Error;

use crate::shared::flags::{Range, any_range, pair};
use crate::shared::inputs::{CleaningArguments, ReadArguments, is_volume};

/// Tells how different two pictures are, or two volumes inside a region
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct CompareArguments {
    /// A picture (PNG or EXR) or a volume; the reference where one is
    pub a: PathBuf,
    /// Another of the same size, or on the same grid
    pub b: PathBuf,
    #[command(flatten)]
    pub volumes: VolumeArguments,
    #[command(flatten)]
    pub read: ReadArguments,
    /// Of pictures: both and a map of their differences side by side
    #[arg(long, value_name = "FILE.png", help_heading = "Output")]
    pub diff: Option<PathBuf>,
    /// What the map shows
    #[arg(long, value_enum, default_value_t = Map::Flip, requires = "diff", help_heading = "Output")]
    pub map: Map,
    /// Replaces an output that exists
    #[arg(short, long, help_heading = "Output")]
    pub force: bool,
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

/// Quantity in a map of differences.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Map {
    /// How strongly the difference is seen, on a scale from 0 to 1
    Flip,
    /// The greatest of |A-B| in red, green and blue, amplified to a round scale
    Absolute,
}

/// Region and range in which two volumes are compared.
#[derive(Args, Debug)]
#[group(skip)]
#[command(next_help_heading = "Volumes")]
pub struct VolumeArguments {
    /// Compares inside this mask of the first volume [default: everywhere]
    #[arg(long, value_name = "MASK", conflicts_with = "roi_threshold")]
    pub roi: Option<PathBuf>,
    /// Or where the first volume is from LOW to HIGH, HU
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair, allow_hyphen_values = true)]
    pub roi_threshold: Option<[f32; 2]>,
    /// Which labels of the mask, by number or name
    #[arg(long, value_name = "N|NAME|...", requires = "roi")]
    pub roi_label: Option<String>,
    #[command(flatten)]
    pub cleaning: CleaningArguments,
    /// What the PSNR is over: two HU, or roi for the range of the first volume inside the region; both
    /// volumes are clipped to it. Or own: each volume over its own full range [default: the full range of the
    /// first]
    #[arg(long, value_name = "LOW,HIGH|roi|own", value_parser = any_range, allow_hyphen_values = true)]
    pub range: Option<Range>,
}

impl VolumeArguments {
    /// Returns true if any of the flags is given.
    pub fn are_given(&self) -> bool {
        self.roi.is_some() || self.roi_threshold.is_some() || self.range.is_some()
    }
}

impl CompareArguments {
    /// Returns true if volumes are compared: by the name of the first file, or by flags that only volumes
    /// have.
    pub fn of_volumes(&self) -> bool {
        self.volumes.are_given() || is_volume(&self.a)
    }

    /// Adds the names of both files to an error of the pair.
    pub fn name_both(&self, error: Error) -> Error {
        let message = format!("{} and {}: {}", self.a.display(), self.b.display(), error.message);
        Error { message, ..error }
    }
}
