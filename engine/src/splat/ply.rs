//! 3D Gaussian splatting PLY files, with the physical intensity of each splat beside the usual properties.
//!
//! **What we write**: binary little endian; element `vertex` with the 17 float properties `x y z nx ny nz f_dc_0..2
//! opacity scale_0..2 rot_0..3` that every reader of the 3DGS convention accepts (opacity is a logit, scale is ln σ,
//! rot is w, x, y, z); then a second element `splat_intensity` with one float `intensity` per splat. An additional
//! vertex property would break readers with a fixed row; a second element is skipped by all that were tried. Means
//! are mm RAS minus a stated origin, scales ln mm. Comments, after the vertex properties because some readers take the
//! third line for the count, hold the rest of a [`SplatSet`](super::SplatSet) in decimal text that reads back to the
//! same bits. `f_dc` is a grey from the intensity by a black-white ramp over the intensities of the set (paper 3.2).
//!
//! An ordinary viewer draws Gaussians to 3 σ and does not divide by Σ w, so what it shows of a set is an approximation,
//! most of all for the compact kernel.
//!
//! **What we read**: the above, and plain 3DGS files: properties in any order and of any scalar type, with or without
//! normals and higher harmonics (which are ignored: a splat has one intensity), any byte order, ASCII. Without our
//! comments the kernel is the Gaussian and the background the mean intensity. The intensity comes from the second
//! element, else from a vertex property `hu` or `intensity`, else it is the luminance of the colour.
//!
//! Every input ends as a set or as an error of class `BadData`, at a cost that the file's length bounds.

mod comments;
mod header;
mod read;
mod rows;
#[cfg(test)]
mod tests;
mod write;

use super::Format;

pub use read::{describe, read};
pub use write::write;

/// The row of this format in [`super::FORMATS`].
pub const FORMAT: Format = Format { name: "ply", sniff, read, write, describe };

/// Degree-0 spherical harmonic, 1 / (2√π): colour = ½ + SH0 · f_dc.
const SH0: f32 = 0.282_094_8;

/// The second element, one row per vertex.
const INTENSITY_ELEMENT: &str = "splat_intensity";

fn sniff(start: &[u8]) -> bool {
    start.strip_prefix(b"ply").is_some_and(|rest| rest.first().is_some_and(u8::is_ascii_whitespace))
}
