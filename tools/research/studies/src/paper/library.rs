//! Reads the cases of the data folder, each one once.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use engine::Result;
use engine::volume::Bricks;

use bench::scene::{Scene, help};

/// Case with one of its masks, and figures that runs and estimates need.
pub struct Place {
    /// Volume and region of interest.
    pub scene: Scene,
    /// Sum of the mask: its number of voxels if it is binary.
    pub voxels: f64,
    /// Bricks of the region and its shell.
    pub bricks: usize,
    /// Cube of the mean voxel spacing over the volume of a voxel: an initial splat measured in spacings
    /// covers this many times the voxels of one measured in voxels.
    pub aspect: f64,
    /// Least and greatest value of the whole volume.
    pub range: [f32; 2],
    /// Least and greatest value of the region, where the mask is above 1 %.
    pub region_range: [f32; 2],
}

impl Place {
    /// Creates a place from a volume with its region.
    pub fn new(scene: Scene) -> Self {
        let spacing = scene.volume.spacing_mm();
        Place {
            voxels: scene.roi.weight_sum(),
            bricks: Bricks::around(&scene.roi, 4).len(),
            aspect: (spacing.element_sum() / 3.0).powi(3) / spacing.element_product(),
            region_range: scene.roi.range(&scene.volume).unwrap_or_default(),
            range: scene.volume.min_max().map(|(low, high)| [low, high]).unwrap_or_default(),
            scene,
        }
    }
}

/// Cases by folder and mask.
pub struct Library {
    folder: PathBuf,
    places: BTreeMap<(String, String), Place>,
}

impl Library {
    /// Creates the library of a data folder: `CASE/ct.nii.gz` with `CASE/MASK.nii.gz` beside it.
    pub fn new(folder: &Path) -> Self {
        Library { folder: folder.to_owned(), places: BTreeMap::new() }
    }

    /// Creates a library with the phantom in place of every case.
    #[cfg(test)]
    pub fn phantom(cases: &[(&str, &str)]) -> Self {
        let place = || Place::new(Scene::phantom(24).expect("a phantom"));
        let key = |&(folder, mask): &(&str, &str)| (folder.to_owned(), mask.to_owned());
        Library { folder: PathBuf::new(), places: cases.iter().map(|case| (key(case), place())).collect() }
    }

    /// Returns the case; reads it if it was not read yet.
    pub fn place(&mut self, folder: &str, mask: &str) -> Result<&Place> {
        let key = (folder.to_owned(), mask.to_owned());
        if !self.places.contains_key(&key) {
            eprintln!("reading {folder} {mask}");
            let inside = |file: &str| self.folder.join(folder).join(format!("{file}.nii.gz"));
            let place = Place::new(Scene::read(&inside("ct"), &inside(mask)).map_err(help)?);
            self.places.insert(key.clone(), place);
        }
        Ok(&self.places[&key])
    }
}
