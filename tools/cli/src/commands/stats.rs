//! Tells the volume and the intensities of each object (`vgs stats`).

use std::path::{Path, PathBuf};

use clap::Args;
use engine::gpu::Gpu;
use engine::splat::{self, SplatSet};
use engine::volume::Volume;
use engine::{Error, Kind, Result, fit, memory, passes};
use serde::Serialize;

use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::table;
use crate::shared::flags::DeviceArguments;
use crate::shared::inputs::{ReadArguments, volume_of};
use crate::shared::sampling::visit_shown;
use crate::shared::terminal::clean;
use crate::shared::waiting::Waiting;

/// Tells the volume of each object and its mean intensity, of the splats and of the CT
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct StatsArguments {
    /// The splats (PLY); each file is an object, or each of its labels
    #[arg(required = true)]
    splats: Vec<PathBuf>,
    /// The volume that they were fitted to: its intensities are told, too, and its voxels are counted
    /// [default: the grid that the splats were fitted on is counted]
    #[arg(long, value_name = "VOLUME")]
    volume: Option<PathBuf>,
    #[command(flatten)]
    read: ReadArguments,
    #[command(flatten)]
    device: DeviceArguments,
}

const EXAMPLES: &str = "\
A voxel belongs to the splats where their occupancy is one half or more, and
there to the object with the greatest summed weight. Means and standard
deviations are over the voxels of an object, each counted once.

Examples:
  vgs stats organs.ply
  vgs stats liver.ply spleen.ply --volume ct.nii.gz
  vgs stats organs.ply --volume ct.nii.gz --json";

/// Host memory of a voxel while objects are counted, bytes: owner, intensity, greatest weight, and the samples of
/// the grid.
const BYTES_A_VOXEL: u64 = 13;
/// Owner of voxels that belong to no object.
const NOBODY: u8 = u8::MAX;

/// Figures of an object.
#[derive(Debug, PartialEq, Serialize)]
struct ObjectFigures {
    number: u8,
    name: String,
    splats: usize,
    voxels: usize,
    volume_ml: f64,
    /// Intensities of the field that is shown; `None` if the object has no voxel.
    field: Option<Intensities>,
    /// Intensities of the volume at the same voxels, without those that are not finite.
    #[serde(skip_serializing_if = "Option::is_none")]
    volume: Option<Intensities>,
}

/// Mean and population standard deviation of intensities.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
struct Intensities {
    mean: f64,
    std_dev: f64,
}

impl Intensities {
    /// Returns those of the finite values; `None` if there is none.
    fn of(values: impl Iterator<Item = f32> + Clone) -> Option<Self> {
        let finite = values.filter(|v| v.is_finite()).map(f64::from);
        let count = finite.clone().count() as f64;
        if count == 0.0 {
            return None;
        }
        let mean = finite.clone().sum::<f64>() / count;
        let variance = finite.map(|v| (v - mean).powi(2)).sum::<f64>() / count;
        Some(Intensities { mean, std_dev: variance.sqrt() })
    }

    fn text(of: Option<Self>) -> [String; 2] {
        match of {
            Some(Intensities { mean, std_dev }) => [format!("{mean:.1}"), format!("{std_dev:.1}")],
            None => ["-".to_owned(), "-".to_owned()],
        }
    }
}

/// Runs the command.
pub fn run(arguments: &StatsArguments, console: &Console) -> std::result::Result<u8, Stop> {
    let volume = arguments.volume.as_deref().map(|path| volume_of(path, &arguments.read)).transpose()?;
    let set = splat::read_all(&arguments.splats, || {
        Ok(volume.as_ref().map(|volume| fit::place::place(volume, None)))
    })?;
    if !set.unit.is_physical() {
        let message = "these splats have a colour but no intensity: there is nothing to tell of";
        return Err(Error::new(Kind::BadData, "VGS-CLI-123", message)
            .file(&arguments.splats[0])
            .help("use splats from `vgs fit`")
            .into());
    }
    let grid = grid(&set, volume.as_ref(), &arguments.splats[0])?;
    let gpu = arguments.device.boot()?;
    let waiting = Waiting::on("evaluating the splats");
    let objects = figures(&gpu, &set, &grid, volume.as_ref())?;
    drop(waiting);
    if console.json {
        console.json_data(&serde_json::json!({ "objects": objects }))?;
    } else {
        let unit = volume.as_ref().map_or(set.unit, Volume::unit).text();
        console.data(&text(&objects, volume.is_some(), unit))?;
    }
    Ok(0)
}

/// Returns an empty volume on the grid whose voxels are counted.
fn grid(set: &SplatSet, volume: Option<&Volume>, path: &Path) -> Result<Volume> {
    let (size, world_from_voxel) = match (volume, &set.grid) {
        (Some(volume), _) => (volume.size, volume.world_from_voxel),
        (None, Some(grid)) => (grid.size.map(|n| n as usize), grid.world_from_voxel),
        (None, None) => {
            let message = "the splats do not say on which grid they were fitted";
            return Err(Error::new(Kind::Usage, "VGS-CLI-124", message)
                .file(path)
                .help("give a volume whose voxels are counted: --volume ct.nii.gz"));
        }
    };
    let voxels = size.iter().map(|&n| n as u64).product::<u64>();
    memory::require(voxels.saturating_mul(BYTES_A_VOXEL), "the voxels of all objects")?;
    Ok(Volume::new(size, world_from_voxel, vec![0.0; size.iter().product()]))
}

/// Evaluates the field at the voxels of a grid and returns the figures of each object.
fn figures(gpu: &Gpu, set: &SplatSet, grid: &Volume, volume: Option<&Volume>) -> Result<Vec<ObjectFigures>> {
    let objects = set.objects();
    let count = grid.len();
    let mut owner = vec![if objects.len() == 1 { 0 } else { NOBODY }; count];
    if let (Some(labels), true) = (&set.labels, objects.len() > 1) {
        let splats = set.to_voxel(&grid.world_from_voxel);
        let mut greatest = vec![0.0_f32; count];
        for (index, object) in objects.iter().enumerate() {
            let own = splats.iter().zip(labels).filter(|(_, label)| **label == object.number);
            let own: Vec<_> = own.map(|(splat, _)| *splat).collect();
            passes::visit(gpu, &own, &set.field, grid.size, |voxel, sample| {
                if sample.weight > greatest[voxel] {
                    greatest[voxel] = sample.weight;
                    owner[voxel] = index as u8;
                }
            })?;
        }
    }
    let mut hu = vec![f32::NAN; count];
    visit_shown(gpu, set, grid, |voxel, sample| {
        if sample.occupancy >= 0.5 {
            hu[voxel] = sample.hu;
        }
    })?;
    let voxel_ml = grid.world_from_voxel.matrix3.determinant().abs() / 1000.0;
    let figures = objects.into_iter().enumerate().map(|(index, object)| {
        let own = || (0..count).filter(|&i| usize::from(owner[i]) == index && !hu[i].is_nan());
        let voxels = own().count();
        ObjectFigures {
            number: object.number,
            name: object.name,
            splats: object.splats,
            voxels,
            volume_ml: voxels as f64 * voxel_ml,
            field: Intensities::of(own().map(|i| hu[i])),
            volume: volume.and_then(|volume| Intensities::of(own().map(|i| volume.samples[i]))),
        }
    });
    Ok(figures.collect())
}

fn text(objects: &[ObjectFigures], with_volume: bool, unit: &str) -> String {
    let unit = if unit.is_empty() { String::new() } else { format!(",{unit}") };
    let [mean, of_volume] = [format!("mean{unit}"), format!("mean of the volume{unit}")];
    let mut heads = vec!["number", "object", "splats", "volume, ml", mean.as_str(), "deviation"];
    if with_volume {
        heads.extend([of_volume.as_str(), "deviation"]);
    }
    let row = |object: &ObjectFigures| {
        let mut cells = vec![
            object.number.to_string(),
            clean(&object.name).replace('\n', " "),
            object.splats.to_string(),
            format!("{:.2}", object.volume_ml),
        ];
        cells.extend(Intensities::text(object.field));
        if with_volume {
            cells.extend(Intensities::text(object.volume));
        }
        cells
    };
    table(&heads, &objects.iter().map(row).collect::<Vec<_>>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_of_the_finite_values() {
        let of = |values: &[f32]| Intensities::of(values.iter().copied());
        assert_eq!(of(&[1.0, 3.0, f32::NAN]), Some(Intensities { mean: 2.0, std_dev: 1.0 }));
        assert_eq!((of(&[]), of(&[f32::INFINITY])), (None, None));
    }
}
