//! Initialisers: a row of [`INITIALISERS`] places the first splats in the region of interest.
//!
//! | file | what it is |
//! |---|---|
//! | `config` | the hyper-parameters of all initialisers |
//! | `gradient` | blue noise, denser where the intensity changes; the default |
//! | `uniform` | the paper's: at random, the mask being the probability |
//! | `reference` | the one in the code of the paper's authors |
//! | `orientation` | the cues that turn splats ([`ORIENTATIONS`]) |
//! | `intensity` | intensities from the volume |
//! | `density`, `blue_noise`, `grid`, `symmetric` | densities, spaced points, neighbours, eigenvectors |
//!
//! Everything is in voxel space. The result depends on the inputs and the seed alone, not on the number of
//! threads. Time and memory follow the region's bounding box, not the volume.

mod blue_noise;
mod config;
mod density;
mod gradient;
mod grid;
mod intensity;
mod orientation;
mod reference;
mod symmetric;
#[cfg(test)]
mod tests;
mod uniform;

pub use self::config::InitConfig;
pub(super) use self::grid::PointGrid;
pub use self::orientation::{ORIENTATIONS, Orientation};
use splat::Splat;
use volume::{Roi, Volume};

/// A way to place the first splats.
pub struct Initialiser {
    /// Name on the command line.
    pub name: &'static str,
    /// Places exactly `count` splats in voxel space, or none if no voxel of the region has a weight above 0.
    /// With [`ScaleUnit::Box`](super::ScaleUnit::Box) they have their shape in the unit cube of the volume's
    /// box, in the unit of [`ScaleUnit::stretch`](super::ScaleUnit::stretch), as a fit with that unit takes
    /// them.
    pub run: fn(volume: &Volume, roi: &Roi, count: usize, seed: u64, config: &InitConfig) -> Vec<Splat>,
}

/// Every way to place the first splats; the first is the default.
pub const INITIALISERS: &[Initialiser] = &[
    Initialiser { name: "gradient", run: gradient::initialise },
    Initialiser { name: "uniform", run: uniform::initialise },
    Initialiser { name: "reference", run: reference::initialise },
];
