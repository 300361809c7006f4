//! Scenes to render: volumes with their regions, splats (fitted once and kept), cameras and transfer
//! functions.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use engine::fit::{self, FitConfig};
use engine::gpu::{Gpu, GpuOptions};
use engine::image::Image;
use engine::render::{Camera, Look, Rays, Renderer, Scene, Settings};
use engine::splat::harmonics::{MAX_DEGREE, SH0, basis_count};
use engine::splat::{self, Harmonics, SplatSet};
use engine::transfer::{TransferFunction, preset};
use engine::volume::{Roi, Volume};
use engine::{Error, Kind, Result};
use glam::DVec3;

use super::config::{Case, Orbit, Rendering, Transfer};
use super::plan::{Source, Unit, mode_row};
use crate::cost::{self, Cost};
use crate::scene::{EVALUATIONS_A_SECOND, SAMPLES_A_VOXEL, SMALL_SPLAT, help};
use crate::store::hash;

/// Volume and region of a case, with figures that cameras and transfer functions need.
pub struct Place {
    /// Volume.
    pub volume: Volume,
    /// Region of interest.
    pub roi: Roi,
    /// Least and greatest intensity of the whole volume.
    pub range: [f64; 2],
    /// Median intensity of the region.
    pub middle: f64,
    /// Centre of the box around the region, mm RAS.
    pub centre: DVec3,
    /// Distance from `centre` to the farthest corner of a voxel of the region, mm.
    pub radius: f64,
}

impl Place {
    /// Creates a place from a volume with its region.
    pub fn new(volume: Volume, roi: Roi) -> Self {
        let [width, height, _] = volume.size;
        let inside = || {
            let at = move |i: usize| {
                DVec3::new((i % width) as f64, (i / width % height) as f64, (i / (width * height)) as f64)
            };
            roi.weight.iter().enumerate().filter(|&(_, &weight)| weight > 0.0).map(move |(i, _)| (i, at(i)))
        };
        let world = volume.world_from_voxel;
        let (low, high) = inside().fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), (_, voxel)| {
            let place = world.transform_point3(voxel);
            (low.min(place), high.max(place))
        });
        let centre = (low + high) * 0.5;
        let farthest =
            inside().map(|(_, voxel)| world.transform_point3(voxel).distance(centre)).fold(0.0, f64::max);
        let corner = world.matrix3 * DVec3::splat(0.5);
        let mut values: Vec<f32> =
            inside().map(|(i, _)| volume.samples[i]).filter(|v| v.is_finite()).collect();
        let half = values.len() / 2;
        let middle = if values.is_empty() {
            0.0
        } else {
            f64::from(*values.select_nth_unstable_by(half, f32::total_cmp).1)
        };
        let range = volume.min_max().map_or([0.0, 1.0], |(low, high)| [low, high].map(f64::from));
        Place { range, middle, centre, radius: farthest + corner.length(), volume, roi }
    }

    fn read(case: &Case, data: &Path) -> Result<Self> {
        let scene = match case.phantom {
            Some(edge) => crate::scene::Scene::phantom(edge)?,
            None => {
                let folder = data.join(&case.folder);
                crate::scene::Scene::read(&folder.join(&case.volume), &folder.join(&case.mask))
                    .map_err(help)?
            }
        };
        Ok(Place::new(scene.volume, scene.roi))
    }

    /// Returns the cameras of these views of an orbit; the region fills each picture.
    pub fn cameras(&self, orbit: &Orbit, views: &[usize]) -> Result<Vec<Camera>> {
        let front = Camera::from_side("anterior", self.centre, self.radius, orbit.fov, 1.0)?;
        let camera = |&view: &usize| {
            let elevation = if view.is_multiple_of(2) { orbit.elevation } else { -orbit.elevation };
            let azimuth = 360.0 / orbit.count as f64 * view as f64;
            front.turned(self.centre, front.right, -elevation.to_radians()).turned(
                self.centre,
                DVec3::Z,
                azimuth.to_radians(),
            )
        };
        Ok(views.iter().map(camera).collect())
    }

    /// Creates the transfer function for this volume.
    pub fn transfer(&self, transfer: &Transfer) -> Result<TransferFunction> {
        let mut function = match (&transfer.preset, transfer.band) {
            (Some(name), _) => preset(name)?.over(self.range),
            (None, width) => {
                // A band is the preset for bands, moved to the median intensity.
                let band = preset(BAND)?.over(self.range);
                let half = width.unwrap_or(0.0) * 0.5;
                let from = band.visible().unwrap_or_default();
                band.stretched(from, [self.middle - half, self.middle + half])?
            }
        };
        if let Some(shade) = transfer.shade {
            function.material.shade = shade;
        }
        Ok(function)
    }

    /// Returns the bytes of the volume, see [`volume_bytes`].
    pub fn bytes(&self) -> u64 {
        volume_bytes(&self.roi)
    }
}

/// Name of the preset that is a band of intensities.
const BAND: &str = "CT-Skin";

/// Returns the bytes of a volume that is cropped to the box of its region and a voxel around it, with 16 bits
/// of intensity and 8 of mask per voxel.
pub fn volume_bytes(roi: &Roi) -> u64 {
    let [width, height, _] = roi.size;
    let (mut low, mut high) = ([usize::MAX; 3], [0; 3]);
    for (i, _) in roi.weight.iter().enumerate().filter(|&(_, &weight)| weight > 0.0) {
        for (axis, at) in [i % width, i / width % height, i / (width * height)].into_iter().enumerate() {
            (low[axis], high[axis]) = (low[axis].min(at), high[axis].max(at));
        }
    }
    let edge = |axis: usize| (high[axis] + 2).min(roi.size[axis]) - low[axis].saturating_sub(1);
    if low[0] > high[0] { 0 } else { (0..3).map(|axis| edge(axis) as u64).product::<u64>() * 3 }
}

/// Cases and splats, read from files or made.
pub struct Library<'a> {
    data: &'a Path,
    /// Folder of the fitted splats.
    splats: PathBuf,
    options: &'a GpuOptions,
    /// Case that was read last; units of one case follow each other.
    last: Option<(Case, Place)>,
}

impl<'a> Library<'a> {
    /// Opens the data folder and creates the folder `splats` for fitted splats.
    pub fn new(data: &'a Path, splats: &Path, options: &'a GpuOptions) -> Result<Self> {
        std::fs::create_dir_all(splats).map_err(|e| Error::io(splats, "making the folder", &e))?;
        Ok(Library { data, splats: splats.to_owned(), options, last: None })
    }

    /// Returns the case; reads it if it is not the last one that was read.
    pub fn place(&mut self, case: &Case) -> Result<&Place> {
        if self.last.as_ref().is_none_or(|(last, _)| last != case) {
            // The last case is dropped first: two may not fit into memory.
            self.last = None;
            eprintln!("    reading {}", case.source());
            self.last = Some((case.clone(), Place::read(case, self.data)?));
        }
        Ok(&self.last.as_ref().expect("it was just read").1)
    }

    /// Estimates the seconds that the fit of a unit takes on two cores; 0 if its splats are there.
    pub fn fit_seconds(&mut self, unit: &Unit) -> Result<f64> {
        let Source::Fit(config) = &unit.source else { return Ok(0.0) };
        if self.path(&unit.case, config).exists() {
            return Ok(0.0);
        }
        let voxels = self.place(&unit.case)?.roi.weight_sum();
        let samples = voxels * SAMPLES_A_VOXEL + config.splat_count(voxels) as f64 * SMALL_SPLAT;
        Ok(f64::from(config.iterations) * 2.0 * samples / EVALUATIONS_A_SECOND)
    }

    /// Returns the splats of a unit, fitted if they are not there, with its case.
    pub fn splats(&mut self, unit: &Unit) -> Result<(SplatSet, &Place)> {
        let path = match &unit.source {
            Source::File(path, _) => path.clone(),
            Source::Fit(config) => self.fitted(&unit.case, config)?,
        };
        let mut set = splat::read_some(&path)?.placed(None)?;
        let place = self.place(&unit.case)?;
        if unit.coloured && set.colours.is_none() {
            set.colours = Some(colours(&set, &place.transfer(&unit.transfers[0])?));
        }
        Ok((set, place))
    }

    /// Returns the path of a fit's splats; fits them if the file is missing.
    pub fn fitted(&mut self, case: &Case, config: &FitConfig) -> Result<PathBuf> {
        let path = self.path(case, config);
        if !path.exists() {
            let gpu = Gpu::new(self.options)?;
            let place = self.place(case)?;
            let count = config.splat_count(place.roi.weight_sum());
            eprintln!("    fitting {count} splats, {} iterations", config.iterations);
            let set = fit::run(&gpu, &place.volume, &place.roi, config, |_| ControlFlow::Continue(()))?;
            // The splats are always read back, so that later runs measure the same.
            splat::write(&path, &set, true)?;
        }
        Ok(path)
    }

    fn path(&self, case: &Case, config: &FitConfig) -> PathBuf {
        let name: String =
            case.name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect();
        let amount = if config.count.splats > 0 {
            config.count.splats.to_string()
        } else {
            config.count.density.to_string()
        };
        // The name of a case is not part of its contents.
        let content = (&case.folder, &case.volume, &case.mask, case.phantom, config);
        self.splats.join(format!("{name}-{amount}-{}.ply", hash(&content)))
    }
}

/// Returns spherical harmonics of the degree of standard splats, which show from all sides the colours of the
/// transfer function: as many bytes and operations as for a scene that was learned from pictures.
fn colours(set: &SplatSet, transfer: &TransferFunction) -> Harmonics {
    let mut coefficients = vec![0.0; set.splats.len() * basis_count(MAX_DEGREE) * 3];
    for (splat, row) in set.splats.iter().zip(coefficients.chunks_mut(basis_count(MAX_DEGREE) * 3)) {
        let (colour, _) = transfer.at(f64::from(splat.intensity));
        row[..3].copy_from_slice(&((colour.as_vec3() - 0.5) / SH0).to_array());
    }
    Harmonics { degree: MAX_DEGREE, coefficients }
}

/// Renderer whose frames are measured.
pub struct TimedRenderer {
    gpu: Gpu,
    renderer: Renderer,
}

impl TimedRenderer {
    /// Creates a renderer. If `precise`, colour is stored in floats, for comparisons; otherwise in halves, as
    /// for a screen.
    ///
    /// # Panics
    /// Panics if this build lacks the mode; plans contain none such.
    pub fn new(
        gpu: &Gpu,
        scene: &Scene,
        rendering: &Rendering,
        size: u32,
        views: u32,
        precise: bool,
    ) -> Result<Self> {
        let row = mode_row(rendering).expect("a plan has modes that are there");
        let settings = Settings {
            views,
            precise,
            step: rendering.step,
            classification: rendering.classification.map(Into::into),
            rays: if rendering.computed { Rays::Computed } else { Rays::Rasterized },
            ..Settings::new([size; 2])
        };
        Ok(TimedRenderer { gpu: gpu.clone(), renderer: Renderer::new(gpu, row, scene, &settings)? })
    }

    /// Renders a frame, waits for it and returns its cost and passes.
    pub fn frame(&mut self, scene: &Scene, cameras: &[Camera]) -> Result<(Cost, cost::Passes)> {
        cost::measure(&self.gpu, || self.renderer.render(scene, cameras))
    }

    /// Gives the scene a look, renders a frame of it, and returns the cost of both.
    pub fn change(&mut self, scene: &mut Scene, look: &Look, camera: Camera) -> Result<Cost> {
        let both = || {
            scene.set_look(look)?;
            self.renderer.render(scene, &[camera])
        };
        cost::measure(&self.gpu, both).map(|(cost, _)| cost)
    }

    /// Reads the colour of the last frame.
    pub fn picture(&self, view: u32) -> Result<Image> {
        let size = self.renderer.target.size().map(|n| n as usize);
        Ok(Image { size, pixels: self.renderer.target.read_colour(view)? })
    }
}

/// Returns true if anything is visible in a picture with 256 steps of opacity.
pub fn shows_something(picture: &Image) -> bool {
    picture.pixels.iter().any(|p| p[3] >= 1.0 / 255.0)
}

/// Returns an error if the validation layers have reported a breach of Vulkan's rules. There are messages
/// only if the layers are on, as in tests.
pub fn check_validation(gpu: &Gpu) -> Result<()> {
    match gpu.validation_messages().first() {
        None => Ok(()),
        Some(first) => {
            Err(Error::new(Kind::Internal, "VGS-BEN-028", format!("the validation layers say: {first}")))
        }
    }
}

/// Returns true if all pixels are finite numbers.
pub fn is_finite(picture: &Image) -> bool {
    picture.pixels.iter().flatten().all(|v| v.is_finite())
}
