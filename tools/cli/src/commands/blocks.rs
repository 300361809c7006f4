//! Divides the region of a large scan into blocks, as cases of a batch (`vgs blocks`).

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::{ArgGroup, Args};
use engine::output::write_atomic;
use engine::unit::Unit;
use engine::volume::{self, Grid, LabelChoice, ReadOptions, Roi, Volume, VoxelSource, unit_by_boxes};
use engine::{Error, Kind, Result, splat};
use rayon::prelude::*;

use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::bytes;
use crate::shared::flags::pair;
use crate::shared::inputs::ReadArguments;
use crate::shared::outputs;
use crate::shared::waiting::Waiting;

/// Divides the region of a large scan into blocks, as a table of cases for vgs batch
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES, group = ArgGroup::new("region").required(true).args(["roi", "roi_threshold"]))]
pub struct BlocksArguments {
    /// The volume: OME-Zarr, or a file that is not compressed; of others each block is read whole
    volume: PathBuf,
    /// Mask on the grid of the volume
    #[arg(long, value_name = "MASK", help_heading = "Region of interest")]
    roi: Option<PathBuf>,
    /// Which labels of the mask, with commas between them: numbers, names, ranges (1-24), patterns (rib_*) or all; each
    /// block gets those that it has
    #[arg(long, value_name = "N|NAME|...", requires = "roi", help_heading = "Region of interest")]
    roi_label: Option<LabelChoice>,
    /// Instead of a mask: the voxels from LOW to HIGH, HU
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair, allow_hyphen_values = true,
          help_heading = "Region of interest")]
    roi_threshold: Option<[f32; 2]>,
    /// Longest edge of a block, voxels
    #[arg(long, value_name = "VOXELS", default_value_t = 128, value_parser = clap::value_parser!(u32).range(16..=1024))]
    edge: u32,
    /// The table (CSV)
    #[arg(short, long, value_name = "CASES.csv", help_heading = "Output")]
    output: PathBuf,
    /// Replaces the table where it exists
    #[arg(short, long, help_heading = "Output")]
    force: bool,
    #[command(flatten)]
    read: ReadArguments,
}

const EXAMPLES: &str = "\
Examples:
  vgs blocks scan.zarr --roi scan.zarr/labels/bone -o blocks.csv
  vgs blocks scan.zarr --roi scan.zarr/labels/organs --roi-label liver,aorta -o blocks.csv
  vgs batch blocks.csv -o bone --format vgs -- --quality standard
  vgs view bone/*.vgs

A block is fitted to the region inside of it alone, and shown there alone, so blocks need not know of each other: they can be
fitted in any order, by --shard also at once, and show no seam. Memory holds one block and the next.";

/// Voxels of the boxes that are read at once: 128 MB of them, and as much again of the region.
const AT_ONCE: usize = 1 << 25;

/// The resolution, counted from the finest, that tells what the numbers of a volume are.
const COARSE: usize = 3;

/// A block that has voxels of the region.
struct Block {
    /// The first voxel, and the one behind the last, along x, y, z, of the box around the region in the block.
    ends: [[usize; 2]; 3],
    /// Voxels of the region.
    voxels: usize,
    /// The labels that the block has of each entry of the choice.
    labels: Vec<Vec<i32>>,
}

/// Runs the command.
pub fn run(arguments: &BlocksArguments, console: &Console) -> std::result::Result<u8, Stop> {
    let mut inputs = vec![arguments.volume.as_path()];
    inputs.extend(arguments.roi.as_deref());
    outputs::check(&[&arguments.output], &inputs, arguments.force)?;
    let options = arguments.read.options();
    let volume = Volume::open(&arguments.volume, &options)?;
    let mask = arguments.roi.as_ref().map(|path| Volume::open(path, &options)).transpose()?;
    let grid = volume.grid();
    if let (Some(mask), Some(path)) = (&mask, &arguments.roi)
        && !grid.has_box(mask.grid().size.map(|end| [0, end]), &mask.grid())
    {
        let message = "the mask is on another grid than the volume";
        return Err(Error::new(Kind::BadData, "VGS-CLI-190", message)
            .file(path)
            .help("resample it to the volume; vgs fit does so with what memory holds")
            .into());
    }
    let _waiting = Waiting::on(format!("looking for the region in {}", arguments.volume.display()));
    let source = mask.as_deref().unwrap_or(&*volume);
    let edge = arguments.edge as usize;
    let all: Vec<_> = boxes(&grid, edge, arguments.read.voxels).collect();
    let mut blocks = Vec::new();
    for some in all.chunks((AT_ONCE / edge.pow(3)).max(1)) {
        let found: Result<Vec<_>> = some.par_iter().map(|&ends| arguments.block(source, ends)).collect();
        let found = found.map_err(|e| e.or_file(arguments.roi.as_ref().unwrap_or(&arguments.volume)))?;
        blocks.extend(found.into_iter().flatten());
    }
    arguments.check_labels(&blocks)?;
    if blocks.is_empty() {
        let message = "the region of interest is empty";
        return Err(Error::new(Kind::NothingToDo, "VGS-CLI-191", message)
            .file(&arguments.volume)
            .help("check the mask, the labels or the threshold")
            .into());
    }
    let unit = arguments.read.unit.map_or_else(|| arguments.unit(&*volume), Ok)?;
    let table = arguments.table(&blocks, unit)?;
    write_atomic(&arguments.output, arguments.force, |out| out.write_all(table.as_bytes()))?;
    let voxels: usize = blocks.iter().map(|block| block.voxels).sum();
    let most = blocks.iter().map(|block| block.ends.map(|[first, end]| end - first).iter().product()).max();
    let most: usize = most.unwrap_or_default();
    if console.json {
        console.json_data(&serde_json::json!({
            "blocks": blocks.len(),
            "voxels": voxels,
            "largest_block_voxels": most,
            "outputs": [arguments.output.display().to_string()],
        }))?;
    } else {
        console.say(&format!(
            "{}: {} blocks with {voxels} voxels of the region; the largest takes {} in memory",
            arguments.output.display(),
            blocks.len(),
            bytes(4 * most as u64)
        ));
    }
    Ok(0)
}

/// Returns blocks of at most `edge` voxels along each axis, as equal as they can be, z slowest; of the whole grid or of the
/// box `within`.
fn boxes(grid: &Grid, edge: usize, within: Option<[[usize; 2]; 3]>) -> impl Iterator<Item = [[usize; 2]; 3]> {
    let within = within.unwrap_or_else(|| grid.size.map(|end| [0, end]));
    let cuts = within.map(|[first, end]| {
        let length = end.saturating_sub(first);
        let count = length.div_ceil(edge).max(1);
        (0..count)
            .map(move |i| [first + i * length / count, first + (i + 1) * length / count])
            .collect::<Vec<_>>()
    });
    let [xs, ys, zs] = cuts;
    zs.into_iter().flat_map(move |z| {
        let xs = xs.clone();
        let ys = ys.clone();
        ys.into_iter().flat_map(move |y| xs.clone().into_iter().map(move |x| [x, y, z]))
    })
}

impl Block {
    fn around(roi: &Roi, ends: [[usize; 2]; 3], labels: Vec<Vec<i32>>) -> Block {
        let [nx, ny, _] = roi.size;
        let (mut low, mut high) = (roi.size, [0; 3]);
        let mut voxels = 0;
        for index in roi.members() {
            let at = [index % nx, index / nx % ny, index / (nx * ny)];
            low = std::array::from_fn(|k| low[k].min(at[k]));
            high = std::array::from_fn(|k| high[k].max(at[k] + 1));
            voxels += 1;
        }
        Block { ends: std::array::from_fn(|k| [ends[k][0] + low[k], ends[k][0] + high[k]]), voxels, labels }
    }
}

impl BlocksArguments {
    /// Returns the block of a box of the mask, or of the volume where there is a threshold; `None` if it has nothing of the
    /// region.
    fn block(&self, source: &dyn VoxelSource, ends: [[usize; 2]; 3]) -> Result<Option<Block>> {
        let (first, size) = (ends.map(|[first, _]| first), ends.map(|[first, end]| end - first));
        let is_outside = |value: f32| match self.roi_threshold {
            Some([low, high]) => !(low..=high).contains(&value),
            None => value == 0.0,
        };
        if source.known(first, size).is_some_and(is_outside) {
            return Ok(None);
        }
        let voxels = source.read_box(first, size)?;
        let labels = self.roi_label.as_ref().map(|choice| choice.present_in(&voxels)).transpose()?;
        let roi = match (self.roi_threshold, &labels) {
            (Some([low, high]), _) => Roi::from_threshold(&voxels, low, high),
            (None, Some(labels)) if labels.iter().all(Vec::is_empty) => return Ok(None),
            (None, labels) => {
                let numbers = |labels: &Vec<Vec<i32>>| labels.iter().flatten().map(i32::to_string).collect();
                let choice =
                    labels.as_ref().map_or(LabelChoice::Whole, |of| LabelChoice::Labels(numbers(of)));
                let nothing = Volume::new(voxels.size, voxels.world_from_voxel, vec![0.0; voxels.len()]);
                Roi::from_mask(&voxels, &choice, &nothing)
            }
        };
        match roi {
            Ok(roi) => Ok(Some(Block::around(&roi, ends, labels.unwrap_or_default()))),
            Err(error) if error.kind == Kind::NothingToDo => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Fails if something of the choice of labels is in no block.
    fn check_labels(&self, blocks: &[Block]) -> Result<()> {
        let (Some(LabelChoice::Labels(asked)), Some(path)) = (&self.roi_label, &self.roi) else {
            return Ok(());
        };
        let is_there = |entry: usize| blocks.iter().any(|block| !block.labels[entry].is_empty());
        let Some(missing) = (0..asked.len()).find(|&entry| !is_there(entry)) else { return Ok(()) };
        let message = format!("the mask has no voxel of the label '{}'", asked[missing]);
        Err(Error::new(Kind::Usage, "VGS-CLI-194", message)
            .file(path)
            .help("`vgs info` of the mask lists its labels"))
    }

    /// Returns what the volume has numbers of, by a coarser resolution where there is one. A block could not tell: one
    /// inside of a body has no air.
    fn unit(&self, volume: &dyn VoxelSource) -> Result<Unit> {
        let level = volume::levels(&self.volume)?.len().saturating_sub(1).min(COARSE);
        let options = ReadOptions { level: Some(level), voxels: None, ..self.read.options() };
        let is_coarser = level > self.read.level.unwrap_or(0);
        let coarse = is_coarser.then(|| Volume::open(&self.volume, &options)).transpose()?;
        unit_by_boxes(coarse.as_deref().unwrap_or(volume), &self.volume).map_err(|e| e.or_file(&self.volume))
    }

    /// Returns the cases, a row for each block.
    fn table(&self, blocks: &[Block], unit: Unit) -> Result<String> {
        let absolute = |path: &Path| {
            let path = std::path::absolute(path).map_err(|e| Error::io(path, "naming", &e))?;
            Ok::<_, Error>(path.display().to_string())
        };
        let mut common = vec![("volume", absolute(&self.volume)?)];
        if let Some(roi) = &self.roi {
            common.push(("roi", absolute(roi)?));
        }
        if let Some([low, high]) = self.roi_threshold {
            common.push(("roi-threshold", format!("{low},{high}")));
        }
        let read = &self.read;
        let mut flag = |name, value: Option<String>| common.extend(value.map(|value| (name, value)));
        flag("level", read.level.map(|n| n.to_string()));
        flag("volume-index", read.volume_index.map(|n| n.to_string()));
        flag("series", read.series.clone());
        flag("voxel-mm", read.voxel_mm.map(|mm| format!("{},{},{}", mm.x, mm.y, mm.z)));
        flag("unit", Some(unit.name().to_owned()));
        let mut out = csv::Writer::from_writer(Vec::new());
        let names = common.iter().map(|(name, _)| *name);
        let failed = |e: csv::Error| Error::new(Kind::Internal, "VGS-CLI-192", format!("no table: {e}"));
        let own = self.roi_label.as_ref().map(|_| "roi-label");
        out.write_record(["name", "voxels"].into_iter().chain(own).chain(names)).map_err(failed)?;
        for Block { ends, labels, .. } in blocks {
            let [x, y, z] = ends;
            let name = splat::block_name(ends.map(|[first, _]| first));
            let voxels = format!("{}:{},{}:{},{}:{}", x[0], x[1], y[0], y[1], z[0], z[1]);
            let values = common.iter().map(|(_, value)| value.as_str());
            let labels: BTreeSet<i32> = labels.iter().flatten().copied().collect();
            let labels = labels.iter().map(i32::to_string).collect::<Vec<_>>().join(",");
            let own = own.map(|_| labels.as_str());
            out.write_record([name.as_str(), &voxels].into_iter().chain(own).chain(values))
                .map_err(failed)?;
        }
        let table = out.into_inner().unwrap_or_default();
        Ok(String::from_utf8_lossy(&table).into_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_cover_the_grid_once_and_are_equal() {
        let grid = Grid { size: [300, 128, 1], world_from_voxel: Default::default() };
        let all: Vec<_> = boxes(&grid, 128, None).collect();
        assert_eq!(all.len(), 3);
        assert_eq!(all[1], [[100, 200], [0, 128], [0, 1]]);
        let within = boxes(&grid, 16, Some([[10, 43], [0, 16], [0, 1]]));
        assert_eq!(within.map(|ends| ends[0]).collect::<Vec<_>>(), [[10, 21], [21, 32], [32, 43]]);
    }
}
