//! Pictures, and how much two of them differ.

use engine::image::{self, Image};
use engine::render::{
    Camera, CameraFile, ClipPlane, FOV_DEGREES, Intensities, Look, OF_VOLUMES, ObjectChange, Renderer, Scene,
    Settings as Quality, SplatKind, UsualLook, VolumeSource, mode,
};
use engine::transfer::{
    self, ColourPoint, FixedTo, Light, Material, OpacityPoint, PRESETS, TransferFunction,
};
use engine::volume::edges::Edges;
use engine::volume::{self, BetweenSlices};
use engine::{Error, Kind, memory};
use glam::DVec3;
use numpy::ndarray::Array3;
use numpy::{IntoPyArray, PyArray3, PyReadonlyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Deserialize;

use crate::device::{unlocked, with_device};
use crate::errors::{internal, raised};
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
    tf: Option<Function>,
    tf_shift: f64,
    camera: Eye,
    fov: Option<f64>,
    zoom: f64,
    shade: Option<bool>,
    occlusion: Option<f64>,
    light: Option<Lit>,
    fill_light: f64,
    box_mm: Option<[[f64; 3]; 2]>,
    /// Normals and offsets.
    planes: Vec<([f64; 3], f64)>,
    /// As flags: NAME:colour=#rrggbb,opacity=0.4.
    objects: Vec<String>,
    hide: Vec<String>,
    step: Option<f64>,
}

/// A transfer function.
#[derive(Deserialize)]
#[serde(untagged)]
enum Function {
    /// A preset, a file, or window:WIDTH,LEVEL.
    Named(String),
    /// Control points: intensity, red, green, blue, opacity per mm.
    Points { points: Vec<[f64; 5]> },
}

/// A camera.
#[derive(Deserialize)]
#[serde(untagged)]
enum Eye {
    Side(String),
    At(CameraFile),
}

/// Direction of the light: angles to the right and up from the viewer, or a side of the patient.
#[derive(Deserialize)]
#[serde(untagged)]
enum Lit {
    Angles([f64; 2]),
    Side(String),
}

fn usage(code: &'static str, message: impl Into<String>, help: &str) -> Error {
    Error::new(Kind::Usage, code, message).help(help)
}

impl Asked {
    fn check(&self) -> engine::Result<()> {
        if self.size.iter().any(|n| !(1..=WIDEST).contains(n)) {
            let message = format!("a picture of {} x {} pixels", self.size[0], self.size[1]);
            return Err(usage("VGS-PY-011", message, "1 to 16384 pixels are possible along each side"));
        }
        let bounds = [
            ("fov", self.fov, 0.01..=170.0),
            ("zoom", Some(self.zoom), 0.01..=1000.0),
            ("occlusion", self.occlusion, 0.0..=1.0),
            ("fill_light", Some(self.fill_light), 0.0..=transfer::MOST_FILL),
            ("step", self.step, 0.01..=100.0),
        ];
        for (name, value, range) in bounds {
            if let Some(value) = value.filter(|value| !range.contains(value)) {
                let help = format!("a number from {} to {} is needed", range.start(), range.end());
                return Err(usage("VGS-PY-012", format!("{name} is {value}"), &help));
            }
        }
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

    fn light(&self) -> engine::Result<Light> {
        let light = match &self.light {
            None => Light::default(),
            Some(Lit::Angles(angles)) => Light::at_angles(*angles),
            Some(Lit::Side(name)) if name == "head" => Light::HEAD,
            Some(Lit::Side(name)) => {
                let camera = Camera::from_side(name, DVec3::ZERO, 1.0, 30.0, 1.0)?;
                Light { fixed_to: FixedTo::Patient, towards: camera.eye.to_array(), fill: 0.0 }
            }
        };
        Ok(Light { fill: self.fill_light, ..light })
    }

    fn changed(&self, mut function: TransferFunction) -> engine::Result<TransferFunction> {
        if self.tf_shift != 0.0 {
            function = function.shifted(self.tf_shift)?;
        }
        function.material.shade = self.shade.unwrap_or(function.material.shade);
        function.material.occlusion = self.occlusion.unwrap_or(function.material.occlusion);
        Ok(function)
    }

    fn function(&self, range: [f64; 2], first: &str) -> engine::Result<TransferFunction> {
        match &self.tf {
            None => transfer::load(first, range),
            Some(Function::Named(name)) => transfer::load(name, range),
            Some(Function::Points { points }) => {
                let colour = |&[intensity, r, g, b, _]: &[f64; 5]| ColourPoint {
                    intensity,
                    colour: DVec3::new(r, g, b),
                };
                let opacity = |&[intensity, .., opacity]: &[f64; 5]| OpacityPoint { intensity, opacity };
                let material = Material { shade: true, ..Material::default() };
                let (colours, opacities) =
                    (points.iter().map(colour).collect(), points.iter().map(opacity).collect());
                TransferFunction::new("points", colours, opacities, material)
            }
        }
    }

    fn look(&self, splats: Option<&Splats>, range: [f64; 2], first: &str) -> engine::Result<Look> {
        let there = splats.map(|splats| splats.0.objects()).unwrap_or_default();
        let usual = splats.filter(|_| self.tf.is_none()).and_then(|splats| UsualLook::of(&splats.0));
        let mut look = match usual {
            Some(usual) => usual.look(&there),
            None => Look::new(self.function(range, first)?),
        };
        look.transfer = self.changed(look.transfer)?;
        for function in look.functions.values_mut() {
            *function = self.changed(function.clone())?;
        }
        look.light = self.light()?;
        if let Some(corners) = self.box_mm {
            let [a, b] = corners.map(DVec3::from_array);
            look.clip.extend(ClipPlane::around(a.min(b), a.max(b)));
        }
        for &(normal, offset) in &self.planes {
            let normal = DVec3::from_array(normal);
            let Some(unit) = normal.try_normalize() else {
                return Err(usage(
                    "VGS-PY-013",
                    "a plane without a direction",
                    "give a normal that is not zero",
                ));
            };
            look.clip.push(ClipPlane { normal: unit, offset: offset / normal.length() });
        }
        let change = |text: &String| {
            text.parse::<ObjectChange>()
                .map_err(|e| usage("VGS-PY-014", format!("the look of an object, {text:?}: {e}"), ""))
        };
        let changes = self.objects.iter().map(change).collect::<engine::Result<Vec<_>>>()?;
        for change in changes.into_iter().chain(self.hide.iter().map(|name| ObjectChange::hiding(name))) {
            change.apply(&there, &mut look, range)?;
        }
        Ok(look)
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
    let asked: Asked = serde_json::from_str(asked).map_err(|e| {
        raised(usage("VGS-PY-015", format!("the settings of the picture: {e}"), "see help(vgs.render)"))
    })?;
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
        // What hardly shows anything through the first preset is shown by one that does.
        let first = splats.map_or_else(
            || transfer::first(unit),
            |splats| Intensities::of_set(&splats.0).suiting_preset(unit),
        );
        let look = asked.look(splats, range.unwrap_or([0.0, 1.0]), first)?;
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
