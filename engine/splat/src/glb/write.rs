//! The writer of binary glTF.

use std::io::{self, Write};
use std::path::Path;

use glam::DVec3;
use serde_json::{Map, Value, json};

use super::{AXES, FLOAT, HU, INTENSITY, LABEL, LOGIT, NAME, POINTS, UNSIGNED_BYTE, WIDENING};
use crate::activation::{Activations, normalised};
use crate::harmonics::{SH0, basis_count};
use crate::ordinary::Ordinary;
use crate::ply::comments;
use crate::{Region, SplatSet, WriteOptions};
use base::error::{Error, Kind, Result};
use base::output::counted;
use base::unit::Unit;

/// Number of glTF for a buffer view of attributes.
const ARRAY_BUFFER: u32 = 34962;
/// Splats that are encoded at a time.
const BLOCK: usize = 4096;

/// Writes `set` atomically.
///
/// # Errors
/// As [`Ordinary::new`]; also [`Kind::Usage`] for a set of more than 4 GiB, which no such file holds.
pub fn write(path: &Path, set: &SplatSet, options: &WriteOptions) -> Result<()> {
    let made = Encoder::new(set, options.made_of).map_err(|error| error.file(path))?;
    base::output::write_atomic(path, options.force, |out| made.encode(out))
}

/// Returns the size in bytes of the file that [`write()`] makes of `set`.
pub fn bytes(set: &SplatSet, options: &WriteOptions) -> Result<u64> {
    let made = Encoder::new(set, options.made_of)?;
    Ok(counted(|out| made.encode(out)))
}

/// Appends the bytes of an attribute of a splat.
type Push<'a> = dyn Fn(&Ordinary, usize, &mut Vec<u8>) + 'a;

/// An attribute of the points.
struct Attribute<'a> {
    name: String,
    /// `VEC3` and the like.
    shape: &'static str,
    component: u32,
    /// True if the numbers stand for 0 to 1.
    normalized: bool,
    /// Bytes of a splat, a multiple of 4.
    bytes: usize,
    push: Box<Push<'a>>,
}

impl<'a> Attribute<'a> {
    fn floats<const N: usize>(
        name: impl Into<String>,
        shape: &'static str,
        of: impl Fn(&Ordinary, usize) -> [f32; N] + 'a,
    ) -> Self {
        let push = move |set: &Ordinary, i: usize, out: &mut Vec<u8>| {
            out.extend(of(set, i).into_iter().flat_map(f32::to_le_bytes));
        };
        let (name, push) = (name.into(), Box::new(push));
        Attribute { name, shape, component: FLOAT, normalized: false, bytes: 4 * N, push }
    }

    /// An attribute of four bytes of a splat.
    fn bytes(
        name: &str,
        shape: &'static str,
        normalized: bool,
        of: impl Fn(&Ordinary, usize) -> [u8; 4] + 'a,
    ) -> Self {
        let push = move |set: &Ordinary, i: usize, out: &mut Vec<u8>| out.extend(of(set, i));
        let (name, push) = (name.to_owned(), Box::new(push));
        Attribute { name, shape, component: UNSIGNED_BYTE, normalized, bytes: 4, push }
    }
}

struct Encoder<'a> {
    set: Ordinary,
    attributes: Vec<Attribute<'a>>,
    /// Bytes after the attributes.
    region: Vec<u8>,
    json: String,
    /// Bytes of the JSON and of the rest.
    lengths: [u32; 2],
}

impl<'a> Encoder<'a> {
    /// Creates the file of `set`, whose colours are those of `made_of`, if that is given.
    fn new(set: &'a SplatSet, made_of: Option<&'a SplatSet>) -> Result<Self> {
        let ordinary = Ordinary::new(set, &AXES)?;
        let stated = made_of.unwrap_or(set);
        if stated.splats.len() != set.splats.len() {
            let message = "the splats of these colours are others";
            return Err(Error::new(Kind::Internal, "VGS-SPLAT-011", message));
        }
        let attributes = attributes(set, made_of);
        let mut region = stated.region.as_ref().map(Region::encode).unwrap_or_default();
        let count = region.len();
        // A chunk is a multiple of four bytes, and one of JSON ends with spaces.
        region.resize(count.next_multiple_of(4), 0);
        let mut json = document(&ordinary, &attributes, stated, count).to_string();
        json.extend(std::iter::repeat_n(' ', json.len().wrapping_neg() % 4));
        let bytes: u64 = attributes.iter().map(|attribute| attribute.bytes as u64).sum();
        let lengths = lengths(json.len(), bytes, set.splats.len(), region.len())?;
        Ok(Encoder { set: ordinary, attributes, region, json, lengths })
    }

    fn encode(&self, out: &mut dyn Write) -> io::Result<()> {
        let [json, binary] = self.lengths;
        out.write_all(b"glTF")?;
        for number in [2, 12 + 8 + json + 8 + binary, json] {
            out.write_all(&u32::to_le_bytes(number))?;
        }
        out.write_all(b"JSON")?;
        out.write_all(self.json.as_bytes())?;
        out.write_all(&binary.to_le_bytes())?;
        out.write_all(b"BIN\0")?;
        let count = self.set.splats.len();
        let mut block = Vec::new();
        for attribute in &self.attributes {
            for first in (0..count).step_by(BLOCK) {
                block.clear();
                for i in first..count.min(first + BLOCK) {
                    (attribute.push)(&self.set, i, &mut block);
                }
                out.write_all(&block)?;
            }
        }
        out.write_all(&self.region)
    }
}

/// Returns the bytes of the JSON and of the rest: `count` splats of so many bytes each, and `more`.
fn lengths(json: usize, bytes: u64, count: usize, more: usize) -> Result<[u32; 2]> {
    let binary = bytes.saturating_mul(count as u64).saturating_add(more as u64);
    let fits = |length: u64| u32::try_from(length).ok();
    match (fits(json as u64), fits(binary), fits(binary.saturating_add(json as u64 + 28))) {
        (Some(json), Some(binary), Some(_)) => Ok([json, binary]),
        _ => {
            let message = format!("{count} splats take {binary} bytes, and a binary glTF file ends at 4 GiB");
            Err(Error::new(Kind::Usage, "VGS-SPLAT-009", message)
                .help("write a .spz, or a part: vgs convert --box or --object"))
        }
    }
}

/// Returns the attributes of the splats of `set`, and of those that its colours were made of.
fn attributes<'a>(set: &'a SplatSet, made_of: Option<&'a SplatSet>) -> Vec<Attribute<'a>> {
    let degree = set.colours.as_ref().map_or(0, |colours| colours.degree);
    let mut all = vec![
        Attribute::floats("POSITION", "VEC3", |set, i| set.splats[i].mean),
        Attribute::floats(format!("{NAME}:ROTATION"), "VEC4", |set, i| {
            let [w, x, y, z] = normalised(set.splats[i].rotation);
            [x, y, z, w]
        }),
        Attribute::floats(format!("{NAME}:SCALE"), "VEC3", |set, i| set.splats[i].scale()),
        Attribute::floats(format!("{NAME}:OPACITY"), "SCALAR", |set, i| [set.splats[i].opacity()]),
    ];
    for degree in 0..=degree {
        let first = usize::from(degree).pow(2);
        for k in first..basis_count(degree) {
            let name = format!("{NAME}:SH_DEGREE_{degree}_COEF_{}", k - first);
            all.push(Attribute::floats(name, "VEC3", move |set, i| {
                let of = &set.colours.of(i)[3 * k..];
                [of[0], of[1], of[2]]
            }));
        }
    }
    let colour = |set: &Ordinary, i: usize| {
        let byte = |v: f32| (v * 255.0).round().clamp(0.0, 255.0) as u8;
        let [r, g, b] = [0, 1, 2].map(|c| byte(light_of(0.5 + SH0 * set.colours.of(i)[c])));
        [r, g, b, byte(set.splats[i].opacity())]
    };
    all.push(Attribute::bytes("COLOR_0", "VEC4", true, colour));
    if let Some(labels) = &set.labels {
        all.push(Attribute::bytes(LABEL, "SCALAR", false, |_, i| [labels[i], 0, 0, 0]));
    }
    if let Some(own) = made_of {
        let name = if own.unit == Unit::Hu { HU } else { INTENSITY };
        all.push(Attribute::floats(name, "SCALAR", |_, i| [own.splats[i].intensity]));
        all.push(Attribute::floats(LOGIT, "SCALAR", |_, i| [own.splats[i].opacity_logit]));
        all.push(Attribute::floats(WIDENING, "SCALAR", |_, i| {
            [(set.splats[i].log_scale[0] - own.splats[i].log_scale[0]).exp()]
        }));
    }
    all
}

/// Returns the linear light of a display-referred number of sRGB (IEC 61966-2-1).
fn light_of(srgb: f32) -> f32 {
    let v = srgb.clamp(0.0, 1.0);
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// Returns the JSON of a file; `stated` says what else is known of its splats, and the `region` bytes of its region follow the
/// attributes.
fn document(set: &Ordinary, attributes: &[Attribute], stated: &SplatSet, region: usize) -> Value {
    let count = set.splats.len();
    let mut at = 0;
    let (mut views, mut accessors, mut names) = (Vec::new(), Vec::new(), Map::new());
    for (index, attribute) in attributes.iter().enumerate() {
        let bytes = attribute.bytes * count;
        let mut view = json!({
            "buffer": 0, "byteOffset": at, "byteLength": bytes, "target": ARRAY_BUFFER,
        });
        let mut accessor = json!({
            "bufferView": index, "componentType": attribute.component, "count": count, "type": attribute.shape,
        });
        if attribute.component == UNSIGNED_BYTE && attribute.shape == "SCALAR" {
            // A byte, and three that fill it up.
            view["byteStride"] = json!(attribute.bytes);
        }
        if attribute.normalized {
            accessor["normalized"] = json!(true);
        }
        views.push(view);
        accessors.push(accessor);
        names.insert(attribute.name.clone(), json!(index));
        at += bytes;
    }
    let along = |k: usize, fold: fn(f32, f32) -> f32, first: f32| {
        set.splats.iter().map(|splat| splat.mean[k]).fold(first, fold)
    };
    accessors[0]["min"] = json!([0, 1, 2].map(|k| along(k, f32::min, f32::INFINITY)));
    accessors[0]["max"] = json!([0, 1, 2].map(|k| along(k, f32::max, f32::NEG_INFINITY)));
    let mut node = json!({ "mesh": 0 });
    if set.origin != DVec3::ZERO {
        node["translation"] = json!(set.origin.to_array());
    }
    let extension = json!({
        "kernel": "ellipse", "colorSpace": "srgb_rec709_display", "projection": "perspective",
        "sortingMethod": "cameraDistance",
    });
    let comments = comments::of_set(stated);
    let comments: Vec<_> = comments.lines().filter_map(|line| line.strip_prefix("comment ")).collect();
    let mut own = json!({ "statements": comments });
    if region > 0 {
        own["region"] = json!(views.len());
        views.push(json!({ "buffer": 0, "byteOffset": at, "byteLength": region }));
        at += region;
    }
    json!({
        "asset": { "version": "2.0", "generator": concat!("vgs ", env!("CARGO_PKG_VERSION")) },
        "extensionsUsed": [NAME],
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [node],
        "meshes": [{ "primitives": [{
            "attributes": names, "mode": POINTS, "extensions": { NAME: extension }, "extras": { "vgs": own },
        }] }],
        "buffers": [{ "byteLength": at }],
        "bufferViews": views,
        "accessors": accessors,
    })
}

#[cfg(test)]
mod tests {
    use glam::DQuat;

    use super::*;
    use crate::Harmonics;
    use crate::ordinary::tests::{Errors, Row, check, coloured};

    /// Returns the JSON and the binary chunk of a file.
    fn chunks(file: &[u8]) -> (Value, &[u8]) {
        let number = |at: usize| u32::from_le_bytes(file[at..][..4].try_into().expect("four bytes")) as usize;
        assert_eq!((&file[..4], number(4), number(8)), (&b"glTF"[..], 2, file.len()));
        let json = number(12);
        assert_eq!((&file[16..20], json % 4), (&b"JSON"[..], 0));
        let binary = number(20 + json);
        assert_eq!((&file[24 + json..28 + json], 28 + json + binary), (&b"BIN\0"[..], file.len()));
        (serde_json::from_slice(&file[20..20 + json]).expect("JSON"), &file[28 + json..])
    }

    /// Returns the numbers of an attribute, for each splat.
    fn numbers(document: &Value, binary: &[u8], name: &str) -> Vec<Vec<f32>> {
        let attribute = &document["meshes"][0]["primitives"][0]["attributes"][name];
        let accessor = &document["accessors"][attribute.as_u64().expect(name) as usize];
        let view = &document["bufferViews"][accessor["bufferView"].as_u64().expect("a view") as usize];
        let at = |of: &Value| of.as_u64().expect("a number") as usize;
        let bytes = &binary[at(&view["byteOffset"])..][..at(&view["byteLength"])];
        let components = match accessor["type"].as_str() {
            Some("SCALAR") => 1,
            Some("VEC3") => 3,
            Some("VEC4") => 4,
            other => panic!("{other:?}"),
        };
        let values: Vec<f32> = match accessor["componentType"].as_u64() {
            Some(5126) => {
                bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().expect("four"))).collect()
            }
            Some(5121) if accessor["normalized"] == true => {
                bytes.iter().map(|&b| f32::from(b) / 255.0).collect()
            }
            other => panic!("{other:?}"),
        };
        assert_eq!(values.len(), at(&accessor["count"]) * components);
        values.chunks_exact(components).map(<[f32]>::to_vec).collect()
    }

    #[test]
    fn a_file_holds_the_splats_in_metres_along_left_up_front() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.glb");
        let set = coloured();
        crate::write(&path, &set, false).expect("a file");
        let file = std::fs::read(&path).expect("the file");
        let bytes = crate::file_bytes(&path, &set, &WriteOptions::default()).expect("bytes");
        assert_eq!(bytes, file.len() as u64);
        let (document, binary) = chunks(&file);
        assert_eq!(document["extensionsUsed"], json!([NAME]));
        let primitive = &document["meshes"][0]["primitives"][0];
        assert_eq!(primitive["mode"], json!(0));
        assert_eq!(primitive["extensions"][NAME]["kernel"], json!("ellipse"));
        assert_eq!(primitive["extensions"][NAME]["colorSpace"], json!("srgb_rec709_display"));
        let vector = |v: &[f32]| DVec3::new(f64::from(v[0]), f64::from(v[1]), f64::from(v[2]));
        let of = |name: &str| numbers(&document, binary, name);
        let translation: Vec<f64> =
            serde_json::from_value(document["nodes"][0]["translation"].clone()).expect("a translation");
        let origin = DVec3::from_slice(&translation);
        let (places, rotations) = (of("POSITION"), of("KHR_gaussian_splatting:ROTATION"));
        let (scales, opacities) = (of("KHR_gaussian_splatting:SCALE"), of("KHR_gaussian_splatting:OPACITY"));
        let harmonics: Vec<_> = [(0, 1), (1, 3), (2, 5)]
            .iter()
            .flat_map(|(l, n)| (0..*n).map(move |k| format!("KHR_gaussian_splatting:SH_DEGREE_{l}_COEF_{k}")))
            .map(|name| of(&name))
            .collect();
        let rows: Vec<Row> = (0..places.len())
            .map(|i| {
                let q: [f32; 4] = rotations[i].as_slice().try_into().expect("four");
                let rotation = DQuat::from_array(q.map(f64::from));
                assert!((rotation.length() - 1.0).abs() < 1e-6, "a unit quaternion");
                Row {
                    place: vector(&places[i]) + origin,
                    rotation,
                    scale: vector(&scales[i]),
                    opacity: f64::from(opacities[i][0]),
                    coefficients: harmonics.iter().flat_map(|of| of[i].iter().copied()).collect(),
                }
            })
            .collect();
        let allowed = Errors { place_mm: 1e-4, shape: 1e-5, opacity: 1e-6, colour: 1e-5 };
        check(&set, &rows, |v| DVec3::new(-v.x, v.z, v.y), &allowed);

        let bounds = &document["accessors"][0];
        for k in 0..3 {
            let along = |i: usize| f64::from(places[i][k]);
            let least = (0..places.len()).map(along).fold(f64::INFINITY, f64::min);
            let greatest = (0..places.len()).map(along).fold(f64::NEG_INFINITY, f64::max);
            assert_eq!((&bounds["min"][k], &bounds["max"][k]), (&json!(least), &json!(greatest)));
        }
    }

    #[test]
    fn points_have_the_colour_in_linear_light_for_programs_without_the_extension() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("a.glb");
        let mut set = coloured().selected(|i, _| i == 0);
        let dc = |v: f32| (v - 0.5) / SH0;
        set.colours = Some(Harmonics { degree: 0, coefficients: vec![dc(0.0), dc(0.5), dc(1.0)] });
        set.origin_mm = DVec3::ZERO;
        crate::write(&path, &set, false).expect("a file");
        let file = std::fs::read(&path).expect("the file");
        let (document, binary) = chunks(&file);
        assert!(document["nodes"][0].get("translation").is_none(), "nothing to move");
        let colour = numbers(&document, binary, "COLOR_0").remove(0);
        let wanted = [0.0, 0.214_041_14, 1.0, set.splats[0].opacity()];
        assert!((0..4).all(|k| (colour[k] - wanted[k]).abs() <= 0.5 / 255.0 + 1e-6), "{colour:?}");
    }

    #[test]
    fn a_file_ends_at_four_gibibytes() {
        assert_eq!(lengths(1000, 56, 1_000_000, 0).expect("it fits"), [1000, 56_000_000]);
        let error = lengths(1000, 156, 30_000_000, 0).expect_err("4.7 GB");
        assert_eq!((error.kind, error.code), (Kind::Usage, "VGS-SPLAT-009"));
    }
}
