//! The DICOM reader: from a folder or a file to a volume.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::find::{dicom_files, dicom_files_beside};
use super::geometry::{Arrangement, arrange};
use super::header::{Content, Frame, Skipped, read_header};
use super::pixels;
use super::stacks::{Stack, StackSummary, choose, stacks};
use crate::volume::source::reserve_samples;
use crate::volume::{ReadOptions, Volume};
use crate::{Error, Kind, Result};

/// Lists the stacks of a folder or a file, in the order in which [`ReadOptions::series`] counts.
///
/// # Errors
/// As [`Volume::read`], except that no series need be chosen.
pub fn list(path: &Path, options: &ReadOptions) -> Result<Vec<StackSummary>> {
    let stacks = stacks(frames_of(path, options)?.0);
    Ok(stacks.iter().enumerate().map(|(i, stack)| stack.summary(i + 1)).collect())
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
    let (frames, left_out) = frames_of(path, options)?;
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
    let arrangement = arrange(stack).map_err(named)?;
    for note in left_out.into_iter().chain(arrangement.notes.iter().cloned()).chain(notes(stack)) {
        tracing::warn!("{}: {note}", path.display());
    }
    volume(stack, &arrangement, options).map_err(named)
}

/// Frames, and a note on what was left out.
type Found = (Vec<Frame>, Option<String>);

/// Reads the frames that have a place: those of a folder, of a file of several frames, or of the series of a
/// single slice.
fn frames_of(path: &Path, options: &ReadOptions) -> Result<Found> {
    if path.is_dir() {
        return frames(path, &dicom_files(path)?, options);
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match read_header(path)? {
        Err(Skipped::Directory) => frames(folder, &dicom_files(folder)?, options),
        Err(skipped) => Err(nothing(path, &[skipped])),
        Ok(frames) if frames.len() > 1 => Ok((frames, None)),
        Ok(own) => {
            let (mut beside, _) = frames(folder, &dicom_files_beside(folder)?, options)?;
            let series = own.first().map(|frame| frame.file.series.clone()).unwrap_or_default();
            beside.retain(|frame| frame.file.series == series);
            Ok((beside, None))
        }
    }
}

fn frames(folder: &Path, files: &[PathBuf], options: &ReadOptions) -> Result<Found> {
    let contents: Vec<Result<Content>> = files.par_iter().map(|file| read_header(file)).collect();
    let (mut frames, mut skipped) = (Vec::new(), Vec::new());
    for content in contents {
        match content {
            Ok(Ok(content)) => frames.extend(content),
            Ok(Err(reason)) => skipped.push(reason),
            Err(e) if options.lenient => tracing::warn!("{e}; left out"),
            Err(e) => return Err(e),
        }
    }
    if frames.is_empty() {
        return Err(nothing(folder, &skipped));
    }
    let placeless = skipped.iter().filter(|reason| matches!(reason, Skipped::NoPlace(_))).count();
    let left_out =
        (placeless > 0).then(|| format!("{placeless} images have no place in the patient: left out"));
    Ok((frames, left_out))
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
                .file(&frame.file.path)
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
            files.entry(&frame.file.path).or_default().push((frame, plane));
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
