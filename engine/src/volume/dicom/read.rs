//! The DICOM reader: from a folder or a file to a volume.

use std::collections::BTreeMap;
use std::path::Path;

use rayon::prelude::*;

use super::find::{dicom_files, dicom_files_beside, is_zip_file, zipped_dicom_files};
use super::geometry::{Arrangement, arrange};
use super::header::{Content, Frame, Skipped, Structures, read_header};
use super::location::Location;
use super::stacks::{Stack, StackSummary, choose, stacks};
use super::structures::Structure;
use super::{contours, pixels, segmentation};
use crate::volume::source::reserve_samples;
use crate::volume::{ReadOptions, Volume};
use crate::{Error, Kind, Result};

/// Lists the stacks of a folder, a zip or a file, in the order in which [`ReadOptions::series`] counts; none of
/// a file of structures.
///
/// # Errors
/// As [`Volume::read`], except that no series need be chosen.
pub fn list(path: &Path, options: &ReadOptions) -> Result<Vec<StackSummary>> {
    let Found::Frames(frames, _) = find(path, options)? else { return Ok(Vec::new()) };
    let stacks = stacks(frames);
    Ok(stacks.iter().enumerate().map(|(i, stack)| stack.summary(i + 1)).collect())
}

/// Lists the structures of a segmentation or a structure set; `None` if the file is neither.
///
/// # Errors
/// As [`Volume::read`], except that no series need be chosen.
pub fn structures(path: &Path, options: &ReadOptions) -> Result<Option<Vec<Structure>>> {
    match find(path, options)? {
        Found::Frames(..) => Ok(None),
        Found::Structures(location, Structures::Voxels) => segmentation::structures(&location).map(Some),
        Found::Structures(location, Structures::Contours) => contours::structures(&location).map(Some),
    }
}

/// Reads one series. See [`Volume::read`], which recognises the format first. A single slice stands for the
/// series of its folder.
///
/// # Errors
/// As [`Volume::read`].
pub fn read(path: &Path, options: &ReadOptions) -> Result<Volume> {
    let named = |e: Error| if e.file.is_some() { e } else { e.file(path) };
    if options.volume_index.is_some_and(|index| index > 0) {
        let message = "a DICOM series is chosen by --series, not by --volume-index";
        return Err(Error::new(Kind::Usage, "VGS-DCM-013", message)
            .file(path)
            .help("`vgs info` lists the series"));
    }
    let (frames, left_out) = match find(path, options)? {
        Found::Frames(frames, left_out) => (frames, left_out),
        Found::Structures(location, Structures::Voxels) => return segmentation::read(&location, options),
        Found::Structures(location, Structures::Contours) => return contours::read(&location, options),
    };
    let stacks = stacks(frames);
    let asked = options.series.as_deref();
    let stack = choose(&stacks, asked).map_err(named)?;
    if stacks.len() > 1 && asked.is_none() {
        let number = 1 + stacks.iter().position(|other| std::ptr::eq(other, stack)).unwrap_or(0);
        let rest = stacks.len() - 1;
        tracing::warn!(
            "{}: taken is {}; {rest} more can be chosen with --series",
            path.display(),
            stack.summary(number).line()
        );
    }
    let arrangement = arrange(&stack.frames, None).map_err(named)?;
    for note in left_out.into_iter().chain(arrangement.notes.iter().cloned()).chain(notes(stack)) {
        tracing::warn!("{}: {note}", path.display());
    }
    volume(stack, &arrangement, options).map_err(named)
}

/// What a folder or a file holds.
enum Found {
    /// Frames that have a place, and notes on what was left out.
    Frames(Vec<Frame>, Vec<String>),
    /// A file of structures.
    Structures(Location, Structures),
}

/// Reads the frames that have a place: those of a folder or a zip, of a file of several frames, or of the series
/// of a single slice. Where there are none, finds the structures.
fn find(path: &Path, options: &ReadOptions) -> Result<Found> {
    if path.is_dir() {
        return found(path, &dicom_files(path)?, options);
    }
    if is_zip_file(path) {
        return found(path, &zipped_dicom_files(path, options)?, options);
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let location = Location::on_disk(path);
    location.check_packed(options.max_bytes)?;
    match read_header(&location)? {
        Err(Skipped::Directory) => found(folder, &dicom_files(folder)?, options),
        Err(Skipped::Structures(kind)) => Ok(Found::Structures(location, kind)),
        Err(skipped) => Err(nothing(path, &[skipped])),
        Ok(frames) if frames.len() > 1 => Ok(Found::Frames(frames, Vec::new())),
        Ok(own) => {
            let Found::Frames(mut beside, _) = found(folder, &dicom_files_beside(folder)?, options)? else {
                return Ok(Found::Frames(own, Vec::new()));
            };
            let series = own.first().map(|frame| frame.file.series.clone()).unwrap_or_default();
            beside.retain(|frame| frame.file.series == series);
            Ok(Found::Frames(beside, Vec::new()))
        }
    }
}

fn found(folder: &Path, files: &[Location], options: &ReadOptions) -> Result<Found> {
    let contents: Vec<Result<Content>> = files
        .par_iter()
        .map(|file| file.check_packed(options.max_bytes).and_then(|()| read_header(file)))
        .collect();
    let (mut frames, mut skipped, mut structures) = (Vec::new(), Vec::new(), Vec::new());
    for (content, location) in contents.into_iter().zip(files) {
        match content {
            Ok(Ok(content)) => frames.extend(content),
            Ok(Err(Skipped::Structures(kind))) => structures.push((location, kind)),
            Ok(Err(reason)) => skipped.push(reason),
            Err(e) if options.lenient => tracing::warn!("{e}; left out"),
            Err(e) => return Err(e),
        }
    }
    match (frames.is_empty(), structures.as_slice()) {
        (true, []) => return Err(nothing(folder, &skipped)),
        (true, [(location, kind)]) => return Ok(Found::Structures((*location).clone(), *kind)),
        (true, several) => {
            let message = format!("there are {} files of structures, and no scan", several.len());
            let names = several.iter().take(10).map(|(location, _)| location.path.display().to_string());
            return Err(Error::new(Kind::Usage, "VGS-DCM-020", message)
                .file(folder)
                .help(format!("give one of them: {}", names.collect::<Vec<_>>().join(", "))));
        }
        (false, _) => {}
    }
    let placeless = skipped.iter().filter(|reason| matches!(reason, Skipped::NoPlace(_))).count();
    let mut left_out = Vec::new();
    if placeless > 0 {
        left_out.push(format!("{placeless} images have no place in the patient: left out"));
    }
    if let [(first, _), ..] = structures.as_slice() {
        let (count, name) = (structures.len(), first.path.display());
        left_out.push(format!("{count} files of structures are left out: give one as a mask, --roi {name}"));
    }
    Ok(Found::Frames(frames, left_out))
}

/// Returns the error for files without a usable frame.
fn nothing(path: &Path, skipped: &[Skipped]) -> Error {
    let placeless = skipped.iter().find_map(|reason| match reason {
        Skipped::NoPlace(what) => Some(what),
        _ => None,
    });
    let message = match placeless {
        Some(what) => format!("images without a place in the patient, such as {what}"),
        None => "DICOM without an image".to_owned(),
    };
    Error::new(Kind::BadData, "VGS-DCM-004", message)
        .file(path)
        .help("position, orientation and distance of the pixels are needed; export the original slices")
}

/// Returns notes for the user about the values.
fn notes(stack: &Stack) -> Vec<String> {
    let file = &stack.first().file;
    let mut notes = Vec::new();
    let slopes = stack.frames.iter().filter(|frame| frame.rescale != stack.first().rescale).count();
    if slopes > 0 {
        notes.push("each slice is scaled by its own slope and intercept".to_owned());
    }
    let units = file.units.to_uppercase();
    if file.modality == "CT" && !["", "HU", "HU_MOD"].contains(&units.as_str()) {
        notes.push(format!("the values are in {}, not in HU", file.units));
    }
    if file.photometric == "MONOCHROME1" {
        notes.push(
            "the scanner's picture is inverted (MONOCHROME1); intensities are as they are stored".to_owned(),
        );
    }
    notes
}

/// Reads the pixels of a stack into its planes; planes without a slice are NaN.
fn volume(stack: &Stack, arrangement: &Arrangement, options: &ReadOptions) -> Result<Volume> {
    let size = arrangement.size;
    let voxels = size.iter().try_fold(1_u64, |product, &n| product.checked_mul(n as u64));
    let bytes = voxels.and_then(|n| n.checked_mul(4)).filter(|&bytes| bytes <= options.max_bytes);
    let Some(bytes) = bytes else {
        let message = format!(
            "a volume of {} x {} x {} voxels is more than the limit of {} bytes",
            size[0], size[1], size[2], options.max_bytes
        );
        return Err(Error::new(Kind::BadData, "VGS-VOL-005", message)
            .help("if the size is right, raise the limit with --max-bytes"));
    };
    for frame in &stack.frames {
        pixels::check(&frame.file)?;
        if !frame.rescale.iter().all(|v| v.is_finite()) {
            let message = format!("rescale slope and intercept are {:?}", frame.rescale);
            return Err(Error::new(Kind::BadData, "VGS-DCM-014", message)
                .file(&frame.file.location.path)
                .help("the file is damaged; copy it again"));
        }
    }
    let count = (bytes / 4) as usize;
    let mut samples = reserve_samples(count)?;
    samples.resize(count, f32::NAN);
    let mut planes: Vec<Option<&mut [f32]>> = samples.chunks_mut(size[0] * size[1]).map(Some).collect();
    let mut files: BTreeMap<&Path, Vec<(&Frame, &mut [f32])>> = BTreeMap::new();
    for (frame, &plane) in stack.frames.iter().zip(&arrangement.planes) {
        if let Some(plane) = planes.get_mut(plane).and_then(Option::take) {
            files.entry(&frame.file.location.path).or_default().push((frame, plane));
        }
    }
    let files: Vec<_> = files.into_values().collect();
    files.into_par_iter().try_for_each(|frames| match frames.first() {
        Some((first, _)) => {
            let file = std::sync::Arc::clone(&first.file);
            pixels::read_frames(&file, frames)
        }
        None => Ok(()),
    })?;
    Ok(Volume::new(size, arrangement.world_from_voxel, samples))
}
