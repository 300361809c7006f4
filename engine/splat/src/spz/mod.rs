//! SPZ, the compressed format of Niantic (<https://github.com/nianticlabs/spz>): some 10 bytes a splat of one
//! colour. Versions 1 to 4 are read. Version 3 is written, the last one in gzip, which nearly all programs read; and
//! version 4 where the fit goes along, as a record for which version 3 has no good place: three.js refuses what follows
//! its splats.
//!
//! Axes are right, up, back (x to the patient's right, y to the head, z to the back), metres. There are, each for all
//! splats: means of 3 × 24 bits in fixed point, opacity of 8 bits, colour of 3 × 8, ln σ of 3 × 8 in steps of 1/16,
//! rotation of 32 bits (which of x, y, z, w is the greatest, and the three others with a sign and 9 bits), harmonics
//! beyond degree 0 of 8 bits each. Version 1 has means of 16-bit floats, and both it and version 2 have x, y, z of the
//! rotation in 8 bits each.
//!
//! Versions 1 to 3 are one gzip stream: a header of 16 bytes, these sections, and records of extensions. Version 4 has
//! a header of 32 bytes, the records, a table of sizes, and a zstd stream for each section.
//!
//! A record is its kind (32 bits: vendor and number), its length (32 bits), and its bytes. That of this program,
//! [`FIT`], is a whole `.vgs`: others skip it and show the colours, this program reads it and skips the colours. The two
//! need not have the same splats.

mod read;
mod write;

use glam::{DMat3, DVec3};

pub use read::{describe, read, sniff};
pub use write::{bytes, write};

/// The first bytes of the header.
const MARK: &[u8; 4] = b"NGSP";

/// Flag of a header: there are records of extensions.
const HAS_EXTENSIONS: u8 = 2;

/// Bytes of the header of version 4.
const ZSTD_HEADER: u32 = 32;

/// The kind of the record with the splats that the colours were made of: number 1 of the vendor "VG". Vendors choose
/// their own numbers.
const FIT: u32 = 0x5647_0001;

/// A colour's coefficient of degree 0 in steps of a byte, about the middle.
const COLOUR_STEPS: f32 = 0.15 * 255.0;

/// From RAS to right, up, back.
const AXES: DMat3 = DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y);
