//! SOG, the format of PlayCanvas (<https://developer.playcanvas.com/user-manual/gaussian-splatting/formats/sog>), version 2:
//! a zip of `meta.json` and of lossless WebP images, in which a splat is a pixel. Splats go along a Morton curve, so that
//! neighbours in an image are neighbours in space.
//!
//! Axes are right, down, front (x to the patient's right, y to the feet, z to the front), metres. The specification says right,
//! up, back; PlayCanvas' own programs have those of a PLY, these, and so do those of others.
//!
//! | image | red, green, blue, alpha |
//! |---|---|
//! | `means_l`, `means_u` | low and high bytes of x, y, z: 16 bits of sign(v) ln(1 + abs(v)) between `mins` and `maxs` |
//! | `quats` | three of w, x, y, z in steps of √2/255; 252 and which of the four is left out, the greatest |
//! | `scales` | ln σ, by a codebook of 256 numbers |
//! | `sh0` | harmonics of degree 0, by a codebook; opacity |
//! | `shN_labels` | which row of the palette has the harmonics beyond degree 0: low and high byte |
//! | `shN_centroids` | the palette, by a codebook: 64 rows a line, a pixel for each basis function |

mod codes;
mod palette;
mod read;
mod write;

use glam::{DMat3, DVec3};
use serde::{Deserialize, Serialize};

pub use read::{describe, read, sniff};
pub use write::{bytes, write};

/// The version that is read and written.
const VERSION: u64 = 2;
/// The file that names the others.
const META: &str = "meta.json";

/// From RAS to right, down, front.
const AXES: DMat3 = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y);

/// Alpha of a rotation whose w is left out; those of x, y, z follow.
const LEFT_OUT: u8 = 252;

/// Steps of a coordinate.
const STEPS: f64 = 65535.0;

/// Rows of the palette in a line of its image.
const ROWS_A_LINE: usize = 64;
/// Most rows of a palette: labels have 16 bits.
const MOST_ROWS: usize = 1 << 16;

/// What `meta.json` says.
#[derive(Serialize, Deserialize)]
struct Meta {
    version: u64,
    count: u64,
    /// Not an ordinary splat, if it is given: "antialiased", "2dgs".
    #[serde(default, skip_serializing_if = "Option::is_none")]
    model: Option<String>,
    means: Means,
    scales: Coded,
    quats: Files,
    sh0: Coded,
    #[serde(rename = "shN", default, skip_serializing_if = "Option::is_none")]
    beyond: Option<Beyond>,
}

/// Places, as [`log_of`] gives them.
#[derive(Serialize, Deserialize)]
struct Means {
    mins: [f64; 3],
    maxs: [f64; 3],
    files: [String; 2],
}

#[derive(Serialize, Deserialize)]
struct Files {
    files: [String; 1],
}

/// Numbers that bytes stand for. The first is `null` in files of some writers.
type Codebook = Vec<Option<f32>>;

#[derive(Serialize, Deserialize)]
struct Coded {
    codebook: Codebook,
    files: [String; 1],
}

/// Harmonics beyond degree 0.
#[derive(Serialize, Deserialize)]
struct Beyond {
    /// Rows of the palette.
    count: u64,
    /// Highest degree.
    bands: u8,
    codebook: Codebook,
    /// Palette and labels.
    files: [String; 2],
}

/// Returns what is stored of a coordinate.
fn log_of(v: f64) -> f64 {
    v.signum() * v.abs().ln_1p()
}

/// Returns the coordinate of what is stored.
fn of_log(v: f64) -> f64 {
    v.signum() * v.abs().exp_m1()
}
