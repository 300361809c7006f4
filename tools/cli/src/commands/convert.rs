//! Writes splats in another format (`vgs convert`).

use std::path::{Path, PathBuf};

use clap::Args;
use engine::fit::{FitConfig, FitForm, Problem, rounded_as_it_is};
use engine::splat::{self, Form, Grid, PlyLayout, ReadOptions, SplatSet, WriteOptions};
use engine::{Error, Kind};

use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::bytes;
use crate::shared::flags::{DeviceArguments, pair};
use crate::shared::inputs::{Case, CleaningArguments, ReadArguments, RoiArguments};
use crate::shared::outputs;
use crate::shared::splat_files::worldly_layout;
use crate::shared::waiting::Waiting;

/// Writes splats in another format; the extension of the output names it
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct ConvertArguments {
    /// The splats
    #[arg(value_name = "SPLATS")]
    splats: PathBuf,
    /// The splats as vgs wrote them, where SPLATS are what another program has made of these without the
    /// comments of vgs: kernel, background, grid and names of labels are taken from there
    #[arg(long, value_name = "ORIGINAL")]
    like: Option<PathBuf>,
    /// The file: .vgs, which is small and rounded, or .ply for other programs
    #[arg(short, long, value_name = "OUT", help_heading = "Output")]
    output: PathBuf,
    /// How a PLY is laid out: vgs (HU as one more property, what most programs read), or inria (rows of 62
    /// floats, for programs that know no others)
    #[arg(long, value_name = "LAYOUT", default_value = "vgs", value_parser = worldly_layout, help_heading = "Output")]
    ply_layout: &'static PlyLayout,
    /// The volume that the splats were fitted to: a .vgs is then rounded more and fitted again to make up for
    /// it
    #[arg(long, value_name = "VOLUME", requires = "region", help_heading = "Fitting again")]
    volume: Option<PathBuf>,
    /// The mask of their fit
    #[arg(long, value_name = "MASK", requires = "volume", group = "region", help_heading = "Fitting again")]
    roi: Option<PathBuf>,
    /// Instead of a mask: the voxels from LOW to HIGH, HU
    #[arg(long, value_name = "LOW,HIGH", value_parser = pair, allow_hyphen_values = true, requires = "volume",
          group = "region", help_heading = "Fitting again")]
    roi_threshold: Option<[f32; 2]>,
    /// Which labels of the mask, by number or name
    #[arg(long, value_name = "N|NAME,...", requires = "roi", help_heading = "Fitting again")]
    roi_label: Option<String>,
    #[command(flatten)]
    read: ReadArguments,
    #[command(flatten)]
    device: DeviceArguments,
    /// Replaces an output that exists
    #[arg(short, long, help_heading = "Output")]
    force: bool,
}

const EXAMPLES: &str = "\
Examples:
  vgs convert bones.ply -o bones.vgs
  vgs convert bones.vgs -o bones.ply
  vgs convert bones.ply -o for-sibr.ply --ply-layout inria
  vgs convert edited.ply --like bones.ply -o edited-bones.ply
  vgs convert bones.ply -o bones.vgs --volume ct.nii.gz --roi bones.nii.gz      a fifth smaller";

/// Runs the command.
pub fn run(arguments: &ConvertArguments, console: &Console) -> Result<u8, Stop> {
    let mut inputs = vec![arguments.splats.as_path()];
    inputs.extend(arguments.like.as_deref());
    inputs.extend(arguments.volume.as_deref());
    inputs.extend(arguments.roi.as_deref());
    outputs::check(&[&arguments.output], &inputs, arguments.force)?;
    let mut set = splat::read(&arguments.splats, &ReadOptions::default())?;
    if let Some(original) = &arguments.like {
        set = given_back(arguments, set, original)?;
    }
    if let Some(volume) = &arguments.volume {
        set = fitted_again(arguments, &set, volume)?;
    } else if splat::rounds(&arguments.output)
        && set.form == (Form::Grid { binary: true })
        && set.rounding.is_none()
    {
        set = rounded_as_it_is(&arguments.device.boot()?, set)?;
    }
    let options = WriteOptions { layout: arguments.ply_layout, place: None, force: arguments.force };
    splat::write_as(&arguments.output, &set, &options)?;
    let size = |path: &PathBuf| std::fs::metadata(path).map_or(0, |found| found.len());
    let (before, after) = (size(&arguments.splats), size(&arguments.output));
    let count = set.splats.len();
    if console.json {
        console.json_data(&serde_json::json!({
            "output": arguments.output, "splats": count, "bytes_before": before, "bytes": after,
        }))?;
    } else {
        console.say(&format!(
            "{}: {count} splats, {} ({:.1} bytes a splat); it was {}",
            arguments.output.display(),
            bytes(after),
            after as f64 / count.max(1) as f64,
            bytes(before),
        ));
    }
    Ok(0)
}

/// Returns `set` with what another program has dropped with the comments of vgs, from the original.
fn given_back(arguments: &ConvertArguments, set: SplatSet, original: &Path) -> Result<SplatSet, Stop> {
    let ConvertArguments { splats, output, .. } = arguments;
    let summary = splat::describe(splats, &ReadOptions::default())?;
    if summary.layout != splat::ply::ORDINARY {
        let message = "the file states itself what --like would take from another";
        return Err(Error::new(Kind::Usage, "VGS-CLI-129", message)
            .file(splats)
            .help("leave out --like")
            .into());
    }
    let original = splat::read(original, &ReadOptions::default())?;
    if original.has_intensity && !set.has_intensity {
        tracing::warn!("{}: the other program has left no intensities but their grey", splats.display());
    }
    let exceptions = original.exceptions.len();
    let set = set.with_statements_of(&original);
    if set.exceptions.len() < exceptions {
        tracing::warn!(
            "{}: without the {exceptions} voxels that are exceptions of the occupancy, since the splats are no \
             longer as many",
            output.display()
        );
    }
    Ok(set)
}

/// Returns `set` rounded to a coarse lattice and fitted again to the volume and region of the flags.
fn fitted_again(arguments: &ConvertArguments, set: &SplatSet, volume: &Path) -> Result<SplatSet, Stop> {
    let region = RoiArguments {
        roi: arguments.roi.clone(),
        roi_threshold: arguments.roi_threshold,
        roi_label: arguments.roi_label.clone(),
        cleaning: CleaningArguments::default(),
    };
    let (case, _) = Case::read_labelled(volume, &arguments.read, &region)?;
    let grid = Grid::of_voxels(case.volume.size, case.volume.world_from_voxel);
    if set.grid != Some(grid) {
        let message = format!("the splats were fitted on another grid than that of {}", volume.display());
        return Err(Error::new(Kind::Usage, "VGS-CLI-100", message)
            .file(&arguments.splats)
            .help("give the volume of their fit, or no --volume")
            .into());
    }
    let config = FitConfig {
        kernel: set.field.kernel,
        epsilon: set.field.epsilon,
        occupancy_w0: set.field.occupancy_w0,
        form: if set.form == Form::Field { FitForm::Field } else { FitForm::Grid },
        ..FitConfig::default()
    };
    let problem = Problem::new(&case.volume, &case.roi, &config)?;
    let gpu = arguments.device.boot()?;
    let _waiting = Waiting::on("fitting the rounded splats again");
    let splats = set.to_voxel(&grid.world_from_voxel);
    let fitted = problem.rounded_set(&gpu, &splats, 0, &mut || false)?;
    Ok(SplatSet {
        iterations: set.iterations,
        labels: set.labels.clone(),
        label_names: set.label_names.clone(),
        ..fitted
    })
}
