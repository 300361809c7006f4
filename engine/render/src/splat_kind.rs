//! The kinds of splats.

use splat::{Form, SplatSet};

/// Kind of splats; each kind has quality levels of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SplatKind {
    /// Splats that are right between the voxels, too.
    Field,
    /// Splats that are fitted for the voxels of a grid.
    Grid,
    /// Splats with colours of their own, as in a standard 3DGS file.
    Coloured,
}

impl SplatKind {
    /// Every kind.
    pub const ALL: [SplatKind; 3] = [SplatKind::Field, SplatKind::Grid, SplatKind::Coloured];

    /// Returns the name in `quality_levels.toml` and in tables.
    pub fn name(self) -> &'static str {
        match self {
            SplatKind::Field => "field",
            SplatKind::Grid => "grid",
            SplatKind::Coloured => "coloured",
        }
    }

    /// Returns the kind of a set's splats.
    pub fn of(set: &SplatSet) -> Self {
        match set.form {
            _ if set.colours.is_some() => SplatKind::Coloured,
            Form::Field => SplatKind::Field,
            Form::Grid => SplatKind::Grid,
        }
    }
}
