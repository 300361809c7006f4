//! The file formats of volumes.

use std::path::{Path, PathBuf};

use super::fields::FieldRow;
use super::read_options::ReadOptions;
use super::source::{SNIFF_BYTES, Source};
use super::volume::Volume;
use super::{Grid, LabelChoice, dicom, inv3, metaimage, nifti, npy, nrrd};
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
    read: fn(&Input, &ReadOptions) -> Result<Volume>,
    /// What is done with the fields of the header.
    pub fields: &'static [FieldRow],
    /// Returns the file beside a header that holds its voxels, if there is one.
    beside: fn(&Path) -> Option<PathBuf>,
}

const DICOM: Format = Format {
    name: dicom::NAME,
    extensions: &[".dcm", ".ima"],
    sniff: dicom::sniff,
    read: dicom::read,
    fields: &[],
    beside: nothing_beside,
};

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
        read: nifti::read,
        fields: nifti::FIELDS,
        beside: nifti::beside,
    },
    Format {
        name: inv3::NAME,
        extensions: &[".inv3"],
        sniff: inv3::sniff,
        read: inv3::read,
        fields: inv3::FIELDS,
        beside: nothing_beside,
    },
    Format {
        name: "NRRD",
        extensions: &[".nrrd", ".nhdr"],
        sniff: nrrd::sniff,
        read: nrrd::read,
        fields: nrrd::FIELDS,
        beside: nrrd::beside,
    },
    Format {
        name: "MetaImage",
        extensions: &[".mha", ".mhd"],
        sniff: metaimage::sniff,
        read: metaimage::read,
        fields: metaimage::FIELDS,
        beside: metaimage::beside,
    },
    Format {
        name: npy::NAME,
        extensions: &[".npy"],
        sniff: npy::sniff,
        read: npy::read,
        fields: npy::FIELDS,
        beside: nothing_beside,
    },
    Format {
        name: dicom::ZIP_NAME,
        extensions: &[".zip"],
        sniff: dicom::is_zip,
        read: dicom::read,
        fields: &[],
        beside: nothing_beside,
    },
];

impl Format {
    /// Returns the format of a file, be it a path or an [`Input`], by its content, or by its name if the content is
    /// not recognised. The format of a folder is DICOM.
    ///
    /// # Errors
    /// [`Kind::Missing`], [`Kind::BadData`] or [`Kind::Io`].
    pub fn of(input: impl Into<Input>, options: &ReadOptions) -> Result<&'static Format> {
        let input = input.into();
        if input.path().is_some_and(Path::is_dir) {
            return Ok(&DICOM);
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

impl Volume {
    /// Reads a volume in any of the [`FORMATS`], or the DICOM series in a folder: from a path, or from an
    /// [`Input::of`] a reader if the volume is one file, or a zip. Oddities that do not prevent reading are logged
    /// as warnings.
    ///
    /// # Errors
    /// [`Kind::Missing`], [`Kind::BadData`], [`Kind::Usage`] (a volume or a series must be chosen, or there must be a
    /// path, beside which other files lie), [`Kind::HostMemory`] or [`Kind::Io`].
    pub fn read(input: impl Into<Input>, options: &ReadOptions) -> Result<Volume> {
        let input = input.into();
        let format = Format::of(&input, options)?;
        let mut volume = (format.read)(&input, options).map_err(|e| e.or_file(input.name()))?;
        volume.stated_unit = options.unit.or(volume.stated_unit);
        volume.learn_unit_from(input.name());
        Ok(volume)
    }

    /// Reads a mask of `volume`: any volume, and the structures of DICOM segmentations and structure sets. Of
    /// structures that overlap only those of `labels` are read; contours become voxels of the volume's grid.
    /// Index and series of the options choose the volume; a mask is a single one.
    ///
    /// # Errors
    /// As [`Volume::read`].
    pub fn read_mask(
        input: impl Into<Input>,
        options: &ReadOptions,
        labels: &LabelChoice,
        volume: &Volume,
    ) -> Result<Volume> {
        let options = ReadOptions {
            volume_index: None,
            series: None,
            labels: labels.clone(),
            grid: Some(Grid { size: volume.size, world_from_voxel: volume.world_from_voxel }),
            frame_of_reference: volume.frame_of_reference.clone(),
            ..*options
        };
        Volume::read(input, &options)
    }
}
