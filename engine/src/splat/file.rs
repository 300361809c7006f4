//! Files of splat sets, whatever their format: [`FORMATS`] lists them.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use serde::Serialize;

use super::labels::LabelCount;
use super::ply::{self, PLY_LAYOUTS, PlyLayout};
use super::{Place, SplatSet, Unplaced, join};
use crate::error::{Error, Kind, Result};

/// How forgiving a reader is.
#[derive(Clone, Copy, Debug)]
pub struct ReadOptions {
    /// Whether an unusable splat (a value that is not finite, a zero quaternion, an absurd scale) is an error; by
    /// default it is dropped, counted and logged.
    pub strict: bool,
    /// Files that declare more splats than this are refused before anything is allocated.
    pub max_splats: u64,
}

impl Default for ReadOptions {
    fn default() -> Self {
        ReadOptions { strict: false, max_splats: 200_000_000 }
    }
}

/// How a set is written.
#[derive(Clone, Copy, Debug)]
pub struct WriteOptions {
    /// What the numbers of a PLY stand for, a row of [`PLY_LAYOUTS`]; the first by default.
    pub layout: &'static PlyLayout,
    /// The volume that the set was fitted to, for layouts that count in its voxels.
    pub place: Option<Place>,
    /// Whether an existing file is replaced.
    pub force: bool,
}

impl Default for WriteOptions {
    fn default() -> Self {
        WriteOptions { layout: &PLY_LAYOUTS[0], place: None, force: false }
    }
}

/// What a splat file holds, for people and for scripts.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the format, a row of [`FORMATS`].
    pub format: &'static str,
    /// How the numbers are stored, in the format's own words.
    pub encoding: String,
    /// What they stand for: a row of [`PLY_LAYOUTS`], or "3dgs" where it is that of ordinary 3D Gaussian splatting.
    pub layout: &'static str,
    /// Size of the file in bytes.
    pub file_bytes: u64,
    /// Usable splats.
    pub splats: usize,
    /// Splats that were dropped because a value is unusable.
    pub dropped: usize,
    /// Splats whose thin axes were widened, because they were longer than
    /// [`ANISOTROPY_LIMIT`](activation::ANISOTROPY_LIMIT) times their width.
    pub widened: usize,
    /// Elements of the file with their counts, in file order.
    pub elements: Vec<(String, u64)>,
    /// Properties of a splat, in file order.
    pub properties: Vec<String>,
    /// Name of the kernel; the Gaussian where the file says nothing.
    pub kernel: &'static str,
    /// Whether intensities are physical (HU) rather than the luminance of a colour.
    pub has_intensity: bool,
    /// Degree of the spherical harmonics of the colours; absent where the splats have an intensity.
    pub harmonics_degree: Option<u8>,
    /// The labels that splats have, ascending; empty where the file gives none.
    pub labels: Vec<LabelCount>,
    /// Least and greatest intensity, absent without splats.
    pub intensity_range: Option<[f32; 2]>,
    /// The intensities that 0 and 1 of `intensity_01` stand for, where the file says so.
    pub intensity_01_range: Option<[f32; 2]>,
    /// Least and greatest mean along each axis, mm RAS with the origin added; absent without splats, and where only a
    /// volume can place them.
    pub bounding_box_mm: Option<[[f64; 3]; 2]>,
    /// The same as voxel index times spacing, mm, of a file whose splats only a volume can place.
    pub index_box_mm: Option<[[f64; 3]; 2]>,
    /// Origin of the means, mm RAS.
    pub origin_mm: [f64; 3],
    /// V̂ where no splat reaches.
    pub background: f32,
    /// ε of eq. (2).
    pub epsilon: f32,
    /// w₀ of the occupancy.
    pub occupancy_w0: f32,
    /// Iterations of the fit, where the file says so.
    pub iterations: Option<u32>,
    /// Voxels along x, y, z of the grid that the set was fitted on, where the file says so.
    pub grid_size: Option<[u32; 3]>,
    /// What it was fitted for: the name of a [`Form`].
    pub form: &'static str,
}

/// One file format of splat sets.
pub struct Format {
    /// Short name, also the usual extension.
    pub name: &'static str,
    /// Whether the first bytes of a file (up to [`SNIFF_BYTES`]) are of this format.
    pub sniff: fn(&[u8]) -> bool,
    /// Reads a file.
    pub read: fn(&Path, &ReadOptions) -> Result<Unplaced>,
    /// Writes a file whole or not at all; an existing one is replaced only if the options say so.
    pub write: fn(&Path, &SplatSet, &WriteOptions) -> Result<()>,
    /// Bytes of the file that it writes.
    pub bytes: fn(&SplatSet, &WriteOptions) -> Result<u64>,
    /// Reads a file and tells what it holds.
    pub describe: fn(&Path, &ReadOptions) -> Result<Summary>,
}

/// Every format of splat sets.
pub const FORMATS: &[Format] = &[ply::FORMAT];

/// How many leading bytes a [`Format::sniff`] gets to see.
pub const SNIFF_BYTES: u64 = 16;

/// Reads a splat set; the content of the file decides on the format, not its name. A file whose splats only a volume can
/// place is refused: [`read_unplaced`] takes it.
pub fn read(path: &Path, options: &ReadOptions) -> Result<SplatSet> {
    read_unplaced(path, options)?.placed(None)
}

/// Reads a splat set that a volume may have to place yet.
pub fn read_unplaced(path: &Path, options: &ReadOptions) -> Result<Unplaced> {
    (sniffed(path)?.read)(path, options)
}

/// Reads the splats of a file as [`read_unplaced`] does and refuses a file without any that can be used.
pub fn read_some(path: &Path) -> Result<Unplaced> {
    let splats = read_unplaced(path, &ReadOptions::default())?;
    if splats.is_empty() {
        return Err(Error::new(Kind::BadData, "VGS-SPLAT-005", "the file holds no usable splat").file(path));
    }
    Ok(splats)
}

/// Reads one or many files as one set, whose objects are called after the files. `place` is asked, once, for the volume of
/// splats that only a volume can place.
pub fn read_all(
    paths: &[impl AsRef<Path>],
    place: impl FnOnce() -> Result<Option<Place>>,
) -> Result<SplatSet> {
    let mut place = Some(place);
    let mut found = None;
    let mut sets = Vec::new();
    for path in paths.iter().map(AsRef::as_ref) {
        let splats = read_some(path)?;
        if splats.needs_volume()
            && let Some(place) = place.take()
        {
            found = place()?;
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        sets.push((name, splats.placed(found.as_ref())?));
    }
    join(sets)
}

/// Tells what a splat file holds; the content of the file decides on the format, not its name.
pub fn describe(path: &Path, options: &ReadOptions) -> Result<Summary> {
    (sniffed(path)?.describe)(path, options)
}

/// Writes `set` in the format that the extension of `path` names; replaces an existing file only with `force`.
pub fn write(path: &Path, set: &SplatSet, force: bool) -> Result<()> {
    write_as(path, set, &WriteOptions { force, ..WriteOptions::default() })
}

/// Writes `set` in the format that the extension of `path` names, as the options say.
pub fn write_as(path: &Path, set: &SplatSet, options: &WriteOptions) -> Result<()> {
    (named(path)?.write)(path, set, options)
}

/// Bytes of the file that [`write_as()`] makes of `set`.
pub fn file_bytes(path: &Path, set: &SplatSet, options: &WriteOptions) -> Result<u64> {
    (named(path)?.bytes)(set, options)
}

/// The format that the extension of `path` names.
fn named(path: &Path) -> Result<&'static Format> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default();
    FORMATS.iter().find(|format| format.name.eq_ignore_ascii_case(extension)).ok_or_else(|| {
        Error::new(Kind::Usage, "VGS-SPLAT-002", format!("no splat format is called {extension:?}"))
            .file(path)
            .help(format!("use one of these extensions: {}", format_names()))
    })
}

fn sniffed(path: &Path) -> Result<&'static Format> {
    let mut start = Vec::new();
    File::open(path)
        .and_then(|file| file.take(SNIFF_BYTES).read_to_end(&mut start))
        .map_err(|error| Error::io(path, "reading a splat file", &error))?;
    FORMATS.iter().find(|format| (format.sniff)(&start)).ok_or_else(|| {
        let found = if start.is_empty() { "the file is empty" } else { "not a splat file" };
        Error::new(Kind::BadData, "VGS-SPLAT-001", found)
            .file(path)
            .help(format!("known splat formats: {}", format_names()))
    })
}

fn format_names() -> String {
    FORMATS.iter().map(|format| format.name).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::splat::Splat;

    #[test]
    fn a_file_is_known_by_its_content_and_written_by_its_extension() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let at = |name: &str| folder.path().join(name);
        let set = SplatSet {
            splats: vec![Splat { rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() }],
            ..SplatSet::default()
        };
        write(&at("a.PLY"), &set, false).expect("the extension in capitals is the same format");
        let length = std::fs::metadata(at("a.PLY")).expect("a file").len();
        assert_eq!(
            file_bytes(&at("b.ply"), &set, &WriteOptions::default()).expect("a format"),
            length,
            "known before it is written"
        );
        std::fs::rename(at("a.PLY"), at("a.dat")).expect("renaming");
        assert_eq!(read(&at("a.dat"), &ReadOptions::default()).expect("a PLY by content"), set);
        assert_eq!(write(&at("a.splat"), &set, false).expect_err("no such format").code, "VGS-SPLAT-002");

        for (name, content) in [("empty", ""), ("text", "hello")] {
            std::fs::write(at(name), content).expect("writing");
            let error = describe(&at(name), &ReadOptions::default()).expect_err(name);
            assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-SPLAT-001"), "{name}");
        }
        let none = "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
        std::fs::write(at("none.ply"), none).expect("writing");
        let error = read_all(&[at("a.dat"), at("none.ply")], || Ok(None)).expect_err("nothing to see");
        assert_eq!((error.kind, error.code), (Kind::BadData, "VGS-SPLAT-005"));
        let both =
            read_all(&[at("a.dat"), at("a.dat")], || panic!("nothing needs a volume")).expect("two files");
        let names: Vec<_> = both.objects().into_iter().map(|object| object.name).collect();
        assert_eq!((both.splats.len(), names), (2, vec!["a".to_owned(), "a".to_owned()]));
        let missing = read(&at("missing"), &ReadOptions::default()).expect_err("no such file");
        assert_eq!(missing.kind, Kind::Missing);
    }
}
