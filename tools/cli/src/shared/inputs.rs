//! Volume and region of interest of a command, and the records of their files.

use std::collections::HashMap;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::{LazyLock, Mutex, PoisonError};
use std::time::SystemTime;

use clap::{ArgGroup, Args};
use engine::unit::Unit;
use engine::volume::{
    self, Cleaning, FORMATS, Format, Grid, LabelChoice, Labels, ReadOptions, Roi, Volume, files_of, npy,
};
use engine::{Error, Kind, Result};
use glam::DVec3;
use serde::Serialize;
use sha2::{Digest, Sha256};

use super::flags::{Range, bytes, pair, spacing, unit, voxels};
use super::padding::Padding;
use super::waiting::Waiting;

/// Returns true if a path has the name of a volume, or is a folder, as of DICOM slices.
pub fn is_volume(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let mut endings = FORMATS.iter().flat_map(|format| format.extensions);
    path.is_dir() || endings.any(|ending| name.ends_with(ending))
}

/// Flags for reading volumes.
#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Input")]
pub struct ReadArguments {
    /// Which volume of a series (4-D file), counted from 0
    #[arg(long, value_name = "N")]
    pub volume_index: Option<usize>,
    /// Which resolution of an OME-Zarr image, from 0, the finest and the default; `vgs info` lists them
    #[arg(long, value_name = "N")]
    pub level: Option<usize>,
    /// Only these voxels, as 0:512,100:400,0:90 along x, y and z, up to the one before the last number; of a file that is
    /// not compressed, and of chunks, no others are read
    #[arg(long, value_name = "X:X,Y:Y,Z:Z", value_parser = voxels)]
    pub voxels: Option<[[usize; 2]; 3]>,
    /// Which series of a DICOM folder: its number in `vgs info`, its UID, or a part of its description
    #[arg(long, value_name = "N|TEXT")]
    pub series: Option<String>,
    /// How far voxels are apart along x, y, z, mm, in a file that does not say (.npy) [default: 1]
    #[arg(long, value_name = "MM", value_parser = spacing)]
    pub voxel_mm: Option<DVec3>,
    /// What the values of the volume are: hu, of a CT, or arbitrary, of any other scan [default: told by the file, its
    /// name or its values]
    #[arg(long, value_name = "hu|arbitrary", value_parser = unit)]
    pub unit: Option<Unit>,
    /// Largest volume that is accepted, bytes; K, M, G stand for powers of 1024 [default: 2G]
    #[arg(long, value_name = "BYTES", value_parser = bytes, env = "VGS_MAX_BYTES", hide_env = true)]
    pub max_bytes: Option<u64>,
    /// Accepts damage that leaves every voxel readable
    #[arg(long)]
    pub lenient: bool,
}

impl ReadArguments {
    /// Returns the options with which the volume is read.
    pub fn options(&self) -> ReadOptions {
        let default = ReadOptions::default();
        ReadOptions {
            max_bytes: self.max_bytes.unwrap_or(default.max_bytes),
            volume_index: self.volume_index,
            level: self.level,
            voxels: self.voxels,
            series: self.series.clone(),
            lenient: self.lenient,
            spacing_mm: self.voxel_mm,
            unit: self.unit,
            ..default
        }
    }
}

/// Flags of the region of interest.
#[derive(Args, Clone, Debug)]
#[group(skip)]
#[command(
    next_help_heading = "Region of interest",
    group = ArgGroup::new("region").required(true).args(["roi", "roi_threshold"])
)]
pub struct RoiArguments {
    /// Mask file: 0 and 1, soft in [0, 1], or labels
    #[arg(long, value_name = "MASK")]
    pub roi: Option<PathBuf>,
    /// Instead of a mask: the voxels from LOW to HIGH, HU
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair, allow_hyphen_values = true)]
    pub roi_threshold: Option<[f32; 2]>,
    /// Which labels of the mask, with commas between them: numbers, names, ranges (1-24), patterns (rib_*, *_left)
    /// or all; a fit keeps the label of each splat. `vgs info MASK` lists them
    #[arg(long, value_name = "N|NAME|...", requires = "roi", conflicts_with = "roi_threshold")]
    pub roi_label: Option<String>,
    #[command(flatten)]
    pub cleaning: CleaningArguments,
}

/// Flags that clean the voxels of a threshold. A flag that needs another one is not refused where that one is
/// in conflict with what is given, so each of these names the mask as well.
#[derive(Args, Clone, Debug, Default, PartialEq)]
#[command(next_help_heading = "Region of interest")]
pub struct CleaningArguments {
    /// Leaves out connected pieces of the threshold below this volume, ml
    #[arg(
        long,
        value_name = "ML",
        requires = "roi_threshold",
        conflicts_with = "roi",
        allow_negative_numbers = true
    )]
    pub roi_min_ml: Option<f64>,
    /// Keeps the largest connected piece of the threshold, or the N largest
    #[arg(long, value_name = "N", requires = "roi_threshold", conflicts_with = "roi", num_args = 0..=1,
          require_equals = true, default_missing_value = "1")]
    pub roi_largest: Option<usize>,
    /// Then closes gaps with a ball of this radius, mm
    #[arg(
        long,
        value_name = "MM",
        requires = "roi_threshold",
        conflicts_with = "roi",
        allow_negative_numbers = true
    )]
    pub roi_close: Option<f64>,
    /// Then fills what is enclosed on all sides
    #[arg(long, requires = "roi_threshold", conflicts_with = "roi")]
    pub roi_fill: bool,
}

impl CleaningArguments {
    /// Returns the cleaning steps; an error if a value is wrong.
    fn steps(&self) -> Result<Cleaning> {
        let CleaningArguments { roi_min_ml, roi_largest, roi_close, roi_fill } = *self;
        let cleaning =
            Cleaning { min_ml: roi_min_ml, largest: roi_largest, close_mm: roi_close, fill_holes: roi_fill };
        cleaning.check()?;
        Ok(cleaning)
    }
}

/// Volume with its region of interest.
pub struct Case {
    /// The volume.
    pub volume: Volume,
    /// Region on the volume's grid.
    pub roi: Roi,
    /// Part of the mask that lies within the volume, by its volume in mm³; `None` without a mask.
    pub mask_within: Option<f64>,
}

impl Case {
    /// Reads volume and region, and the labels if some of a label map were chosen.
    pub fn read_labelled(
        volume_path: &Path,
        read: &ReadArguments,
        region: &RoiArguments,
    ) -> Result<(Case, Option<Labels>)> {
        let (case, mask) = Case::with_mask(volume_path, read, region)?;
        let labels = match (&region.roi, mask) {
            (Some(path), Some((mask, choice))) => {
                Labels::chosen(&mask, &choice, &case.volume).map_err(|e| e.or_file(path))?
            }
            _ => None,
        };
        Ok((case, labels))
    }

    fn with_mask(
        volume_path: &Path,
        read: &ReadArguments,
        region: &RoiArguments,
    ) -> Result<(Case, Option<Mask>)> {
        // The values are checked before a large file is read.
        let cleaning = region.cleaning.steps()?;
        let volume = volume_of(volume_path, read)?;
        let (mask, label) = (region.roi.as_deref(), region.roi_label.as_deref());
        let (roi, mask) = region_with_mask(&volume, read, mask, region.roi_threshold, &cleaning, label)
            .map_err(|e| e.or_file(volume_path))?
            // The flags are a required group.
            .unwrap_or_else(|| unreachable!("a region of interest is required"));
        tracing::info!(
            "{}: {:?} voxels, {} in the region of interest",
            volume_path.display(),
            volume.size,
            roi.voxel_count()
        );
        let mask_within =
            mask.as_ref().map(|(mask, labels)| roi.share_of(mask, labels, &volume)).transpose()?;
        if let Some(padding) = Padding::of(&volume) {
            padding.warn_of_region(&volume, &roi);
        }
        Ok((Case { volume, roi, mask_within }, mask))
    }

    /// Returns the least and the greatest finite sample of the whole volume: the usual normalisation of a
    /// PSNR.
    pub fn full_range(&self) -> [f32; 2] {
        self.volume.min_max().map(|(low, high)| [low, high]).unwrap_or_default()
    }

    /// Returns the range of a PSNR; the [full range](Case::full_range) if none is chosen.
    pub fn range(&self, chosen: Option<Range>) -> Result<[f32; 2]> {
        match chosen {
            Some(Range::Given(range)) => Ok(range),
            Some(Range::Roi) => region_range(&self.volume, &self.roi),
            Some(Range::Own) | None => {
                let range = self.full_range();
                if let Some(padding) = Padding::of(&self.volume) {
                    padding.warn_of_range(range);
                }
                Ok(range)
            }
        }
    }
}

/// Returns the range of a volume inside a region; an error if the volume is constant there.
pub fn region_range(volume: &Volume, roi: &Roi) -> Result<[f32; 2]> {
    match roi.range(volume) {
        Some([low, high]) if low < high => Ok([low, high]),
        found => {
            let value = found.map_or("nothing".to_owned(), |[low, _]| low.to_string());
            let message = format!("the volume is {value} everywhere in the region: that is no range");
            Err(Error::new(Kind::BadData, "VGS-CLI-043", message).help("give one: --range LOW,HIGH"))
        }
    }
}

/// Reads a volume.
pub fn volume_of(path: &Path, read: &ReadArguments) -> Result<Volume> {
    let options = read.options();
    if read.voxel_mm.is_some() && Format::of(path, &options)?.name != npy::NAME {
        let message = "--voxel-mm is for files without a voxel spacing";
        return Err(Error::new(Kind::Usage, "VGS-CLI-120", message)
            .file(path)
            .help("leave it out; `vgs info` shows what the file says"));
    }
    let _waiting = Waiting::on(format!("reading {}", path.display()));
    Volume::read(path, &options)
}

/// Reads the region of a volume from a mask file (some of its labels, or all of it) or from a threshold, HU,
/// whose voxels are cleaned; `None` if neither is given.
pub fn region_of(
    volume: &Volume,
    read: &ReadArguments,
    mask: Option<&Path>,
    (threshold, cleaning): (Option<[f32; 2]>, &CleaningArguments),
    labels: Option<&str>,
) -> Result<Option<Roi>> {
    Ok(region_with_mask(volume, read, mask, threshold, &cleaning.steps()?, labels)?.map(|(roi, _)| roi))
}

/// Mask as its file has it, and the chosen labels.
type Mask = (Volume, LabelChoice);

/// Reads the region as [`region_of`] does, cleaning that of a threshold, and also returns its mask.
fn region_with_mask(
    volume: &Volume,
    read: &ReadArguments,
    mask: Option<&Path>,
    threshold: Option<[f32; 2]>,
    cleaning: &Cleaning,
    labels: Option<&str>,
) -> Result<Option<(Roi, Option<Mask>)>> {
    let labels: LabelChoice = match labels {
        Some(text) => text.parse()?,
        None => LabelChoice::Whole,
    };
    if let Some(path) = mask {
        let _waiting = Waiting::on(format!("reading {}", path.display()));
        let mask = Volume::read_mask(path, &read.options(), &labels, volume)?;
        let roi = Roi::from_mask(&mask, &labels, volume).map_err(|e| e.or_file(path))?;
        return Ok(Some((roi, Some((mask, labels)))));
    }
    let _waiting = Waiting::on("finding the voxels of the threshold");
    let roi = threshold.map(|[low, high]| cleaning.region(volume, low, high)).transpose()?;
    Ok(roi.map(|roi| (roi, None)))
}

/// Record of an input file.
#[derive(Clone, Debug, Serialize)]
pub struct InputRecord {
    /// Path as it was given.
    pub path: String,
    /// Size in bytes; of a part of a store of chunks, that of its voxels.
    pub bytes: u64,
    /// Hash of the content, hexadecimal; of a part of a store of chunks, that of its voxels and of where they are.
    pub sha256: String,
}

impl InputRecord {
    /// Returns the record of a part of a store of chunks, or of the whole if it is none, or is on another grid than `part`,
    /// the voxels that the options choose of the volume.
    pub fn of_part(path: &Path, options: &ReadOptions, part: &Grid) -> Result<InputRecord> {
        let is_store = !volume::levels(path)?.is_empty();
        let Some(voxels) = options.voxels.filter(|_| is_store) else { return InputRecord::of(path) };
        if !Volume::open(path, options)?.grid().has_box(voxels, part) {
            return InputRecord::of(path);
        }
        let part = Volume::read(path, options)?;
        let mut hash = Sha256::new();
        part.size.iter().for_each(|&n| hash.update((n as u64).to_le_bytes()));
        part.world_from_voxel.to_cols_array().iter().for_each(|x| hash.update(x.to_le_bytes()));
        for samples in part.samples.chunks(1 << 16) {
            hash.update(samples.iter().flat_map(|sample| sample.to_le_bytes()).collect::<Vec<u8>>());
        }
        let bytes = 4 * part.samples.len() as u64;
        Ok(InputRecord { path: path.display().to_string(), bytes, sha256: hexadecimal(hash) })
    }

    /// Reads a file once more, for its hash, and then the file of voxels that it names, if it is a header; for a
    /// folder all files within it, in the order of their names.
    pub fn of(path: &Path) -> Result<InputRecord> {
        let mut files = Vec::new();
        if path.is_dir() {
            files_within(path, &mut files)?;
            files.sort();
        } else {
            files = files_of(path);
        }
        let known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner).get(&files).cloned();
        let stamp = stamp_of(&files);
        if let Some((_, bytes, sha256)) = known.filter(|(then, ..)| stamp.is_some() && *then == stamp) {
            return Ok(InputRecord { path: path.display().to_string(), bytes, sha256 });
        }
        let _waiting = Waiting::on(format!("hashing {}, for the record", path.display()));
        let mut hash = Sha256::new();
        let mut block = vec![0; 1 << 18];
        let mut bytes = 0;
        for file in &files {
            let failed = |e: std::io::Error| Error::io(file, "reading", &e);
            let mut open = engine::input::open(file).map_err(failed)?;
            loop {
                let n = open.read(&mut block).map_err(failed)?;
                if n == 0 {
                    break;
                }
                hash.update(&block[..n]);
                bytes += n as u64;
            }
        }
        let sha256 = hexadecimal(hash);
        KNOWN.lock().unwrap_or_else(PoisonError::into_inner).insert(files, (stamp, bytes, sha256.clone()));
        Ok(InputRecord { path: path.display().to_string(), bytes, sha256 })
    }
}

fn hexadecimal(hash: Sha256) -> String {
    hash.finalize().iter().map(|b| format!("{b:02x}")).collect()
}

/// Sizes of files and the times of their last changes.
type Stamp = Vec<(u64, SystemTime)>;

/// What was hashed: files with their stamp then, their size in bytes, and their hash.
type Known = HashMap<Vec<PathBuf>, (Option<Stamp>, u64, String)>;

/// Blocks of one scan have the same files.
static KNOWN: LazyLock<Mutex<Known>> = LazyLock::new(Mutex::default);

fn stamp_of(files: &[PathBuf]) -> Option<Stamp> {
    let of = |file: &PathBuf| {
        let found = std::fs::metadata(file).ok()?;
        Some((found.len(), found.modified().ok()?))
    };
    files.iter().map(of).collect()
}

/// Adds the files of a folder and of the folders within it; links to folders are not followed.
fn files_within(path: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    let failed = |e: std::io::Error| Error::io(path, "reading", &e);
    for entry in std::fs::read_dir(path).map_err(failed)? {
        let entry = entry.map_err(failed)?;
        let kind = entry.file_type().map_err(failed)?;
        if kind.is_dir() {
            files_within(&entry.path(), files)?;
        } else if entry.path().is_file() {
            files.push(entry.path());
        }
    }
    Ok(())
}
