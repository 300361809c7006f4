//! Flags of `vgs fit`.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::Args;
use engine::Result;
use engine::volume::{self, ReadOptions, Volume};

use super::checkpoint::CheckpointArguments;
use super::settings::SettingsArguments;
use crate::shared::flags::{DeviceArguments, Range, bytes, duration, range_or_roi};
use crate::shared::inputs::{InputRecord, ReadArguments, RoiArguments};
use crate::shared::splat_files::LayoutArguments;

/// Fits splats to the region of interest of a volume
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct FitArguments {
    /// The volume: a file (NIfTI, NRRD, MetaImage, ...) or a folder of DICOM slices
    pub volume: PathBuf,
    #[command(flatten)]
    pub region: RoiArguments,
    /// Where the splats go: .ply for all programs, or .vgs, which is small and rounded. Beside a.ply: a.run.json
    /// (record), a.csv and a.svg (curve); beside a.vgs: a.vgs.run.json, ...
    #[arg(short, long, value_name = "OUT", help_heading = "Output")]
    pub output: PathBuf,
    /// Replaces outputs that exist
    #[arg(short, long, help_heading = "Output")]
    pub force: bool,
    /// Slices and shaded views of CT, splats and difference, as `vgs eval` draws them
    #[arg(long, value_name = "FILE.png", help_heading = "Output", conflicts_with = "no_eval")]
    pub picture: Option<PathBuf>,
    /// Leaves out the closing evaluation
    #[arg(long, help_heading = "Output")]
    pub no_eval: bool,
    /// What the PSNR of the closing evaluation is over: two HU, or roi for the volume's range inside the
    /// region [default: the range of the whole volume]
    #[arg(long, value_name = "LOW,HIGH|roi", value_parser = range_or_roi, allow_hyphen_values = true,
          help_heading = "Output")]
    pub eval_range: Option<Range>,
    /// Sub-voxel offset grids of the closing evaluation
    #[arg(long, value_name = "N", default_value_t = 4, help_heading = "Output",
          value_parser = clap::value_parser!(u32).range(0..=64))]
    pub eval_offsets: u32,
    /// Says first what the fit will cost on this device: time, memory, file, error. The record then has both
    /// that and what it came to
    #[arg(long, help_heading = "Output", conflicts_with = "resume")]
    pub explain: bool,
    /// Says it and does not fit; nothing is written
    #[arg(long, help_heading = "Output", conflicts_with_all = ["resume", "explain"])]
    pub dry_run: bool,
    /// Most bytes that the file of the splats may have; K, M, G stand for powers of 1024. As many splats are
    /// fitted as it holds, or fewer if something else says so
    #[arg(long, value_name = "BYTES", value_parser = bytes, help_heading = "Output")]
    pub max_size: Option<u64>,
    #[command(flatten)]
    pub layout: LayoutArguments,
    #[command(flatten)]
    pub checkpoint: CheckpointArguments,
    #[command(flatten)]
    pub read: ReadArguments,
    /// Time until the splats are ready (90s, 5m), reading included: as many iterations as it allows are done,
    /// and the schedule follows the clock. Two runs then differ. --iterations limits it only where it is
    /// given
    #[arg(long, value_name = "TIME", value_parser = duration, help_heading = "Settings")]
    pub time_budget: Option<Duration>,
    #[command(flatten)]
    pub device: DeviceArguments,
    #[command(flatten)]
    pub settings: SettingsArguments,
}

const EXAMPLES: &str = "\
Examples:
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply --quality fine --dry-run     what that would cost
  vgs fit ct.nii.gz --roi labels.nii.gz --roi-label liver,aorta -o organs.ply --density 0.2
  vgs fit skull.inv3 --roi-threshold 226,3071 -o skull.ply --time-budget 5m
  vgs fit scans/ --series 3 --roi bones.nii.gz -o bones.ply     a DICOM series; vgs info scans/ lists them
  vgs fit ct.nii.gz --roi-threshold 200,3000 --roi-largest --roi-close 2 --roi-fill -o bone.ply
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.vgs     an eighth of the bytes, in 1.8 times the time
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply --target-psnr 45     as few splats as that takes
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.vgs --max-size 500K      as good as that can be
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply --config best.toml --json
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply --kernel gaussian --ply-layout reference
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply --profile paper --subset 4000 --checkpoint-every 100
  vgs fit ct.nii.gz --roi bones.nii.gz -o bones.ply --profile paper --subset 4000 --resume";

impl FitArguments {
    /// Returns the files that the fit reads.
    pub fn inputs(&self) -> Vec<&Path> {
        let mut inputs = vec![self.volume.as_path()];
        inputs.extend(self.region.roi.as_deref());
        inputs
    }

    /// Returns true if existing outputs may be replaced. A resumed fit may replace what the interrupted one
    /// has written, and a dry run writes nothing.
    pub fn replaces_outputs(&self) -> bool {
        self.force || self.checkpoint.resume || self.dry_run
    }

    /// Returns true if a flag that is none of the settings limits what the fit may cost.
    pub fn is_limited(&self) -> bool {
        self.time_budget.is_some() || self.max_size.is_some()
    }

    /// Returns the records of the input files; of stores of chunks, those of the part that is read.
    pub fn input_records(&self) -> Result<BTreeMap<&'static str, InputRecord>> {
        let options = self.read.options();
        // Of other files the whole is read in any case.
        let is_store = !volume::levels(&self.volume)?.is_empty();
        let grid_of = |[first, size]: [[usize; 3]; 2]| {
            Volume::open(&self.volume, &options).map(|volume| volume.grid().of_box(first, size))
        };
        let voxels = self.read.voxels.filter(|_| is_store);
        let voxels = voxels
            .map(|ends| [ends.map(|[first, _]| first), ends.map(|[first, end]| end.saturating_sub(first))]);
        let part = voxels.map(grid_of).transpose()?;
        let record = |path: &Path, options: &ReadOptions| match &part {
            Some(part) => InputRecord::of_part(path, options, part),
            None => InputRecord::of(path),
        };
        let mut records = BTreeMap::from([("volume", record(&self.volume, &options)?)]);
        if let Some(mask) = &self.region.roi {
            let single = ReadOptions { volume_index: None, series: None, ..options };
            records.insert("roi", record(mask, &single)?);
        }
        Ok(records)
    }
}
