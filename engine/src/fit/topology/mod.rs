//! How the number and the places of the splats change during a fit (adaptive density control). A row of [`TOPOLOGIES`] is
//! a function from what is there ([`Scene`]) to what shall be ([`Change`]); the fit calls it between two iterations, as
//! often as its configuration says.
//!
//! | file | what it is |
//! |---|---|
//! | `scene` | what a change sees and what it returns |
//! | `densify` | the paper's way: clone, split, prune, fill holes |
//! | `reference` | the same as the code of the paper's authors has it |
//! | `growth` | new splats where the error is largest |
//! | `relocate` | idle splats move there |
//! | `residual`, `spread` | where the error is largest; places that keep apart |
//!
//! Everything runs on the host. What is drawn at random is drawn in one thread and in a fixed order, and every sum has
//! an owner, so the same scene and the same random numbers give the same bits whatever the number of threads.

mod densify;
mod growth;
mod reference;
mod relocate;
mod residual;
mod scene;
mod spread;
#[cfg(test)]
mod tests;

use rand_pcg::Pcg64;

pub use scene::{Change, Scene};

use super::config::{FitConfig, row};
use crate::error::Result;

/// A row of [`TOPOLOGIES`].
pub struct Topology {
    /// Name in configurations.
    pub name: &'static str,
    /// What a change does; nothing where splats stay what they are.
    pub change: Option<fn(&Scene, &mut Pcg64) -> Change>,
}

/// Every way; the first is the default.
pub const TOPOLOGIES: &[Topology] = &[
    Topology { name: "none", change: None },
    Topology { name: "densify", change: Some(densify::densify) },
    Topology { name: "growth", change: Some(growth::growth) },
    Topology { name: "relocate", change: Some(relocate::relocate) },
    Topology { name: "reference", change: Some(reference::densify) },
];

impl FitConfig {
    /// Returns the row of the table that `topology` names.
    pub fn topology(&self) -> Result<&'static Topology> {
        row("topology", &self.topology, TOPOLOGIES, |row| row.name)
    }
}
