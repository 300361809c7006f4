//! Description of a NIfTI header, without reading the voxels.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Serialize;

use super::open::open;
use crate::ReadOptions;
#[cfg(doc)]
use crate::Volume;
use crate::affine::{axis_codes_of, spacing_of};
#[cfg(doc)]
use base::Kind;
use base::Result;
use base::input::Input;

/// The content of a NIfTI header, for people and for scripts.
#[derive(Clone, Debug, Serialize)]
pub struct Header {
    /// "NIfTI-1" or "NIfTI-2".
    pub format: &'static str,
    /// True if numbers are stored with the most significant byte first.
    pub big_endian: bool,
    /// True if the file with the header is gzip.
    pub gzip: bool,
    /// The file that holds the voxels, if it is not the same.
    pub voxel_file: Option<PathBuf>,
    /// Dimensions, x first; at least three.
    pub dims: Vec<usize>,
    /// Name of the datatype, such as "int16" or "RGB".
    pub datatype: &'static str,
    /// The standard's code of the datatype.
    pub datatype_code: i16,
    /// True if the voxels are single real numbers, that is, readable as a [`Volume`].
    pub scalar: bool,
    /// Byte at which the voxels begin in their file.
    pub vox_offset: u64,
    /// Distance between voxel centres along x, y, z, mm.
    pub spacing_mm: [f64; 3],
    /// Rows of the voxel-to-world matrix, mm RAS.
    pub affine: [[f64; 4]; 3],
    /// Source of the affine: "sform", "qform" or "pixdim".
    pub affine_source: &'static str,
    /// Direction in which each index grows, as "LAS"; "???" if the orientation is unknown.
    pub axes: String,
    /// True if the file says how the patient lies.
    pub oriented: bool,
    /// The length unit of the file.
    pub units: &'static str,
    /// Factor from stored to real values; absent if there is no scaling.
    pub slope: Option<f64>,
    /// Number that is added after the factor; absent if there is no scaling.
    pub inter: Option<f64>,
    /// The qform code as stored.
    pub qform_code: i32,
    /// The sform code as stored.
    pub sform_code: i32,
    /// Free text of the header.
    pub description: String,
    /// Names of label values.
    pub labels: BTreeMap<i32, String>,
    /// Oddities that do not prevent reading, as sentences.
    pub notes: Vec<String>,
}

/// Reads and checks the header and the label names, whatever the voxels are: RGB and complex files too.
///
/// # Errors
/// [`Kind::Missing`], [`Kind::BadData`] or [`Kind::Io`]; [`Kind::Usage`] for half of a pair without a path.
pub fn describe(input: impl Into<Input>) -> Result<Header> {
    let input = input.into();
    // The voxels are not read, so their amount is no reason to refuse.
    let options = ReadOptions { max_bytes: u64::MAX, lenient: true, ..ReadOptions::default() };
    let opened = open(&input, &options).map_err(|e| e.or_file(input.name()))?;
    let h = opened.header;
    let oriented = h.affine_source != "pixdim";
    let [x, y, z, t] = h.affine.to_cols_array_2d();
    Ok(Header {
        format: if h.version == 1 { "NIfTI-1" } else { "NIfTI-2" },
        big_endian: h.big_endian,
        gzip: opened.gzip,
        voxel_file: (!h.single_file).then_some(opened.voxels.path),
        datatype: h.datatype.name,
        datatype_code: h.datatype.code,
        scalar: h.datatype.element.is_some(),
        vox_offset: h.vox_offset,
        spacing_mm: spacing_of(&h.affine).to_array(),
        affine: std::array::from_fn(|r| [x[r], y[r], z[r], t[r]]),
        affine_source: h.affine_source,
        axes: if oriented { axis_codes_of(&h.affine) } else { "???".into() },
        oriented,
        units: h.units,
        slope: h.scaling.map(|s| s.0),
        inter: h.scaling.map(|s| s.1),
        qform_code: h.qform_code,
        sform_code: h.sform_code,
        description: h.description,
        labels: opened.labels,
        notes: h.notes,
        dims: h.dims,
    })
}
