//! The files of a session: where they are, as a session file names them, and those that are missing.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use engine::Result;
use serde::{Deserialize, Serialize};

use super::unpacked::{Unpacked, is_packed};
use crate::model::region::{Region, Threshold};

/// Files of the data.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Files {
    /// Splat files, one for each fit.
    pub splats: Vec<PathBuf>,
    /// Splats that are compared with those: they have no rows in the list of objects.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beside: Option<PathBuf>,
    /// The CT or MR that they were fitted to.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub volume: Option<PathBuf>,
    /// The series that is meant, if the volume is a folder or a zip of several DICOM series: its UID, which is what
    /// the viewer writes, its number, or a part of its description.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub series: Option<String>,
    /// The mask or label map of its region.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roi: Option<PathBuf>,
    /// The labels of a label map that make up the region, by number or name, with commas between them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub labels: Option<String>,
    /// The threshold that makes up the region where there is no mask.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub threshold: Option<Threshold>,
    /// Folders of packed sessions that some of these files were unpacked into; they are deleted with the last copy
    /// of this value.
    #[serde(skip)]
    pub unpacked: Vec<Unpacked>,
}

impl Files {
    /// Returns what makes up the region of the volume; `None` if all of it is shown.
    pub fn region(&self) -> Option<Region> {
        let mask = || Some(Region::Mask { path: self.roi.clone()?, labels: self.labels.clone() });
        mask().or_else(|| self.threshold.clone().map(Region::Threshold))
    }

    /// Replaces the region of the volume.
    pub fn set_region(&mut self, region: Option<Region>) {
        (self.roi, self.labels, self.threshold) = match region {
            None => (None, None, None),
            Some(Region::Mask { path, labels }) => (Some(path), labels, None),
            Some(Region::Threshold(threshold)) => (None, None, Some(threshold)),
        };
    }

    /// Returns all of the files.
    pub fn all(&self) -> impl Iterator<Item = &PathBuf> {
        self.splats.iter().chain(&self.beside).chain(&self.volume).chain(&self.roi)
    }

    /// Calls a function with each of the files.
    pub fn change_each(&mut self, change: impl FnMut(&mut PathBuf)) {
        let Files { splats, beside, volume, roi, .. } = self;
        splats.iter_mut().chain(beside).chain(volume).chain(roi).for_each(change);
    }

    /// Returns the files that are not there.
    pub fn missing(&self) -> Vec<PathBuf> {
        let mut missing: Vec<PathBuf> = Vec::new();
        for file in self.all().filter(|file| !file.exists()) {
            if !missing.contains(file) {
                missing.push(file.clone());
            }
        }
        missing
    }

    /// Puts a file that was found in the place of a missing one, and others that lie beside it in theirs.
    pub fn replace_missing(&mut self, missing: &Path, found: &Path) {
        let folder = found.parent().unwrap_or(Path::new("")).to_owned();
        self.change_each(|file| {
            if file == missing {
                *file = found.to_owned();
            } else if !file.exists() {
                *file = place_in(&folder, file);
            }
        });
    }

    /// Makes the paths of a session file in `folder` those of the files. What is not where a path says is looked
    /// for in that folder; what is in a packed session is unpacked.
    ///
    /// # Errors
    /// Returns the errors of [`Unpacked::of`].
    pub(super) fn find_from(&mut self, folder: &Path) -> Result<()> {
        let zips = self.all().filter_map(|file| {
            let path = folder.join(file);
            path.ancestors().skip(1).find(|zip| is_packed(zip)).map(Path::to_owned)
        });
        let zips: BTreeSet<PathBuf> = zips.collect();
        for zip in zips {
            let unpacked = Unpacked::of(&zip)?;
            self.change_each(|file| {
                if let Ok(rest) = folder.join(&file).strip_prefix(&zip) {
                    *file = unpacked.folder().join(rest);
                }
            });
            self.unpacked.push(unpacked);
        }
        // An absolute path replaces the folder.
        self.change_each(|file| *file = place_in(folder, file));
        Ok(())
    }

    /// Returns the files with paths for a session file in `folder`: relative for what is there or below.
    pub(super) fn seen_from(&self, folder: &Path) -> Files {
        let mut files = Files { unpacked: Vec::new(), ..self.clone() };
        files.change_each(|file| {
            let of_zip =
                |unpacked: &Unpacked| Some(unpacked.zip().join(file.strip_prefix(unpacked.folder()).ok()?));
            let path = self.unpacked.iter().find_map(of_zip).unwrap_or_else(|| file.clone());
            let path = std::path::absolute(&path).unwrap_or(path);
            *file = below(folder, &path).unwrap_or(path);
        });
        files
    }

    /// Returns the folder in which one would look for these files; `None` if there are none.
    pub fn folder(&self) -> Option<PathBuf> {
        let first = self.splats.first().or(self.volume.as_ref())?;
        let unpacked = self.unpacked.iter().find(|unpacked| first.starts_with(unpacked.folder()));
        let near = unpacked.map_or(first.as_path(), Unpacked::zip).parent()?;
        near.is_dir().then(|| near.to_owned())
    }

    /// Returns a name for what is shown, after its first file and without its ending; `None` without files.
    pub fn case_name(&self) -> Option<String> {
        let first = self.splats.first().or(self.volume.as_ref())?;
        let name = first.file_name()?.to_string_lossy().into_owned();
        let volumes = engine::volume::FORMATS.iter().flat_map(|format| format.extensions);
        let splats = engine::splat::FORMATS.iter().map(|format| format!(".{}", format.name));
        let endings = volumes.map(|end| (*end).to_owned()).chain(splats);
        let lower = name.to_lowercase();
        // The longest one, as .nii.gz.
        let length = endings.filter(|end| lower.ends_with(end)).map(|end| end.len()).max().unwrap_or(0);
        Some(name[..name.len() - length].to_owned()).filter(|name| !name.is_empty())
    }

    /// Returns true if the volume may be one of several DICOM series, by its name.
    pub fn may_have_series(&self) -> bool {
        self.volume.as_ref().is_some_and(|path| match path.extension() {
            Some(end) => ["dcm", "ima", "zip"].iter().any(|known| end.eq_ignore_ascii_case(known)),
            None => true,
        } || path.is_dir())
    }

    /// Returns true if both name the same volume.
    pub fn has_volume_of(&self, other: &Files) -> bool {
        (&self.volume, &self.series) == (&other.volume, &other.series)
    }
}

/// Returns where a file is that a session in `folder` names: where the path says, or else where the longest end of
/// the path is found in that folder; if it is nowhere, where the path says.
fn place_in(folder: &Path, file: &Path) -> PathBuf {
    let named = folder.join(file);
    if named.exists() {
        return named;
    }
    // The path may be one of another system.
    let text = file.to_string_lossy();
    let parts: Vec<&str> = text.split(['/', '\\']).filter(|part| !["", ".", ".."].contains(part)).collect();
    let ends = (0..parts.len()).map(|start| folder.join(parts[start..].iter().collect::<PathBuf>()));
    ends.into_iter().find(|path| path.exists()).unwrap_or(named)
}

/// Returns the path of a file from a folder that it is in, at any depth, with slashes; `None` if it is elsewhere.
fn below(folder: &Path, file: &Path) -> Option<PathBuf> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let rest = |folder: &Path| {
        let rest = file.strip_prefix(folder).ok()?;
        let parts: Option<Vec<_>> = rest.components().map(|part| part.as_os_str().to_str()).collect();
        let text = parts?.join("/");
        Some(PathBuf::from(if text.is_empty() { ".".to_owned() } else { text }))
    };
    rest(&std::path::absolute(folder).ok()?).or_else(|| rest(&folder.canonicalize().ok()?))
}

#[cfg(test)]
#[path = "files_tests.rs"]
mod tests;
