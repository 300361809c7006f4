//! The intensities of a region coded so that none is off by more than a bound, beside splats of as many bytes.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use engine::coded::coded;
use engine::splat::{self, vgs};
use engine::volume::{LabelChoice, ReadOptions, Roi, Volume};
use engine::{Error, Kind, Result};
use serde::Serialize;

/// Bytes, errors and times of a volume's region as `vgs convert` codes it, as a line of JSON for each bound.
#[derive(Args)]
pub struct CodeArguments {
    /// The volume; its intensities are rounded to whole numbers and clamped to -1024 to 3071.
    volume: PathBuf,
    /// The mask of the region; without one all voxels.
    #[arg(long)]
    roi: Option<PathBuf>,
    /// Greatest errors of a voxel, in the unit of the intensities.
    #[arg(long, value_delimiter = ',', default_value = "0,6,15,30,60")]
    bounds: Vec<u32>,
}

#[derive(Serialize)]
struct Coded {
    bound: u32,
    voxels: usize,
    region_bytes: usize,
    /// The rest of the file.
    value_bytes: usize,
    rmse: f64,
    greatest_error: f64,
    encoding_s: f64,
    decoding_s: f64,
}

/// Codes the region with each bound, and prints what that takes.
pub fn run(arguments: &CodeArguments) -> Result<()> {
    let mut volume = Volume::read(&arguments.volume, &ReadOptions::default())?;
    volume.samples.iter_mut().for_each(|v| *v = v.clamp(-1024.0, 3071.0).round());
    let roi = match &arguments.roi {
        Some(path) => {
            let mask = Volume::read(path, &ReadOptions::default())?;
            Roi::from_mask(&mask, &LabelChoice::Whole, &volume)?
        }
        None => Roi::new(vec![1.0; volume.len()], &volume)?,
    };
    let broken = || Error::new(Kind::Internal, "VGS-BEN-063", "what was coded is not what is read");
    for &bound in &arguments.bounds {
        let begin = Instant::now();
        let set = coded(&volume, &roi, None, f64::from(bound))?;
        let file = vgs::encode(&set)?;
        let encoding_s = begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        let (read, _) = vgs::decode(&file, &splat::ReadOptions::default())?;
        let decoding_s = begin.elapsed().as_secs_f64();
        let (Some(region), Some(voxels)) = (&read.region, read.voxels.first()) else { return Err(broken()) };
        let (mut squares, mut greatest_error, mut count) = (0.0, 0.0f64, 0);
        for (voxel, _) in region.voxels() {
            let [x, y, z] = voxel.map(|at| at as usize);
            let found = voxels.at(voxel.map(i64::from)).ok_or_else(broken)?;
            let error = (found - f64::from(volume.samples[volume.index(x, y, z)])).abs();
            (squares, greatest_error, count) =
                (squares + error * error, greatest_error.max(error), count + 1);
        }
        let region_bytes = region.encode().len();
        let coded = Coded {
            bound,
            voxels: count,
            region_bytes,
            value_bytes: file.len() - region_bytes,
            rmse: (squares / count.max(1) as f64).sqrt(),
            greatest_error,
            encoding_s,
            decoding_s,
        };
        println!("{}", serde_json::to_string(&coded).map_err(|_| broken())?);
    }
    Ok(())
}
