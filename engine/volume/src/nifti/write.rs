//! The NIfTI writer: float32, a single file, with an sform and, if it can express the same affine, a qform.

use std::io::{self, Write};
use std::path::Path;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::{DMat3, DQuat};

use super::header::{SIZE_1, SIZE_2};
use crate::Volume;
use base::output::write_atomic;
use base::{Error, Kind, Result};

/// Code of scanner coordinates, for both forms of an oriented volume.
const SCANNER: i32 = 1;
/// Code of millimetres.
const UNITS_MM: u8 = 2;
const FLOAT32: i16 = 16;

/// Writes `volume` as float32 to a `.nii` or `.nii.gz` file, atomically: NIfTI-1, or NIfTI-2 where a
/// dimension exceeds the 32767 of NIfTI-1. A volume of unknown orientation gets neither sform nor qform.
/// Label names are not written.
///
/// # Errors
/// [`Kind::Usage`] for another name ending, [`Kind::Internal`] for an affine that is no grid, and those of
/// [`write_atomic`].
pub fn write(path: impl AsRef<Path>, volume: &Volume, force: bool) -> Result<()> {
    let path = path.as_ref();
    let gzip = check_name(path)?;
    let det = volume.world_from_voxel.matrix3.determinant();
    if volume.samples.is_empty() || !volume.world_from_voxel.is_finite() || !det.is_normal() {
        let message = "cannot write a volume without voxels or with a singular affine";
        return Err(Error::new(Kind::Internal, "VGS-NII-021", message).file(path));
    }
    let header = header(volume);
    write_atomic(path, force, |out| {
        if gzip {
            let mut encoder = GzEncoder::new(out, Compression::default());
            encoder.write_all(&header)?;
            write_samples(&mut encoder, &volume.samples)?;
            encoder.finish().map(drop)
        } else {
            out.write_all(&header)?;
            write_samples(out, &volume.samples)
        }
    })
}

/// Returns true if a file of this name is compressed.
///
/// # Errors
/// [`Kind::Usage`] for a name that ends neither in `.nii` nor in `.nii.gz`.
pub fn check_name(path: &Path) -> Result<bool> {
    let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
    let gzip = name.ends_with(".nii.gz");
    if !gzip && !name.ends_with(".nii") {
        let message = "the name of a NIfTI output must end in .nii or .nii.gz";
        return Err(Error::new(Kind::Usage, "VGS-NII-020", message).file(path));
    }
    Ok(gzip)
}

fn write_samples(out: &mut dyn Write, samples: &[f32]) -> io::Result<()> {
    let mut block = Vec::with_capacity(4 * 16384);
    for chunk in samples.chunks(16384) {
        block.clear();
        block.extend(chunk.iter().flat_map(|v| v.to_le_bytes()));
        out.write_all(&block)?;
    }
    Ok(())
}

/// Returns the qform of an affine: `pixdim[0]` and the quaternion's b, c, d; `None` if its axes are not
/// orthogonal.
fn qform(volume: &Volume) -> Option<(f64, [f64; 3])> {
    let spacing = volume.spacing_mm();
    let m = volume.world_from_voxel.matrix3;
    let qfac = m.determinant().signum();
    let r = DMat3::from_cols(m.x_axis / spacing.x, m.y_axis / spacing.y, m.z_axis / spacing.z * qfac);
    let orthogonal = (r.transpose() * r).abs_diff_eq(DMat3::IDENTITY, 1e-6);
    let q = DQuat::from_mat3(&r).normalize();
    // Only b, c, d are stored; a is taken as positive.
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    orthogonal.then_some((qfac, [q.x, q.y, q.z].map(|v| sign * v)))
}

/// A byte buffer into which numbers are put at the offsets of the standard.
struct Buffer(Vec<u8>);

impl Buffer {
    fn put(&mut self, at: usize, bytes: &[u8]) {
        self.0[at..at + bytes.len()].copy_from_slice(bytes);
    }

    /// Writes numbers one after another from offset `at`, as f64 if `wide`, else as f32.
    fn put_reals(&mut self, at: usize, wide: bool, values: &[f64]) {
        for (i, &v) in values.iter().enumerate() {
            match wide {
                true => self.put(at + 8 * i, &v.to_le_bytes()),
                false => self.put(at + 4 * i, &(v as f32).to_le_bytes()),
            }
        }
    }

    /// Writes a code at offset `at`: four bytes in NIfTI-2 (`wide`), two in NIfTI-1.
    fn put_code(&mut self, at: usize, wide: bool, value: i32) {
        match wide {
            true => self.put(at, &value.to_le_bytes()),
            false => self.put(at, &(value as i16).to_le_bytes()),
        }
    }
}

/// Returns the header and the four zero bytes that announce no extension.
fn header(volume: &Volume) -> Vec<u8> {
    let wide = volume.size.iter().any(|&n| n > i16::MAX as usize);
    let size = if wide { SIZE_2 } else { SIZE_1 };
    let mut b = Buffer(vec![0; size + 4]);
    b.put(0, &(size as i32).to_le_bytes());
    let dim = [3, volume.size[0], volume.size[1], volume.size[2], 1, 1, 1, 1];
    for (i, n) in dim.into_iter().enumerate() {
        match wide {
            true => b.put(16 + 8 * i, &(n as i64).to_le_bytes()),
            false => b.put(40 + 2 * i, &(n as i16).to_le_bytes()),
        }
    }
    let spacing = volume.spacing_mm().to_array();
    let form = if volume.oriented { qform(volume) } else { None };
    let (qfac, quaternion) = form.unwrap_or((1.0, [0.0; 3]));
    let qform_code = if form.is_some() { SCANNER } else { 0 };
    let sform_code = if volume.oriented { SCANNER } else { 0 };
    let [x, y, z, t] = volume.world_from_voxel.to_cols_array_2d();
    let rows: Vec<f64> = (0..3).flat_map(|r| [x[r], y[r], z[r], t[r]]).collect();

    // Offsets of NIfTI-2 and NIfTI-1.
    let at = |two: usize, one: usize| if wide { two } else { one };
    b.put(at(12, 70), &FLOAT32.to_le_bytes());
    b.put(at(14, 72), &32_i16.to_le_bytes());
    b.put_reals(at(104, 76), wide, &[qfac, spacing[0], spacing[1], spacing[2], 1.0, 1.0, 1.0, 1.0]);
    b.put_reals(at(176, 112), wide, &[1.0, 0.0]);
    b.put(at(500, 123), &[UNITS_MM]);
    b.put_code(at(344, 252), wide, qform_code);
    b.put_code(at(348, 254), wide, sform_code);
    b.put_reals(at(352, 256), wide, &[quaternion[0], quaternion[1], quaternion[2], t[0], t[1], t[2]]);
    if volume.oriented {
        b.put_reals(at(400, 280), wide, &rows);
    }
    if wide {
        b.put(4, b"n+2\0\r\n\x1a\n");
        b.put(168, &((size + 4) as i64).to_le_bytes());
    } else {
        b.put_reals(108, false, &[(size + 4) as f64]);
        b.put(344, b"n+1\0");
    }
    b.0
}
