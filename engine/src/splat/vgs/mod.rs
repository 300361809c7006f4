//! `.vgs`: splat sets in a file of a seventh of the size of a PLY, whose first part is a coarser scene.
//!
//! | bytes | what they are |
//! |---|---|
//! | 8 | the mark `\x89VGS\r\n\x1a\n` |
//! | 4, 4, 4 | version 1, length of the header, CRC-32 of the header; little endian, as all numbers |
//! | header | JSON: field, grid, labels, steps of the lattice, and length and CRC-32 of each part that follows |
//! | layers | the splats, the most important layer first: an eighth, a quarter, the rest |
//! | exceptions | gaps between voxels where the rounded occupancy is wrong, seven bits a byte |
//!
//! | file | what it is |
//! |---|---|
//! | `lattice` | the steps that a splat's parameters are rounded to |
//! | `layers` | rows of rounded splats as bytes |
//! | `coder` | the range coder |
//! | `file` | header, reading, writing |
//!
//! A file that ends early is read as far as its layers are whole. The splats are rounded; a set that was read
//! from such a file and is written again is rounded to nearly the same.

mod coder;
mod file;
mod lattice;
mod layers;

pub use file::{bytes, describe, read, sniff, write};
use lattice::Steps;

use super::Splat;

/// Returns steps at which rounding costs a fit of 49 dB 0.2 dB, one of 60 dB 0.9.
fn steps_for(splats: &[Splat]) -> Steps {
    let mut intensities: Vec<f32> = splats.iter().map(|splat| splat.intensity).collect();
    intensities.sort_unstable_by(f32::total_cmp);
    let at = |share: usize| intensities.get(intensities.len() * share / 100).copied().unwrap_or(0.0);
    // A few far intensities do not make the steps coarse.
    let span = f64::from(at(98)) - f64::from(at(2));
    let intensity = if span > 0.0 { (span / 500.0).clamp(1e-20, 1e20) } else { 1.0 };
    // An intensity far beyond the span still has a code.
    let greatest = splats.iter().map(|splat| f64::from(splat.intensity.abs())).fold(0.0, f64::max);
    let intensity = intensity.max(greatest / f64::from(lattice::CODE_LIMIT));
    Steps { mean: 0.02, ratio: 1.015, opacity: 0.03, intensity }
}
