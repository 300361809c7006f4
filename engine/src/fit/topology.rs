//! How the number and the places of the splats change during a fit. A row of [`TOPOLOGIES`] is a function from what is
//! there to what shall be; the fit calls it between two iterations, as often as its configuration says.

use rand_pcg::Pcg64;

use super::FitConfig;
use super::evaluate::FieldSample;
use crate::splat::Splat;
use crate::volume::{Bricks, Roi, Volume};

/// What a change may look at. Voxel space, HU.
pub struct Scene<'a> {
    /// The volume that is fitted.
    pub volume: &'a Volume,
    /// Its region of interest.
    pub roi: &'a Roi,
    /// Hyper-parameters.
    pub config: &'a FitConfig,
    /// All splats.
    pub splats: &'a [Splat],
    /// Σ |dL/dμ| of each splat since the last change.
    pub gradient_norms: &'a [f32],
    /// The sample grid.
    pub bricks: &'a Bricks,
    /// The field of the splats at the voxel centres, [slot][Morton place].
    pub samples: &'a [FieldSample],
    /// Part of the schedule that is done, 0..1.
    pub share: f64,
    /// The most splats there may be.
    pub limit: usize,
}

/// The splats after a change.
#[derive(Clone, Debug, Default)]
pub struct Change {
    /// All of them. Voxel space, HU.
    pub splats: Vec<Splat>,
    /// For each the old one whose moments of Adam it keeps; a new one starts without.
    pub keeps: Vec<Option<u32>>,
}

/// A row of [`TOPOLOGIES`].
pub struct Topology {
    /// Name in configurations.
    pub name: &'static str,
    /// What a change does; nothing where splats stay what they are.
    pub change: Option<fn(&Scene, &mut Pcg64) -> Change>,
}

/// Every way; the first is the default.
pub const TOPOLOGIES: &[Topology] = &[Topology { name: "none", change: None }];
