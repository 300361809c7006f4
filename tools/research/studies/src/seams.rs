//! `studies seams`: whether a region that was fitted in blocks has larger errors where they meet.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use engine::gpu::Gpu;
use engine::rasterize::{Quantity, rasterize};
use engine::splat::{self, ReadOptions, SplatSet};
use engine::volume::{self, Volume};
use engine::{Error, Kind, Result, output};
use glam::DVec3;

/// The error of a fit in blocks near seams and elsewhere, and of one fit at the same voxels.
#[derive(Args)]
#[command(after_help = "\
Example:
  vgs blocks ct.nii.gz --roi bones.nii.gz --edge 40 -o blocks.csv
  vgs batch blocks.csv -o bones --format vgs
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.vgs
  studies seams ct.nii.gz --whole bones.vgs bones/*.vgs")]
pub struct SeamsArguments {
    /// The volume.
    volume: PathBuf,
    /// The fits of the blocks.
    #[arg(required = true, value_name = "BLOCKS")]
    blocks: Vec<PathBuf>,
    /// One fit of the same region.
    #[arg(long)]
    whole: PathBuf,
    /// A voxel is near a seam if, along an axis, one of another block is at most so many voxels away.
    #[arg(long, default_value_t = 4)]
    near: usize,
    /// File for a row of each way to fit (CSV).
    #[arg(long, default_value = "seams.csv")]
    out: PathBuf,
    /// Replaces it.
    #[arg(long)]
    force: bool,
}

/// What each voxel of the grid belongs to.
const NOTHING: u16 = u16::MAX;

/// Reads, decodes and compares.
///
/// # Errors
/// Those of reading and of the device; [`Kind::Usage`] for splats without a region.
pub fn run(gpu: &Gpu, arguments: &SeamsArguments) -> Result<()> {
    output::check_writable(&arguments.out, arguments.force)?;
    let volume = Volume::read(&arguments.volume, &volume::ReadOptions::default())?;
    let mut owners = vec![NOTHING; volume.len()];
    let mut of_blocks = vec![f32::NAN; volume.len()];
    let mut field = volume.clone();
    let (mut splats, mut bytes) = (0, 0);
    for (number, path) in arguments.blocks.iter().enumerate() {
        let set = of_region(path)?;
        rasterize(gpu, &set, Quantity::Field, &mut field)?;
        for i in members(&set, &volume) {
            owners[i] = number as u16;
            of_blocks[i] = field.samples[i];
        }
        splats += set.splats.len();
        bytes += splat::file_bytes(Path::new("x.vgs"), &set, &splat::WriteOptions::default())?;
    }
    let whole = of_region(&arguments.whole)?;
    rasterize(gpu, &whole, Quantity::Field, &mut field)?;
    let near = near_seams(&owners, volume.size, arguments.near);
    let range = volume.min_max().map_or(1.0, |(low, high)| f64::from(high) - f64::from(low));
    let mut table = "case,fit,blocks,splats,bytes,voxels,near,near_db,elsewhere_db,all_db\n".to_owned();
    let case = arguments.whole.file_stem().unwrap_or_default().to_string_lossy();
    let whole_bytes = splat::file_bytes(Path::new("x.vgs"), &whole, &splat::WriteOptions::default())?;
    for (name, blocks, splats, bytes, samples) in [
        ("blocks", arguments.blocks.len(), splats, bytes, &of_blocks),
        ("whole", 1, whole.splats.len(), whole_bytes, &field.samples),
    ] {
        let psnr = |wanted: &dyn Fn(usize) -> bool| {
            let of = (0..owners.len()).filter(|&i| owners[i] != NOTHING && wanted(i));
            let error = |i: usize| f64::from(samples[i]) - f64::from(volume.samples[i]);
            let (sum, count) = of.fold((0.0, 0usize), |(sum, n), i| (sum + error(i).powi(2), n + 1));
            (20.0 * range.log10() - 10.0 * (sum / count.max(1) as f64).log10(), count)
        };
        let [(near_db, beside), (elsewhere, _), (all, voxels)] =
            [psnr(&|i| near[i]), psnr(&|i| !near[i]), psnr(&|_| true)];
        let row = format!(
            "{case},{name},{blocks},{splats},{bytes},{voxels},{beside},{near_db:.2},{elsewhere:.2},{all:.2}"
        );
        println!("{row}");
        let _ = writeln!(table, "{row}");
    }
    output::write_atomic(&arguments.out, arguments.force, |file| file.write_all(table.as_bytes()))
}

/// Reads splats that know the region that they were fitted to.
fn of_region(path: &Path) -> Result<SplatSet> {
    let set = splat::read(path, &ReadOptions::default())?;
    if set.region.is_some() && set.grid.is_some() {
        return Ok(set);
    }
    let message = "splats without a region";
    Err(Error::new(Kind::Usage, "VGS-BEN-066", message).file(path).help("fit them to a binary mask"))
}

/// Returns the indices of the volume's voxels in a set's region, which may have more slices than the volume.
fn members(set: &SplatSet, volume: &Volume) -> Vec<usize> {
    let (Some(region), Some(grid)) = (&set.region, &set.grid) else { return Vec::new() };
    let into = grid.world_from_voxel.inverse() * volume.world_from_voxel;
    let [nx, ny, _] = volume.size;
    let is_in = |&i: &usize| {
        let at = DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / (nx * ny)) as f64);
        region.at(into.transform_point3(at).round().to_array().map(|v| v as i64)).is_some()
    };
    (0..volume.len()).filter(is_in).collect()
}

/// Returns, of each voxel, whether one of another owner is at most `reach` away along an axis.
fn near_seams(owners: &[u16], size: [usize; 3], reach: usize) -> Vec<bool> {
    let strides = [1, size[0], size[0] * size[1]];
    let near = |i: usize| {
        let own = owners[i];
        own != NOTHING
            && (0..3).any(|k| {
                let at = i / strides[k] % size[k];
                let (low, high) = (at.saturating_sub(reach), (at + reach).min(size[k] - 1));
                (low..=high).any(|to| {
                    let other = owners[i - at * strides[k] + to * strides[k]];
                    other != own && other != NOTHING
                })
            })
    };
    (0..owners.len()).map(near).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seam_is_where_another_block_is_near_along_an_axis() {
        // Two blocks in a row of 6, one voxel between them empty in the second row, and a third row of one block.
        let n = NOTHING;
        let owners = [0, 0, 0, 1, 1, 1, 0, 0, n, n, n, 1, 0, 0, 0, 0, 0, 0];
        let near = near_seams(&owners, [6, 3, 1], 1);
        let wanted =
            [[false, false, true, true, false, false], [false; 6], [false, false, false, false, false, true]];
        assert_eq!(near[..6], wanted[0]);
        assert_eq!(near[6..11], wanted[1][..5]);
        assert!(near[11], "above it is the third row");
        assert_eq!(near[12..], wanted[2]);
    }
}
