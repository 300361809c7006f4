//! The series of a folder as people choose from them, and the files of one.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use dicom_dictionary_std::tags;
use rayon::prelude::*;

use super::elements::{self, Element};
use super::geometry::arrange;
use super::pixels;
use super::read::{Found, find};
use super::stacks::{Stack, StackSummary, choose, key, stacks};
use crate::ReadOptions;
use base::{Error, Result};

/// A series with what a person knows it by. The name of the patient is for the screen: it is never written.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// Its row in the list of [`super::list`].
    pub summary: StackSummary,
    /// What names it wherever its files lie, which [`ReadOptions::series`] takes, too: the UID of its series, with its
    /// number in the series where that has several (`1.2.3#2`).
    pub key: String,
    /// Name of the patient, family name first; empty if there is none.
    pub patient: String,
    /// Day of the study, as 2026-03-31; empty if there is none.
    pub study_date: String,
    /// Thickness of the slices that the scanner gives, mm; 0 if it gives none.
    pub thickness_mm: f64,
    /// Distance of neighbouring slices, mm; `None` if they lie on no regular planes, or there is one.
    pub distance_mm: Option<f64>,
    /// What is wrong or unusual: missing slices, uneven distances.
    pub notes: Vec<String>,
    /// The slice in the middle; `None` if it cannot be read.
    pub slice: Option<Slice>,
}

/// A slice of a series.
#[derive(Clone, Debug, PartialEq)]
pub struct Slice {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Distance of neighbouring columns, then of rows, mm.
    pub spacing_mm: [f64; 2],
    /// Intensities, columns fastest, rows from the top.
    pub samples: Vec<f32>,
}

/// The files of one series.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SeriesFiles {
    /// Its [`Series::key`]; `None` for structures.
    pub key: Option<String>,
    /// Its files, or that of the structures, in the order of their names; members of a zip as paths below it.
    pub files: Vec<PathBuf>,
}

/// Lists the series of a folder, a zip or a file, each with the slice in its middle; none of a file of structures.
///
/// # Errors
/// As [`super::list`].
pub fn series(path: &Path, options: &ReadOptions) -> Result<Vec<Series>> {
    let Found::Frames(frames, _) = find(&path.into(), options)? else { return Ok(Vec::new()) };
    let stacks = stacks(frames);
    Ok((0..stacks.len()).into_par_iter().map(|at| described(&stacks, at)).collect())
}

fn described(stacks: &[Stack], at: usize) -> Series {
    let stack = &stacks[at];
    let middle = &stack.frames[stack.frames.len() / 2];
    let (distance_mm, found) = match arrange(&stack.frames, &[]) {
        Ok(found) if stack.frames.len() > 1 => {
            (Some(found.world_from_voxel.matrix3.z_axis.length()), found.notes)
        }
        Ok(_) => (None, Vec::new()),
        Err(error) => (None, vec![error.message]),
    };
    let object = middle.file.location.open(Some(tags::PIXEL_DATA)).ok().map(|opened| opened.object);
    // What cannot be read is not shown; nothing is computed of it.
    let text = |element: Element| element.text(object.as_ref()?).ok()?;
    Series {
        summary: stack.summary(at + 1),
        key: key(stacks, at),
        patient: name_of(&text(elements::PATIENT_NAME).unwrap_or_default()),
        study_date: date_of(&text(elements::STUDY_DATE).unwrap_or_default()),
        thickness_mm: middle.thickness,
        distance_mm,
        notes: stack.notes.iter().cloned().chain(found).collect(),
        slice: slice_of(stack),
    }
}

/// Returns the slice in the middle of a stack.
fn slice_of(stack: &Stack) -> Option<Slice> {
    let middle = &stack.frames[stack.frames.len() / 2];
    pixels::check(&middle.file).ok()?;
    let mut samples = vec![0.0; middle.size.iter().product()];
    let file = Arc::clone(&middle.file);
    pixels::read_frames(&file, vec![(middle, samples.as_mut_slice())]).ok()?;
    Some(Slice { size: middle.size, spacing_mm: middle.spacing, samples })
}

/// Returns a name as people write it: `Family, Given Middle` of `Family^Given^Middle=...`.
fn name_of(text: &str) -> String {
    let alphabetic =
        text.split('=').find(|group| !group.trim_matches(['^', ' ']).is_empty()).unwrap_or_default();
    let parts: Vec<_> = alphabetic.split('^').map(str::trim).collect();
    let (family, rest) = parts.split_first().map_or(("", &[][..]), |(first, rest)| (*first, rest));
    let given: Vec<_> = rest.iter().take(2).copied().filter(|part| !part.is_empty()).collect();
    [family.to_owned(), given.join(" ")]
        .into_iter()
        .filter(|part| !part.is_empty())
        .collect::<Vec<_>>()
        .join(", ")
}

/// Returns `2026-03-31` of `20260331`; other texts as they are.
fn date_of(text: &str) -> String {
    match text.len() == 8 && text.bytes().all(|b| b.is_ascii_digit()) {
        true => format!("{}-{}-{}", &text[..4], &text[4..6], &text[6..]),
        false => text.to_owned(),
    }
}

/// Returns the files of the series that [`crate::Volume::read`] would read, with those of its other stacks.
///
/// # Errors
/// As [`crate::Volume::read`].
pub fn series_files(path: &Path, options: &ReadOptions) -> Result<SeriesFiles> {
    let stacks = match find(&path.into(), options)? {
        Found::Structures(location, _) => return Ok(SeriesFiles { key: None, files: vec![location.path] }),
        Found::Frames(frames, _) => stacks(frames),
    };
    let named = |e: Error| e.or_file(path);
    let stack = choose(&stacks, options.series.as_deref()).map_err(named)?;
    let at = stacks.iter().position(|other| std::ptr::eq(other, stack)).unwrap_or(0);
    let same = stacks.iter().filter(|other| other.first().file.series == stack.first().file.series);
    let files: BTreeSet<_> =
        same.flat_map(|other| &other.frames).map(|frame| frame.file.location.path.clone()).collect();
    Ok(SeriesFiles { key: Some(key(&stacks, at)), files: files.into_iter().collect() })
}

/// Returns true if text is a UID or a [`Series::key`], and not a number in the list or a description.
pub fn is_key(text: &str) -> bool {
    let uid = text.split('#').next().unwrap_or_default();
    uid.contains('.') && uid.bytes().all(|b| b.is_ascii_digit() || b == b'.')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_dates_are_as_people_write_them() {
        for (text, name) in [
            ("Doe^Jane^M", "Doe, Jane M"),
            ("Doe^Jane^^Dr^PhD", "Doe, Jane"),
            ("Yamada^Tarou=山田^太郎", "Yamada, Tarou"),
            ("=山田^太郎", "山田, 太郎"),
            ("ANON-17", "ANON-17"),
            ("^", ""),
            ("", ""),
        ] {
            assert_eq!(name_of(text), name);
        }
        assert_eq!((date_of("20260331").as_str(), date_of("2026.03").as_str()), ("2026-03-31", "2026.03"));
    }

    #[test]
    fn keys_are_no_numbers_and_no_descriptions() {
        for (text, is) in
            [("1.2.840.3", true), ("1.2.3#2", true), ("3", false), ("Bone 1.5", false), ("", false)]
        {
            assert_eq!(is_key(text), is, "{text}");
        }
    }
}
