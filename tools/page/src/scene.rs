//! What a page is told of its scene: the JSON in it. `web/types.ts` has the same names.

use engine::Result;
use engine::render::{Camera, CameraFile, ClipPlane};
use engine::transfer::{FixedTo, Light, Material, TransferFunction};
use glam::DVec3;
use serde::{Deserialize, Serialize};

/// What a page shows, and how at first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Scene {
    /// Name and version of the program that wrote it.
    pub program: String,
    /// Title, for people.
    pub title: String,
    /// Name of the unit of the intensities ([`engine::unit::Unit::name`]).
    pub unit: String,
    /// What the data are, in their order.
    pub parts: Vec<Part>,
    /// Objects, by ascending number.
    pub objects: Vec<SceneObject>,
    /// Transfer function of all objects without one of their own.
    pub function: Function,
    /// Transfer functions to choose from.
    pub presets: Vec<Function>,
    /// Where light comes from.
    pub light: SceneLight,
    /// Clip planes.
    pub clip: Vec<Plane>,
    /// Where the scene is seen from at first.
    pub camera: Viewpoint,
    /// Background, display-referred, 0 to 1.
    pub background: [f64; 3],
}

/// How a part is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PartKind {
    /// A file of splats, `.vgs`.
    Vgs,
    /// A decoded field (`src/voxels.rs`).
    Voxels,
}

/// A set of splats, or a field.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Part {
    /// How it is stored.
    pub kind: PartKind,
    /// Its size, bytes.
    pub bytes: u64,
    /// Label, and number of the object that it is; label 0 stands for all where there are no labels.
    pub numbers: Vec<[u8; 2]>,
}

/// Object of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct SceneObject {
    /// Number by which parts name it.
    pub number: u8,
    /// Name, for people.
    pub name: String,
    /// True if it is shown at first.
    pub visible: bool,
    /// Colour in place of the function's, display-referred, 0 to 1.
    pub tint: Option<[f32; 3]>,
    /// Factor of the opacity per mm, 0 to 1.
    pub opacity: f32,
    /// Transfer function of its own.
    pub function: Option<Function>,
}

/// Transfer function.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Function {
    /// Name, for people.
    pub name: String,
    /// Intensity, red, green, blue, by rising intensity.
    pub colours: Vec<[f64; 4]>,
    /// Intensity, opacity per mm, by rising intensity.
    pub opacities: Vec<[f64; 2]>,
    /// Magnitude of the gradient, factor of the opacity.
    pub gradient_opacities: Vec<[f64; 2]>,
    /// Reflection of light.
    pub material: Material,
}

/// Light.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct SceneLight {
    /// Unit vector towards the key light, in the space of what it is fixed to.
    pub direction: [f64; 3],
    /// What it is fixed to.
    pub fixed_to: FixedTo,
    /// Share of the fill light.
    pub fill: f64,
}

/// Clip plane: points with normal · x < offset are cut away.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Plane {
    /// Unit vector, RAS.
    pub normal: [f64; 3],
    /// Offset along it, mm.
    pub offset: f64,
}

/// Where a scene is seen from.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
pub struct Viewpoint {
    /// Place of the eye, mm RAS.
    pub eye: [f64; 3],
    /// Place in the middle of the picture, about which it turns, mm RAS.
    pub target: [f64; 3],
    /// Direction that is upwards in the picture.
    pub up: [f64; 3],
    /// Angle from the upper to the lower edge, degrees.
    pub field_of_view: f64,
}

impl Viewpoint {
    /// Returns the viewpoint from a side of the patient ([`Camera::from_side`]) that has a box between two corners, mm RAS,
    /// in a square picture; `zoom` times as near as shows all of it.
    ///
    /// # Errors
    /// Returns the errors of [`Camera::from_side`].
    pub fn from_side(name: &str, [low, high]: [DVec3; 2], degrees: f64, zoom: f64) -> Result<Self> {
        let (centre, radius) = ((low + high) * 0.5, (high - low).length() * 0.5 / zoom);
        let camera = Camera::from_side(name, centre, radius, degrees, 1.0)?;
        Ok(Viewpoint {
            eye: camera.eye.to_array(),
            target: centre.to_array(),
            up: camera.up.to_array(),
            field_of_view: degrees,
        })
    }

    /// Returns the viewpoint of a file of a camera.
    ///
    /// # Errors
    /// Returns the errors of [`CameraFile::camera`].
    pub fn of_file(file: &CameraFile) -> Result<Self> {
        let camera = file.camera(1.0)?;
        Ok(Viewpoint {
            eye: file.eye_mm,
            target: file.target_mm,
            up: camera.up.to_array(),
            field_of_view: file.fov_deg,
        })
    }
}

impl From<&TransferFunction> for Function {
    fn from(function: &TransferFunction) -> Self {
        let pairs = |points: &[engine::transfer::OpacityPoint]| {
            points.iter().map(|point| [point.intensity, point.opacity]).collect()
        };
        let colour = |point: &engine::transfer::ColourPoint| {
            let [r, g, b] = point.colour.to_array();
            [point.intensity, r, g, b]
        };
        Function {
            name: function.name.clone(),
            colours: function.colours().iter().map(colour).collect(),
            opacities: pairs(function.opacities()),
            gradient_opacities: pairs(function.gradient_opacities()),
            material: function.material,
        }
    }
}

impl From<&Light> for SceneLight {
    fn from(light: &Light) -> Self {
        SceneLight { direction: light.direction().to_array(), fixed_to: light.fixed_to, fill: light.fill }
    }
}

impl From<&ClipPlane> for Plane {
    fn from(plane: &ClipPlane) -> Self {
        Plane { normal: plane.normal.to_array(), offset: plane.offset }
    }
}
