//! The modes that show splats: rows of the engine's table.

use engine::render::{self, ModeRow, SplatKind};
use serde::{Deserialize, Serialize};

/// Mode that shows the decoded field; the colours of the error are those of its voxels.
pub const DECODED: &str = "decoded";

/// Render mode for splats: a row of [`render::MODES`], by its name in a session.
#[derive(Clone, Copy, Deserialize, Serialize)]
#[serde(try_from = "String", into = "String")]
pub struct SplatMode(&'static ModeRow);

impl SplatMode {
    /// Returns all modes, in the order in which one steps through them.
    pub fn all() -> impl Iterator<Item = SplatMode> {
        render::MODES.iter().filter(|row| row.of_splats).map(SplatMode)
    }

    /// Returns the mode of this name; `None` if it shows no splats or is none.
    pub fn named(name: &str) -> Option<SplatMode> {
        SplatMode::all().find(|mode| mode.name == name)
    }

    /// Returns the modes that show splats of a kind as they are meant, in the order in which one steps through them.
    pub fn of_kind(kind: SplatKind) -> Vec<SplatMode> {
        SplatMode::all().filter(|mode| kind.own_mode().is_none_or(|own| own == mode.name)).collect()
    }

    /// Returns the row of the engine.
    pub fn row(self) -> &'static ModeRow {
        self.0
    }
}

impl Default for SplatMode {
    /// Returns the mode of splats that are fitted for the voxels of a grid.
    fn default() -> Self {
        SplatMode(mode_row(SplatKind::Grid.usual_mode()))
    }
}

impl std::ops::Deref for SplatMode {
    type Target = ModeRow;

    fn deref(&self) -> &ModeRow {
        self.0
    }
}

impl PartialEq for SplatMode {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl std::fmt::Debug for SplatMode {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

impl From<SplatMode> for String {
    fn from(mode: SplatMode) -> String {
        mode.name.to_owned()
    }
}

impl TryFrom<String> for SplatMode {
    type Error = String;

    fn try_from(name: String) -> std::result::Result<Self, String> {
        let known = || SplatMode::all().map(|mode| mode.name).collect::<Vec<_>>().join(", ");
        SplatMode::named(&name)
            .ok_or_else(|| format!("no mode of splats is called {name:?}: they are {}", known()))
    }
}

/// Returns the engine's row of a mode.
pub fn mode_row(name: &str) -> &'static ModeRow {
    render::mode(name).expect("names of modes are the engine's")
}
