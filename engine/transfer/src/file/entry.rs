//! What the readers of all formats produce, and the rules that they share.

use crate::{OpacityPoint, TransferFunction};
use base::error::{Error, Kind, Result};

/// The most control points of one kind that a function may have.
pub(super) const MAX_POINTS: usize = 16384;

/// One function of a file. A function that cannot be used is an error only when it is asked for.
pub(super) struct Entry {
    /// The name; empty if the file gives none.
    pub(super) name: String,
    pub(super) function: Result<TransferFunction>,
}

/// Creates an error about the content of a file.
pub(super) fn broken(message: impl Into<String>) -> Error {
    Error::new(Kind::BadData, "VGS-TF-008", message)
}

/// Converts pairs (intensity, opacity) to control points of opacity.
pub(super) fn opacity_points(points: &[(f64, f64)]) -> Vec<OpacityPoint> {
    points.iter().map(|&(intensity, opacity)| OpacityPoint { intensity, opacity }).collect()
}
