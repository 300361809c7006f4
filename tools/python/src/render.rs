//! Pictures, and how much two of them differ.

use engine::image::{self, Image};
use engine::memory;
use engine::render::{
    Camera, CameraFile, FOV_DEGREES, OF_VOLUMES, Renderer, Scene, Settings as Quality, SplatKind,
    VolumeSource, mode,
};
use engine::transfer::PRESETS;
use engine::volume::edges::Edges;
use engine::volume::{self, BetweenSlices};
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Deserialize;

use crate::device::{unlocked, with_device};
use crate::errors::internal;
use crate::look::{AskedLook, parsed, usage, within};
use crate::splats::Splats;
use crate::volume::{Roi, Volume};

/// Host bytes that a pixel takes.
const BYTES_A_PIXEL: u64 = 40;
/// Greatest width or height, pixels.
const WIDEST: u32 = 16384;

/// What a picture is to be; JSON of `vgs/_render.py`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Asked {
    size: [u32; 2],
    mode: Option<String>,
    look: AskedLook,
    camera: Eye,
    fov: Option<f64>,
    zoom: f64,
    step: Option<f64>,
}

/// A camera.
#[derive(Deserialize)]
#[serde(untagged)]
enum Eye {
    Side(String),
    At(CameraFile),
}

impl Asked {
    fn check(&self) -> engine::Result<()> {
        if self.size.iter().any(|n| !(1..=WIDEST).contains(n)) {
            let message = format!("a picture of {} x {} pixels", self.size[0], self.size[1]);
            return Err(usage("VGS-PY-011", message, "1 to 16384 pixels are possible along each side"));
        }
        within(&[
            ("fov", self.fov, 0.01..=170.0),
            ("zoom", Some(self.zoom), 0.01..=1000.0),
            ("step", self.step, 0.01..=100.0),
        ])?;
        let pixels: u64 = self.size.iter().map(|&n| u64::from(n)).product();
        memory::require(pixels.saturating_mul(BYTES_A_PIXEL), "a picture of this size")
    }

    fn aspect(&self) -> f64 {
        f64::from(self.size[0]) / f64::from(self.size[1])
    }

    fn camera(&self, scene: &Scene) -> engine::Result<Camera> {
        let [low, high] = scene.bounds();
        match &self.camera {
            Eye::At(file) => file.camera(self.aspect()),
            Eye::Side(name) => {
                let radius = (high - low).length() * 0.5 / self.zoom;
                let fov = self.fov.unwrap_or(FOV_DEGREES);
                Camera::from_side(name, (low + high) * 0.5, radius, fov, self.aspect())
            }
        }
    }
}

/// Renders splats, or a volume in its region: [row, column, red green blue opacity], premultiplied, rows from the top.
#[pyfunction]
#[pyo3(signature = (asked, *, splats, volume, roi, device))]
pub fn render<'py>(
    py: Python<'py>,
    asked: &str,
    splats: Option<&Splats>,
    volume: Option<&Volume>,
    roi: Option<&Roi>,
    device: Option<&str>,
) -> PyResult<Bound<'py, PyArray3<f32>>> {
    let asked: Asked = parsed(asked, "render")?;
    if let (Some(roi), Some(volume)) = (roi, volume) {
        roi.check_on(&volume.0)?;
    }
    let drawn = || {
        asked.check()?;
        let kind = splats.map(|splats| SplatKind::of(&splats.0));
        let usual = kind.map_or(OF_VOLUMES, SplatKind::usual_mode);
        let row = mode(asked.mode.as_deref().unwrap_or(usual))?;
        if row.of_splats != splats.is_some() {
            let what = if row.of_splats { "splats" } else { "a volume" };
            let message = format!("mode {:?} renders {what}", row.name);
            return Err(usage(
                "VGS-PY-016",
                message,
                "leave mode out, and it is the one that suits what is rendered",
            ));
        }
        let range = match (splats, volume) {
            (Some(splats), _) => splats.0.intensity_range(),
            (None, Some(volume)) => volume.0.min_max().map(|(low, high)| [f64::from(low), f64::from(high)]),
            (None, None) => None,
        };
        let unit = match (splats, volume) {
            (Some(splats), _) => splats.0.unit,
            (None, Some(volume)) => volume.0.unit(),
            (None, None) => {
                return Err(usage("VGS-PY-017", "a picture of nothing", "give splats or a volume"));
            }
        };
        let look = asked.look.look(splats.map(|splats| &*splats.0), unit, range)?;
        let region = roi.map(|roi| &*roi.roi);
        let shown = volume.map(|of| volume::shown(&of.0, region, BetweenSlices::Smooth, Edges::default()));
        let source = shown.as_ref().map(|(volume, roi)| VolumeSource { volume, roi: roi.as_deref() });
        with_device(device, |gpu| {
            let scene = Scene::new(gpu, splats.map(|splats| &*splats.0), source.as_ref(), &look)?;
            let settings =
                Quality { step: asked.step.unwrap_or(row.step), precise: true, ..Quality::new(asked.size) };
            let mut renderer = Renderer::new(gpu, row, &scene, &settings)?;
            renderer.render(&scene, &[asked.camera(&scene)?])?;
            renderer.target.read_colour(0)
        })
    };
    let pixels = unlocked(py, drawn)?;
    let [width, height] = asked.size.map(|n| n as usize);
    let flat = bytemuck::cast_vec::<[f32; 4], f32>(pixels);
    let picture = Array3::from_shape_vec((height, width, 4), flat).map_err(internal)?;
    Ok(picture.into_pyarray(py))
}

/// Returns the presets: for each its name, what it is for, and the unit of its intensities.
#[pyfunction]
pub fn transfer_functions() -> Vec<(&'static str, &'static str, &'static str)> {
    PRESETS.iter().map(|preset| (preset.name, preset.about, preset.unit.name())).collect()
}

/// Compares two pictures [row, column, red green blue] of numbers from 0 to 1.
#[pyfunction]
pub fn compare_pictures<'py>(
    py: Python<'py>,
    a: PyReadonlyArray3<'_, f32>,
    b: PyReadonlyArray3<'_, f32>,
) -> PyResult<Bound<'py, PyDict>> {
    let [a, b] = [a, b].map(|picture| {
        let view = picture.as_array();
        let [height, width] = [view.shape()[0], view.shape()[1]];
        let pixels = view.rows().into_iter().map(|pixel| [pixel[0], pixel[1], pixel[2], 1.0]).collect();
        Image { size: [width, height], pixels }
    });
    let measured = || Ok((image::psnr(&a, &b)?, image::ssim(&a, &b)?, image::flip(&a, &b)?.mean));
    let (psnr_db, ssim, flip) = unlocked(py, measured)?;
    let dictionary = PyDict::new(py);
    dictionary.set_item("psnr_db", psnr_db)?;
    dictionary.set_item("ssim", ssim)?;
    dictionary.set_item("flip", flip)?;
    Ok(dictionary)
}
