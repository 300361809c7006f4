//! The file formats of volumes.

use std::path::{Path, PathBuf};

use super::fields::FieldRow;
use super::read_options::ReadOptions;
use super::source::{SNIFF_BYTES, Source};
use super::volume::Volume;
use super::voxel_source::VoxelSource;
#[cfg(feature = "zarr")]
use super::zarr;
use super::{Grid, LabelChoice, Level, PartOf, dicom, inv3, metaimage, nifti, npy, nrrd};
use base::input::Input;
use base::{Error, Kind, Result};

/// A file format that [`Volume::read`] knows.
pub struct Format {
    /// Name for messages.
    pub name: &'static str,
    /// Lower-case extensions, with the dot.
    pub extensions: &'static [&'static str],
    /// Returns true if the first [`SNIFF_BYTES`] decoded bytes (fewer in a shorter file) are of this format.
    sniff: fn(&[u8]) -> bool,
    open: fn(&Input, &ReadOptions) -> Result<Box<dyn VoxelSource>>,
    /// What is done with the fields of the header.
    pub fields: &'static [FieldRow],
    /// Returns true if a folder is of this format.
    is_folder: fn(&Path) -> bool,
    /// Returns the file beside a header that holds its voxels, if there is one.
    beside: fn(&Path) -> Option<PathBuf>,
}

const DICOM: Format = Format {
    name: dicom::NAME,
    extensions: &[".dcm", ".ima"],
    sniff: dicom::sniff,
    open: |input, options| in_memory(dicom::read(input, options)),
    fields: &[],
    is_folder: Path::is_dir,
    beside: nothing_beside,
};

fn in_memory(volume: Result<Volume>) -> Result<Box<dyn VoxelSource>> {
    Ok(Box::new(volume?))
}

fn nothing_beside(_: &Path) -> Option<PathBuf> {
    None
}

/// All formats; a format is chosen by the content, and by the name only if the content is not recognised.
pub const FORMATS: &[Format] = &[
    // First, because the bytes before its magic may be anything, also the beginning of another format.
    DICOM,
    Format {
        name: "NIfTI",
        extensions: &[".nii", ".nii.gz", ".hdr", ".hdr.gz", ".img", ".img.gz"],
        sniff: nifti::sniff,
        open: nifti::open,
        fields: nifti::FIELDS,
        is_folder: |_| false,
        beside: nifti::beside,
    },
    Format {
        name: inv3::NAME,
        extensions: &[".inv3"],
        sniff: inv3::sniff,
        open: |input, options| in_memory(inv3::read(input, options)),
        fields: inv3::FIELDS,
        is_folder: |_| false,
        beside: nothing_beside,
    },
    Format {
        name: "NRRD",
        extensions: &[".nrrd", ".nhdr"],
        sniff: nrrd::sniff,
        open: nrrd::open,
        fields: nrrd::FIELDS,
        is_folder: |_| false,
        beside: nrrd::beside,
    },
    Format {
        name: "MetaImage",
        extensions: &[".mha", ".mhd"],
        sniff: metaimage::sniff,
        open: metaimage::open,
        fields: metaimage::FIELDS,
        is_folder: |_| false,
        beside: metaimage::beside,
    },
    Format {
        name: npy::NAME,
        extensions: &[".npy"],
        sniff: npy::sniff,
        open: npy::open,
        fields: npy::FIELDS,
        is_folder: |_| false,
        beside: nothing_beside,
    },
    #[cfg(feature = "zarr")]
    Format {
        name: zarr::NAME,
        extensions: &[".zarr", ".zarr.zip", ".ozx"],
        sniff: zarr::sniff,
        open: zarr::open,
        fields: zarr::FIELDS,
        is_folder: zarr::is_store,
        beside: nothing_beside,
    },
    Format {
        name: dicom::ZIP_NAME,
        extensions: &[".zip"],
        sniff: dicom::is_zip,
        open: |input, options| in_memory(dicom::read(input, options)),
        fields: &[],
        is_folder: |_| false,
        beside: nothing_beside,
    },
];

impl Format {
    /// Returns the format of a file, be it a path or an [`Input`], by its content, or by its name if the content is
    /// not recognised. A folder is of DICOM unless it is a store of Zarr.
    ///
    /// # Errors
    /// [`Kind::Missing`], [`Kind::BadData`] or [`Kind::Io`].
    pub fn of(input: impl Into<Input>, options: &ReadOptions) -> Result<&'static Format> {
        let input = input.into();
        if let Some(folder) = input.path().filter(|path| path.is_dir()) {
            // Any folder may be one of DICOM, the first row.
            return Ok(FORMATS.iter().rev().find(|f| (f.is_folder)(folder)).unwrap_or(&DICOM));
        }
        let mut head = vec![0; SNIFF_BYTES];
        let n = Source::open(&input, options.lenient)?.read_some(&mut head)?;
        let name = input.name().file_name().unwrap_or_default().to_string_lossy().to_lowercase();
        FORMATS
            .iter()
            .find(|f| (f.sniff)(&head[..n]))
            .or_else(|| FORMATS.iter().find(|f| f.extensions.iter().any(|e| name.ends_with(e))))
            .ok_or_else(|| {
                let known: Vec<_> =
                    FORMATS.iter().map(|f| format!("{} ({})", f.name, f.extensions.join(" "))).collect();
                Error::new(Kind::BadData, "VGS-VOL-009", "not a volume in a known format")
                    .file(input.name())
                    .help(format!("known formats: {}", known.join(", ")))
            })
    }
}

/// Returns the files that make up a volume file: the file itself, and the one with its voxels where a header
/// names it (`.nhdr`, `.mhd`, `.hdr`, `.img`). A file that cannot be read is returned alone.
pub fn files_of(path: &Path) -> Vec<PathBuf> {
    let beside = Format::of(path, &ReadOptions::default()).ok().and_then(|format| (format.beside)(path));
    std::iter::once(path.to_owned()).chain(beside).collect()
}

/// Returns the resolutions of a file that has several (OME-Zarr), finest first; none of any other file.
///
/// # Errors
/// [`Kind::BadData`] or [`Kind::Io`].
pub fn levels(path: &Path) -> Result<Vec<Level>> {
    #[cfg(feature = "zarr")]
    if Format::of(path, &ReadOptions::default()).is_ok_and(|format| format.name == zarr::NAME) {
        return zarr::levels(path).map_err(|e| e.or_file(path));
    }
    let _ = path;
    Ok(Vec::new())
}

/// Writes `volume` as float32, by the ending of the name: NIfTI (`.nii`, `.nii.gz`) or OME-Zarr (`.zarr`, a folder), either
/// whole or not at all.
///
/// # Errors
/// [`Kind::Usage`] for another ending, and those of the writers.
pub fn write(path: &Path, volume: &Volume, force: bool) -> Result<()> {
    #[cfg(feature = "zarr")]
    if is_zarr(path) {
        return zarr::write(path, volume, force);
    }
    nifti::write(path, volume, force)
}

/// Writes a volume as [`write()`] does, to OME-Zarr by boxes: memory need not hold it.
///
/// # Errors
/// Those of [`write()`] and of the source.
pub fn write_by_boxes(path: &Path, volume: &dyn VoxelSource, force: bool) -> Result<()> {
    #[cfg(feature = "zarr")]
    if is_zarr(path) {
        return zarr::write(path, volume, force);
    }
    nifti::write(path, &volume.read_box([0; 3], volume.grid().size)?, force)
}

/// Checks that [`write()`] could write a file of this name, before anything is computed for it.
///
/// # Errors
/// As [`write()`].
pub fn check_output(path: &Path, force: bool) -> Result<()> {
    #[cfg(feature = "zarr")]
    if is_zarr(path) {
        return base::output::check_folder(path, force, zarr::is_store);
    }
    let ending = |e: Error| e.help("endings are .nii, .nii.gz and .zarr");
    nifti::check_name(path).map_err(ending).and_then(|_| base::output::check_writable(path, force))
}

/// Returns true if a file of this name is written as OME-Zarr.
pub fn is_zarr(path: &Path) -> bool {
    cfg!(feature = "zarr") && path.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("zarr"))
}

impl Volume {
    /// Opens a volume in any of the [`FORMATS`], also the DICOM series or the store of Zarr in a folder: from a path, or from an
    /// [`Input::of`] a reader if the volume is one file, or a zip. Voxels that are not compressed as a whole stay where
    /// they are until they are asked for; other files are read. Oddities that do not prevent reading are logged as
    /// warnings. The options' box and unit are those of [`Volume::read`].
    ///
    /// # Errors
    /// Those of [`Volume::read`].
    pub fn open(input: impl Into<Input>, options: &ReadOptions) -> Result<Box<dyn VoxelSource>> {
        let input = input.into();
        let format = Format::of(&input, options)?;
        (format.open)(&input, options).map_err(|e| e.or_file(input.name()))
    }

    /// Reads the volume that [`Volume::open`] opens, or its box [`ReadOptions::voxels`].
    ///
    /// # Errors
    /// [`Kind::Missing`], [`Kind::BadData`], [`Kind::Usage`] (a volume or a series must be chosen, a box is not within
    /// the volume, or there must be a path, beside which other files lie), [`Kind::HostMemory`] or [`Kind::Io`].
    pub fn read(input: impl Into<Input>, options: &ReadOptions) -> Result<Volume> {
        let input = input.into();
        let source = Volume::open(&input, options)?;
        read_of(source, &input, options)
    }

    /// Reads a mask of `volume`: any volume, and the structures of DICOM segmentations and structure sets. Of
    /// structures that overlap only those of `labels` are read; contours become voxels of the volume's grid.
    /// Index and series of the options choose the volume; a mask is a single one. A mask of more than the box of
    /// the volume is read in that box.
    ///
    /// # Errors
    /// As [`Volume::read`].
    pub fn read_mask(
        input: impl Into<Input>,
        options: &ReadOptions,
        labels: &LabelChoice,
        volume: &Volume,
    ) -> Result<Volume> {
        let input = input.into();
        let own = Grid { size: volume.size, world_from_voxel: volume.world_from_voxel };
        let options = ReadOptions {
            volume_index: None,
            series: None,
            labels: labels.clone(),
            grid: Some(own),
            frame_of_reference: volume.frame_of_reference.clone(),
            ..options.clone()
        };
        let source = Volume::open(&input, &options)?;
        let boxed = options.voxels.filter(|&voxels| source.grid().has_box(voxels, &own));
        read_of(source, &input, &ReadOptions { voxels: boxed, ..options })
    }
}

/// Reads what the options choose of an open volume.
fn read_of(source: Box<dyn VoxelSource>, input: &Input, options: &ReadOptions) -> Result<Volume> {
    let part_of =
        options.voxels.map(|ends| PartOf { grid: source.grid(), first: ends.map(|[first, _]| first) });
    let volume = match options.voxels {
        Some(ends) => {
            let first = ends.map(|[first, _]| first);
            source.read_box(first, ends.map(|[first, end]| end.saturating_sub(first)))
        }
        None => source.whole(),
    };
    let mut volume = volume.map_err(|e| e.or_file(input.name()))?;
    volume.part_of = part_of;
    volume.stated_unit = options.unit.or(volume.stated_unit);
    volume.learn_unit_from(input.name());
    Ok(volume)
}
