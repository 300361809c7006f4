//! Measures how well splats reproduce a volume in a region of interest (`vgs eval`).

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use clap::{Args, ValueEnum};
use engine::Result;
use engine::fidelity::{evaluate_decoded, in_volume};
use engine::fit::errors::ErrorMap;
use engine::fit::evaluate::{self, Evaluation, Protocol};
use engine::fit::place::place;
use engine::output::write_atomic;
use engine::render::decode;
use engine::splat::{Form, SplatSet};
use engine::volume::{BetweenSlices, nifti};
use serde::Serialize;

use crate::picture;
use crate::report::errors::ErrorsByPlace;
use crate::report::quality::{Quality, quality_table, quality_text};
use crate::shared::console::Console;
use crate::shared::evaluation::{EVAL_SEED, unweighted};
use crate::shared::failure::Stop;
use crate::shared::flags::{DeviceArguments, Range, between_slices, range_or_roi};
use crate::shared::inputs::{Case, ReadArguments, RoiArguments};
use crate::shared::memory::host_peak_bytes;
use crate::shared::waiting::Waiting;
use crate::shared::{outputs, splat_files};

/// Measures splats against a volume, at the voxels and between them
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct EvalArguments {
    /// The splats (PLY with intensities; also that of the paper's authors)
    splats: PathBuf,
    /// The volume
    volume: PathBuf,
    #[command(flatten)]
    region: RoiArguments,
    #[command(flatten)]
    read: ReadArguments,
    /// What the PSNR is over: two HU, or roi for the volume's range inside the region (of a soft mask where
    /// it is above 1 % of its maximum), the paper's normalisation [default: the range of the whole volume]
    #[arg(long, value_name = "LOW,HIGH|roi", value_parser = range_or_roi, allow_hyphen_values = true,
          help_heading = "Evaluation")]
    range: Option<Range>,
    /// Sub-voxel offset grids besides the voxel grid
    #[arg(long, value_name = "N", default_value_t = 4, help_heading = "Evaluation",
          value_parser = clap::value_parser!(u32).range(0..=64))]
    offsets: u32,
    /// Seed of the offsets
    #[arg(long, value_name = "N", default_value_t = EVAL_SEED, help_heading = "Evaluation")]
    seed: u64,
    /// What lies between thick slices: smooth, other slices, or linear [default: as the splats were fitted]
    #[arg(long, value_name = "smooth|linear", value_parser = between_slices, help_heading = "Evaluation")]
    between_slices: Option<BetweenSlices>,
    /// How far around the region the occupancy counts, voxels along each axis
    #[arg(long, value_name = "N", default_value_t = 4, help_heading = "Evaluation",
          value_parser = clap::value_parser!(u32).range(0..=32))]
    shell: u32,
    /// Slices and shaded views of CT, splats and difference
    #[arg(long, value_name = "FILE.png", help_heading = "Output")]
    picture: Option<PathBuf>,
    /// Where the slices of the picture meet: in the middle of the region, or at its worst voxel
    #[arg(long, value_enum, default_value_t, requires = "picture", help_heading = "Output")]
    slices: Slices,
    /// The signed error at each voxel, splats less volume, on the volume's grid; 0 outside the region
    #[arg(long, value_name = "FILE.nii.gz", help_heading = "Output")]
    map: Option<PathBuf>,
    /// All figures of all grids as a table
    #[arg(long, value_name = "FILE.csv", help_heading = "Output")]
    table: Option<PathBuf>,
    /// Replaces outputs that exist
    #[arg(short, long, help_heading = "Output")]
    force: bool,
    #[command(flatten)]
    device: DeviceArguments,
}

/// Place where the slices of a picture meet.
#[derive(Clone, Copy, Debug, Default, PartialEq, ValueEnum)]
pub enum Slices {
    /// In the centre of mass of the region.
    #[default]
    Centre,
    /// Where the error is largest.
    Worst,
}

const EXAMPLES: &str = "\
Examples:
  vgs eval bones.ply ct.nii.gz --roi bones.nii.gz
  vgs eval bones.ply ct.nii.gz --roi bones.nii.gz --range -1024,3071 --json
  vgs eval bones.ply ct.nii.gz --roi bones.nii.gz --range roi      as the paper and its authors' code normalise
  vgs eval skull.ply skull.inv3 --roi-threshold 226,3071 --picture skull.png --table skull.csv
  vgs eval bones.ply ct.nii.gz --roi bones.nii.gz --map error.nii.gz --picture error.png --slices worst";

/// Output of `--json`.
#[derive(Serialize)]
struct EvaluationOutput {
    splats: usize,
    /// Quality of what is shown, as a fit records it: `decoded` if `form` is a grid, else `field`.
    #[serde(flatten)]
    quality: Quality,
    /// Form of the fit: `field`, `grid` or `grid-binary`.
    form: &'static str,
    /// Quality of the splats' field, which modes slab and exact show.
    field: Quality,
    /// Quality of the field decoded on the CT's grid and interpolated, which mode decoded shows.
    decoded: Quality,
    /// Origin of `range`: the `volume`, the volume inside the `roi`, or `given`.
    range_of: &'static str,
    /// Errors by place.
    errors: ErrorsByPlace,
    /// Number of iterations of the fit; null if the file does not have it.
    iterations: Option<u32>,
    seconds: f64,
    device_peak_bytes: u64,
    host_peak_bytes: Option<u64>,
    device: String,
    driver: String,
    roi_voxels: usize,
    outputs: Vec<String>,
}

/// Runs the command.
pub fn run(arguments: &EvalArguments, console: &Console) -> std::result::Result<u8, Stop> {
    let start = Instant::now();
    let written: Vec<&Path> = [&arguments.picture, &arguments.table, &arguments.map]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path)
        .collect();
    let mut inputs = vec![arguments.splats.as_path(), arguments.volume.as_path()];
    inputs.extend(arguments.region.roi.as_deref());
    outputs::check(&written, &inputs, arguments.force)?;
    if let Some(map) = &arguments.map {
        nifti::check_name(map)?;
    }

    let read = splat_files::read_with_intensity(&arguments.splats)?;
    let (case, labels) = Case::read_labelled(&arguments.volume, &arguments.read, &arguments.region)?;
    let set = read.placed(Some(&place(&case.volume, Some(&case.roi))))?;
    splat_files::warn_of_another_volume(&set, &case.volume, &arguments.volume);
    let splats = in_volume(&set, &case.volume).map_err(|e| e.file(&arguments.splats))?;
    let gpu = arguments.device.boot()?;
    let protocol = arguments.protocol(&case)?;
    let waiting = Waiting::on("measuring the splats");
    let fitted = || evaluate::between_slices_of(&set, &case.volume);
    let between = arguments.between_slices.unwrap_or_else(fitted);
    let of_decoded =
        evaluate::with_slices(&case.volume, &case.roi, between, &protocol, |volume, roi, protocol| {
            evaluate_decoded(&gpu, &set, volume, roi, protocol)
        })?;
    // What is coded has no field beside the one that is shown.
    let is_coded = !set.voxels.is_empty();
    let of_field = match is_coded {
        true => of_decoded.clone(),
        false => {
            evaluate::with_slices(&case.volume, &case.roi, between, &protocol, |volume, roi, protocol| {
                let splats = set.to_voxel(&volume.world_from_voxel);
                evaluate::evaluate(&gpu, &splats, &set.field, volume, roi, protocol)
            })?
        }
    };
    let of_grid = set.form != Form::Field;
    // The evaluation of what is shown comes first.
    let evaluation = if of_grid { &of_decoded } else { &of_field };
    let map = match is_coded {
        true => {
            let decoded = decode(&gpu, &set, 1.0)?;
            ErrorMap::of_field(decoded.in_voxels_of(&case.volume, set.origin_mm), &case.volume, &case.roi)
        }
        false => ErrorMap::new(&gpu, &splats, &set.field, &case.volume, &case.roi)?,
    };
    let errors = ErrorsByPlace::of(&map, &case.volume, labels.as_ref());

    drop(waiting);
    if let Some(path) = &arguments.picture {
        let _waiting = Waiting::on(format!("drawing {}", path.display()));
        picture::draw(
            path,
            arguments.force,
            &gpu,
            &set,
            &case,
            (arguments.slices == Slices::Worst).then(|| map.worst_voxel()),
            &picture::names(&arguments.splats, &arguments.volume),
            evaluation,
        )?;
    }
    if let Some(path) = &arguments.table {
        write_atomic(path, arguments.force, |out| out.write_all(csv(evaluation).as_bytes()))?;
    }
    if let Some(path) = &arguments.map {
        nifti::write(path, &map.volume(), arguments.force)?;
    }
    if console.json {
        let description = gpu.description();
        console.json_data(&EvaluationOutput {
            splats: splats.len(),
            quality: Quality::of(evaluation),
            form: set.form_name(),
            field: Quality::of(&of_field),
            decoded: Quality::of(&of_decoded),
            range_of: range_of(arguments.range).0,
            errors,
            iterations: set.iterations,
            seconds: start.elapsed().as_secs_f64(),
            device_peak_bytes: gpu.peak_bytes(),
            host_peak_bytes: host_peak_bytes(),
            device: description.name.clone(),
            driver: description.driver.clone(),
            roi_voxels: case.roi.voxel_count(),
            outputs: written.iter().map(|p| p.display().to_string()).collect(),
        })?;
    } else {
        console.data(&text(arguments, &set, &case, &of_decoded, &of_field, &errors))?;
    }
    Ok(0)
}

/// Returns the figures as text: those of what is shown, then those of the other way to see it.
fn text(
    arguments: &EvalArguments,
    set: &SplatSet,
    case: &Case,
    of_decoded: &Evaluation,
    of_field: &Evaluation,
    errors: &ErrorsByPlace,
) -> String {
    let is_coded = !set.voxels.is_empty();
    let of_grid = set.form != Form::Field;
    let shown = quality_text(if of_grid { of_decoded } else { of_field });
    let head = match is_coded {
        true => format!("{} coded voxels\n{shown}", set.coded_count()),
        false => format!("{} splats in {} voxels\n{shown}", set.splats.len(), case.roi.voxel_count()),
    };
    let of = range_of(arguments.range).1;
    let field = ("as modes slab and exact show the splats", of_field);
    let decoded = ("as mode decoded shows them: on the scan's grid, interpolated", of_decoded);
    let tables = if of_grid { [decoded, field] } else { [field, decoded] };
    let quality: String = tables
        .iter()
        .take(if is_coded { 1 } else { 2 })
        .map(|(what, found)| format!("{what}:\n{}", quality_table(found, of)))
        .collect();
    head + &quality + &errors.table(&case.volume)
}

impl EvalArguments {
    fn protocol(&self, case: &Case) -> Result<Protocol> {
        Ok(Protocol {
            offsets: evaluate::random_offsets(self.offsets as usize, self.seed),
            range: case.range(self.range)?,
            shell: self.shell,
            threshold: unweighted(self.range),
        })
    }
}

/// Returns the origin of a range, for scripts and for people.
fn range_of(chosen: Option<Range>) -> (&'static str, &'static str) {
    match chosen {
        Some(Range::Given(_)) => ("given", "given"),
        Some(Range::Roi) => ("roi", "the volume's inside the region"),
        Some(Range::Own) | None => ("volume", "of the whole volume"),
    }
}

fn csv(evaluation: &Evaluation) -> String {
    let mut out = String::from(
        "offset_x,offset_y,offset_z,psnr_db,mmse,rmse_hu,p99_hu,occupancy_rmse,soft_dice,range_low,range_high\n",
    );
    let [low, high] = evaluation.range;
    for m in std::iter::once(&evaluation.on_grid).chain(&evaluation.between) {
        let [x, y, z] = m.offset;
        // Writing to a string cannot fail.
        let _ = writeln!(
            out,
            "{x},{y},{z},{},{},{},{},{},{},{low},{high}",
            m.psnr_db, m.mmse, m.rmse_hu, m.p99_hu, m.occupancy_rmse, m.soft_dice
        );
    }
    out
}
