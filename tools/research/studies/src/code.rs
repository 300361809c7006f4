//! The intensities of a region coded so that none is off by more than a bound, beside splats of as many bytes.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use engine::splat::Region;
use engine::splat::vgs::values::{self, Shape};
use engine::volume::{LabelChoice, ReadOptions, Roi, Volume};
use engine::{Error, Kind, Result};
use serde::Serialize;

/// Bytes, errors and times of a volume's region in the near-lossless coder, as a line of JSON for each bound.
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
    value_bytes: usize,
    rmse: f64,
    greatest_error: i32,
    encoding_s: f64,
    decoding_s: f64,
}

/// Codes the region with each bound, and prints what that takes.
pub fn run(arguments: &CodeArguments) -> Result<()> {
    let volume = Volume::read(&arguments.volume, &ReadOptions::default())?;
    let inside: Vec<bool> = match &arguments.roi {
        Some(path) => {
            let mask = Volume::read(path, &ReadOptions::default())?;
            let roi = Roi::from_mask(&mask, &LabelChoice::Whole, &volume)?;
            roi.weight.iter().map(|&weight| weight > 0.5).collect()
        }
        None => vec![true; volume.len()],
    };
    let broken = || Error::new(Kind::Internal, "VGS-BEN-063", "what was coded is not what is read");
    let region = Region::of(volume.size, |i| inside[i].then_some(0)).ok_or_else(broken)?;
    let [first, end] = region.bounds();
    let size = [0, 1, 2].map(|k| (end[k] - first[k]) as usize);
    let shape = Shape { size, numbers: region.kinds() };
    let within = (0..volume.len()).filter(|&i| inside[i]);
    let codes: Vec<i32> = within.map(|i| volume.samples[i].clamp(-1024.0, 3071.0).round() as i32).collect();
    let region_bytes = region.encode().len();
    for &bound in &arguments.bounds {
        let begin = Instant::now();
        let slabs = values::encode(&codes, shape, bound);
        let encoding_s = begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        let found = values::decode(&slabs, shape, bound).ok_or_else(broken)?;
        let decoding_s = begin.elapsed().as_secs_f64();
        let errors = || found.iter().zip(&codes).map(|(a, b)| (a - b).abs());
        let squares: f64 = errors().map(|error| f64::from(error).powi(2)).sum();
        let coded = Coded {
            bound,
            voxels: codes.len(),
            region_bytes,
            value_bytes: slabs.iter().map(Vec::len).sum(),
            rmse: (squares / codes.len() as f64).sqrt(),
            greatest_error: errors().max().unwrap_or(0),
            encoding_s,
            decoding_s,
        };
        println!("{}", serde_json::to_string(&coded).map_err(|_| broken())?);
    }
    Ok(())
}
