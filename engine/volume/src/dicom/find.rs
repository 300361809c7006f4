//! The DICOM files of a folder or a zip.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::location::{self, Location, is_zip};
use super::sniff;
use crate::ReadOptions;
use crate::source::SNIFF_BYTES;
use base::input::Input;
use base::{Error, Kind, Result};

/// Levels of nested folders that are searched.
const DEEPEST: usize = 8;
/// More files than any study has; with more, the user has named the wrong folder.
const MOST_FILES: usize = 100_000;

/// Returns the DICOM files of a folder and its subfolders, in the order of their names. Links to folders are
/// not followed.
///
/// # Errors
/// [`Kind::BadData`] if there is none or the folder holds far too many files, and [`Kind::Io`].
pub(super) fn dicom_files(folder: &Path) -> Result<Vec<Location>> {
    files_within(folder, DEEPEST)
}

/// Returns the DICOM files of a folder as [`dicom_files`] does, without those of its subfolders.
pub(super) fn dicom_files_beside(folder: &Path) -> Result<Vec<Location>> {
    files_within(folder, 0)
}

/// Returns the DICOM files of a zip, in the order of their names.
///
/// # Errors
/// [`Kind::BadData`] if there is none, or the zip is damaged, encrypted or too large; [`Kind::Io`].
pub(super) fn zipped_dicom_files(input: &Input, options: &ReadOptions) -> Result<Vec<Location>> {
    let (count, files) = location::members(input, MOST_FILES, options)?;
    if files.is_empty() {
        let message = format!("none of the {count} files in the zip is DICOM");
        return Err(Error::new(Kind::BadData, "VGS-DCM-001", message)
            .file(input.name())
            .help("unpack the zip, and give the volume file in it"));
    }
    Ok(files)
}

/// Returns true if a file is a zip; false also if it cannot be read.
pub(super) fn is_zip_file(input: &Input) -> bool {
    let mut head = Vec::new();
    input.open().and_then(|file| file.take(4).read_to_end(&mut head)).is_ok() && is_zip(&head)
}

fn files_within(folder: &Path, depth: usize) -> Result<Vec<Location>> {
    let mut files = Vec::new();
    gather(folder, depth, &mut files)?;
    let looked_at = files.len();
    files.retain(|path| is_dicom(path));
    if files.is_empty() {
        let message = format!("none of the {looked_at} files in the folder is DICOM");
        return Err(Error::new(Kind::BadData, "VGS-DCM-001", message)
            .file(folder)
            .help("give the folder of a DICOM series, or a volume file such as .nii.gz"));
    }
    files.sort();
    Ok(files.into_iter().map(Location::on_disk).collect())
}

fn gather(folder: &Path, deeper: usize, files: &mut Vec<PathBuf>) -> Result<()> {
    for entry in fs::read_dir(folder).map_err(|e| Error::io(folder, "reading", &e))? {
        let entry = entry.map_err(|e| Error::io(folder, "reading", &e))?;
        let kind = entry.file_type().map_err(|e| Error::io(entry.path(), "reading", &e))?;
        if kind.is_dir() && deeper > 0 {
            gather(&entry.path(), deeper - 1, files)?;
        } else if !kind.is_dir() {
            files.push(entry.path());
        }
        if files.len() > MOST_FILES {
            return Err(Error::new(
                Kind::BadData,
                "VGS-DCM-002",
                format!("the folder holds more than {MOST_FILES} files"),
            )
            .file(folder)
            .help("give the folder of one study or series"));
        }
    }
    Ok(())
}

/// Returns true if a file begins as DICOM does; false also if it cannot be read.
fn is_dicom(path: &Path) -> bool {
    let mut head = Vec::new();
    let regular = fs::metadata(path).is_ok_and(|meta| meta.is_file());
    regular
        && base::input::open(path)
            .and_then(|file| file.take(SNIFF_BYTES as u64).read_to_end(&mut head))
            .is_ok()
        && sniff(&head)
}
