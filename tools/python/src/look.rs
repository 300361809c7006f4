//! How splats or a volume are to be shown: transfer functions, light, objects, cuts.

use std::ops::RangeInclusive;

use engine::render::{Camera, ClipPlane, Intensities, Look, ObjectChange, UsualLook};
use engine::splat::SplatSet;
use engine::transfer::{self, ColourPoint, FixedTo, Light, Material, OpacityPoint, TransferFunction};
use engine::unit::Unit;
use engine::{Error, Kind};
use glam::DVec3;
use pyo3::prelude::*;
use serde::Deserialize;
use serde::de::DeserializeOwned;

use crate::errors::raised;

/// A look; JSON of `vgs/_look.py`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AskedLook {
    tf: Option<Function>,
    tf_shift: f64,
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

/// Direction of the light: angles to the right and up from the viewer, or a side of the patient.
#[derive(Deserialize)]
#[serde(untagged)]
enum Lit {
    Angles([f64; 2]),
    Side(String),
}

/// Returns what a function of Python was asked, as JSON.
pub fn parsed<T: DeserializeOwned>(asked: &str, function: &str) -> PyResult<T> {
    serde_json::from_str(asked).map_err(|e| {
        raised(usage("VGS-PY-015", format!("the settings: {e}"), &format!("see help(vgs.{function})")))
    })
}

pub fn usage(code: &'static str, message: impl Into<String>, help: &str) -> Error {
    Error::new(Kind::Usage, code, message).help(help)
}

/// Fails for numbers that are given and are not in their range.
pub fn within(numbers: &[(&str, Option<f64>, RangeInclusive<f64>)]) -> engine::Result<()> {
    for (name, value, range) in numbers {
        if let Some(value) = value.filter(|value| !range.contains(value)) {
            let help = format!("a number from {} to {} is needed", range.start(), range.end());
            return Err(usage("VGS-PY-012", format!("{name} is {value}"), &help));
        }
    }
    Ok(())
}

impl AskedLook {
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

    /// Returns the look of splats, or of a volume of this unit. `range` is that of the intensities.
    ///
    /// # Errors
    /// [`Kind::Usage`], and those of reading files of transfer functions.
    pub fn look(
        &self,
        splats: Option<&SplatSet>,
        unit: Unit,
        range: Option<[f64; 2]>,
    ) -> engine::Result<Look> {
        within(&[
            ("occlusion", self.occlusion, 0.0..=1.0),
            ("fill_light", Some(self.fill_light), 0.0..=transfer::MOST_FILL),
        ])?;
        let range = range.unwrap_or([0.0, 1.0]);
        // What hardly shows anything through the first preset is shown by one that does.
        let first = splats
            .map_or_else(|| transfer::first(unit), |splats| Intensities::of_set(splats).suiting_preset(unit));
        let there = splats.map(SplatSet::objects).unwrap_or_default();
        let usual = splats.filter(|_| self.tf.is_none()).and_then(UsualLook::of);
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
