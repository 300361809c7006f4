//! What the attributes of a group say of its image.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3, DVec3};
use serde_json::{Map, Value};

use super::store::bad;
use crate::fields::FieldRow;
use crate::text_header::excerpt;
use base::{Error, Result};

/// What is done with the attributes.
pub(crate) const FIELDS: &[FieldRow] = &[
    FieldRow::needed(
        "multiscales",
        "the images of the group, of which the first is read; below 'ome' in 0.5",
        &["{}", "[]", "7"],
    ),
    FieldRow::needed(
        "axes",
        "of the arrays, slowest first: three of type space; the others, as t and c, count volumes",
        &[
            "7",
            "[]",
            "[\"z\", 7, \"x\"]",
            "[{\"name\": \"y\", \"type\": \"space\"}, {\"name\": \"x\", \"type\": \"space\"}]",
        ],
    ),
    FieldRow::with_default(
        "unit",
        "of an axis of space: nanometer, micrometer, millimeter, centimeter or meter",
        "mm, a note",
        &["\"parsec\"", "7"],
    ),
    FieldRow::with_default(
        "orientation",
        "direction of an axis in the patient, as right-to-left; counts if all three have one",
        "orientation unknown",
        &["{\"type\": \"anatomical\", \"value\": \"up\"}", "7"],
    ),
    FieldRow::needed("datasets", "the resolutions, finest first", &["[]", "7", "[7]"]),
    FieldRow::needed("path", "of the array of a resolution, in the group", &["7", "\"../0\"", "\"/0\""]),
    FieldRow::needed(
        "coordinateTransformations",
        "of a resolution, and then of all: one scale, and one translation or none",
        &[
            "7",
            "[]",
            "[{\"type\": \"scale\", \"scale\": [1, 0, 1]}]",
            "[{\"type\": \"scale\", \"scale\": [1, 1]}]",
            "[{\"type\": \"scale\", \"path\": \"scale\"}]",
            "[{\"type\": \"affine\", \"affine\": []}]",
        ],
    ),
    FieldRow::with_default(
        "world_from_voxel",
        "rows of the affine of the finest resolution, mm RAS, as vgs writes it below 'vgs'",
        "the axes tell",
        &["7", "[[1, 0, 0, 0]]", "[[1, 0, 0, 0], [0, 0, 0, 0], [0, 0, 1, 0]]"],
    ),
    FieldRow::unused("omero", "not used: how others show the image"),
];

/// One array of an image.
#[derive(Clone, Debug)]
pub(super) struct LevelRow {
    /// Path of the array in the group.
    pub path: String,
    /// Map from voxel index to world, mm RAS.
    pub world_from_voxel: DAffine3,
}

/// An image.
#[derive(Clone, Debug)]
pub(super) struct Image {
    /// Number of axes of its arrays.
    pub axes: usize,
    /// Which of them are x, y and z.
    pub space: [usize; 3],
    pub levels: Vec<LevelRow>,
    /// True if the file says how the patient lies.
    pub oriented: bool,
    /// Names of label values.
    pub labels: BTreeMap<i32, String>,
    pub notes: Vec<String>,
}

fn wrong(field: &str, found: &Value, needed: &str) -> Error {
    let found = excerpt(&found.to_string()).to_string();
    bad("VGS-ZAR-003", format!("'{field}' is {found}; {needed}")).help(
        "correct the attributes (zarr.json or .zattrs), or export the image again as OME-Zarr 0.4 or 0.5",
    )
}

impl Image {
    /// Reads the attributes of a group; `nodes` lists what is in the group, for the error if it is no image.
    pub fn of(attributes: &Map<String, Value>, nodes: impl FnOnce() -> Vec<String>) -> Result<Image> {
        let ome = match attributes.get("ome") {
            Some(Value::Object(ome)) => ome,
            _ => attributes,
        };
        let Some(multiscales) = ome.get("multiscales") else {
            let nodes = nodes();
            let inside = match nodes.is_empty() {
                true => String::new(),
                false => format!("; inside of it are {}", excerpt(&nodes.join(", "))),
            };
            return Err(bad("VGS-ZAR-001", format!("no image: the group has no 'multiscales'{inside}"))
                .help("give the path of the image itself, such as store.zarr/0 or store.zarr/labels/liver"));
        };
        let needed = "a list of images is needed";
        let first = multiscales.get(0).and_then(Value::as_object);
        let image = first.ok_or_else(|| wrong("multiscales", multiscales, needed))?;
        let mut notes = Vec::new();
        if multiscales.as_array().is_some_and(|all| all.len() > 1) {
            notes.push("the group has several images, of which the first is read".to_owned());
        }
        let axes = Axes::of(image.get("axes").unwrap_or(&Value::Null), &mut notes)?;
        let common = match image.get("coordinateTransformations") {
            Some(found) => Transform::of(found, axes.count, false)?,
            None => Transform::none(axes.count),
        };
        let datasets = image.get("datasets").unwrap_or(&Value::Null);
        let rows = datasets.as_array().filter(|rows| !rows.is_empty());
        let rows = rows.ok_or_else(|| wrong("datasets", datasets, "a list of arrays is needed"))?;
        let mut levels: Vec<LevelRow> = Vec::new();
        let mut own = None;
        for row in rows {
            let row =
                row.as_object().ok_or_else(|| wrong("datasets", row, "objects with a path are needed"))?;
            let path = row.get("path").unwrap_or(&Value::Null);
            let inside = |path: &&str| {
                let mut parts = path.split('/');
                parts.all(|part| !matches!(part, "" | "." | ".."))
            };
            let path = path
                .as_str()
                .filter(inside)
                .ok_or_else(|| wrong("path", path, "the path of an array inside of the group is needed"))?;
            let found = row.get("coordinateTransformations").unwrap_or(&Value::Null);
            let of_level = Transform::of(found, axes.count, true)?.then(&common);
            let (scale, translation) = (axes.space_of(&of_level.scale), axes.space_of(&of_level.translation));
            let lengths = DAffine3 { matrix3: DMat3::from_diagonal(scale), translation };
            // An affine of our own is that of the finest resolution; the others lie on it by their lengths.
            let finest = *own.get_or_insert(match of_vgs(attributes)? {
                Some(world_from_voxel) => world_from_voxel * lengths.inverse(),
                None => DAffine3::from_mat3(axes.directions),
            });
            levels.push(LevelRow { path: path.to_owned(), world_from_voxel: finest * lengths });
        }
        let oriented = axes.oriented || of_vgs(attributes)?.is_some();
        Ok(Image { axes: axes.count, space: axes.space, levels, oriented, labels: labels(ome), notes })
    }
}

/// Returns the names of label values, where properties of labels have one.
fn labels(ome: &Map<String, Value>) -> BTreeMap<i32, String> {
    let rows = ome.get("image-label").and_then(|of| of.get("properties")).and_then(Value::as_array);
    let name = |row: &Value| {
        let value = i32::try_from(row.get("label-value")?.as_i64()?).ok()?;
        Some((value, ["name", "class"].iter().find_map(|key| row.get(key)?.as_str())?.to_owned()))
    };
    rows.into_iter().flatten().filter_map(name).collect()
}

/// Returns the affine that vgs wrote.
fn of_vgs(attributes: &Map<String, Value>) -> Result<Option<DAffine3>> {
    let Some(found) = attributes.get("vgs").and_then(|own| own.get("world_from_voxel")) else {
        return Ok(None);
    };
    let rows: Option<[[f64; 4]; 3]> = serde_json::from_value(found.clone()).ok();
    let affine = rows.map(|[x, y, z]| DAffine3 {
        matrix3: DMat3::from_cols_array_2d(&[0, 1, 2].map(|column| [x[column], y[column], z[column]])),
        translation: DVec3::new(x[3], y[3], z[3]),
    });
    let sound = |affine: &DAffine3| affine.is_finite() && affine.matrix3.determinant().abs() > 1e-12;
    affine.filter(sound).map(Some).ok_or_else(|| {
        wrong(
            "world_from_voxel",
            found,
            "three rows of four numbers are needed, of a map that can be inverted",
        )
    })
}

/// The axes of the arrays.
struct Axes {
    count: usize,
    space: [usize; 3],
    /// Millimetres in a unit of x, y, z.
    mm: DVec3,
    /// Directions of x, y, z in the patient.
    directions: DMat3,
    oriented: bool,
}

impl Axes {
    fn of(found: &Value, notes: &mut Vec<String>) -> Result<Axes> {
        let needed = "a list of axes is needed, three of them of type space";
        let rows = found.as_array().ok_or_else(|| wrong("axes", found, needed))?;
        let mut names = Vec::new();
        for row in rows {
            // Version 0.3 had names alone.
            let name = row.as_str().or_else(|| row.get("name")?.as_str());
            names.push(name.ok_or_else(|| wrong("axes", row, "an axis needs a name"))?.to_lowercase());
        }
        let is_space = |axis: &usize| match rows[*axis].get("type").and_then(Value::as_str) {
            Some(kind) => kind == "space",
            None => matches!(names[*axis].as_str(), "x" | "y" | "z"),
        };
        let space: Vec<usize> = (0..rows.len()).filter(is_space).collect();
        let &[z, y, x] = space.as_slice() else {
            let message = format!("{} axes of space; three are needed", space.len());
            return Err(wrong("axes", found, &message));
        };
        let named = ["x", "y", "z"].map(|name| space.iter().copied().find(|&axis| names[axis] == name));
        let space = match named {
            [Some(x), Some(y), Some(z)] => [x, y, z],
            _ => [x, y, z],
        };
        let mut mm = [1.0; 3];
        let mut without_unit = false;
        let mut directions = [None; 3];
        for (k, &axis) in space.iter().enumerate() {
            match rows[axis].get("unit") {
                None | Some(Value::Null) => without_unit = true,
                Some(unit) => mm[k] = length(unit)?,
            }
            directions[k] = match rows[axis].get("orientation") {
                None | Some(Value::Null) => None,
                Some(orientation) => Some(direction(orientation)?),
            };
        }
        if without_unit {
            notes.push("an axis of space has no unit: its lengths are taken as mm".to_owned());
        }
        let directions = match directions {
            [Some(x), Some(y), Some(z)] => Some(DMat3::from_cols(x, y, z)).filter(|m| m.determinant() != 0.0),
            _ => None,
        };
        if directions.is_none() {
            let note = "it does not say how the patient lies: its axes are taken as x, y, z, left and right cannot \
                        be told";
            notes.push(note.to_owned());
        }
        let oriented = directions.is_some();
        let directions = directions.unwrap_or(DMat3::IDENTITY);
        Ok(Axes { count: rows.len(), space, mm: DVec3::from_array(mm), directions, oriented })
    }

    /// Returns the numbers of the axes of space, mm.
    fn space_of(&self, of_axes: &[f64]) -> DVec3 {
        DVec3::from_array(self.space.map(|axis| of_axes[axis])) * self.mm
    }
}

/// Returns the millimetres of a unit.
fn length(unit: &Value) -> Result<f64> {
    Ok(match unit.as_str().map(str::to_lowercase).as_deref() {
        Some("nanometer" | "nanometre" | "nm") => 1e-6,
        Some("micrometer" | "micrometre" | "micron" | "um" | "µm" | "μm") => 1e-3,
        Some("millimeter" | "millimetre" | "mm") => 1.0,
        Some("centimeter" | "centimetre" | "cm") => 10.0,
        Some("meter" | "metre" | "m") => 1000.0,
        _ => {
            return Err(wrong(
                "unit",
                unit,
                "nanometer, micrometer, millimeter, centimeter or meter is needed",
            ));
        }
    })
}

/// Returns the direction in the patient, RAS, in which an axis grows.
fn direction(orientation: &Value) -> Result<DVec3> {
    Ok(match orientation.get("value").and_then(Value::as_str) {
        Some("left-to-right") => DVec3::X,
        Some("right-to-left") => -DVec3::X,
        Some("posterior-to-anterior") => DVec3::Y,
        Some("anterior-to-posterior") => -DVec3::Y,
        Some("inferior-to-superior") => DVec3::Z,
        Some("superior-to-inferior") => -DVec3::Z,
        _ => {
            let needed =
                "left-to-right, posterior-to-anterior, inferior-to-superior or an opposite is needed";
            return Err(wrong("orientation", orientation, needed));
        }
    })
}

/// A scale and a translation along each axis.
struct Transform {
    scale: Vec<f64>,
    translation: Vec<f64>,
}

impl Transform {
    fn none(axes: usize) -> Transform {
        Transform { scale: vec![1.0; axes], translation: vec![0.0; axes] }
    }

    fn of(found: &Value, axes: usize, scale_needed: bool) -> Result<Transform> {
        let needed =
            format!("a scale of {axes} numbers above 0 is needed, and a translation of {axes} or none");
        let wrong = || wrong("coordinateTransformations", found, &needed);
        let mut transform = Transform::none(axes);
        let (mut scaled, mut moved) = (false, false);
        for step in found.as_array().ok_or_else(wrong)? {
            let kind = step.get("type").and_then(Value::as_str).unwrap_or_default();
            let numbers: Option<Vec<f64>> = step
                .get(kind)
                .and_then(|numbers| serde_json::from_value(numbers.clone()).ok())
                .filter(|numbers: &Vec<f64>| numbers.len() == axes && numbers.iter().all(|n| n.is_finite()));
            match (kind, numbers) {
                ("identity", _) => {}
                ("scale", Some(numbers)) if !scaled && !moved && numbers.iter().all(|&n| n > 0.0) => {
                    (scaled, transform.scale) = (true, numbers);
                }
                ("translation", Some(numbers)) if !moved => (moved, transform.translation) = (true, numbers),
                _ => return Err(wrong()),
            }
        }
        if scale_needed && !scaled { Err(wrong()) } else { Ok(transform) }
    }

    /// Returns this and then `next`.
    fn then(self, next: &Transform) -> Transform {
        let scale = self.scale.iter().zip(&next.scale).map(|(a, b)| a * b).collect();
        let of = next.scale.iter().zip(&next.translation);
        let translation = self.translation.iter().zip(of).map(|(a, (scale, b))| a * scale + b).collect();
        Transform { scale, translation }
    }
}
