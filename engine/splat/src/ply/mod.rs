//! 3D Gaussian splatting PLY files, with the physical intensity of each splat beside the usual properties.
//!
//! **What we write**: binary little endian; element `vertex` with the 17 float properties `x y z nx ny nz
//! f_dc_0..2 opacity scale_0..2 rot_0..3` that every reader of the 3DGS convention accepts (opacity is a
//! logit, scale is ln σ, rot is w, x, y, z), then a float `intensity` and, for a set with labels, a float
//! `label`, whose names are comments `vgs.label 5 liver`. All are floats, because there are readers that count
//! no others. A second element `exception` has the voxels of the grid where the splats are wrong about a
//! binary mask, as bytes `code`. Means are mm RAS, less a stated origin where f32 would be too coarse without
//! one; scales are ln mm. Comments, after the vertex properties because some readers take the third line for
//! the count, hold the rest of a [`SplatSet`](super::SplatSet) in decimal text that reads back to the same
//! bits. `f_dc` is a grey from the intensity by a black-white ramp over the intensities of the set (paper
//! 3.2). A set with colours has these as `f_dc` and, between it and `opacity`, `f_rest`; it has no intensity.
//!
//! The layout `inria` is for readers whose rows have 62 floats: all of `f_rest`, no intensity and no label.
//! These have a second element, `splat_intensity`. `docs/design/file-formats.md` has what other programs read.
//!
//! An ordinary viewer draws Gaussians to 3 σ and does not divide by Σ w, so what it shows of a set is an
//! approximation, most of all for the compact kernel.
//!
//! **What we read**: the above, and plain 3DGS files: properties in any order and of any scalar type, with or
//! without normals, any byte order, ASCII. Without our comments the kernel is the Gaussian, the background
//! the mean intensity, and means are taken as they are (which axis of an ordinary file points up is not
//! known). The intensity comes from an element `splat_intensity`, else from a vertex property `hu` or
//! `intensity`. A file without it is a set with colours: their harmonics are kept whole (0, 9, 24 or 45
//! properties `f_rest`, all of red first, then green, then blue), and the intensity is the luminance of the
//! first of them. Beside an intensity colours are ignored.
//!
//! **The PLY of the paper's authors** looks like one of these and is not: `reference` has what its numbers
//! stand for. It is known by its property `intensity_01`, and read and written as a row of [`PLY_LAYOUTS`].
//!
//! **Volume Encoding Gaussians** have elements of their own, and are read alone: `veg`.
//!
//! Every input ends as a set or as an error of class `BadData`, at a cost that the file's length bounds.

pub(super) mod comments;
mod encode;
mod header;
mod layout;
mod names;
mod read;
pub(super) mod reference;
pub(super) mod region;
mod rows;
#[cfg(test)]
mod tests;
mod veg;
mod write;

pub use layout::{PLY_LAYOUTS, PlyLayout};
pub(super) use names::sniff;
pub(super) use read::convert_help;
pub use read::{ORDINARY, describe, read};
pub(super) use write::check;
pub use write::{bytes, write};
