//! Adaptive density control: how the number and the places of the splats change during a fit. A row of
//! [`TOPOLOGIES`] is a function from the fit as it is ([`Scene`]) to its new splats ([`Change`]); the fit
//! calls it between two iterations, as often as its configuration says.
//!
//! | file | what it is |
//! |---|---|
//! | `scene` | the input and the result of a change |
//! | `densify` | the paper's method: clone, split, prune, fill holes |
//! | `reference` | the same as in the code of the paper's authors |
//! | `growth` | new splats where the error is largest |
//! | `relocate` | idle splats move to where the error is largest |
//! | `residual`, `spread` | places where the error is largest; samples that keep apart |
//!
//! Everything runs on the host. Random numbers are drawn in one thread and in a fixed order, and each sum is
//! computed by one thread, so the same scene and the same random numbers give the same bits whatever the
//! number of threads.

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
use base::error::Result;

/// A method of density control, a row of [`TOPOLOGIES`].
pub struct Topology {
    /// Name in configurations.
    pub name: &'static str,
    /// Function that changes the splats; none where they stay what they are.
    pub change: Option<fn(&Scene, &mut Pcg64) -> Change>,
}

/// Every method of density control; the first is the default.
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
        row("topology", &self.topology.name, TOPOLOGIES, |row| row.name)
    }
}
