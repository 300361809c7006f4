//! Splat sets: parameters, activations, spaces and files.
//!
//! A [`Splat`] holds raw parameters (logit, ln σ, quaternion); [`activation`] says what they stand for and [`kernel`]
//! how a splat fades with distance. A fit works in voxel space, a [`SplatSet`] lives in the world; [`space`] leads
//! from one to the other. [`harmonics`] are the colours of splats that have no intensity, [`packed`] is a set in 16 bytes
//! a splat. [`join`] makes one set of several, whose labels are the objects of a scene. [`FORMATS`] lists the files: a new format is one module with `sniff`, `read`, `write` and
//! `describe`, and one row. A file may leave open where its splats lie: it is read as [`Unplaced`], and the [`Place`] of a
//! volume makes it a set.

pub mod activation;
mod grid;
pub mod harmonics;
mod importance;
pub mod kernel;
mod labels;
mod objects;
pub mod packed;
mod place;
pub mod ply;
pub mod space;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use glam::DVec3;
use serde::Serialize;

pub use activation::Activations;
pub use grid::{Form, Grid};
pub use harmonics::Harmonics;
pub use importance::by_importance;
pub use kernel::Kernel;
pub use labels::{LabelCount, label_name};
pub use objects::{MOST_OBJECTS, Object, join};
pub use packed::Packed;
pub use place::{Place, Unplaced};
pub use ply::{PLY_LAYOUTS, PlyLayout};
pub use shaders_glsl::types::Splat;

use crate::error::{Error, Kind, Result};

/// A fitted set of splats in world space, with all that is needed to evaluate the field it stands for.
#[derive(Clone, Debug, PartialEq)]
pub struct SplatSet {
    /// Means in mm, RAS, relative to `origin_mm`; ln σ in ln mm; intensity as `has_intensity` says.
    pub splats: Vec<Splat>,
    /// World position of the splats' zero, mm RAS.
    pub origin_mm: DVec3,
    /// How the splats add up to a field.
    pub field: Field,
    /// Whether intensities are physical (HU for CT). Otherwise they are the luminance of a colour, about 0 to 1, and
    /// a transfer function over HU means nothing for them.
    pub has_intensity: bool,
    /// The colours of a set of ordinary 3D Gaussian splatting; nothing where the splats have an intensity, which a
    /// transfer function colours.
    pub colours: Option<Harmonics>,
    /// Which structure each splat belongs to, by the labels of the label map it was fitted to; 0 is none of them.
    pub labels: Option<Vec<u8>>,
    /// Names of labels, at most one for each, in ascending order; see [`label_name`].
    pub label_names: Vec<(u8, String)>,
    /// Iterations of the fit that made the set; nothing where the file does not say.
    pub iterations: Option<u32>,
    /// The grid of the volume that it was fitted to; nothing where the file does not say.
    pub grid: Option<Grid>,
    /// What it was fitted for.
    pub form: Form,
}

impl Default for SplatSet {
    /// No splats, whose intensities would be physical.
    fn default() -> Self {
        SplatSet {
            splats: Vec::new(),
            origin_mm: DVec3::ZERO,
            field: Field::default(),
            has_intensity: true,
            colours: None,
            labels: None,
            label_names: Vec::new(),
            iterations: None,
            grid: None,
            form: Form::default(),
        }
    }
}

impl SplatSet {
    /// Sorts the splats by importance, the most important first: any number of the first splats then stands for the whole
    /// as well as so many can. The field stays what it is.
    pub fn order_by_importance(&mut self) {
        let order = by_importance(&self.splats, &self.field);
        self.take(&order.iter().map(|&i| i as usize).collect::<Vec<_>>());
    }

    /// Keeps the first splats.
    pub fn truncate(&mut self, count: usize) {
        self.take(&(0..count.min(self.splats.len())).collect::<Vec<_>>());
    }

    /// Keeps the splats of these rows, in this order.
    fn take(&mut self, rows: &[usize]) {
        self.splats = rows.iter().map(|&i| self.splats[i]).collect();
        if let Some(labels) = &mut self.labels {
            *labels = rows.iter().map(|&i| labels[i]).collect();
        }
        if let Some(colours) = &mut self.colours {
            let stride = colours.stride();
            let of = |&i: &usize| colours.coefficients[i * stride..][..stride].iter().copied();
            colours.coefficients = rows.iter().flat_map(of).collect();
        }
    }
}

/// How splats add up to V̂(x) = b + Σ w (c − b) / (Σ w + ε), with w = α κ(q), and to the occupancy
/// O(x) = Σ w / (Σ w + w₀).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// The profile κ.
    pub kernel: Kernel,
    /// b, in the unit of the intensities (HU): V̂ where no splat reaches.
    pub background: f32,
    /// ε of eq. (2), in units of w.
    pub epsilon: f32,
    /// w₀ of the occupancy, in units of w.
    pub occupancy_w0: f32,
}

impl Default for Field {
    fn default() -> Self {
        Field { kernel: Kernel::Compact, background: 0.0, epsilon: 1e-3, occupancy_w0: 0.05 }
    }
}

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

/// Why a file must not hold this splat, or nothing if it may.
pub fn defect(splat: &Splat) -> Option<&'static str> {
    let values: &[f32; 12] = bytemuck::cast_ref(splat);
    if !values.iter().all(|v| v.is_finite()) {
        Some("a value is not finite")
    } else if splat.rotation == [0.0; 4] {
        Some("its quaternion is zero")
    } else if splat.log_scale.iter().any(|log| log.abs() > activation::LOG_SCALE_LIMIT) {
        Some("its scale is out of range")
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
        let missing = read(&at("missing"), &ReadOptions::default()).expect_err("no such file");
        assert_eq!(missing.kind, Kind::Missing);
    }

    #[test]
    fn the_most_important_splats_come_first_with_what_belongs_to_them() {
        let weighing = |opacity_logit, size: f32| Splat {
            opacity_logit,
            log_scale: [size, 0.0, -1.0],
            rotation: [1.0, 0.0, 0.0, 0.0],
            ..Splat::default()
        };
        let splats = vec![weighing(0.0, 0.0), weighing(0.0, 2.0), weighing(-9.0, 2.0), weighing(5.0, 2.0)];
        let coefficients = (0..12).map(|i| i as f32).collect();
        let mut set = SplatSet {
            splats: splats.clone(),
            labels: Some(vec![0, 1, 2, 3]),
            colours: Some(Harmonics { degree: 0, coefficients }),
            ..SplatSet::default()
        };
        set.order_by_importance();
        assert_eq!(set.labels.as_deref(), Some(&[3, 1, 0, 2][..]));
        assert_eq!(set.splats, [3, 1, 0, 2].map(|i| splats[i]));
        set.truncate(2);
        assert_eq!(set.labels.as_deref(), Some(&[3, 1][..]));
        assert_eq!(set.colours.expect("colours").coefficients, [9.0, 10.0, 11.0, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn defects_are_found() {
        let good = Splat { rotation: [1.0, 0.0, 0.0, 0.0], ..Splat::default() };
        let rows = [
            (good, true),
            (Splat { rotation: [0.0, 0.0, -0.0, 0.0], ..good }, false),
            (Splat { rotation: [0.0, 0.0, 1e-30, 0.0], ..good }, true),
            (Splat { mean: [0.0, f32::NAN, 0.0], ..good }, false),
            (Splat { opacity_logit: f32::NEG_INFINITY, ..good }, false),
            (Splat { log_scale: [0.0, -1e3, 0.0], ..good }, false),
            (Splat { log_scale: [0.0, 0.0, 1e3], ..good }, false),
            (Splat { intensity: f32::INFINITY, ..good }, false),
            (Splat { intensity: f32::MIN, ..good }, true),
        ];
        for (splat, usable) in rows {
            assert_eq!(defect(&splat).is_none(), usable, "{splat:?}");
        }
    }
}
