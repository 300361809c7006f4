//! The DICOM reader: from a folder or a file to a volume.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use dicom_object::Tag;
use rayon::prelude::*;

use super::find::{dicom_files, dicom_files_beside, is_zip_file, zipped_dicom_files};
use super::geometry::{Arrangement, arrange};
use super::header::{Content, FileHeader, Frame, Part, Skipped, Structures, read_header};
use super::location::Location;
use super::scale::Scale;
use super::stacks::{Stack, StackSummary, choose, name, stacks};
use super::structures::Structure;
use super::{contours, elements, pixels, segmentation};
use crate::source::reserve_samples;
use crate::{ReadOptions, Volume};
use base::input::Input;
use base::unit::Unit;
use base::{Error, Kind, Result};

/// Lists the stacks of a folder, a zip or a file, in the order in which [`ReadOptions::series`] counts; none of
/// a file of structures.
///
/// # Errors
/// As [`Volume::read`], except that no series need be chosen.
pub fn list(path: &Path, options: &ReadOptions) -> Result<Vec<StackSummary>> {
    let Found::Frames(frames, _) = find(&path.into(), options)? else { return Ok(Vec::new()) };
    let stacks = stacks(frames);
    Ok(stacks.iter().enumerate().map(|(i, stack)| stack.summary(i + 1)).collect())
}

/// Lists the structures of a segmentation or a structure set; `None` if the file is neither.
///
/// # Errors
/// As [`Volume::read`], except that no series need be chosen.
pub fn structures(path: &Path, options: &ReadOptions) -> Result<Option<Vec<Structure>>> {
    match find(&path.into(), options)? {
        Found::Frames(..) => Ok(None),
        Found::Structures(location, Structures::Voxels) => segmentation::structures(&location).map(Some),
        Found::Structures(location, Structures::Contours) => contours::structures(&location).map(Some),
    }
}

/// Reads one series, as [`Volume::read`] does. A single slice stands for the series of its folder.
pub(crate) fn read(input: &Input, options: &ReadOptions) -> Result<Volume> {
    if options.volume_index.is_some_and(|index| index > 0) {
        let message = "a DICOM series is chosen by --series, not by --volume-index";
        return Err(Error::new(Kind::Usage, "VGS-DCM-013", message).help("`vgs info` lists the series"));
    }
    let (frames, left_out) = match find(input, options)? {
        Found::Frames(frames, left_out) => (frames, left_out),
        Found::Structures(location, Structures::Voxels) => return segmentation::read(&location, options),
        Found::Structures(location, Structures::Contours) => return contours::read(&location, options),
    };
    let stacks = stacks(frames);
    let asked = options.series.as_deref();
    let stack = choose(&stacks, asked)?;
    if stacks.len() > 1 && asked.is_none() {
        let number = 1 + stacks.iter().position(|other| std::ptr::eq(other, stack)).unwrap_or(0);
        let rest = stacks.len() - 1;
        tracing::warn!(
            "{}: taken is {}; {rest} more can be chosen with --series",
            input.name().display(),
            stack.summary(number).line()
        );
    }
    let arrangement = arrange(&stack.frames, &[])?;
    check_scales(stack)?;
    let missing = missing_parts(stack, &stacks);
    if let (Some(parts), false) = (&missing, options.lenient) {
        let message = format!("the file is a part of a whole: {parts}");
        return Err(Error::new(Kind::BadData, "VGS-DCM-025", message)
            .help("put all parts into one folder and give that; --lenient reads what is there"));
    }
    let notes =
        left_out.into_iter().chain(stack.notes.iter().cloned()).chain(arrangement.notes.iter().cloned());
    for note in notes.chain(missing).chain(notes_on_values(stack)) {
        tracing::warn!("{}: {note}", input.name().display());
    }
    volume(stack, &arrangement, options)
}

/// What a folder or a file holds.
pub(super) enum Found {
    /// Frames that have a place, and notes on what was left out.
    Frames(Vec<Frame>, Vec<String>),
    /// A file of structures.
    Structures(Location, Structures),
}

/// Reads the frames that have a place: those of a folder or a zip, of a file of several frames, or of the series
/// of a single slice. Where there are none, finds the structures.
pub(super) fn find(input: &Input, options: &ReadOptions) -> Result<Found> {
    if is_zip_file(input) {
        return found(input.name(), &zipped_dicom_files(input, options)?, options);
    }
    let path = input.needed_path("a DICOM file, beside which the others of its series are looked for")?;
    if path.is_dir() {
        return found(path, &dicom_files(path)?, options);
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let location = Location::on_disk(path);
    location.check_packed(options.max_bytes)?;
    match read_header(&location)? {
        Err(Skipped::Directory) => found(folder, &dicom_files(folder)?, options),
        Err(Skipped::Structures(kind)) => Ok(Found::Structures(location, kind)),
        Err(skipped) => Err(nothing(path, &[skipped])),
        // A part of a concatenation stands for all of it, as a slice does for its series.
        Ok(frames) if frames.len() > 1 && frames[0].file.part.is_none() => {
            Ok(Found::Frames(frames, Vec::new()))
        }
        Ok(own) => {
            let Found::Frames(mut beside, _) = found(folder, &dicom_files_beside(folder)?, options)? else {
                return Ok(Found::Frames(own, Vec::new()));
            };
            let Some(of_own) = own.first().map(|frame| Arc::clone(&frame.file)) else {
                return Ok(Found::Frames(own, Vec::new()));
            };
            let whole = |part: &Option<Part>| part.as_ref().map(|part| part.whole.clone());
            beside.retain(|frame| {
                frame.file.series == of_own.series && whole(&frame.file.part) == whole(&of_own.part)
            });
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
    let no_integers = skipped.iter().filter(|reason| matches!(reason, Skipped::NoIntegers(_))).count();
    let mut left_out = Vec::new();
    if no_integers > 0 {
        left_out.push(format!("images of real numbers and spectra are left out: {no_integers}"));
    }
    if placeless > 0 {
        left_out.push(format!("images without a place in the patient are left out: {placeless}"));
    }
    if let [(first, _), ..] = structures.as_slice() {
        let (count, name) = (structures.len(), first.path.display());
        left_out
            .push(format!("files of structures are left out ({count}): give one as a mask, --roi {name}"));
    }
    Ok(Found::Frames(frames, left_out))
}

/// Returns the error for files without a usable frame.
fn nothing(path: &Path, skipped: &[Skipped]) -> Error {
    let no_integers = skipped.iter().find_map(|reason| match reason {
        Skipped::NoIntegers(what) => Some(what),
        _ => None,
    });
    if let Some(what) = no_integers {
        let message = format!("the pixels of {what} are real numbers or spectra, which are not read");
        return Error::new(Kind::BadData, "VGS-DCM-027", message)
            .file(path)
            .help("Float Pixel Data and Spectroscopy Data need another program; give images of integers");
    }
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

/// Refuses slices of which some have a scale and others none: what these hold is not known.
fn check_scales(stack: &Stack) -> Result<()> {
    let (with, without): (Vec<&Frame>, Vec<&Frame>) =
        stack.frames.iter().partition(|frame| frame.scale != Scale::Stored);
    let (Some(_), Some(bare)) = (with.first(), without.first()) else { return Ok(()) };
    let message = format!(
        "{} and {} are missing in {} of {} slices, as in {}",
        elements::RESCALE_SLOPE,
        elements::RESCALE_INTERCEPT,
        without.len(),
        stack.frames.len(),
        name(bare)
    );
    Err(Error::new(Kind::BadData, "VGS-DCM-024", message)
        .help("their values cannot be compared with those of the others; export the series again"))
}

/// Returns a text on the parts that are missing of the concatenations of a stack; other stacks may have some of them.
fn missing_parts(stack: &Stack, all: &[Stack]) -> Option<String> {
    fn parts(stack: &Stack) -> impl Iterator<Item = &Part> {
        stack.frames.iter().filter_map(|frame| frame.file.part.as_ref())
    }
    let own: BTreeSet<&str> = parts(stack).map(|part| part.whole.as_str()).collect();
    let mut wholes: BTreeMap<&str, (BTreeSet<i64>, i64)> = BTreeMap::new();
    for part in all.iter().flat_map(parts).filter(|part| own.contains(part.whole.as_str())) {
        let (there, of) = wholes.entry(&part.whole).or_default();
        there.insert(part.number);
        *of = part.of.unwrap_or(0).max(*of).max(part.number);
    }
    wholes.into_values().find_map(|(there, of)| {
        let missing: Vec<_> =
            (1..=of).filter(|number| !there.contains(number)).map(|n| n.to_string()).collect();
        (!missing.is_empty())
            .then(|| format!("{} of {of} parts are there; missing: {}", there.len(), missing.join(", ")))
    })
}

/// What Rescale Type says of a CT in HU; empty where it says nothing.
const HU: [&str; 3] = ["", "HU", "HU_MOD"];

/// Returns notes for the user about the values.
fn notes_on_values(stack: &Stack) -> Vec<String> {
    let first = stack.first();
    let file = &first.file;
    let mut notes = Vec::new();
    let count = |is: &dyn Fn(&Frame) -> bool| stack.frames.iter().filter(|frame| is(frame)).count();
    let mut odd: BTreeMap<Tag, (&str, usize)> = BTreeMap::new();
    let mut last: Option<&Arc<FileHeader>> = None;
    for frame in &stack.frames {
        if last.is_none_or(|last| !Arc::ptr_eq(last, &frame.file)) {
            for (tag, text) in elements::of_each_element(&frame.file.oddities) {
                odd.entry(*tag).or_insert((text, 0)).1 += 1;
            }
        }
        last = Some(&frame.file);
    }
    notes.extend(odd.into_values().map(|(text, files)| format!("{text} (files: {files})")));
    if count(&|frame| frame.scale != first.scale) > 0 {
        notes.push("each slice is scaled by its own slope and intercept".to_owned());
    }
    if count(&|frame| frame.units != first.units) > 0 {
        notes.push("the slices do not agree on the units of their values".to_owned());
    }
    let units = first.units.to_uppercase();
    // The standard's term US means that the units are not specified.
    if file.modality == "CT" && units == "US" {
        notes.push("the file does not say what the values are numbers of; they may not be HU".to_owned());
    } else if file.modality == "CT" && !HU.contains(&units.as_str()) {
        notes.push(format!("the values are in {}, not in HU", first.units));
    }
    match &first.scale {
        Scale::Table(_) => notes.push("the values are those of the Modality LUT Sequence".to_owned()),
        Scale::Stored if file.modality == "CT" => notes.push(
            "the file has no slope and intercept: the values are as they are stored, which may not be HU"
                .to_owned(),
        ),
        Scale::Stored if file.real_world => notes.push(
            "the values are as they are stored; the Real World Value Mapping Sequence is not applied"
                .to_owned(),
        ),
        _ => {}
    }
    if !["", "LIN"].contains(&file.relationship.to_uppercase().as_str()) {
        let relationship = &file.relationship;
        notes.push(format!("the values are not linear in what was measured ({relationship})"));
    }
    if file.photometric == "MONOCHROME1" {
        notes.push(
            "the scanner's picture is inverted (MONOCHROME1); intensities are as they are stored".to_owned(),
        );
    }
    notes
}

/// Returns what the values are numbers of; `None` if the file does not say it.
fn unit_of(stack: &Stack) -> Option<Unit> {
    let first = stack.first();
    let units = first.units.to_uppercase();
    match first.file.modality.as_str() {
        // The values tell.
        "CT" if units == "US" || first.scale == Scale::Stored => None,
        "CT" if HU.contains(&units.as_str()) => Some(Unit::Hu),
        "CT" | "MR" | "PT" | "NM" | "US" => Some(Unit::Arbitrary),
        _ => None,
    }
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
    }
    let count = (bytes / 4) as usize;
    let mut samples = reserve_samples(count, options.max_bytes)?;
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
            let file = Arc::clone(&first.file);
            pixels::read_frames(&file, frames)
        }
        None => Ok(()),
    })?;
    let mut volume = Volume::new(size, arrangement.world_from_voxel, samples);
    let space = &stack.first().file.frame_of_reference;
    volume.frame_of_reference = Some(space.clone()).filter(|space| !space.is_empty());
    volume.stated_unit = unit_of(stack);
    Ok(volume)
}
