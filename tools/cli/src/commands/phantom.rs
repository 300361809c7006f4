//! Writes a synthetic CT with a mask, for trying things out without a patient (`vgs phantom`).

use std::path::PathBuf;

use clap::Args;
use engine::volume;
use engine::volume::phantom::Phantom;
use engine::{Error, Kind};
use glam::DVec3;

use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::flags::spacing;
use crate::shared::outputs;
use crate::shared::waiting::Waiting;

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
  vgs phantom -o scan.zarr --mask bone.zarr --size 2048     # 34 GB that memory never holds
  vgs fit phantom/ct.nii.gz --roi phantom/mask.nii.gz -o phantom/splats.ply";

/// Voxels of the largest phantom in one file: 2 GiB as the reader takes them by default.
const MOST_VOXELS: usize = 1 << 29;

/// Voxels of the longest edge.
const MOST_EDGE: usize = 1 << 13;

fn size(text: &str) -> Result<[usize; 3], String> {
    let numbers: Result<Vec<usize>, _> = text.split(',').map(|t| t.trim().parse::<usize>()).collect();
    let size = match numbers.as_deref() {
        Ok(&[n]) => [n; 3],
        Ok(&[x, y, z]) => [x, y, z],
        _ => return Err("one whole number or three with commas between are needed".into()),
    };
    match size.iter().all(|n| (1..=MOST_EDGE).contains(n)) {
        true => Ok(size),
        false => Err(format!("1 to {MOST_EDGE} voxels along each axis")),
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

    let count: usize = arguments.size.iter().product();
    if let Some(file) = files.iter().find(|file| count > MOST_VOXELS && !volume::is_zarr(file)) {
        let message = format!("{count} voxels in one file, which can have {MOST_VOXELS}");
        let error = Error::new(Kind::Usage, "VGS-CLI-193", message).file(*file);
        return Err(error.help("name outputs that end in .zarr, or choose a smaller --size").into());
    }

    let phantom = Phantom::new(arguments.size, arguments.spacing, arguments.seed);
    let voxels = phantom.roi_voxels()?;
    let _waiting = Waiting::on(format!("writing {}", ct.display()));
    volume::write_by_boxes(&ct, &phantom.ct(), arguments.force)?;
    if let Some(path) = &mask {
        volume::write_by_boxes(path, &phantom.mask(), arguments.force)?;
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
        for text in ["", "0", "1,2", "-1", "8193", "4294967296,4294967296,4294967296", "a"] {
            assert!(super::size(text).is_err(), "{text}");
        }
    }
}
