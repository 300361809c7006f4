//! Tells the volume and the intensities of each object (`vgs stats`).

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::Args;
use engine::gpu::Gpu;
use engine::output::write_atomic;
use engine::rasterize::visit_shown;
use engine::splat::{self, SplatSet};
use engine::volume::Volume;
use engine::{Error, Kind, Result, fit, memory, passes};
use serde::Serialize;

use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::{table, with_unit};
use crate::shared::flags::DeviceArguments;
use crate::shared::inputs::{ReadArguments, volume_of};
use crate::shared::outputs;
use crate::shared::splat_files::warn_of_another_volume;
use crate::shared::terminal::clean;
use crate::shared::waiting::Waiting;

/// Tells the volume of each object and its mean intensity, of the splats and of the scan
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct StatsArguments {
    /// The splats; each file is an object, or each of its labels. Files of one scan are one scene, in which a voxel
    /// belongs to one object; those of several scans are counted one after the other
    #[arg(required = true)]
    splats: Vec<PathBuf>,
    /// The scan that they were fitted to: its intensities are told, too, and its voxels are counted. May be repeated
    /// for splats of several scans, which know theirs by a checksum [default: the grid that the splats were fitted
    /// on is counted]
    #[arg(long, value_name = "VOLUME")]
    volume: Vec<PathBuf>,
    /// The same as a table, with a row for each file and object
    #[arg(long, value_name = "FILE.csv", help_heading = "Output")]
    csv: Option<PathBuf>,
    /// Replaces a table that exists
    #[arg(short, long, help_heading = "Output")]
    force: bool,
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
  vgs stats patients/*.vgs --csv livers.csv     a row for each file and object
  vgs stats a.ply b.ply --volume a.nii.gz --volume b.nii.gz --csv both.csv
  vgs stats organs.ply --volume ct.nii.gz --json";

/// Host memory of a voxel while objects are counted, bytes: owner, intensity, greatest weight, and the samples of
/// the grid.
const BYTES_A_VOXEL: u64 = 13;
/// Owner of voxels that belong to no object.
const NOBODY: u8 = u8::MAX;

/// Figures of an object.
#[derive(Debug, PartialEq, Serialize)]
struct ObjectFigures {
    file: String,
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

/// Splats that were fitted to one scan.
struct Scene {
    /// Files, each with the number of its objects.
    files: Vec<(PathBuf, usize)>,
    set: SplatSet,
}

/// Runs the command.
pub fn run(arguments: &StatsArguments, console: &Console) -> std::result::Result<u8, Stop> {
    let inputs: Vec<&Path> = arguments.splats.iter().chain(&arguments.volume).map(PathBuf::as_path).collect();
    let written: Vec<&Path> = arguments.csv.as_deref().into_iter().collect();
    outputs::check(&written, &inputs, arguments.force)?;
    let volumes = arguments
        .volume
        .iter()
        .map(|path| Ok((path.as_path(), volume_of(path, &arguments.read)?)))
        .collect::<Result<Vec<_>>>()?;
    let scenes = scenes(&arguments.splats, &volumes)?;
    let gpu = arguments.device.boot()?;
    let waiting = Waiting::on("evaluating the splats");
    let (mut objects, mut units) = (Vec::new(), BTreeSet::new());
    for (done, scene) in scenes.iter().enumerate() {
        waiting.at(done as f64 / scenes.len() as f64);
        let volume = volume_for(scene, &volumes, scenes.len());
        let grid = grid(&scene.set, volume, &scene.files[0].0)?;
        objects.extend(figures(&gpu, scene, &grid, volume)?);
        units.insert(volume.map_or(scene.set.unit, Volume::unit).text());
    }
    drop(waiting);
    // Where the units of several scans differ, no heading can name one.
    let unit = if units.len() == 1 { units.first().copied().unwrap_or_default() } else { "" };
    if let Some(path) = &arguments.csv {
        write_atomic(path, arguments.force, |out| out.write_all(csv(&objects, unit).as_bytes()))?;
    }
    if console.json {
        console.json_data(&serde_json::json!({ "objects": objects }))?;
    } else {
        console.data(&text(&objects, arguments.splats.len() > 1, unit))?;
    }
    Ok(0)
}

/// Reads splats, and puts those of one scan together.
fn scenes(paths: &[PathBuf], volumes: &[(&Path, Volume)]) -> Result<Vec<Scene>> {
    let mut scans: Vec<Vec<(&PathBuf, SplatSet)>> = Vec::new();
    for path in paths {
        let splats = splat::read_some(path)?;
        if !splats.unit().is_physical() {
            let message = "these splats have a colour but no intensity: there is nothing to tell of";
            return Err(Error::new(Kind::BadData, "VGS-CLI-123", message)
                .file(path)
                .help("use splats from `vgs fit`"));
        }
        let place = match volumes {
            [(_, volume)] if splats.needs_volume() => Some(fit::place::place(volume, None)),
            _ => None,
        };
        let set = splats.placed(place.as_ref())?;
        match scans.iter_mut().find(|scan| are_of_one_scan(&scan[0].1, &set)) {
            Some(scan) => scan.push((path, set)),
            None => scans.push(vec![(path, set)]),
        }
    }
    let joined = |scan: Vec<(&PathBuf, SplatSet)>| {
        let files = scan.iter().map(|(path, set)| ((*path).clone(), set.objects().len())).collect();
        let name = |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let set = splat::join(scan.into_iter().map(|(path, set)| (name(path), set)).collect())?;
        Ok(Scene { files, set })
    };
    scans.into_iter().map(joined).collect()
}

/// Returns true if nothing says that two sets are of different scans or grids.
fn are_of_one_scan(a: &SplatSet, b: &SplatSet) -> bool {
    let same_scan = a.volume_crc32.zip(b.volume_crc32).is_none_or(|(a, b)| a == b);
    same_scan && a.grid.zip(b.grid).is_none_or(|(a, b)| a == b)
}

/// Returns the volume of a scene: the one with the checksum that its splats name, or the only one, with a warning where
/// that is another.
fn volume_for<'a>(scene: &Scene, volumes: &'a [(&Path, Volume)], scenes: usize) -> Option<&'a Volume> {
    let named = scene.set.volume_crc32;
    if let Some((_, volume)) = volumes.iter().find(|(_, volume)| named == Some(volume.crc32())) {
        return Some(volume);
    }
    match volumes {
        [] => None,
        [(path, volume)] if scenes == 1 => {
            warn_of_another_volume(&scene.set, volume, path);
            Some(volume)
        }
        _ => {
            let file = scene.files[0].0.display();
            tracing::warn!("{file}: none of the volumes is its scan, so the grid of the fit is counted");
            None
        }
    }
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
fn figures(gpu: &Gpu, scene: &Scene, grid: &Volume, volume: Option<&Volume>) -> Result<Vec<ObjectFigures>> {
    let set = &scene.set;
    // Objects are numbered in the order of files and labels.
    let mut files = scene.files.iter().flat_map(|(path, count)| std::iter::repeat_n(path, *count));
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
            file: files.next().map(|path| path.display().to_string()).unwrap_or_default(),
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

/// Returns the figures as a table for people; `unit` is the text behind an intensity.
fn text(objects: &[ObjectFigures], with_file: bool, unit: &str) -> String {
    let with_volume = objects.iter().any(|object| object.volume.is_some());
    let names = ["mean", "standard deviation", "mean of the scan", "standard deviation of the scan"];
    let names = names.map(|name| with_unit(name, unit));
    let mut heads = if with_file { vec!["file"] } else { Vec::new() };
    heads.extend(["number", "object", "splats", "volume, ml"]);
    heads.extend(names[..if with_volume { 4 } else { 2 }].iter().map(String::as_str));
    let row = |object: &ObjectFigures| {
        let mut cells = if with_file { vec![clean(&object.file)] } else { Vec::new() };
        cells.extend([
            object.number.to_string(),
            clean(&object.name).replace('\n', " "),
            object.splats.to_string(),
            format!("{:.2}", object.volume_ml),
        ]);
        cells.extend(Intensities::text(object.field));
        if with_volume {
            cells.extend(Intensities::text(object.volume));
        }
        cells
    };
    table(&heads, &objects.iter().map(row).collect::<Vec<_>>())
}

/// Returns the figures as comma-separated values, with their units in the first row.
fn csv(objects: &[ObjectFigures], unit: &str) -> String {
    let unit = if unit.is_empty() { String::new() } else { format!(" ({})", unit.trim()) };
    let mut out = format!(
        "file,number,object,splats,voxels,volume (ml),mean{unit},standard deviation{unit},mean of the \
         scan{unit},standard deviation of the scan{unit}\n"
    );
    let quoted = |text: &str| format!("\"{}\"", text.replace('"', "\"\""));
    let figures = |of: Option<Intensities>| match of {
        Some(Intensities { mean, std_dev }) => format!("{mean},{std_dev}"),
        None => ",".to_owned(),
    };
    for o in objects {
        let (file, name) = (quoted(&o.file), quoted(&o.name));
        let (field, volume) = (figures(o.field), figures(o.volume));
        out += &format!(
            "{file},{},{name},{},{},{},{field},{volume}\n",
            o.number, o.splats, o.voxels, o.volume_ml
        );
    }
    out
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

    #[test]
    fn a_table_has_units_in_its_first_row_and_names_in_quotes() {
        let object = ObjectFigures {
            file: "a, b.ply".into(),
            number: 3,
            name: "the \"large\" one".into(),
            splats: 7,
            voxels: 100,
            volume_ml: 2.5,
            field: Some(Intensities { mean: 40.25, std_dev: 1.0 }),
            volume: None,
        };
        let text = csv(&[object], " HU");
        let lines: Vec<_> = text.lines().collect();
        assert!(lines[0].starts_with("file,number,object,splats,voxels,volume (ml),mean (HU),"), "{text}");
        assert_eq!(lines[1], "\"a, b.ply\",3,\"the \"\"large\"\" one\",7,100,2.5,40.25,1,,");
        assert!(csv(&[], "").contains(",mean,"));
    }
}
