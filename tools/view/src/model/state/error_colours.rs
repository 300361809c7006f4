//! Which of what is seen has the colours of the error of the splats.

use engine::fidelity::ShownError;
use serde::{Deserialize, Serialize};

/// Colours of the error of the splats against the volume.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ErrorColours {
    /// True if the slices have them.
    pub slices: bool,
    /// True if surfaces in the picture have them.
    pub picture: bool,
    /// Error at which the colours end, HU for CT; `None` for a round number that 99 % of the voxels do not exceed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<f64>,
}

impl ErrorColours {
    pub(super) fn is_default(&self) -> bool {
        *self == ErrorColours::default()
    }

    /// Returns the error at which the colours saturate.
    pub fn range(&self, error: &ShownError) -> f64 {
        self.range.unwrap_or(error.range)
    }
}
