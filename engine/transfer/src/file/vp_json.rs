//! Slicer's `.vp.json`, after its `volume-property-schema-v1.0.0.json`; the format that is also written.
//!
//! α is per `scalarOpacityUnitDistance` in mm. The name of a function and `ambientOcclusion` of its lighting are
//! ours: the schema has neither, and lets other keys be. The latter is written only where it is more than 0.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::super::{ColourPoint, Material, OpacityPoint, TransferFunction};
use super::curve::{Node, just_above, straightened};
use super::entry::{Entry, MAX_POINTS, broken, opacity_points};
use base::error::Result;

const SCHEMA: &str = "https://raw.githubusercontent.com/slicer/slicer/main/Modules/Loadable/VolumeRendering/Resources/Schema/volume-property-schema-v1.0.0.json#";

#[derive(Serialize, Deserialize)]
struct Document {
    #[serde(rename = "@schema", default)]
    schema: Option<String>,
    #[serde(rename = "volumeProperties")]
    properties: Vec<Property>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Property {
    #[serde(default)]
    name: String,
    /// The range that Slicer sets its editor to. It follows from the points, and is only written.
    #[serde(skip_deserializing)]
    effective_range: [f64; 2],
    #[serde(skip_deserializing)]
    independent_components: bool,
    #[serde(skip_deserializing)]
    interpolation_type: &'static str,
    #[serde(default)]
    components: Vec<Component>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Component {
    #[serde(default)]
    shade: bool,
    #[serde(default)]
    lighting: Lighting,
    #[serde(default)]
    disable_gradient_opacity: bool,
    #[serde(default = "one")]
    scalar_opacity_unit_distance: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rgb_transfer_function: Option<ColourFunction>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    gray_transfer_function: Option<Piecewise>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    scalar_opacity: Option<Piecewise>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    gradient_opacity: Option<Piecewise>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase", default)]
struct Lighting {
    ambient: f64,
    diffuse: f64,
    specular: f64,
    specular_power: f64,
    #[serde(skip_serializing_if = "is_zero")]
    ambient_occlusion: f64,
}

impl Default for Lighting {
    fn default() -> Self {
        let Material { ambient, diffuse, specular, power, occlusion, .. } = Material::default();
        Lighting { ambient, diffuse, specular, specular_power: power, ambient_occlusion: occlusion }
    }
}

#[derive(Serialize, Deserialize)]
struct Piecewise {
    #[serde(rename = "type", skip_deserializing)]
    kind: &'static str,
    points: Vec<Point>,
}

#[derive(Serialize, Deserialize)]
struct Point {
    x: f64,
    y: f64,
    #[serde(default = "half")]
    midpoint: f64,
    #[serde(default)]
    sharpness: f64,
}

#[derive(Serialize, Deserialize)]
struct ColourFunction {
    #[serde(rename = "type", skip_deserializing)]
    kind: &'static str,
    points: Vec<Colour>,
}

#[derive(Serialize, Deserialize)]
struct Colour {
    x: f64,
    color: [f64; 3],
    #[serde(default = "half")]
    midpoint: f64,
    #[serde(default)]
    sharpness: f64,
}

fn one() -> f64 {
    1.0
}

fn half() -> f64 {
    0.5
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

pub fn sniff(text: &str) -> bool {
    text.trim_start().starts_with('{') && text.contains("\"volumeProperties\"")
}

pub fn read(text: &str) -> Result<Vec<Entry>> {
    let document: Document = serde_json::from_str(text).map_err(|e| broken(e.to_string()))?;
    if let Some(schema) = &document.schema
        && !schema.to_lowercase().contains("volume-property-schema-v1.")
    {
        return Err(broken(format!("of the schema {schema:?}, not of volume-property-schema-v1"))
            .help("save the file from Slicer 5.9 or later as a volume property"));
    }
    let entry = |(i, property): (usize, Property)| {
        let name = property.name.clone();
        let function = function(property).map_err(|mut e| {
            e.message = format!("volumeProperties[{i}]: {}", e.message);
            e
        });
        Entry { name, function }
    };
    Ok(document.properties.into_iter().enumerate().map(entry).collect())
}

fn function(property: Property) -> Result<TransferFunction> {
    let count = property.components.len();
    let component =
        property.components.into_iter().next().ok_or_else(|| broken("there are no components"))?;
    if count > 1 {
        tracing::warn!("the volume property is for {count} components; that of the first one is taken");
    }
    let distance = component.scalar_opacity_unit_distance;
    if !(distance > 0.0 && distance.is_finite()) {
        return Err(broken(format!("scalarOpacityUnitDistance is {distance}, more than 0 mm is needed")));
    }
    let opacity = component.scalar_opacity.ok_or_else(|| broken("there is no scalarOpacity"))?;
    let opacities = curve("scalarOpacity", opacity, distance != 1.0)?;
    // α over a distance d results from d layers of one mm: (1 − α per mm)^d = 1 − α. Values outside 0 to 1
    // are left for the check.
    let per_mm = |(x, a): (f64, f64)| {
        let converts = distance != 1.0 && (0.0..=1.0).contains(&a);
        (x, if converts { -((-a).ln_1p() / distance).exp_m1() } else { a })
    };
    let opacities: Vec<_> = opacities.into_iter().map(per_mm).collect();
    let colours = match (component.rgb_transfer_function, component.gray_transfer_function) {
        (Some(rgb), _) => colour_curve(rgb)?,
        (None, Some(grey)) => curve("grayTransferFunction", grey, false)?
            .into_iter()
            .map(|(x, y)| (x, DVec3::splat(y)))
            .collect(),
        (None, None) => return Err(broken("there is no rgbTransferFunction")),
    };
    let gradient = match component.gradient_opacity {
        Some(gradient) if !component.disable_gradient_opacity => curve("gradientOpacity", gradient, false)?,
        _ => Vec::new(),
    };
    let colours = colours.into_iter().map(|(intensity, colour)| ColourPoint { intensity, colour });
    let Lighting { ambient, diffuse, specular, specular_power: power, ambient_occlusion: occlusion } =
        component.lighting;
    let material = Material { shade: component.shade, ambient, diffuse, specular, power, occlusion };
    TransferFunction::new(property.name, colours.collect(), opacity_points(&opacities), material)?
        .with_gradient_opacity(opacity_points(&gradient))
}

fn check_count(what: &str, count: usize) -> Result<()> {
    if count > MAX_POINTS {
        return Err(broken(format!("{what}: {count} points, at most {MAX_POINTS} can be used")));
    }
    Ok(())
}

fn curve(what: &str, function: Piecewise, bent: bool) -> Result<Vec<(f64, f64)>> {
    check_count(what, function.points.len())?;
    let node = |p: Point| Node { x: p.x, value: p.y, midpoint: p.midpoint, sharpness: p.sharpness };
    let nodes = function.points.into_iter().map(node).collect();
    Ok(straightened(nodes, bent, |a, b, share| a + (b - a) * share))
}

fn colour_curve(function: ColourFunction) -> Result<Vec<(f64, DVec3)>> {
    check_count("rgbTransferFunction", function.points.len())?;
    let node = |p: Colour| Node {
        x: p.x,
        value: DVec3::from_array(p.color),
        midpoint: p.midpoint,
        sharpness: p.sharpness,
    };
    let nodes = function.points.into_iter().map(node).collect();
    Ok(straightened(nodes, false, |a: DVec3, b, share| a.lerp(b, share)))
}

pub fn write(tf: &TransferFunction) -> String {
    let colours = tf.colours().iter().enumerate().map(|(i, p)| Colour {
        x: place(tf.colours(), i, |p| p.intensity),
        color: p.colour.to_array(),
        midpoint: half(),
        sharpness: 0.0,
    });
    let Material { shade, ambient, diffuse, specular, power, occlusion } = tf.material;
    let gradient = (!tf.gradient_opacities().is_empty()).then(|| piecewise(tf.gradient_opacities()));
    let component = Component {
        shade,
        lighting: Lighting {
            ambient,
            diffuse,
            specular,
            specular_power: power,
            ambient_occlusion: occlusion,
        },
        disable_gradient_opacity: false,
        scalar_opacity_unit_distance: one(),
        rgb_transfer_function: Some(ColourFunction {
            kind: "colorTransferFunction",
            points: colours.collect(),
        }),
        gray_transfer_function: None,
        scalar_opacity: Some(piecewise(tf.opacities())),
        gradient_opacity: gradient,
    };
    let document = Document {
        schema: Some(SCHEMA.to_owned()),
        properties: vec![Property {
            name: tf.name.clone(),
            effective_range: tf.extent(),
            independent_components: true,
            interpolation_type: "linear",
            components: vec![component],
        }],
    };
    let mut text = serde_json::to_string_pretty(&document).expect("a document of numbers and strings");
    text.push('\n');
    text
}

/// Returns the intensity at which point `index` is written. The second point of a step stands just above the
/// first, since VTK would otherwise drop one of them.
fn place<P>(points: &[P], index: usize, intensity: impl Fn(&P) -> f64) -> f64 {
    let x = intensity(&points[index]);
    let second = index > 0 && intensity(&points[index - 1]) == x;
    if second { just_above(x) } else { x }
}

fn piecewise(points: &[OpacityPoint]) -> Piecewise {
    let point = |(i, p): (usize, &OpacityPoint)| Point {
        x: place(points, i, |p| p.intensity),
        y: p.opacity,
        midpoint: half(),
        sharpness: 0.0,
    };
    Piecewise { kind: "piecewiseLinearFunction", points: points.iter().enumerate().map(point).collect() }
}
