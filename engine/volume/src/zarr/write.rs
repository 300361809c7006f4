//! The writer: float32 as OME-Zarr 0.5, with coarser resolutions.

use std::path::Path;
use std::sync::Arc;

use glam::DVec3;
use serde_json::{Value, json};
use zarrs::array::codec::ZstdCodec;
use zarrs::array::{ArrayBuilder, data_type};
use zarrs::group::GroupBuilder;

use super::store::{Store, is_store};
use crate::Volume;
use crate::affine::SHEARED;
use base::output::write_folder;
use base::{Error, Kind, Result};

/// Edge of a chunk, voxels.
const CHUNK: usize = 64;
/// Level of compression of zstd.
const EFFORT: i32 = 3;

/// Writes `volume` as float32 to a folder whose name ends in `.zarr`, which appears whole or not at all: Zarr 3 with
/// chunks of 64³ voxels, and coarser resolutions, each of means of 2³ voxels, down to one chunk. Directions of the axes
/// are written where they are those of the patient, and the whole affine as an attribute of vgs.
///
/// # Errors
/// [`Kind::Usage`] for another name ending, and those of [`write_folder`].
pub fn write(path: impl AsRef<Path>, volume: &Volume, force: bool) -> Result<()> {
    let path = path.as_ref();
    if !path.extension().is_some_and(|e| e.eq_ignore_ascii_case("zarr")) {
        let message = "the name of an OME-Zarr output must end in .zarr";
        return Err(Error::new(Kind::Usage, "VGS-ZAR-008", message).file(path));
    }
    write_folder(path, force, is_store, |folder| {
        let failed = |e: &dyn std::fmt::Display| {
            Error::new(Kind::Io, "VGS-ZAR-009", format!("writing failed: {e}"))
                .file(path)
                .help("free some space or choose another folder")
        };
        let store = Arc::new(Store::in_folder(folder));
        let mut level = std::borrow::Cow::Borrowed(volume);
        let mut levels = Vec::new();
        loop {
            write_array(&store, &levels.len().to_string(), &level).map_err(|e| failed(&e))?;
            levels.push(level.world_from_voxel);
            if level.size.iter().all(|&side| side <= CHUNK) {
                break;
            }
            level = std::borrow::Cow::Owned(level.coarsened(2));
        }
        let attributes = attributes(volume, levels.len());
        let mut group = GroupBuilder::new();
        group.attributes(attributes.as_object().cloned().unwrap_or_default());
        let group = group.build(Arc::clone(&store), "/").map_err(|e| failed(&e))?;
        group.store_metadata().map_err(|e| failed(&e))
    })
}

fn write_array(
    store: &Arc<Store>,
    name: &str,
    volume: &Volume,
) -> std::result::Result<(), Box<dyn std::error::Error>> {
    let [nx, ny, nz] = volume.size;
    let chunk = volume.size.map(|side| side.min(CHUNK));
    let [cx, cy, cz] = chunk;
    let of_axes = |[x, y, z]: [usize; 3]| vec![z as u64, y as u64, x as u64];
    let mut builder = ArrayBuilder::new(of_axes(volume.size), of_axes(chunk), data_type::float32(), 0.0_f32);
    builder.bytes_to_bytes_codecs(vec![Arc::new(ZstdCodec::new(EFFORT, false))]);
    builder.dimension_names(["z", "y", "x"].into());
    let array = builder.build(Arc::clone(store), &format!("/{name}"))?;
    array.store_metadata()?;
    let mut values = vec![0.0_f32; cx * cy * cz];
    for k in 0..nz.div_ceil(cz) {
        for j in 0..ny.div_ceil(cy) {
            for i in 0..nx.div_ceil(cx) {
                values.fill(0.0);
                let width = cx.min(nx - i * cx);
                for z in 0..cz.min(nz - k * cz) {
                    for y in 0..cy.min(ny - j * cy) {
                        let from = volume.index(i * cx, j * cy + y, k * cz + z);
                        let to = cx * (y + cy * z);
                        values[to..to + width].copy_from_slice(&volume.samples[from..from + width]);
                    }
                }
                array.store_chunk(&[k as u64, j as u64, i as u64], values.as_slice())?;
            }
        }
    }
    Ok(())
}

fn attributes(volume: &Volume, levels: usize) -> Value {
    let affine = volume.world_from_voxel;
    let spacing = volume.spacing_mm();
    let units: [DVec3; 3] = std::array::from_fn(|axis| affine.matrix3.col(axis) / spacing[axis]);
    let directions = units.map(|unit| direction_of(unit).filter(|_| volume.oriented));
    let aligned = directions.iter().all(Option::is_some);
    let axes: Vec<Value> = [2, 1, 0]
        .into_iter()
        .map(|axis| {
            let name = ["x", "y", "z"][axis];
            let mut row = json!({ "name": name, "type": "space", "unit": "millimeter" });
            if let (true, Some(value)) = (aligned, directions[axis]) {
                row["orientation"] = json!({ "type": "anatomical", "value": value });
            }
            row
        })
        .collect();
    // Along its own direction, where an axis has one.
    let origin: [f64; 3] =
        std::array::from_fn(|axis| if aligned { affine.translation.dot(units[axis].round()) } else { 0.0 });
    let datasets: Vec<Value> = (0..levels)
        .map(|level| {
            let factor = (1_u64 << level) as f64;
            let scale = [2, 1, 0].map(|axis| spacing[axis] * factor);
            let translation = [2, 1, 0].map(|axis| origin[axis] + spacing[axis] * (factor - 1.0) / 2.0);
            json!({
                "path": level.to_string(),
                "coordinateTransformations": [
                    { "type": "scale", "scale": scale },
                    { "type": "translation", "translation": translation },
                ],
            })
        })
        .collect();
    let mut ome = json!({ "version": "0.5", "multiscales": [{ "axes": axes, "datasets": datasets }] });
    if !volume.labels.is_empty() {
        let rows = volume.labels.iter().map(|(value, name)| json!({ "label-value": value, "name": name }));
        ome["image-label"] = json!({ "properties": rows.collect::<Vec<_>>() });
    }
    let mut all = json!({ "ome": ome });
    if volume.oriented {
        let (m, t) = (affine.matrix3, affine.translation);
        let rows = [0, 1, 2].map(|row| [m.x_axis[row], m.y_axis[row], m.z_axis[row], t[row]]);
        all["vgs"] = json!({ "world_from_voxel": rows });
    }
    all
}

/// Returns the name of a direction in the patient, RAS; `None` if it is oblique.
fn direction_of(unit: DVec3) -> Option<&'static str> {
    const NAMES: [[&str; 2]; 3] = [
        ["right-to-left", "left-to-right"],
        ["anterior-to-posterior", "posterior-to-anterior"],
        ["superior-to-inferior", "inferior-to-superior"],
    ];
    let axis = (0..3).find(|&axis| unit[axis].abs() > 1.0 - SHEARED * SHEARED)?;
    Some(NAMES[axis][usize::from(unit[axis] > 0.0)])
}
