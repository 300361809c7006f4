//! `.vgs`: splat sets in a file of a seventh of the size of a PLY, whose first part is a coarser scene.
//!
//! | bytes | what they are |
//! |---|---|
//! | 8 | the mark `\x89VGS\r\n\x1a\n` |
//! | 4, 4, 4 | version 2, length of the header, CRC-32 of the header; little endian, as all numbers |
//! | header | JSON: field, grid, labels, steps of the lattice, and length and CRC-32 of each part that follows |
//! | region | the voxels that are shown, if the set has a [`Region`](crate::Region) |
//! | slabs | V of the region's voxels, if the set has [`Voxels`](crate::Voxels) in place of splats |
//! | layers | the splats, the most important layer first: an eighth, a quarter, the rest |
//!
//! | file | what it is |
//! |---|---|
//! | `lattice` | the steps that a splat's parameters are rounded to |
//! | `rounding` | what a set was rounded to: [`Rounding`] |
//! | `rounds` | rounding splats before they are written |
//! | `layers` | rows of rounded splats as bytes |
//! | `exceptions` | what files of version 1 have for a region |
//! | `morton` | codes of places along a Morton curve, and gaps between them |
//! | `values` | intensities of a region as bytes, none off by more than a bound |
//! | `voxel`, `regression`, `decisions` | the prediction of an intensity, and the intensity as decisions |
//! | `coder` | the range coder |
//! | `file` | header, reading, writing |
//!
//! A file that ends early is read as far as its layers are whole; region and slabs are, always. The splats are rounded.
//! A set that was read from such a file states its rounding, and is the same when it is written again.

pub mod coder;
mod decisions;
mod exceptions;
mod file;
mod lattice;
mod layers;
pub(crate) mod morton;
mod regression;
mod rounding;
mod rounds;
pub mod values;
mod voxel;

pub use file::{MARK, bytes, decode, describe, encode, read, sniff, write};
pub use rounding::Rounding;
pub use rounds::Group;
