//! Initialisers: a row of [`INITIALISERS`] places the first splats in the region of interest.
//!
//! | file | what it is |
//! |---|---|
//! | `gradient` | blue noise, denser where the intensity changes; the default |
//! | `uniform` | the paper's: at random, the mask being the probability |
//! | `reference` | the one in the code of the paper's authors |
//! | `orientation` | the cues that turn splats ([`ORIENTATIONS`]) |
//! | `prototype` | the splat that all begin with |
//! | `intensity` | intensities from the volume |
//! | `density`, `blue_noise`, `grid`, `symmetric` | densities, spaced points, neighbours, eigenvectors |
//!
//! Everything is in voxel space. The result depends on the inputs and the seed alone, not on the number of
//! threads. Time and memory follow the region's bounding box, not the volume.

mod blue_noise;
mod density;
mod gradient;
mod grid;
mod intensity;
mod orientation;
mod prototype;
mod reference;
mod symmetric;
#[cfg(test)]
mod tests;
mod uniform;

use std::time::Instant;

pub(super) use self::grid::PointGrid;
pub use self::orientation::{ORIENTATIONS, Orientation};
use super::config::{Init, row};
use base::error::Result;
use splat::Splat;
use volume::{Roi, Volume};

/// Function that places first splats in a volume and its region: their number, the seed, the hyper-parameters, and the
/// time after which it is to hurry, if it can.
type Run = fn(&Volume, &Roi, usize, u64, &Init, Option<Instant>) -> Vec<Splat>;

/// A way to place the first splats.
pub struct Initialiser {
    /// Name on the command line.
    pub name: &'static str,
    /// Places exactly `count` splats in voxel space, or none if no voxel of the region has a weight above 0.
    /// With [`ScaleUnit::Box`](super::ScaleUnit::Box) they have their shape in the unit cube of the volume's
    /// box, in the unit of [`ScaleUnit::stretch`](super::ScaleUnit::stretch), as a fit with that unit takes
    /// them.
    pub run: Run,
}

/// Every way to place the first splats; the first is the default.
pub const INITIALISERS: &[Initialiser] = &[
    Initialiser { name: "gradient", run: gradient::initialise },
    Initialiser {
        name: "uniform",
        run: |v, roi, n, seed, init, _| uniform::initialise(v, roi, n, seed, init),
    },
    Initialiser {
        name: "reference",
        run: |v, roi, n, seed, init, _| reference::initialise(v, roi, n, seed, init),
    },
];

impl Init {
    /// Returns the row of the table that `initialiser` names.
    pub fn initialiser(&self) -> Result<&'static Initialiser> {
        row("initialiser", &self.initialiser, INITIALISERS, |row| row.name)
    }

    /// Returns the row of the table that `orientation` names.
    pub fn orientation(&self) -> Result<&'static Orientation> {
        row("init_orientation", &self.orientation, ORIENTATIONS, |row| row.name)
    }

    /// Returns the cue that turns the splats: that of the orientation, whose name was checked with the configuration.
    fn cue(&self) -> &'static Orientation {
        self.orientation().unwrap_or(&ORIENTATIONS[0])
    }
}
