//! The NIfTI header: parsed, checked field by field, and turned into a grid.
//!
//! NIfTI-1 is parsed by the `nifti` crate once the size, byte order and dimension count are known to be
//! sound; NIfTI-2 here. Everything that decides how many bytes are read, and from where, is checked here.

use glam::{DAffine3, DMat3, DVec3};
use nifti::{Endianness, NiftiHeader};

use super::datatype::{DATATYPES, Datatype};
use crate::affine::{SHEARED, axis_codes_of, shear_of, spacing_of};
use crate::fields::FieldRow;
use base::{Error, Kind, Result};

/// Bytes of a NIfTI-1 header, and of the older ANALYZE 7.5 header.
pub(super) const SIZE_1: usize = 348;
/// Bytes of a NIfTI-2 header.
pub(super) const SIZE_2: usize = 540;
/// Part by which lengths may differ that count as the same.
const SAME_LENGTH: f64 = 0.01;
/// Distance, in voxels, up to which corners by qform and sform count as the same: half a rotation of single precision.
const SAME_PLACE: f64 = 0.5;
/// What to do about a field that cannot be read.
const CORRECT: &str = "correct the header, or export the volume again";
const MAGIC_2_SINGLE: &[u8; 8] = b"n+2\0\r\n\x1a\n";
const MAGIC_2_PAIR: &[u8; 8] = b"ni2\0\r\n\x1a\n";

/// What is done with the fields of the header. It has all of them, so that absent means the value that says so.
pub(crate) const FIELDS: &[FieldRow] = &[
    FieldRow::needed("sizeof_hdr", "348 of NIfTI-1, 540 of NIfTI-2; tells the order of bytes", &["347"]),
    FieldRow::needed("magic", "n+1, ni1 or their counterparts of NIfTI-2; ANALYZE 7.5 has none", &["0"]),
    FieldRow::needed("dim[0]", "number of dimensions, 1 to 7", &["0", "8", "-1"]),
    FieldRow::needed("dim[1]", "size of each axis; from the fourth on 0 counts as 1", &["0", "-3"]),
    FieldRow::needed("datatype", "type of the voxels", &["3", "9999", "0", "128"]),
    FieldRow::unused("bitpix", "not used: the datatype counts, and a note tells where they differ"),
    FieldRow::with_default(
        "pixdim[0]",
        "-1 or 1, the handedness of the qform; another number counts by its sign: a note",
        "0: as 1, a note",
        &["nan", "inf"],
    ),
    FieldRow::needed(
        "pixdim[1]",
        "size of a voxel, unless there is an sform; below 0 its sign is ignored: a note",
        &["0", "nan", "inf"],
    ),
    FieldRow::with_default(
        "vox_offset",
        "byte of the first voxel",
        "0: after the header, a note",
        &["nan", "-1", "7.5", "100", "1e30"],
    ),
    FieldRow::with_default(
        "scl_slope",
        "factor of the stored values",
        "0 or NaN: they are the values; of NaN a note",
        &["inf", "-inf"],
    ),
    FieldRow::needed("scl_inter", "number that is added after the factor", &["nan", "inf"]),
    FieldRow::with_default(
        "xyzt_units",
        "unit of lengths; that of time is not used",
        "0: mm",
        &["4", "5", "7"],
    ),
    FieldRow::with_default(
        "sform_code",
        "more than 0: the sform says where the voxels are, and a note tells where the qform says something else",
        "0: the qform counts",
        &["-1"],
    ),
    FieldRow::with_default(
        "qform_code",
        "more than 0: the qform says it",
        "0: orientation unknown, a note",
        &["-1"],
    ),
    FieldRow::needed("srow_x", "first row of the sform, and so are srow_y and srow_z", &["nan", "inf"]),
    FieldRow::needed("quatern_b", "rotation of the qform, and so are quatern_c and quatern_d", &["nan", "2"]),
    FieldRow::needed(
        "qoffset_x",
        "place of the first voxel by the qform, and so are qoffset_y and qoffset_z",
        &["nan", "inf"],
    ),
    FieldRow::unused(
        "descrip",
        "shown by `vgs info`; TE= and TR=, as converters of MR write, say that values are no HU",
    ),
    FieldRow::unused("intent_code", "not used: the values tell a mask from an image"),
    FieldRow::unused("cal_min", "not used, and so is cal_max: for the display"),
    FieldRow::unused("dim_info", "not used, and so are the slice fields, toffset and aux_file"),
];

/// The fields of either header that matter here, unchecked.
struct Fields {
    version: u8,
    big_endian: bool,
    single_file: bool,
    dim: [i64; 8],
    datatype: i16,
    bitpix: i16,
    pixdim: [f64; 8],
    vox_offset: f64,
    slope: f64,
    inter: f64,
    units: i32,
    qform_code: i32,
    sform_code: i32,
    /// The components b, c, d.
    quaternion: [f64; 3],
    q_offset: [f64; 3],
    srow: [[f64; 4]; 3],
    description: Vec<u8>,
}

/// A checked header.
#[derive(Clone, Debug)]
pub(super) struct Parsed {
    /// Version: 1 or 2.
    pub version: u8,
    pub big_endian: bool,
    /// True if the voxels follow in the same file.
    pub single_file: bool,
    /// Effective dimensions: trailing ones of size 1 are dropped, but at least three are kept.
    pub dims: Vec<usize>,
    pub datatype: &'static Datatype,
    /// Byte at which the voxels begin.
    pub vox_offset: u64,
    /// Slope and intercept; `None` if there is no scaling.
    pub scaling: Option<(f64, f64)>,
    pub units: &'static str,
    pub qform_code: i32,
    pub sform_code: i32,
    /// Source of the affine: "sform", "qform" or "pixdim".
    pub affine_source: &'static str,
    /// Map from voxel to world, mm RAS.
    pub affine: DAffine3,
    pub description: String,
    /// Oddities that do not prevent reading, as sentences.
    pub notes: Vec<String>,
}

impl Parsed {
    pub fn size(&self) -> [usize; 3] {
        [self.dims[0], self.dims[1], self.dims[2]]
    }

    /// Returns the number of volumes in the file: the product of the dimensions beyond the third.
    pub fn volumes(&self) -> usize {
        self.dims[3..].iter().product()
    }

    /// Returns the number of voxels of one volume.
    pub fn voxels(&self) -> usize {
        self.dims[..3].iter().product()
    }

    /// Returns true if the description has the times of a sequence, as converters of DICOM write them: an MR.
    pub fn is_mr(&self) -> bool {
        self.description.split([';', ' ', ',']).any(|word| word.starts_with("TE=") || word.starts_with("TR="))
    }

    /// Returns the size of the header itself plus the four bytes that announce extensions.
    pub fn header_bytes(&self) -> u64 {
        (if self.version == 1 { SIZE_1 } else { SIZE_2 }) as u64 + 4
    }
}

fn bad(code: &'static str, message: impl Into<String>) -> Error {
    Error::new(Kind::BadData, code, message)
}

/// Returns true if `head` begins like a NIfTI (or ANALYZE) header, in either byte order.
pub(crate) fn sniff(head: &[u8]) -> bool {
    header_size(head).is_some_and(|(size, _)| head.len() >= size)
}

/// Returns the header size that the first bytes declare, and true if the file is big-endian.
fn header_size(head: &[u8]) -> Option<(usize, bool)> {
    let raw: [u8; 4] = head.get(..4)?.try_into().ok()?;
    let known = |v: i32| [SIZE_1, SIZE_2].into_iter().find(|&s| s as i32 == v);
    known(i32::from_le_bytes(raw))
        .map(|s| (s, false))
        .or_else(|| known(i32::from_be_bytes(raw)).map(|s| (s, true)))
}

/// Parses and checks the header at the beginning of `head`.
pub(super) fn parse(head: &[u8]) -> Result<Parsed> {
    check(fields(head)?)
}

fn fields(head: &[u8]) -> Result<Fields> {
    if head.len() < SIZE_1 {
        let message = format!("too short for a NIfTI header ({} of {SIZE_1} bytes)", head.len());
        return Err(bad("VGS-NII-001", message));
    }
    match header_size(head) {
        Some((SIZE_1, big)) => fields_1(head, big),
        Some((_, big)) => fields_2(head, big),
        None => {
            let found = i32::from_le_bytes([head[0], head[1], head[2], head[3]]);
            let message = format!("not a NIfTI file: sizeof_hdr is {found} instead of {SIZE_1} or {SIZE_2}");
            Err(bad("VGS-NII-002", message))
        }
    }
}

fn fields_1(head: &[u8], big_endian: bool) -> Result<Fields> {
    let magic = &head[344..348];
    if magic != b"n+1\0" && magic != b"ni1\0" {
        return Err(bad("VGS-NII-003", "ANALYZE 7.5, or a NIfTI-1 file without its magic").help(
            "ANALYZE does not say how the patient lies: convert it to NIfTI with a tool that asks, and check",
        ));
    }
    // The crate guesses the byte order from dim[0] and reads the dimensions without their sign.
    let raw = [head[40], head[41]];
    let rank = if big_endian { i16::from_be_bytes(raw) } else { i16::from_le_bytes(raw) };
    check_rank(i64::from(rank))?;
    let h = NiftiHeader::from_reader(&head[..SIZE_1])
        .map_err(|e| bad("VGS-NII-004", format!("the NIfTI-1 header cannot be read: {e}")))?;
    if (h.endianness == Endianness::Big) != big_endian {
        return Err(bad("VGS-NII-004", "sizeof_hdr and dim[0] disagree about the byte order"));
    }
    Ok(Fields {
        version: 1,
        big_endian,
        single_file: magic == b"n+1\0",
        dim: h.dim.map(|d| i64::from(d as i16)),
        datatype: h.datatype,
        bitpix: h.bitpix,
        pixdim: h.pixdim.map(f64::from),
        vox_offset: f64::from(h.vox_offset),
        slope: f64::from(h.scl_slope),
        inter: f64::from(h.scl_inter),
        units: i32::from(h.xyzt_units),
        qform_code: i32::from(h.qform_code),
        sform_code: i32::from(h.sform_code),
        quaternion: [h.quatern_b, h.quatern_c, h.quatern_d].map(f64::from),
        q_offset: [h.quatern_x, h.quatern_y, h.quatern_z].map(f64::from),
        srow: [h.srow_x, h.srow_y, h.srow_z].map(|row| row.map(f64::from)),
        description: h.descrip,
    })
}

/// Reads fixed-size little- or big-endian numbers at byte offsets.
struct Bytes<'a> {
    data: &'a [u8],
    big: bool,
}

impl Bytes<'_> {
    fn raw<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut raw = [0; N];
        raw.copy_from_slice(&self.data[at..at + N]);
        if self.big {
            raw.reverse();
        }
        raw
    }

    fn i16(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.raw(at))
    }

    fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.raw(at))
    }

    fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.raw(at))
    }

    fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.raw(at))
    }

    fn f64s<const N: usize>(&self, at: usize) -> [f64; N] {
        std::array::from_fn(|i| self.f64(at + 8 * i))
    }
}

fn fields_2(head: &[u8], big: bool) -> Result<Fields> {
    if head.len() < SIZE_2 {
        let message = format!("too short for a NIfTI-2 header ({} of {SIZE_2} bytes)", head.len());
        return Err(bad("VGS-NII-001", message));
    }
    let magic = &head[4..12];
    if magic != MAGIC_2_SINGLE && magic != MAGIC_2_PAIR {
        return Err(bad("VGS-NII-003", "sizeof_hdr says NIfTI-2, but the magic is not that of NIfTI-2")
            .help("the header was damaged, often by a transfer in text mode: copy the file again"));
    }
    let b = Bytes { data: head, big };
    check_rank(b.i64(16))?;
    Ok(Fields {
        version: 2,
        big_endian: big,
        single_file: magic == MAGIC_2_SINGLE,
        dim: std::array::from_fn(|i| b.i64(16 + 8 * i)),
        datatype: b.i16(12),
        bitpix: b.i16(14),
        pixdim: b.f64s(104),
        // This is an integer; beyond 2⁵³ it is far out of range anyway.
        vox_offset: b.i64(168) as f64,
        slope: b.f64(176),
        inter: b.f64(184),
        units: b.i32(500),
        qform_code: b.i32(344),
        sform_code: b.i32(348),
        quaternion: b.f64s(352),
        q_offset: b.f64s(376),
        srow: std::array::from_fn(|r| b.f64s(400 + 32 * r)),
        description: head[240..320].to_vec(),
    })
}

fn check_rank(rank: i64) -> Result<()> {
    if (1..=7).contains(&rank) {
        Ok(())
    } else {
        Err(bad("VGS-NII-005", format!("dim[0] is {rank}; a number of dimensions from 1 to 7 is needed")))
    }
}

fn check(f: Fields) -> Result<Parsed> {
    let mut notes = Vec::new();
    let dims = check_dims(&f)?;
    let datatype = DATATYPES
        .iter()
        .find(|d| d.code == f.datatype)
        .ok_or_else(|| bad("VGS-NII-007", format!("datatype {} is not a NIfTI datatype", f.datatype)))?;
    if i64::from(f.bitpix) != 8 * datatype.bytes as i64 && datatype.bytes > 0 {
        notes.push(format!(
            "bitpix is {}, but the datatype is {}: the datatype counts",
            f.bitpix, datatype.name
        ));
    }
    let voxels = dims.iter().try_fold(1_usize, |n, &d| n.checked_mul(d));
    if voxels.and_then(|n| n.checked_mul(datatype.bytes.max(4))).is_none_or(|n| n > i64::MAX as usize) {
        return Err(bad("VGS-NII-006", format!("the dimensions {dims:?} are more than any memory holds")));
    }
    let vox_offset = check_vox_offset(&f, &mut notes)?;
    let scaling = check_scaling(f.slope, f.inter, &mut notes)?;
    let (units, millimetres) = match f.units & 7 {
        0 => ("unknown, taken as mm", 1.0),
        1 => ("m", 1e3),
        2 => ("mm", 1.0),
        3 => ("µm", 1e-3),
        n => {
            let message =
                format!("xyzt_units has the unit of length {n}; 0 to 3 (unknown, m, mm, µm) is needed");
            return Err(bad("VGS-NII-022", message).help(CORRECT));
        }
    };
    let (affine_source, affine) = check_affine(&f, &dims, &mut notes)?;
    if !affine.is_finite() {
        let fields = if affine_source == "sform" {
            "srow_x, srow_y, srow_z"
        } else {
            "qoffset_x, qoffset_y, qoffset_z"
        };
        return Err(bad("VGS-NII-012", format!("{fields} hold NaN or infinity; finite numbers are needed"))
            .help(CORRECT));
    }
    let affine =
        DAffine3 { matrix3: affine.matrix3 * millimetres, translation: affine.translation * millimetres };
    check_shape(&affine, &mut notes)?;
    let text = f.description.split(|&b| b == 0).next().unwrap_or_default();
    Ok(Parsed {
        version: f.version,
        big_endian: f.big_endian,
        single_file: f.single_file,
        dims,
        datatype,
        vox_offset,
        scaling,
        units,
        qform_code: f.qform_code,
        sform_code: f.sform_code,
        affine_source,
        affine,
        description: String::from_utf8_lossy(text).replace(char::is_control, " ").trim().to_owned(),
        notes,
    })
}

fn check_dims(f: &Fields) -> Result<Vec<usize>> {
    let rank = f.dim[0] as usize;
    let mut dims = Vec::with_capacity(rank);
    for i in 1..=rank {
        // Beyond the third, zeros occur in real files and mean "none".
        match (f.dim[i], i) {
            (0, 4..) => dims.push(1),
            (n, _) if n > 0 => dims.push(usize::try_from(n).unwrap_or(usize::MAX)),
            (n, _) => return Err(bad("VGS-NII-005", format!("dim[{i}] is {n}; it must be positive"))),
        }
    }
    while dims.len() > 3 && dims.last() == Some(&1) {
        dims.pop();
    }
    dims.resize(dims.len().max(3), 1);
    Ok(dims)
}

fn check_vox_offset(f: &Fields, notes: &mut Vec<String>) -> Result<u64> {
    let least = match (f.single_file, f.version) {
        (false, _) => 0,
        (true, 1) => SIZE_1 + 4,
        (true, _) => SIZE_2 + 4,
    } as f64;
    let offset = f.vox_offset;
    // 2⁵³ is where f64 stops counting, and more than any disk holds.
    if !(offset.fract() == 0.0 && (0.0..9_007_199_254_740_992.0).contains(&offset)) {
        return Err(bad("VGS-NII-008", format!("vox_offset is {offset}; a whole number of bytes is needed")));
    }
    if offset == 0.0 && f.single_file {
        notes.push(format!("vox_offset is 0: the voxels are taken to begin at byte {least}"));
        return Ok(least as u64);
    }
    if offset < least {
        let message = format!("vox_offset is {offset}, inside the header; at least {least} is needed");
        return Err(bad("VGS-NII-008", message));
    }
    Ok(offset as u64)
}

fn check_scaling(slope: f64, inter: f64, notes: &mut Vec<String>) -> Result<Option<(f64, f64)>> {
    if slope == 0.0 {
        return Ok(None);
    }
    // Some programs write a slope of NaN where there is no scaling.
    if slope.is_nan() {
        notes.push(format!("scl_slope is {slope} and scl_inter is {inter}: values are read without scaling"));
        return Ok(None);
    }
    if slope.is_infinite() || !inter.is_finite() {
        let message = format!("scl_slope is {slope} and scl_inter is {inter}; finite numbers are needed");
        return Err(bad("VGS-NII-009", message).help(CORRECT));
    }
    Ok((slope != 1.0 || inter != 0.0).then_some((slope, inter)))
}

/// Returns the affine, in the file's unit, and its source: sform before qform before pixdim.
fn check_affine(f: &Fields, dims: &[usize], notes: &mut Vec<String>) -> Result<(&'static str, DAffine3)> {
    for (name, code) in [("qform_code", f.qform_code), ("sform_code", f.sform_code)] {
        if code < 0 {
            let message = format!("{name} is {code}; 0 (there is none) or more is needed");
            return Err(bad("VGS-NII-023", message).help(CORRECT));
        }
    }
    if f.sform_code > 0 {
        let [x, y, z] = f.srow;
        let affine = DAffine3::from_cols(
            DVec3::new(x[0], y[0], z[0]),
            DVec3::new(x[1], y[1], z[1]),
            DVec3::new(x[2], y[2], z[2]),
            DVec3::new(x[3], y[3], z[3]),
        );
        compare_forms(f, &affine, dims, notes);
        return Ok(("sform", affine));
    }
    let rank = f.dim[0] as usize;
    let mut spacing = [1.0; 3];
    for i in 1..=rank.min(3) {
        let p = f.pixdim[i];
        if p == 0.0 || !p.is_finite() {
            let message = format!("pixdim[{i}] is {p}; the voxel size is needed, since there is no sform");
            return Err(bad("VGS-NII-010", message).help(CORRECT));
        }
        if p < 0.0 {
            notes.push(format!("pixdim[{i}] is {p}: its sign is ignored"));
        }
        spacing[i - 1] = p.abs();
    }
    let spacing = DVec3::from_array(spacing);
    if f.qform_code > 0 {
        return Ok(("qform", qform(f, spacing, notes)?));
    }
    notes.push(
        "neither sform nor qform is set: the orientation is unknown, left and right cannot be told".into(),
    );
    Ok(("pixdim", DAffine3::from_scale(spacing)))
}

/// Notes where the sform, which is used, says something else than the qform or the voxel size.
fn compare_forms(f: &Fields, sform: &DAffine3, dims: &[usize], notes: &mut Vec<String>) {
    let spacing = DVec3::from_array([1, 2, 3].map(|i| f.pixdim[i].abs()));
    let own = spacing_of(sform);
    let differs = |axis: usize| {
        dims[axis] > 1 && spacing[axis] > 0.0 && (own[axis] / spacing[axis] - 1.0).abs() > SAME_LENGTH
    };
    let qform = if f.qform_code > 0 { qform(f, spacing, &mut Vec::new()).ok() } else { None };
    if let Some(qform) = qform.filter(|form| form.is_finite()) {
        let corner = |i: usize| {
            DVec3::from_array(
                [0, 1, 2].map(|axis| if i >> axis & 1 == 1 { dims[axis] as f64 - 1.0 } else { 0.0 }),
            )
        };
        let apart = |i: usize| qform.transform_point3(corner(i)).distance(sform.transform_point3(corner(i)));
        let most = (0..8).map(apart).fold(0.0, f64::max);
        if most > SAME_PLACE * own.min_element() {
            notes.push(format!(
                "qform (code {}) and sform (code {}) are up to {most:.4} units of length apart: the sform is used, as \
                 nibabel and FSL do; ITK and 3D Slicer may use the other",
                f.qform_code, f.sform_code
            ));
        }
    } else if (0..3).any(differs) && shear_of(sform) <= SHEARED {
        let [x, y, z] = spacing.to_array();
        notes.push(format!(
            "pixdim has voxels of {x} × {y} × {z}, and the sform of {:.4} × {:.4} × {:.4}: the sform is used",
            own.x, own.y, own.z
        ));
    }
}

fn qform(f: &Fields, spacing: DVec3, notes: &mut Vec<String>) -> Result<DAffine3> {
    let [b, c, d] = f.quaternion;
    let offset = DVec3::from_array(f.q_offset);
    let norm2 = b * b + c * c + d * d;
    if !norm2.is_finite() || norm2.sqrt() > 1.0 + 1e-3 {
        let message = format!("quatern_b, quatern_c, quatern_d are {b}, {c}, {d}, which is not a rotation");
        return Err(bad("VGS-NII-011", message).help(CORRECT));
    }
    // Rounding of the three stored components may make them just longer than a unit vector: then a = 0.
    let scale = if norm2 > 1.0 { norm2.sqrt().recip() } else { 1.0 };
    let [b, c, d] = [b * scale, c * scale, d * scale];
    let a = (1.0 - (b * b + c * c + d * d)).max(0.0).sqrt();
    let rotation = DMat3::from_cols(
        DVec3::new(a * a + b * b - c * c - d * d, 2.0 * (b * c + a * d), 2.0 * (b * d - a * c)),
        DVec3::new(2.0 * (b * c - a * d), a * a + c * c - b * b - d * d, 2.0 * (c * d + a * b)),
        DVec3::new(2.0 * (b * d + a * c), 2.0 * (c * d - a * b), a * a + d * d - b * b - c * c),
    );
    let qfac = f.pixdim[0];
    if !qfac.is_finite() {
        let message = format!("pixdim[0] is {qfac}; -1 or 1, the handedness of the axes, is needed");
        return Err(bad("VGS-NII-024", message).help(CORRECT));
    }
    if qfac != 1.0 && qfac != -1.0 {
        notes.push(format!("pixdim[0] is {qfac}: it is taken as {}", if qfac < 0.0 { -1 } else { 1 }));
    }
    let handed = DVec3::new(spacing.x, spacing.y, if qfac < 0.0 { -spacing.z } else { spacing.z });
    Ok(DAffine3::from_mat3_translation(rotation * DMat3::from_diagonal(handed), offset))
}

/// Checks that the affine is invertible, and notes shear and odd voxel sizes.
fn check_shape(affine: &DAffine3, notes: &mut Vec<String>) -> Result<()> {
    let spacing = spacing_of(affine);
    let det = affine.matrix3.determinant();
    // Compared with a box of the same voxel size, so that small voxels are not refused.
    if det.abs() <= 1e-6 * spacing.element_product() || !det.is_normal() {
        return Err(bad("VGS-NII-012", "the affine is singular: voxels have no volume"));
    }
    let shear = shear_of(affine);
    if shear > SHEARED {
        let degrees = shear.min(1.0).asin().to_degrees();
        notes.push(format!("the affine is sheared by {degrees:.1}° (gantry tilt?): it is kept exactly"));
    }
    if spacing.min_element() < 1e-3 || spacing.max_element() > 1e3 {
        let [x, y, z] = spacing.to_array();
        let axes = axis_codes_of(affine);
        notes.push(format!("voxels of {x:e} × {y:e} × {z:e} mm ({axes}): is the unit right?"));
    }
    Ok(())
}
