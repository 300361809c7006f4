//! Scenes to measure: a volume with its region of interest, and splats that were fitted to it for a while.
//! The cost of a pass depends on the shapes of the splats, and those of a fit differ from those it starts
//! from.

use std::path::Path;

use engine::fit::{FitConfig, Problem, Scaling, Start};
use engine::gpu::Gpu;
use engine::splat::{self, Splat, SplatSet};
use engine::volume::phantom::Phantom;
use engine::volume::{Bricks, LabelChoice, ReadOptions, Roi, Volume};
use engine::{Error, Kind, Result};
use glam::DVec3;

/// Samples that a fit of the default profile evaluates for each voxel of the region.
pub const SAMPLES_A_VOXEL: f64 = 25.0;
/// Cost of a small splat in addition, as a number of samples.
pub const SMALL_SPLAT: f64 = 150.0;
/// Samples that two CPU cores evaluate in a second.
pub const EVALUATIONS_A_SECOND: f64 = 1e8;

/// Reads the splats of a file, the most important first.
pub fn splats_by_importance(path: &Path) -> Result<SplatSet> {
    let mut set = splat::read_some(path)?.placed(None)?;
    set.order_by_importance();
    Ok(set)
}

/// Adds to the error of a missing file what `--data` should contain.
pub fn help(error: Error) -> Error {
    match error.kind {
        Kind::Missing => {
            error.help("--data is a folder that has a folder for each case: ct-thorax-1p5mm and others")
        }
        _ => error,
    }
}

/// Volume with its region of interest.
pub struct Scene {
    /// Name for tables.
    pub name: String,
    /// The volume.
    pub volume: Volume,
    /// Its region of interest.
    pub roi: Roi,
}

impl Scene {
    /// Creates the seeded synthetic CT of `edge`³ voxels.
    pub fn phantom(edge: usize) -> Result<Self> {
        let phantom = Phantom::new([edge; 3], DVec3::ONE, 1);
        Ok(Scene { name: format!("phantom {edge}³"), volume: phantom.volume(), roi: phantom.roi()? })
    }

    /// Reads a CT and its mask.
    pub fn read(volume: &Path, mask: &Path) -> Result<Self> {
        let options = ReadOptions::default();
        let read = Volume::read(volume, &options)?;
        let roi = Roi::from_mask(&Volume::read(mask, &options)?, &LabelChoice::Whole, &read)?;
        Ok(Scene { name: volume.display().to_string(), volume: read, roi })
    }

    /// Returns the splats after `iterations` steps of a fit, in the fit's own coordinates, with its sample
    /// grid.
    pub fn fitted(&self, gpu: &Gpu, density: f64, iterations: u32) -> Result<Fitted> {
        let config = FitConfig::default().with(|c| {
            c.iterations = iterations;
            c.count.density = density;
        });
        let problem = Problem::new(&self.volume, &self.roi, &config)?;
        let mut fitter = problem.fitter(gpu, &Start::First(problem.first_splats()?))?;
        fitter.run_to(iterations, problem.schedule())?;
        let scaling: Scaling = *fitter.scaling();
        let origin = fitter.bricks().origin.as_vec3().to_array();
        let splats = fitter
            .splats()?
            .iter()
            .map(|s| Splat {
                mean: std::array::from_fn(|i| s.mean[i] - origin[i]),
                intensity: scaling.value(s.intensity),
                ..*s
            })
            .collect();
        Ok(Fitted { config, splats, bricks: fitter.bricks().clone() })
    }
}

/// Splats as a fit has them on the device.
pub struct Fitted {
    /// The fit's configuration.
    pub config: FitConfig,
    /// Splats in brick-grid coordinates, with intensities as the fit scales them.
    pub splats: Vec<Splat>,
    /// The sample grid.
    pub bricks: Bricks,
}
