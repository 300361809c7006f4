//! Writes a synthetic CT with a mask, for trying things out without a patient (`vgs phantom`).

use std::path::PathBuf;

use clap::Args;
use engine::volume::phantom::Phantom;
use engine::volume::{self, Volume};
use engine::{Error, Kind};
use glam::DVec3;

use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::flags::spacing;
use crate::shared::outputs;

/// Writes a synthetic CT (body, bone, contrast-filled vessels) and the mask of its bone and vessels
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct PhantomArguments {
    /// The CT (.nii, .nii.gz or .zarr), or a folder for ct.nii.gz and mask.nii.gz, made if missing
    #[arg(short, long, value_name = "CT|FOLDER", help_heading = "Output")]
    output: PathBuf,
    /// The mask, if the CT was named
    #[arg(long, value_name = "MASK", help_heading = "Output")]
    mask: Option<PathBuf>,
    /// Replaces outputs that exist
    #[arg(short, long, help_heading = "Output")]
    force: bool,
    /// Voxels along x, y, z, or one number for all
    #[arg(long, value_name = "X,Y,Z", default_value = "64,64,64", value_parser = size)]
    size: [usize; 3],
    /// Distance of voxel centres, mm: one number or three
    #[arg(long, value_name = "MM", default_value = "1,1,1", value_parser = spacing)]
    spacing: DVec3,
    /// Places and shapes bone and vessels
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
}

const EXAMPLES: &str = "\
Examples:
  vgs phantom -o phantom
  vgs phantom -o ct.nii.gz --mask mask.nii.gz --size 128 --spacing 0.8 --seed 3
  vgs fit phantom/ct.nii.gz --roi phantom/mask.nii.gz -o phantom/splats.ply";

/// Voxels of the largest phantom: 2 GiB as the reader takes them by default.
const MOST_VOXELS: usize = 1 << 29;

fn size(text: &str) -> Result<[usize; 3], String> {
    let numbers: Result<Vec<usize>, _> = text.split(',').map(|t| t.trim().parse::<usize>()).collect();
    let size = match numbers.as_deref() {
        Ok(&[n]) => [n; 3],
        Ok(&[x, y, z]) => [x, y, z],
        _ => return Err("one whole number or three with commas between are needed".into()),
    };
    let voxels = size.iter().try_fold(1usize, |product, &n| product.checked_mul(n));
    match voxels {
        Some(n) if n > 0 && n <= MOST_VOXELS => Ok(size),
        _ => Err(format!("1 to {MOST_VOXELS} voxels in all")),
    }
}

/// Runs the command.
pub fn run(arguments: &PhantomArguments, console: &Console) -> Result<u8, Stop> {
    let name = arguments.output.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let is_file = [".nii", ".nii.gz", ".zarr"].iter().any(|ending| name.ends_with(ending));
    let (ct, mask) = match (is_file, &arguments.mask) {
        (true, mask) => (arguments.output.clone(), mask.clone()),
        (false, None) => (arguments.output.join("ct.nii.gz"), Some(arguments.output.join("mask.nii.gz"))),
        (false, Some(_)) => {
            let message = "--mask goes with a CT that ends in .nii, .nii.gz or .zarr, not with a folder";
            return Err(Error::new(Kind::Usage, "VGS-CLI-060", message).file(&arguments.output).into());
        }
    };
    if !is_file {
        outputs::make_folder(&arguments.output)?;
    }
    let mut files = vec![ct.as_path()];
    files.extend(mask.as_deref());
    outputs::check(&files, &[], arguments.force)?;

    let phantom = Phantom::new(arguments.size, arguments.spacing, arguments.seed);
    let volume = phantom.volume();
    let roi = phantom.roi()?;
    let voxels = roi.voxel_count();
    volume::write(&ct, &volume, arguments.force)?;
    if let Some(path) = &mask {
        volume::write(path, &Volume { samples: roi.weight, ..volume }, arguments.force)?;
    }
    let written: Vec<_> = files.iter().map(|p| p.display().to_string()).collect();
    if console.json {
        console.json_data(&serde_json::json!({
            "size": arguments.size,
            "spacing_mm": arguments.spacing.to_array(),
            "seed": arguments.seed,
            "roi_voxels": voxels,
            "outputs": written,
        }))?;
    } else {
        console.say(&format!("written: {} ({voxels} voxels of bone and vessels)", written.join(", ")));
    }
    Ok(0)
}

#[cfg(test)]
mod tests {
    #[test]
    fn sizes() {
        assert_eq!(super::size("5"), Ok([5; 3]));
        assert_eq!(super::size("5, 6,7"), Ok([5, 6, 7]));
        for text in ["", "0", "1,2", "-1", "100000", "4294967296,4294967296,4294967296", "a"] {
            assert!(super::size(text).is_err(), "{text}");
        }
    }
}
