//! The decoded field: value and occupancy that the splats give at each voxel of a box.

use glam::DVec3;

use super::splat_to_volume::splat_to_volume;
use super::{Footprint, Reconstruction};
use splat::Field;

/// A voxel of the decoded field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Voxel {
    /// V.
    pub value: f64,
    /// O.
    pub occupancy: f64,
    /// Index of the object with the largest Σ w.
    pub object: usize,
}

/// Decodes the voxels of a box, x fastest. `objects` holds the footprints of each object's splats, in voxels
/// of the box. V is the field's value where a splat reaches;
/// elsewhere it is the mean of the neighbouring voxels that a splat reaches, or the background if there are
/// none.
pub fn decoded(objects: &[Vec<Footprint>], field: &Field, size: [usize; 3]) -> Vec<Voxel> {
    let [nx, ny, nz] = size;
    let place = |i: usize| [i % nx, i / nx % ny, i / (nx * ny)];
    let positions: Vec<DVec3> =
        (0..nx * ny * nz).map(|i| DVec3::from_array(place(i).map(|v| v as f64))).collect();
    let at = |footprints: &[Footprint]| {
        splat_to_volume(footprints, &positions, field.kernel, f64::from(field.epsilon))
    };
    let all: Vec<Reconstruction> = at(&objects.concat());
    let each: Vec<Vec<Reconstruction>> = objects.iter().map(|o| at(o)).collect();
    let background = f64::from(field.background);
    let beside = |i: usize| {
        let [x, y, z] = place(i);
        let near = |v: usize, n: usize| v.saturating_sub(1)..=(v + 1).min(n - 1);
        let mut found = Vec::new();
        for z in near(z, nz) {
            for y in near(y, ny) {
                let row = near(x, nx).map(|x| all[(z * ny + y) * nx + x]);
                found.extend(row.filter(|r| r.weight > 0.0).map(|r| r.value));
            }
        }
        if found.is_empty() { 0.0 } else { found.iter().sum::<f64>() / found.len() as f64 }
    };
    (0..all.len())
        .map(|i| {
            let Reconstruction { weight, value } = all[i];
            let occupancy = weight / (weight + f64::from(field.occupancy_w0));
            let most = (0..each.len()).rev().max_by(|&a, &b| each[a][i].weight.total_cmp(&each[b][i].weight));
            Voxel {
                value: background + if weight > 0.0 { value } else { beside(i) },
                occupancy,
                object: most.unwrap_or(0),
            }
        })
        .collect()
}

/// Returns the size of the box and the voxels of twice the edge that stand for those of a box, x fastest. Each
/// has the mean O of eight voxels, their mean V weighted by O, and the object with most of O; voxel 1 along an
/// axis stands for voxels 0 and 1. V and the object are those of the first voxel where all are empty.
pub fn halved(size: [usize; 3], voxels: &[Voxel]) -> ([usize; 3], Vec<Voxel>) {
    let coarse = size.map(|n| n.div_ceil(2) + 2);
    let nothing = Voxel { occupancy: 0.0, ..voxels[0] };
    let at = |place: [usize; 3]| -> Voxel {
        let behind: Vec<&Voxel> = (0..8)
            .filter_map(|corner| {
                let fine = [0, 1, 2].map(|k| (2 * place[k] + (corner >> k & 1)).checked_sub(2));
                let [Some(x), Some(y), Some(z)] = fine else { return None };
                ([x, y, z].iter().zip(size).all(|(&v, n)| v < n))
                    .then(|| &voxels[(z * size[1] + y) * size[0] + x])
            })
            .collect();
        let whole: f64 = behind.iter().map(|v| v.occupancy).sum();
        if whole == 0.0 {
            return nothing;
        }
        let share = |object: usize| -> f64 {
            behind.iter().filter(|v| v.object == object).map(|v| v.occupancy).sum()
        };
        let most = behind.iter().map(|v| v.object).max_by(|&a, &b| share(a).total_cmp(&share(b)));
        Voxel {
            value: behind.iter().map(|v| v.occupancy * v.value).sum::<f64>() / whole,
            occupancy: whole / 8.0,
            object: most.unwrap_or(0),
        }
    };
    let [nx, ny, nz] = coarse;
    (coarse, (0..nx * ny * nz).map(|i| at([i % nx, i / nx % ny, i / (nx * ny)])).collect())
}
