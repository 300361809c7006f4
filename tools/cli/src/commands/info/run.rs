//! Describes the contents of a file (`vgs info`).

use std::io::Read;
use std::path::{Path, PathBuf};

use clap::Args;
use engine::splat::{self, LabelCount, Summary};
use engine::unit::Unit;
use engine::volume::dicom::{self, StackSummary, Structure};
use engine::volume::nifti::{self, Header};
use engine::volume::{self, Format, LabelChoice, Level, PresentLabel, ReadOptions, Roi, Stats, Volume, inv3};
use engine::{Error, Kind, Result};
use serde::Serialize;

use super::budget::{self, BudgetArguments, FrameBudget};
use crate::shared::console::Console;
use crate::shared::failure::Stop;
use crate::shared::figures::{bytes, table, with_unit};
use crate::shared::inputs::{ReadArguments, volume_of};
use crate::shared::terminal::clean;

/// Tells what volumes and splat files hold
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub struct InfoArguments {
    /// Volumes, splat files, and folders of DICOM series
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// The scan of a mask: its mean intensity in each label is told, too, and contours are counted on its voxels
    #[arg(long, value_name = "VOLUME", help_heading = "Input")]
    volume: Option<PathBuf>,
    #[command(flatten)]
    read: ReadArguments,
    #[command(flatten)]
    budget: BudgetArguments,
}

const EXAMPLES: &str = "\
Examples:
  vgs info ct.nii.gz bones.ply
  vgs info labels.nii.gz --volume ct.nii.gz     the labels that are there, with voxels, ml and mean HU
  vgs info scans/                 the DICOM series in a folder; --series N tells more of one
  vgs info --json bones.ply       one object, on one line, for each file
  vgs info --budget --tf CT-Bone body.ply     where bytes and milliseconds of a frame go";

/// Contents of a file. The tag `kind` and the fields of its format are on one level.
#[derive(Serialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
enum FileContent {
    Splats(Box<Summary>),
    Volume(Box<VolumeContent>),
}

/// What a volume's file says, and what its voxels are.
#[derive(Default, Serialize)]
struct VolumeContent {
    /// Name of the format, if no header has it.
    #[serde(rename = "file_format", skip_serializing_if = "Option::is_none")]
    format: Option<&'static str>,
    #[serde(flatten)]
    header: Option<Box<Header>>,
    /// Resolutions of a file that has several, finest first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    levels: Vec<Level>,
    /// Series of a DICOM folder.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    series: Vec<StackSummary>,
    /// Labels of a mask with their names, as the file lists them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    structures: Vec<Structure>,
    /// Labels that some voxels have.
    #[serde(skip_serializing_if = "Option::is_none")]
    present: Option<Vec<PresentLabel>>,
    /// Text behind an intensity of `present`.
    #[serde(skip)]
    unit: &'static str,
    #[serde(flatten)]
    voxels: Option<Box<Voxels>>,
}

/// Grid and statistics of a readable volume.
#[derive(Serialize)]
struct Voxels {
    size: [usize; 3],
    spacing_mm: [f64; 3],
    axes: String,
    oriented: bool,
    min: f32,
    max: f32,
    mean: f64,
    std_dev: f64,
    non_finite: usize,
    /// What the values are numbers of; nothing of a mask.
    #[serde(skip_serializing_if = "Option::is_none")]
    unit: Option<Unit>,
    /// Why that is in doubt.
    #[serde(skip_serializing_if = "Option::is_none")]
    unit_doubt: Option<String>,
}

#[derive(Serialize)]
struct FileOutput<'a> {
    file: String,
    #[serde(flatten)]
    content: &'a FileContent,
    #[serde(skip_serializing_if = "Option::is_none")]
    budget: Option<&'a FrameBudget>,
}

/// Runs the command.
pub fn run(arguments: &InfoArguments, console: &Console) -> std::result::Result<u8, Stop> {
    let volume = arguments.volume.as_deref().map(|path| volume_of(path, &arguments.read)).transpose()?;
    for (i, path) in arguments.files.iter().enumerate() {
        let content = read_content(path, &arguments.read, volume.as_ref())?;
        let asked = arguments.budget.budget && matches!(content, FileContent::Splats(_));
        let budget = asked.then(|| budget::measure(path, &arguments.budget)).transpose()?;
        let file = path.display().to_string();
        if console.json {
            console.json_data(&FileOutput { file, content: &content, budget: budget.as_ref() })?;
        } else {
            let gap = if i > 0 { "\n" } else { "" };
            let mut out = text(&content);
            for (name, value) in budget.iter().flat_map(FrameBudget::lines) {
                out.add(name, value);
            }
            console.data(&format!("{gap}{}\n{}", clean(&file), out.0))?;
        }
    }
    Ok(0)
}

fn read_content(path: &Path, read: &ReadArguments, of: Option<&Volume>) -> Result<FileContent> {
    let mut start = Vec::new();
    // A file that cannot be read is reported by the reader below.
    let _ = engine::input::open(path).and_then(|file| file.take(splat::SNIFF_BYTES).read_to_end(&mut start));
    if splat::is_splats(path, &start) {
        let summary = splat::describe(path, &splat::ReadOptions::default())?;
        return Ok(FileContent::Splats(Box::new(summary)));
    }
    let mut options = read.options();
    match Format::of(path, &options) {
        Ok(format) if [dicom::NAME, dicom::ZIP_NAME].contains(&format.name) => {
            return dicom_content(path, format.name, &options, of);
        }
        _ => {}
    }
    let header = nifti::describe(path).ok().map(Box::new);
    if header.as_ref().is_some_and(|h| !h.scalar) {
        return Ok(volume_content(VolumeContent { header, ..VolumeContent::default() }));
    }
    if header.as_ref().is_some_and(|h| h.dims.iter().skip(3).product::<usize>() > 1) {
        options.volume_index = options.volume_index.or(Some(0));
    }
    let levels = volume::levels(path)?;
    if levels.iter().any(|level| level.volumes > 1) {
        options.volume_index = options.volume_index.or(Some(0));
    }
    if !levels.is_empty() && options.level.is_none() {
        options.level = readable(&levels, options.max_bytes);
    }
    if !levels.is_empty() && options.level.is_none() && options.voxels.is_none() {
        // The list is the answer.
        return Ok(volume_content(VolumeContent {
            format: Some(Format::of(path, &options)?.name),
            levels,
            ..VolumeContent::default()
        }));
    }
    let volume = Volume::read(path, &options).map_err(|e| not_splats_either(e, path))?;
    let format = if header.is_some() { None } else { Some(Format::of(path, &options)?.name) };
    let structures = if header.is_some() { Vec::new() } else { labels_of(&volume) };
    Ok(volume_content(VolumeContent {
        format,
        header,
        levels,
        structures,
        present: present(&volume, of, path)?,
        unit: of.map_or("", |of| of.unit().text()),
        voxels: Some(Voxels::of(&volume)),
        ..VolumeContent::default()
    }))
}

fn volume_content(content: VolumeContent) -> FileContent {
    FileContent::Volume(Box::new(content))
}

/// Returns the finest resolution that may be read; `None` if there is none.
fn readable(levels: &[Level], max_bytes: u64) -> Option<usize> {
    let bytes =
        |level: &Level| level.size.iter().fold(4, |bytes: u64, &side| bytes.saturating_mul(side as u64));
    levels.iter().position(|level| bytes(level) <= max_bytes)
}

/// Returns the labels that voxels of a file have, if it is a mask of labels.
fn present(file: &Volume, of: Option<&Volume>, path: &Path) -> Result<Option<Vec<PresentLabel>>> {
    if file.labels.is_empty() && !Roi::has_values_of_mask(file) {
        return Ok(None);
    }
    PresentLabel::list(file, of).map_err(|error| error.file(path))
}

/// Lists the series of a DICOM folder, and describes the one that is chosen, or the only one. Lists the
/// structures of a segmentation or a structure set.
fn dicom_content(
    path: &Path,
    format: &'static str,
    options: &ReadOptions,
    of: Option<&Volume>,
) -> Result<FileContent> {
    if let Some(structures) = dicom::structures(path, options)? {
        let mask = match of {
            Some(of) => Volume::read_mask(path, options, &LabelChoice::Whole, of),
            None => Volume::read(path, options),
        };
        let mask = match mask {
            // Contours have no voxels of their own.
            Err(error) if error.kind == Kind::Usage => None,
            mask => Some(mask?),
        };
        return Ok(volume_content(VolumeContent {
            format: Some(format),
            structures,
            present: mask.as_ref().map(|mask| present(mask, of, path)).transpose()?.flatten(),
            unit: of.map_or("", |of| of.unit().text()),
            voxels: mask.as_ref().map(Voxels::of),
            ..VolumeContent::default()
        }));
    }
    let series = dicom::list(path, options)?;
    let voxels = match Volume::read(path, options) {
        Ok(volume) => Some(Voxels::of(&volume)),
        // No series is chosen yet: the list is the answer.
        Err(error)
            if error.kind == Kind::Usage && options.series.is_none() && options.volume_index.is_none() =>
        {
            None
        }
        Err(error) => return Err(error),
    };
    Ok(volume_content(VolumeContent { format: Some(format), series, voxels, ..VolumeContent::default() }))
}

/// Returns the names of labels that the file has.
fn labels_of(volume: &Volume) -> Vec<Structure> {
    let structure = |(&number, name): (&i32, &String)| Structure { number, name: name.clone() };
    volume.labels.iter().map(structure).collect()
}

fn not_splats_either(error: Error, path: &Path) -> Error {
    let ply = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("ply"));
    // What cannot be read at all says so.
    if ply && error.kind == Kind::BadData && error.code != "VGS-IO-002" {
        Error { message: "not a PLY file, nor a volume".into(), ..error }
    } else {
        error
    }
}

impl Voxels {
    fn of(volume: &Volume) -> Box<Self> {
        let Stats { min, max, mean, std_dev, non_finite, .. } = volume.gather_stats();
        let is_scan =
            volume.labels.is_empty() && (volume.stated_unit.is_some() || !Roi::has_values_of_mask(volume));
        Box::new(Voxels {
            size: volume.size,
            spacing_mm: volume.spacing_mm().to_array(),
            axes: volume.axis_codes(),
            oriented: volume.oriented,
            min,
            max,
            mean,
            std_dev,
            non_finite,
            unit: is_scan.then(|| volume.unit()),
            unit_doubt: volume.unit_doubt().filter(|_| is_scan),
        })
    }
}

/// Lines of `name: value`.
struct Lines(String);

impl Lines {
    fn add(&mut self, name: &str, value: impl AsRef<str>) {
        self.0.push_str(&format!("  {name:<12} {}\n", clean(value.as_ref()).replace('\n', " ")));
    }
}

fn text(content: &FileContent) -> Lines {
    let mut out = Lines(String::new());
    match content {
        FileContent::Splats(summary) => splat_lines(summary, &mut out),
        FileContent::Volume(content) => {
            let VolumeContent { format, header, levels, series, structures, present, unit, voxels } =
                &**content;
            level_lines(levels, &mut out);
            let named: Vec<String> = match header {
                Some(h) => h.labels.iter().map(|(number, name)| format!("{number} {name}")).collect(),
                None => structures.iter().map(|s| format!("{} {}", s.number, s.name)).collect(),
            };
            if present.is_none() && !named.is_empty() {
                out.add("labels", named.join(", "));
            }
            volume_lines(format.unwrap_or_default(), header.as_deref(), series, voxels.as_deref(), &mut out);
            if let Some(present) = present {
                present_lines(present, named.len(), unit, &mut out);
            }
        }
    }
    out
}

/// Lists the labels that voxels have; `named` is the number of those that the file names.
fn present_lines(present: &[PresentLabel], named: usize, unit: &str, out: &mut Lines) {
    let of = if named > 0 { format!(" have voxels; the file names {named}") } else { " have voxels".into() };
    out.add("labels", format!("{}{of}", present.len()));
    let [mean, deviation] = ["mean", "standard deviation"].map(|name| with_unit(name, unit));
    let mut heads = vec!["number", "name", "voxels", "volume, ml"];
    let measured = present.iter().any(|label| label.mean.is_some());
    if measured {
        heads.extend([mean.as_str(), deviation.as_str()]);
    }
    let row = |label: &PresentLabel| {
        let name = label.name.as_deref().unwrap_or_default();
        let mut cells = vec![
            label.number.to_string(),
            clean(name).replace('\n', " "),
            label.voxels.to_string(),
            format!("{:.2}", label.ml),
        ];
        if measured {
            let text = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.1}"));
            cells.extend([text(label.mean), text(label.std_dev)]);
        }
        cells
    };
    for line in table(&heads, &present.iter().map(row).collect::<Vec<_>>()).lines() {
        out.0.push_str(&format!("    {line}\n"));
    }
}

fn joined<T: ToString>(values: &[T], between: &str) -> String {
    values.iter().map(ToString::to_string).collect::<Vec<_>>().join(between)
}

fn rounded(values: &[f64]) -> String {
    values
        .iter()
        .map(|v| format!("{:.4}", v))
        .map(|t| t.trim_end_matches('0').trim_end_matches('.').to_owned())
        .collect::<Vec<_>>()
        .join(" x ")
}

fn volume_lines(
    format: &str,
    header: Option<&Header>,
    series: &[StackSummary],
    voxels: Option<&Voxels>,
    out: &mut Lines,
) {
    let Some(h) = header else {
        out.add("format", format);
        for (i, row) in series.iter().enumerate() {
            out.add(if i == 0 { "series" } else { "" }, row.line());
        }
        if let Some(v) = voxels {
            out.add("voxels", joined(&v.size, " x "));
            out.add("spacing", format!("{} mm", rounded(&v.spacing_mm)));
            let source = match (format, v.oriented) {
                (inv3::NAME, _) => " (assumed: the file does not say)",
                (_, false) => " (the file does not say how the patient lies)",
                _ => "",
            };
            out.add("axes", format!("{}{source}", v.axes));
            value_lines(v, out);
        }
        return;
    };
    let gzip = if h.gzip { ", gzip" } else { "" };
    let order = if h.big_endian { ", big-endian" } else { "" };
    out.add("format", format!("{}{gzip}{order}", h.format));
    out.add("voxels", format!("{}, {}", joined(&h.dims, " x "), h.datatype));
    out.add("spacing", format!("{} mm (units in the file: {})", rounded(&h.spacing_mm), h.units));
    let source = if h.oriented { "" } else { ": the file does not say how the patient lies" };
    out.add("axes", format!("{} (from {}{source})", h.axes, h.affine_source));
    for (name, row) in ["to world", "", ""].iter().zip(&h.affine) {
        out.add(name, joined(&row.map(|v| format!("{v:10.4}")), " "));
    }
    if let (Some(slope), Some(inter)) = (h.slope, h.inter) {
        out.add("scaling", format!("{slope} x stored + {inter}"));
    }
    if !h.description.is_empty() {
        out.add("description", &h.description);
    }
    match voxels {
        Some(v) => value_lines(v, out),
        None => {
            out.add("values", format!("{}: not one number a voxel, so not readable as a volume", h.datatype))
        }
    }
    for note in &h.notes {
        out.add("note", note);
    }
}

/// Lists the resolutions of a file.
fn level_lines(levels: &[Level], out: &mut Lines) {
    for (number, level) in levels.iter().enumerate() {
        let volumes = if level.volumes > 1 { format!(", {} volumes", level.volumes) } else { String::new() };
        let chunk = format!("chunks of {}{volumes}", joined(&level.chunk, " x "));
        let (size, spacing) = (joined(&level.size, " x "), rounded(&level.spacing_mm));
        out.add(&format!("level {number}"), format!("{size} voxels, {spacing} mm, {chunk}"));
    }
}

fn value_lines(v: &Voxels, out: &mut Lines) {
    out.add(
        "values",
        format!("{} to {}, mean {:.2}, standard deviation {:.2}", v.min, v.max, v.mean, v.std_dev),
    );
    let unit = match v.unit {
        Some(Unit::Hu) => "HU",
        Some(_) => "none, as of an MR",
        None => "",
    };
    match &v.unit_doubt {
        Some(doubt) => out.add("unit", format!("{unit} ({doubt}; a fit can be told by --unit)")),
        None if !unit.is_empty() => out.add("unit", unit),
        None => {}
    }
    if v.non_finite > 0 {
        out.add("", format!("{} voxels are NaN or infinite", v.non_finite));
    }
}

fn splat_lines(s: &Summary, out: &mut Lines) {
    out.add("format", format!("{}, {}, {}", s.format.to_uppercase(), s.encoding, bytes(s.file_bytes)));
    let dropped =
        if s.dropped > 0 { format!(" ({} unusable ones dropped)", s.dropped) } else { String::new() };
    let widened = if s.widened > 0 {
        format!(" ({} thinner than 1/10000 of their length widened)", s.widened)
    } else {
        String::new()
    };
    if let Some(bound) = s.bound {
        let how = match bound > 0.0 {
            true => format!("each within {bound}{} of the volume", s.unit.text()),
            false => "as they are in the volume".to_owned(),
        };
        out.add("voxels", format!("coded in place of splats, {how}"));
    }
    let has_splats = s.splats > 0 || s.bound.is_none();
    if has_splats {
        out.add("splats", format!("{}{dropped}{widened}", s.splats));
    }
    let meaning = LAYOUTS.iter().find(|(name, _)| *name == s.layout).map_or("", |(_, meaning)| meaning);
    out.add("layout", format!("{}: {meaning}", s.layout));
    if let Some([low, high]) = s.intensity_range {
        let unit = match s.unit {
            Unit::Hu => " HU",
            Unit::Arbitrary => ", without a unit, as of an MR",
            Unit::Luminance => " luminance of the colour; the file holds no HU",
        };
        out.add("intensity", format!("{low} to {high}{unit}"));
    }
    if let Some([low, high]) = s.intensity_01_range {
        out.add("intensity_01", format!("0 to 1 stand for {low} to {high} HU"));
    }
    if let Some(degree) = s.harmonics_degree {
        out.add("colours", format!("spherical harmonics of degree {degree}"));
    }
    if !s.labels.is_empty() {
        let texts: Vec<_> = s.labels.iter().map(|count| label_text(count, has_splats)).collect();
        out.add("labels", joined(&texts, ", "));
    }
    if let Some([low, high]) = s.bounding_box_mm {
        let point = |p: [f64; 3]| joined(&p.map(|v| format!("{v:.1}")), ", ");
        let what = if has_splats { "means" } else { "place" };
        out.add(what, format!("({}) to ({}) mm RAS", point(low), point(high)));
    }
    if let Some([low, high]) = s.index_box_mm {
        let point = |p: [f64; 3]| joined(&p.map(|v| format!("{v:.1}")), ", ");
        out.add("means", format!("({}) to ({}) mm, voxel index times spacing", point(low), point(high)));
    }
    if has_splats {
        out.add("kernel", s.kernel);
        let unit = s.unit.text();
        let field = format!(
            "{}{unit} where no splat reaches (ε {}, w₀ {}: see vgs's method.md)",
            s.background, s.epsilon, s.occupancy_w0
        );
        out.add("field", field);
    }
    if let Some(iterations) = s.iterations {
        out.add("fit", format!("{iterations} iterations"));
    }
    if let Some(crc32) = s.volume_crc32 {
        out.add("volume", format!("CRC-32 of its samples {crc32:08x}"));
    }
    if let Some(size) = s.grid_size {
        let right = match s.form {
            _ if !has_splats => "those of the volume",
            "field" => "the splats are right between them, too",
            _ => "the splats are right at these alone: mode decoded shows them",
        };
        out.add("grid", format!("{} voxels; {right}", joined(&size, " x ")));
        if let Some(voxels) = s.region_voxels {
            out.add("region", format!("{voxels} voxels, exactly those of the mask"));
        }
    }
    let elements: Vec<_> = s.elements.iter().map(|(name, n)| format!("{name} ({n})")).collect();
    out.add("elements", elements.join(", "));
    if has_splats {
        out.add("properties", s.properties.join(" "));
    }
}

/// Explanation of each layout of splats.
const LAYOUTS: [(&str, &str); 4] = [
    ("vgs", "places in mm RAS, an intensity for each splat"),
    ("inria", "rows of 62 floats, places in mm RAS, an intensity for each splat in a second element"),
    (
        "reference",
        "that of the paper's authors; opacities are probabilities, and only the volume can place the splats: give it to \
         eval, rasterize, render or view, with the mask of the fit",
    ),
    ("3dgs", "that of ordinary 3D Gaussian splatting"),
];

/// Formats a label with its name and, if there are splats at all, its number of splats.
fn label_text(count: &LabelCount, has_splats: bool) -> String {
    let LabelCount { label, name, splats } = count;
    let count = if has_splats { format!(" ({splats})") } else { String::new() };
    match (label, name) {
        (0, _) => format!("none{count}"),
        (_, Some(name)) => format!("{label} {name}{count}"),
        (_, None) => format!("{label}{count}"),
    }
}
