//! The writer: float32 as OME-Zarr 0.5, with coarser resolutions.

use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DVec3};
use rayon::prelude::*;
use serde_json::{Value, json};
use zarrs::array::codec::ZstdCodec;
use zarrs::array::{Array, ArrayBuilder, ArraySubset, data_type};
use zarrs::group::GroupBuilder;

use super::store::{Store, is_store};
use crate::affine::SHEARED;
use crate::{Volume, VoxelSource};
use base::output::write_folder;
use base::{Error, Kind, Result};

/// Edge of a chunk, voxels.
const CHUNK: usize = 64;
/// Level of compression of zstd.
const EFFORT: i32 = 3;

/// Writes a volume as float32 to a folder whose name ends in `.zarr`, which appears whole or not at all: Zarr 3 with
/// chunks of 64³ voxels, and coarser resolutions, each of means of 2³ voxels, down to one chunk. Voxels are taken by boxes,
/// so that memory need not hold them. Directions of the axes
/// are written where they are those of the patient, and the whole affine as an attribute of vgs.
///
/// # Errors
/// [`Kind::Usage`] for another name ending, those of the source, and those of [`write_folder`].
pub fn write(path: impl AsRef<Path>, volume: &dyn VoxelSource, force: bool) -> Result<()> {
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
        let mut size = volume.grid().size;
        let mut finer = write_array(&store, 0, size, &|first, size| volume.read_box(first, size), &failed)?;
        let mut levels = 1;
        while size.iter().any(|&side| side > CHUNK) {
            let (all, coarse) = (size, size.map(|side| side.div_ceil(2)));
            let means = |first: [usize; 3], size: [usize; 3]| {
                let first = first.map(|at| 2 * at);
                let size = [0, 1, 2].map(|k| (2 * size[k]).min(all[k] - first[k]));
                let ranges = [2, 1, 0].map(|k| first[k] as u64..(first[k] + size[k]) as u64);
                let samples = finer.retrieve_array_subset(&ArraySubset::new_with_ranges(&ranges));
                let samples: Vec<f32> = samples.map_err(|e| failed(&e))?;
                Ok(Volume::new(size, DAffine3::IDENTITY, samples).coarsened(2))
            };
            finer = write_array(&store, levels, coarse, &means, &failed)?;
            (size, levels) = (coarse, levels + 1);
        }
        let attributes = attributes(&volume.read_box([0; 3], [1; 3])?, levels);
        let mut group = GroupBuilder::new();
        group.attributes(attributes.as_object().cloned().unwrap_or_default());
        let group = group.build(Arc::clone(&store), "/").map_err(|e| failed(&e))?;
        group.store_metadata().map_err(|e| failed(&e))
    })
}

/// Writes a level of `size` voxels, of which `read` returns those of a box, and returns it.
fn write_array(
    store: &Arc<Store>,
    level: usize,
    size: [usize; 3],
    read: &(dyn Fn([usize; 3], [usize; 3]) -> Result<Volume> + Sync),
    failed: &(dyn Fn(&dyn std::fmt::Display) -> Error + Sync),
) -> Result<Array<Store>> {
    let chunk = size.map(|side| side.min(CHUNK));
    let of_axes = |[x, y, z]: [usize; 3]| vec![z as u64, y as u64, x as u64];
    let mut builder = ArrayBuilder::new(of_axes(size), of_axes(chunk), data_type::float32(), 0.0_f32);
    builder.bytes_to_bytes_codecs(vec![Arc::new(ZstdCodec::new(EFFORT, false))]);
    builder.dimension_names(["z", "y", "x"].into());
    let array = builder.build(Arc::clone(store), &format!("/{level}")).map_err(|e| failed(&e))?;
    array.store_metadata().map_err(|e| failed(&e))?;
    let counts = [0, 1, 2].map(|k| size[k].div_ceil(chunk[k]));
    (0..counts.iter().product()).into_par_iter().try_for_each(|i: usize| {
        let place = [i % counts[0], i / counts[0] % counts[1], i / (counts[0] * counts[1])];
        let first = [0, 1, 2].map(|k| place[k] * chunk[k]);
        let part = [0, 1, 2].map(|k| chunk[k].min(size[k] - first[k]));
        let samples = read(first, part)?.samples;
        let mut values = vec![0.0_f32; chunk.iter().product()];
        for (row, samples) in samples.chunks(part[0]).enumerate() {
            let (y, z) = (row % part[1], row / part[1]);
            values[chunk[0] * (y + chunk[1] * z)..][..part[0]].copy_from_slice(samples);
        }
        array.store_chunk(&of_axes(place), values.as_slice()).map_err(|e| failed(&e))
    })?;
    Ok(array)
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
