//! Common parts of NRRD and MetaImage: a header of lines, a file of voxels beside it, and a grid whose
//! directions may be anything.

use std::io::Read;
use std::path::{Path, PathBuf};

use glam::DAffine3;

use super::affine::{SHEARED, axis_codes_of, shear_of, spacing_of};
use super::source::Source;
use base::input::Input;
use base::{Error, Kind, Result};

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

/// Returns true if the name of a file of voxels stands for several files: `LIST`, perhaps with a number, or a pattern of
/// printf with its first number, its last one and the step, and perhaps one more. Any other name is that of one file, also
/// with a % in it.
pub(super) fn names_several(name: &str) -> bool {
    let words: Vec<&str> = name.split_whitespace().collect();
    let numbers = words.iter().rev().take_while(|word| word.parse::<i64>().is_ok()).count();
    match words.as_slice() {
        ["LIST"] => true,
        ["LIST", _] => numbers == 1,
        words => (3..=4).contains(&numbers) && has_conversion(&words[..words.len() - numbers].join(" ")),
    }
}

/// Returns true if a text has a conversion of printf for whole numbers, such as %d or %03i.
fn has_conversion(text: &str) -> bool {
    text.split('%').skip(1).any(|after| {
        after
            .trim_start_matches(|c: char| c.is_ascii_digit() || "-+ #.".contains(c))
            .starts_with(['d', 'i', 'u'])
    })
}

/// Opens the file of voxels that a header names. It must be in the folder of the header or below it: a header
/// from elsewhere must not lead to other files of this machine.
pub(super) fn open_beside(header: &Input, name: &str, lenient: bool) -> Result<Source> {
    let header = header.needed_path("a header whose voxels are in another file")?;
    Source::open(&path_beside(header, name)?.into(), lenient).map_err(|e| match e.kind {
        Kind::Missing => {
            e.help(format!("{} says that its voxels are there: put both files together", header.display()))
        }
        _ => e,
    })
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

/// Refuses an affine that is not a grid; returns notes on its oddities, as sentences. `directions` and `origin` are the
/// fields that it comes from.
pub(super) fn check_grid(affine: &DAffine3, directions: &str, origin: &str) -> Result<Vec<String>> {
    let bad = |message: String| {
        Error::new(Kind::BadData, "VGS-VOL-025", message)
            .help("the header is damaged: export the volume again")
    };
    if !affine.is_finite() {
        let field = if affine.matrix3.is_finite() { origin } else { directions };
        return Err(bad(format!("{field} holds NaN or infinity; finite numbers are needed")));
    }
    let mut notes = Vec::new();
    let spacing = spacing_of(affine);
    let det = affine.matrix3.determinant();
    // Compared with a box of the same voxel size, so that small voxels are not refused.
    if !det.is_normal() || det.abs() <= 1e-6 * spacing.element_product() {
        return Err(bad(format!("the vectors of {directions} lie in a plane: voxels have no volume")));
    }
    let most = shear_of(affine);
    if most > SHEARED {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_and_lists_stand_for_several_files() {
        for name in [
            "LIST",
            "LIST 2",
            "%03d.raw 1 10 1",
            "slice %d of a.raw 1 10 1",
            "a%5i 0 -3 -1 2",
            "100%%_%u 1 2 1",
        ] {
            assert!(names_several(name), "{name}");
        }
        for name in [
            "a.raw",
            "100%.raw",
            "100 %.raw",
            "50% of 3.raw",
            "% 1 2 3",
            "50% 1 2 3",
            "LIST of a.raw",
            "list",
            "%d.raw",
            "%d 1 2",
        ] {
            assert!(!names_several(name), "{name}");
        }
    }
}
