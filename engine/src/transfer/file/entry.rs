//! What the readers of all formats make, and the rules that they share.

use crate::error::{Error, Kind, Result};
use crate::transfer::{OpacityPoint, TransferFunction};

/// Most control points of one kind in one function.
pub(super) const MAX_POINTS: usize = 16384;

/// One function of a file. Another one that cannot be used does not matter as long as nobody asks for it.
pub(super) struct Entry {
    /// Empty where the file has none.
    pub(super) name: String,
    pub(super) function: Result<TransferFunction>,
}

/// Returns an error in the content of a file.
pub(super) fn broken(message: impl Into<String>) -> Error {
    Error::new(Kind::BadData, "VGS-TF-008", message)
}

/// Returns control points of opacity from pairs (intensity, opacity).
pub(super) fn opacity_points(points: &[(f64, f64)]) -> Vec<OpacityPoint> {
    points.iter().map(|&(intensity, opacity)| OpacityPoint { intensity, opacity }).collect()
}
