//! The decoded field: V and O of the splats, evaluated once on the voxels of the grid that they were fitted
//! on, and kept in bricks of 8³ as far as splats reach.
//!
//! A fit aims at the CT's voxels and at trilinear interpolation between them, so samples at the voxels,
//! interpolated, reproduce it. A frame then costs as much as one of the CT, however many splats there are,
//! and a transfer function may change at any time: V and O do not depend on it.
//!
//! V is the value of the field, in 16-bit fractions of its range. For splats that were fitted for voxels
//! alone it is taken at the voxel; otherwise it is what comes nearest to the field between the voxels, by
//! [least squares](super::least_squares). Where no splat reaches, V is the mean of the neighbours that one
//! does reach, so that interpolation at the rim is not drawn towards the background. Beyond the faces of the
//! grid V is that at the faces. O is Σ w / (Σ w + w₀); beyond the faces of the grid O is 0, as it is in the CT.
//! A voxel belongs to the object that has most of Σ w there. O and object of a set with a [`Region`] are those
//! of its [region](region).
//!
//! If a file does not say what its grid was, voxels are cubes with an edge of
//! [`GpuSplats::sigma_mm`](super::GpuSplats::sigma_mm), from the least coordinates of all means on; splats
//! are fitted to be about as wide as voxels. The pitch doubles until the bricks fit into the limits below,
//! with a warning: a coarser picture is better than none.
//!
//! | file | what it is |
//! |---|---|
//! | `source` | splats, where they are sampled, and their field |
//! | `region` | that of splats with a region |
//! | `voxels` | [`Decoded`]: what comes of it |

mod region;
mod source;
mod voxels;

use super::detail::FieldBudget;
use base::error::{Error, Kind, Result};
use gpu::Gpu;
use splat::SplatSet;
use volume::edges::Edges;

pub(super) use source::{Source, bricks_over};
pub use voxels::Decoded;
pub(super) use voxels::place_of;

/// The finest and the coarsest pitch that may be asked for, voxels.
const PITCHES: [f64; 2] = [0.25, 16.0];

/// How splats are decoded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DecodeOptions {
    /// Distance of the voxels, in those of the splats' grid, ¼ to 16.
    pub pitch: f64,
    /// Edges of a region.
    pub edges: Edges,
    /// Most memory of the device that the field may take; `None` for as much as it needs.
    pub budget: Option<FieldBudget>,
}

impl Default for DecodeOptions {
    fn default() -> Self {
        DecodeOptions { pitch: 1.0, edges: Edges::default(), budget: None }
    }
}

impl DecodeOptions {
    /// Returns true if both are of the same field in as much memory, wherever it is seen from.
    pub fn is_like(&self, other: &DecodeOptions) -> bool {
        let bytes = |options: &DecodeOptions| options.budget.map(|budget| budget.bytes);
        self.is_of_field(other) && bytes(self) == bytes(other)
    }

    /// Returns true if both are of the same field, whatever its memory.
    pub(super) fn is_of_field(&self, other: &DecodeOptions) -> bool {
        (self.pitch, self.edges) == (other.pitch, other.edges)
    }
}

/// Decodes a set, in its own space (mm less its origin), to voxels `pitch` voxels of its grid apart. A voxel of the
/// set's region is wholly inside, any other wholly outside. A set that
/// was fitted for the voxels alone is wrong between them: its pitch is 1 or the next power of two, and coarser
/// voxels have the means of those of the grid.
///
/// # Errors
/// If the pitch is below ¼ or above 16.
pub fn decode(gpu: &Gpu, set: &SplatSet, pitch: f64) -> Result<Decoded> {
    decode_as(gpu, set, &DecodeOptions { pitch, edges: Edges::Voxel, budget: None })
}

/// Decodes a set as [`decode`] does, as `options` say, all of it.
///
/// # Errors
/// Those of [`decode`].
pub fn decode_as(gpu: &Gpu, set: &SplatSet, options: &DecodeOptions) -> Result<Decoded> {
    Source::of(set)
        .decode(gpu, options, &mut |_| true)?
        .ok_or_else(|| Error::new(Kind::Internal, "VGS-RENDER-026", "a decoded field is lost"))
}

/// Returns true if [`decode`] has every voxel of a set's grid; false if there would be too many, so that it takes every
/// second one, or fewer.
pub fn decodes_every_voxel(set: &SplatSet) -> bool {
    match &set.region {
        Some(region) => region::is_within_limits(region),
        None => Source::of(set).fits_at(1.0),
    }
}

/// Fails if splats cannot be decoded to voxels of this pitch.
pub(super) fn check(pitch: f64) -> Result<()> {
    let [finest, coarsest] = PITCHES;
    if (finest..=coarsest).contains(&pitch) {
        return Ok(());
    }
    Err(Error::new(Kind::Usage, "VGS-RENDER-024", format!("a pitch of {pitch} voxels"))
        .help(format!("choose one from {finest} to {coarsest}; 1 is the grid of the CT itself")))
}

impl Source {
    /// Decodes the splats. `going` is told the part that is done, 0 to 1, again and again; the result is
    /// `None` if it returns false.
    pub(super) fn decode(
        &self,
        gpu: &Gpu,
        options: &DecodeOptions,
        going: &mut dyn FnMut(f64) -> bool,
    ) -> Result<Option<Decoded>> {
        let DecodeOptions { pitch, edges, budget: _ } = *options;
        check(pitch)?;
        if let (Some(region), Some(grid)) = (&self.region, &self.grid) {
            let decoded = self.decode_region(gpu, region, grid, edges, going)?;
            return Ok(decoded.map(|(decoded, reached)| decoded.at_pitch(reached, pitch)));
        }
        self.decode_field(gpu, pitch, going)
    }
}
