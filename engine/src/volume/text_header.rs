//! Common parts of NRRD and MetaImage: a header of lines, a file of voxels beside it, and a grid whose
//! directions may be anything.

use std::io::Read;
use std::path::{Path, PathBuf};

use glam::DAffine3;

use super::affine::{axis_codes_of, spacing_of};
use super::source::Source;
use crate::{Error, Kind, Result};

/// The longest header that is read; those of real files have some kilobytes, even with the names of a hundred
/// labels.
const MAX_HEADER: usize = 1 << 20;

/// Reader of the lines of a header. The source is left at the byte after the last line that was read.
pub(super) struct Lines<'a> {
    source: &'a mut Source,
    left: usize,
    /// Number of the last line read, from 1.
    pub number: usize,
}

impl<'a> Lines<'a> {
    /// Creates a reader of lines; `source` is at the beginning of a file.
    pub fn new(source: &'a mut Source) -> Self {
        Lines { source, left: MAX_HEADER, number: 0 }
    }

    /// Returns the next line without its end, or `None` at the end of the file.
    pub fn next(&mut self) -> Result<Option<String>> {
        let mut line = Vec::new();
        let mut byte = [0];
        loop {
            let n = self.source.read(&mut byte).map_err(|e| self.source.failed(&e))?;
            if n == 0 && line.is_empty() {
                return Ok(None);
            }
            if n == 0 || byte == *b"\n" {
                break;
            }
            line.extend(byte);
            self.left = self.left.saturating_sub(1);
            if self.left == 0 {
                let message = format!("the header does not end within {MAX_HEADER} bytes");
                return Err(Error::new(Kind::BadData, "VGS-VOL-023", message)
                    .help("the line that ends the header was damaged: copy the file again"));
            }
        }
        if line.last() == Some(&b'\r') {
            line.pop();
        }
        self.number += 1;
        Ok(Some(String::from_utf8_lossy(&line).into_owned()))
    }
}

/// Skips whole lines of any length; a file with fewer lines is left at its end.
pub(super) fn skip_lines(source: &mut Source, count: u64) -> Result<()> {
    let mut byte = [0];
    let mut left = count;
    while left > 0 && source.read_some(&mut byte)? > 0 {
        left -= u64::from(byte == *b"\n");
    }
    Ok(())
}

/// Returns the beginning of a text from a file, suitable for a message.
pub(super) fn excerpt(text: &str) -> String {
    let short: String = text.chars().take(60).collect();
    let dots = if short.len() < text.len() { "..." } else { "" };
    format!("{}{dots}", short.replace(char::is_control, " "))
}

/// Parses the numbers of a line; `None` if something else is among them.
pub(super) fn reals(text: &str) -> Option<Vec<f64>> {
    text.split_whitespace().map(|word| word.parse().ok()).collect()
}

/// Opens the file of voxels that a header names. It must be in the folder of the header or below it: a header
/// from elsewhere must not lead to other files of this machine.
pub(super) fn open_beside(header: &Path, name: &str, lenient: bool) -> Result<(Source, PathBuf)> {
    let path = path_beside(header, name)?;
    let source = Source::open(&path, lenient).map_err(|e| match e.kind {
        Kind::Missing => {
            e.help(format!("{} says that its voxels are there: put both files together", header.display()))
        }
        _ => e,
    })?;
    Ok((source, path))
}

/// Returns the path of the file that a header names; an error if it is not below the header's folder.
pub(super) fn path_beside(header: &Path, name: &str) -> Result<PathBuf> {
    // Windows programs write backslashes, which no one uses in a name.
    let name = name.trim().replace('\\', "/");
    let has_drive = name.as_bytes().get(1) == Some(&b':');
    if name.is_empty() || name.starts_with('/') || has_drive || name.split('/').any(|part| part == "..") {
        let message =
            format!("the voxels are in '{}', which is not below the header's folder", excerpt(&name));
        return Err(Error::new(Kind::BadData, "VGS-VOL-024", message)
            .file(header)
            .help("put both files in one folder, and write only the name in the header"));
    }
    Ok(header.parent().unwrap_or(Path::new("")).join(name))
}

/// Refuses an affine that is not a grid; returns notes on its oddities, as sentences.
pub(super) fn check_grid(affine: &DAffine3) -> Result<Vec<String>> {
    let bad = |code, message: &str| {
        Error::new(Kind::BadData, code, message).help("the header is damaged: export the volume again")
    };
    if !affine.is_finite() {
        return Err(bad("VGS-VOL-025", "the directions or the origin hold NaN or infinity"));
    }
    let mut notes = Vec::new();
    let spacing = spacing_of(affine);
    let det = affine.matrix3.determinant();
    // Compared with a box of the same voxel size, so that small voxels are not refused.
    if !det.is_normal() || det.abs() <= 1e-6 * spacing.element_product() {
        return Err(bad("VGS-VOL-025", "the directions lie in a plane: voxels have no volume"));
    }
    let m = affine.matrix3;
    let units = [m.x_axis / spacing.x, m.y_axis / spacing.y, m.z_axis / spacing.z];
    let shear = [(0, 1), (0, 2), (1, 2)].map(|(i, j)| units[i].dot(units[j]).abs());
    let most = shear.iter().fold(0.0_f64, |a, &s| a.max(s));
    if most > 1e-3 {
        let degrees = most.min(1.0).asin().to_degrees();
        notes.push(format!("the axes are sheared by {degrees:.1}° (gantry tilt?): they are kept exactly"));
    }
    if spacing.min_element() < 1e-3 || spacing.max_element() > 1e3 {
        let [x, y, z] = spacing.to_array();
        let axes = axis_codes_of(affine);
        notes.push(format!("voxels of {x:e} × {y:e} × {z:e} mm ({axes}): is the unit right?"));
    }
    Ok(notes)
}
