//! Binary glTF 2.0 with the extension KHR_gaussian_splatting, which Khronos has ratified
//! (<https://github.com/KhronosGroup/glTF/tree/main/extensions/2.0/Khronos/KHR_gaussian_splatting>).
//!
//! **What is written**: one mesh of points has, as floats: places, and of each splat rotation (x, y, z, w), scale,
//! opacity and harmonics; and `COLOR_0`, from which programs without the extension colour the points. Places and
//! shapes are stored in metres along the axes of glTF (x to the patient's left, y to the head, z to the front, where
//! the patient looks); the origin of the means, where there is one, is the translation of the node.
//!
//! Beside them stand attributes of an application, which other programs ignore: `_LABEL`, a byte; and of splats whose
//! colours were made of intensities `_HU` (or `_INTENSITY`, without that unit), `_OPACITY_LOGIT` and `_WIDENING`, the
//! factor by which SCALE is wider than σ. The `extras` of the primitive have what a PLY has as comments, and the view
//! of the region as bytes. So a file is again the set that it was made of, but for the splats that its transfer
//! function hid, and for rounding.
//!
//! **What is read**: all primitives with the extension of the scene, wherever its nodes put them, from accessors of any
//! type of number. With intensities of all splats a set has these, and otherwise colours.

mod document;
mod read;
mod write;

use glam::{DMat3, DVec3};

pub use read::{describe, read, sniff};
pub use write::{bytes, write};

/// From RAS to left, up, front.
const AXES: DMat3 = DMat3::from_cols(DVec3::NEG_X, DVec3::Z, DVec3::Y);

const NAME: &str = "KHR_gaussian_splatting";

/// Attributes of this program.
const HU: &str = "_HU";
const INTENSITY: &str = "_INTENSITY";
const LABEL: &str = "_LABEL";
const LOGIT: &str = "_OPACITY_LOGIT";
const WIDENING: &str = "_WIDENING";

/// Numbers of glTF: types of components, and what a primitive is made of.
const FLOAT: u32 = 5126;
const UNSIGNED_BYTE: u32 = 5121;
const POINTS: u32 = 0;
